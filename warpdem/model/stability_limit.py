"""Spectral stability limit: the least time step at which a mode (K, C, m*) of the contacts grows, K dt^2/4 + C(dt) dt = m*.

m* is the reduced mass of a contact, k its stiffness (tangent along the normal, secant across) and C made of its damping, as it
acts at the step dt (``kernels.contact.normal_law``), as K is of its stiffness:

    packing of Z contacts per grain   K = (Z/3)(k_n + 2 k_t) neighbors move against each other, K = (5 Z/3) k_t all rotate
    one contact                       K = k_n along the normal, K = (7/2) k_t rolling
    rolling spring k_r                against I* = (2/5) m* R^2, on a wall together with slip; in a packing (2 Z/3) k_r

That condition is exact for a damped oscillator under the predicted velocity v* = v + (dt/2) a of the default scheme. The
modes are those of Bloch waves on cubic packings of equal grains with free rotation. Measured:
tests/verification/test_stability_limit.py.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

from warpdem.kernels.contact.normal_law import NORMAL_CAP, ROLLING_MASS, TANGENTIAL_CAP

PACKED = 6  # contacts per grain: dense frictional packing


@dataclass(frozen=True)
class Spring:
    """A spring with its dashpot, as the default scheme takes it."""

    stiffness: float
    """k [N/m]: the slope of the force; [N m] of a rotation."""
    damping: float
    """Damping coefficient of the law [N s/m], [N m s]."""
    mass: float
    """That its own ends move [kg], [kg m2]."""
    cap: float = math.inf
    """Largest damping coefficient times the time step over ``mass`` [-]."""
    dashpot_slope: float | None = None
    """Slope that the dashpot is reduced by [N/m], if it is not ``stiffness``: of a law that unloads more steeply."""

    def acting(self, dt: float) -> float:
        """Damping coefficient that acts at time step ``dt`` [s]."""
        slope = self.stiffness if self.dashpot_slope is None else self.dashpot_slope
        reduction = 1.0 + slope * dt**2 / (2.0 * self.mass)
        return self.damping / max(reduction, self.damping * dt / (self.cap * self.mass))


def along(stiffness: float, damping: float, mass: float, dashpot_slope: float | None = None) -> Spring:
    """The spring along the normal of a contact: slope [N/m], damping [N s/m], m* [kg]; ``dashpot_slope`` as of ``Spring``."""
    return Spring(stiffness, damping, mass, NORMAL_CAP, dashpot_slope)


def across(stiffness: float, damping: float, mass: float) -> Spring:
    """The spring across the normal of a contact: k_t [N/m], damping [N s/m] and m* [kg]."""
    return Spring(stiffness, damping, ROLLING_MASS * mass, TANGENTIAL_CAP)


def stable_step(stiffness: float, damping: Callable[[float], float], mass: float) -> float:
    """Least time step [s] at which m x'' + C x' + K x = 0 grows under the predicted velocity: K dt^2/4 + C dt = m.

    Args:
        stiffness: K [N/m], or that of a rotation.
        damping: C [N s/m] at a time step [s].
        mass: m [kg].
    """
    if stiffness <= 0.0:  # a force that does not grow with the overlap: the dashpot alone decides
        plain = damping(0.0)
        alone = mass / plain if plain > 0.0 else math.inf
        return alone if alone == math.inf or damping(alone) * alone >= mass else math.inf
    low, high = 0.0, 2.0 * math.sqrt(mass / stiffness)  # without damping
    if damping(high) == 0.0:
        return high
    for _ in range(50):
        middle = 0.5 * (low + high)
        grows = stiffness * middle**2 / 4.0 + damping(middle) * middle > mass
        low, high = (low, middle) if grows else (middle, high)
    return high


def packing_limit(normal: Spring, tangential: Spring, contacts: int = PACKED) -> float:
    """Stability limit of a packing [s].

    Args:
        normal: spring of each contact along its normal.
        tangential: across it.
        contacts: contacts per grain Z [-].
    """
    third = contacts / 3.0
    against = stable_step(
        third * (normal.stiffness + 2.0 * tangential.stiffness),
        lambda dt: third * (normal.acting(dt) + 2.0 * tangential.acting(dt)),
        normal.mass,
    )
    if tangential.stiffness == 0.0:
        return against
    rotating = stable_step(5.0 * third * tangential.stiffness, lambda dt: 5.0 * third * tangential.acting(dt), normal.mass)
    return min(against, rotating)


def contact_limit(normal: Spring, tangential: Spring) -> float:
    """Stability limit of one contact [s]; arguments as of ``packing_limit``."""
    limit = stable_step(normal.stiffness, normal.acting, normal.mass)
    if tangential.stiffness == 0.0:
        return limit
    return min(limit, stable_step(tangential.stiffness, tangential.acting, tangential.mass))


def rolling_limit(
    rolling: Spring, tangential: Spring, inertia: float, mass: float, radius: float, wall: bool
) -> tuple[float, float]:
    """Stability limits [s] of a packing and of one contact whose relative rotation bends a spring.

    On a wall the angle bends it and slips by R at once: the larger rate of both together. Between two grains slip goes with
    the sum of the spins and the spring with their difference, so that neither feels the other.

    Args:
        rolling: rolling spring; its ``mass`` is I_r [kg m2].
        tangential: spring across the contact.
        inertia: I* [kg m2].
        mass: reduced mass m* [kg].
        radius: of the grain [m].
        wall: whether the contact is one with a wall.
    """
    fraction = 2.0 * PACKED / 3.0
    packing = stable_step(fraction * rolling.stiffness, lambda dt: fraction * rolling.acting(dt), inertia)
    if not wall:
        return packing, stable_step(rolling.stiffness, rolling.acting, inertia)

    def both(k_r: float, k_t: float) -> float:
        """The larger eigenvalue of the two over mass and inertia."""
        trace, product = k_t / mass + (k_t * radius**2 + k_r) / inertia, k_t * k_r / (mass * inertia)
        return 0.5 * (trace + math.sqrt(trace**2 - 4.0 * product))

    stiffness = both(rolling.stiffness, tangential.stiffness)
    return packing, stable_step(stiffness, lambda dt: both(rolling.acting(dt), tangential.acting(dt)), 1.0)
