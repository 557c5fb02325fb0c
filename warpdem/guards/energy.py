"""Energy created by the integration: contacts only dissipate energy, so a rise that no work explains is an error.

    E = kinetic + rotational + elastic + potential + fields       [J]

Where no wall moves in the laboratory and nothing else does work, E only falls: it may not rise over the least seen so far by
more than 5 % of the largest energy of motion and of springs so far (of its size, where contacts attract). When grains come
or leave, a new reference begins. Where walls or other things do work, only the energy budget (measures.energy) knows how
much: then what it cannot explain is compared with what went through it. A driven scene without that budget is not watched.

Grains at rest have hardly any energy of motion, and that is one of rounding. A rise counts only above

    E_0 = eps sum |E_k| + (1/2) M (eps |x| / dt)^2,   eps = 2^-52,

the rounding of the energies E_k, and the motion of all grains, of mass M, by one rounding of the farthest place x in each
step [J].
"""

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from warpdem.guards.verdict import Verdict, at_time, grain_at
from warpdem.measure import observers
from warpdem.measure.budget import Budget
from warpdem.measure.totals import Totals
from warpdem.model.model import Model
from warpdem.scene.models import model
from warpdem.state.view import RunView

SHARE = 0.05  # of the energy at hand
STORED = ("kinetic", "rotational", "elastic")


@dataclass(frozen=True)
class EnergyReference:
    """What the energy at hand is compared with: ``known`` counts grains inserted so far and grains present."""

    known: tuple[int, int] = (-1, -1)
    least: float = math.inf
    """Least energy since the grains are these [J]."""
    largest: float = 0.0
    """Most of what moves or is stored in springs, or of what went through the budget [J]."""


class EnergyGuard:
    """Watches the energy of a run."""

    NAME = "energy"

    def __init__(self, model: Model) -> None:
        self._budget = model.features.measures.energy
        self._not_watchable = driven(model) and not self._budget
        self._reference = self._next = EnergyReference()

    def look(self, view: RunView, now: Totals) -> Verdict | None:
        """What is wrong with the energy, None if it is no more than can be there."""
        if self._not_watchable:
            return None
        energy = now.energy
        stored = sum(abs(energy[name]) for name in STORED)  # contacts that attract hold a negative energy
        surplus = self._unexplained(now, stored) if self._budget else self._risen(view, now.count, sum(energy.values()), stored)
        at_hand = self._next.largest
        if surplus <= SHARE * at_hand:
            return None
        view.gather()
        p = observers.Particles(view)
        if surplus <= rounding_energy(energy.values(), p.mass, p.position, view.clock.dt):
            return None
        kinetic = p.mass * np.einsum("ij,ij->i", p.velocity_lab, p.velocity_lab)
        return Verdict(
            self.NAME,
            f"{at_time(view.clock)}: {surplus:.3g} J appeared from nowhere, more than {SHARE:.0%} of the {at_hand:.3g} J at "
            f"hand; most of it in {grain_at(view.state, int(np.argmax(kinetic)))}, at {np.sqrt(kinetic / p.mass).max():.3g} "
            f"m/s the fastest grain moves. Time step {view.clock.dt:.3g} s. Take a smaller time.step.",
        )

    def remember(self) -> None:
        """Compare later looks with the last one."""
        self._reference = self._next

    def state(self) -> dict[str, Any]:
        """What is kept between looks."""
        return asdict(self._reference)

    def restore(self, state: dict[str, Any]) -> None:
        """Take over what ``state`` gave."""
        self._reference = self._next = EnergyReference(**{**state, "known": tuple(state["known"])})

    def _risen(self, view: RunView, count: int, total: float, stored: float) -> float:
        """Rise of the energy of ``count`` grains over the least so far [J]."""
        reference = self._reference
        known = (view.state.next_id, count)
        if known != reference.known:
            reference = EnergyReference(known)
        self._next = EnergyReference(known, min(reference.least, total), max(reference.largest, stored))
        return total - self._next.least

    def _unexplained(self, now: Totals, stored: float) -> float:
        """What the budget cannot explain [J]."""
        budget = Budget(now.view, now).energy()
        through = [budget["work_walls"], budget["work_fields"], budget["carried_in"]]
        through += [value for name, value in budget.items() if name.startswith("dissipated_")]
        self._next = EnergyReference(largest=max(self._reference.largest, stored + sum(abs(x) for x in through)))
        return budget["integration_error"]


def rounding_energy(energies: Iterable[float], mass: np.ndarray, position: np.ndarray, dt: float) -> float:
    """Energy that rounding alone makes up [J].

    Args:
        energies: Energies that are added up [J].
        mass: Of the grains [kg], shape (n,).
        position: Their places in frame axes [m], shape (n, 3).
        dt: Time step [s].
    """
    eps = float(np.finfo(np.float64).eps)
    speed = eps * float(np.linalg.norm(position, axis=1).max()) / dt
    return eps * sum(abs(one) for one in energies) + 0.5 * float(mass.sum()) * speed**2


def driven(run: Model) -> bool:
    """Whether anything but gravity and the potentials of fields at rest may bring energy in, or the law itself does."""
    scene, plan = run.scene, run.features
    walls = any(
        wall.motion is not None or wall.driven or wall.dynamic is not None or wall.surface_velocity is not None
        or (wall.fixed_to == "frame" and plan.frame.moves)
        for wall in scene.walls
    )  # fmt: skip
    fields = any(
        not hasattr(model("field", name), "energy") or (axes == "frame" and plan.frame.moves) for name, axes in plan.fields
    )
    contact = plan.contact
    laws = [("normal", contact.normal), *([("tangential", contact.tangential)] if contact.tangential else [])]
    law = not all(getattr(model(role, name), "PASSIVE", False) for role, name in laws)
    # a grain that crosses the periodic border falls for ever
    pulled = any(scene.gravity) if plan.frame.moves else np.dot(np.abs(scene.gravity), plan.domain.period) > 0.0
    return walls or fields or law or bool(any(plan.domain.period) and pulled)
