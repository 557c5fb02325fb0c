r"""Hertz contact with Tsuji's damping: the restitution asked for is the restitution obtained, at any speed.

    F_n = K d^(3/2) - C d^(1/4) v_n,     K = (4/3) E* sqrt(R*),     C = sqrt(5) |beta| sqrt(m* K)
    k_t = 8 G* sqrt(R* d),               gamma_t = 2 sqrt(5/6) |beta| sqrt(k_t m*)

    d      overlap                                                        [m]
    v_n    speed at which the two separate                                [m/s]
    beta   ln e / sqrt(ln^2 e + pi^2), e the coefficient of restitution   [-]
    E*     1/E* = (1 - nu_i^2)/E_i + (1 - nu_j^2)/E_j                     [Pa]
    G*     1/G* = 2 (2 - nu_i)(1 + nu_i)/E_i + the same for j             [Pa]
    R*, m* reduced radius [m] and mass [kg]; those of the grain at a wall

F_n is positive when it pushes apart and may attract just before separation: only then is e exact (Tsuji, Tanaka and
Ishida 1992, closed relation by Antypov and Elliott 2011). k_t is Mindlin's no-slip stiffness (1949). The paper's Table 1
prints sqrt(2/3 k_n m*) and 2 (2 + nu)(1 - nu): both are misprints (restitution 0.3 would become 0.46).
At zero overlap force and stiffnesses vanish. Not modelled: plasticity, adhesion.
"""

import functools
import math

import numpy as np
import warp as wp

SUMMARY = "from the moduli"
PASSIVE = True
TANGENT = 1.5  # slope of the force over k_n: it grows with the power 3/2 of the overlap
_DAMPED_TIME = (
    (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 1.0),
    (1.778, 1.511, 1.296, 1.195, 1.134, 1.093, 1.064, 1.042, 1.025, 1.011, 1.005, 1.0),
)


def coefficients(a, b, pair) -> tuple[float, float, float, float]:
    """Stiffness base (4/3) E* [Pa], damping base sqrt(5)|beta| [-], k_t/k_n [-] and gamma_t/gamma_n [-] of two materials."""
    elastic = 1.0 / ((1 - a.poisson_ratio**2) / a.young_modulus + (1 - b.poisson_ratio**2) / b.young_modulus)
    shear = 1.0 / sum(2 * (2 - m.poisson_ratio) * (1 + m.poisson_ratio) / m.young_modulus for m in (a, b))
    beta = -math.log(pair.restitution) / math.hypot(math.log(pair.restitution), math.pi)
    ratio = 8.0 * shear / (4.0 / 3.0 * elastic)
    # gamma_n = 2 sqrt(5/6) |beta| sqrt(S_n m*) with the tangent stiffness S_n = (3/2) k_n, so gamma_t/gamma_n = sqrt(k_t/S_n)
    return 4.0 / 3.0 * elastic, math.sqrt(5.0) * beta, ratio, math.sqrt(ratio / 1.5)


@functools.cache
def build(real):
    """Return (contact constants, force) for ``real`` (wp.float32 or wp.float64)."""

    @wp.func
    def constants(base: real, damping: real, radius: real, mass: real):
        """K [N/m^1.5] and C [N s/m^1.25] of one contact from the pair's bases, R* [m] and m* [kg]."""
        stiffness = base * wp.sqrt(radius)
        return stiffness, damping * wp.sqrt(mass * stiffness)

    @wp.func
    def force(overlap: real, speed: real, stiffness: real, damping: real):
        """Normal force [N], its secant stiffness k_n [N/m] and damping coefficient gamma_n [N s/m]."""
        depth = overlap if overlap > real(0.0) else real(0.0)
        root = wp.sqrt(depth)
        dashpot = damping * wp.sqrt(root)
        spring = stiffness * root
        return spring * depth - dashpot * speed, spring, dashpot

    return constants, force


def stiffness(base, radius):
    """K [N/m^1.5] of contacts from the pair's base [Pa] and R* [m]: what ``constants`` computes, for readers."""
    return base * radius**0.5


def damped_time(restitution: float) -> float:
    """Contact time with damping over that without [-]: the closed relation (Antypov and Elliott 2011), tabulated."""
    return float(np.interp(restitution, *_DAMPED_TIME))


def energy(overlap, stiffness):
    """Elastic energy of the normal contact, (2/5) K d^(5/2) [J]."""
    return 0.4 * stiffness * overlap**2.5
