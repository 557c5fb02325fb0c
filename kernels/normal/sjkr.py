r"""Hertz contact with a pull per contact area, "simplified JKR": what LIGGGHTS calls ``cohesion sjkr``; for decks from there.

    F_n = K d^(3/2) - C d^(1/4) v_n - k_c A

    A    area of the disc in which two spheres cut each other; of the cap cut off by a wall       [m2]
    k_c  cohesion energy density (``cohesionEnergyDensity``)                                      [J/m3]
    others as in ``hertz``

With c = 1/(R_i + R_j), 0 at a wall, the disc follows from R*, c and the overlap d without cancellation:

    A = pi d (2 - c d)(4 R* - 2 d + c d^2) / (4 (1 - c d)^2)

The pull vanishes with the overlap: no jump, no energy lost, nothing sticks but by its dashpot, and a stiffer grain is pulled
less. It has no more of JKR than the name; ``jkr`` is the theory. Friction goes by the force without the pull, as there
(``tangential_reduce off``).
"""

import functools
import math

import numpy as np
import warp as wp
from warpdem.kernels.contact import columns
from warpdem.kernels.contact.columns import PairKey
from warpdem.kernels.normal import hertz

SUMMARY = "Hertz with a pull per contact area, as in LIGGGHTS"
PASSIVE = True
CLOSENESS = True
TANGENT = hertz.TANGENT
PAIR = {
    "cohesion_energy_density": PairKey("J/m3", None, 'Pull per contact area [J/m3], >= 0; only with normal = "sjkr".'),
}
COEFFICIENTS = {"cohesion": "J/m3", "reduced_radius": "m", "closeness": "1/m"}  # of materials: pi k_c/4, and nothing yet
damped_time, stiffness = hertz.damped_time, hertz.stiffness
at = columns.scalars(COEFFICIENTS)
NODES, WEIGHTS = np.polynomial.legendre.leggauss(10)


def coefficients(a, b, pair) -> tuple[float, ...]:
    """Those of ``hertz``; (pi/4) k_c [J/m3], and two that a contact only has."""
    return *hertz.coefficients(a, b, pair), 0.25 * math.pi * pair.cohesion_energy_density, 0.0, 0.0


def own_constants(radius, cohesion, reduced_radius, closeness):
    """Constants of contacts with a wall, for readers, and for estimates of those of two grains, where c d is small."""
    return {"cohesion": cohesion, "reduced_radius": radius, "closeness": 0.0 * radius}


def disc(overlap, reduced_radius, closeness):
    """4 A/pi [m2]."""
    left = 1.0 - closeness * overlap
    return overlap * (1.0 + left) * (4.0 * reduced_radius - overlap * (1.0 + left)) / left**2


@functools.cache
def build(real):
    """Return (contact constants, force) for ``real`` (wp.float32 or wp.float64)."""
    Own = at.vector(real)
    Nothing = columns.scalars({}).vector(real)
    constants_of_hertz, force_of_hertz = hertz.build(real)

    @wp.func
    def constants(base: real, damping: real, own: Own, radius: real, mass: real, closeness: real):
        """K [N/m^1.5], C [N s/m^1.25], (pi/4) k_c [J/m3], R* [m] and 1/(R_i + R_j) [1/m] of one contact."""
        stiffness, dashpot = constants_of_hertz(base, damping, radius, mass)
        return stiffness, dashpot, Own(own[wp.static(at.cohesion)], radius, closeness)

    @wp.func
    def force(
        overlap: real, overlap_before: real, speed: real, stiffness: real, damping: real, own: Own, nothing: Nothing
    ):
        """F_n and Coulomb load [N], k_n [N/m], gamma_n [N s/m], depth now and before [m], no history."""
        pressed, spring, dashpot = force_of_hertz(overlap, speed, stiffness, damping)
        depth = overlap if overlap > real(0.0) else real(0.0)
        left = real(1.0) - own[wp.static(at.closeness)] * depth
        twice = depth * (real(1.0) + left)
        area = twice * (real(4.0) * own[wp.static(at.reduced_radius)] - twice) / (left * left)
        load = pressed if pressed > real(0.0) else real(0.0)
        f_n = pressed - own[wp.static(at.cohesion)] * area
        return f_n, load, spring, dashpot, overlap, overlap_before, nothing

    return constants, force


def secant(overlap, stiffness, cohesion, reduced_radius, closeness):
    """K sqrt(d) [N/m]."""
    return stiffness * np.maximum(overlap, 0.0) ** 0.5


def slope(overlap, stiffness, cohesion, reduced_radius, closeness):
    """(3/2) K sqrt(d) [N/m]: the pull, which only softens, is left out."""
    return TANGENT * secant(overlap, stiffness, cohesion, reduced_radius, closeness)


def adhesion(stiffness, radius, cohesion, reduced_radius, closeness):
    """Largest pull [N], energy that a touch costs, none [J], and no third number; at a wall, between grains larger by some d/R.

    With x = sqrt(d) and 2 k_c pi = 8 ``cohesion`` the slope is zero where 2 k x^2 + (3/2) K x - 2 k R* = 0, k = k_c pi.
    """
    pull = 4.0 * cohesion
    root = 4.0 * pull * radius / (1.5 * stiffness + np.sqrt((1.5 * stiffness) ** 2 + 16.0 * pull**2 * radius))
    return pull * root**2 * (2.0 * radius - root**2) - stiffness * root**3, 0.0, None


def energy(overlap, stiffness, cohesion, reduced_radius, closeness):
    """(2/5) K d^(5/2) less the integral of k_c A up to d, by Gauss's rule [J]; 0 beyond contact."""
    depth = np.maximum(overlap, 0.0)
    area = sum(w * disc(0.5 * (x + 1.0) * depth, reduced_radius, closeness) for x, w in zip(NODES, WEIGHTS, strict=True))
    return hertz.energy(depth, stiffness) - cohesion * 0.5 * depth * area
