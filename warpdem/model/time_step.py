"""Limits of the time step of a scene, and the step chosen from them.

Rayleigh time     pi R sqrt(rho/G) / (0.1631 nu + 0.8766), the least over the grains: shown, since other codes go by it;
                  a tenth of it bounds "auto" where no speed is known
contact time      of an undamped impact at max_speed, from the energy of the normal law
stability limit   of a contact, and of a packing under its own weight: ``stability_limit``
frame             0.02 / Omega_max (nested rotations: of the sum of their largest rates)
travel            s r / max_speed beside meshes, see ``travel``
thin liquid gap   0.3 m*/c_n of a viscous bridge at its least gap: ``liquid_numbers``
external fields   0.1 / the largest rate at which one changes a grain's motion: sqrt(k/m), c/m, e B/m

Stiffnesses are those at the largest overlap of an impact at ``max_speed``; beyond the limit of that one contact a given step is
refused. No packing holds such overlaps everywhere. What a bed does hold everywhere is its weight and the load of a servo
(``expected_load``): ``settled`` is the limit of a dense packing, Z = 6, whose contacts carry F = p pi d^2/3 [N]; it was 0.7 to
1 times the limit measured in beds at rest.

``step = "auto"`` is the least of contact time / n, 80 % of the limit of that contact, the limit of the bed at rest, and what
frame, fields and travel allow. n is the least of 8 to 12 with which the restitution of every pair of materials is right within
0.003 in the mean (``restitution_error``): 8 from e = 0.3 with the laws of Hertz and Hooke, 12 below e = 0.1 and where a law has
a memory or acts beyond contact. Discharge, angles of repose and of drums, loads and losses do not depend on the step from there
down to a quarter of it, within the scatter of repeated runs; ``accuracy = "impact"``, contact time / 40, is for those who look
at single impacts.
"""

import math
from dataclasses import dataclass

import numpy as np

from warpdem.errors import SceneError
from warpdem.filling.initial_grains import InitialGrains
from warpdem.mesh.triangle_mesh import TriangleMesh
from warpdem.model.coefficients import coefficient_columns
from warpdem.model.contact_cases import contact_cases, impact_of, limits_at
from warpdem.model.expected_load import bed_pressure, fall_speed
from warpdem.model.impact import damped_time, impact, own_of, pressed
from warpdem.model.liquid_numbers import thin_gap_limit
from warpdem.model.restitution_error import restitution_errors
from warpdem.model.travel import longest_step
from warpdem.scene.model import Scene
from warpdem.scene.models import model
from warpdem.scene.motion_chain import frame_chain
from warpdem.scene.parameters import numbers

STABLE_SHARE = 0.8
UNKNOWN_SHARE = 0.1
BULK_STEPS = range(8, 13)  # in the contact time of an undamped impact: the first that meets RESTITUTION, or the last
RESTITUTION = 0.003  # error in the mean that "auto" accepts
IMPACT_STEPS = 40  # with time.accuracy = "impact"
FRAME_ANGLE = 0.02  # [rad] per step
FIELD_ANGLE = 0.1  # [rad] per step: second order leaves 4e-4 of the motion; a drag is stable up to 1


@dataclass(frozen=True)
class Limits:
    """What bounds the time step of a scene; inf where nothing does [s]."""

    rayleigh: float
    contact_time: float
    """Undamped contact time of the quickest impact at ``max_speed`` [s]."""
    settled: float
    """Spectral limit of a packing at rest under the weight of the grains above and the load of a servo [s]."""
    stable: float
    """Spectral limit of one contact at that overlap [s]: the largest step that is accepted."""
    frame: float
    field: float
    """Largest step for the external fields [s]."""
    travel: float
    """Largest step that keeps a grain at ``max_speed`` on its side of the mesh walls [s]."""
    max_speed: float
    """Speed that the limits are made for [m/s]."""
    damped_contact: float
    """Duration of the quickest impact at ``max_speed`` with its damping [s]."""
    overlap: float
    """Deepest overlap of an undamped impact at ``max_speed`` over the smaller radius [-]."""
    contact_steps: int
    """Steps in the contact time that "auto" takes at least."""
    thin_gap: float = math.inf
    """Longest step that leaves the dashpot of the thinnest liquid gap as it is [s]."""

    @property
    def candidates(self) -> dict[str, float]:
        """The steps that "auto" chooses the least of [s], by what binds them."""
        found = {
            f"contact time / {self.contact_steps} at {self.max_speed:.3g} m/s": self.contact_time / self.contact_steps,
            f"{STABLE_SHARE:.0%} of the stability limit of one impact": STABLE_SHARE * self.stable,
            "the stability limit of the bed at rest": self.settled,
            f"{FRAME_ANGLE} rad of the frame": self.frame,
            f"{FIELD_ANGLE} rad of the external fields": self.field,
            "half the limit of travel beside meshes": 0.5 * self.travel,
            "the dashpot of the thinnest liquid gap": self.thin_gap,
        }
        if self.max_speed == 0.0:  # what will move grains is not known: fields, walls that a program drives
            found[f"{UNKNOWN_SHARE:.0%} of the Rayleigh time, as no speed is known"] = UNKNOWN_SHARE * self.rayleigh
        return found

    @property
    def binding(self) -> str:
        """Which of the candidates is the least."""
        return min(self.candidates, key=self.candidates.__getitem__)


