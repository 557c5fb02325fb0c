"""Characteristic times of a scene and the time step chosen from them.

Rayleigh time     pi R sqrt(rho/G) / (0.1631 nu + 0.8766), the least over the grains: shown, since other codes go by it;
                  a tenth of it bounds "auto" where no speed is known
contact time      of an undamped impact at max_speed, from the energy of the normal law
spectral limit    the least step at which a mode (K, C, m*) of the contacts grows: K dt^2/4 + C(dt) dt = m*
frame             0.02 / Omega_max (nested rotations: of the sum of their largest rates)
travel            s r / max_speed beside meshes, see ``travel``
external fields   0.1 / the largest rate at which one changes a grain's motion: sqrt(k/m), c/m, e B/m

Modes, with m* the reduced mass of a contact, k its stiffness (tangent along the normal, secant across) and C made of its
damping, as it acts at the step dt (``kernels.contact.normal_law``), as K is of its stiffness:

    packing of Z contacts per grain   K = (Z/3)(k_n + 2 k_t) neighbours move against each other, K = (5 Z/3) k_t all turn
    one contact                       K = k_n along the normal, K = (7/2) k_t rolling
    rolling spring k_r                against I* = (2/5) m* R^2, on a wall together with slip; in a packing (2 Z/3) k_r

That condition is exact for a damped oscillator under the predicted velocity v* = v + (dt/2) a of the default scheme. The
modes are those of Bloch waves on cubic packings of equal grains with free rotation. Measured:
tests/verification/test_stability_limit.py.

Stiffnesses are those at the largest overlap of an impact at ``max_speed``; beyond the limit of that one contact a given step is
refused. No packing holds such overlaps everywhere. What a bed does hold everywhere is its weight: ``settled`` is the limit of
a dense packing, Z = 6, whose contacts carry

    F = p pi d^2/3,     p = 0.6 rho (g + Omega^2 r) H        [N], [Pa]

with H the height of the grains at the start; it was 0.7 to 1 times the limit measured in beds at rest.

``step = "auto"`` is the least of contact time / 12, 80 % of the limit of that contact, the limit of the bed at rest, and what
frame, fields and travel allow. Discharge, angles of repose and of drums, loads and losses do not depend on the step from
there down to a quarter of it, within the scatter of repeated runs; ``accuracy = "impact"``, contact time / 40, is for those who
look at single impacts. ``restitution_error`` is what either costs.

``max_speed`` is, where the scene does not give it, sqrt(v0^2 + 2 g H) with v0 the largest speed at the start or of a stream,
plus what frame and walls add, see ``fall_speed``.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from warpdem.errors import SceneError
from warpdem.filling.initial_grains import InitialGrains
from warpdem.kernels.contact.normal_law import NORMAL_CAP, ROLLING_MASS, TANGENTIAL_CAP
from warpdem.mesh.triangle_mesh import TriangleMesh
from warpdem.model.features import coefficient_columns, coefficient_table
from warpdem.model.impact import Impact, Own, damped_time, impact, own_of, pressed, rebound
from warpdem.model.travel import longest_step
from warpdem.scene.model import Scene
from warpdem.scene.models import model, numbers
from warpdem.scene.motion_chain import Chain, frame_chain, wall_chain
from warpdem.scene.surface_velocity import surface_speed

PACKED = 6  # contacts per grain: dense frictional packing
STABLE_SHARE = 0.8
UNKNOWN_SHARE = 0.1
CONTACT_STEPS = {"bulk": 12, "impact": 40}  # in the contact time of an undamped impact, by time.accuracy
TURN_ANGLE = 0.05  # [rad] of the frame between two directions of gravity that are looked at
MOST_DIRECTIONS = 20_000
FINE_STEPS = 400  # in a contact, of the impact that an error is measured against
BED_FRACTION = 0.6  # of the volume of a bed is solid
FRAME_ANGLE = 0.02  # [rad] per step
FIELD_ANGLE = 0.1  # [rad] per step: second order leaves 4e-4 of the motion; a drag is stable up to 1


@dataclass(frozen=True)
class Limits:
    """What bounds the time step of a scene; inf where nothing does [s]."""

    rayleigh: float
    contact_time: float
    """Undamped contact time of the quickest impact at ``max_speed`` [s]."""
    settled: float
    """Spectral limit of a packing at rest under the weight of the grains above [s]."""
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
        }
        if self.max_speed == 0.0:  # what will move grains is not known: fields, walls that a program drives
            found[f"{UNKNOWN_SHARE:.0%} of the Rayleigh time, as no speed is known"] = UNKNOWN_SHARE * self.rayleigh
        return found

    @property
    def binding(self) -> str:
        """Which of the candidates is the least."""
        return min(self.candidates, key=self.candidates.__getitem__)


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

    def acting(self, dt: float) -> float:
        """Damping coefficient that acts at time step ``dt`` [s]."""
        lessened = 1.0 + self.stiffness * dt**2 / (2.0 * self.mass)
        return self.damping / max(lessened, self.damping * dt / (self.cap * self.mass))


def along(stiffness: float, damping: float, mass: float) -> Spring:
    """The spring along the normal of a contact: slope [N/m], damping [N s/m] and m* [kg]."""
    return Spring(stiffness, damping, mass, NORMAL_CAP)


def across(stiffness: float, damping: float, mass: float) -> Spring:
    """The spring across the normal of a contact: k_t [N/m], damping [N s/m] and m* [kg]."""
    return Spring(stiffness, damping, ROLLING_MASS * mass, TANGENTIAL_CAP)


def stable_step(stiffness: float, damping: Callable[[float], float], mass: float) -> float:
    """Least time step [s] at which m x'' + C x' + K x = 0 grows under the predicted velocity: K dt^2/4 + C dt = m.

    Args:
        stiffness: K [N/m], or its share of a rotation.
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
    turning = stable_step(5.0 * third * tangential.stiffness, lambda dt: 5.0 * third * tangential.acting(dt), normal.mass)
    return min(against, turning)


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
    share = 2.0 * PACKED / 3.0
    packing = stable_step(share * rolling.stiffness, lambda dt: share * rolling.acting(dt), inertia)
    if not wall:
        return packing, stable_step(rolling.stiffness, rolling.acting, inertia)

    def both(k_r: float, k_t: float) -> float:
        """The larger eigenvalue of the two over mass and inertia."""
        trace, product = k_t / mass + (k_t * radius**2 + k_r) / inertia, k_t * k_r / (mass * inertia)
        return 0.5 * (trace + math.sqrt(trace**2 - 4.0 * product))

    stiffness = both(rolling.stiffness, tangential.stiffness)
    return packing, stable_step(stiffness, lambda dt: both(rolling.acting(dt), tangential.acting(dt)), 1.0)


