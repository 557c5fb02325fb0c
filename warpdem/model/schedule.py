"""The tables of ``kernels.step.schedule`` for a batch of steps: all that is known beforehand about time."""

import copy
from pathlib import Path

import numpy as np

from warpdem.core.pose import FramePose, Placement
from warpdem.core.rigid_motion import Pose, apply, compose, cross, rounded, still, transposed
from warpdem.model.driven import DrivenMotion
from warpdem.model.dynamic_walls import DynamicWall
from warpdem.scene.model import Scene
from warpdem.scene.motion_chain import Chain, frame_chain, timed, wall_chain
from warpdem.scene.regions import Placed
from warpdem.scene.surface_velocity import Belt, SurfaceVelocity


class WallMotion:
    """How a group of walls moves: fixed to the frame or the laboratory, and moving by itself in it or not.

    Attributes:
        dynamic: number among the schedule's dynamic walls, if it is one.
    """

    def __init__(self, fixed_to: str, own: Chain | DrivenMotion, surface: "SurfaceCourse | None" = None) -> None:
        self.fixed_to, self.own, self.surface = fixed_to, own, surface
        self.dynamic: int | None = None

    @property
    def rests_in_frame(self) -> bool:
        """Whether it never moves relative to the frame (given that the frame moves)."""
        return self.fixed_to == "frame" and not self.own.displaces and self.dynamic is None


class SurfaceCourse:
    """The surface velocity of a group of walls against time."""

    def __init__(self, given: SurfaceVelocity) -> None:
        self._circulates = isinstance(given, Belt)
        translation = given.translation if isinstance(given, Belt) else given
        self._course = timed(translation, translation)

    def velocities(self, time: np.ndarray, axes: np.ndarray) -> np.ndarray:
        """V and a of ``kernels.step.schedule`` in frame axes [m/s] at ``time`` [s], shape (k, 6).

        Args:
            time: shape (k,).
            axes: body axes to frame axes, shape (k, 3, 3).
        """
        velocity = apply(axes, self._course.pose(time, time).velocity)
        both = [np.zeros_like(velocity), velocity] if self._circulates else [velocity, np.zeros_like(velocity)]
        return np.concatenate(both, axis=1)


