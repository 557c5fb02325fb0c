"""All guards of a run, when each of them looks, and what happens when one sees something.

    overlap      the step it happens in: there a batch of steps rests (``kernels.loop``)
    not finite   the step it happens in, which makes the lists
    travel       whenever the contact list is made (``engine.travel``)
    lists        whenever they are made
    stability    at looks (``guards.stability``)
    energy       at looks (``guards.energy``)
    side         at looks (``guards.sides``)

Looks come at steps 0, 100, 200, 400 ... 6400 and every 10 000, and ``stability.CONFIRM`` steps after one that found the time
step in danger: numbers that follow from the scene alone, so the verdict on a run depends on no clock, thread, output or
resume. What a guard keeps from one look to the next is part of a checkpoint. A run with files also judges its last step, and
asks before it saves a checkpoint, without keeping anything: a state that is not sound is not saved over a good one, and
the run goes on to its next look. Guards only read. With engine.guards = "record" each notes what it saw first, and the run
goes on.
"""

import numpy as np

from warpdem.errors import StabilityError
from warpdem.guards.energy import EnergyGuard
from warpdem.guards.messages import grain_at, instant
from warpdem.guards.sides import SideGuard
from warpdem.guards.stability import CONFIRM, StabilityGuard
from warpdem.guards.travel import TravelGuard

LOOKS = (100, 10_000)  # step of the first look after the start, and steps between two later on
LIST_ENTRIES = 2**31 - 1  # what 32-bit numbers count