def contact_time(scene: Scene, row: np.ndarray, mass: float, radius: float, speed: float) -> float:
    """Undamped contact time [s] at reduced mass [kg] and radius [m]; ``row`` of the table of coefficients."""
    law = scene.located(scene.contact.normal)
    return impact(law, row[coefficient_columns(scene).stiffness], mass, radius, speed, own_of(law, row)).time


def fall_speed(scene: Scene, start: InitialGrains, meshes: dict[str, TriangleMesh]) -> float:
    """Largest speed that is expected of a grain against what it meets [m/s]: sqrt(v0^2 + 2 g H) + V.

    v0 is the largest speed at the start. H is the height that a grain may fall: from the highest grain to the lowest point of
    grains and walls, along gravity as the frame turns; from the highest point of walls, too, where frame or walls may lift a
    grain. V is what moves: the frame, the two fastest of the walls that move in different ways, and the fastest belt.
    """
    if not len(start.id):
        return 0.0
    points = [start.position, *(m.vertices for m in meshes.values())]
    for wall in scene.walls:
        if wall.shape is not None:  # the feet of the grains: a plane has no extent of its own
            points.append(wall.shape.nearest(start.position)[0])
    cloud = np.concatenate(points)
    frame = frame_chain(scene)
    motions = [wall.motion for wall in scene.walls]
    walls = [wall_chain(scene, k) for k, motion in enumerate(motions) if motion not in motions[:k]]
    g = float(np.linalg.norm(scene.gravity))
    lifted = frame.moves or any(chain.moves for chain in walls) or any(
        wall.servo is not None and (wall.servo.turns or np.dot(wall.servo.axis, scene.gravity) < 0.0) for wall in scene.walls
    )
    from_where = cloud if lifted else start.position
    height = max((float((cloud @ way).max() - (from_where @ way).min()) for way in _down(scene, frame)), default=0.0)
    servos = [wall.servo.speed_bound(cloud) for wall in scene.walls if wall.servo is not None]
    own = np.sort([*(chain.speed_bound(cloud, scene.time.end) for chain in walls), *servos])
    belts = [surface_speed(wall.surface_velocity) for wall in scene.walls if wall.surface_velocity is not None]
    moved = frame.speed_bound(cloud, scene.time.end) + float(own[-2:].sum()) + max(belts, default=0.0)
    thrown = float(np.linalg.norm(start.velocity, axis=1).max())
    return math.hypot(thrown, math.sqrt(2.0 * g * height)) + moved


