"""An undamped head-on impact, and a contact under a steady load, under any normal law, from its energy E(d) alone.

E(d_max) - E(0) = m v^2 / 2,     t_c = 2 int_0^d_max dd / sqrt(v^2 - 2 (E(d) - E(0))/m)
k_secant = E'(d)/d,     k_tangent = E''(d)
Under a load F:  E'(d) = F
"""

import functools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, TypeVar

import numpy as np

from warpdem.kernels.contact import columns
from warpdem.kernels.contact.normal_law import NORMAL_CAP
from warpdem.scene.models import model
from warpdem.scene.user_models import using

PHASES = 32  # times within a step at which a contact may begin
NODES, WEIGHTS = np.polynomial.legendre.leggauss(48)
DIFFERENCE = 1.0e-4  # of the overlap: step of the derivatives
LONGEST = 20.0  # contact times without damping after which an impact counts as one that sticks


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


Value = TypeVar("Value", float, np.ndarray)
"""A number of one contact, or one of each of several, shape (c,)."""
Own = Mapping[str, Any]
"""A normal law's own numbers by name: of a pair of materials, of contacts, or what contacts remember."""
NONE: Own = MappingProxyType({})


def stiffness(normal: str, base: Value, radius: Value) -> Value:
    """Constant of the normal law of contacts: its file's ``stiffness(base, radius)``, or the base itself.

    Args:
        normal: name of the normal law.
        base: stiffness base of the pair of materials.
        radius: R* [m].
    """
    of_contact = getattr(model("normal", normal), "stiffness", None)
    return of_contact(base, radius) if of_contact else base


def own_constants(normal: str, own: Own, radius: float | np.ndarray) -> dict[str, Any]:
    """The law's own constants of contacts: its file's ``own_constants(radius, **own)``, or the coefficients themselves.

    Args:
        normal: name of the normal law.
        own: its own coefficients of a pair of materials.
        radius: R* [m].
    """
    of_contact = getattr(model("normal", normal), "own_constants", None)
    return dict(of_contact(radius, **own)) if of_contact else dict(own)


def own_of(normal: str, row: np.ndarray) -> dict[str, Any]:
    """The law's own coefficients by name, from rows of the table of coefficients, columns along the last axis."""
    module = model("normal", normal)
    at = columns.coefficients(module)
    return {name: row[..., at.of(name)] for name in columns.own_coefficients(module).names}


def untouched(normal: str) -> dict[str, float]:
    """What a contact remembers for its normal law before it begins."""
    return dict.fromkeys(columns.own_history(model("normal", normal)).names, 0.0)


def damped_time(normal: str, restitution: float) -> float:
    """Contact time with damping over that without [-]: as the law says, else that of a linear spring and dashpot."""
    of_law = getattr(model("normal", normal), "damped_time", None)
    return of_law(restitution) if of_law else math.hypot(math.log(restitution), math.pi) / math.pi


def damping_coefficient(normal: str, k_n: Value, constant: Value, damping: Value, mass: Value) -> Value:
    """gamma_n [N s/m] of contacts: the law's ``damping_coefficient``, else damping base times sqrt(m* k_n).

    Args:
        normal: name of the normal law.
        k_n: ``secant`` of the contacts [N/m].
        constant: stiffness constants of the contacts.
        damping: damping base of the pair of materials.
        mass: m* [kg].
    """
    of_law = getattr(model("normal", normal), "damping_coefficient", None)
    found: Value = of_law(k_n, constant, damping, mass) if of_law else damping * np.sqrt(k_n * mass)
    return found


def elastic_energy(normal: str, overlap: Value, constant: Value, own: Own = NONE) -> Value:
    """Energy of contacts [J] of the law named ``normal``.

    Args:
        normal: name of the normal law.
        overlap: [m], one or an array.
        constant: stiffness constants of the contacts.
        own: the law's own constants and history of the contacts.
    """
    return model("normal", normal).energy(overlap, constant, **own)


def secant(normal: str, overlap: Value, constant: Value, own: Own = NONE) -> Value:
    """k_n [N/m] of contacts: the law's ``secant``, else elastic force over overlap; arguments as of ``elastic_energy``."""
    of_law = getattr(model("normal", normal), "secant", None)
    if of_law:
        return of_law(overlap, constant, **own)
    return _force_over_overlap(normal, overlap, constant, own)


def _force_over_overlap(normal: str, overlap: Value, constant: Value, own: Own) -> Value:
    """E'(d)/d [N/m]; arguments as of ``elastic_energy``."""
    energy, step = model("normal", normal).energy, DIFFERENCE * overlap
    return (energy(overlap + step, constant, **own) - energy(overlap - step, constant, **own)) / (2.0 * step * overlap)


def tangent(normal: str, overlap: Value, constant: Value, own: Own = NONE) -> Value:
    """Slope of the elastic force [N/m]: the law's ``slope``, else from its energy; arguments as of ``elastic_energy``."""
    of_law = getattr(model("normal", normal), "slope", None)
    if of_law:
        return of_law(overlap, constant, **own)
    return _bend(functools.partial(model("normal", normal).energy, **own), overlap, constant)


def dashpot_slope(normal: str, slope: Value, k_n: Value) -> Value:
    """Slope [N/m] by which the dashpot of contacts is reduced: no more than TANGENT k_n (``kernels.contact.normal_law``).

    A law that yields unloads along a steeper line than that, by which its dashpot is not reduced.

    Args:
        normal: name of the normal law.
        slope: ``tangent`` of the contacts [N/m].
        k_n: ``secant`` of the contacts [N/m].
    """
    module = model("normal", normal)
    if not hasattr(module, "slope"):
        return slope
    least: Value = np.minimum(slope, getattr(module, "TANGENT", 1.0) * k_n)
    return least


