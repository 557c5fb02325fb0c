"""Launching steps: the array structs of the present lists, and one batch of steps on CPU threads or a GPU."""

import time

import numpy as np
import warp as wp

from warpdem.core.threads import ranges
from warpdem.engine.graph import Resident
from warpdem.engine.pace import Pace
from warpdem.kernels.contact.pairs import BLOCK as PACK_BLOCK
from warpdem.kernels.field import Numbers
from warpdem.kernels.measure.budget import Energies, Momenta
from warpdem.kernels.measure.flow import Plane
from warpdem.kernels.step import barrier
from warpdem.kernels.step.loop import SPAN
from warpdem.kernels.step.motion import Box
from warpdem.kernels.step.schedule import FrameRow, Placement, Row
from warpdem.kernels.wall.surface import Surface
from warpdem.model.features import field_numbers

SCHEDULE_STEPS = (256, 4096)  # whose schedule is made at once on a CPU, where batches end with it
GRAPH_STEPS = 2048  # the same for the graph
GRAIN_STEPS = 200_000  # of a batch that takes about as long as people wait for an answer to Ctrl-C


def packed(array, dtype):
    """The same memory as an array of vectors."""
    return wp.array(ptr=array.ptr, shape=array.shape[:-1], dtype=dtype, device=array.device)


