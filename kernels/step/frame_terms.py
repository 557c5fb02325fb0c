"""The apparent accelerations of a moving frame, for schemes that hold velocities relative to it.

    a = -2 w x v - w x (w x q) - w' x q - o'',     b = -w x s - w'

q, v, s position, velocity and spin relative to the frame, w its angular velocity, w' its angular acceleration, o'' the
acceleration of its origin, all in frame axes (Coriolis, centrifugal, Euler and linear term; the spin counterpart of a body
whose moments of inertia are equal). Where w or the frame's velocity jumps, relative velocities jump by the opposite.
"""

import functools

import warp as wp
from warpdem.kernels import KernelSet
from warpdem.kernels.step.schedule import (
    FrameRow,
    frame_acceleration,
    frame_angular_acceleration,
    frame_spin,
    spin_jump,
    velocity_jump,
)


@functools.cache
def build(moving_frame: bool):
    """Return the terms; all are zero when the frame never moves."""

    @wp.func
    def spin_before(f: FrameRow) -> wp.vec3d:
        """Angular velocity of the frame just before this time [rad/s]."""
        return frame_spin(f)

    @wp.func
    def spin_after(f: FrameRow) -> wp.vec3d:
        """Angular velocity of the frame just after this time [rad/s]."""
        return frame_spin(f) + spin_jump(f)

    @wp.func
    def coriolis(omega: wp.vec3d, v: wp.vec3d) -> wp.vec3d:
        return wp.cross(omega, v) * wp.float64(-2.0)

    @wp.func
    def of_place(f: FrameRow, omega: wp.vec3d, q: wp.vec3d) -> wp.vec3d:
        """The terms that do not depend on the velocity: centrifugal, Euler and linear [m/s2]."""
        out = -wp.cross(omega, wp.cross(omega, q)) - wp.cross(frame_angular_acceleration(f), q)
        return out - frame_acceleration(f)

    @wp.func
    def of_spin(f: FrameRow, omega: wp.vec3d, s: wp.vec3d) -> wp.vec3d:
        """Apparent angular acceleration [rad/s2]."""
        return wp.cross(s, omega) - frame_angular_acceleration(f)

    @wp.func
    def read(frames: wp.array(dtype=FrameRow), at: int) -> FrameRow:
        if wp.static(moving_frame):
            return frames[at]
        return FrameRow()

    return KernelSet(
        read=read,
        spin_before=spin_before,
        spin_after=spin_after,
        coriolis=coriolis,
        of_place=of_place,
        of_spin=of_spin,
        angular_acceleration=frame_angular_acceleration,
        spin_jump=spin_jump,
        velocity_jump=velocity_jump,
    )
