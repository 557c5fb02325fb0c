"""What changes with time and is known beforehand: one row per force call, made on the host, read by every kernel.

Row (29 numbers)                                     Placement of a wall motion (24 numbers)
    0        slip time: dt, 0 at time 0              0..8    A, body axes -> frame axes
    1        kick time: dt, dt/2 at the first            9..11   t: x_frame = A x_body + t        [m]
    2..4     gravity in frame axes       [m/s2]          12..14  angular velocity                 [rad/s]
    5..13    R - I of the drift from t_k to t_k+1        15..17  velocity of the body's point at
    14..16   shift of that drift         [m]                     the frame origin                 [m/s]
    17..25   R - I of the step before
    26..28   shift of the step before    [m]             absolute, or relative to the frame for a scheme that works there
                                                         18..20  velocity V of its surface          [m/s]
                                                         21..23  speed of its surface times axis a  [m/s]

The surface of a wall may move along itself relative to the wall: by V - n (n . V) + a x n, n the normal to the grain.

A point fixed in the laboratory goes from x to x + (R - I) x + shift in frame axes. Vectors are resolved in the axes of their
own time.

FrameRow (31 numbers), only for what needs the frame itself: schemes with frame-relative velocities, external fields
    0..8     A, frame axes -> laboratory axes
    9..11    o: x_lab = A x_frame + o                   [m]
    12..14   angular velocity of the frame at t-         [rad/s]
    15..17   velocity of the frame's origin at t-        [m/s]
    18..23   the same two at t+: they differ where the frame jumps
    24..26   angular acceleration                        [rad/s2]
    27..29   acceleration of the frame's origin          [m/s2]
    30       time                                        [s]
Angular velocity, velocity and accelerations are absolute, resolved in frame axes; at a kink the accelerations are the mean
of both sides.
"""

import warp as wp

Row = wp.types.vector(29, wp.float64)
FrameRow = wp.types.vector(31, wp.float64)
Placement = wp.types.vector(24, wp.float64)


@wp.func
def slip_time(row: Row) -> wp.float64:
    """Time over which springs have slipped since the last force call [s]."""
    return row[0]


@wp.func
def kick_time(row: Row) -> wp.float64:
    """Time over which this acceleration kicks [s]."""
    return row[1]


@wp.func
def gravity(row: Row) -> wp.vec3d:
    """Gravity in frame axes [m/s2]."""
    return wp.vec3d(row[2], row[3], row[4])


@wp.func
def drift_rotation(row: Row) -> wp.mat33d:
    """R - I of the drift that follows."""
    return wp.mat33d(row[5], row[6], row[7], row[8], row[9], row[10], row[11], row[12], row[13])


@wp.func
def drift_shift(row: Row) -> wp.vec3d:
    """Shift of the drift that follows [m]."""
    return wp.vec3d(row[14], row[15], row[16])


@wp.func
def last_drift_rotation(row: Row) -> wp.mat33d:
    """R - I of the drift that led here."""
    return wp.mat33d(row[17], row[18], row[19], row[20], row[21], row[22], row[23], row[24], row[25])


@wp.func
def last_drift_shift(row: Row) -> wp.vec3d:
    """Shift of the drift that led here [m]."""
    return wp.vec3d(row[26], row[27], row[28])


@wp.func
def frame_axes(f: FrameRow) -> wp.mat33d:
    """Rotation from frame axes to laboratory axes."""
    return wp.mat33d(f[0], f[1], f[2], f[3], f[4], f[5], f[6], f[7], f[8])


@wp.func
def frame_origin(f: FrameRow) -> wp.vec3d:
    """The frame's origin in the laboratory [m]."""
    return wp.vec3d(f[9], f[10], f[11])


@wp.func
def frame_spin(f: FrameRow) -> wp.vec3d:
    """Angular velocity of the frame at t- [rad/s]."""
    return wp.vec3d(f[12], f[13], f[14])


@wp.func
def frame_velocity(f: FrameRow, q: wp.vec3d) -> wp.vec3d:
    """Absolute velocity of the frame's point ``q`` at t- [m/s]."""
    return wp.vec3d(f[15], f[16], f[17]) + wp.cross(frame_spin(f), q)


@wp.func
def spin_jump(f: FrameRow) -> wp.vec3d:
    """Jump of the frame's angular velocity at this time [rad/s]."""
    return wp.vec3d(f[18] - f[12], f[19] - f[13], f[20] - f[14])


@wp.func
def velocity_jump(f: FrameRow, q: wp.vec3d) -> wp.vec3d:
    """Jump of the velocity of the frame's point ``q`` at this time [m/s]."""
    return wp.vec3d(f[21] - f[15], f[22] - f[16], f[23] - f[17]) + wp.cross(spin_jump(f), q)


@wp.func
def frame_angular_acceleration(f: FrameRow) -> wp.vec3d:
    """Angular acceleration of the frame [rad/s2]."""
    return wp.vec3d(f[24], f[25], f[26])


@wp.func
def frame_acceleration(f: FrameRow) -> wp.vec3d:
    """Absolute acceleration of the frame's origin, resolved in frame axes [m/s2]."""
    return wp.vec3d(f[27], f[28], f[29])


@wp.func
def time_of(f: FrameRow) -> wp.float64:
    """Time [s]."""
    return f[30]


@wp.func
def axes(p: Placement) -> wp.mat33d:
    """Rotation from body axes to frame axes."""
    return wp.mat33d(p[0], p[1], p[2], p[3], p[4], p[5], p[6], p[7], p[8])


@wp.func
def local(p: Placement, point: wp.vec3d) -> wp.vec3d:
    """Body coordinates of a point given in frame axes [m]."""
    return wp.transpose(axes(p)) * (point - wp.vec3d(p[9], p[10], p[11]))


@wp.func
def rotated(p: Placement, vector: wp.vec3d) -> wp.vec3d:
    """A body-axes direction in frame axes."""
    return axes(p) * vector


@wp.func
def placed(p: Placement, point: wp.vec3d) -> wp.vec3d:
    """Frame coordinates of a body point [m]."""
    return axes(p) * point + wp.vec3d(p[9], p[10], p[11])


@wp.func
def wall_spin(p: Placement) -> wp.vec3d:
    """Angular velocity of the wall [rad/s]."""
    return wp.vec3d(p[12], p[13], p[14])


@wp.func
def wall_velocity(p: Placement, point: wp.vec3d) -> wp.vec3d:
    """Velocity of the wall's material at a frame point [m/s]."""
    return wp.vec3d(p[15], p[16], p[17]) + wp.cross(wall_spin(p), point)


@wp.func
def surface_vector(p: Placement) -> wp.vec3d:
    """Velocity of the wall's surface relative to the wall, before its part along the normal is taken off [m/s]."""
    return wp.vec3d(p[18], p[19], p[20])


@wp.func
def surface_circulation(p: Placement) -> wp.vec3d:
    """Speed of the wall's surface around an axis, times that axis [m/s]."""
    return wp.vec3d(p[21], p[22], p[23])


@wp.func
def surface_velocity(vector: wp.vec3d, circulation: wp.vec3d, n: wp.vec3d) -> wp.vec3d:
    """Velocity of the surface relative to the wall where its normal is ``n`` [m/s]."""
    return vector - n * wp.dot(n, vector) + wp.cross(circulation, n)