def _bend(energy: Callable[[Value, Value], Value], overlap: Value, constant: Value) -> Value:
    """E''(d) [N/m]."""
    step = DIFFERENCE * overlap
    bend = energy(overlap + step, constant) - 2.0 * energy(overlap, constant)
    return (bend + energy(overlap - step, constant)) / step**2


def impact(normal: str, base: float, mass: float, radius: float, speed: float, own: Own = NONE) -> Impact:
    """Impact at ``speed`` [m/s] of two bodies with m* [kg] and R* [m] under the law named ``normal``.

    Args:
        normal: name of the normal law.
        base: stiffness base of the pair of materials.
        mass: m* [kg].
        radius: R* [m].
        speed: at which they meet [m/s].
        own: the law's own coefficients of the pair.

    Raises:
        SceneError: a function of the law in a file of the user fails.
    """
    with using([normal], "it fails in the estimate of an impact"):
        constant, own = stiffness(normal, base, radius), own_constants(normal, own, radius) | untouched(normal)
        energy = functools.partial(model("normal", normal).energy, **own)
        at_touch = energy(0.0, constant)
        whole = 0.5 * mass * speed**2 + at_touch
        low, high = 0.0, 1.0e-12 * radius
        while energy(high, constant) < whole:
            low, high = high, 2.0 * high
        for _ in range(60):  # more bits than a double has
            middle = 0.5 * (low + high)
            low, high = (middle, high) if energy(middle, constant) < whole else (low, middle)
        u = 0.5 * (NODES + 1.0)  # d = d_max (1 - u^2) takes the singular end of the integral away
        left = 1.0 - (energy(high * (1.0 - u**2), constant) - at_touch) / (whole - at_touch)
        inwards = float(np.sum(0.5 * WEIGHTS * 2.0 * high * u / (speed * np.sqrt(left))))
        slope = float(tangent(normal, high, constant, own))
        # a law that unloads along a steeper line states its slope: the way out is as much quicker
        bend = float(_bend(energy, high, constant)) if hasattr(model("normal", normal), "slope") else slope
        quicker = slope / bend if bend > 0.0 else 1.0
        time = inwards * (1.0 + 1.0 / math.sqrt(max(quicker, 1.0)))
        return Impact(high, time, float(secant(normal, high, constant, own)), slope)


def pressed(normal: str, base: float, radius: float, force: float, own: Own = NONE) -> tuple[float, float]:
    """Secant and tangent stiffness [N/m] of a contact that carries ``force`` [N]; other arguments as of ``impact``.

    Raises:
        SceneError: a function of the law in a file of the user fails.
    """
    with using([normal], "it fails in the estimate of a load"):
        constant, own = stiffness(normal, base, radius), own_constants(normal, own, radius) | untouched(normal)
        low, high = 0.0, 1.0e-12 * radius
        # a law whose force saturates never carries a larger one: then that of an overlap of R*
        while high < radius and _force_over_overlap(normal, high, constant, own) * high < force:
            low, high = high, 2.0 * high
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if _force_over_overlap(normal, middle, constant, own) * middle < force else (low, middle)
        return float(secant(normal, high, constant, own)), float(tangent(normal, high, constant, own))


def rebound(
    normal: str, base: float, damping: float, mass: float, radius: float, speed: float, dt: float, own: Own = NONE
) -> np.ndarray:
    """Restitution of a head-on impact [-] as the default scheme makes it, for each phase of its beginning, shape (PHASES,).

    The step is that of ``kernels.integrator.exact_drift``, the dashpot that of ``kernels.contact.normal_law``: damping
    coefficient ``damping_coefficient``.

    Args:
        normal: name of the normal law.
        base: stiffness base of the pair of materials.
        damping: damping base of it.
        mass: m* [kg].
        radius: R* [m].
        speed: at which the two meet [m/s].
        dt: time step [s].
        own: the law's own coefficients of the pair.

    Raises:
        SceneError: a function of the law in a file of the user fails.
    """
    with using([normal], "it fails in the estimate of a restitution"):
        constant, own = stiffness(normal, base, radius), own_constants(normal, own, radius) | untouched(normal)
        module = model("normal", normal)
        half_tangent, clamped = 0.5 * getattr(module, "TANGENT", 1.0), getattr(module, "CLAMPED", False)
        pulls = hasattr(module, "secant")  # k_n of its own: the force is not k_n d, as where a pull is taken off
        overlap = -speed * dt * (np.arange(PHASES) + 0.5) / PHASES
        rate, before = np.full(PHASES, speed), np.zeros(PHASES)
        longest = LONGEST * impact(normal, base, mass, radius, speed, own).time
        for _ in range(math.ceil(longest / dt)):
            overlap = overlap + dt * rate
            touching = overlap > 0.0
            depth: np.ndarray = np.where(touching, overlap, radius)
            k_n = touching * secant(normal, depth, np.full(PHASES, constant), own)
            gamma = touching * damping_coefficient(normal, k_n, constant, damping, mass)
            acting = gamma / np.maximum(1.0 + half_tangent * k_n * dt**2 / mass, gamma * dt / (NORMAL_CAP * mass))
            elastic = touching * _force_over_overlap(normal, depth, np.full(PHASES, constant), own) if pulls else k_n
            force = elastic * overlap + acting * (rate + 0.5 * dt * before)
            now = -(np.maximum(force, 0.0) if clamped else force) / mass
            rate, before = rate + dt * now, now
            if not touching.any() and (rate < 0.0).all():
                break
        out: np.ndarray = -rate / speed
        return out
