"""Energy that appears from nowhere: contacts only take it, so what nothing brings in must not be there.

    E = kinetic + rotational + elastic + potential + fields       [J]

Where no wall moves in the laboratory and nothing else does work, E only falls: it may not rise over the least seen so far by
more than 5 % of the largest energy of motion and of springs so far. Grains that come or leave begin the books afresh. Where
walls or other things do work, only the energy budget (measures.energy) knows how much: then what it cannot explain is
compared with what went through it. A driven scene without that budget is not watched.
"""

import numpy as np

from warpdem.guards.words import grain_at, instant
from warpdem.measure.budget import DISSIPATED
from warpdem.scene.models import model

SHARE = 0.05  # of the energy at hand
STORED = ("kinetic", "rotational", "elastic")


class EnergyGuard:
    """Watches the energy of a simulation."""

    def __init__(self, sim) -> None:
        self.sim = sim
        self._driven = driven(sim)
        self._known = (-1, -1)
        self._least = np.inf
        self._largest = 0.0

    def look(self) -> None:
        """Compare the energy with what can be there.

        Raises:
            StabilityError: there is more.
        """
        sim = self.sim
        if self._driven and not sim.plan.energy:
            return
        energy = sim.energy()
        stored = sum(energy[name] for name in STORED)
        surplus, at_hand = self._unexplained() if sim.plan.energy else self._risen(sum(energy.values()), stored)
        if surplus <= SHARE * at_hand:
            return
        p = sim.particles
        kinetic = p.mass * np.einsum("ij,ij->i", p.velocity_lab, p.velocity_lab)
        sim.guards.notice(
            "energy",
            f"{instant(sim)}: {surplus:.3g} J appeared from nowhere, more than {SHARE:.0%} of the {at_hand:.3g} J at hand; "
            f"most of it in {grain_at(sim, int(np.argmax(kinetic)))}, at {np.sqrt(kinetic / p.mass).max():.3g} m/s the "
            f"fastest grain moves. Time step {sim.dt:.3g} s. Take a smaller time.step.",
        )

    def _risen(self, total: float, stored: float) -> tuple[float, float]:
        """Rise over the least energy so far, and the largest energy of motion and of springs so far [J]."""
        sim = self.sim
        known = (sim._next_id, len(sim.state))
        if known != self._known:
            self._known, self._least, self._largest = known, total, 0.0
        self._least, self._largest = min(self._least, total), max(self._largest, stored)
        return total - self._least, self._largest

    def _unexplained(self) -> tuple[float, float]:
        """What the budget cannot explain, and what went through it [J]."""
        budget = self.sim.budget.energy()
        through = [budget["work_walls"], budget["work_fields"], budget["carried_in"]]
        through += [budget[f"dissipated_{name}"] for name in DISSIPATED]
        self._largest = max(self._largest, sum(self.sim.energy()[name] for name in STORED) + sum(abs(x) for x in through))
        return budget["integration_error"], self._largest


def driven(sim) -> bool:
    """Whether anything but gravity and the potentials of fields at rest may bring energy in, or the law itself does."""
    scene, plan = sim.scene, sim.plan
    walls = any(wall.motion is not None or (wall.fixed_to == "frame" and plan.moving_frame) for wall in scene.walls)
    fields = any(
        not hasattr(model("field", name), "energy") or (axes == "frame" and plan.moving_frame) for name, axes in plan.fields
    )
    law = plan.normal not in ("hertz", "hooke") or plan.tangential not in (None, "mindlin")
    # a grain that comes round falls for ever
    pulled = any(scene.gravity) if plan.moving_frame else np.dot(np.abs(scene.gravity), plan.period) > 0.0
    return walls or fields or law or bool(any(plan.period) and pulled)
