"""Sums over all grains and contacts of a run at one time, each made when it is asked for.

    T = sum (1/2) m V^2,   R = sum (1/2) I W^2,   P = sum m V,   L = sum (m x x V + I W),   M x_c = sum m x
    F_w = -sum F,   T_w = -sum ((x - p) x F + M),   P_w = sum (F . v + M . w),   v = u + w x x

They are exact and rounded once (``kernels.measure.exact_sum``): the same bits for any order in memory and number of threads.
Sums are taken in frame axes about the frame's origin; what is rotated and shifted from there is the few numbers that come out.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from typing import Any, TypeVar

import numpy as np

from warpdem.core.pose import FramePose
from warpdem.kernels.measure import window_sum
from warpdem.kernels.measure.readings import GRAIN_SUMS, WALL_SUMS
from warpdem.kernels.measure.wear import SUMS
from warpdem.measure import elastic
from warpdem.measure.liquid import LiquidTotals, read_liquid
from warpdem.measure.part import Part, first_spring
from warpdem.measure.sums import reader_of
from warpdem.measure.surface_power import surface_powers
from warpdem.scene.models import model
from warpdem.state.view import RunView

Thing = TypeVar("Thing")


class Totals:
    """Sums over the grains and contacts of a run at the time of the view, vectors in laboratory axes if not said otherwise.

    Over several processes each adds up its own part (``part``), and no grain goes to another one.

    Attributes:
        part: the part of this process.
    """

    def __init__(self, view: RunView) -> None:
        self.view, self.part = view, Part(view)

    def made(self) -> "Totals":
        """The same, all of it made now: it may be read when the run has gone on."""
        names = ["pose", "bodies", "count", "_sums", "elastic", "surface_powers", "fields"]
        names += ["liquid"] if self.view.model.liquid is not None else []
        measures = self.view.model.features.measures
        asked = {"worn": measures.wear, "losses": measures.energy, "added_up": self.view.totals is not None}
        names += [name for name, there in asked.items() if there]
        for name in names:
            getattr(self, name)
        self.view = replace(self.view, model=self.view.model.at_present())
        self.part = Part(self.view)  # the one before has arrays of the run, which goes on
        return self

    def each(self, read: Callable[[Part], Thing]) -> list[Thing]:
        """What ``read`` gives of the part of each process."""
        parts = self.view.parts
        return [read(self.part)] if parts is None or parts.all_here else parts.each(read)

    def _rounded(self, read: Callable[[Part], np.ndarray]) -> np.ndarray:
        """The sums of whose digits ``read`` gives those of a part."""
        return reader_of(self.view).rounded(self.each(read))

    @cached_property
    def pose(self) -> FramePose:
        """The frame."""
        return self.part.pose

    @cached_property
    def bodies(self) -> np.ndarray:
        """Placements of the walls, shape (w, 24)."""
        return self.part.bodies

    @cached_property
    def surface_powers(self) -> dict[str, float]:
        """Power of the surface velocity of each wall that has one [W], by name."""
        return surface_powers(self.each, self.view.model, self.bodies) if self.view.model.features.walls.conveying else {}

    @cached_property
    def liquid(self) -> LiquidTotals:
        """Where the liquid is."""
        return read_liquid(self.each, self.view)

    @cached_property
    def count(self) -> int:
        """Number of grains."""
        return sum(self.each(Part.count))

    @cached_property
    def _sums(self) -> np.ndarray:
        """All sums over grains, walls and springs."""
        return self._rounded(Part.sums)

    # -- grains ---------------------------------------------------------------------------------

    @cached_property
    def grains(self) -> dict[str, Any]:
        """``GRAIN_SUMS`` by name, vectors in frame axes."""
        return {name: self._sums[GRAIN_SUMS.of(name)] for name in GRAIN_SUMS.names}

    @property
    def mass(self) -> float:
        """Mass of all grains [kg]."""
        return float(self.grains["mass"])

    @cached_property
    def moment(self) -> np.ndarray:
        """Sum m x [kg m], shape (3,)."""
        return self.pose.rotation @ self.grains["moment"] + self.mass * self.pose.translation

    @property
    def center_of_mass(self) -> np.ndarray:
        """Center of mass of all grains [m], shape (3,); nan without grains."""
        return self.moment / self.mass if self.mass > 0.0 else np.full(3, np.nan)

    @property
    def momentum(self) -> np.ndarray:
        """P, then L about the laboratory's origin, shape (6,)."""
        linear = self.pose.rotation @ self.grains["momentum"]
        angular = self.pose.rotation @ self.grains["angular_momentum"] + np.cross(self.pose.translation, linear)
        return np.concatenate([linear, angular])

    @property
    def along_frame(self) -> float:
        """Sum (m V . v_frame + I W . w_frame) [J]."""
        pose = self.pose
        return float(self.grains["momentum"] @ pose.velocity + self.grains["angular_momentum"] @ pose.spin)

    # -- energies -------------------------------------------------------------------------------

    @cached_property
    def elastic(self) -> dict[str, float]:
        """Energy in the normal contacts, the tangential and the rolling springs [J]."""
        assert self.view.parts is not None or self.part.has_pairs  # else what they store is unknown, not zero
        names = [name for name, there in elastic.springs(self.view.model.features.contact).items() if there]
        found = self._sums[first_spring(self.view.model) :].tolist()
        return dict.fromkeys(elastic.SPRINGS, 0.0) | dict(zip(names, found, strict=False))

    @cached_property
    def fields(self) -> float | None:
        """Potential energy in the external fields that have one [J]; None if none has."""
        if not any(hasattr(model("field", name), "energy") for name, _ in self.view.model.features.fields):
            return None
        return float(sum(self._rounded(Part.field_energies).tolist()))

    @cached_property
    def energy(self) -> dict[str, float]:
        """Kinetic, rotational, elastic and potential energy [J]; and that in fields where one has a potential."""
        out = {
            "kinetic": float(self.grains["kinetic"]),
            "rotational": float(self.grains["rotational"]),
            "elastic": sum(self.elastic.values()),
            "potential": float(-(self.moment @ np.array(self.view.model.scene.gravity, dtype=float))),
        }
        return out if self.fields is None else out | {"fields": self.fields}

    # -- walls ----------------------------------------------------------------------------------

    @cached_property
    def walls(self) -> np.ndarray:
        """``WALL_SUMS`` of each wall of the scene, in frame axes, shape (w, 9)."""
        if "_sums" in vars(self):
            found = self._sums[GRAIN_SUMS.width : first_spring(self.view.model)]
        else:  # a frame asks for these alone
            found = self._rounded(Part.wall_sums)
        return found.reshape(-1, WALL_SUMS.width)

    # -- what the steps have added up -----------------------------------------------------------

    @cached_property
    def added_up(self) -> dict[str, np.ndarray]:
        """What the budgets have added up of the grains that are present, by name; vectors in frame axes."""
        sums = self.view.model.features.measures.sums
        found = np.split(self._rounded(Part.added_up), np.cumsum([*sums.values()])[:-1])
        return dict(zip(sums, found, strict=True))

    @cached_property
    def losses(self) -> np.ndarray:
        """What contacts between grains have lost up to the present time, as of ``MeasureFeatures.of_contacts`` [J]."""
        return window_sum.rounded(np.concatenate(self.each(Part.losses)))

    @cached_property
    def worn(self) -> np.ndarray:
        """What has worn walls up to the last kick, columns as of ``kernels.measure.wear.SUMS``, shape (features, 5)."""
        return window_sum.rounded(np.stack(self.each(Part.wear))).reshape(-1, SUMS.width)
