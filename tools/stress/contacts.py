"""Hard scenes of contacts: impacts, time steps, rest."""

import math
from collections.abc import Callable

import numpy as np

from stress.cases import DENSITY, DOWN, FLOOR, NU, RADIUS, Case, entering, rest_depth, scene_of, simulate
from warpdem import Scene, Simulation, StabilityError
from warpdem.guards.stability import springs, stable_step

CASES: list[Case] = []
case = entering(CASES)


# -- impacts ---------------------------------------------------------------------------------------


def impact_error(young=5e7, restitution=0.5, speed=0.2, radii=(RADIUS, RADIUS), at=0.0, densities=None, **keys) -> float:
    """Restitution obtained less the one asked for, in a head-on impact."""
    gap = 1e-3 * min(radii)
    way = (sum(radii) + gap) * np.array([0.48, 0.6, 0.64])
    first = np.full(3, at)
    velocities = [[0, 0, 0], (-speed * np.array([0.48, 0.6, 0.64])).tolist()]
    materials = {}
    if densities:
        grains = [
            {"material": name, "positions": [point.tolist()], "radius": radius, "velocities": [velocity]}
            for name, point, radius, velocity in zip("gh", (first, first + way), radii, velocities, strict=True)
        ]
        base = {"young_modulus": young, "poisson_ratio": NU}
        materials = {
            "grains": grains,
            "materials": {name: {"density": density, **base} for name, density in zip("gh", densities, strict=True)},
            "pairs": [{"materials": list(m), "restitution": restitution, "friction": 0.5} for m in ("gg", "gh", "hh")],
        }
        scene = scene_of([first], young=young, max_speed=speed, accuracy="impact", **keys).model_dump(mode="json") | materials
        sim = Simulation(Scene.model_validate(scene), device="cpu", threads=1)
    else:
        sim = simulate([first, first + way], radius=list(radii), young=young, restitution=restitution, max_speed=speed,
                       accuracy="impact", grains={"velocities": velocities}, **keys)  # fmt: skip
    sim.run(until=1.5 * gap / speed + 3.0 * sim.limits.contact_time * (1.0 if restitution > 0.05 else 3.0))
    velocity = sim.particles.velocity
    return abs(float((velocity[1] - velocity[0]) @ way / np.linalg.norm(way)) / speed - restitution)


for young, speed in ((1e5, 0.02), (1e7, 0.2), (1e9, 1.0), (1e11, 1.0)):
    case(f"impact, stiffness {young:.0e} Pa", "restitution obtained - asked (0.5)", 0.01, young, 0.5, speed, tier="short")(
        impact_error
    )
for e in (0.01, 0.1, 0.9, 1.0):
    case(f"impact, restitution {e}", "restitution obtained - asked", 0.01, 5e7, e, tier="short")(impact_error)
for ratio in (10, 50):
    radii = (ratio * RADIUS, RADIUS)
    case(f"impact, size ratio {ratio}", "restitution obtained - asked (0.5)", 0.01, 5e7, 0.5, 0.2, radii, tier="short")(
        impact_error
    )
for ratio in (1e3, 1e6):
    densities = (DENSITY * ratio, DENSITY)
    case(f"impact, mass ratio {ratio:.0e} by densities", "restitution obtained - asked (0.5)", 0.01, densities)(
        lambda densities: impact_error(densities=densities)
    )
for name, size in (("grains of 1 micrometre", 1e-6), ("rocks of 10 m", 10.0)):
    case(f"impact of {name}", "restitution obtained - asked (0.5)", 0.01, 5e7, 0.5, 0.2, (size, size), tier="short")(
        impact_error
    )
case("impact at 100 m/s, 1e11 Pa", "restitution obtained - asked (0.5)", 0.01, 1e11, 0.5, 100.0, tier="short")(impact_error)
case("impact in single precision law", "restitution obtained - asked (0.5)", 0.01)(
    lambda: impact_error(engine={"precision": "mixed"})
)


@case("impact 1 km from the origin", "restitution there - at the origin", 1e-5, tier="short")
def far_impact() -> float:
    """Restitution of an impact far away less the one at the origin."""
    return abs(impact_error(at=1000.0) - impact_error(at=0.0))