class Stepper:
    """Owns what a batch of steps needs besides state and lists: schedule rows, flags, extremes, scratch."""

    def __init__(self, sim) -> None:
        self.sim = sim
        self.stages = len(sim.plan.backend.scheme.STAGES)
        device = sim.device
        slots = 1 if sim.plan.backend.resident else sim.threads.count
        control = self.control = sim.kernels.loop.Control()
        control.share = wp.zeros((slots, 6), dtype=wp.int32, device=device)
        control.moved = wp.zeros(slots * SPAN, dtype=wp.int32, device=device)
        control.extreme = wp.zeros(slots * SPAN, dtype=wp.float64, device=device)
        control.deepest = wp.array([sim.scene.engine.max_overlap], dtype=wp.float64, device=device)
        control.scratch = wp.zeros((slots * PACK_BLOCK, 9), dtype=sim.kernels.pairs.Lane, device=device)
        control.field = wp.array(field_numbers(sim.scene), dtype=Numbers, device=device)
        control.outlet = wp.array(sim.domain.boxes, dtype=Box, device=device)
        planes = [(*p.point, *p.normal, p.radius or np.inf, p.fixed_to == "laboratory") for p in sim.scene.measures.flow]
        control.plane = wp.array(np.array(planes, dtype=float).reshape(-1, 8), dtype=Plane, device=device)
        control.origin = wp.zeros(1, dtype=wp.int32, device=device)
        control.done = wp.zeros(1, dtype=wp.int32, device=device)
        control.meeting = wp.zeros(barrier.ROOM, dtype=wp.int32, device=device)
        control.ways = wp.array(barrier.ways_to_wait(), dtype=wp.uint64, device=device)
        self._block: tuple[int, int] | None = None  # first step and number of steps of the schedule on the device
        self._arguments = None
        self._arguments_of = -1  # version of the lists that they belong to
        self.resident = Resident(sim, control) if sim.plan.backend.resident else None
        self.pace = Pace()

    @property
    def extreme(self) -> np.ndarray:
        """Largest overlap share [-] and approach speed [m/s] of pairs, then of walls, since the start; shape (4,)."""
        return self.control.extreme.numpy().reshape(-1, SPAN)[:, :4].max(axis=0)

    def pass_over_overlaps(self) -> None:
        """Let batches go on whatever the overlaps."""
        self.control.deepest.fill_(np.inf)

    def restore(self, extreme: np.ndarray) -> None:
        """Take over the extremes of a checkpoint; schedule and arguments are made anew."""
        values = self.control.extreme.numpy()
        values[:4] = extreme
        self.control.extreme.assign(values)
        self._block, self._arguments_of = None, -1

    def forget(self) -> None:
        """Let go of the arrays of the lists, before others are made."""
        self._arguments, self._arguments_of = None, -1
        if self.resident:
            self.resident.forget()

    def row(self) -> tuple[int, int]:
        """Row of the present step in the schedule on the device, and how many steps may follow."""
        sim, first = self.sim, self.sim.step_number
        if self._block is None or not self._block[0] <= first < self._block[0] + self._block[1]:
            with sim.clock("schedule"):
                ahead = self._steps_ahead()
                self._schedule("row", sim.schedule.rows(first, ahead), Row)
                if sim.plan.frame_rows:
                    self._schedule("frame", sim.schedule.frames(first, ahead), FrameRow)
                self._placements = sim.schedule.placements(first, ahead)
                self._schedule("placement", self._placements, Placement)
                self._block = (first, ahead)
                self.control.origin.assign(np.array([first], dtype=np.int32))
        base = first - self._block[0]
        return base, self._block[1] - base

    def _steps_ahead(self) -> int:
        """Steps of the next schedule: a short one would cost few grains more than their steps."""
        if self.resident:
            return GRAPH_STEPS
        low, high = SCHEDULE_STEPS
        return min(max(GRAIN_STEPS // max(len(self.sim.state), 1), low), high)

    def _schedule(self, name: str, table: np.ndarray, dtype) -> None:
        """Put a table of the schedule where the kernels find it, each time at the same place."""
        there = getattr(self.control, name)
        if there is not None and len(there) == len(table) and there.size:
            there.assign(table)
        else:
            setattr(self.control, name, wp.array(table, dtype=dtype, device=self.sim.device))

    def placements(self) -> np.ndarray:
        """Placements of the wall motions at the present step, shape (motions, 18)."""
        base, _ = self.row()
        return self._placements[(base + 1) * self.stages]

    def placements_ahead(self) -> np.ndarray:
        """Placements of the wall motions at all force calls of the schedule on the device, shape (calls, motions, 18)."""
        self.row()
        return self._placements

    def arguments(self):
        """Structs of grains, packs and wall rows for the present lists."""
        lists = self.sim.lists
        if self._arguments_of == lists.version:
            self._arguments[0].flight = lists.flights.path  # paths are laid between two lists too
            return self._arguments
        sim, loop = self.sim, self.sim.kernels.loop
        lane, lane_int = sim.kernels.pairs.Lane, sim.kernels.pairs.LaneInt

        grains, packs = loop.Grains(), loop.Packs()
        grains.record, grains.inverse, grains.kind = sim.state.record, sim.state.inverse, sim.state.kind
        if sim.plan.measures.orientation:
            grains.orientation = sim.state.orientation
        grains.reference, grains.row_start = lists.reference, lists.row_start
        grains.flight = lists.flights.path
        grains.store = wp.zeros((sim.state.slots, sim.plan.backend.scheme.STORE), dtype=wp.vec3d, device=sim.device)
        grains.row = packed(lists.row, sim.kernels.pairs.Share)
        grains.entry = packed(lists.entry, sim.kernels.pairs.Entry)
        for name, dtype in (("energies", Energies), ("momenta", Momenta)):
            if name in sim.plan.measures.sums:
                setattr(grains, name, packed(getattr(sim.state, name), dtype))
        for name in sim.plan.measures.sums.keys() & {"wall_work", "flow"}:
            setattr(grains, name, getattr(sim.state, name))
        packs.owner, packs.partner = packed(lists.owner, lane_int), packed(lists.partner, lane_int)
        packs.slot_i, packs.slot_j = packed(lists.slot_i, lane_int), packed(lists.slot_j, lane_int)
        packs.constants, packs.memory = packed(lists.constants, lane), packed(lists.memory, lane)
        packs.trial = packed(lists.trial, lane) if self.stages > 1 else packs.memory
        if sim.plan.contact.table:
            packs.kind = packed(lists.kind, lane_int)
        rows = lists.rows if sim.plan.walls.present else sim.kernels.Rows()
        self._arguments, self._arguments_of = (grains, packs, rows), lists.version
        return self._arguments

    def read(self) -> tuple[wp.array, wp.array, wp.array]:
        """Contact force [N] and torque [N m] together, velocity [m/s], spin [rad/s], by memory slot."""
        sim, n = self.sim, self.sim.state.slots
        load = wp.zeros(n, dtype=wp.types.vector(6, wp.float64), device=sim.device)
        velocity, spin = (wp.zeros(n, dtype=wp.vec3d, device=sim.device) for _ in range(2))
        if n:
            base, _ = self.row()
            grains, _, rows = self.arguments()
            inputs = [base, grains, rows, self.control, sim.dt, load, velocity, spin]
            wp.launch(sim.kernels.loop.read, dim=n, inputs=inputs, device=sim.device)
        return load, velocity, spin

    def read_sums(self) -> dict[str, np.ndarray]:
        """What the plan's budgets have added up per grain up to the present instant, in memory order."""
        sim, n = self.sim, self.sim.state.slots
        plan = sim.plan
        out = {name: wp.zeros((n, width), dtype=wp.float64, device=sim.device) for name, width in plan.measures.sums.items()}
        if "flow" in out:
            out["flow"] = sim.state.flow
        if n and (plan.measures.energy or plan.measures.momentum):
            base, _ = self.row()
            grains, _, rows = self.arguments()
            none = wp.zeros((0, 1), dtype=wp.float64, device=sim.device)
            energies, momenta = (packed(out.get(k, none), t) for k, t in (("energies", Energies), ("momenta", Momenta)))
            inputs = [base, grains, rows, self.control, sim.dt, energies, momenta, out.get("wall_work", none)]
            wp.launch(sim.kernels.loop.read_budget, dim=n, inputs=inputs, device=sim.device)
        return {name: array.numpy() for name, array in out.items()}

    def advance(self, count: int, forces_first: bool, hold: bool = False) -> tuple[int, int]:
        """Run up to ``count`` steps; returns how many were done, and what is to be seen to before the last forces.

        That is a sum of ``kernels.motion``'s BEYOND, the lists are out of date, and LEFT, grains have left the domain.

        ``hold`` leaves the forces of the last step to the next call: grains come in there.
        """
        sim = self.sim
        base, _ = self.row()
        grains, packs, rows = self.arguments()
        surface = sim.walls.surface if sim.walls else Surface()
        run = self.resident.advance if self.resident else self._on_cpu
        return run(base, count, forces_first, hold, sim.step_number & 1, grains, packs, rows, surface)

    def _on_cpu(self, base, count, forces_first, hold, parity, grains, packs, rows, surface) -> tuple[int, int]:
        """One launch per thread for the whole batch."""
        sim, control = self.sim, self.control
        most = sim.threads.at_work(len(sim.state))
        n = self.pace.threads(most) if sim.threads.as_pays else most
        kernel = sim.kernels.loop.run
        wp.load_module(kernel.module, device=sim.device)  # loading is not safe from several threads
        parts = [ranges(m, n) for m in (packs.owner.shape[0], sim.state.slots, sim.lists.row_count)]
        share = np.zeros(control.share.shape, dtype=np.int32)
        share[:n] = np.hstack(parts)
        control.share.assign(share)
        control.meeting.zero_()
        control.moved.zero_()
        shared = [grains, packs, rows, surface, control, sim.coefficients, sim.plan.contact.materials, sim.dt, sim.lists.reach]

        def job(thread: int):
            inputs = [thread, n, base, count, int(forces_first), int(hold), parity, *shared]
            return lambda: wp.launch(kernel, dim=1, inputs=inputs, device=sim.device)

        wall, used = time.perf_counter(), time.process_time()
        sim.threads.together([job(t) for t in range(n)])
        if count == 0:
            return 0, 0
        done = int(control.done.numpy()[0])
        if most > 1:
            self.pace.done(most, done, time.perf_counter() - wall, time.process_time() - used)
        return done, int(np.bitwise_or.reduce(control.moved.numpy()[::SPAN]))
