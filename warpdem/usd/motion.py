"""The motion of a USD prim as that of a frame or a wall: a rigid motion through the local-to-world transforms of its samples.

    M(t) = X(t) X(0)^-1,   X(t): x_world = B(t) x_prim + p(t)

so that frame and laboratory coincide at time 0, as for every motion. Lengths are multiplied by the stage's metersPerUnit
and time codes divided by its timeCodesPerSecond; a stage with Y upwards is rotated by 90 degrees about x, so that z is
upwards in the laboratory. A wall's mesh from the same prim is converted in the same way and so moves as on the stage.
Between two samples B rotates at a constant rate about a fixed axis, by the smaller angle, and p moves along a straight line;
before the first and after the last sample both rest. Two samples must therefore differ by less than half a revolution.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from warpdem.core.pose import SampledPart
from warpdem.core.rigid_motion import (
    WIDE,
    Increment,
    Pose,
    apply,
    compose,
    quaternion_rotation_increment,
    rotation_about,
    translation_by,
    transposed,
)
from warpdem.errors import SceneError
from warpdem.usd import stage as usd_stage

RIGID_TOLERANCE = 1e-6
"""Tolerance of a transform against a rotation [-]: float32 files round to 1e-7; more is scale or shear."""


def multiply_quaternions(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Products of quaternions (scalar first), shape (k, 4)."""
    aw, ax, ay, az = np.moveaxis(a, -1, 0)
    bw, bx, by, bz = np.moveaxis(b, -1, 0)
    w, x = aw * bw - ax * bx - ay * by - az * bz, aw * bx + ax * bw + ay * bz - az * by
    y, z = aw * by + ay * bw + az * bx - ax * bz, aw * bz + az * bw + ax * by - ay * bx
    return np.stack([w, x, y, z], axis=-1)


def conjugate(q: np.ndarray) -> np.ndarray:
    """Inverses of unit quaternions, shape (k, 4)."""
    return q * np.array([1, -1, -1, -1], dtype=WIDE)


