"""Scenes that show how stable the default scheme is: a gas, a bed at rest, an incline, a packing and one contact."""

import math

import numpy as np

from warpdem import Scene, Simulation, StabilityError
from warpdem.model.coefficients import coefficient_columns
from warpdem.model.contact_cases import contact_cases, limits_at
from warpdem.model.impact import impact

RADIUS, DENSITY, POISSON, G = 1e-3, 2500.0, 0.3, 9.81
MASS = DENSITY * 4.0 / 3.0 * math.pi * RADIUS**3


def plane(name: str, point: list, normal: list) -> dict:
    """Table of a wall."""
    return {"name": name, "material": "g", "plane": {"point": point, "normal": normal}}


def scene(young_modulus: float, step: float, grains: dict, contact: dict, pair: dict, max_speed: float, **keys) -> Scene:
    """One material; ``keys`` are further tables of the scene."""
    return Scene.model_validate(
        {
            "gravity": [0, 0, 0],
            "materials": {"g": {"density": DENSITY, "young_modulus": young_modulus, "poisson_ratio": POISSON}},
            "contact": {"normal": "hertz", "tangential": "none", "rolling": "none", **contact},
            "pairs": [{"materials": ["g", "g"], **pair}],
            "grains": [{"material": "g", **grains}],
            "time": {"end": 1.0, "step": step, "max_speed": max_speed},
            **keys,
        }
    )


# --- a gas -----------------------------------------------------------------------------------------------------------

GAS_MODULUS, GAS_SPEED = 5e7, 0.5
FASTEST = 2.0
"""Approach speed of any impact in the gas [m/s]."""


def gas(
    restitution: float, steps_per_contact: float, device: str = "cpu", side: int = 3, spacing: float = 4.0, seed: int = 3
) -> Simulation:
    """side^3 frictionless grains at random speeds in a box with six walls.

    Args:
        restitution: of all impacts.
        steps_per_contact: time steps within the contact time of the quickest impact, at ``FASTEST``.
        device: where it runs.
        side: grains along each edge.
        spacing: edge of the box per grain along it, over the radius.
        seed: of the velocities.
    """
    edge = side * spacing * RADIUS
    position = (np.stack(np.meshgrid(*[np.arange(side)] * 3), axis=-1).reshape(-1, 3) + 0.5) * edge / side
    velocity = np.random.default_rng(seed).normal(size=position.shape)
    velocity *= GAS_SPEED / np.sqrt(np.mean(np.sum(velocity**2, axis=1)))
    stiffness = GAS_MODULUS / (2.0 * (1.0 - POISSON**2)) * math.sqrt(0.5 * RADIUS)
    depth = (15.0 * 0.5 * MASS * FASTEST**2 / (16.0 * stiffness)) ** 0.4
    normals = np.concatenate([np.eye(3), -np.eye(3)])
    walls = [plane(f"face{k}", (edge * (n < 0)).tolist(), n.tolist()) for k, n in enumerate(normals)]
    grains = {"positions": position.tolist(), "radius": RADIUS, "velocities": velocity.tolist()}
    step = 2.943275184 * depth / FASTEST / steps_per_contact
    pair = {"restitution": restitution}
    wide = {"skin": 2.0 * RADIUS}  # few and fast: lists live longer than they cost
    gas_scene = scene(GAS_MODULUS, step, grains, {}, pair, 1e-3, walls=walls, engine=wide)
    return Simulation(gas_scene, device=device, threads=1)


def total_energy(sim: Simulation) -> float:
    """Kinetic, elastic and potential energy [J]."""
    return sum(sim.energy().values())


def energy_between_contacts(sim: Simulation, pause: int) -> float:
    """Energy [J] at an instant without any contact: within one, the energy of a symplectic scheme swings.

    Args:
        sim: a gas.
        pause: steps between two looks, half a contact or so.
    """
    while (sim.contacts().overlap > 0.0).any():
        sim.step(pause)
    return total_energy(sim)


def energy_errors(steps_per_contact: float, windows: int = 120, length: float = 6.0, device: str = "cpu", seed: int = 3):
    """Changes of the energy of a gas of 125 over its energy in windows of ``length`` contact times, shape (windows,).

    A window sees a handful of impacts, each with an error of its own: many short ones tell the rms best.
    """
    sim = gas(1.0, steps_per_contact, device, side=5, spacing=6.0, seed=seed)
    energy = [total_energy(sim)]
    for _ in range(windows):
        sim.step(round(length * steps_per_contact))
        energy.append(energy_between_contacts(sim, max(1, round(0.5 * steps_per_contact))))
    return np.diff(energy) / energy[0]


