r"""Harmonic spring to a point.

    F = -k (q - c),     U = (k/2) |q - c|^2

    k   stiffness, the same for every grain   [N/m]
    c   centre                                [m]
    q   position of the grain's centre        [m]

A grain of mass m swings with omega = sqrt(k/m) about c. Source: Hooke; the oscillator of Delacroix et al. 2020. The force
grows without bound with the distance; grains of one k and different masses swing at different rates.
"""

import functools

import numpy as np
import warp as wp
from warpdem.kernels.field import Numbers

PARAMETERS = {"stiffness": ("N/m", 1, None), "centre": ("m", 3, (0.0, 0.0, 0.0))}


@functools.cache
def build():
    """Return the force."""

    @wp.func
    def force(
        q: wp.vec3d, v: wp.vec3d, mass: wp.float64, radius: wp.float64, time: wp.float64, p: Numbers
    ) -> wp.vec3d:
        """Force on a grain [N]."""
        return (wp.vec3d(p[1], p[2], p[3]) - q) * p[0]

    return force


def rate(mass, p):
    """Angular frequency of the swing sqrt(|k|/m) [rad/s], shape (n,), of grains of ``mass`` [kg]."""
    return np.sqrt(abs(p[0]) / mass)


def energy(position, mass, radius, p):
    """Energy of the spring [J], shape (n,), of grains at ``position`` [m], shape (n, 3)."""
    return 0.5 * p[0] * ((position - p[1:4]) ** 2).sum(axis=1)