def oblique(friction: float, energy: bool) -> float:
    """Energy gained in an oblique impact of spinning grains over what was there, or the change of both momenta over theirs."""
    motion = {"velocities": [[0.3, 0.2, 0], [-0.2, -0.4, 0.1]], "spins": [[0, 50, 200], [90, 0, 300]]}
    sim = simulate([[0, 0, 0], [1.2e-3, 1.61e-3, 0]], friction=friction, restitution=1.0, grains=motion)

    def sums() -> tuple[np.ndarray, np.ndarray, float]:
        p = sim.particles
        momentum = (p.mass[:, None] * p.velocity).sum(axis=0)
        angular = np.cross(p.position, p.mass[:, None] * p.velocity).sum(axis=0) + (p.inertia[:, None] * p.spin).sum(axis=0)
        return momentum, angular, sum(sim.energy().values())

    before = sums()
    sim.run(until=1.5e-3)
    after = sums()
    assert sim.extremes["pair_overlap_share"] > 0.0
    if energy:
        return after[2] / before[2] - 1.0
    return max(float(np.linalg.norm(b - a) / np.linalg.norm(a)) for a, b in zip(before[:2], after[:2], strict=True))


for mu in (0.0, 1.0, 10.0):
    case(f"oblique elastic impact with spins, friction {mu:g}", "change of momentum and angular momentum / their size", 1e-12,
         mu, False, tier="short")(oblique)  # fmt: skip
    case(f"oblique elastic impact with spins, friction {mu:g}", "energy gained / energy", 1e-3, mu, True, tier="short")(oblique)


@case("soft grains start in each other, allowed: overlap 0.5 R", "energy out / elastic energy in - 1", 0.01, tier="short")
def explosive() -> float:
    """Kinetic energy after two grains have sprung apart over the elastic energy before, less 1."""
    keys = {"young": 1e6, "restitution": 1.0, "max_speed": 10.0, "accuracy": "impact", "engine": {"max_overlap": 1.0}}
    sim = simulate([[0, 0, 0], [1.5e-3, 0, 0]], **keys)
    before = sim.energy()["elastic"]
    sim.run(until=3e-3)
    after = sim.energy()
    return abs(after["kinetic"] / before - 1.0) if after["elastic"] == 0.0 else math.inf


case("grains start in each other, overlap 0.5 R", "refused", tier="short", expected="refused",
     reason="such an overlap holds more energy than any impact brings: it would explode")(
    lambda: simulate([[0, 0, 0], [1.5e-3, 0, 0]])
)  # fmt: skip
case("coincident grains", "refused", tier="short", expected="refused",
     reason="two centres in one point have no normal")(lambda: simulate([[0, 0, 0], [0, 0, 0]]))  # fmt: skip


# -- time step -------------------------------------------------------------------------------------


def longest_step(make: Callable[[float], Simulation], holds: Callable[[Simulation], bool], rule: float) -> float:
    """Largest step [s] between a half and twice ``rule`` at which what ``make`` gives ``holds`` for 600 steps."""

    def survives(step: float) -> bool:
        sim = make(step)
        for _ in range(20):
            try:
                sim.step(30)
            except StabilityError:
                return False
            if not holds(sim):
                return False
        return True

    low, high = 0.5 * rule, 2.0 * rule
    for _ in range(8):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if survives(middle) else (low, middle)
    return low


def lost_over_limit(restitution: float) -> float:
    """Largest step that holds a rolling pair over the measured limit, less 1."""

    def pair(step: float) -> Simulation:
        hold = {"model": "harmonic", "parameters": {"stiffness": 5e-3 / 0.995e-3}}
        return simulate(
            [[-0.995e-3, 0, 0], [0.995e-3, 0, 0]], step, restitution=restitution, friction=1e6, max_speed=1e-9,
            contact={"normal": "hooke"}, pair={"stiffness": 500.0, "tangential_stiffness_ratio": 0.8}, fields=[hold],
            engine={"guards": "record"}, grains={"spins": [[0, 0, 1e-6], [0, 0, 1e-6]]},
        )  # fmt: skip

    sim = pair(1e-7)
    p = sim.particles
    rule = stable_step(springs(sim.view, sim.contacts()), p.mass, p.inertia)[0]
    return abs(longest_step(pair, lambda sim: float(np.abs(sim.particles.spin).max()) < 1e-4, rule) / rule - 1.0)


for e in (1.0, 0.5, 0.1):
    case(f"time step swept to failure, pair, restitution {e}", "largest stable step / limit of its contacts - 1", 0.1, e)(
        lost_over_limit
    )


