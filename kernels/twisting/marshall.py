r"""Twisting of two bodies about the normal of their contact: spring and dashpot of its area, up to a limit (Marshall 2009).

    M = -k_q q - eta_q w,     |M| <= (2/3) a mu L,     k_q = k_t a^2/2,     eta_q = gamma_t a^2/2,     a^2 = R* d

    q      relative twist since the contact began, as far as the limit lets it           [rad]
    w      spin of i less that of j along the normal                                      [rad/s]
    a      radius of the contact; R* d is that of Hertz, and of JKR by the depth it says  [m]
    k_t, gamma_t, mu, L  stiffness, damping, friction coefficient and Coulomb load of the tangential law

A disc on which each point slips as the surface does has (2/3) a mu L where it slips as a whole. The stiffness is that of
tangential springs spread over the disc; half spaces that stick together have (8/3) G a^3 (Reissner and Sagoci 1944), 2.3 times
as much at Poisson's ratio 0.3. It keeps Marshall's name and form: 10.1016/j.jcp.2008.10.035.

As the contact shrinks the spring keeps its twist; as it grows it keeps the fraction (d'/d)^(3/2) of it, under every normal law.
With Hertz, k_q being proportional to d^(3/2), that is its torque; with ``hooke`` and ``luding``, k_q being proportional to d,
the torque falls by sqrt(d'/d). So it never returns more than was put in. With ``tangential = "mindlin_displacement"`` it keeps
the twist either way. Spring and dashpot are cut as those of friction. The torque is far below what limits the time step: its
rate is that of the tangential spring times some a/R.
"""

import functools

import warp as wp
from warpdem.kernels import tiny

SUMMARY = "spring and limit of the contact area"
PASSIVE = True


@functools.cache
def build(real):
    """Return the torque for ``real``."""
    small = tiny(real)

    @wp.func
    def torque(
        angle: real,  # q with this step's increment [rad]
        rate: real,  # w at the time of the force [rad/s]
        radius: real,  # a [m]
        stiffness: real,  # k_t [N/m]
        damping: real,  # gamma_t [N s/m]
        load: real,  # mu L [N]
    ):
        """Torque on i along the normal [N m] and the twisting spring [rad] cut to its limit."""
        half_area = real(0.5) * radius * radius
        k_q = stiffness * half_area
        limit = real(wp.static(2.0 / 3.0)) * radius * load
        size = k_q * wp.abs(angle) + real(wp.static(small))
        fraction = limit / size
        held = angle * (fraction if fraction < real(1.0) else real(1.0))
        trial = held * (-k_q) - rate * (damping * half_area)
        cap = limit / (wp.abs(trial) + real(wp.static(small)))
        return trial * (cap if cap < real(1.0) else real(1.0)), held

    return torque


def energy(angle, radius, stiffness):
    """Energy of twisting springs (1/2) k_q q^2 [J], shape (c,)."""
    return 0.25 * stiffness * (radius * angle) ** 2
