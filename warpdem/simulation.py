"""A run: owns state, lists and kernels; ``step`` and ``run`` advance it, everything else only reads."""

import hashlib
import math
import time
from contextlib import contextmanager

import numpy as np
import warp as wp

from warpdem import checkpoint, observers, timestep
from warpdem.compiled import compile_plan
from warpdem.errors import SceneError, StabilityError
from warpdem.grain_source import check_start, load_grains
from warpdem.kernels import barrier
from warpdem.kernels.loop import SPAN
from warpdem.kernels.pairs import BLOCK as PACK_BLOCK
from warpdem.kernels.schedule import Placement, Row
from warpdem.kernels.wall.surface import Surface
from warpdem.neighbours import Lists
from warpdem.plan import SIMD_LANES, coefficient_table, make_plan
from warpdem.scene import Scene
from warpdem.schedule import Schedule
from warpdem.snapshot import Snapshot, WallMesh
from warpdem.state import State
from warpdem.threads import Threads, available_threads, ranges
from warpdem.walls import Walls, check_sizes, load_meshes, named_diameters

BLOCK = 256  # steps whose schedule is made at once
CUDA_THREADS = 1 << 16  # most GPU threads of one launch; more work is strided


class Simulation:
    """A scene on a device, at rest between steps with the forces of its instant evaluated.

    Args:
        scene: validated scene.
        device: "cpu" or a CUDA device such as "cuda:0"; None takes a GPU if there is one.
        threads: CPU threads; None takes all available cores.

    Raises:
        SceneError: if the scene cannot be run: no such device, a bad mesh, overlapping start, time step over its limit.
    """

    def __init__(self, scene: Scene, device: str | None = None, threads: int | None = None) -> None:
        self.scene = scene
        self.device = pick_device(device)
        self.seconds: dict[str, float] = {}
        if threads is not None and threads < 1:
            raise SceneError(f"threads = {threads}: at least 1 is needed")
        self.threads = Threads((threads or available_threads()) if self.device.is_cpu else 1)
        self._block: tuple[int, int] | None = None
        with self.clock("set-up"):
            self.meshes = load_meshes(scene)
            check_sizes(scene, self.meshes, named_diameters(scene))
            start = load_grains(scene, self.meshes)
            check_sizes(scene, self.meshes, 2.0 * start.radius)
            check_start(start, self.meshes, scene)
            self.schedule = Schedule(scene)
            start_spin, start_velocity = self._to_absolute(start)
            self.plan = make_plan(
                scene,
                start.type,
                bool(np.any(start.spin)),
                self.schedule.moving,
                SIMD_LANES if self.device.is_cpu else 1,
            )
            self.limits = timestep.limits(scene, start, self.meshes)
            self.dt = timestep.choose(scene, self.limits)
            self.schedule.dt = self.dt
            self.kernels = compile_plan(self.plan)
            density = np.array([m.density for m in scene.materials.values()])
            moving = type(start)(**{**vars(start), "velocity": start_velocity, "spin": start_spin})
            self.state = State(moving, density, self.plan.spins, self.device)
            self.walls = (
                Walls(scene, self.meshes, self.schedule.wall_motion, self.device) if self.plan.walls else None
            )
            table = coefficient_table(scene) if self.plan.table else self._only_coefficients(start)
            self.coefficients = wp.array(np.nan_to_num(table), dtype=self.kernels.pairs.Coefficients, device=self.device)
            self.lists = Lists(self)
            self._control = self._new_control()
        self.step_number = 0
        self._forces_ready = False
        self.steps_done = 0

    def _only_coefficients(self, start) -> np.ndarray:
        """The one row of coefficients that all contacts of the scene share."""
        table = coefficient_table(self.scene)
        names = list(self.scene.materials)
        first = int(start.type[0]) if len(start.type) else 0
        others = [first, *(names.index(w.material) for w in self.scene.walls)]
        rows = [table[first * len(names) + other] for other in others]
        return next((r for r in rows if np.isfinite(r).all()), rows[0])[None]

    def _to_absolute(self, start) -> tuple[np.ndarray, np.ndarray]:
        """Absolute spins [rad/s] and velocities [m/s] of grains given relative to the frame at time 0."""
        pose = self.schedule.pose(0.0)
        omega = pose.axis * pose.rate
        return start.spin + omega, start.velocity + np.cross(omega, start.position - pose.origin)

    @contextmanager
    def clock(self, stage: str):
        """Add the time spent inside to ``seconds[stage]``."""
        begin = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[stage] = self.seconds.get(stage, 0.0) + time.perf_counter() - begin

    # -- advancing ------------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Simulated time [s]: step number times time step, never a running sum."""
        return self.step_number * self.dt

    def step(self, count: int = 1) -> None:
        """Advance by ``count`` time steps.

        Raises:
            StabilityError: when the run became unstable; names grain, time and cause.
        """
        left = count
        while left > 0:
            self._prepare()
            base = self._rows_for(left)
            batch = min(left, base[1], 1 if self.lists.stale else left)
            done = self._advance(base[0], batch)
            left -= done
            self._guard()

    def run(self, until: float) -> None:
        """Advance to the first step at or after ``until`` [s]."""
        self.step(max(0, self.steps_until(until) - self.step_number))

    def steps_until(self, time: float) -> int:
        """Number of the first step at or after ``time`` [s]; round-off of the division does not add one."""
        return math.ceil(time / self.dt - 1.0e-9)

    def _prepare(self) -> None:
        """Evaluate the forces of the present instant if they are not."""
        if self._forces_ready or len(self.state) == 0:
            return
        self.lists.update()
        base, _ = self._rows_for(1)
        self._advance(base, 0)

    def _rows_for(self, count: int) -> tuple[int, int]:
        """Row of the present step in the uploaded schedule, and how many steps may follow."""
        if self._block is None or not self._block[0] <= self.step_number < self._block[0] + self._block[1]:
            with self.clock("schedule"):
                first = self.step_number
                self._control.row = wp.array(self.schedule.rows(first, BLOCK), dtype=Row, device=self.device)
                placements = self.schedule.placements(first, BLOCK)
                self._control.placement = wp.array(placements, dtype=Placement, device=self.device)
                self._placements_host = placements
                self._block = (first, BLOCK)
        base = self.step_number - self._block[0]
        return base, min(count, self._block[1] - base)

    def placements_now(self) -> np.ndarray:
        """Placements of the wall motions at the present step, shape (motions, 18)."""
        base, _ = self._rows_for(1)
        return self._placements_host[base + 1]

    def _advance(self, base: int, count: int) -> int:
        """Run ``count`` steps (0: only the forces) and return how many were done before the lists ran out."""
        if len(self.state) == 0:
            self.step_number += count
            return count
        grains, packs, rows = self._arguments()
        control = self._control
        forces_first = 0 if self._forces_ready else 1
        parity = self.step_number & 1
        surface = self.walls.surface if self.walls else Surface()
        shared = [grains, packs, rows, surface, control, self.coefficients, self.plan.materials]
        n = self.threads.count
        with self.clock("steps" if count else "first forces"):
            if self.device.is_cpu:
                parts = [ranges(m, n) for m in (packs.owner.shape[0], len(self.state), self.lists.row_count)]
                control.share.numpy()[:, :6] = np.array([[*p, *g, *w] for p, g, w in zip(*parts, strict=True)])
                control.meeting.zero_()
                control.moved.zero_()
                kernel = self.kernels.loop.run
                wp.load_module(kernel.module, device=self.device)
                yield_to = wp.uint64(barrier.yield_address())

                def job(thread: int):
                    inputs = [thread, n, base, count, forces_first, parity, *shared, self.dt, self.lists.reach, yield_to]
                    return lambda: wp.launch(kernel, dim=1, inputs=inputs, device=self.device)

                self.threads.together([job(t) for t in range(n)])
                done = int(control.done.numpy()[0]) if count else 0
                moved = bool(control.moved.numpy()[::SPAN].any()) and count > 0
            else:
                done, moved = self._advance_on_gpu(base, count, forces_first, parity, grains, packs, rows, surface)
        self.step_number += done
        self.steps_done += done
        self._forces_ready = not moved and not (self.lists.stale and count)
        return done

    def _advance_on_gpu(self, base, count, forces_first, parity, grains, packs, rows, surface) -> tuple[int, bool]:
        """As ``_advance`` with one launch per phase."""
        loop, control, n = self.kernels.loop, self._control, len(self.state)
        contacts, walls = packs.owner.shape[0], self.lists.row_count

        def launch(kernel, last, *inputs):
            dim = min(last, CUDA_THREADS)
            if dim:
                wp.launch(kernel, dim=dim, inputs=[dim, last, *inputs], device=self.device)

        def forces(s: int) -> None:
            launch(loop.pair_forces, contacts, base + s, grains, packs, control, self.coefficients, self.dt)
            launch(loop.wall_forces, walls, base + s, grains, rows, surface, control, self.coefficients,
                   self.plan.materials, (parity + s) & 1, self.dt)  # fmt: skip

        if forces_first:
            forces(0)
        for s in range(1, count + 1):
            launch(loop.move, n, base + s - 1, grains, rows, control, self.dt, self.lists.reach)
            if control.moved.numpy()[::SPAN].any():
                control.moved.zero_()
                return s, True
            forces(s)
        return count, False

    def _arguments(self):
        """The array structs of the present lists."""
        loop, lists = self.kernels.loop, self.lists
        grains, packs = loop.Grains(), loop.Packs()
        grains.record, grains.inverse, grains.kind = self.state.record, self.state.inverse, self.state.kind
        grains.reference, grains.row_start = lists.reference, lists.row_start
        lane, lane_int = self.kernels.pairs.Lane, self.kernels.pairs.LaneInt

        def packed(array, dtype):
            return wp.array(ptr=array.ptr, shape=array.shape[:-1], dtype=dtype, device=self.device)

        packs.owner, packs.partner = packed(lists.owner, lane_int), packed(lists.partner, lane_int)
        packs.constants, packs.memory = packed(lists.constants, lane), packed(lists.memory, lane)
        packs.slot_i, packs.slot_j = packed(lists.slot_i, lane_int), packed(lists.slot_j, lane_int)
        grains.row = packed(lists.row, self.kernels.pairs.Share)
        if self.plan.table:
            packs.kind = packed(lists.kind, lane_int)
        rows = self.kernels.Rows()
        if self.plan.walls:
            rows = lists.rows
        return grains, packs, rows

    def new_rows(self, grains: int, slots: int):
        """Wall rows of ``grains`` grains with ``slots`` slots in all."""
        rows, device = self.kernels.Rows(), self.device
        rows.first = wp.zeros(grains + 1, dtype=wp.int32, device=device)
        rows.candidates = wp.zeros(grains, dtype=wp.int32, device=device)
        rows.load = wp.zeros(grains, dtype=wp.types.vector(6, wp.float64), device=device)
        for name, dtype in (
            ("feature", wp.int32), ("hit_state", wp.int32), ("hit_mask", wp.int32), ("hit_distance", wp.float64),
            ("hit_point", wp.vec3d), ("hit_direction", wp.vec3d), ("place_force", wp.vec3d),
        ):  # fmt: skip
            setattr(rows, name, wp.zeros(slots, dtype=dtype, device=device))
        rows.place_count = wp.zeros((2, grains), dtype=wp.int32, device=device)
        rows.place_wall = wp.zeros((2, slots), dtype=wp.int32, device=device)
        rows.place_overlap = wp.zeros((2, slots), dtype=wp.float64, device=device)
        names = ["place_point", "place_normal"]
        names += ["place_spring"] if self.plan.memory >= 3 else []
        names += ["place_angle"] if self.plan.memory == 6 else []
        for name in names:
            setattr(rows, name, wp.zeros((2, slots), dtype=wp.vec3d, device=device))
        return rows

    def _new_control(self):
        control, device = self.kernels.loop.Control(), self.device
        slots = self.threads.count if device.is_cpu else CUDA_THREADS
        control.share = wp.zeros((slots if device.is_cpu else 0, 6), dtype=wp.int32, device=device)
        control.moved = wp.zeros(slots * SPAN, dtype=wp.int32, device=device)
        control.extreme = wp.zeros(slots * SPAN, dtype=wp.float64, device=device)
        control.scratch = wp.zeros((slots * PACK_BLOCK, 9), dtype=self.kernels.pairs.Lane, device=device)
        control.done = wp.zeros(1, dtype=wp.int32, device=device)
        control.meeting = wp.zeros(1, dtype=wp.int32, device=device)
        return control

    # -- guards ---------------------------------------------------------------------------------

    @property
    def extremes(self) -> dict[str, float]:
        """Largest values met so far: overlap over radius [-] and approach speed [m/s], of pairs and of walls."""
        e = self._control.extreme.numpy().reshape(-1, SPAN)[:, :4].max(axis=0)
        return {
            "pair_overlap_share": float(e[0]),
            "pair_approach_speed": float(e[1]),
            "wall_overlap_share": float(e[2]),
            "wall_approach_speed": float(e[3]),
        }

    def _guard(self) -> None:
        """Stop on overlaps that no sound run reaches."""
        met = self.extremes
        limit = self.scene.engine.max_overlap
        share = max(met["pair_overlap_share"], met["wall_overlap_share"])
        if share <= limit:
            return
        contacts = self.contacts()
        kind = "grains" if met["pair_overlap_share"] >= met["wall_overlap_share"] else "a grain and a wall"
        where = contacts.worst() if len(contacts.i) else "the contact is over"
        raise StabilityError(
            f"stopped at t = {self.time:.6g} s (step {self.step_number}): {kind} overlap by {share:.3g} of the radius, "
            f"allowed is engine.max_overlap = {limit:g}. {where}. Time step {self.dt:.3g} s, stability limit "
            f"{self.limits.stable:.3g} s at {self.limits.max_speed:.3g} m/s; largest approach speed met "
            f"{max(met['pair_approach_speed'], met['wall_approach_speed']):.3g} m/s. "
            "Take a smaller time.step, or a stiffer material."
        )

    def stop_not_finite(self) -> None:
        """Name the first grain whose state is no number.

        Raises:
            StabilityError: always.
        """
        record = self.state.record.numpy()
        bad = ~np.isfinite(record).all(axis=1)
        ids = np.sort(self.state.id.numpy()[bad])
        raise StabilityError(
            f"stopped at t = {self.time:.6g} s (step {self.step_number}): the state of grain {ids[0]} is not finite "
            f"({len(ids)} of {len(bad)} grains). Largest approach speed met before: "
            f"{max(self.extremes['pair_approach_speed'], self.extremes['wall_approach_speed']):.3g} m/s; "
            f"time step {self.dt:.3g} s. Take a smaller time.step."
        )

    # -- checkpoint -----------------------------------------------------------------------------

    def save_checkpoint(self, path) -> None:
        """Write the whole state to ``path`` (HDF5), so that a resumed run equals this one bit for bit."""
        checkpoint.save(self, path)

    @classmethod
    def from_checkpoint(cls, path, device: str | None = None, threads: int | None = None) -> "Simulation":
        """The simulation that a checkpoint was saved from, on any device and number of threads.

        Raises:
            SceneError: if the file is missing, damaged or of another version.
        """
        sim = cls(checkpoint.scene_of(checkpoint.read(path)), device=device, threads=threads)
        checkpoint.restore(sim, path)
        return sim

    # -- reading --------------------------------------------------------------------------------

    @property
    def particles(self) -> observers.Particles:
        """The grains at the present time, ordered by id."""
        return observers.Particles(self)

    def contacts(self) -> observers.Contacts:
        """All grain-grain and grain-wall contacts at the present time."""
        self._prepare()
        return observers.read_contacts(self)

    def energy(self) -> dict[str, float]:
        """Kinetic, rotational, elastic and potential energy in the laboratory [J]."""
        return observers.energy(self)

    def loads(self) -> tuple[np.ndarray, np.ndarray]:
        """Contact force [N] and torque [N m] on each grain, by id, shapes (n, 3)."""
        self._prepare()
        n = len(self.state)
        if n == 0:
            return np.zeros((0, 3)), np.zeros((0, 3))
        out = wp.zeros(n, dtype=wp.types.vector(6, wp.float64), device=self.device)
        grains, _, rows = self._arguments()
        wp.launch(self.kernels.loop.gather, dim=n, inputs=[grains, rows, out], device=self.device)
        load = out.numpy()[self.state.rank]
        return load[:, :3].copy(), load[:, 3:].copy()

    def snapshot(self) -> Snapshot:
        """Everything a writer needs, at the present time."""
        p = self.particles
        return Snapshot(
            step=self.step_number,
            time=self.time,
            frame=self.schedule.pose(self.time),
            id=p.id,
            type=p.type,
            radius=p.radius,
            mass=p.mass,
            position=p.position,
            velocity=p.velocity,
            spin=p.spin,
            force=self.loads()[0],
            walls=self.schedule.wall_placements(self.scene, self.time),
        )

    def wall_meshes(self) -> list[WallMesh]:
        """The mesh walls in their body axes."""
        return [WallMesh(name, m.vertices, m.triangles) for name, m in self.meshes.items()]

    def state_hash(self) -> str:
        """SHA-256 of step number, ids and moving state in order of id: equal runs have equal hashes."""
        digest = hashlib.sha256(str(self.step_number).encode())
        digest.update(np.sort(self.state.id.numpy()).tobytes())
        digest.update(np.ascontiguousarray(self.state.record.numpy()[self.state.rank]).tobytes())
        return digest.hexdigest()


def pick_device(name: str | None):
    """The Warp device of that name; without a name the first GPU, or the CPU.

    Raises:
        SceneError: if there is no such device, with those there are.
    """
    wp.init()
    there = [d.alias for d in wp.get_devices()]
    if name is None:
        name = "cuda:0" if "cuda:0" in there else "cpu"
    if name not in there:
        raise SceneError(f"device = {name!r}: not on this machine; there is {', '.join(there)}")
    return wp.get_device(name)