# --- at rest ---------------------------------------------------------------------------------------------------------


def bed(rolling: str, device: str = "cpu", seed: int = 5, rolling_friction: float = 0.1) -> Simulation:
    """36 grains of 0.8 to 1.2 mm radius above an inverted pyramid of four planes at 45 degrees.

    No place of it holds a grain on one contact, about whose normal it could spin or roll for ever.
    """
    rng = np.random.default_rng(seed)
    radii = RADIUS * rng.uniform(0.8, 1.2, 36)
    grid = np.stack(np.meshgrid(*[np.arange(k) for k in (3, 3, 4)], indexing="ij"), axis=-1).reshape(-1, 3)
    place = RADIUS * ((grid - [1, 1, 0]) * 2.5 + rng.uniform(-0.04, 0.04, grid.shape) + [0, 0, 4.3])
    walls = [plane(f"side{k}", [0, 0, 0], [x, y, 1]) for k, (x, y) in enumerate(((1, 0), (-1, 0), (0, 1), (0, -1)))]
    grains = {"positions": place.tolist(), "radii": radii.tolist()}
    pair = {"restitution": 0.3, "friction": 0.5}
    pair |= {} if rolling == "none" else {"rolling_friction": rolling_friction}
    contact = {"tangential": "mindlin", "rolling": rolling}
    return Simulation(
        scene(5e6, 1e-5, grains, contact, pair, 0.3, gravity=[0, 0, -G], walls=walls), device=device, threads=1
    )


def kinetic_share(sim: Simulation) -> np.ndarray:
    """Kinetic energy of each grain over m g d [-]."""
    p = sim.particles
    kinetic = p.mass * (p.velocity**2).sum(axis=1) + p.inertia * (p.spin**2).sum(axis=1)
    return 0.5 * kinetic / (p.mass * G * 2.0 * p.radius)


def incline(shares: np.ndarray, rolling_friction: float, step: float, device: str = "cpu") -> list[Simulation]:
    """A grain at its static overlap on a plane for each slope, tan(slope) = share x rolling friction; constant torque."""
    stiffness = 4.0 / 3.0 * 5e6 / (2.0 * (1.0 - POISSON**2)) * math.sqrt(RADIUS)
    out = []
    for share in shares:
        slope = math.atan(share * rolling_friction)
        depth = (MASS * G * math.cos(slope) / stiffness) ** (2.0 / 3.0)
        grains = {"positions": [[0, 0, RADIUS - depth]], "radius": RADIUS}
        pair = {"restitution": 0.3, "friction": 2.0, "rolling_friction": rolling_friction}
        contact = {"tangential": "mindlin", "rolling": "constant"}
        gravity = [G * math.sin(slope), 0, -G * math.cos(slope)]
        one = scene(5e6, step, grains, contact, pair, 1e-3, gravity=gravity, walls=[plane("plane", [0, 0, 0], [0, 0, 1])])
        out.append(Simulation(one, device=device, threads=1))
    return out


# --- stability limits ------------------------------------------------------------------------------------------------

OVERLAP = 1e-5
"""Over the radius [-]: small, so that the pressure of the contacts does not make the packing buckle."""
DISTURBANCE = 1e-11
"""Speeds [m/s] that must not grow: far above round-off, far below what opens a contact."""
GROWTH, STEPS, LOOK = 100.0, 600, 60


def law_of(normal: str, ratio: float, restitution: float) -> tuple[dict, dict]:
    """Tables of contact and pair; k_t/k_n = ``ratio`` with hooke, given by Poisson's ratio with hertz; 0: no friction."""
    pair = {"restitution": restitution, "friction": 1.0} if ratio else {"restitution": restitution}
    if normal == "hooke":
        pair |= {"stiffness": 1000.0} | ({"tangential_stiffness_ratio": ratio} if ratio else {})
    return {"normal": normal, "tangential": "mindlin" if ratio else "none"}, pair


def stiffness_of(normal: str, radius: float) -> tuple[float, float]:
    """K and p of the elastic force K d^p of ``law_of`` between surfaces of reduced radius [m]."""
    if normal == "hooke":
        return 1000.0, 1.0
    return 4.0 / 3.0 * 1e7 / (2.0 * (1.0 - POISSON**2)) * math.sqrt(radius), 1.5


