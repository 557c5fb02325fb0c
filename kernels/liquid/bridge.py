r"""Pull of a liquid bridge: the full fit of Willett, Adams, Johnson and Seville (2000) to the Young-Laplace equation.

    F = 2 pi R g exp(f1 - f2 exp(f3 ln S+ + f4 ln^2 S+)),     S+ = S/(2 sqrt(V/R)),     R = 2 R*
    S_r = (1 + theta/2) (V^(1/3) + V^(2/3)/(10 R))

    S      gap between the surfaces, 0 in contact    [m]
    V      volume of the bridge                      [m3]
    g      surface tension                           [N/m]
    theta  contact angle                             [rad]
    R*     reduced radius, that of the grain at a wall: unequal grains as equal ones of radius 2 R*

f1 to f4 are polynomials in ln(V/R^3) and theta (``FIT``). Within 3 % of the Young-Laplace profile in contact, 2 % beyond and
4 % near rupture, for V/R^3 from 1e-5 to 0.1 and theta up to 50 degrees; outside of this range of volumes f1 to f4 keep their
values at its end. Gravity does not deform the bridge.
"""

import functools

import numpy as np
import warp as wp
from warpdem.kernels import KernelSet, series, tiny
from warpdem.kernels.contact import liquid
from warpdem.kernels.contact.columns import scalars
from warpdem.kernels.simd.values import only_where_needed

PAIR, problems = liquid.PAIR, liquid.problems
SUMMARY = "liquid bridges, Willett's fit to Young-Laplace"
FIT = (
    ((-0.44507, 0.050832, -1.1466), (-0.1119, -0.000411, -0.1490), (-0.012101, -0.0036456, -0.01255),
     (-0.0005, -0.0003505, -0.00029076)),
    ((1.9222, -0.57473, -1.2918), (-0.0668, -0.1201, -0.22574), (-0.0013375, -0.0068988, -0.01137)),
    ((1.268, -0.01396, -0.23566), (0.198, 0.092, -0.06418), (0.02232, 0.02238, -0.009853), (0.0008585, 0.001318, -0.00053)),
    ((-0.010703, 0.073776, -0.34742), (0.03345, 0.04543, -0.09056), (0.0018574, 0.004456, -0.006257)),
)  # fmt: skip
"""Of f1 to f4: a row per power of ln(V/R^3), and in it the factors of 1, theta and theta^2."""
VOLUMES = 1.0e-5, 0.1
"""V/R^3 that the fit was made for [-]."""
NEAREST = 1.0e-9  # S+ below which the gap counts as that: F is that in contact to double precision
FORMED = {"touching": "N", "f2": "-", "f3": "-", "f4": "-", "work": "J"}
"""Pull in contact, f2 to f4, and the work from contact to rupture."""
BRIDGE = scalars(["rupture", "square", *FORMED])
NODES, WEIGHTS = np.polynomial.legendre.leggauss(16)


def rupture(volume, radius, wetting):
    """Rupture distance [m] of bridges."""
    root = np.cbrt(volume)
    return (1.0 + 0.5 * np.arccos(wetting)) * (root + root**2 / (20.0 * radius))


def exponents(volume, radius, wetting):
    """f1 to f4 [-] of bridges."""
    theta, logarithm = np.arccos(wetting), np.log(np.clip(volume / (2.0 * radius) ** 3, *VOLUMES))
    return tuple(sum((a + b * theta + c * theta**2) * logarithm**k for k, (a, b, c) in enumerate(rows)) for rows in FIT)


def _pull(gap, touching, square, f2, f3, f4):
    """Pull [N] from what a bridge keeps."""
    apart = 0.5 * np.log(np.maximum(gap**2 / (2.0 * np.pi * square), NEAREST**2))
    return touching * np.exp(-f2 * np.exp(f3 * apart + f4 * apart**2))


def force(gap, volume, radius, tension, wetting):
    """Pull of bridges [N]."""
    f1, f2, f3, f4 = exponents(volume, radius, wetting)
    return _pull(gap, 4.0 * np.pi * radius * tension * np.exp(f1), volume / (np.pi * radius), f2, f3, f4)


def energy(gap, pull, square, rupture, touching, f2, f3, f4, work):
    """Energy of bridges [J], 0 at their rupture: the integral of the pull by Gauss's 16 points in the root of the gap."""
    low, high = np.sqrt(np.minimum(gap, rupture)), np.sqrt(rupture)
    total = 0.0
    for node, weight in zip(NODES, WEIGHTS, strict=True):
        root = 0.5 * (low + high) + 0.5 * (high - low) * node
        total = total + weight * root * _pull(root**2, touching, square, f2, f3, f4)
    return -(high - low) * total


