r"""Linear spring and dashpot.

    F_n = k d - C v_n,     C = 2 |beta| sqrt(m* k),     k_t = r k,     gamma_t = 2 |beta| sqrt(m* k_t)

    d      overlap                                                        [m]
    v_n    speed at which the two separate                                [m/s]
    k      stiffness, given per pair of materials                         [N/m]
    r      tangential stiffness ratio, given per pair of materials        [-]
    beta   ln e / sqrt(ln^2 e + pi^2), e the coefficient of restitution   [-]
    m*     reduced mass; the grain's at a wall                            [kg]

The contact lasts pi / sqrt(k/m* - (C/2m*)^2) at any speed and returns exactly e (damped oscillator); the force may
attract just before separation. It jumps by C v_n when the contact begins and vanishes where the overlap does.
"""

import functools
import math

import warp as wp
from warpdem.kernels.contact.columns import PairKey

SUMMARY = "linear, stiffness per pair"
PASSIVE = True
STIFFNESS_KEY = "pairs[].stiffness"
PAIR = {
    "stiffness": PairKey(
        "N/m", None, 'Normal stiffness [N/m], > 0; required by normal = "hooke" and "luding" (of first loading).', positive=True
    ),
    "tangential_stiffness_ratio": PairKey(
        "-", 2.0 / 7.0, 'Tangential over normal stiffness [-], > 0, default 2/7; of normal = "hooke", "luding", "edinburgh".',
        positive=True,
    ),
}


def coefficients(a, b, pair) -> tuple[float, float, float, float]:
    """Stiffness k [N/m], damping base 2|beta| [-], k_t/k_n [-] and gamma_t/gamma_n [-] of two materials."""
    beta = -math.log(pair.restitution) / math.hypot(math.log(pair.restitution), math.pi)
    ratio = pair.tangential_stiffness_ratio
    return pair.stiffness, 2.0 * beta, ratio, math.sqrt(ratio)


@functools.cache
def build(real):
    """Return (contact constants, force) for ``real`` (wp.float32 or wp.float64)."""

    @wp.func
    def constants(base: real, damping: real, radius: real, mass: real):
        """Stiffness [N/m] and damping [N s/m] of one contact from the pair's bases and m* [kg]."""
        return base, damping * wp.sqrt(mass * base)

    @wp.func
    def force(overlap: real, speed: real, stiffness: real, damping: real):
        """Normal force [N], its secant stiffness k_n [N/m] and damping coefficient gamma_n [N s/m]."""
        touching = real(1.0) if overlap > real(0.0) else real(0.0)
        spring = touching * stiffness
        dashpot = touching * damping
        return spring * overlap - dashpot * speed, spring, dashpot

    return constants, force


def damped_time(restitution: float) -> float:
    """Contact time with damping over that without [-], 1/sqrt(1 - beta^2): the damped oscillator's half period."""
    return math.hypot(math.log(restitution), math.pi) / math.pi


def energy(overlap, stiffness):
    """Elastic energy of the normal contact, (1/2) k d^2 [J]."""
    return 0.5 * stiffness * overlap**2