def impact_speed(normal: str, mass: float, radius: float) -> float:
    """Speed [m/s] at which an impact of reduced mass [kg] and radius [m] reaches ``OVERLAP``: K d^(p+1)/(p+1) = m v^2/2."""
    k, p = stiffness_of(normal, radius)
    return math.sqrt(2.0 * k * (OVERLAP * RADIUS) ** (p + 1.0) / ((p + 1.0) * mass))


def packing(normal: str, ratio: float, restitution: float, step: float, device: str = "cpu") -> Simulation:
    """Simple cubic packing of 6^3 grains in periodic borders, every contact at ``OVERLAP``, disturbed at random."""
    contact, pair = law_of(normal, ratio, restitution)
    distance = RADIUS * (2.0 - OVERLAP)
    position = (np.stack(np.meshgrid(*[np.arange(6)] * 3), axis=-1).reshape(-1, 3) + 0.25) * distance
    border = {"min": 0.0, "max": 6.0 * distance, "kind": "periodic"}
    borders = dict.fromkeys("xyz", border)
    return _disturbed(
        position, contact, pair, step, device, impact_speed(normal, 0.5 * MASS, 0.5 * RADIUS), borders=borders
    )


def pressed(normal: str, ratio: float, restitution: float, step: float, device: str = "cpu") -> Simulation:
    """Two grains pressed together to ``OVERLAP`` by weak springs to the point where they touch, disturbed at random."""
    contact, pair = law_of(normal, ratio, restitution)
    k, p = stiffness_of(normal, 0.5 * RADIUS)
    place = RADIUS * (1.0 - 0.5 * OVERLAP)
    spring = k * (OVERLAP * RADIUS) ** p / place
    fields = [{"model": "harmonic", "parameters": {"stiffness": spring}}]
    position = np.array([[-place, 0, 0], [place, 0, 0]])
    speed = impact_speed(normal, 0.5 * MASS, 0.5 * RADIUS)
    return _disturbed(position, contact, pair, step, device, speed, fields=fields)


def _disturbed(position, contact, pair, step, device, max_speed, **keys) -> Simulation:
    rng = np.random.default_rng(1)
    velocity, spin = DISTURBANCE * rng.normal(size=(2, *position.shape))
    grains = {"positions": position.tolist(), "radius": RADIUS, "velocities": velocity.tolist()}
    grains |= {"spins": (spin / RADIUS).tolist()} if contact["tangential"] != "none" else {}
    noting = {"guards": "record"}  # steps over the limit are what this is about
    return Simulation(scene(1e7, step, grains, contact, pair, max_speed, engine=noting, **keys), device=device, threads=1)


def packing_rule(sim: Simulation) -> float:
    """The rule's limit [s] of a packing whose contacts are at the overlap of an impact at ``max_speed``."""
    one = next(contact_cases(sim.scene, sim.expected))
    law, at = sim.scene.contact.normal, coefficient_columns(sim.scene)
    met = impact(law, one.row[at.stiffness], one.reduced_mass, one.reduced_radius, sim.scene.time.max_speed, one.own)
    return limits_at(sim.scene, one, met.secant, met.tangent, None)[0]


def contact_rule(sim: Simulation) -> float:
    """The rule's limit [s] of one such contact."""
    return sim.limits.stable


def grows(sim: Simulation) -> bool:
    """Whether the disturbance grows a hundredfold within 600 steps."""
    for _ in range(STEPS // LOOK):
        try:
            sim.step(LOOK)
        except StabilityError:
            return True
        p = sim.particles
        if not max(np.abs(p.velocity).max(), RADIUS * np.abs(p.spin).max()) < GROWTH * DISTURBANCE:
            return True
    return False


def measured_limit(make, normal: str, ratio: float, restitution: float, guess: float) -> float:
    """Least step [s] at which ``make`` (``packing`` or ``pressed``) grows, by bisection between guess/2 and 2 guess, to 1 %.

    Raises:
        ValueError: it grows at half the guess, or does not at twice it.
    """
    low, high = 0.5 * guess, 2.0 * guess
    for step, expected in ((low, False), (high, True)):
        if grows(make(normal, ratio, restitution, step)) is not expected:
            raise ValueError(f"{make.__name__}: the limit is not within a factor 2 of {guess:g} s")
    while high / low > 1.01:
        middle = math.sqrt(low * high)
        low, high = (low, middle) if grows(make(normal, ratio, restitution, middle)) else (middle, high)
    return math.sqrt(low * high)
