"""A run: owns state, lists and kernels; ``step`` and ``run`` advance it, everything else only reads."""

import hashlib
import math
import time
from collections.abc import Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import warp as wp

from warpdem.core.snapshot import Snapshot, WallLoad, WallMesh
from warpdem.core.start_warp import start_warp
from warpdem.core.threads import Threads, available_threads, threads_for
from warpdem.engine.compiled import compile_plan
from warpdem.engine.neighbor_list import Lists
from warpdem.engine.stepper import Stepper
from warpdem.errors import SceneError, StabilityError, WarpdemError
from warpdem.filling.grain_source import check_start, joined, load_grains
from warpdem.filling.streams import Feeder, FeedWalls, representatives
from warpdem.guards.watch import Guards
from warpdem.kernels import grain
from warpdem.kernels.measure.budget import WallEntry
from warpdem.kernels.wall import record
from warpdem.kernels.wall.places import Hit
from warpdem.measure import measures, observation, observers, wall_loads
from warpdem.measure.budget import Budget
from warpdem.measure.contact_network import read_network
from warpdem.mesh.tessellation import drawings
from warpdem.model import digests, needs, time_step
from warpdem.model.domain import Domain
from warpdem.model.domain import check as check_domain
from warpdem.model.plan import SIMD_LANES, WARP_LANES, coefficient_table, make_plan
from warpdem.model.schedule import Schedule
from warpdem.model.wall_images import wall_images
from warpdem.model.walls import Walls, load_meshes, mesh_notes, named_diameters, size_warnings
from warpdem.scene.model import Scene
from warpdem.scene.models import model
from warpdem.state import checkpoint, contact_history
from warpdem.state.particles import State
from warpdem.state.restart import Past, started_from
from warpdem.state.restart import read as read_start

MOST_THREADS = 1024
"""Threads of a CPU run [-]: no machine has more cores."""


