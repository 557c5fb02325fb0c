r"""Pull of a liquid bridge in closed form (Rabinovich, Esayanur and Moudgil 2005), with a straight meniscus.

    F = 4 pi R* g cos(theta) (1 - S/sqrt(S^2 + c^2)),     c^2 = V/(pi R*)
    S_r = (1 + theta/2) V^(1/3)                           (Lian, Thornton and Adams 1993)

    S      gap between the surfaces, 0 in contact    [m]
    V      volume of the bridge                      [m3]
    g      surface tension                           [N/m]
    theta  contact angle                             [rad]
    R*     reduced radius, that of the grain at a wall

Against the Young-Laplace profile 7 to 28 % too strong in contact and 15 to 40 % too weak at large gaps; ``bridge`` is within
4 %.
"""

import functools

import numpy as np
import warp as wp
from warpdem.kernels import KernelSet
from warpdem.kernels.contact import liquid
from warpdem.kernels.contact.columns import scalars

PAIR, problems = liquid.PAIR, liquid.problems
SUMMARY = "liquid bridges, closed form of Rabinovich"
FORMED: dict[str, str] = {}
BRIDGE = scalars(["rupture", "square", *FORMED])


def rupture(volume, radius, wetting):
    """Rupture distance [m] of bridges."""
    return (1.0 + 0.5 * np.arccos(wetting)) * np.cbrt(volume)


def force(gap, volume, radius, tension, wetting):
    """Pull of bridges [N]."""
    square = volume / (np.pi * radius)
    return 4.0 * np.pi * radius * tension * wetting * (1.0 - gap / np.sqrt(gap**2 + square))


def energy(gap, pull, square, rupture):
    """Energy of bridges [J], 0 at their rupture: the integral of the pull, closed."""
    return pull * (gap - np.sqrt(gap**2 + square) - rupture + np.sqrt(rupture**2 + square))


@functools.cache
def build(real):
    """Return ``formed``, ``force`` and ``work`` for ``real``."""
    Bridge = BRIDGE.vector(real)
    at = BRIDGE

    @wp.func
    def formed(volume: wp.float64, radius: wp.float64, tension: wp.float64, wetting: wp.float64):
        """Rupture distance [m] and c^2 [m2]."""
        distance = (wp.float64(1.0) + wp.float64(0.5) * wp.acos(wetting)) * wp.cbrt(volume)
        return Bridge(real(distance), real(volume / (wp.float64(wp.static(np.pi)) * radius)))

    @wp.func
    def force(gap: real, pull: real, bridge: Bridge) -> real:
        """Pull [N]."""
        square = gap * gap + bridge[wp.static(at.square)]
        return pull * (real(1.0) - gap / wp.sqrt(square if square > real(0.0) else real(1.0)))

    @wp.func
    def work(pull: real, bridge: Bridge) -> real:
        """Work from contact to rupture [J]."""
        far = bridge[wp.static(at.rupture)]
        square = bridge[wp.static(at.square)]
        return pull * (far + wp.sqrt(square) - wp.sqrt(far * far + square))

    return KernelSet(formed=formed, force=force, work=work)
