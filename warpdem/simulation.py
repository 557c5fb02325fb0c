"""A run: owns state, lists and kernels; ``step`` and ``run`` advance it, everything else only reads."""

import hashlib
import math
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path

import numpy as np
import warp as wp

from warpdem.core.device import pick_device
from warpdem.core.snapshot import Snapshot, WallLoad, WallMesh
from warpdem.core.threads import Threads, available_threads, threads_for
from warpdem.core.timers import Timers
from warpdem.engine.engine import Engine
from warpdem.errors import SceneError, WarpdemError
from warpdem.filling.initial_grains import InitialGrains
from warpdem.filling.inlet import Inlet
from warpdem.filling.inlet_walls import InletWalls
from warpdem.guards.watch import Guards
from warpdem.kernels import grain
from warpdem.measure import measures, observation, observers, wall_loads
from warpdem.measure.budget import Budget
from warpdem.measure.contact_network import read_network
from warpdem.mesh.tessellation import drawings
from warpdem.model import time_step
from warpdem.model.digests import Given
from warpdem.model.past import Past
from warpdem.model.prepare import absolute, prepare
from warpdem.scene.model import Scene
from warpdem.state import checkpoint, contact_history
from warpdem.state.clock import Clock
from warpdem.state.particles import State
from warpdem.state.restart import read as read_start
from warpdem.state.restart import started_from

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
        if threads is not None and not 1 <= threads <= MOST_THREADS:
            raise SceneError(f"threads = {threads}: at least 1 is needed, at most {MOST_THREADS} are taken")
        given = Given.of(scene if start is None else started_from(scene, start))
        where = pick_device(device)
        if where.is_cuda and resident is False:
            raise SceneError(f"resident = False: device {where.alias} knows no other way of stepping")
        self.timers = Timers()
        self.seconds = self.timers.seconds
        with self.clock("set-up"):
            past = read_start(given.scene) if given.scene.start is not None else None
            model, grains = prepare(given, where, where.is_cuda if resident is None else resident, past)
            self.model = model
            self.scene, self.device, self.meshes, self.domain = model.scene, model.device, model.meshes, model.domain
            self.expected, self.schedule, self.plan, self.limits = model.expected, model.schedule, model.features, model.limits
            self.kernels, self.coefficients, self.walls = model.kernels, model.coefficients, model.walls
            self.dt, self.notes = model.dt, list(model.notes)
            self.state = State.of(model, grains)
            self._clock = Clock(model.dt)
            count = threads or (available_threads() if model.scene.streams else threads_for(len(grains)))
            self.threads = Threads(count if model.device.is_cpu else 1, as_pays=threads is None)
            self.engine = Engine(model, self.state, self._clock, self.threads, self.timers)
            self.lists = self.engine.lists
        self._cut_short = False  # an interrupt came between the first step of a batch and its count
        self.steps_done = 0
        streams = range(len(model.scene.streams))
        self.inlets = [Inlet(number, model.scene, model.dt, self._inlet_walls(number)) for number in streams]
        self.notes += [note for inlet in self.inlets for note in inlet.walls.notes]
        self.budget = Budget(self) if self.plan.measures.sums else None
        if self.budget is not None:
            self.engine.leavers.before_leaving = self.budget.left
        self._next_id = int(grains.id.max(initial=-1)) + 1
        self.guards = Guards(self)
        self.lists.watch_travel = self.guards.travel.watch
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
        for number, state in past.inlets.items():
            self.inlets[number].restore({**state, "count": 0, "mass": 0.0})

    def clock(self, stage: str) -> AbstractContextManager[None]:
        """Add the time spent inside to ``seconds[stage]``."""
        return self.timers.measure(stage)

    # -- advancing ------------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Simulated time [s]: step number times time step, never a running sum."""
        return self._clock.time

    @property
    def step_number(self) -> int:
        """Steps since the start of the scene."""
        return self._clock.step_number

    def load_kernels(self) -> None:
        """Load the kernels of the steps and the lists, compiled where Warp's cache lacks them; else the first step does."""
        self.engine.load_kernels()

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
        if not self._clock.forces_evaluated:
            self._advance(0)

    def _advance(self, count: int) -> int:
        """Make valid lists, evaluate the forces if they are not, and run up to ``count`` steps; returns how many.

        Raises:
            WarpdemError: an interrupt has left the state at a step that was not counted.
        """
        if self._cut_short:
            raise WarpdemError("the simulation was interrupted in the middle of its steps: go on from a checkpoint")
        if len(self.state) and not self._clock.forces_evaluated:
            self.lists.update(self._grown)
            self._grown = False
        events = [event for inlet in self.inlets if (event := inlet.next_event(self.step_number)) is not None]
        due = min(events, default=self.step_number + count + 1) - self.step_number
        batch = min(count, due)
        if len(self.state) == 0:
            done, moved = batch, 0
        else:
            batch = min(batch, self.engine.steps_ahead)
            with self.clock("steps"):
                self._cut_short = True
                done, moved = self.engine.advance(batch, not self._clock.forces_evaluated, hold=batch == due)
        self._clock.step_number += done
        self._cut_short = False
        self.steps_done += done
        self.lists.due |= moved
        self._clock.forces_evaluated = not moved and done < due
        if done == due:
            self._let_in()
        return done

    @property
    def left(self) -> dict[str, list]:
        """Number and mass [kg] of the grains that each border or outlet took, by its name."""
        return self.engine.leavers.left

    def _inlet_walls(self, number: int) -> InletWalls:
        """The walls beside the box of a stream."""

        def places(time: float) -> list:
            return [(body[:9].reshape(3, 3), body[9:12]) for body in self.schedule.bodies(time)]

        moves = self.schedule.wall_motion < self.schedule.moving
        return InletWalls(number, self.scene, self.meshes, places, moves)

    def _let_in(self) -> None:
        """Add what the streams bring at the present step, before its forces are called."""
        for inlet in self.inlets:
            if not inlet.is_event(self.step_number):
                continue
            record = self.state.record.numpy()[self.state.here]
            there = record[:, grain.POSITION], record[:, grain.RADIUS]
            position, radius = inlet.insert(self.step_number, *there, self.domain.nearest)
            n = len(radius)
            if n == 0:
                continue
            velocity = np.tile(np.array(inlet.stream.velocity, dtype=float), (n, 1))
            ids = np.arange(self._next_id, self._next_id + n)
            kinds = (np.full(n, number, np.int32) for number in (inlet.type, inlet.group))
            came = InitialGrains(ids, *kinds, radius, position, velocity, np.zeros((n, 3)))
            if not self.plan.backend.scheme.RELATIVE:
                came = absolute(self.schedule, came, self.time)
                if self.step_number > 0:  # the record holds the velocity of mid-step, and the next kick is a whole one
                    kick = 0.5 * self.dt * self.schedule.rows(self.step_number, 0)[0, 2:5]
                    came = replace(came, velocity=came.velocity - kick)
            self.state.add(came, self.model.density)
            if self.budget is not None:
                self.budget.came(np.arange(self.state.slots - n, self.state.slots))
            self._next_id += n
            self._grown, self._clock.forces_evaluated = True, False

    # -- guards ---------------------------------------------------------------------------------

    @property
    def extremes(self) -> dict[str, float]:
        """Largest values met so far: overlap over radius [-] and approach speed [m/s], of pairs and of walls."""
        e = self.engine.extreme
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
        return self.engine.read()

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
