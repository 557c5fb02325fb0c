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
import warp as wp

from warpdem.core.pose import FramePose
from warpdem.kernels import grain
from warpdem.kernels.clump import NONE
from warpdem.kernels.measure import readings as kernels
from warpdem.kernels.measure.readings import GRAIN_SUMS, WALL_SUMS
from warpdem.measure import elastic
from warpdem.measure.contact_columns import ContactColumns
from warpdem.measure.liquid import LiquidTotals, read_liquid
from warpdem.measure.selection import Slots, selected_flow
from warpdem.measure.sums import Reader
from warpdem.measure.surface_power import surface_powers
from warpdem.model.coefficients import field_numbers
from warpdem.scene.models import model
from warpdem.state.listed_contacts import ListedContacts
from warpdem.state.view import RunView

Thing = TypeVar("Thing")
SPRINGS = len(elastic.SPRINGS)
ABSOLUTE = kernels.Motion()


def reader_of(view: RunView) -> Reader:
    """Launches on the device of what is read of a run."""
    kept = view.kept.get("reader")
    if kept is None:
        device = view.state.record.device
        assert device is not None
        kept = view.kept["reader"] = Reader(device, view.threads)
    return kept


class Totals:
    """Sums over the grains and contacts of a run at the time of the view, vectors in laboratory axes if not said otherwise."""

    def __init__(self, view: RunView) -> None:
        self.view = view

    def made(self) -> "Totals":
        """The same, all of it made now: it may be read when the run has gone on."""
        self.view = replace(self.view, model=self.view.model.at_present())
        names = ["pose", "bodies", "_sums", "elastic", "surface_powers", "fields"]
        names += ["liquid"] if self.view.model.liquid is not None else []
        for name in names if self.view.totals is None else [*names, "added_up"]:
            getattr(self, name)
        for name in ("contacts", "listed"):  # arrays of the run, which goes on
            vars(self).pop(name, None)
        return self

    @cached_property
    def pose(self) -> FramePose:
        """The frame."""
        view = self.view
        return self._still("pose", view.model.features.frame.moves, lambda: view.model.schedule.pose(view.clock.time))

    @cached_property
    def bodies(self) -> np.ndarray:
        """Placements of the walls, shape (w, 24)."""
        view, schedule = self.view, self.view.model.schedule
        changes = schedule.moving > 0 or schedule.shifting or view.model.features.walls.conveying
        return self._still("bodies", changes, lambda: schedule.bodies(view.clock.time))

    @cached_property
    def surface_powers(self) -> dict[str, float]:
        """Power of the surface velocity of each wall that has one [W], by name."""
        return surface_powers(self.view, self.bodies) if self.view.model.features.walls.conveying else {}

    def _still(self, name: str, moves: bool, read: Callable[[], Thing]) -> Thing:
        """What ``read`` gives, once for all times if it never moves."""
        if moves:
            return read()
        if name not in self.view.kept:
            self.view.kept[name] = read()
        kept: Thing = self.view.kept[name]
        return kept

    @cached_property
    def listed(self) -> ListedContacts:
        """The contacts of the lists."""
        return self.view.contacts

    @cached_property
    def liquid(self) -> LiquidTotals:
        """Where the liquid is."""
        return read_liquid(self.view, self.listed)

    @cached_property
    def _sums(self) -> np.ndarray:
        """All sums over grains, walls and springs, in one go: each takes longer to ask for than to add up for a few grains."""
        view, reader, state = self.view, reader_of(self.view), self.view.state
        if not len(state):
            return np.zeros(self._first_spring + SPRINGS)
        sums = reader.sums(self._first_spring + SPRINGS)
        _, velocity, spin = view.reader.read()
        record, inverse = reader.plain("record", state.record), reader.plain("inverse", state.inverse)
        clumps = state.clumps
        moving = velocity, spin, self._axes, int(state.spins), reader.no_slots if clumps is None else clumps.of_grain
        reader.add(kernels.grain_sums, state.slots, record, inverse, *moving, sums)
        if clumps is not None:
            of_clumps = reader.plain("clumps", clumps.record), clumps.rate, clumps.reading
            reader.add(kernels.clump_sums, len(clumps), *of_clumps, sums)
        self._add_walls(sums, GRAIN_SUMS.width)
        if self._pairs_are_there and len(self.contacts):
            found = [values for values in elastic.elastic_energies(view, self.contacts).values() if values is not None]
            reader.add_columns(reader.uploaded("springs", *found), len(self.contacts), self._first_spring, sums)
        return reader.rounded(sums)

    def _add_walls(self, sums: wp.array, column: int) -> None:
        """Add the loads on the walls to ``sums``, from that column on."""
        view, reader, of = self.view, reader_of(self.view), self.listed.walls
        if self._walls and self.listed.row_count:
            point, result = reader.plain("point", of.point), reader.plain("result", of.result)
            points = of.grain, of.first, of.point_count, point, result, view.clock.step_number & 1
            record = reader.plain("record", view.state.record)
            reader.add(kernels.wall_sums, self.listed.row_count, record, *points, column, sums)

    @property
    def _pairs_are_there(self) -> bool:
        """Whether the view has its contacts between grains: a copy that only walls and grains are read of has none."""
        return not self.listed.contact_count or self.listed.owner is not None

    @property
    def _walls(self) -> int:
        """Walls of the scene."""
        return len(self.view.model.scene.walls)

    @property
    def _first_spring(self) -> int:
        """Column of the sums from which on elastic energies stand."""
        return GRAIN_SUMS.width + self._walls * WALL_SUMS.width

    @property
    def _axes(self) -> Any:
        """Motion that the integrator holds velocities relative to."""
        view = self.view
        if not view.model.features.backend.scheme.RELATIVE:
            return ABSOLUTE
        return kernels.Motion(*view.model.schedule.frames(view.clock.step_number, 0)[0][12:18])

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
    def contacts(self) -> ContactColumns:
        """The contacts, in the order of the lists."""
        return ContactColumns(self.view, reader_of(self.view), listed=self.listed)

    @cached_property
    def elastic(self) -> dict[str, float]:
        """Energy in the normal contacts, the tangential and the rolling springs [J]."""
        assert self._pairs_are_there  # else what they store is unknown, not zero
        names = [name for name, there in elastic.springs(self.view.model.features.contact).items() if there]
        found = self._sums[self._first_spring :].tolist()
        return dict.fromkeys(elastic.SPRINGS, 0.0) | dict(zip(names, found, strict=False))

    @cached_property
    def fields(self) -> float | None:
        """Potential energy in the external fields that have one [J]; None if none has."""
        run = self.view.model
        fields = [(model("field", name), axes) for name, axes in run.features.fields]
        if not any(hasattr(field, "energy") for field, _ in fields):
            return None
        # those that have left lie where a field may be no number
        state, reader = self.view.state, reader_of(self.view)
        here = np.flatnonzero(state.here) if len(state) < state.slots else slice(None)
        record, mass = state.record.numpy()[here], 1.0 / state.inverse.numpy()[here, 0]
        if state.clumps is not None:  # fields act on a clump as on a sphere of its volume
            alone, clumps = state.clumps.of_grain.numpy()[here] == NONE, state.clumps.record.numpy()
            there = clumps[:, 0] != grain.REMOVED_X
            record = np.concatenate([record[alone], clumps[there]])
            mass = np.concatenate([mass[alone], 1.0 / state.clumps.rate.numpy()[there, 0]])
        position, radius = record[:, :3], record[:, 3]
        place = {"laboratory": self.pose.to_laboratory(position), "frame": position}
        energies = [  # a field of the same energy everywhere may say so with one number
            np.broadcast_to(field.energy(place[axes], mass, radius, numbers), mass.shape)
            for (field, axes), numbers in zip(fields, field_numbers(run.scene), strict=True)
            if hasattr(field, "energy")
        ]
        return float(sum(float(total[0]) for total in reader.column_sums(*energies)))

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
            found = self._sums[GRAIN_SUMS.width : self._first_spring]
        elif not (self._walls and len(self.view.state)):
            found = np.zeros(self._walls * WALL_SUMS.width)
        else:  # a frame asks for these alone, and may hold no contacts between grains
            reader = reader_of(self.view)
            sums = reader.sums(self._walls * WALL_SUMS.width)
            self._add_walls(sums, 0)
            found = reader.rounded(sums)
        return found.reshape(self._walls, WALL_SUMS.width)

    # -- what the steps have added up -----------------------------------------------------------

    @cached_property
    def added_up(self) -> dict[str, np.ndarray]:
        """What the budgets have added up of the grains that are present, by name; vectors in frame axes."""
        per_grain = self.view.reader.read_sums()
        reader, state = reader_of(self.view), self.view.state
        if not len(state):
            return {name: np.zeros(values.shape[1]) for name, values in per_grain.items()}
        if "flow" in per_grain:
            per_grain = per_grain | {"flow": selected_flow(self.view.model.scene, Slots(state), per_grain["flow"])}
        record = reader.plain("record", state.record)
        return dict(zip(per_grain, reader.column_sums(*per_grain.values(), present=record), strict=True))
