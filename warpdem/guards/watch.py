"""All guards of a run, when each of them looks, and what happens when one returns a verdict.

    overlap      the step it happens in: there a batch of steps ends (``kernels.step.loop``)
    travel       when a list check finds a grain that is fast beside a mesh, before the lists are built (``guards.travel``)
    stability    at looks (``guards.stability``)
    energy       at looks (``guards.energy``)
    side         at looks (``guards.sides``)

States that are not finite, lists that are too long and grains beyond a border that stops a run end it within the engine.

Looks come at steps 0, 100, 200, 400 ... 6400 and every 10 000, and ``stability.CONFIRM`` steps after one that found the time
step in danger: numbers that follow from the scene alone, so the verdict on a run depends on no clock, thread, output or
resume. What a guard keeps from one look to the next is part of a checkpoint. A run with files also judges its last step, and
asks before it saves a checkpoint, without keeping anything: a state that is not sound is not saved over a good one, and
the run goes on to its next look. Guards only read. With engine.guards = "record" each notes what it saw first, and the run
goes on.

A look begins with sums and largest values, which each process of a run gives of its own grains and contacts. All grains are
gathered (``RunView.gather``) where these alone leave a verdict open, and at each look where walls are closed meshes or free.
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from warpdem.core.log import log
from warpdem.errors import StabilityError
from warpdem.guards.energy import EnergyGuard
from warpdem.guards.overlap import OverlapGuard
from warpdem.guards.sides import SideGuard
from warpdem.guards.stability import CONFIRM, StabilityGuard
from warpdem.guards.travel import TravelGuard
from warpdem.guards.verdict import Verdict
from warpdem.measure.totals import Totals
from warpdem.state.view import RunView

LOOKS = (100, 10_000)  # step of the first look after the start, and steps between two later on


def look_after(step: int) -> int:
    """The first step after ``step`` at which all runs are looked at."""
    first, interval = LOOKS
    look = first
    while look <= step and look < interval:
        look *= 2
    return look if look < interval else (step // interval + 1) * interval


class Guards:
    """All guards of a run, and who acts on their verdicts: a run is stopped, or goes on with the verdict noticed.

    Args:
        view: the run.
        evaluate: evaluates the forces of the present time if they are not.
        ignore_overlaps: lets batches of steps go on whatever the overlaps.

    Attributes:
        noticed: what each guard saw first, by its name; empty but with engine.guards = "record".
        next_look: step of the next look.
    """

    def __init__(self, view: RunView, evaluate: Callable[[], None], ignore_overlaps: Callable[[], None]) -> None:
        self.view, self._evaluate, self._ignore_overlaps = view, evaluate, ignore_overlaps
        self._stops = view.model.scene.engine.guards == "stop"
        self.noticed: dict[str, str] = {}
        self.travel, self.overlap, self.energy = TravelGuard(view.model), OverlapGuard(view.model), EnergyGuard(view.model)
        self.sides, self.stability = SideGuard(view), StabilityGuard()
        self._looking = (self.sides, self.stability, self.energy)
        self._kept = (self.energy, self.stability)  # by checkpoints, besides the arrays of ``sides``
        self.next_look = view.clock.step_number

    def notice(self, verdict: Verdict) -> None:
        """Stop the run, or note what a guard saw if the scene asks for that.

        Raises:
            StabilityError: with engine.guards = "stop".
        """
        if self._stops:
            raise StabilityError(f"stopped {verdict.message}")
        if verdict.guard not in self.noticed:
            log.warning("%s: %s", verdict.guard, verdict.message)
        self.noticed.setdefault(verdict.guard, verdict.message)

    def steps_done(self) -> None:
        """Look at what a batch of steps has made of the run: overlaps always, all else at the step of a look.

        Raises:
            StabilityError: it cannot be trusted any more.
        """
        self._check_overlap()
        if self.view.clock.step_number >= self.next_look:
            self.look()

    def check_travel(self, record: np.ndarray, placements: np.ndarray) -> None:
        """Look at the travel of the grains beside meshes, when one was found fast; arguments as of ``TravelGuard.look``.

        Raises:
            StabilityError: a grain went further in the last step than the walls allow.
        """
        for verdict in self.travel.look(record, placements, self.view.state, self.view.clock):
            self.notice(verdict)

    def look(self) -> None:
        """Look at everything now, and keep what the next look compares with.

        Raises:
            StabilityError: the run cannot be trusted any more.
        """
        self.judge()
        for guard in self._looking:
            guard.remember()
        self.next_look = look_after(self.view.clock.step_number)
        if self.stability.in_danger and self.stability.NAME not in self.noticed:
            self.next_look = min(self.next_look, self.view.clock.step_number + CONFIRM)

    def judge(self) -> None:
        """Look at everything now and keep nothing, so that later looks find what they would have found.

        Raises:
            StabilityError: the run cannot be trusted any more.
        """
        for verdict in self._verdicts():
            self.notice(verdict)

    def is_sound(self) -> bool:
        """Whether a look now would let the run go on."""
        return not self._stops or not self._verdicts()

    def _verdicts(self) -> list[Verdict]:
        """What is wrong now."""
        if not Totals(self.view).count:
            return []
        self._evaluate()
        now = Totals(self.view)
        found = [guard.look(self.view, now) for guard in self._looking]
        return [verdict for verdict in found if verdict is not None]

    def _check_overlap(self) -> None:
        """Notice overlaps that no sound run reaches."""
        met = self.view.extremes
        if self.overlap.NAME in self.noticed or not self.overlap.is_exceeded(met):
            return
        self._ignore_overlaps()
        self._evaluate()
        self.view.gather()
        self.notice(self.overlap.look(self.view, met, self.stability.excess))

    # -- checkpoint -----------------------------------------------------------------------------

    def state(self) -> dict[str, Any]:
        """What the guards keep between looks besides ``arrays``, fit for JSON."""
        return {"next_look": self.next_look, **{guard.NAME: guard.state() for guard in self._kept}}

    def arrays(self) -> dict[str, np.ndarray]:
        """What the guards keep of each grain."""
        return self.sides.arrays()

    def restore(self, data: Mapping[str, Any]) -> None:
        """Take over ``state``, under "guards", and ``arrays`` of a checkpoint.

        What a checkpoint of an older version lacks counts as nothing kept: that guard starts without a reference.
        """
        state = data.get("guards", {})
        self.next_look = state.get("next_look", look_after(self.view.clock.step_number))
        for guard in self._kept:
            if guard.NAME in state:
                guard.restore(state[guard.NAME])
        if data.keys() >= self.sides.arrays().keys():
            self.sides.restore(data)
