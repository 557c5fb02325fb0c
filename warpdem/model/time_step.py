"""Characteristic times of a scene and the time step chosen from them.

Rayleigh time     pi R sqrt(rho/G) / (0.1631 nu + 0.8766), the least over the grains
contact time      of an undamped impact at max_speed, from the energy of the normal law
spectral limit    the least step at which a mode (K, C, m*) of the contacts grows: K dt^2/4 + C dt = m*
frame             0.02 / Omega_max (nested rotations: of the sum of their largest rates)
travel            s r / max_speed beside meshes, see ``travel``
external fields   0.1 / the largest rate at which one changes a grain's motion: sqrt(k/m), c/m, e B/m

Modes, with m* the reduced mass of a contact, k its stiffness (tangent along the normal, secant across) and C made of its
damping as K is of its stiffness:

    packing of Z contacts per grain   K = (Z/3)(k_n + 2 k_t) neighbours move against each other, K = (5 Z/3) k_t all turn
    one contact                       K = k_n along the normal, K = (7/2) k_t rolling
    rolling spring k_r                against I* = (2/5) m* R^2, on a wall together with slip; in a packing (2 Z/3) k_r

That condition is exact for a damped oscillator under the predicted velocity v* = v + (dt/2) a of the default scheme; with
w = sqrt(K/m*) and z = C/(2 w m*) it reads dt = (2/w)(sqrt(1 + 4 z^2) - 2 z). The modes are those of Bloch waves on cubic
packings of equal grains with free rotation. Measured: tests/verification/test_stability_limit.py.

Stiffnesses are those at the largest overlap of an impact at ``max_speed``. Z = 6 is a dense packing, the caution of
"auto"; beyond the limit of one contact a given step is refused (a dense packing hardly ever holds such overlaps everywhere).
What a bed does hold everywhere is its weight: ``settled`` is the limit of a packing whose contacts carry

    F = p pi d^2/3,     p = 0.6 rho (g + Omega^2 r) H        [N], [Pa]

with H the height of the grains at the start; it was 0.7 to 1 times the limit measured in beds at rest.

``step = "auto"`` is the least of 10 % of the Rayleigh time, contact time / 40, 80 % of the spectral limit of a packing, and
what frame and fields allow.
"""

import math
from dataclasses import dataclass

import numpy as np

from warpdem.errors import SceneError
from warpdem.filling.initial_grains import InitialGrains
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


def stable_step(stiffness: float, damping: float, mass: float) -> float:
    """Least time step [s] at which m x'' + C x' + K x = 0 grows under the predicted velocity: K dt^2/4 + C dt = m.

    Args:
        stiffness: K [N/m], or its share of a rotation.
        damping: C [N s/m].
        mass: m [kg].
    """
    return 2.0 * mass / (damping + math.sqrt(damping**2 + stiffness * mass))


def packing_limit(normal: tuple[float, float], tangential: tuple[float, float], mass: float, contacts: int = PACKED) -> float:
    """Stability limit of a packing [s].

    Args:
        normal: stiffness [N/m] and damping [N s/m] of each contact along its normal.
        tangential: the same across it.
        mass: reduced mass m* of a contact [kg].
        contacts: contacts per grain Z [-].
    """
    against, damping = (contacts / 3.0 * (n + 2.0 * t) for n, t in zip(normal, tangential, strict=True))
    turning, turning_damping = (contacts * 5.0 / 3.0 * t for t in tangential)
    return min(stable_step(against, damping, mass), stable_step(turning, turning_damping, mass) if turning > 0.0 else math.inf)


def contact_limit(normal: tuple[float, float], tangential: tuple[float, float], mass: float) -> float:
    """Stability limit of one contact [s]; arguments as of ``packing_limit``."""
    rolling, rolling_damping = (3.5 * t for t in tangential)
    return min(stable_step(*normal, mass), stable_step(rolling, rolling_damping, mass) if rolling > 0.0 else math.inf)


def rolling_limit(
    spring: tuple[float, float], tangential: tuple[float, float], inertia: float, mass: float, radius: float, wall: bool
) -> tuple[float, float]:
    """Stability limits [s] of a packing and of one contact whose relative rotation bends a spring.

    On a wall the angle bends it and slips by R at once: the larger rate of both together. Between two grains slip goes with
    the sum of the spins and the spring with their difference, so that neither feels the other.

    Args:
        spring: k_r [N m] and C_r [N m s].
        tangential: stiffness [N/m] and damping [N s/m] across the contact.
        inertia: I* [kg m2].
        mass: reduced mass m* [kg].
        radius: of the grain [m].
        wall: whether the contact is one with a wall.
    """
    stiffness, damping = (2.0 * PACKED / 3.0 * k for k in spring)
    packing = stable_step(stiffness, damping, inertia)
    if not wall:
        return packing, stable_step(*spring, inertia)
    both = []
    for k_r, k_t in zip(spring, tangential, strict=True):
        trace, product = k_t / mass + (k_t * radius**2 + k_r) / inertia, k_t * k_r / (mass * inertia)
        both.append(0.5 * (trace + math.sqrt(trace**2 - 4.0 * product)))
    stiffness, damping = both
    return packing, stable_step(stiffness, damping, 1.0)


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
            normal = met.tangent, dashpot
            tangential = (shear * met.secant, shear_damping * dashpot) if sticks else (0.0, 0.0)
            packed = min(packed, packing_limit(normal, tangential, reduced_mass))
            if weight > 0.0:
                secant, slope = pressed(
                    law, row[at.stiffness], reduced_radius, weight * math.pi / 3.0 * (2.0 * radius) ** 2, own
                )  # fmt: skip
                resting = damping * math.sqrt(secant * reduced_mass)
                across = (shear * secant, shear_damping * resting) if sticks else (0.0, 0.0)
                settled = min(settled, packing_limit((slope, resting), across, reduced_mass))
            stable = min(stable, contact_limit(normal, tangential, reduced_mass))
            if oscillator is not None and row[at.rolling_friction] > 0.0:
                arm = row[at.rolling_friction] * reduced_radius
                spring = oscillator(met.secant, arm, row[at.rolling_damping], 1.4 * reduced_mass * radius**2)
                wall = reduced_radius == radius
                rolling = rolling_limit(spring, tangential, 0.4 * reduced_mass * radius**2, reduced_mass, radius, wall)
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
