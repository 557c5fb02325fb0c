r"""Elastic-plastic rolling spring with dashpot (EPSD, type C of Ai et al. 2011): holds a grain truly still.

    M_i = -k_r a - C_r w,   |k_r a| <= mu_r R* max(F_n, 0),   k_r = 2.25 k_n (mu_r R*)^2,   C_r = 2 eta sqrt(I_r k_r)

    a     relative rolling angle since the contact began, carried like the tangential spring   [rad]
    w     part of w_i - w_j across the normal (all of it with torsion)                         [rad/s]
    k_n   F_n / d of the elastic part                                                          [N/m]
    I_r   1 / (1/(I_i + m_i R_i^2) + 1/(I_j + m_j R_j^2)), about the contact point             [kg m2]
    eta   rolling damping ratio                                                                [-]

Once the spring reaches its limit it slides along with it and the dashpot is left out (f = 0 in the source's equation 12).
"""

import functools
import math

import warp as wp
from warpdem.kernels import tiny
from warpdem.kernels.contact.columns import PairKey

SUMMARY = "EPSD"
HISTORY = True
STIFFNESS = 2.25  # k_r over k_n (mu_r R*)^2
PAIR = {
    "rolling_damping": PairKey(
        "-", 0.3, 'Damping of the rolling spring [-], >= 0, default 0.3; only with rolling = "spring".'
    )
}


@functools.cache
def build(real):
    """Return the rolling torque for ``real``."""
    vec3 = wp.types.vector(3, real)
    small = tiny(real)

    @wp.func
    def torque(
        spin: vec3,
        spin_predicted: vec3,  # relative spin at the time of the force [rad/s]
        angle: vec3,  # rolling spring with this step's increment [rad]
        limit: real,  # mu_r R* max(F_n, 0) [N m]
        spring: real,  # k_n (mu_r R*)^2 [N m]
        damping: real,  # eta [-]
        inertia: real,  # I_r [kg m2]
        dt: real,
    ):
        """Torque on i [N m] and the rolling spring [rad] cut to its limit."""
        stiffness = real(wp.static(STIFFNESS)) * spring
        size = stiffness * wp.sqrt(wp.dot(angle, angle) + real(wp.static(small)))
        fraction = limit / (size + real(wp.static(small)))
        kept = fraction if fraction < real(1.0) else real(1.0)
        viscous = real(0.0) if fraction < real(1.0) else real(2.0) * damping * wp.sqrt(inertia * stiffness)
        held = angle * kept
        return held * (-stiffness) - spin_predicted * viscous, held

    return torque


def oscillator(k_n: float, arm: float, damping: float, inertia: float) -> tuple[float, float]:
    """Stiffness k_r [N m] and dashpot C_r [N m s] of the torque, for the time step.

    Args:
        k_n: normal stiffness F_n / d [N/m].
        arm: mu_r R* [m].
        damping: eta [-].
        inertia: I_r [kg m2].
    """
    stiffness = STIFFNESS * k_n * arm**2
    return stiffness, 2.0 * damping * math.sqrt(inertia * stiffness)


def energy(angle, spring):
    """Energy of rolling springs (1/2) k_r a^2 [J], shape (c,), bent by ``angle`` [rad], shape (c, 3); k_n (mu_r R*)^2 [N m]."""
    return 0.5 * STIFFNESS * spring * (angle**2).sum(axis=1)
