"""Fast grains fly along paths: lists last longer, nobody who is met is missed, and no bit of the result changes."""

import numpy as np
import pytest
import trimesh

from warpdem import Scene, Simulation

R = 1e-3
SKIN = 2e-4


def scene(positions, velocities, **keys) -> Scene:
    group = {"material": "g", "radius": R, "positions": np.asarray(positions), "velocities": np.asarray(velocities)}
    return Scene.model_validate(
        {
            "materials": {"g": {"density": 2500.0, "young_modulus": 1e8, "poisson_ratio": 0.3}},
            "contact": {"normal": "hertz", "tangential": "mindlin", "rolling": "none"},
            "pairs": [{"materials": ["g", "g"], "restitution": 0.7, "friction": 0.5}],
            "grains": [group],
            "time": {"end": 1.0, "step": 2e-6, "max_speed": 2.0},
            "engine": {"skin": SKIN, "max_overlap": 0.9, **keys.pop("engine", {})},
            **keys,
        }
    )


def grounded(sim: Simulation) -> Simulation:
    """The same, but nobody flies: what the lists alone make of it."""
    sim.lists.flights.take = lambda stray, hasty: (stray, np.zeros(0, dtype=int))
    sim.lists.flights.reassign_paths = lambda wanted: None
    return sim


