r"""Lorentz force of uniform, constant electric and magnetic fields.

    F = e (E + v x B),     U = -e E . q

    e   charge, the same for every grain   [C]
    B   magnetic flux density              [T]
    E   electric field                     [V/m]
    q   position of the grain's centre     [m]
    v   velocity of the grain's centre     [m/s]

Without E a grain of mass m circles with the angular velocity -e B/m, on a radius m v/(e B). Source: Lorentz 1895; the
velocity-dependent force beside Coriolis' of Delacroix et al. 2020. Speeds far below that of light; E and B are those of the
field's own axes (in frame axes v is relative to the frame). Grains do not act on each other by their charges.
"""

import functools

import numpy as np
import warp as wp
from warpdem.kernels.field import Numbers

PARAMETERS = {
    "charge": ("C", 1, None),
    "magnetic": ("T", 3, (0.0, 0.0, 0.0)),
    "electric": ("V/m", 3, (0.0, 0.0, 0.0)),
}


@functools.cache
def build():
    """Return the force."""

    @wp.func
    def force(
        q: wp.vec3d, v: wp.vec3d, mass: wp.float64, radius: wp.float64, time: wp.float64, p: Numbers
    ) -> wp.vec3d:
        """Force on a grain [N]."""
        return (wp.vec3d(p[4], p[5], p[6]) + wp.cross(v, wp.vec3d(p[1], p[2], p[3]))) * p[0]

    return force


def rate(mass, p):
    """Angular velocity of the circle |e B|/m [rad/s], shape (n,), of grains of ``mass`` [kg]."""
    return np.linalg.norm(p[0] * p[1:4]) / mass


def energy(position, mass, radius, p):
    """Energy in the electric field [J], zero at the origin, shape (n,), of grains at ``position`` [m], shape (n, 3)."""
    return -p[0] * (position @ p[4:7])
