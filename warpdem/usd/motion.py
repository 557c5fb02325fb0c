"""The motion of a USD prim as a frame's or a wall's: the local-to-world transforms at its time samples, made rigid motion.

    M(t) = X(t) X(0)^-1,   X(t): x_world = B(t) x_prim + p(t)

so that frame and laboratory coincide at time 0, as for every motion. Lengths are multiplied by the stage's metersPerUnit
and time codes divided by its timeCodesPerSecond; a stage with Y upwards is turned by 90 degrees about x, so that z is
upwards in the laboratory. A wall's mesh from the same prim is treated alike and so moves as on the stage.
Between two samples B turns at a constant rate about a fixed axis, the short way round, and p moves along a straight line;
before the first and after the last sample both rest. Samples must therefore be less than half a turn apart.
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
    quaternion_turn_increment,
    shifting_by,
    transposed,
    turning_about,
)
from warpdem.errors import SceneError
from warpdem.usd import stage as usd_stage

RIGID_TOLERANCE = 1e-6
"""How far a transform may be from a turn [-]: float32 files round to 1e-7; more is scale or shear."""


def times(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Products of quaternions (scalar first), shape (k, 4)."""
    aw, ax, ay, az = np.moveaxis(a, -1, 0)
    bw, bx, by, bz = np.moveaxis(b, -1, 0)
    w, x = aw * bw - ax * bx - ay * by - az * bz, aw * bx + ax * bw + ay * bz - az * by
    y, z = aw * by + ay * bw + az * bx - ax * bz, aw * bz + az * bw + ax * by - ay * bx
    return np.stack([w, x, y, z], axis=-1)


def conjugate(q: np.ndarray) -> np.ndarray:
    """The inverse turns, shape (k, 4)."""
    return q * np.array([1, -1, -1, -1], dtype=WIDE)


