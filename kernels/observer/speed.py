r"""Speed of the grain's centre, |v|. In laboratory axes absolute, in frame axes relative to the frame."""

import functools

import warp as wp
from warpdem.kernels.field import Numbers

UNIT = "m/s"
PARAMETERS = {}


@functools.cache
def build():
    """Return the observer."""

    @wp.func
    def observe(
        q: wp.vec3d, v: wp.vec3d, w: wp.vec3d, mass: wp.float64, radius: wp.float64, time: wp.float64, p: Numbers
    ) -> wp.float64:
        """Speed of a grain [m/s]."""
        return wp.length(v)

    return observe