@case("time step swept to failure, periodic cubic lattice", "largest stable step / spectral rule (Z = 6) - 1", 0.1)
def lattice() -> float:
    """Largest stable step of a lattice over the rule for dense packings, less 1."""
    count, ratio, k = 6, 0.8, 500.0
    spacing = 1.98e-3
    points = np.stack(np.meshgrid(*[np.arange(count)] * 3, indexing="ij"), axis=-1).reshape(-1, 3) * spacing
    side = {"min": -0.5 * spacing, "max": (count - 0.5) * spacing, "kind": "periodic"}
    mass = DENSITY * 4.0 / 3.0 * math.pi * RADIUS**3
    rule = 2.0 / math.sqrt(6.0 / mass * k * max(2.0 / 3.0 * (1.0 + 2.0 * ratio), 10.0 / 3.0 * ratio))
    velocities = 1e-7 * np.random.default_rng(0).normal(size=points.shape)

    def block(step: float) -> Simulation:
        return simulate(points, step, restitution=1.0, friction=1e6, max_speed=1e-9, contact={"normal": "hooke"},
                        pair={"stiffness": k, "tangential_stiffness_ratio": ratio}, engine={"guards": "record"},
                        borders={axis: side for axis in "xyz"}, grains={"velocities": velocities.tolist()})  # fmt: skip

    return abs(longest_step(block, lambda sim: float(np.abs(sim.particles.velocity).max()) < 1e-5, rule) / rule - 1.0)


case("time.step over the limit of stability", "refused", tier="short", expected="refused",
     reason="the spring of an impact would gain energy at every step")(
    lambda: simulate([[0, 0, 0], [5e-3, 0, 0]], 1e-3)
)  # fmt: skip


@case("impact at 60 m/s with a step for 0.5 m/s", "stopped", tier="short", expected="stopped",
      reason="max_speed was understated: the grains go into each other before a step can answer")  # fmt: skip
def understated() -> float:
    """Two grains that meet much faster than the scene says."""
    sim = simulate([[0, 0, 0], [0.01, 0, 0]], max_speed=0.5, young=5e6, grains={"velocities": [[60, 0, 0], [0, 0, 0]]})
    sim.run(until=1e-3)
    return 0.0


# -- rest ------------------------------------------------------------------------------------------


def one_contact(steps: int) -> float:
    """Change of the overlap of a grain that rests on a floor, over that overlap."""
    depth = rest_depth(5e7, 9.81)
    sim = simulate([[0, 0, RADIUS - depth]], walls=[FLOOR], gravity=DOWN, max_speed=0.01)
    sim.step(1000)
    first = sim.particles.position[0, 2]
    sim.step(steps)
    return abs(sim.particles.position[0, 2] - first) / depth


for steps, tier in ((10_000, "short"), (1_000_000, "default"), (10_000_000, "full")):
    case(f"one contact at rest for {steps:.0e} steps", "change of its overlap / overlap", 1e-6, steps, tier=tier)(one_contact)


@case("grain at rest 1 km from the origin", "overlap / closed form - 1", 1e-4, tier="short")
def far_rest() -> float:
    """Error of the overlap of a grain at rest far from the origin."""
    depth = rest_depth(5e7, 9.81)
    floor = {"name": "floor", "material": "g", "plane": {"point": [1000.0, 1000.0, 1000.0], "normal": [0, 0, 1]}}
    sim = simulate([[1000.0, 1000.0, 1000.0 + RADIUS - depth]], walls=[floor], gravity=DOWN, max_speed=0.01)
    sim.step(5000)
    return abs(float(sim.contacts().overlap[0]) / depth - 1.0)


@case("grain at rest under 1e5 g, 1e11 Pa", "overlap / closed form - 1", 1e-6, tier="short")
def heavy_rest() -> float:
    """Error of the overlap of a grain at rest under a huge weight."""
    depth = rest_depth(1e11, 1e6)
    sim = simulate([[0, 0, RADIUS - depth]], walls=[FLOOR], gravity=(0, 0, -1e6), young=1e11, restitution=0.1, max_speed=1.0)
    sim.step(3000)
    return abs(float(sim.contacts().overlap[0]) / depth - 1.0)


def bed(count: int, **keys) -> Simulation:
    """``count`` times ``count`` times 4 grains in a box of planes, dropped as a loose lattice."""
    points = np.stack(np.meshgrid(*[np.arange(count)] * 2, np.arange(4), indexing="ij"), axis=-1).reshape(-1, 3) * 2.1e-3
    points[:, :2] += 1.05e-3 * (points[:, 2:] / 2.1e-3 % 2)  # over gaps: columns would go on falling over for seconds
    points += 1.05e-3 + 4e-5 * np.random.default_rng(1).random(points.shape)
    side = count * 2.1e-3 + 1.15e-3
    walls = [
        {"name": name, "material": "g", "plane": {"point": point, "normal": normal}}
        for name, point, normal in (
            ("floor", [0, 0, 0], [0, 0, 1]), ("left", [0, 0, 0], [1, 0, 0]), ("right", [side, 0, 0], [-1, 0, 0]),
            ("front", [0, 0, 0], [0, 1, 0]), ("back", [0, side, 0], [0, -1, 0]),
        )
    ]  # fmt: skip
    walls += keys.pop("more_walls", [])
    return simulate(points, walls=walls, gravity=DOWN, young=5e6, **keys)