def both(given: Scene, steps: int, pieces: int = 5, **keys) -> tuple[Simulation, Simulation]:
    """With and without flights, equal at several instants."""
    flying = Simulation(given, device="cpu", **{"threads": 1, **keys})
    still = grounded(Simulation(given, device="cpu", threads=1))
    for _ in range(pieces):
        for sim in (flying, still):
            sim.step(steps // pieces)
            sim.contacts()  # the forces of this instant count among the extremes
        assert flying.state_hash() == still.state_hash()
        assert flying.extremes == still.extremes
    return flying, still


def layer(side: int, height: float = 0.0) -> np.ndarray:
    """Grains side by side, ``side`` by ``side``, with gaps of a tenth of the radius."""
    grid = np.stack(np.meshgrid(np.arange(side), np.arange(side), indexing="ij"), axis=-1).reshape(-1, 2) - 0.5 * (side - 1)
    return np.column_stack([2.1 * R * grid, np.full(side**2, height)])


def volley() -> tuple[np.ndarray, np.ndarray]:
    """A resting layer, and grains that are shot at it, past it, at each other and side by side."""
    rest = layer(5)
    shot = np.array(
        [
            [0, 0, 0.03], [0.001, 0, -0.04],  # into the layer from both sides
            [0.03, 0, 0.004], [-0.03, 0, 0.0045],  # above it, at each other
            [0.05, 0.02, 0], [0.05, 0.0225, 0],  # side by side, past it
            [0.02, -0.02, 0.0], [0.02, 0.02, 0.0004],  # at each other where nothing else is
            [0.04, 0, 0.06], [-0.01, 0.05, 0.06],  # their paths cross, at different times
        ]
    )  # fmt: skip
    way = np.array(
        [[0, 0, -9], [0, 0, 7], [-8, 0, 0], [8, 0, 0], [-9, 0, 0], [-9, 0, 0], [0, 8, 0], [0, -8, 0], [-8, 0, 0], [0, -8, 0]]
    )
    return np.concatenate([rest, shot]), np.concatenate([np.zeros_like(rest), way])


@pytest.mark.parametrize("threads", [1, 2])
def test_who_is_shot_at_is_met(threads):
    flying, still = both(scene(*volley(), gravity=[0, 0, 0]), 5000, threads=threads)
    assert flying.extremes["pair_overlap_share"] > 0.05
    assert np.linalg.norm(flying.particles.velocity[:25], axis=1).max() > 1.0, "the layer was not hit"
    assert flying.lists.flights.laid > 2
    assert flying.lists.rebuilds < 0.25 * still.lists.rebuilds


def test_the_graph_flies_too():
    flying, still = both(scene(*volley(), gravity=[0, 0, 0]), 3000, resident=True)
    assert flying.lists.flights.laid > 1
    assert flying.lists.rebuilds < 0.5 * still.lists.rebuilds


def test_grains_that_fall_alike_need_no_lists():
    """Away from everything a cluster falls, and two grains side by side for ever, with a gap of half the skin."""
    cluster = np.concatenate([layer(4, 3e-3 * k) for k in range(3)])
    pair = np.array([[0.05, 0, 0], [0.05 + 2 * R + 0.5 * SKIN, 0, 0]])
    places = np.concatenate([cluster, pair])
    flying, still = both(scene(places, np.zeros_like(places) - [0, 0, 3.0], gravity=[0, 0, -9.81]), 10_000)
    assert still.lists.rebuilds > 200
    assert flying.lists.rebuilds + flying.lists.inner_rebuilds < 15
    assert flying.lists.flights.laid <= 2  # one path, the parabola, holds all the time


def vessel(folder) -> dict:
    """A floor, a slanted plate that moves, and a block of triangles."""
    trimesh.creation.box((0.01, 0.01, 0.01)).export(folder / "block.stl")
    return {
        "walls": [
            {"name": "floor", "material": "g", "plane": {"point": [0, 0, -0.012], "normal": [0, 0, 1]}},
            {"name": "block", "material": "g", "mesh": str(folder / "block.stl"), "translate": [0.03, 0, 0]},
            {
                "name": "lid", "material": "g", "plane": {"point": [0, 0, 0.03], "normal": [0.1, 0, -1]},
                "motion": {"velocity": [0, 0, -1.5]},
            },
            {
                "name": "rod", "material": "g",
                "cylinder": {"point": [0, 0.03, 0], "axis": [1, 0, 0], "radius": 0.004, "inside": False},
            },
        ],
        "gravity": [0, 0, -9.81],
    }  # fmt: skip


def shots() -> tuple[np.ndarray, np.ndarray]:
    """Grains shot at each of the walls, past their rims, along the floor, and some that rest."""
    places = [
        [0, 0, 0], [0.01, 0, 0], [0.01, 0.004, 0.002], [0, 0.01, 0.001], [0, -0.02, -0.0109], [0.005, -0.02, 0.005],
        [0.05, 0, 0.0058],
    ]  # fmt: skip
    ways = [[0, 0, -3], [3, 0, 0], [3, 0.5, 0], [0, 3, 0], [3, 0, 0], [0, 0, 4], [-4, 0, 0]]
    rest = layer(4, -0.0109) - [0.03, 0.03, 0]
    return np.concatenate([places, rest]), np.concatenate([ways, np.zeros_like(rest)])


@pytest.mark.parametrize("resident", [False, True])
def test_walls_are_met_whether_they_move_or_not(tmp_path, resident):
    flying, still = both(scene(*shots(), **vessel(tmp_path)), 5000, resident=resident)
    assert flying.extremes["wall_overlap_share"] > 0.02
    turned = (flying.particles.velocity[:7] * shots()[1][:7]).sum(axis=1) < 0.0
    assert turned.sum() >= 4, "the walls were not hit"
    assert flying.lists.flights.laid > 2
    assert flying.lists.rebuilds < 0.7 * still.lists.rebuilds


def test_periodic_images_are_met():
    """Grains that fly round and round through borders, into each other and into a layer that lies across one."""
    borders = {axis: {"min": -0.02, "max": 0.02, "kind": "periodic"} for axis in "xyz"}
    places = np.concatenate([layer(3, -0.0199), [[0.003, 0, 0], [0.015, 0.015, 0.01], [-0.015, 0.0152, 0.01]]])
    ways = np.concatenate([np.zeros((9, 3)), [[0, 0, 5.0], [4, 0, 0], [-4, 0, 0]]])
    flying, _ = both(scene(places, ways, gravity=[0, 0, 0], borders=borders, engine={"integrator": "rk2"}), 6000)
    assert np.linalg.norm(flying.particles.velocity[:9], axis=1).max() > 0.5, "the layer was not hit"
    assert flying.lists.flights.laid > 2


def test_one_that_is_held_back_leaves_its_path():
    """A strong drag bends every path: it is noticed, and the grain still meets what is there."""
    drag = {"model": "drag", "parameters": {"coefficient": 1e-3}}
    flying, _ = both(scene(*volley(), gravity=[0, 0, 0], fields=[drag]), 3000)
    assert flying.lists.flights.laid > 2
    assert flying.extremes["pair_overlap_share"] > 0.01


def test_one_that_is_deflected_meets_what_its_path_had_passed():
    """A magnetic field takes it round a circle of 0.1 m; what it hits is six diameters beside the line on which it starts."""
    mass, speed, circle, angle = 2500.0 * 4.0 / 3.0 * np.pi * R**3, 20.0, 0.1, 0.5
    field = {"charge": 1.0, "magnetic": [0, 0, -mass * speed / circle]}
    target = circle * np.array([np.sin(angle), 1.0 - np.cos(angle), 0.0])
    given = scene(
        [[0, 0, 0], target], [[speed, 0, 0], [0, 0, 0]], gravity=[0, 0, 0], fields=[{"model": "lorentz", "parameters": field}]
    )
    flying, _ = both(given, 1500)
    assert flying.lists.flights.laid > 0
    assert flying.extremes["pair_overlap_share"] > 0.01


def test_a_resumed_run_flies_on_with_the_same_bits(tmp_path):
    whole = Simulation(scene(*volley(), gravity=[0, 0, 0]), device="cpu", threads=1)
    whole.step(1000)
    assert len(whole.lists.flights.slots) > 3
    whole.save_checkpoint(tmp_path / "half.h5")
    rest = Simulation.from_checkpoint(tmp_path / "half.h5", device="cpu", threads=1)
    for sim in (whole, rest):
        sim.step(2000)
    assert rest.state_hash() == whole.state_hash()
