"""A column of history.csv, and the readings of a run that the columns of one row share."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpdem.core.snapshot import ContactNetwork, WallLoad
from warpdem.measure.budget import Budget
from warpdem.measure.bulk import Bulk
from warpdem.measure.contact_network import read_network
from warpdem.measure.observers import Particles
from warpdem.measure.residence import Departed, read_departed
from warpdem.measure.seen_grains import SeenGrains, seen_from
from warpdem.measure.selection import selected
from warpdem.measure.totals import Totals
from warpdem.measure.wall_loads import total_loads
from warpdem.measure.wall_wear import WallWear, read_wear
from warpdem.mesh.solid import Bounded, shape_of
from warpdem.scene.measures import Region
from warpdem.state.view import RunView


@dataclass(frozen=True)
class Column:
    """One column: its name, its unit and how its number is read."""

    name: str
    """Name, such as ``kinetic``."""
    unit: str
    """Unit, such as ``J``; ``-`` for a pure number."""
    read: Callable[[Readings], float]
    """The number [unit] at the time of the readings."""
    whole: bool = False
    """Whether it reads grains or contacts one by one, and not only sums over them: over ranks all are gathered for it."""

    @property
    def header(self) -> str:
        """The column's entry in the first line of history.csv."""
        return f"{self.name} [{self.unit}]"


class Readings:
    """Quantities of a run at one time, each computed once, when the first column asks for it.

    Args:
        view: the run.
        observed: what each observer of the scene reads, by its name, shapes (n,); see ``observation.observed``.
        totals: its sums, where they have been made already.
    """

    def __init__(
        self, view: RunView, observed: Mapping[str, np.ndarray] | None = None, totals: Totals | None = None
    ) -> None:
        self.view, self._given = view, totals
        self.observed = observed or {}
        self._bulk: dict[str, Bulk] = {}

    @cached_property
    def particles(self) -> Particles:
        """The grains, by id."""
        return Particles(self.view)

    @cached_property
    def totals(self) -> Totals:
        """Sums over grains and contacts."""
        return self._given or Totals(self.view)

    @cached_property
    def energy(self) -> dict[str, float]:
        """Kinetic, rotational, elastic, potential and field energy in the laboratory [J]."""
        return self.totals.energy

    @cached_property
    def center_of_mass(self) -> np.ndarray:
        """Center of mass of all grains in the laboratory [m], shape (3,); nan without grains."""
        return self.totals.center_of_mass

    @cached_property
    def extremes(self) -> dict[str, float]:
        """Largest overlaps over radius [-] and approach speeds [m/s] so far."""
        return self.view.extremes

    @cached_property
    def wall_loads(self) -> dict[str, WallLoad]:
        """Load on each wall by its name, vectors in laboratory axes."""
        return total_loads(self.totals, lab=True)

    @cached_property
    def contacts(self) -> ContactNetwork:
        """All contacts, without their damping forces."""
        return read_network(self.view, damping=False)

    @cached_property
    def energy_budget(self) -> dict[str, float]:
        """Terms of the energy budget [J] by name."""
        return Budget(self.view, self.totals).energy()

    @cached_property
    def momentum_budget(self) -> dict[str, float]:
        """Terms of the budgets of momentum [N s] and angular momentum [N m s] by name."""
        return Budget(self.view, self.totals).momentum()

    @cached_property
    def wear(self) -> dict[str, WallWear]:
        """Wear of each wall by its name."""
        return read_wear(self.view, self.totals)

    @cached_property
    def departed(self) -> Departed:
        """The grains that have left."""
        return read_departed(self.view)

    @cached_property
    def flow(self) -> list[float]:
        """Mass [kg] and number [-] that went through each plane so far, plane after plane."""
        return Budget(self.view, self.totals).flow()

    def bulk(self, region: Region) -> Bulk:
        """The grains in a region of the scene, and their averages."""
        if region.name not in self._bulk:
            model = self.view.model
            counts = selected(region.of, model.scene, self.particles) if region.of is not None else None
            particles: Particles | SeenGrains = self.particles
            network = self.contacts
            if (carrier := model.schedule.carrier(region)) is not None:
                particles, network = seen_from(carrier, self.view, self.particles, network)
            self._bulk[region.name] = Bulk(region, particles, network, model.domain.period, counts, self._shape(region))
        return self._bulk[region.name]

    def _shape(self, region: Region) -> Bounded | None:
        """Shape of a region that is no box, loaded once in a run; None of a box or all grains."""
        if region.box is not None or not region.shape_key:
            return None
        kept, key = self.view.kept, f"region {region.name}"
        if key not in kept:
            kept[key] = shape_of(self.view.model.scene, region.shape, f"measures.regions.{region.name}.{region.shape_key}")
        shape: Bounded = kept[key]
        return shape
