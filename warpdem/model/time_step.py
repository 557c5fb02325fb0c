"""Characteristic times of a scene and the time step chosen from them.

Rayleigh time     pi R sqrt(rho/G) / (0.1631 nu + 0.8766), the least over the grains
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

Stiffnesses are those at the largest overlap of an impact at ``max_speed``. Z = 6 is a dense packing, the caution of
"auto"; beyond the limit of one contact a given step is refused (a dense packing hardly ever holds such overlaps everywhere).
What a bed does hold everywhere is its weight: ``settled`` is the limit of a packing whose contacts carry

    F = p pi d^2/3,     p = 0.6 rho (g + Omega^2 r) H        [N], [Pa]

with H the height of the grains at the start; it was 0.7 to 1 times the limit measured in beds at rest.

``step = "auto"`` is the least of 10 % of the Rayleigh time, contact time / 40, 80 % of the spectral limit of a packing, and
what frame and fields allow.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from warpdem.errors import SceneError
from warpdem.filling.initial_grains import InitialGrains
from warpdem.kernels.contact.normal_law import NORMAL_CAP, ROLLING_MASS, TANGENTIAL_CAP
from warpdem.mesh.triangle_mesh import TriangleMesh
from warpdem.model.features import coefficient_columns, coefficient_table
from warpdem.model.impact import damped_time, impact, own_of, pressed
from warpdem.model.travel import longest_step
from warpdem.scene.model import Scene
from warpdem.scene.models import model, numbers
from warpdem.scene.motion_chain import frame_chain, wall_chain

PACKED = 6  # contacts per grain: dense frictional packing
RAYLEIGH_SHARE = 0.1
PACKED_SHARE = 0.8  # overlaps of impacts everywhere in a packing are caution enough
CONTACT_STEPS = 40
BED_FRACTION = 0.6  # of the volume of a bed is solid
FRAME_ANGLE = 0.02  # [rad] per step
FIELD_ANGLE = 0.1  # [rad] per step: second order leaves 4e-4 of the motion; a drag is stable up to 1


@dataclass(frozen=True)
class Limits:
    """What bounds the time step of a scene; inf where nothing does [s]."""

    rayleigh: float
    contact_time: float
    """Undamped contact time of the quickest impact at ``max_speed`` [s]."""
    packed: float
    """Spectral limit of a packing whose overlaps are those of an impact at ``max_speed`` [s]."""
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

    @property
    def candidates(self) -> dict[str, float]:
        """The steps that "auto" chooses the least of [s], by what binds them."""
        return {
            f"{RAYLEIGH_SHARE:.0%} of the Rayleigh time": RAYLEIGH_SHARE * self.rayleigh,
            f"contact time / {CONTACT_STEPS} at {self.max_speed:.3g} m/s": self.contact_time / CONTACT_STEPS,
            f"{PACKED_SHARE:.0%} of the spectral limit of a packing": PACKED_SHARE * self.packed,
            f"{FRAME_ANGLE} rad of the frame": self.frame,
            f"{FIELD_ANGLE} rad of the external fields": self.field,
            "half the limit of travel beside meshes": 0.5 * self.travel,
        }

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
    """sqrt(2 g H) plus the largest wall speed and start speed [m/s]; H is the extent of walls and grains along gravity."""
    if not len(start.id):
        return 0.0
    points = [start.position, *(m.vertices for m in meshes.values())]
    for wall in scene.walls:
        if wall.shape is not None:  # the feet of the grains: a plane has no extent of its own
            points.append(wall.shape.nearest(start.position)[0])
    cloud = np.concatenate(points)
    extent = cloud.max(axis=0) - cloud.min(axis=0)
    gravity = np.array(scene.gravity)
    g = float(np.linalg.norm(gravity))
    chains = [frame_chain(scene), *(wall_chain(scene, k) for k in range(len(scene.walls)))]
    height = float(np.linalg.norm(extent)) if chains[0].rotates else float(abs(gravity) @ extent) / g if g else 0.0
    speed = math.sqrt(2.0 * g * height) + sum(chain.speed_bound(cloud, scene.time.end) for chain in chains)
    start_speed = float(np.linalg.norm(start.velocity, axis=1).max())
    return max(speed, 0.0) + start_speed


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


def limits(scene: Scene, start: InitialGrains, meshes: dict[str, TriangleMesh]) -> Limits:
    """Limits of the time step of ``scene`` for the grains it starts with."""
    rate = frame_chain(scene).max_rate
    frame = FRAME_ANGLE / rate if rate > 0 else math.inf
    speed = scene.time.max_speed if scene.time.max_speed is not None else fall_speed(scene, start, meshes)
    rayleigh = contact = packed = settled = stable = damped = math.inf
    weight = weight_per_area(scene, start)
    overlap = 0.0
    law = scene.located(scene.contact.normal)
    materials = list(scene.materials.values())
    names = list(scene.materials)
    at = coefficient_columns(scene)
    table = coefficient_table(scene).reshape(len(names), len(names), at.width)
    rolling_law = model("rolling", scene.located(scene.contact.rolling)) if scene.contact.rolling != "none" else None
    oscillator = getattr(rolling_law, "oscillator", None)
    for t in np.unique(start.type):
        m = materials[t]
        radius = float(start.radius[start.type == t].min())
        shear = m.young_modulus / (2.0 * (1.0 + m.poisson_ratio))
        rayleigh = min(
            rayleigh, math.pi * radius * math.sqrt(m.density / shear) / (0.1631 * m.poisson_ratio + 0.8766)
        )
        mass = m.density * 4.0 / 3.0 * math.pi * radius**3
        walls = {names.index(w.material) for w in scene.walls}
        alone = len(start.id) < 2 and not scene.streams
        partners = [(int(o), 0.5 * mass, 0.5 * radius) for o in np.unique(start.type) if not alone]
        partners += [(o, mass, radius) for o in walls]
        for other, reduced_mass, reduced_radius in partners:
            restitution = scene.pair(names[t], names[other]).restitution
            row = table[t, other]
            own = own_of(law, row)
            damping, shear, shear_damping = (row[at.of(name)] for name in ("damping", "shear", "shear_damping"))
            met = impact(law, row[at.stiffness], reduced_mass, reduced_radius, max(speed, 1e-6), own)
            if speed > 0:
                contact = min(contact, met.time)
                damped = min(damped, met.time * damped_time(law, restitution))
                overlap = max(overlap, met.overlap / radius)
            dashpot = damping * math.sqrt(met.secant * reduced_mass)
            sticks = scene.contact.tangential != "none" and row[at.friction] > 0.0
            normal = along(met.tangent, dashpot, reduced_mass)
            tangential = across(sticks * shear * met.secant, sticks * shear_damping * dashpot, reduced_mass)
            packed = min(packed, packing_limit(normal, tangential))
            if weight > 0.0:
                secant, slope = pressed(
                    law, row[at.stiffness], reduced_radius, weight * math.pi / 3.0 * (2.0 * radius) ** 2, own
                )  # fmt: skip
                resting = damping * math.sqrt(secant * reduced_mass)
                pushed = along(slope, resting, reduced_mass)
                rubbed = across(sticks * shear * secant, sticks * shear_damping * resting, reduced_mass)
                settled = min(settled, packing_limit(pushed, rubbed))
            stable = min(stable, contact_limit(normal, tangential))
            if oscillator is not None and row[at.rolling_friction] > 0.0:
                arm = row[at.rolling_friction] * reduced_radius
                inertia = 0.4 * reduced_mass * radius**2
                bending, losing = oscillator(met.secant, arm, row[at.rolling_damping], 3.5 * inertia)
                spring = Spring(bending, losing, 3.5 * inertia)
                wall = reduced_radius == radius
                rolling = rolling_limit(spring, tangential, inertia, reduced_mass, radius, wall)
                packed, stable = min(packed, rolling[0]), min(stable, rolling[1])
    return Limits(
        rayleigh=float(rayleigh),
        contact_time=float(contact),
        packed=float(packed),
        settled=float(settled),
        stable=float(stable),
        frame=float(frame),
        field=field_limit(scene, start),
        travel=longest_step(scene, start.radius, speed),
        max_speed=float(speed),
        damped_contact=float(damped),
        overlap=float(overlap),
    )


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
