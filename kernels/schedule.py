"""What changes with time and is known beforehand: one row per step, made on the host, read by every kernel.

Row (26 numbers)                                     Placement of a wall motion (18 numbers)
    0        slip time: dt, 0 at the first instant       0..8    A, body axes -> frame axes
    1        kick time: dt, dt/2 at the first            9..11   t: x_frame = A x_body + t        [m]
    2..4     gravity in frame axes       [m/s2]          12..14  absolute angular velocity        [rad/s]
    5..13    R - I of the drift from t_k to t_k+1        15..17  absolute velocity of the body's
    14..22   R - I of the step before                            point at the frame origin        [m/s]
    23..25   point of the axis           [m]

Vectors are resolved in the axes of their own instant.
"""

import warp as wp

Row = wp.types.vector(26, wp.float64)
Placement = wp.types.vector(18, wp.float64)


@wp.func
def slip_time(row: Row) -> wp.float64:
    """Time over which springs have slipped since the last force call [s]."""
    return row[0]


@wp.func
def kick_time(row: Row) -> wp.float64:
    """Time over which this instant's acceleration kicks [s]."""
    return row[1]


@wp.func
def gravity(row: Row) -> wp.vec3d:
    """Gravity in frame axes [m/s2]."""
    return wp.vec3d(row[2], row[3], row[4])


@wp.func
def drift_turn(row: Row) -> wp.mat33d:
    """R - I of the drift that follows."""
    return wp.mat33d(row[5], row[6], row[7], row[8], row[9], row[10], row[11], row[12], row[13])


@wp.func
def past_turn(row: Row) -> wp.mat33d:
    """R - I of the drift that led here."""
    return wp.mat33d(row[14], row[15], row[16], row[17], row[18], row[19], row[20], row[21], row[22])


@wp.func
def pivot(row: Row) -> wp.vec3d:
    """A point of the rotation axis [m]."""
    return wp.vec3d(row[23], row[24], row[25])


@wp.func
def axes(p: Placement) -> wp.mat33d:
    """Turn from body axes to frame axes."""
    return wp.mat33d(p[0], p[1], p[2], p[3], p[4], p[5], p[6], p[7], p[8])


@wp.func
def local(p: Placement, point: wp.vec3d) -> wp.vec3d:
    """Body coordinates of a point given in frame axes [m]."""
    return wp.transpose(axes(p)) * (point - wp.vec3d(p[9], p[10], p[11]))


@wp.func
def turned(p: Placement, vector: wp.vec3d) -> wp.vec3d:
    """A body-axes direction in frame axes."""
    return axes(p) * vector


@wp.func
def placed(p: Placement, point: wp.vec3d) -> wp.vec3d:
    """Frame coordinates of a body point [m]."""
    return axes(p) * point + wp.vec3d(p[9], p[10], p[11])


@wp.func
def wall_spin(p: Placement) -> wp.vec3d:
    """Absolute angular velocity of the wall [rad/s]."""
    return wp.vec3d(p[12], p[13], p[14])


@wp.func
def wall_velocity(p: Placement, point: wp.vec3d) -> wp.vec3d:
    """Absolute velocity of the wall's material at a frame point [m/s]."""
    return wp.vec3d(p[15], p[16], p[17]) + wp.cross(wall_spin(p), point)