def contact_time(scene: Scene, row: np.ndarray, mass: float, radius: float, speed: float) -> float:
    """Undamped contact time [s] at reduced mass [kg] and radius [m]; ``row`` of the table of coefficients."""
    law = scene.normal_law
    return impact(law, row[coefficient_columns(scene).stiffness], mass, radius, speed, own_of(law, row)).time


def limits(scene: Scene, start: InitialGrains, meshes: dict[str, TriangleMesh]) -> Limits:
    """Limits of the time step of ``scene`` for the grains it starts with."""
    rate = frame_chain(scene).max_rate
    frame = FRAME_ANGLE / rate if rate > 0 else math.inf
    speed = scene.time.max_speed if scene.time.max_speed is not None else fall_speed(scene, start, meshes)
    rayleigh = contact = settled = stable = damped = math.inf
    pressure = bed_pressure(scene, start, meshes)
    overlap = 0.0
    law, at = scene.normal_law, coefficient_columns(scene)
    materials = list(scene.materials.values())
    rolling_law = model("rolling", scene.located(scene.contact.rolling)) if scene.contact.rolling != "none" else None
    oscillator = getattr(rolling_law, "oscillator", None)
    for t in np.unique(start.type):
        m, radius = materials[t], float(start.radius[start.type == t].min())
        shear = m.young_modulus / (2.0 * (1.0 + m.poisson_ratio))
        rayleigh = min(
            rayleigh, math.pi * radius * math.sqrt(m.density / shear) / (0.1631 * m.poisson_ratio + 0.8766)
        )
    for one in contact_cases(scene, start):
        met = impact_of(law, at.stiffness, one, speed)
        if speed > 0:
            contact = min(contact, met.time)
            damped = min(damped, met.time * damped_time(law, one.restitution))
            overlap = max(overlap, met.overlap / one.radius)
        stable = min(stable, limits_at(scene, one, met.secant, met.tangent, oscillator)[1])
        if pressure > 0.0:
            force = pressure * math.pi / 3.0 * (2.0 * one.radius) ** 2
            resting = pressed(law, one.row[at.stiffness], one.reduced_radius, force, one.own)
            settled = min(settled, limits_at(scene, one, *resting, oscillator)[0])
    return Limits(
        rayleigh=float(rayleigh),
        contact_time=float(contact),
        settled=float(settled),
        stable=float(stable),
        frame=float(frame),
        field=field_limit(scene, start),
        travel=longest_step(scene, start.type, start.radius, speed),
        max_speed=float(speed),
        damped_contact=float(damped),
        overlap=float(overlap),
        contact_steps=contact_steps(scene, start, speed, contact),
        thin_gap=thin_gap_limit(scene, contact_cases(scene, start)),
    )


def contact_steps(scene: Scene, start: InitialGrains, speed: float, contact_time: float) -> int:
    """Steps in the contact time [s] of the quickest undamped impact, at ``speed`` [m/s], that "auto" takes."""
    if scene.time.accuracy == "impact":
        return IMPACT_STEPS
    errors = restitution_errors(scene, start, speed, [contact_time / steps for steps in BULK_STEPS])
    allowed = (steps for steps, error in zip(BULK_STEPS, errors, strict=False) if abs(error.mean) <= RESTITUTION)
    return next(allowed, BULK_STEPS[-1])


def field_limit(scene: Scene, start: InitialGrains) -> float:
    """Largest time step [s] for the external fields that state their rate; inf without any.

    Raises:
        SceneError: a field's ``rate`` fails, or gives no numbers from 0.
    """
    density = np.array([m.density for m in scene.materials.values()])
    mass = density[start.type] * (4.0 / 3.0) * np.pi * start.radius**3
    fastest = 0.0
    for i, one in enumerate(scene.fields):
        rate = getattr(model("field", scene.located(one.model)), "rate", None)
        if rate is None or not len(mass):
            continue
        key = f"{scene.source}: fields[{i}].model = {one.model!r}: rate(mass, p)"
        try:
            found = np.asarray(rate(mass, numbers(one.parameters)), dtype=float)
        except Exception as error:  # whatever the user's function stumbles over
            raise SceneError(f"{key} fails: {type(error).__name__}: {error}") from error
        if not (np.isfinite(found).all() and (found >= 0.0).all()):
            raise SceneError(f"{key} gives {float(found.min()):g}; finite rates [rad/s], >= 0, are needed")
        fastest = max(fastest, float(found.max()))
    return FIELD_ANGLE / fastest if fastest > 0.0 else math.inf


def choose(scene: Scene, found: Limits) -> float:
    """The time step [s]: as given, or by the rule of "auto".

    Raises:
        SceneError: if the step given is over the limit of stability or travel, or "auto" has nothing to go by.
    """
    if scene.time.step == "auto":
        step = min(found.candidates.values())
        if not math.isfinite(step):
            raise SceneError(f'{scene.source}: time.step = "auto": nothing limits it here; give a number, such as "0.1 ms"')
        return step
    over = over_limit(scene.time.step, found)
    if over and scene.engine.guards == "stop":
        raise SceneError(f"{scene.source}: {over}")
    return float(scene.time.step)


def over_limit(step: float, found: Limits) -> str:
    """Words on a time step [s] over the limits that no step may pass; none when it is not."""
    limit, what = min((found.stable, "stability limit"), (found.travel, "limit of travel beside meshes"))
    if step <= limit:
        return ""
    return (
        f"time.step = {step:g} s is over the {what} {limit:.3g} s of contacts at {found.max_speed:.3g} m/s (time.max_speed); "
        f"allowed is less, and 'auto' would take {min(found.candidates.values()):.3g} s"
    )
