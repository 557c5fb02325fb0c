"""The part of a run that one process holds: what its grains and contacts add to the sums of the whole.

A run of one process is one part. Sums are whole numbers (``kernels.measure.exact_sum``, ``kernels.measure.window_sum``) which
add up to the same for any parts; what they add up to is rounded once, in ``totals``. A contact between grains of two processes
is in the lists of both, and counts where the grain of the lower id belongs to.
"""

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
import warp as wp

from warpdem.core.pose import FramePose
from warpdem.kernels import grain
from warpdem.kernels.clump import NONE
from warpdem.kernels.measure import readings as kernels
from warpdem.kernels.measure.exact_sum import WIDTH
from warpdem.kernels.measure.readings import GRAIN_SUMS, WALL_SUMS
from warpdem.measure import elastic
from warpdem.measure.contact_columns import ContactColumns
from warpdem.measure.selection import Slots, selected_flow
from warpdem.measure.sums import reader_of
from warpdem.model.coefficients import field_numbers
from warpdem.model.model import Model
from warpdem.scene.models import model
from warpdem.state.listed_contacts import ListedContacts
from warpdem.state.view import RunView

Each = Callable[[Callable[["Part"], Any]], list[Any]]
"""Calls something with the part of each process, and returns what it gave (``Totals.each``)."""
SPRINGS = len(elastic.SPRINGS)
ABSOLUTE = kernels.Motion()


def wall_columns(run: Model) -> int:
    """Columns of ``Part.wall_sums``: ``WALL_SUMS`` of each wall of the scene."""
    return len(run.scene.walls) * WALL_SUMS.width


def first_spring(run: Model) -> int:
    """Column of ``Part.sums`` from which on elastic energies stand."""
    return GRAIN_SUMS.width + wall_columns(run)


class Part:
    """The part of a run that one process holds, at the time of a view.

    Args:
        view: the process's grains, those of other processes behind them, its contacts, and the time of the run.

    Attributes:
        reader: launches on its device.
    """

    def __init__(self, view: RunView) -> None:
        self.view, self.reader = view, reader_of(view)

    @cached_property
    def pose(self) -> FramePose:
        """The frame."""
        view = self.view
        return view.still("pose", view.model.features.frame.moves, lambda: view.model.schedule.pose(view.clock.time))

    @cached_property
    def bodies(self) -> np.ndarray:
        """Placements of the walls, shape (w, 24)."""
        view, schedule = self.view, self.view.model.schedule
        changes = schedule.moving > 0 or schedule.shifting or view.model.features.walls.conveying
        return view.still("bodies", changes, lambda: schedule.bodies(view.clock.time))

    @cached_property
    def listed(self) -> ListedContacts:
        """The contacts of the lists."""
        return self.view.contacts

    @cached_property
    def contacts(self) -> ContactColumns:
        """The contacts, in the order of the lists; those with grains of other processes too."""
        return ContactColumns(self.view, self.reader, listed=self.listed)

    @property
    def has_pairs(self) -> bool:
        """Whether the view has its contacts between grains: a copy that only walls and grains are read of has none."""
        return not self.listed.contact_count or self.listed.owner is not None

    # -- what adds up ---------------------------------------------------------------------------

    def count(self) -> int:
        """Grains that are there."""
        return self.view.state.owned_count

    def sums(self) -> np.ndarray:
        """``digits`` over grains, walls and springs, in one go: asking takes longer than adding up a few grains."""
        view, reader, state = self.view, self.reader, self.view.state
        columns, springs = first_spring(view.model) + SPRINGS, first_spring(view.model)
        if not len(state):
            return nothing(columns)
        sums = reader.sums(columns)
        _, velocity, spin = view.reader.read()
        record, inverse = reader.plain("record", state.record), reader.plain("inverse", state.inverse)
        clumps = state.clumps
        moving = velocity, spin, self._axes, int(state.spins), reader.no_slots if clumps is None else clumps.of_grain
        reader.add(kernels.grain_sums, state.owned, record, inverse, *moving, sums)
        if clumps is not None:
            of_clumps = reader.plain("clumps", clumps.record), clumps.rate, clumps.reading
            reader.add(kernels.clump_sums, len(clumps), *of_clumps, sums)
        self._add_walls(sums, GRAIN_SUMS.width)
        if self.has_pairs and len(self.contacts):
            found = [values for values in elastic.elastic_energies(view, self.contacts).values() if values is not None]
            found = found if (counted := self.contacts.counted) is None else [values[counted] for values in found]
            reader.add_columns(reader.uploaded("springs", *found), len(found[0]), springs, sums)
        return reader.digits(sums)

    def wall_sums(self) -> np.ndarray:
        """``digits`` over the walls alone: a frame asks for these, and may hold no contacts between grains."""
        columns = wall_columns(self.view.model)
        if not (columns and len(self.view.state)):
            return nothing(columns)
        sums = self.reader.sums(columns)
        self._add_walls(sums, 0)
        return self.reader.digits(sums)

    def field_energies(self) -> np.ndarray:
        """``digits`` of the potential energy in each external field that has one."""
        run = self.view.model
        fields = [(model("field", name), axes) for name, axes in run.features.fields]
        # those that have left lie where a field may be no number
        state, reader = self.view.state, self.reader
        here = np.flatnonzero(state.here[: state.owned]) if len(state) < state.slots else slice(0, state.owned)
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
        return reader.column_digits(*energies)

    def added_up(self) -> np.ndarray:
        """``digits`` of what the budgets have added up of the grains that are there, as of ``MeasureFeatures.sums``."""
        state, reader = self.view.state, self.reader
        per_grain = self.view.reader.read_sums()
        if not len(state):
            return nothing(sum(values.shape[1] for values in per_grain.values()))
        if "flow" in per_grain:
            per_grain = per_grain | {"flow": selected_flow(self.view.model.scene, Slots(state), per_grain["flow"])}
        own = [values[: state.owned] for values in per_grain.values()]
        return reader.column_digits(*own, present=reader.plain("record", state.record))

    def losses(self) -> np.ndarray:
        """What contacts between grains have lost up to the present time, as of ``StepReader.read_losses``."""
        return self.view.reader.read_losses()

    def wear(self) -> np.ndarray:
        """What has worn walls up to the last kick, as of ``StepReader.digits``."""
        return self.view.reader.digits["wear"]

    def _add_walls(self, sums: wp.array, column: int) -> None:
        """Add the loads on the walls to ``sums``, from that column on."""
        view, reader, of = self.view, self.reader, self.listed.walls
        if view.model.scene.walls and self.listed.row_count:
            point, result = reader.plain("point", of.point), reader.plain("result", of.result)
            points = of.grain, of.first, of.point_count, point, result, view.clock.step_number & 1
            record = reader.plain("record", view.state.record)
            reader.add(kernels.wall_sums, self.listed.row_count, record, *points, column, sums)

    @property
    def _axes(self) -> Any:
        """Motion that the integrator holds velocities relative to."""
        view = self.view
        if not view.model.features.backend.scheme.RELATIVE:
            return ABSOLUTE
        return kernels.Motion(*view.model.schedule.frames(view.clock.step_number, 0)[0][12:18])


def nothing(columns: int) -> np.ndarray:
    """``digits`` of sums to which nothing was added."""
    return np.zeros((columns, WIDTH), dtype=np.int64)