def _down(scene: Scene, frame: Chain) -> np.ndarray:
    """Directions of gravity in frame axes up to the end of the run, shape (d, 3); none without gravity."""
    gravity = np.array(scene.gravity)
    g = float(np.linalg.norm(gravity))
    if not g:
        return np.zeros((0, 3))
    steps = min(MOST_DIRECTIONS, math.ceil(frame.max_rate * scene.time.end / TURN_ANGLE)) if frame.rotates else 0
    axes = frame.pose(np.linspace(0.0, scene.time.end, steps + 1)).axes.astype(float)
    if not steps:
        return (gravity / g @ axes[0])[None]
    ways = np.unique(np.round(gravity / g @ axes, 2), axis=0)
    return ways / np.linalg.norm(ways, axis=1)[:, None]


def weight_per_area(scene: Scene, start: InitialGrains) -> float:
    """Pressure at the foot of the grains as they start [Pa], in a frame that turns with what its rate adds to gravity."""
    if not len(start.id):
        return 0.0
    gravity, chain = np.array(scene.gravity), frame_chain(scene)
    g = float(np.linalg.norm(gravity))
    along = start.position @ gravity / g if g and not chain.rotates else np.linalg.norm(start.position, axis=1)
    height = float(np.ptp(along)) + 2.0 * float(start.radius.max())
    pull = g + chain.max_rate**2 * float(np.linalg.norm(start.position, axis=1).max())
    density = max(list(scene.materials.values())[kind].density for kind in np.unique(start.type))
    return BED_FRACTION * density * pull * height


@dataclass(frozen=True)
class Meeting:
    """Two bodies that may touch: the smallest grain of a material with itself, another or a wall."""

    materials: tuple[str, str]
    radius: float
    """Of the grain [m]."""
    reduced_radius: float
    """R* [m]."""
    reduced_mass: float
    """m* [kg]."""
    restitution: float
    row: np.ndarray
    """Of the table of coefficients."""
    own: Own
    """The normal law's own coefficients."""

    @property
    def wall(self) -> bool:
        """Whether the other body is a wall."""
        return self.reduced_radius == self.radius


def meetings(scene: Scene, start: InitialGrains) -> Iterator[Meeting]:
    """What may touch, of grains that the scene starts with or that come."""
    names, materials = list(scene.materials), list(scene.materials.values())
    law, at = scene.located(scene.contact.normal), coefficient_columns(scene)
    table = coefficient_table(scene).reshape(len(names), len(names), at.width)
    walls = {names.index(w.material) for w in scene.walls}
    alone = len(start.id) < 2 and not scene.streams
    for t in np.unique(start.type):
        radius = float(start.radius[start.type == t].min())
        mass = materials[t].density * 4.0 / 3.0 * math.pi * radius**3
        partners = [(int(o), 0.5 * mass, 0.5 * radius) for o in np.unique(start.type) if not alone]
        partners += [(o, mass, radius) for o in walls]
        for other, reduced_mass, reduced_radius in partners:
            pair, row = (names[t], names[other]), table[t, other]
            restitution = scene.pair(*pair).restitution
            yield Meeting(pair, radius, reduced_radius, reduced_mass, restitution, row, own_of(law, row))


