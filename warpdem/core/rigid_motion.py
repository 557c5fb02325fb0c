"""Kinematics of rigid motions at many times at once: poses of bodies within bodies, and the increments between times.

A pose maps body points to outer points, x_outer = A x + o, and gives the velocity and acceleration of the body's points,

    v(x) = u + w x x,      a(x) = a + w' x x + w x (w x x)     (of the body's point at x = 0: u and a)

all of them resolved in body axes. A body 2 within a body 1 within the laboratory (primes: derivatives; A = A2, o = o2):

    A_12 = A1 A2,   o_12 = A1 o2 + o1
    w = A^T w1 + w2,                     u = A^T (u1 + w1 x o) + u2
    w' = A^T w1' + w2' - w2 x A^T w1,    a = A^T (a1 + w1' x o + w1 x (w1 x o)) + 2 A^T w1 x u2 + a2

The increment D = G'^-1 G - I between two poses G and G' moves a point at rest outside from x to x + D x in body axes. It
is never computed as a difference of poses: D = D2 + G2'^-1 D1 G2.

All numbers are long doubles, so that the results rounded to double are exact, at large angles too.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

WIDE = np.longdouble
PI = WIDE("3.14159265358979323846264338327950288")


@dataclass(frozen=True)
class Pose:
    """Position, orientation and motion of a body at k times, relative to the body or laboratory around it."""

    axes: np.ndarray
    """A, body axes to outer axes, shape (k, 3, 3)."""
    origin: np.ndarray
    """o, the body's origin in outer axes [m], shape (k, 3)."""
    spin: np.ndarray
    """w, angular velocity [rad/s], shape (k, 3)."""
    velocity: np.ndarray
    """u, velocity of the body's origin [m/s], shape (k, 3)."""
    spin_rate: np.ndarray
    """w', angular acceleration [rad/s2], shape (k, 3)."""
    acceleration: np.ndarray
    """a, acceleration of the body's origin [m/s2], shape (k, 3)."""

    def __getitem__(self, which: slice) -> "Pose":
        return Pose(*(getattr(self, field.name)[which] for field in fields(self)))


@dataclass(frozen=True)
class Increment:
    """D at k steps: x goes to x + rotation x + shift."""

    rotation: np.ndarray
    """R - I, shape (k, 3, 3)."""
    shift: np.ndarray
    """Displacement [m], shape (k, 3)."""


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross products of rows, shape (k, 3) (np.cross takes five times as long on few rows)."""
    after, before = [1, 2, 0], [2, 0, 1]
    return np.asarray(a[:, after] * b[:, before] - a[:, before] * b[:, after])


def apply(matrices: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Product of each matrix with its vector, shapes (k, 3, 3) and (k, 3), or with one for all, shape (3,)."""
    product: np.ndarray = np.einsum("kij,kj->ki" if vectors.ndim == 2 else "kij,j->ki", matrices, vectors)
    return product


def transposed(matrices: np.ndarray) -> np.ndarray:
    """Each matrix transposed, shape (k, 3, 3)."""
    return matrices.swapaxes(1, 2)


def cross_matrix(vectors: np.ndarray) -> np.ndarray:
    """Matrices [a]x with [a]x b = a x b, shape (..., 3, 3)."""
    x, y, z = np.moveaxis(np.asarray(vectors), -1, 0)
    zero = np.zeros_like(x)
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(*np.shape(x), 3, 3)


def unit(vector: Sequence[float] | np.ndarray) -> np.ndarray:
    """Unit vector along a vector, in long double, shape (3,)."""
    wide = np.asarray(vector, dtype=WIDE)
    return np.asarray(wide / np.sqrt(np.sum(wide * wide)))