@dataclass(frozen=True)
class SampledMotion:
    """M(t) of a prim: a rotation about the position of its origin at time 0, and a translation of this point."""

    time: np.ndarray
    """Times of the samples [s], increasing, shape (m,), long double."""
    quaternion: np.ndarray
    """B(t) B(0)^-1 at each sample, scalar first, shape (m, 4)."""
    shift: np.ndarray
    """p(t) - p(0) at each sample [m], shape (m, 3)."""
    centre: np.ndarray
    """p(0) [m], shape (3,)."""

    @functools.cached_property
    def _intervals(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Start [s], spin in M's axes [rad/s] and velocity of p [m/s] of each interval between samples, and its sample.

        The intervals before the first and after the last sample are at rest.
        """
        step = multiply_quaternions(conjugate(self.quaternion[:-1]), self.quaternion[1:])
        step = np.where(step[:, :1] < 0, -step, step)  # by the smaller angle
        sine = np.sqrt(np.sum(step[:, 1:] ** 2, axis=1))[:, None]
        # at a sine of 0 the angle is 0 and the axis arbitrary
        axis = step[:, 1:] / np.where(sine > 0, sine, 1)
        length = np.diff(self.time)[:, None]
        rest = np.zeros((1, 3), dtype=WIDE)
        spin = np.concatenate([rest, 2 * np.arctan2(sine, step[:, :1]) * axis / length, rest])
        velocity = np.concatenate([rest, np.diff(self.shift, axis=0) / length, rest])
        number = np.concatenate([[0], np.arange(len(self.time))])
        return self.time[number], spin, velocity, number

    @property
    def moves(self) -> bool:
        """Whether the prim ever moves."""
        return self.rotates or bool(np.any(self._intervals[2]))

    @property
    def rotates(self) -> bool:
        """Whether its axes ever rotate."""
        return bool(np.any(self._intervals[1]))

    @property
    def max_rate(self) -> float:
        """Maximum angular velocity [rad/s]."""
        return float(np.sqrt(np.sum(self._intervals[1] ** 2, axis=1)).max())

    def _interval(self, time: np.ndarray) -> np.ndarray:
        """Number of the interval that holds each time; at a sample the interval after it."""
        return np.searchsorted(self.time, time, side="right")

    def _quaternion_and_shift(self, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Quaternions (k, 4) and displacements of p (k, 3) [m] at ``time`` [s]."""
        start, spin, velocity, number = (values[self._interval(time)] for values in self._intervals)
        since = (time - start)[:, None]
        rate = np.sqrt(np.sum(spin * spin, axis=1))[:, None]
        half = rate * since / 2
        change = np.concatenate([np.cos(half), np.sin(half) * spin / np.where(rate > 0, rate, 1)], axis=1)
        return multiply_quaternions(self.quaternion[number], change), self.shift[number] + velocity * since

    def pose(self, time: np.ndarray, segment_time: np.ndarray) -> Pose:
        """Poses at ``time`` [s]; velocities are those of the intervals that hold ``segment_time`` [s], shapes (k,)."""
        quaternion, shift = self._quaternion_and_shift(time)
        spin, velocity = (values[self._interval(segment_time)] for values in self._intervals[1:3])
        zero = np.zeros_like(spin)
        rotation = quaternion_rotation_increment(quaternion)
        return compose(translation_by(shift, velocity, zero), rotation_about(self.centre, rotation, spin, zero))

    def increments(self, time: np.ndarray) -> Increment:
        """Increments between consecutive times [s]; shape (k + 1,) gives k."""
        quaternion, shift = self._quaternion_and_shift(time)
        rotation = quaternion_rotation_increment(multiply_quaternions(conjugate(quaternion[1:]), quaternion[:-1]))
        step = shift[:-1] - shift[1:]
        back = transposed(quaternion_rotation_increment(quaternion[1:]))
        return Increment(rotation, step + apply(back, step) - apply(rotation, self.centre))

    def part(self, time: float) -> SampledPart:
        """The motion at one time [s], for writers."""
        at = np.array([time])
        quaternion, _ = self._quaternion_and_shift(at)
        return SampledPart(quaternion[0].astype(float), self.pose(at, at).origin[0].astype(float))

    def speed_bound(self, points: np.ndarray, radius: float) -> float:
        """Upper bound of the speed [m/s] of all points within ``radius`` [m] of the given ones, shape (n, 3)."""
        arm = float(np.linalg.norm(points - self.centre.astype(float), axis=1).max()) + radius
        rate, speed = (np.sqrt(np.sum(values**2, axis=1)) for values in self._intervals[1:3])
        return float(np.max(speed + rate * arm))

    def bounding_balls(self, points: np.ndarray, radius: float, end: float) -> tuple[np.ndarray, float]:
        """Points and a radius [m]: balls that hold the given balls at every time up to ``end`` [s]."""
        centre = self.centre.astype(float)
        farthest = float(np.linalg.norm(points - centre, axis=1).max()) + radius
        return (self.shift + self.centre).astype(float), farthest


def read(file: Path, prim: str, where: str, folders: Sequence[Path] | None = None) -> SampledMotion:
    """The motion of a prim.

    Args:
        file: USD file.
        prim: Path of the prim on the stage.
        where: File and key of the scene, for messages.
        folders: Folders that must hold all files it refers to; None for no restriction.

    Raises:
        SceneError: There is no such prim, it has no time samples, or a transform holds scale or shear.
    """
    stamp = file.stat() if file.is_file() else None
    return _read(file, prim, where, folders and tuple(folders), stamp and (stamp.st_mtime_ns, stamp.st_size))


@functools.lru_cache(maxsize=32)
def _read(
    file: Path, prim: str, where: str, folders: tuple[Path, ...] | None, stamp: tuple[int, int] | None
) -> SampledMotion:
    """As `read`, cached: a scene reads each of its motions several times. ``stamp`` changes with the file."""
    stage, arrays = usd_stage.read(file, "motion", prim, where, folders)
    up = usd_stage.TO_Z_UP[stage["up"]]
    for code, matrix in zip(arrays["codes"], arrays["matrices"], strict=True):
        _check_rigid(matrix[:3, :3], f"{where}.prim = {prim!r}: time code {code:g}")
    quaternion = np.array([quaternion_of(up @ matrix[:3, :3]) for matrix in arrays["matrices"]])
    position = (arrays["matrices"][:, :3, 3] @ up.T).astype(WIDE) * WIDE(stage["metres"])
    return _relative(arrays["codes"].astype(WIDE) / WIDE(stage["rate"]), quaternion, position)


def _relative(time: np.ndarray, quaternion: np.ndarray, position: np.ndarray) -> SampledMotion:
    """M(t) = X(t) X(0)^-1 from X at the samples."""
    absolute = SampledMotion(time, quaternion, position, np.zeros(3, dtype=WIDE))
    initial, centre = absolute._quaternion_and_shift(np.zeros(1))
    relative = multiply_quaternions(quaternion, conjugate(initial))
    return SampledMotion(time, relative, position - centre, centre[0])


def _check_rigid(matrix: np.ndarray, where: str) -> None:
    error = float(np.abs(matrix @ matrix.T - np.eye(3)).max())
    if error > RIGID_TOLERANCE or np.linalg.det(matrix) < 0.0:
        lengths = ", ".join(f"{length:.6g}" for length in np.linalg.norm(matrix, axis=0))
        raise SceneError(
            f"{where}: a transform with scale, shear or mirroring is no rigid motion; the lengths of its axes are "
            f"{lengths}, required is 1 within {RIGID_TOLERANCE:g} at right angles"
        )


def quaternion_of(matrix: np.ndarray) -> np.ndarray:
    """Unit quaternion, scalar first, of the rotation nearest to a matrix, shape (4,), long double."""
    left, _, right = np.linalg.svd(matrix)
    m = left @ right
    # the largest of the four squares selects the form, so that no divisor is small
    squares = np.array([1 + np.trace(m), *(1 + 2 * m[i, i] - np.trace(m) for i in range(3))])
    k = int(np.argmax(squares))
    axial = np.array([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]])
    if k == 0:
        q = np.array([squares[0], *axial])
    else:
        row = m[k - 1] + m[:, k - 1]
        row[k - 1] = squares[k]
        q = np.array([axial[k - 1], *row])
    q = q.astype(WIDE)
    return np.asarray(q / np.sqrt(np.sum(q * q)))