def resting_bed(steps: int, share: bool) -> float:
    """Kinetic energy of a bed with the rolling spring after ``steps``: over what it was before, or per grain over m g d."""
    sim = bed(4, contact={"rolling": "spring"}, pair={"rolling_friction": 0.2}, max_speed=0.3, restitution=0.3)
    sim.step(30_000)
    energy = []
    for count in (0, steps):
        sim.step(count)
        p = sim.particles
        energy.append(float(np.mean(0.5 * np.einsum("ij,ij->i", p.velocity, p.velocity)) / (9.81 * 2.0 * RADIUS)))
    return energy[1] / energy[0] if share else energy[1]


case("settling bed, rolling spring, 5e4 steps", "kinetic energy / before", 1.0, 50_000, True)(resting_bed)
case("bed at rest, rolling spring, 1e6 steps", "kinetic energy per grain / m g d", 1e-8, 1_000_000, False, tier="full")(
    resting_bed
)


def compressed(share: float) -> float:
    """Overlap share of a bed under a lid that comes down until it has lost ``share`` of its height, over engine.max_overlap."""
    lid = {"name": "lid", "material": "g", "plane": {"point": [0, 0, 8.5e-3], "normal": [0, 0, -1]},
           "motion": {"velocity": [0, 0, -0.1]}}  # fmt: skip
    sim = bed(3, more_walls=[lid], max_speed=0.5)
    sim.run(until=share * 8.5e-3 / 0.1)
    return max(sim.extremes["pair_overlap_share"], sim.extremes["wall_overlap_share"]) / 0.1


case("bed pressed by a moving lid", "deepest overlap / allowed", 1.0, 0.06, tier="short")(compressed)
case("bed pressed to half its height", "stopped", math.nan, 0.5, tier="short", expected="stopped",
     reason="spheres fill at most 74 % of the room: the rest could only be overlap")(compressed)  # fmt: skip


@case("elastic gas between walls, 2e4 steps", "drift of its energy", 1e-3)
def gas() -> float:
    """Change of the energy of an elastic gas over that energy."""
    count, side = 3, 12e-3
    points = (np.stack(np.meshgrid(*[np.arange(count)] * 3, indexing="ij"), axis=-1).reshape(-1, 3) + 0.5) * side / count
    velocities = np.random.default_rng(3).normal(size=points.shape) * 0.3
    walls = [
        {"name": f"{'xyz'[k]}{s}", "material": "g",
         "plane": {"point": [side * (s > 0)] * 3, "normal": (-s * np.eye(3)[k]).tolist()}}
        for k in range(3) for s in (-1, 1)
    ]  # fmt: skip
    sim = simulate(points, walls=walls, restitution=1.0, friction=0.0, max_speed=1.5,
                   grains={"velocities": velocities.tolist()})  # fmt: skip
    before = sum(sim.energy().values())
    sim.step(20_000)
    return abs(sum(sim.energy().values()) / before - 1.0)


@case("slide to roll from 1e4 rad/s", "speed / (2/7) w R - 1", 2e-3)
def spun() -> float:
    """Error of the speed at which a spinning grain comes to roll."""
    depth = rest_depth(1e9, 9.81)
    sim = simulate([[0, 0, RADIUS - depth]], walls=[FLOOR], gravity=DOWN, young=1e9, friction=10.0, restitution=0.1,
                   max_speed=0.05, grains={"spins": [[0, 1e4, 0]]})  # fmt: skip
    sim.run(until=2.0 / 7.0 * 1e4 * RADIUS / (10.0 * 9.81) * 1.05)
    return abs(sim.particles.velocity[0, 0] / (2.0 / 7.0 * 1e4 * RADIUS) - 1.0)


@case("grain jammed between planes 4 degrees apart", "kinetic energy / energy of its fall", 1e-6)
def jammed() -> float:
    """Kinetic energy of a grain that fell into a narrow wedge over that of its fall."""
    tilt = math.radians(2.0)
    walls = [
        {"name": name, "material": "g", "plane": {"point": [0, 0, 0], "normal": [s * math.cos(tilt), 0, math.sin(tilt)]}}
        for name, s in (("left", 1.0), ("right", -1.0))
    ]
    sim = simulate([[0, 0, 1.001 * RADIUS / math.sin(tilt)]], walls=walls, gravity=DOWN, young=5e8, friction=1.0, max_speed=0.1)
    sim.run(until=0.02)
    v = sim.particles.velocity[0]
    return float(0.5 * v @ v / (9.81 * 0.001 * RADIUS / math.sin(tilt)))