class Schedule:
    """Frame, gravity and wall motions against time.

    Args:
        scene: validated scene.
        stages: times of the force calls of one step, as fractions of it, the first of them 0.
        relative: angular velocity and velocity of walls are relative to the frame, not absolute.

    Attributes:
        dt: time step [s], to be set before any table is asked for.
        rotates: whether the frame's axes ever rotate.
        shifting: whether the frame moves at all.
        motions: wall motions, those that move relative to the frame first; then those of regions alone.
        wall_motion: motion number of each wall of the scene, shape (w,).
        moving: how many of the motions move relative to the frame.
        driven: motions that may be changed in the run, by the names of their walls.
        dynamic: walls that move by the load on them, each with a motion of its own.
        max_rate: bound of the frame's angular velocity [rad/s].
        period: length of the domain along each axis [m], 0 where it is not periodic: the kernels see a wall that has gone by
            a period where it was.

    Raises:
        SceneError: a sampled motion cannot be read.
    """

    def __init__(self, scene: Scene, stages: tuple[float, ...] = (0.0,), relative: bool = False) -> None:
        self.dt = 0.0
        self.period = np.zeros(3)
        self.stages, self.relative = np.array(stages), relative
        self.gravity = np.array(scene.gravity, dtype=float)
        self.frame = frame_chain(scene)
        self.rotates, self.shifting, self.max_rate = self.frame.rotates, self.frame.moves, self.frame.max_rate
        found: dict[str, WallMotion] = {}
        keys = []
        self.driven: dict[str, DrivenMotion] = {}
        self.dynamic: list[DynamicWall] = []
        for number, wall in enumerate(scene.walls):
            own: Chain | DrivenMotion = wall_chain(scene, number)
            if wall.driven:
                own = self.driven[wall.name] = DrivenMotion(scene, number, wall_chain(scene, number))
            # in a frame that coincides with it the laboratory is the frame
            fixed_to = wall.fixed_to if self.frame.displaces else "frame"
            alone = wall.driven or wall.dynamic is not None
            keys.append(f"{fixed_to} {wall.motion if own.displaces else None!r}" + f" {number}" * alone)
            surface = None
            if wall.surface_velocity is not None:
                keys[-1] += f" {wall.surface_velocity!r}"
                surface = SurfaceCourse(wall.surface_velocity)
            motion = found.setdefault(keys[-1], WallMotion(fixed_to, own, surface))
            if wall.dynamic is not None:
                motion.dynamic = len(self.dynamic)
                self.dynamic.append(DynamicWall(number, wall))
        order = sorted(found, key=lambda key: found[key].rests_in_frame)
        self.motions = [found[key] for key in order]
        self.moving = sum(not motion.rests_in_frame for motion in self.motions)
        self.wall_motion = np.array([order.index(key) for key in keys], dtype=np.int32)
        self._wall_names = [wall.name for wall in scene.walls]

    def carrier(self, place: Placed) -> WallMotion | None:
        """What carries a region: the motion of a wall, or that of the laboratory; None where it is at rest in the frame."""
        if place.follows is not None:
            motion = self.motions[int(self.wall_motion[self._wall_names.index(place.follows)])]
            return None if motion.rests_in_frame else motion
        if place.fixed_to == "frame" or not self.frame.displaces:
            return None
        at_rest = (m for m in self.motions if m.fixed_to == "laboratory" and not m.own.displaces and m.dynamic is None)
        return next(at_rest, WallMotion("laboratory", Chain(None, Path, "")))

    def motion_of(self, place: Placed) -> int:
        """Number of the motion that carries a region, -1 where it is at rest in the frame; a new one is the last of all.

        Grains do not touch regions: no displacement is counted in the axes of their motions, which are behind those of walls.
        """
        carrier = self.carrier(place)
        if carrier is None:
            return -1
        if carrier not in self.motions:
            self.motions.append(carrier)
        return self.motions.index(carrier)

    def place(self, carrier: WallMotion, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Axes (3, 3) of a region in frame axes [-] at ``time`` [s], and its origin there [m], shape (3,)."""
        numbers = self._now(carrier, time)
        return numbers[:9].reshape(3, 3), numbers[9:12]

    def carried(
        self, carrier: WallMotion | None, time: float, position: np.ndarray, velocity: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Velocity [m/s] and spin [rad/s] relative to the frame of grains that are at rest in a region but for a velocity.

        Args:
            carrier: what carries the region.
            time: [s].
            position: of the grains in frame axes [m], shape (n, 3).
            velocity: relative to the region, in its axes [m/s], shape (3,).

        Returns:
            Both of shape (n, 3).
        """
        if carrier is None:
            return np.tile(velocity, (len(position), 1)), np.zeros_like(position)
        numbers, pose = self._now(carrier, time), self.pose(time)
        absolute = numbers[:9].reshape(3, 3) @ velocity + self.velocity_of(carrier, time, position)
        return absolute - pose.velocity_at(position), np.tile(numbers[12:15] - pose.spin, (len(position), 1))

    def velocity_of(self, carrier: WallMotion, time: float, position: np.ndarray) -> np.ndarray:
        """Absolute velocity [m/s] in frame axes of the points of a region that are at positions (n, 3) [m] in the frame."""
        numbers = self._now(carrier, time)
        return np.asarray(numbers[15:18] + np.cross(numbers[12:15], position))

    def _now(self, carrier: WallMotion, time: float) -> np.ndarray:
        """The numbers of one motion at ``time`` [s], with absolute velocities, shape (24,)."""
        now = np.array([time])
        return self._placement(carrier, now, self.frame.pose(now), False)[0]

    def pose(self, time: float) -> FramePose:
        """Place of the frame in the laboratory at ``time`` [s]; where its rate jumps, velocities are those after."""
        pose = self.frame.pose(np.array([time]))
        numbers = (pose.axes, pose.origin, pose.spin, pose.velocity)
        axes, origin, spin, velocity = (values[0].astype(float) for values in numbers)
        return FramePose(axes, origin, spin, velocity, self.frame.parts(time))

    def _times(self, first: int, last: int) -> np.ndarray:
        """Times of the force calls of steps ``first`` to ``last`` [s], none before 0; stages run fastest."""
        return np.maximum(np.add.outer(np.arange(first, last + 1), self.stages).ravel(), 0.0) * self.dt

    def rows(self, step: int, count: int) -> np.ndarray:
        """Rows of steps ``step`` to ``step + count``, shape ((count + 1) stages, 29)."""
        k = np.arange(step, step + count + 1)
        rows = np.zeros((count + 1, len(self.stages), 29))
        rows[:, :, 0] = self.stages * self.dt
        rows[:, 0, 0] = np.where(k == 0, 0.0, self.dt)
        rows[:, 0, 1] = np.where(k == 0, 0.5 * self.dt, self.dt)
        rows[:, :, 2:5] = self.gravity
        if self.frame.displaces and self.gravity.any():
            back = transposed(self.frame.pose(self._times(step, step + count)).axes)
            rows[:, :, 2:5] = apply(back, self.gravity).astype(float).reshape(count + 1, -1, 3)
        if self.shifting:
            whole = np.maximum(np.arange(step - 1, step + count + 2), 0) * self.dt  # nothing moved before 0
            drift = self.frame.increments(whole)
            exact = np.concatenate([drift.rotation.reshape(-1, 9), drift.shift], axis=1)
            drifts = rounded(exact, np.arange(step - 1, step + count + 1))
            rows[:, 0, 5:17] = drifts[1:]
            rows[:, 0, 17:29] = drifts[:-1]
        return rows.reshape(-1, 29)

    def frames(self, step: int, count: int) -> np.ndarray:
        """Rows of the frame for steps ``step`` to ``step + count``, shape ((count + 1) stages, 31).

        Within each step the frame's velocities are those of one smooth stretch of its schedule, the one at mid-step: t- at
        a time belongs to the step that ends there and t+ to the one that begins, so that a jump between two times
        counts at the nearer one. The later stages of a step, and the accelerations of all its stages, know only its own
        stretch.
        """
        time = self._times(step, step + count)
        after = self.frame.pose(time, self._middle(step, count, 0.5))
        before = self.frame.pose(time, self._middle(step, count, -0.5))
        single = len(self.stages) == 1
        within = (np.arange(len(time)) % len(self.stages) > 0)[:, None]
        columns = [
            after.axes.reshape(-1, 9), after.origin,
            np.where(within, after.spin, before.spin), np.where(within, after.velocity, before.velocity),
            after.spin, after.velocity,
            (before.spin_rate + after.spin_rate) / 2 if single else after.spin_rate,
            (before.acceleration + after.acceleration) / 2 if single else after.acceleration, time[:, None],
        ]  # fmt: skip
        return np.concatenate(columns, axis=1).astype(float)

    def _middle(self, step: int, count: int, fraction: float) -> np.ndarray:
        """Times ``fraction`` of a step after each step begins [s], none before 0, one for each stage."""
        middle = np.maximum(np.arange(step, step + count + 1) + fraction, 0.0) * self.dt
        return np.repeat(middle, len(self.stages))

    def placements(self, step: int, count: int) -> np.ndarray:
        """Placements at the force calls of steps ``step - 1`` to ``step + count + 1``, shape (calls, motions, 24).

        Those of dynamic walls are known up to step ``step``; after it they are those of their carriers.
        """
        times = self._times(step - 1, step + count + 1)
        table = self._brought_back(self._placements(times, self.relative, carriers=True))
        for wall in self.dynamic:
            motion = self.wall_motion[wall.number]
            if wall.now is None:
                wall.before = wall.now = self._placement(self.motions[motion], times[:1], self.frame.pose(times[:1]), False)[0]
            table[0, motion], table[1, motion] = wall.before, wall.now
        return table

    def drives(self, step: int, count: int) -> np.ndarray:
        """Load asked of each dynamic wall at steps ``step`` to ``step + count``, shape (count + 1, walls)."""
        times = self._times(step, step + count)
        return np.stack([wall.drive(times) for wall in self.dynamic], axis=1)

    def at_present(self) -> "Schedule":
        """The same, in which dynamic walls stay where they are now; itself where there are none."""
        if not self.dynamic:
            return self
        kept = copy.copy(self)
        kept.dynamic = [copy.copy(wall) for wall in self.dynamic]
        return kept

    def _brought_back(self, placements: np.ndarray) -> np.ndarray:
        """Placements less the whole periods that each has gone since the start."""
        if not self.period.any():
            return placements
        gone = placements[:, :, 9:12] - self._placements(np.zeros(1), self.relative, carriers=True)[:, :, 9:12]
        placements[:, :, 9:12] -= self.period * np.rint(gone / np.where(self.period > 0.0, self.period, np.inf))
        return placements

    def bodies(self, time: float) -> np.ndarray:
        """Placement of each wall's body at ``time`` [s], with absolute velocities, shape (w, 24)."""
        return self.wall_places(np.array([time]))[0]

    def wall_places(self, times: np.ndarray) -> np.ndarray:
        """The same at several ``times`` [s], shape (k, w, 24)."""
        return self._placements(times, relative=False)[:, self.wall_motion]

    def _placements(self, time: np.ndarray, relative: bool, carriers: bool = False) -> np.ndarray:
        """Placement of each motion at ``time`` [s]; of dynamic walls as they are at present, or of their ``carriers``."""
        frame = self.frame.pose(time)
        out = np.zeros((len(time), max(len(self.motions), 1), 24))
        for number, motion in enumerate(self.motions):
            out[:, number] = self._placement(motion, time, frame, relative, carriers)
        return out

    def _placement(
        self, motion: WallMotion, time: np.ndarray, frame: Pose, relative: bool, carrier: bool = False
    ) -> np.ndarray:
        """The 24 numbers of one motion at ``time`` [s], shape (k, 24)."""
        own = motion.own.pose(time) if motion.own.displaces else still(len(time))
        if motion.dynamic is not None and not carrier:
            own = compose(own, self.dynamic[motion.dynamic].pose(len(time)))
        if motion.fixed_to == "frame":
            body, axes, shift = frame if motion.rests_in_frame else compose(frame, own), own.axes, own.origin
        else:
            back = transposed(frame.axes)
            body, axes, shift = own, back @ own.axes, apply(back, own.origin - frame.origin)
        spin = apply(axes, body.spin)
        velocity = apply(axes, body.velocity) - cross(spin, shift)
        if relative:
            spin, velocity = spin - frame.spin, velocity - frame.velocity
        surface = np.zeros((len(time), 6)) if motion.surface is None else motion.surface.velocities(time, axes)
        return np.concatenate([axes.reshape(-1, 9), shift, spin, velocity, surface], axis=1).astype(float)

    def wall_placements(self, scene: Scene, time: float) -> dict[str, Placement]:
        """Placement of every wall at ``time`` [s], by name."""
        return {
            wall.name: Placement(body[:9].reshape(3, 3), body[9:12])
            for wall, body in zip(scene.walls, self.bodies(time), strict=True)
        }