@dataclass(frozen=True)
class SampledMotion:
    """M(t) of a prim: it turns about the place of its origin at time 0, and that place shifts."""

    time: np.ndarray
    """Instants of the samples [s], rising, shape (m,), long double."""
    quaternion: np.ndarray
    """B(t) B(0)^-1 at each, scalar first, shape (m, 4)."""
    shift: np.ndarray
    """p(t) - p(0) at each [m], shape (m, 3)."""
    centre: np.ndarray
    """p(0) [m], shape (3,)."""

    @functools.cached_property
    def _spans(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Start [s], spin in M's axes [rad/s] and velocity of p [m/s] from each sample on, and its number.

        One stretch of rest comes before the first sample, one after the last.
        """
        step = times(conjugate(self.quaternion[:-1]), self.quaternion[1:])
        step = np.where(step[:, :1] < 0, -step, step)  # the short way round
        sine = np.sqrt(np.sum(step[:, 1:] ** 2, axis=1))[:, None]
        # at a sine of 0 the axis has no meaning, and the angle is 0
        axis = step[:, 1:] / np.where(sine > 0, sine, 1)
        length = np.diff(self.time)[:, None]
        rest = np.zeros((1, 3), dtype=WIDE)
        spin = np.concatenate([rest, 2 * np.arctan2(sine, step[:, :1]) * axis / length, rest])
        velocity = np.concatenate([rest, np.diff(self.shift, axis=0) / length, rest])
        number = np.concatenate([[0], np.arange(len(self.time))])
        return self.time[number], spin, velocity, number

    @property
    def moves(self) -> bool:
        """Whether it ever moves."""
        return self.turns or bool(np.any(self._spans[2]))

    @property
    def turns(self) -> bool:
        """Whether its axes ever turn."""
        return bool(np.any(self._spans[1]))

    @property
    def max_rate(self) -> float:
        """Largest angular velocity [rad/s]."""
        return float(np.sqrt(np.sum(self._spans[1] ** 2, axis=1)).max())

    def _span(self, time: np.ndarray) -> np.ndarray:
        """Number of the stretch that holds each time; at a sample the one after it."""
        return np.searchsorted(self.time, time, side="right")

    def _place(self, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Quaternions (k, 4) and shifts of p (k, 3) at ``time`` [s]."""
        start, spin, velocity, number = (values[self._span(time)] for values in self._spans)
        since = (time - start)[:, None]
        rate = np.sqrt(np.sum(spin * spin, axis=1))[:, None]
        half = rate * since / 2
        bent = np.concatenate([np.cos(half), np.sin(half) * spin / np.where(rate > 0, rate, 1)], axis=1)
        return times(self.quaternion[number], bent), self.shift[number] + velocity * since

    def pose(self, time: np.ndarray, piece: np.ndarray) -> Pose:
        """Poses at ``time`` [s]; velocities are those of the stretches that hold ``piece`` [s], shapes (k,)."""
        quaternion, shift = self._place(time)
        spin, velocity = (values[self._span(piece)] for values in self._spans[1:3])
        zero = np.zeros_like(spin)
        turn = quaternion_turn_increment(quaternion)
        return compose(shifting_by(shift, velocity, zero), turning_about(self.centre, turn, spin, zero))

    def increments(self, time: np.ndarray) -> Increment:
        """Increments between consecutive instants of ``time`` [s], shape (k + 1,) gives k."""
        quaternion, shift = self._place(time)
        turn = quaternion_turn_increment(times(conjugate(quaternion[1:]), quaternion[:-1]))
        gone = shift[:-1] - shift[1:]
        back = transposed(quaternion_turn_increment(quaternion[1:]))
        return Increment(turn, gone + apply(back, gone) - apply(turn, self.centre))

    def part(self, time: float) -> SampledPart:
        """The place at one instant [s], for writers."""
        at = np.array([time])
        quaternion, _ = self._place(at)
        return SampledPart(quaternion[0].astype(float), self.pose(at, at).origin[0].astype(float))

    def speed(self, points: np.ndarray, slack: float) -> float:
        """Bound of the speed of points within ``slack`` [m] of those given, shape (n, 3) [m/s]."""
        arm = float(np.linalg.norm(points - self.centre.astype(float), axis=1).max()) + slack
        rate, speed = (np.sqrt(np.sum(values**2, axis=1)) for values in self._spans[1:3])
        return float(np.max(speed + rate * arm))

    def swept(self, points: np.ndarray, slack: float, end: float) -> tuple[np.ndarray, float]:
        """Points and slack [m] that hold the given ones at every time up to ``end`` [s]."""
        centre = self.centre.astype(float)
        reach = float(np.linalg.norm(points - centre, axis=1).max()) + slack
        return (self.shift + self.centre).astype(float), reach


def read(file: Path, prim: str, where: str, folders: Sequence[Path] | None = None) -> SampledMotion:
    """The motion of a prim.

    Args:
        file: USD file.
        prim: path of the prim on the stage.
        where: file and key of the scene, for messages.
        folders: folders that all files it refers to must lie in; None is no bound.

    Raises:
        SceneError: there is no such prim, it has no time samples, or a transform holds scale or shear.
    """
    stamp = file.stat() if file.is_file() else None
    return _read(file, prim, where, folders and tuple(folders), stamp and (stamp.st_mtime_ns, stamp.st_size))


@functools.lru_cache(maxsize=32)
def _read(
    file: Path, prim: str, where: str, folders: tuple[Path, ...] | None, stamp: tuple[int, int] | None
) -> SampledMotion:
    """As `read`; ``stamp`` tells the states of a file apart. A scene asks for each of its motions several times."""
    said, arrays = usd_stage.ask(file, "motion", prim, where, folders)
    up = usd_stage.TO_Z_UP[said["up"]]
    for code, matrix in zip(arrays["codes"], arrays["matrices"], strict=True):
        _check_rigid(matrix[:3, :3], f"{where}.prim = {prim!r}: time code {code:g}")
    quaternion = np.array([quaternion_of(up @ matrix[:3, :3]) for matrix in arrays["matrices"]])
    place = (arrays["matrices"][:, :3, 3] @ up.T).astype(WIDE) * WIDE(said["metres"])
    return _relative(arrays["codes"].astype(WIDE) / WIDE(said["rate"]), quaternion, place)


def _relative(time: np.ndarray, quaternion: np.ndarray, place: np.ndarray) -> SampledMotion:
    """M(t) = X(t) X(0)^-1 from X at the samples."""
    nowhere = np.zeros(3, dtype=WIDE)
    absolute = SampledMotion(time, quaternion, place, nowhere)
    turn, centre = absolute._place(np.zeros(1))
    relative = times(quaternion, conjugate(turn))
    return SampledMotion(time, relative, place - centre, centre[0])


def _check_rigid(matrix: np.ndarray, where: str) -> None:
    off = float(np.abs(matrix @ matrix.T - np.eye(3)).max())
    if off > RIGID_TOLERANCE or np.linalg.det(matrix) < 0.0:
        lengths = ", ".join(f"{length:.6g}" for length in np.linalg.norm(matrix, axis=0))
        raise SceneError(
            f"{where}: a transform with scale, shear or mirroring is no rigid motion; lengths of its axes are "
            f"{lengths}, allowed is 1 within {RIGID_TOLERANCE:g} at right angles"
        )


def quaternion_of(matrix: np.ndarray) -> np.ndarray:
    """Unit quaternion, scalar first, of the turn nearest to a matrix, shape (4,), long double."""
    left, _, right = np.linalg.svd(matrix)
    m = left @ right
    # the largest of the four squares decides the form, so that nothing small is divided by
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
    return q / np.sqrt(np.sum(q * q))
