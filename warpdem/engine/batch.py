"""What a batch of steps needs on the device besides state and lists: schedule, clock, extremes, scratch."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from warpdem.core.timers import Timers
from warpdem.kernels.field import Numbers
from warpdem.kernels.lists import numbering
from warpdem.kernels.lists.displacement import Watched
from warpdem.kernels.measure import wear, window_sum
from warpdem.kernels.measure.exact_sum import WIDTH
from warpdem.kernels.measure.flow import Plane
from warpdem.kernels.step import barrier
from warpdem.kernels.step import clock as clock_slots
from warpdem.kernels.step.dynamic_walls import STATE, SUMS, DynamicWalls
from warpdem.kernels.step.free_bodies import MOTION
from warpdem.kernels.step.schedule import FrameRow, Placement, Row
from warpdem.kernels.step.structs import SPAN, Control, Report
from warpdem.kernels.wall.surface import Surface
from warpdem.model.coefficients import field_numbers
from warpdem.model.dynamic_walls import mobilities
from warpdem.model.model import Model
from warpdem.model.travel import max_travel
from warpdem.scene.wear import Finnie
from warpdem.state.clock import Clock

LOSS_ROWS = 256  # rows of the sums of losses on a GPU, so that few threads meet in the same number


@dataclass(frozen=True)
class Scratch:
    """Arrays that lists are numbered with; allocated before a graph is captured, whose branches may not allocate."""

    nothing: wp.array
    """Stands for what is not asked for."""
    sums: wp.array
    """Of each block of grains."""
    start: wp.array
    """(n + 1,) of the rows of an outer list that a graph builds."""
    allowance: wp.array
    """(n,) of the grains in such a list."""
    entries: wp.array
    """(3,), [1]: neighbors in an outer list."""
    slots: wp.array
    """(3,), [1]: slots beside walls."""
    met: wp.array
    """(n, 0): the counting pass stores no wall features."""

    @classmethod
    def of(cls, n: int, device: wp.Device) -> "Scratch":
        """Scratch for ``n`` grains."""
        nothing, start, entries, slots = (wp.zeros(size, dtype=wp.int32, device=device) for size in (0, n + 1, 3, 3))
        sums = wp.zeros(-(-n // numbering.BLOCK), dtype=numbering.Sums, device=device)
        allowance = wp.zeros(n, dtype=wp.float64, device=device)
        return cls(nothing, sums, start, allowance, entries, slots, wp.zeros((n, 0), dtype=wp.int32, device=device))


class Batch:
    """Device arrays that steps share.

    Args:
        model: what is run.
        clock: where the run is in time.
        timers: add up the time of the schedule.
        threads: largest number of threads that step side by side.
        steps_ahead: steps whose schedule is written to the device at once, asked for each time.

    Attributes:
        control, report, model: structs of ``kernels.step.structs``: what steps read of the host, what they hand back, and what
            is the same in all of them.
        clock: conditions and counters, ``kernels.step.clock``.
        placements: of the wall motions at present, shape (motions,).
        watched: mesh walls beside which the travel per step is bounded.
        stages: force calls per step.
    """

    def __init__(self, model: Model, clock: Clock, timers: Timers, threads: int, steps_ahead: Callable[[], int]) -> None:
        self._model, self._now, self._timers, self._steps_ahead = model, clock, timers, steps_ahead
        device, scene = model.device, model.scene
        self.stages = len(model.features.backend.scheme.STAGES)
        control, report = self.control, self.report = Control(), Report()
        self.model = model_struct(model)
        control.thread_ranges = wp.zeros((threads, 8), dtype=wp.int32, device=device)
        report.moved = wp.zeros(threads * SPAN, dtype=wp.int32, device=device)
        report.extreme = wp.zeros(threads * SPAN, dtype=wp.float64, device=device)
        control.max_overlap = wp.array([scene.engine.max_overlap], dtype=wp.float64, device=device)
        control.field = wp.array(field_numbers(scene), dtype=Numbers, device=device)
        control.outlet = model.exits.on_device(device)
        # what leaves is put out of the domain by the step itself, unless it stops the run or a budget asks for its state
        removes_in_step = [not (stops or model.features.measures.sums) for stops in model.domain.stops]
        control.removes_in_step = wp.array(np.array(removes_in_step, dtype=np.int32), dtype=wp.int32, device=device)
        report.removed = wp.zeros(1, dtype=wp.int32, device=device)
        planes = [(*p.point, *p.normal, p.radius or np.inf, p.fixed_to == "laboratory") for p in scene.measures.flow]
        control.plane = wp.array(np.array(planes, dtype=float).reshape(-1, 8), dtype=Plane, device=device)
        if model.features.measures.wear:
            assert model.walls is not None and scene.measures.wear is not None
            sums = len(model.walls.wall_of) * wear.SUMS.width
            report.wear = wp.zeros((threads, sums, window_sum.WIDTH), dtype=wp.int64, device=device)
            first = round(scene.measures.wear.start / model.dt)
            control.wear_from = wp.array([first], dtype=wp.int32, device=device)
            law = scene.measures.wear.finnie or Finnie(pressure=1.0)
            control.cutting = wp.array([law.force_ratio], dtype=wp.float64, device=device)
        if model.features.measures.energy:
            rows = LOSS_ROWS if device.is_cuda else threads
            losses = len(model.features.measures.of_contacts)
            report.losses = wp.zeros((rows, losses, window_sum.WIDTH), dtype=wp.int64, device=device)
        control.origin = wp.zeros(1, dtype=wp.int32, device=device)
        report.done = wp.zeros(1, dtype=wp.int32, device=device)
        report.taken = wp.zeros(threads * SPAN, dtype=wp.int32, device=device)
        report.arrivals = wp.zeros(barrier.LENGTH, dtype=wp.int32, device=device)
        control.wait_modes = wp.array(barrier.wait_modes(), dtype=wp.uint64, device=device)
        self.clock = wp.zeros(clock_slots.SLOTS, dtype=wp.int32, device=device)
        self.placements = wp.zeros(max(len(model.schedule.motions), 1), dtype=Placement, device=device)
        self.watched = watched_meshes(model)
        if model.schedule.dynamic:
            control.dynamic = dynamic_walls(model, threads)
        self._scratch: Scratch | None = None
        self._block: tuple[int, int] | None = None  # first step and number of steps of the schedule on the device

    def scratch(self, n: int) -> Scratch:
        """Scratch for lists of ``n`` grains."""
        if self._scratch is None or self._scratch.start.shape[0] != n + 1:
            self._scratch = Scratch.of(n, self._model.device)
        return self._scratch

    # -- schedule -------------------------------------------------------------------------------

    def forget_schedule(self) -> None:
        """Write the schedule to the device again at its next use: the clock was set."""
        self._block = None

    def row(self) -> tuple[int, int]:
        """Row of the present step in the schedule on the device, and how many steps may follow."""
        first, schedule = self._now.step_number, self._model.schedule
        if self._block is None or not self._block[0] <= first < self._block[0] + self._block[1]:
            with self._timers.measure("schedule"):
                ahead = self._steps_ahead()
                self._write("row", schedule.rows(first, ahead), Row)
                if self._model.features.frame_rows:
                    self._write("frame", schedule.frames(first, ahead), FrameRow)
                self._placements = schedule.placements(first, ahead)
                if schedule.dynamic:
                    self._write_dynamic(first, ahead)
                self._write("placement", self._placements, Placement)
                self._block = (first, ahead)
                self.control.origin.assign(np.array([first], dtype=np.int32))
        base = first - self._block[0]
        return base, self._block[1] - base

    def _write(self, name: str, table: np.ndarray, dtype: type) -> None:
        """Put a table of the schedule where the kernels find it, each time at the same place."""
        there = getattr(self.control, name)
        if there is not None and len(there) == len(table) and there.size:
            there.assign(table)
        else:
            setattr(self.control, name, wp.array(table, dtype=dtype, device=self._model.device))

    def _write_dynamic(self, first: int, ahead: int) -> None:
        """Write state and drive of the dynamic walls."""
        schedule, there = self._model.schedule, self.control.dynamic
        there.state.assign(np.stack([wall.state for wall in schedule.dynamic]))
        there.motions.assign(np.stack([wall.motion for wall in schedule.dynamic]))
        if len(there.mobility):
            there.mobility.assign(mobilities(schedule))
        drives = schedule.drives(first, ahead)
        if len(there.drive) == len(drives):
            there.drive.assign(drives)
        else:
            there.drive = wp.array(drives, dtype=wp.float64, device=self._model.device)

    def read_dynamic(self) -> None:
        """Take over from the device where the dynamic walls are, which steps have moved; the clock has gone on."""
        schedule = self._model.schedule
        if not schedule.dynamic or self._block is None:
            return
        row = self._now.step_number - self._block[0] + 1
        placements, there = self.control.placement.numpy(), self.control.dynamic
        state, motions = there.state.numpy(), there.motions.numpy()
        for number, wall in enumerate(schedule.dynamic):
            motion = schedule.wall_motion[wall.number]
            wall.state, wall.motion = state[number].copy(), motions[number].copy()
            wall.before, wall.now = placements[row - 1, motion].copy(), placements[row, motion].copy()
            self._placements[row, motion] = wall.now

    def placements_ahead(self) -> np.ndarray:
        """Placements of the wall motions at the present step and those after it, shape (steps, motions, 24)."""
        base, _ = self.row()
        return self._placements[(base + 1) * self.stages :: self.stages]

    def set_time(self) -> None:
        """Write the present step and its placements to the device, with all conditions of the clock off."""
        now = np.zeros(clock_slots.SLOTS, dtype=np.int32)
        now[clock_slots.SCHEDULE_ROW] = self.row()[0]
        now[clock_slots.PARITY] = self._now.step_number & 1
        self.clock.assign(now)
        if len(self._model.schedule.motions):
            self.placements.assign(self.placements_ahead()[0])


def model_struct(model: Model) -> Any:
    """``Model`` of ``kernels.step.structs``: what is the same in all steps."""
    struct = model.kernels.structs.Model()
    struct.coefficients, struct.materials, struct.dt = model.coefficients, model.features.contact.materials, model.dt
    if model.liquid is not None:
        struct.quantum, struct.most_from_film = model.liquid.quantum, model.liquid.most_from_film
    struct.surface = model.walls.surface if model.walls is not None else Surface()
    return struct


def dynamic_walls(model: Model, threads: int) -> DynamicWalls:
    """Arrays of the walls that move by the load on them; state and drive come with the schedule."""
    schedule, device, walls = model.schedule, model.device, DynamicWalls()
    count = len(schedule.dynamic)
    number = np.full(len(model.scene.walls), -1, dtype=np.int32)
    number[[wall.number for wall in schedule.dynamic]] = np.arange(count)
    walls.number = wp.array(number, dtype=wp.int32, device=device)
    walls.motion = wp.array(schedule.wall_motion[number >= 0], dtype=wp.int32, device=device)
    walls.numbers = wp.array(np.stack([wall.numbers for wall in schedule.dynamic]), dtype=wp.float64, device=device)
    walls.curve = wp.array(np.stack([wall.curve for wall in schedule.dynamic]), dtype=wp.vec2d, device=device)
    walls.state = wp.zeros((count, STATE.width), dtype=wp.float64, device=device)
    walls.bodies = wp.array(np.stack([wall.body for wall in schedule.dynamic]), dtype=wp.float64, device=device)
    walls.motions = wp.zeros((count, MOTION.width), dtype=wp.float64, device=device)
    walls.drive = wp.zeros((0, count), dtype=wp.float64, device=device)
    assert model.walls is not None
    walls.mobility = model.walls.surface.mobility
    walls.sums = wp.zeros((threads, count * SUMS.width, WIDTH), dtype=wp.int64, device=device)
    return walls


def watched_meshes(model: Model) -> Watched:
    """Mesh walls with the largest travel per step that they allow, and their bounding boxes in body axes."""
    watched, device = Watched(), model.device
    motion = model.walls.surface.motion.numpy() if model.walls is not None else np.zeros(0, dtype=int)
    walls = [(number, wall) for number, wall in enumerate(model.scene.walls) if wall.mesh is not None]
    vertices = [model.meshes[wall.name].vertices for _, wall in walls]
    watched.motion = wp.array([motion[number] for number, _ in walls], dtype=wp.int32, device=device)
    watched.max_travel = wp.array([max_travel(wall) for _, wall in walls], dtype=wp.float64, device=device)
    for name, corners in (("low", [v.min(axis=0) for v in vertices]), ("high", [v.max(axis=0) for v in vertices])):
        setattr(watched, name, wp.array(np.array(corners).reshape(-1, 3), dtype=wp.vec3d, device=device))
    return watched
