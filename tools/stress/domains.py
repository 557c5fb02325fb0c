"""Hard scenes of frames, walls and domains."""

import math
import tempfile
from pathlib import Path

import numpy as np

from stress.cases import DOWN, FLOOR, RADIUS, Case, entering, rest_depth, scene_of, simulate
from warpdem import Scene, Simulation

BOX = str(Path(__file__).resolve().parents[2] / "scenes" / "meshes" / "box.stl")

CASES: list[Case] = []
case = entering(CASES)


# -- frames ----------------------------------------------------------------------------------------


def seen_flight(frame: dict, step: float, steps: int) -> float:
    """Distance from the straight line in the laboratory over its length, of a free grain seen in ``frame``."""
    # a grain alone meets nothing, but the scene's materials limit the step
    sim = simulate([[0.3, 0.1, 0.2]], step, frame=frame, engine={"guards": "record"},
                   grains={"velocities": [[3.0, 1.0, 0.5]], "velocities_in": "laboratory"})  # fmt: skip
    sim.step(steps)
    way = np.array([3.0, 1.0, 0.5]) * sim.time
    return float(np.linalg.norm(sim.particles.position_lab[0] - [0.3, 0.1, 0.2] - way) / np.linalg.norm(way))


for rate in (10.0, 1e3, 1e4):
    case(f"free grain seen at {rate:.0e} rad/s, 1e5 steps", "distance from the straight line / its length", 1e-11,
         {"axis": [1, 2, 3], "rate": rate}, 0.02 / rate, 100_000)(seen_flight)  # fmt: skip
case("frame stops dead from 1e4 rad/s", "distance from the straight line / its length", 1e-11,
     {"axis": [0, 0, 1], "schedule": [{"until": 5e-3, "rate": 1e4}, {"rate": 0.0}]}, 2e-6, 10_000)(seen_flight)  # fmt: skip


def drum(rate: float, young: float, schedule=None) -> Simulation:
    """A grain held against the inside of a turning cylinder of radius 0.05 m."""
    depth = rest_depth(young, rate**2 * 0.049)
    frame = {"axis": [0, 0, 1], **({"schedule": schedule} if schedule else {"rate": rate})}
    cylinder = {"name": "drum", "material": "g", "cylinder": {"point": [0, 0, 0], "axis": [0, 0, 1], "radius": 0.05}}
    return simulate([[0.049 + depth, 0, 0]], walls=[cylinder], frame=frame, young=young, restitution=0.1, max_speed=2.0,
                    engine={"max_overlap": 0.2})  # fmt: skip


@case("grain in a centrifuge at 1e4 rad/s (5e5 g), 1e11 Pa", "overlap / closed form - 1", 1e-4)
def centrifuge() -> float:
    """Error of the overlap of a grain at rest in a turning bore."""
    sim = drum(1e4, 1e11)
    sim.step(5000)
    found = float(sim.contacts().overlap[0])
    # R* of a grain in a bore is taken as the grain's; the acceleration is that at its centre
    return abs(found / rest_depth(1e11, 1e8 * (0.049 + found)) - 1.0)


@case("drum stops dead from 100 rad/s with a grain at its wall", "energy gained / energy at the stop", 0.0)
def stopped_drum() -> float:
    """Energy that a grain gains after its drum has stopped over what it had."""
    sim = drum(100.0, 1e9, [{"until": 1e-3, "rate": 100.0}, {"rate": 0.0}])
    sim.run(until=1.001e-3)
    before = sum(sim.energy().values())
    sim.run(until=3e-3)
    return max(0.0, sum(sim.energy().values()) / before - 1.0)


# -- walls -----------------------------------------------------------------------------------------


def write_fan(path: Path, count: int, apex: float) -> None:
    """Write a binary STL: ``count`` triangles about the z axis, corners 0.01 m from it, the middle at height ``apex`` [m]."""
    angle = np.linspace(0.0, 2.0 * math.pi, count + 1)
    rim = np.stack([0.01 * np.cos(angle), 0.01 * np.sin(angle), 0.0 * angle], axis=1)
    rim[-1] = rim[0]
    corners = np.stack([np.tile([0.0, 0.0, apex], (count, 1)), rim[:-1], rim[1:]], axis=1)
    data = np.zeros(count, dtype=[("normal", "<f4", 3), ("corner", "<f4", (3, 3)), ("rest", "<u2")])
    data["corner"] = corners
    path.write_bytes(bytes(80) + np.uint32(count).tobytes() + data.tobytes())