def rotation_increment(axis: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """R - I of the rotation by ``angle`` [rad], shape (k,), about a unit axis; shape (k, 3, 3), exact for small angles."""
    across = cross_matrix(axis)
    angle = np.asarray(angle)[:, None, None]
    half = np.sin(angle / 2)
    return np.asarray(np.sin(angle) * across + 2 * half * half * (across @ across))


def quaternion_rotation_increment(q: np.ndarray) -> np.ndarray:
    """R - I of unit quaternions (scalar first), shapes (k, 4) and (k, 3, 3); exact for small rotations."""
    across = cross_matrix(q[:, 1:])
    return np.asarray(2 * (q[:, :1, None] * across + across @ across))


def still(count: int) -> Pose:
    """Pose of a body at rest, at ``count`` times."""
    zero = np.zeros((count, 3), dtype=WIDE)
    return Pose(np.tile(np.eye(3, dtype=WIDE), (count, 1, 1)), zero, zero, zero, zero, zero)


def rotation_about(centre: np.ndarray, increment: np.ndarray, spin: np.ndarray, spin_rate: np.ndarray) -> Pose:
    """Pose of a body that rotates about the point c = ``centre`` [m], shape (3,), with ``increment`` D = R - I.

    A = I + D, o = -D c, u = -w x c, a = -w' x c - w x (w x c).
    """
    arm = np.broadcast_to(centre, spin.shape)
    velocity = -cross(spin, arm)
    acceleration = cross(spin, velocity) - cross(spin_rate, arm)
    return Pose(np.eye(3, dtype=WIDE) + increment, -apply(increment, centre), spin, velocity, spin_rate, acceleration)


def translation_by(shift: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray) -> Pose:
    """Pose of a body that only translates, arrays of shape (k, 3)."""
    at_rest = still(len(shift))
    return Pose(at_rest.axes, shift, at_rest.spin, velocity, at_rest.spin_rate, acceleration)


def compose(outer: Pose, inner: Pose) -> Pose:
    """Pose, relative to the surroundings of ``outer``, of the body whose pose within ``outer`` is ``inner``."""
    back, o = transposed(inner.axes), inner.origin
    spin, spin_rate = apply(back, outer.spin), apply(back, outer.spin_rate)
    transport = outer.acceleration + cross(outer.spin_rate, o) + cross(outer.spin, cross(outer.spin, o))
    return Pose(
        axes=outer.axes @ inner.axes,
        origin=apply(outer.axes, o) + outer.origin,
        spin=spin + inner.spin,
        velocity=apply(back, outer.velocity + cross(outer.spin, o)) + inner.velocity,
        spin_rate=spin_rate + inner.spin_rate - cross(inner.spin, spin),
        acceleration=apply(back, transport) + 2 * cross(spin, inner.velocity) + inner.acceleration,
    )


def chained(outer: Increment, inner: Increment, before: Pose, after: Pose) -> Increment:
    """Increment of ``compose(outer, inner)``: D2 + G2'^-1 D1 G2, with the inner body's poses before and after."""
    back = transposed(after.axes)
    shift = apply(outer.rotation, before.origin) + outer.shift
    return Increment(inner.rotation + back @ outer.rotation @ before.axes, inner.shift + apply(back, shift))


def rounded(exact: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Doubles for the long doubles of each ``step``, shapes (k, n) and (k,), without bias over many steps.

    At a constant rate every step would have the same rounding error: some 1e-17 rad a step, 1e-11 after a million. So each
    number is rounded up in some steps and down in others, in proportion to its distance from the two doubles around it. The
    choice depends on the step number alone, so that equal times have equal bits. Needs a long double of more than 64 bits;
    with a shorter one nothing changes.
    """
    nearest = exact.astype(np.float64)
    unit_last = np.spacing(np.abs(nearest))
    # in units in the last place, -0.5 ... 0.5: the additional bits of a long double
    miss = ((exact - nearest) / unit_last).astype(np.float64)
    k = step[:, None]
    return np.asarray(nearest + unit_last * (np.floor((k + 1) * miss + 0.5) - np.floor(k * miss + 0.5)))
