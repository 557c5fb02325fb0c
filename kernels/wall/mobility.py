"""How a wall yields where it is pushed: one over the mass that a force along the unit vector n at its point p meets.

    1/M_eff = y (n . B n + (r x n) . J (r x n)),     r = p - c

    slider      B = a a/M, J = 0          a  its axis
    hinge       B = 0, J = a a/I          c  a point on the axis
    free body   B = 1/M, J = I^-1         c  its center of mass

in the axes of the wall; y is 0 in a step in which the wall is held or rests on the end of its range. Of any other wall all is
zero: walls that move by a schedule yield to nothing, and servos hold a load with whatever mass.
"""

import warp as wp
from warpdem.kernels.contact.columns import Columns

MOBILITY = Columns(
    (
        ("yields", 1),  # y: 1, or 0 where nothing can push it
        ("center", 3),  # c [m]
        ("inverse_mass", 6),  # B: xx, yy, zz, xy, xz, yz [1/kg]
        ("inverse_inertia", 6),  # J: xx, yy, zz, xy, xz, yz [1/(kg m2)]
    )
)
"""What the mobility of a wall is made of."""
Mobility = MOBILITY.vector(wp.float64)


@wp.func
def inverse_mass(m: Mobility, n: wp.vec3d, point: wp.vec3d) -> wp.float64:
    """1/M_eff of a wall along ``n`` at ``point`` [m], both in its axes [1/kg]."""
    two = wp.float64(2.0)
    t = wp.cross(point - wp.vec3d(m[1], m[2], m[3]), n)
    translation = n[0] * (m[4] * n[0] + two * (m[7] * n[1] + m[8] * n[2])) + n[1] * (m[5] * n[1] + two * m[9] * n[2])
    rotation = t[0] * (m[10] * t[0] + two * (m[13] * t[1] + m[14] * t[2])) + t[1] * (m[11] * t[1] + two * m[15] * t[2])
    return m[0] * (translation + m[6] * n[2] * n[2] + rotation + m[12] * t[2] * t[2])


assert MOBILITY.width == 16, "inverse_mass is written for these columns"