def on_edges(apex: float) -> float:
    """Overlap of a grain at rest on the middle of a fan of a thousand triangles over the closed form, less 1."""
    depth = rest_depth(5e7, 9.81)
    with tempfile.TemporaryDirectory() as folder:
        write_fan(path := Path(folder) / "fan.stl", 1000, apex)
        wall = {"name": "fan", "material": "g", "mesh": str(path), "open": True}
        sim = simulate([[0, 0, apex + RADIUS - depth]], walls=[wall], gravity=DOWN, max_speed=0.01)
    sim.step(5000)
    return abs(float(sim.contacts().overlap.sum()) / depth - 1.0)


case("grain on the meeting point of a thousand edges, flat", "overlap / closed form - 1", 1e-6, 0.0)(on_edges)
case("grain on the tip of a thousand edges, raised", "overlap / closed form - 1", 1e-3, 1e-3)(on_edges)


def box_flight(speed_share: float) -> float:
    """Share of grains that are outside a mesh box after many impacts, at ``speed_share`` of the limit of travel."""
    points = 0.2 + 0.15 * np.stack(np.meshgrid(*[np.arange(4)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    velocities = np.random.default_rng(5).normal(size=points.shape)
    velocities /= np.linalg.norm(velocities, axis=1)[:, None]
    step = 2e-4
    speed = speed_share * 0.2 * 0.02 / step
    sim = simulate(points, step, radius=0.02, young=3e7, restitution=0.9, friction=0.3, max_speed=1.0,
                   walls=[{"name": "box", "material": "g", "mesh": BOX}], engine={"max_overlap": 0.9},
                   grains={"velocities": (speed * velocities).tolist()})  # fmt: skip
    sim.step(2000)
    outside = ((sim.particles.position < 0.0) | (sim.particles.position > 1.0)).any(axis=1)
    return float(outside.mean())


case("64 grains at 0.5 of the travel limit in a mesh box", "share of grains lost", 0.0, 0.5)(box_flight)
case("64 grains at 1.5 times the travel limit in a mesh box", "stopped", math.nan, 1.5, expected="stopped",
     reason="in one step a grain could be on the other side of a triangle")(box_flight)  # fmt: skip


# -- domain ----------------------------------------------------------------------------------------

case("one grain alone, 1e5 steps", "distance from the parabola / its length", 1e-11, tier="short")(
    lambda: parabola(100_000)
)


def parabola(steps: int) -> float:
    """Distance from the parabola of a free grain over the length of its way."""
    sim = simulate([[0, 0, 1]], 1e-5, gravity=DOWN, grains={"velocities": [[0.3, 0, 0.2]]})
    sim.step(steps)
    t = sim.time
    way = np.array([0.3 * t, 0.0, 0.2 * t - 0.5 * 9.81 * t * t])
    return float(np.linalg.norm(sim.particles.position[0] - [0, 0, 1] - way) / np.linalg.norm(way))


def stream_scene(rate: float, start: float) -> Simulation:
    """Grains that fall through a box into an outlet, ``rate`` [1/s] from ``start`` [s] on."""
    data = scene_of([[0, 0, 0]], 1e-5, walls=[FLOOR], gravity=DOWN, max_speed=1.0).model_dump(mode="json", exclude_unset=True)
    del data["grains"]
    stream = {"material": "g", "box": {"min": [-0.01, -0.01, 0.02], "max": [0.01, 0.01, 0.04]}, "diameter": 2e-3,
              "velocity": [0, 0, -0.5], "count_rate": rate, "start": start}  # fmt: skip
    outlet = {"name": "low", "box": {"min": [-1, -1, -1], "max": [1, 1, 0.01]}}
    return Simulation(Scene.model_validate(data | {"streams": [stream], "outlets": [outlet]}), device="cpu", threads=1)


@case("empty scene: a stream that has not begun", "grains there", 0.0)
def empty() -> float:
    """Number of grains before the first comes in."""
    sim = stream_scene(1000.0, 1.0)
    sim.step(1000)
    return float(len(sim.state)) + abs(sum(sim.energy().values()))


@case("stream into an outlet", "grains that came - left - are there", 0.0)
def balance() -> float:
    """Grains that came less those that left and those that are there."""
    sim = stream_scene(2000.0, 0.0)
    sim.step(5000)
    assert sim.left["low"][0] > 10
    return abs(sim.inlets[0].count - sim.left["low"][0] - len(sim.state))


@case("grains leave the domain on all sides", "grains at the start - left - there", 0.0, tier="short")
def leaving() -> float:
    """Grains at the start less those that left and those that are there."""
    points = 0.01 * np.random.default_rng(0).uniform(-1, 1, size=(200, 3))
    points = points[[np.linalg.norm(points[:k] - points[k], axis=1).min(initial=1.0) > 2.1e-3 for k in range(200)]]
    side = {"min": -0.011, "max": 0.011, "kind": "open"}
    sim = simulate(points, 1e-5, borders={axis: side for axis in "xyz"}, grains={"velocities": (100.0 * points).tolist()})
    sim.step(3000)
    gone = sum(count for count, _ in sim.left.values())
    return float(abs(len(points) - gone - len(sim.state)) + (gone == 0))


@case("a grain passes a border that stops", "stopped", expected="stopped", reason="the scene asks for it")
def border() -> float:
    """A grain that flies beyond a border."""
    side = {"min": -0.01, "max": 0.01, "kind": "stop"}
    simulate([[0, 0, 0]], 1e-5, borders={"x": side}, grains={"velocities": [[1.0, 0, 0]]}).step(2000)
    return 0.0


@case("grid wrap-around: far grains in the cells of a pair", "way of the pair with them - without", 0.0, tier="short")
def wrapped() -> float:
    """Distance of a pair from where it is without the grains far away."""
    pair = np.array([[0, 0, 0], [1.99e-3, 0, 0]])
    far = 0.01 * 2.0 ** np.arange(4, 24)[:, None] * [1.0, 0.0, 0.0]
    alone, crowded = (simulate(points, 1e-6) for points in (pair, np.concatenate([pair, far, -far])))
    for sim in (alone, crowded):
        sim.step(2000)
    return float(np.abs(crowded.particles.position[:2] - alone.particles.position).max())


def thin(length: float) -> float:
    """Change of the momentum of a gas in a box that is periodic on all sides, over the sum of its sizes; edge in diameters."""
    points = np.array([[0, 0, 0], [0.5, 0.5, 0.0], [0.5, 0.0, 0.5], [0.0, 0.5, 0.5]]) * length * 2 * RADIUS + 0.2 * RADIUS
    side = {"min": 0.0, "max": length * 2 * RADIUS, "kind": "periodic"}
    velocities = np.random.default_rng(2).normal(size=points.shape) * 0.3
    sim = simulate(points, restitution=0.9, borders={axis: side for axis in "xyz"}, grains={"velocities": velocities.tolist()})
    sim.step(20_000)
    p = sim.particles
    assert sim.extremes["pair_overlap_share"] > 0.0
    return float(np.linalg.norm((p.velocity - velocities).sum(axis=0)) / np.abs(velocities).sum())


case("periodic box of 4.5 diameters", "change of momentum", 1e-12, 4.5)(thin)
case("periodic box of 3 diameters", "refused", math.nan, 3.0, expected="refused",
     reason="a grain would meet two images of another, of which the lists know one")(thin)  # fmt: skip


@case("size ratio 50 in one cloud", "change of momentum / sum of its sizes", 1e-12)
def cloud() -> float:
    """Change of the momentum of small grains that hit a large one, over the sum of its sizes."""
    rng = np.random.default_rng(4)
    directions = rng.normal(size=(60, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    directions = directions[[np.linalg.norm(directions[:k] - directions[k], axis=1).min(initial=1.0) > 0.05 for k in range(60)]]
    points = np.concatenate([[[0, 0, 0]], directions * 0.0512])
    radii = [0.05] + [1e-3] * len(directions)
    velocities = np.concatenate([[[0.0, 0, 0]], -0.5 * directions + 0.1 * rng.normal(size=directions.shape)])
    sim = simulate(points, radius=radii, grains={"velocities": velocities.tolist()})
    mass = sim.particles.mass[:, None]
    sim.step(5000)
    change = np.linalg.norm((mass * (sim.particles.velocity - velocities)).sum(axis=0))
    assert sim.extremes["pair_overlap_share"] > 0.0
    return float(change / np.abs(mass * velocities).sum())


@case("energy put in behind the engine's back", "stopped", tier="short", expected="stopped",
      reason="what no wall, no fall and no spring gave cannot be there")  # fmt: skip
def from_nowhere() -> float:
    """Grains that are made 10 % faster between two steps."""
    sim = simulate([[0, 0, 0], [0.1, 0, 0]], 1e-5, grains={"velocities": [[0.1, 0, 0], [0, 0.1, 0]]})
    sim.step(1100)
    record = sim.state.record.numpy()
    record[:, 4:7] *= 1.1
    sim.state.record.assign(record)
    sim.step(3000)
    return 0.0