@functools.cache
def build(real):
    """Return ``formed``, ``force`` and ``work`` for ``real``."""
    Bridge, at, of = BRIDGE.vector(real), BRIDGE, series.build(real)
    powers = 4
    Fit = wp.types.matrix((4, 3 * powers), wp.float64)
    fit = Fit([[number for row in (*rows, *[(0.0, 0.0, 0.0)] * (powers - len(rows))) for number in row] for rows in FIT])
    points = len(NODES)
    Points = wp.types.vector(points, wp.float64)
    nodes, weights = Points(*NODES), Points(*WEIGHTS)

    @wp.func
    def exponent(n: int, logarithm: wp.float64, theta: wp.float64) -> wp.float64:
        """f1 to f4 [-], ``n`` from 0 to 3."""
        table = wp.static(fit)
        total = wp.float64(0.0)
        for k in range(wp.static(powers)):
            m = 3 * (wp.static(powers - 1) - k)
            total = total * logarithm + (table[n, m] + theta * (table[n, m + 1] + theta * table[n, m + 2]))
        return total

    @wp.func
    def share_of_touching(
        gap: wp.float64, square: wp.float64, f2: wp.float64, f3: wp.float64, f4: wp.float64
    ) -> wp.float64:  # fmt: skip
        """Pull over that in contact [-]."""
        ratio = gap * gap / (wp.float64(wp.static(2.0 * np.pi)) * square)
        apart = wp.float64(0.5) * wp.log(wp.max(ratio, wp.float64(wp.static(NEAREST**2))))
        return wp.exp(-f2 * wp.exp((f3 + f4 * apart) * apart))

    @wp.func
    def formed(volume: wp.float64, radius: wp.float64, tension: wp.float64, wetting: wp.float64):
        """Rupture distance [m], c^2 [m2], pull in contact [N], f2 to f4 [-], work [J]."""
        theta = wp.acos(wetting)
        root = wp.cbrt(volume)
        double = wp.float64(2.0) * radius
        distance = (wp.float64(1.0) + wp.float64(0.5) * theta) * (root + root * root / (wp.float64(10.0) * double))
        square = volume / (wp.float64(wp.static(np.pi)) * radius)
        relative = volume / (double * double * double)
        relative = wp.clamp(relative, wp.float64(wp.static(VOLUMES[0])), wp.float64(wp.static(VOLUMES[1])))
        logarithm = wp.log(relative)
        touching = wp.float64(wp.static(4.0 * np.pi)) * radius * tension * wp.exp(exponent(0, logarithm, theta))
        f2 = exponent(1, logarithm, theta)
        f3 = exponent(2, logarithm, theta)
        f4 = exponent(3, logarithm, theta)
        half = wp.float64(0.5) * wp.sqrt(distance)
        work = wp.float64(0.0)
        node = wp.static(nodes)
        weight = wp.static(weights)
        for n in range(wp.static(points)):
            u = half * (wp.float64(1.0) + node[n])
            work += weight[n] * u * share_of_touching(u * u, square, f2, f3, f4)
        work = work * touching * wp.float64(2.0) * half
        return Bridge(real(distance), real(square), real(touching), real(f2), real(f3), real(f4), real(work))

    @only_where_needed
    @wp.func
    def over_touching(needed: real, gap: real, bridge: Bridge) -> real:
        """Pull over that in contact [-]."""
        square = bridge[wp.static(at.square)]
        square = square if square > real(wp.static(tiny(real))) else real(1.0)  # of a contact without a bridge
        ratio = gap * gap / (real(wp.static(2.0 * np.pi)) * square)
        ratio = ratio if ratio > real(wp.static(NEAREST**2)) else real(wp.static(NEAREST**2))
        apart = real(0.5) * of.log(ratio)
        inner = of.exp((bridge[wp.static(at.f3)] + bridge[wp.static(at.f4)] * apart) * apart)
        return of.exp(-bridge[wp.static(at.f2)] * inner)

    @wp.func
    def force(gap: real, pull: real, bridge: Bridge) -> real:
        """Pull [N]."""
        opened = gap if bridge[wp.static(at.square)] > real(0.0) else real(0.0)
        share = over_touching(opened, gap, bridge)
        return bridge[wp.static(at.touching)] * (share if opened > real(0.0) else real(1.0))

    @wp.func
    def work(pull: real, bridge: Bridge) -> real:
        """Work from contact to rupture [J]."""
        return bridge[wp.static(at.work)]

    return KernelSet(formed=formed, force=force, work=work)
