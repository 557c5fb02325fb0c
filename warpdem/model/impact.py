"""An undamped head-on impact, and a contact under a steady load, under any normal law, from its energy E(d) alone.

E(d_max) = m v^2 / 2,     t_c = 2 int_0^d_max dd / sqrt(v^2 - 2 E(d)/m),     k_secant = E'(d)/d,     k_tangent = E''(d)
Under a load F:  E'(d) = F
"""

from dataclasses import dataclass

import numpy as np

from warpdem.scene.models import model, using

NODES, WEIGHTS = np.polynomial.legendre.leggauss(48)
DIFFERENCE = 1.0e-4  # of the overlap: step of the derivatives


@dataclass(frozen=True)
class Impact:
    """What an impact reaches."""

    overlap: float
    """Largest overlap [m]."""
    time: float
    """Duration [s]."""
    secant: float
    """Force over overlap at the largest overlap [N/m]."""
    tangent: float
    """Slope of the force there [N/m]."""


def stiffness(normal: str, base, radius):
    """Constant of the normal law of contacts: its file's ``stiffness(base, radius)``, or the base itself.

    Args:
        normal: name of the normal law.
        base: stiffness base of the pair of materials.
        radius: R* [m].
    """
    of_contact = getattr(model("normal", normal), "stiffness", None)
    return of_contact(base, radius) if of_contact else base


def secant(normal: str, overlap, constant):
    """Elastic force over overlap [N/m] of the law named ``normal`` at ``overlap`` [m], arrays of one shape."""
    energy, step = model("normal", normal).energy, DIFFERENCE * overlap
    return (energy(overlap + step, constant) - energy(overlap - step, constant)) / (2.0 * step * overlap)


def tangent(normal: str, overlap: float, constant: float) -> float:
    """Slope of the elastic force [N/m] of the law named ``normal`` at ``overlap`` [m]."""
    energy, step = model("normal", normal).energy, DIFFERENCE * overlap
    bend = energy(overlap + step, constant) - 2.0 * energy(overlap, constant) + energy(overlap - step, constant)
    return float(bend / step**2)


def impact(normal: str, base: float, mass: float, radius: float, speed: float) -> Impact:
    """Impact at ``speed`` [m/s] of two bodies with m* [kg] and R* [m] under the law named ``normal``.

    Raises:
        SceneError: ``energy`` or ``stiffness`` in a file of the user fails.
    """
    with using([normal], "it fails in the estimate of an impact"):
        energy, constant = model("normal", normal).energy, stiffness(normal, base, radius)
        whole = 0.5 * mass * speed**2
        low, high = 0.0, 1.0e-12 * radius
        while energy(high, constant) < whole:
            low, high = high, 2.0 * high
        for _ in range(60):  # more bits than a double has
            middle = 0.5 * (low + high)
            low, high = (middle, high) if energy(middle, constant) < whole else (low, middle)
        u = 0.5 * (NODES + 1.0)  # d = d_max (1 - u^2) takes the singular end of the integral away
        left = 1.0 - energy(high * (1.0 - u**2), constant) / whole
        time = 2.0 * float(np.sum(0.5 * WEIGHTS * 2.0 * high * u / (speed * np.sqrt(left))))
        return Impact(high, time, float(secant(normal, high, constant)), tangent(normal, high, constant))


def pressed(normal: str, base: float, radius: float, force: float) -> tuple[float, float]:
    """Secant and tangent stiffness [N/m] of a contact of R* [m] that carries ``force`` [N] under the law named ``normal``.

    Raises:
        SceneError: ``energy`` or ``stiffness`` in a file of the user fails.
    """
    with using([normal], "it fails in the estimate of a load"):
        constant = stiffness(normal, base, radius)
        low, high = 0.0, 1.0e-12 * radius
        while secant(normal, high, constant) * high < force:
            low, high = high, 2.0 * high
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if secant(normal, middle, constant) * middle < force else (low, middle)
        return float(secant(normal, high, constant)), tangent(normal, high, constant)
