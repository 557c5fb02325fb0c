r"""Harmonic spring to the z axis: the external field that holds the pairs of ``measure.py`` together.

    F = -k (x, y, 0)

    k   stiffness, the same for every grain   [N/m]

The z axis of the axes that the field lives in. Unlike a spring to a point it is the same for any number of copies along z.
"""

import functools

import warp as wp
from warpdem.kernels.field import Numbers

PARAMETERS = {"stiffness": ("N/m", 1, None)}


@functools.cache
def build():
    """Return the force."""

    @wp.func
    def force(
        q: wp.vec3d, v: wp.vec3d, mass: wp.float64, radius: wp.float64, time: wp.float64, p: Numbers
    ) -> wp.vec3d:
        """Force on a grain [N]."""
        return wp.vec3d(q[0], q[1], wp.float64(0.0)) * (-p[0])

    return force
