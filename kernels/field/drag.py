r"""Drag that is linear in the velocity relative to a uniform flow.

    F = -c (v - u)

    c   coefficient, the same for every grain   [kg/s]
    u   velocity of the flow                    [m/s]
    v   velocity of the grain's centre          [m/s]

Stokes 1851: a sphere of radius R in a fluid of viscosity eta has c = 6 pi eta R, valid for a particle Reynolds number well
below 1. The velocity alone decays as exp(-c t/m). No torque acts on the spin; no buoyancy, added mass or shielding by
neighbours.
"""

import functools

import warp as wp
from warpdem.kernels.field import Numbers

PARAMETERS = {"coefficient": ("kg/s", 1, None), "flow": ("m/s", 3, (0.0, 0.0, 0.0))}


@functools.cache
def build():
    """Return the force."""

    @wp.func
    def force(
        q: wp.vec3d, v: wp.vec3d, mass: wp.float64, radius: wp.float64, time: wp.float64, p: Numbers
    ) -> wp.vec3d:
        """Force on a grain [N]."""
        return (wp.vec3d(p[1], p[2], p[3]) - v) * p[0]

    return force


def rate(mass, p):
    """Rate of decay |c|/m [1/s], shape (n,), of the velocity of grains of ``mass`` [kg]."""
    return abs(p[0]) / mass