class Simulation:
    """A scene on a device, at rest between steps with the forces of its instant evaluated.

    Args:
        scene: validated scene.
        device: "cpu" or a CUDA device such as "cuda:0"; None takes a GPU if there is one.
        threads: CPU threads; None takes as many as pay for the number of grains, up to all available cores.
        start: checkpoint of another run to start from in place of the scene's grains, as the scene's key start.
        resident: many steps as one captured graph on one thread; None takes it on a GPU and not on a CPU, where it shows that
            the GPU's launches give the CPU's bits.

    Attributes:
        notes: what of the scene's file was not taken, and what is odd or was mended in its meshes, for people.

    Raises:
        SceneError: if the scene cannot be run: no such device, a bad mesh, overlapping start, time step over its limit.
        TypeError: if ``scene`` is no Scene.
    """

    def __init__(
        self,
        scene: Scene,
        device: str | None = None,
        threads: int | None = None,
        start: str | Path | None = None,
        *,
        resident: bool | None = None,
    ) -> None:
        require_scene(scene)
        if scene.phases:
            raise SceneError(f"{scene.source}: phases: a simulation is one of them: take scene.phase(0), or warpdem run")
        self.given = scene = scene if start is None else started_from(scene, start)
        self.given_json = scene.model_dump_json()
        self.files = digests.file_digests(scene)
        self.scene_hash = digests.scene_hash(scene, self.files)
        self.device = pick_device(device)
        resident = self.device.is_cuda if resident is None else resident
        if self.device.is_cuda and not resident:
            raise SceneError(f"resident = False: device {self.device.alias} knows no other way of stepping")
        self.seconds: dict[str, float] = {}
        if threads is not None and not 1 <= threads <= MOST_THREADS:
            raise SceneError(f"threads = {threads}: at least 1 is needed, at most {MOST_THREADS} are taken")
        with self.clock("set-up"):
            needs.check_grid(scene)
            free = needs.free_bytes(self.device)
            past = read_start(scene) if scene.start is not None else None
            self.scene = scene = scene if past is None else past.scene
            self.meshes = load_meshes(scene)
            size_warnings(scene, self.meshes, named_diameters(scene))  # refuses before anything is filled
            start = load_grains(scene, self.meshes) if past is None else past.grains
            if past is None:  # what a run before left may have flown far away
                needs.check_places(scene, start)
            check_start(start, self.meshes, scene, () if past is None else past.old_walls)
            self.domain = Domain(scene)
            start = replace(start, position=self.domain.wrapped(start.position))
            self.expected = joined(start, representatives(scene))
            needs.check_masses(scene, self.expected)
            size_warnings(scene, self.meshes, 2.0 * self.expected.radius)
            self.notes = [*scene.notes, *mesh_notes(scene, self.meshes), *start.notes]
            scheme = model("integrator", scene.engine.integrator)
            self.schedule = Schedule(scene, scheme.STAGES, scheme.RELATIVE)
            images = wall_images(scene, self.meshes, self.schedule, self.domain, self.expected.radius)
            start_spin, start_velocity = (start.spin, start.velocity) if scheme.RELATIVE else self._to_absolute(start)
            self.plan = make_plan(
                scene,
                self.expected.type,
                bool(np.any(start.spin)),
                self.schedule.moving,
                len(self.schedule.motions) - self.schedule.moving,
                WARP_LANES if resident else SIMD_LANES,
                resident,
                float(self.expected.radius.max(initial=0.0)),
            )
            self.plan = replace(self.plan, wall_images=images is not None)
            check_domain(scene, start, self.schedule.frame, self.plan.gap)
            needs.check_memory(scene, self.plan.bytes_per_grain, len(start), free)
            self.limits = time_step.limits(scene, self.expected, self.meshes)
            self.dt = time_step.choose(scene, self.limits)
            needs.check_step(scene, self.limits, self.dt)
            self.schedule.dt = self.dt
            self.kernels = compile_plan(self.plan, self.device)
            observation.compile_own(scene, self.device)
            density = np.array([m.density for m in scene.materials.values()])
            moving = replace(start, velocity=start_velocity, spin=start_spin)
            self.density = density
            self.state = State(moving, density, self.plan.spins, self.plan.orientation, self.device, self.plan.sums)
            self.walls = (
                Walls(scene, self.meshes, self.schedule.wall_motion, images, self.device) if self.plan.walls else None
            )
            table = coefficient_table(scene) if self.plan.table else self._only_coefficients(self.expected)
            self.coefficients = wp.array(np.nan_to_num(table), dtype=self.kernels.pairs.Coefficients, device=self.device)
            count = threads or (available_threads() if scene.streams else threads_for(len(start.id)))
            self.threads = Threads(count if self.device.is_cpu else 1, as_pays=threads is None)
            self.lists = Lists(self)
            self.stepper = Stepper(self)
        self.step_number = 0
        self._forces_ready = False
        self._cut_short = False  # an interrupt came between the first step of a batch and its count
        self.steps_done = 0
        self.left = {name: [0, 0.0] for name in self.domain.names}  # grains and mass [kg] that each border or outlet took
        self.feeders = [Feeder(number, scene, self.dt, self._feed_walls(number)) for number in range(len(scene.streams))]
        self.notes += [note for feeder in self.feeders for note in feeder.walls.notes]
        self.budget = Budget(self) if self.plan.sums else None
        self._next_id = int(start.id.max(initial=-1)) + 1
        self.guards = Guards(self)
        self._grown = past is not None
        if past is not None:
            self._take_over(past)
        self._let_in()
        if over := time_step.over_limit(self.dt, self.limits):
            self.guards.notice("time step", over)

    def __repr__(self) -> str:
        where = f"t = {self.time:.6g} s (step {self.step_number}) on {self.device.alias}"
        return f"<Simulation of {self.scene.source}: {len(self.state)} grains at {where}>"

    def _take_over(self, past: Past) -> None:
        """Memory of contacts, orientation and random numbers of the run that this one starts from."""
        self.notes += past.notes
        self._next_id = max(self._next_id, past.next_id)
        if len(self.state):
            contact_history.remember(self.lists, past.data)
        if self.state.orientation is not None and "orientation" in past.data:
            self.state.orientation.assign(past.data["orientation"])
        for number, state in past.feeders.items():
            self.feeders[number].restore({**state, "count": 0, "mass": 0.0})

    def _only_coefficients(self, start) -> np.ndarray:
        """The one row of coefficients that all contacts of the scene share."""
        table = coefficient_table(self.scene)
        names = list(self.scene.materials)
        first = int(start.type[0]) if len(start.type) else 0
        others = [first, *(names.index(w.material) for w in self.scene.walls)]
        rows = [table[first * len(names) + other] for other in others]
        return next((r for r in rows if np.isfinite(r).all()), rows[0])[None]

    def _to_absolute(self, start, time: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """Absolute spins [rad/s] and velocities [m/s] of grains given relative to the frame at ``time`` [s]."""
        pose = self.schedule.pose(time)
        return start.spin + pose.spin, start.velocity + pose.velocity_at(start.position)

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

    def load_kernels(self) -> None:
        """Load the kernels of the steps and the lists, compiled where Warp's cache lacks them; else the first step does."""
        built = self.kernels
        if self.plan.resident:  # the graph's are compiled where it is captured
            return
        lists = [thing for group in (built.lists, built.walls) if group is not None for thing in vars(group).values()]
        for thing in (built.loop.run, built.loop.read, built.loop.read_budget, *lists):
            if isinstance(thing, wp.Kernel):
                wp.load_module(thing.module, device=self.device)

    def step(self, count: int = 1) -> None:
        """Advance by ``count`` time steps.

        Raises:
            StabilityError: when the run became unstable; names grain, time and cause.
            ValueError: if ``count`` is below 0.
        """
        if count < 0:
            raise ValueError(f"step({count}): must be 0 or more; time does not run back")
        if self.budget is not None:
            self.budget.begin()
        last = self.step_number + count
        while self.step_number < last:
            self._advance(min(last, self.guards.next_look) - self.step_number)
            self.guards.steps_done()

    def run(self, until: float) -> None:
        """Advance to the first step at or after ``until`` [s].

        Raises:
            StabilityError: as ``step``.
            ValueError: if ``until`` is past or no finite time.
        """
        if not math.isfinite(until) or (last := self.steps_until(until)) < self.step_number:
            raise ValueError(f"run(until={until:g}): must be finite and not before the present time, {self.time:.6g} s")
        self.step(last - self.step_number)

    def steps_until(self, time: float) -> int:
        """Number of the first step at or after ``time`` [s]; round-off of the division does not add one."""
        return math.ceil(time / self.dt - 1.0e-9)

    def _prepare(self) -> None:
        """Evaluate the forces of the present instant if they are not: what every reader asks for first."""
        if not self._forces_ready:
            self._advance(0)

    def _advance(self, count: int) -> int:
        """Make valid lists, evaluate the forces if they are not, and run up to ``count`` steps; returns how many.

        Raises:
            WarpdemError: an interrupt has left the state at a step that was not counted.
        """
        if self._cut_short:
            raise WarpdemError("the simulation was interrupted in the middle of its steps: go on from a checkpoint")
        if len(self.state) and not self._forces_ready:
            self.lists.update(self._grown)
            self._grown = False
        events = [event for feeder in self.feeders if (event := feeder.next_event(self.step_number)) is not None]
        due = min(events, default=self.step_number + count + 1) - self.step_number
        batch = min(count, due)
        if len(self.state) == 0:
            done, moved = batch, 0
        else:
            batch = min(batch, self.stepper.row()[1])
            with self.clock("steps"):
                self._cut_short = True
                done, moved = self.stepper.advance(batch, not self._forces_ready, hold=batch == due)
        self.step_number += done
        self._cut_short = False
        self.steps_done += done
        self.lists.due |= moved
        self._forces_ready = not moved and done < due
        if done == due:
            self._let_in()
        return done

    def leaving(self) -> np.ndarray:
        """Slots [-] of the grains that are not in the domain any more, shape (m,); they are counted.

        Raises:
            StabilityError: one is beyond a border that stops the run, or crossed a whole periodic domain in a step.
        """
        position, here = self.state.record.numpy()[:, grain.POSITION], self.state.here
        if any(self.domain.period) and (thrown := self.domain.thrown(position) & here).any():
            i = int(np.flatnonzero(thrown)[0])
            speed = float(np.linalg.norm(self.state.record.numpy()[i, grain.VELOCITY]))
            raise StabilityError(
                f"stopped at t = {self.time:.6g} s (step {self.step_number}): grain {self.state.id.numpy()[i]} crossed the "
                f"whole periodic domain in one step of {self.dt:.3g} s, at {speed:.3g} m/s. Take a smaller time.step."
            )
        where = self.domain.left_by(position)
        gone = (where >= 0) & here
        if gone.any():
            ids, mass = self.state.id.numpy(), 1.0 / self.state.inverse.numpy()[:, 0]
            for number in np.unique(where[gone]):
                name, through = self.domain.names[number], np.flatnonzero(gone & (where == number))
                through = through[np.argsort(ids[through])]
                if self.domain.stops[number]:
                    first = int(through[0])
                    place = ", ".join(f"{x:.4g}" for x in position[first])
                    raise StabilityError(
                        f"stopped at t = {self.time:.6g} s (step {self.step_number}): grain {ids[first]} at ({place}) m is "
                        f"beyond the border {name}, which the scene says stops the run"
                    )
                self.left[name][0] += len(through)
                self.left[name][1] += float(mass[through].sum())
            if self.budget is not None:
                self.budget.left(np.flatnonzero(gone))
        return np.flatnonzero(gone)

    def _feed_walls(self, number: int) -> FeedWalls:
        """The walls beside the box of a stream."""

        def places(time: float) -> list:
            return [(body[:9].reshape(3, 3), body[9:12]) for body in self.schedule.bodies(time)]

        moves = self.schedule.wall_motion < self.schedule.moving
        return FeedWalls(number, self.scene, self.meshes, places, moves)

    def _let_in(self) -> None:
        """Add what the streams bring at the present step, before its forces are called."""
        for feeder in self.feeders:
            if not feeder.is_event(self.step_number):
                continue
            record = self.state.record.numpy()[self.state.here]
            there = record[:, grain.POSITION], record[:, grain.RADIUS]
            position, radius = feeder.bring(self.step_number, *there, self.domain.nearest)
            n = len(radius)
            if n == 0:
                continue
            velocity = np.tile(np.array(feeder.stream.velocity, dtype=float), (n, 1))
            ids = np.arange(self._next_id, self._next_id + n)
            kinds = (np.full(n, number, np.int32) for number in (feeder.type, feeder.group))
            came = type(self.expected)(ids, *kinds, radius, position, velocity, np.zeros((n, 3)))
            if not self.plan.scheme.RELATIVE:
                spin, velocity = self._to_absolute(came, self.time)
                if self.step_number > 0:  # the record holds the velocity of mid-step, and the next kick is a whole one
                    velocity = velocity - 0.5 * self.dt * self.schedule.rows(self.step_number, 0)[0, 2:5]
                came = replace(came, velocity=velocity, spin=spin)
            self.state.add(came, self.density)
            if self.budget is not None:
                self.budget.came(np.arange(self.state.slots - n, self.state.slots))
            self._next_id += n
            self._grown, self._forces_ready = True, False

    def new_rows(self, grains: int, slots: int):
        """Wall rows of ``grains`` grains with ``slots`` slots in all."""
        rows, device = self.kernels.Rows(), self.device
        rows.first = wp.zeros(grains + 1, dtype=wp.int32, device=device)
        rows.candidates = wp.zeros(grains, dtype=wp.int32, device=device)
        rows.load = wp.zeros(grains, dtype=wp.types.vector(6, wp.float64), device=device)
        for name in ("feature", "hit_state", "hit_mask"):
            setattr(rows, name, wp.zeros(slots, dtype=wp.int32, device=device))
        rows.hit = wp.zeros(slots, dtype=Hit, device=device)
        rows.result = wp.zeros(slots, dtype=record.result_type(bool(self.plan.rolling)), device=device)
        generations = 2 if len(self.plan.scheme.STAGES) == 1 else 3
        rows.place_count = wp.zeros((generations, grains), dtype=wp.int32, device=device)
        if self.plan.energy:
            rows.entry = wp.zeros(grains, dtype=WallEntry, device=device)
            rows.power = wp.zeros((grains, self.plan.scene_walls), dtype=wp.float64, device=device)
        rows.place = wp.zeros((generations, slots), dtype=record.memory_type(self.plan.history), device=device)
        return rows

    # -- guards ---------------------------------------------------------------------------------

    @property
    def extremes(self) -> dict[str, float]:
        """Largest values met so far: overlap over radius [-] and approach speed [m/s], of pairs and of walls."""
        e = self.stepper.extreme
        return {
            "pair_overlap_share": float(e[0]),
            "pair_approach_speed": float(e[1]),
            "wall_overlap_share": float(e[2]),
            "wall_approach_speed": float(e[3]),
        }

    @property
    def noticed(self) -> dict[str, str]:
        """What each guard saw first, by its name; empty but with engine.guards = "record"."""
        return self.guards.noticed

    # -- checkpoint -----------------------------------------------------------------------------

    def save_checkpoint(self, path) -> None:
        """Write the whole state to ``path`` (HDF5), so that a resumed run equals this one bit for bit."""
        checkpoint.save(self, path)

    @classmethod
    def from_checkpoint(
        cls, path, device: str | None = None, threads: int | None = None, plugins: Sequence[str | Path] = ()
    ) -> "Simulation":
        """The simulation that a checkpoint was saved from, on any device and number of threads.

        Args:
            path: the checkpoint.
            device: as in ``Simulation``.
            threads: as in ``Simulation``.
            plugins: the .py files with models of your own that its scene names: no others are loaded.

        Raises:
            SceneError: if the file is missing, damaged or of another version.
        """
        data = checkpoint.read(path)
        sim = cls(checkpoint.scene_of(data, plugins), device=device, threads=threads)
        checkpoint.restore(sim, data)
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

    def measure(self) -> dict[str, float]:
        """What the scene's ``measures`` tell at the present time, by the names of their columns in history.csv."""
        return measures.measured(self)

    def observe(self, name: str) -> np.ndarray:
        """What an observer of the scene reads off each grain at the present time, in its unit, by id, shape (n,).

        Args:
            name: its name in the scene's ``observers``.

        Raises:
            SceneError: the scene has no observer of that name.
        """
        return observation.observe(self, name)

    def loads(self) -> tuple[np.ndarray, np.ndarray]:
        """Contact force [N] and torque [N m] on each grain, by id, shapes (n, 3)."""
        return self.readings()[:2]

    def wall_loads(self, lab: bool = False) -> dict[str, WallLoad]:
        """What the grains do to each wall at the present time, by wall name; vectors in frame axes or in the laboratory."""
        self._prepare()
        loads = wall_loads.read_loads(self)
        if not lab:
            return loads
        pose = self.schedule.pose(self.time)
        return {name: load.in_laboratory(pose) for name, load in loads.items()}

    def readings(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Contact force [N], torque [N m], velocity [m/s] and spin [rad/s] of each grain, by id, shapes (n, 3).

        Velocity and spin in frame axes, absolute or relative to the frame as the integrator holds them.
        """
        load, velocity, spin = (a.numpy()[self.state.rank] for a in self._read())
        return load[:, :3].copy(), load[:, 3:].copy(), velocity, spin

    def _read(self) -> tuple[wp.array, wp.array, wp.array]:
        """What ``readings`` gives, in memory order on the device: force and torque together, velocity, spin."""
        self._prepare()
        n = self.state.slots
        load = wp.zeros(n, dtype=wp.types.vector(6, wp.float64), device=self.device)
        velocity, spin = (wp.zeros(n, dtype=wp.vec3d, device=self.device) for _ in range(2))
        if n:
            base, _ = self.stepper.row()
            grains, _, rows = self.stepper.arguments()
            inputs = [base, grains, rows, self.stepper.control, self.dt, load, velocity, spin]
            wp.launch(self.kernels.loop.read, dim=n, inputs=inputs, device=self.device)
        return load, velocity, spin

    def snapshot(self) -> Snapshot:
        """Everything a writer needs, at the present time."""
        p = self.particles
        return Snapshot(
            step=self.step_number,
            time=self.time,
            frame=self.schedule.pose(self.time),
            id=p.id,
            type=p.type,
            group=p.group,
            radius=p.radius,
            mass=p.mass,
            position=p.position,
            velocity=p.velocity,
            spin=p.spin,
            force=p.force,
            walls=self.schedule.wall_placements(self.scene, self.time),
            loads=self.wall_loads() if self.scene.output.wall_loads else {},
            orientation=p.orientation if self.scene.output.orientation else None,
            contacts=read_network(self) if self.scene.output.contacts or self.scene.measures.grid else None,
            gravity=np.array(self.scene.gravity, dtype=float),
        )

    def wall_meshes(self) -> list[WallMesh]:
        """The walls to draw, in their body axes: meshes as they are, analytic ones cut into triangles, patches of planes."""
        return drawings(self.scene.walls, self.meshes, self.expected.position)

    def state_hash(self) -> str:
        """SHA-256 of step number, ids and moving state in order of id: equal runs have equal hashes."""
        digest = hashlib.sha256(str(self.step_number).encode())
        digest.update(self.state.ids.tobytes())
        digest.update(np.ascontiguousarray(self.state.record.numpy()[self.state.rank]).tobytes())
        return digest.hexdigest()


def require_scene(scene: Scene) -> None:
    """Refuse what is no scene.

    Raises:
        TypeError: with the call that makes one, where the name of a file or a table is given.
    """
    if isinstance(scene, Scene):
        return
    remedy = "Scene.model_validate({...})" if isinstance(scene, dict) else "load_scene(...)"
    if isinstance(scene, (str, Path)):
        remedy = f"load_scene({str(scene)!r})"
    raise TypeError(f"a Scene is needed, not {type(scene).__name__}: give {remedy}")


def pick_device(name: str | None):
    """The Warp device of that name; without a name the first GPU, or the CPU.

    Raises:
        SceneError: if there is no such device, with those there are.
    """
    start_warp()
    there = [d.alias for d in wp.get_devices()]
    if name is None:
        name = "cuda:0" if "cuda:0" in there else "cpu"
    if name not in there:
        raise SceneError(f"device = {name!r}: not on this machine; there is {', '.join(there)}")
    return wp.get_device(name)