def look_after(step: int) -> int:
    """The first step after ``step`` at which all runs are looked at."""
    first, most = LOOKS
    due = first
    while due <= step and due < most:
        due *= 2
    return due if due < most else (step // most + 1) * most


class Guards:
    """Watches a simulation.

    Attributes:
        noticed: what each guard saw first, by its name; empty but with engine.guards = "record".
        next_look: step of the next look.
    """

    def __init__(self, sim) -> None:
        self.sim = sim
        self.noticed: dict[str, str] = {}
        self.travel, self.energy = TravelGuard(sim), EnergyGuard(sim)
        self.sides, self.stability = SideGuard(sim), StabilityGuard(sim)
        self._looking = {"side": self.sides, "stability": self.stability, "energy": self.energy}
        self.next_look = sim.step_number

    def notice(self, guard: str, message: str) -> None:
        """Stop the run, or note what a guard saw if the scene asks for that.

        Raises:
            StabilityError: with engine.guards = "stop".
        """
        if self.sim.scene.engine.guards == "stop":
            raise StabilityError(f"stopped {message}")
        self.noticed.setdefault(guard, message)

    def steps_done(self) -> None:
        """Look at what a batch of steps has made of the run: overlaps always, all else at the step of a look.

        Raises:
            StabilityError: it cannot be trusted any more.
        """
        self._overlap()
        if self.sim.step_number >= self.next_look:
            self.look()

    def look(self) -> None:
        """Look at everything now, and keep what the next look compares with.

        Raises:
            StabilityError: the run cannot be trusted any more.
        """
        self.judge()
        for guard in self._looking.values():
            guard.remember()
        self.next_look = look_after(self.sim.step_number)
        if self.stability.in_danger and "stability" not in self.noticed:
            self.next_look = min(self.next_look, self.sim.step_number + CONFIRM)

    def judge(self) -> None:
        """Look at everything now and keep nothing, so that later looks say what they would have said.

        Raises:
            StabilityError: the run cannot be trusted any more.
        """
        for name, message in self._verdicts().items():
            self.notice(name, message)

    def is_sound(self) -> bool:
        """Whether a look now would let the run go on."""
        return self.sim.scene.engine.guards == "record" or not self._verdicts()

    def _verdicts(self) -> dict[str, str]:
        """What is wrong now, by guard."""
        if not len(self.sim.state):
            return {}
        found = {name: guard.look() for name, guard in self._looking.items()}
        return {name: message for name, message in found.items() if message}

    # -- checkpoint -----------------------------------------------------------------------------

    def state(self) -> dict:
        """What the guards keep between looks besides ``arrays``, fit for JSON."""
        return {"next_look": self.next_look, "energy": self.energy.state(), "stability": self.stability.state()}

    def arrays(self) -> dict[str, np.ndarray]:
        """What the guards keep of each grain."""
        return self.sides.arrays()

    def restore(self, data: dict) -> None:
        """Take over ``state``, under "guards", and ``arrays`` of a checkpoint; one of an older version has none."""
        if "guards" not in data:
            self.next_look = look_after(self.sim.step_number)
            return
        state = data["guards"]
        self.next_look = state["next_look"]
        self.energy.restore(state["energy"])
        self.stability.restore(state["stability"])
        self.sides.restore(data)

    # -- what needs no look ---------------------------------------------------------------------

    def _overlap(self) -> None:
        """Notice overlaps that no sound run reaches."""
        sim, met = self.sim, self.sim.extremes
        limit = sim.scene.engine.max_overlap
        share = max(met["pair_overlap_share"], met["wall_overlap_share"])
        if share <= limit or "overlap" in self.noticed:
            return
        sim.engine.ignore_overlaps()
        contacts = sim.contacts()
        kind = "grains" if met["pair_overlap_share"] >= met["wall_overlap_share"] else "a grain and a wall"
        where = contacts.worst() if len(contacts.i) else "The contact is over by now."
        over = self.stability.excess
        fastest = max(met["pair_approach_speed"], met["wall_approach_speed"])
        deepest = float(contacts.overlap.max(initial=0.0))
        remedy = "Take a smaller time.step, or a stiffer material."
        if deepest > 0.0 and fastest * max(sim.time, sim.dt) < 0.5 * deepest:
            remedy = "Nothing moved as far as that: it was so when the grain was placed. Give it, or its wall, another place."
        self.notice(
            "overlap",
            f"{instant(sim)}: {kind} overlap by {share:.3g} of the radius, "
            f"allowed is engine.max_overlap = {limit:g}. {where} Time step {sim.dt:.3g} s, "
            f"{over + '; ' if over else ''}stability limit of an impact "
            f"{sim.limits.stable:.3g} s at {sim.limits.max_speed:.3g} m/s; largest approach speed met "
            f"{fastest:.3g} m/s. {remedy}",
        )

    def stop_not_finite(self) -> None:
        """Name the first grain whose state is no number.

        Raises:
            StabilityError: always.
        """
        sim = self.sim
        bad = ~np.isfinite(sim.state.record.numpy()[sim.state.rank]).all(axis=1)
        ids = sim.state.ids[bad]
        raise StabilityError(
            f"stopped {instant(sim)}: the state of grain {ids[0]} is not finite "
            f"({len(ids)} of {len(bad)} grains). Largest approach speed met before: "
            f"{max(sim.extremes['pair_approach_speed'], sim.extremes['wall_approach_speed']):.3g} m/s; "
            f"time step {sim.dt:.3g} s. Take a smaller time.step."
        )

    def lists_fit(self, entries: int, count) -> None:
        """Stop when a list would have more than LIST_ENTRIES, which only grains that lie within each other bring about.

        Args:
            entries: length of the list.
            count: neighbours or wall features of each grain, a device array of shape (n,) in memory order.

        Raises:
            StabilityError: it does not fit.
        """
        if entries <= LIST_ENTRIES:
            return
        sim, most = self.sim, int(np.argmax(count.numpy()))
        row = int(np.flatnonzero(sim.state.rank == most)[0])
        raise StabilityError(
            f"stopped {instant(sim)}: the lists need {entries} entries, more than {LIST_ENTRIES}: "
            f"{grain_at(sim, row)} has {int(count.numpy()[most])} neighbours. Take a smaller time.step, or fewer grains."
        )