def limits(scene: Scene, start: InitialGrains, meshes: dict[str, TriangleMesh]) -> Limits:
    """Limits of the time step of ``scene`` for the grains it starts with."""
    rate = frame_chain(scene).max_rate
    frame = FRAME_ANGLE / rate if rate > 0 else math.inf
    speed = scene.time.max_speed if scene.time.max_speed is not None else fall_speed(scene, start, meshes)
    rayleigh = contact = settled = stable = damped = math.inf
    weight = weight_per_area(scene, start)
    overlap = 0.0
    law, at = scene.located(scene.contact.normal), coefficient_columns(scene)
    materials = list(scene.materials.values())
    rolling_law = model("rolling", scene.located(scene.contact.rolling)) if scene.contact.rolling != "none" else None
    oscillator = getattr(rolling_law, "oscillator", None)
    for t in np.unique(start.type):
        m, radius = materials[t], float(start.radius[start.type == t].min())
        shear = m.young_modulus / (2.0 * (1.0 + m.poisson_ratio))
        rayleigh = min(
            rayleigh, math.pi * radius * math.sqrt(m.density / shear) / (0.1631 * m.poisson_ratio + 0.8766)
        )
    for one in meetings(scene, start):
        met = _impact(law, at.stiffness, one, speed)
        if speed > 0:
            contact = min(contact, met.time)
            damped = min(damped, met.time * damped_time(law, one.restitution))
            overlap = max(overlap, met.overlap / one.radius)
        stable = min(stable, limits_at(scene, one, met.secant, met.tangent, oscillator)[1])
        if weight > 0.0:
            force = weight * math.pi / 3.0 * (2.0 * one.radius) ** 2
            resting = pressed(law, one.row[at.stiffness], one.reduced_radius, force, one.own)
            settled = min(settled, limits_at(scene, one, *resting, oscillator)[0])
    return Limits(
        rayleigh=float(rayleigh),
        contact_time=float(contact),
        settled=float(settled),
        stable=float(stable),
        frame=float(frame),
        field=field_limit(scene, start),
        travel=longest_step(scene, start.radius, speed),
        max_speed=float(speed),
        damped_contact=float(damped),
        overlap=float(overlap),
        contact_steps=CONTACT_STEPS[scene.time.accuracy],
    )


def _impact(law: str, stiffness: int, one: Meeting, speed: float) -> Impact:
    """The undamped impact of ``one`` at ``speed`` [m/s]; ``stiffness`` is the column of the stiffness base."""
    return impact(law, one.row[stiffness], one.reduced_mass, one.reduced_radius, max(speed, 1e-6), one.own)


def limits_at(scene: Scene, one: Meeting, secant: float, slope: float, oscillator: Any) -> tuple[float, float]:
    """Stability limits [s] of a packing and of one contact with k_n = ``secant`` and the slope of its force [N/m]."""
    at = coefficient_columns(scene)
    normal, tangential = _springs(scene, one, secant, slope)
    packing, single = packing_limit(normal, tangential), contact_limit(normal, tangential)
    if oscillator is not None and one.row[at.rolling_friction] > 0.0:
        arm, inertia = one.row[at.rolling_friction] * one.reduced_radius, 0.4 * one.reduced_mass * one.radius**2
        bending, losing = oscillator(secant, arm, one.row[at.rolling_damping], 3.5 * inertia)
        spring = Spring(bending, losing, 3.5 * inertia)
        rolling = rolling_limit(spring, tangential, inertia, one.reduced_mass, one.radius, one.wall)
        packing, single = min(packing, rolling[0]), min(single, rolling[1])
    return packing, single


def _springs(scene: Scene, one: Meeting, secant: float, slope: float) -> tuple[Spring, Spring]:
    """Springs along and across the normal of a contact with k_n = ``secant`` and the slope of its force [N/m]."""
    at = coefficient_columns(scene)
    dashpot = one.row[at.damping] * math.sqrt(secant * one.reduced_mass)
    sticks = scene.contact.tangential != "none" and one.row[at.friction] > 0.0
    shear, shear_damping = (one.row[at.of(name)] if sticks else 0.0 for name in ("shear", "shear_damping"))
    return along(slope, dashpot, one.reduced_mass), across(shear * secant, shear_damping * dashpot, one.reduced_mass)


@dataclass(frozen=True)
class RestitutionError:
    """How far the restitution of impacts at ``max_speed`` is from the one asked for [-]."""

    materials: tuple[str, str]
    asked: float
    mean: float
    """Over the instants within a step at which a contact may begin."""
    worst: float


def restitution_error(scene: Scene, start: InitialGrains, speed: float, dt: float) -> RestitutionError | None:
    """The largest error in the mean that the time step ``dt`` [s] makes in an impact at ``speed`` [m/s].

    None where nothing collides, and for a law with a memory or a reach beyond contact: what it gives back is not one number.
    """
    law, at = scene.located(scene.contact.normal), coefficient_columns(scene)
    module = model("normal", law)
    if hasattr(module, "HISTORY") or hasattr(module, "gap") or speed <= 0.0:
        return None
    found = []
    for one in meetings(scene, start):
        of = (law, one.row[at.stiffness], one.row[at.damping], one.reduced_mass, one.reduced_radius, speed)
        fine = _impact(law, at.stiffness, one, speed).time / FINE_STEPS
        out = rebound(*of, dt, one.own) - rebound(*of, min(fine, dt), one.own).mean()
        found.append(RestitutionError(one.materials, one.restitution, float(out.mean()), float(out[np.argmax(np.abs(out))])))
    return max(found, key=lambda error: abs(error.mean), default=None)


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
