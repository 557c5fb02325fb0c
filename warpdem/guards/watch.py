"""All guards of a run, when each of them looks, and what happens when one sees something.

    overlap      after every batch of steps: from the extremes that the kernels keep
    travel       at every refresh of the lists (``engine.travel``)
    not finite   at every refresh of the lists, which a grain that is no longer finite causes at once
    lists        whenever they are made
    time step    at looks, and when the deepest overlap has doubled (``guards.stability``)
    energy       at looks (``guards.energy``)
    side         at looks (``guards.sides``)

Looks come after 1000, 2000, 4000... steps, then every 10 000, and before each checkpoint of a run with files, so that the last
checkpoint is a good one. They only read. With engine.guards = "record" each guard notes what it saw first, and the run goes on.
"""

import numpy as np

from warpdem.engine.travel import TravelGuard
from warpdem.errors import StabilityError
from warpdem.guards.energy import EnergyGuard
from warpdem.guards.sides import SideGuard
from warpdem.guards.stability import StabilityGuard
from warpdem.guards.words import grain_at, instant

LOOKS = (1_000, 10_000)  # steps before the first look, and most steps between two
LIST_ENTRIES = 2**31 - 1  # what 32-bit numbers count
SHALLOW = 1.0e-3  # deepest overlap over radius up to which the time step waits for the next look [-]


class Guards:
    """Watches a simulation.

    Attributes:
        noticed: what each guard saw first, by its name; empty but with engine.guards = "record".
    """

    def __init__(self, sim) -> None:
        self.sim = sim
        self.noticed: dict[str, str] = {}
        self.travel, self.energy = TravelGuard(sim), EnergyGuard(sim)
        self.sides, self.stability = SideGuard(sim), StabilityGuard(sim)
        self._next_look = LOOKS[0]
        self._deepest = SHALLOW

    def notice(self, guard: str, message: str) -> None:
        """Stop the run, or note what a guard saw if the scene asks for that.

        Raises:
            StabilityError: with engine.guards = "stop".
        """
        if self.sim.scene.engine.guards == "stop":
            raise StabilityError(f"stopped {message}")
        self.noticed.setdefault(guard, message)

    def steps_done(self) -> None:
        """Look at what a batch of steps has made of the run.

        Raises:
            StabilityError: it cannot be trusted any more.
        """
        sim = self.sim
        deepest = self._overlap()
        if sim.step_number >= self._next_look:
            self.look()
        elif deepest > 2.0 * self._deepest:
            self._deepest = deepest
            self.stability.look()

    def look(self) -> None:
        """Look at everything now.

        Raises:
            StabilityError: the run cannot be trusted any more.
        """
        self._next_look = self.sim.step_number + min(max(self.sim.step_number, LOOKS[0]), LOOKS[1])
        if len(self.sim.state):
            self.sides.look()
            self.stability.look()
            self.energy.look()

    def _overlap(self) -> float:
        """Notice overlaps that no sound run reaches; returns the deepest met over the radius [-]."""
        sim, met = self.sim, self.sim.extremes
        limit = sim.scene.engine.max_overlap
        share = max(met["pair_overlap_share"], met["wall_overlap_share"])
        if share <= limit or "overlap" in self.noticed:
            return share
        contacts = sim.contacts()
        kind = "grains" if met["pair_overlap_share"] >= met["wall_overlap_share"] else "a grain and a wall"
        where = contacts.worst() if len(contacts.i) else "The contact is over by now."
        fastest = max(met["pair_approach_speed"], met["wall_approach_speed"])
        deepest = float(contacts.overlap.max(initial=0.0))
        remedy = "Take a smaller time.step, or a stiffer material."
        if deepest > 0.0 and fastest * max(sim.time, sim.dt) < 0.5 * deepest:
            remedy = "Nothing moved as far as that: it was so when the grain was placed. Give it, or its wall, another place."
        self.notice(
            "overlap",
            f"{instant(sim)}: {kind} overlap by {share:.3g} of the radius, "
            f"allowed is engine.max_overlap = {limit:g}. {where} Time step {sim.dt:.3g} s, stability limit "
            f"{sim.limits.stable:.3g} s at {sim.limits.max_speed:.3g} m/s; largest approach speed met "
            f"{fastest:.3g} m/s. {remedy}",
        )
        return share

    def stop_not_finite(self) -> None:
        """Name the first grain whose state is no number.

        Raises:
            StabilityError: always.
        """
        sim, record = self.sim, self.sim.state.record.numpy()
        bad = ~np.isfinite(record).all(axis=1)
        ids = np.sort(sim.state.id.numpy()[bad])
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
