"""The inner list that CPU threads build in one launch each is that of the launches of a graph."""

import numpy as np
import pytest

import warpdem.engine.host_build as host_build
from warpdem import Scene, Simulation
from warpdem.engine.host_build import HostBuild

RADIUS = 1e-3
PER_GRAIN = ["touching", "near", "width", "touching_start", "near_start", "slot_start", "reference"]
PER_BATCH = ["owner", "partner", "slot_i", "slot_j", "constants", "kind"]


def layers(materials: int = 1, speed: float = 0.0) -> Scene:
    """1000 grains in layers upon each other on a plane: some touch, some are near, some neither."""
    rng = np.random.default_rng(3)
    grid = np.stack(np.meshgrid(*[np.arange(10)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    positions = (grid + 0.5) * 2.0 * RADIUS + rng.normal(0.0, 0.02 * RADIUS, (1000, 3))
    ids, names = rng.permutation(1000), ["glass", "steel"][:materials]
    stuff = {"density": 2500, "young_modulus": 5e6, "poisson_ratio": 0.3}
    pairs = [[a, b] for k, a in enumerate(names) for b in names[k:]]
    return Scene.model_validate(
        {
            "materials": dict.fromkeys(names, stuff),
            "contact": {"tangential": "mindlin", "rolling": "constant"},
            "pairs": [
                {"materials": pair, "restitution": 0.5, "friction": 0.1 * (k + 1), "rolling_friction": 0.1}
                for k, pair in enumerate(pairs)
            ],
            "grains": [
                {
                    "material": name, "positions": positions[k::materials], "radius": RADIUS, "ids": ids[k::materials],
                    "velocities": rng.normal(0.0, speed, (1000 // materials, 3)) if speed else np.zeros((1000 // materials, 3)),
                }
                for k, name in enumerate(names)
            ],
            "walls": [{"name": "floor", "material": "glass", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}],
            "time": {"end": 1, "step": 5e-6, "max_speed": 2},
            "engine": {"skin": 0.3 * RADIUS, "max_overlap": 0.3},
        }
    )  # fmt: skip


def listed(sim: Simulation) -> dict[str, np.ndarray]:
    """Copies of the arrays of the inner list, as far as they are used."""
    lists = sim.lists
    batches = lists.totals[0] // sim.plan.backend.lanes
    out = {name: getattr(lists, name).numpy().copy() for name in PER_GRAIN}
    out |= {name: getattr(lists, name).numpy()[:batches].copy() for name in PER_BATCH}
    real = lists.slot_i.numpy()[:batches] < lists.slot_force.shape[0] - 1
    for name in ("slot_i", "slot_j"):  # that of no grain goes by the length of the arrays
        out[name] = np.where(real, out[name], -1)
    out["history"] = np.where(real[:, None, :], lists.history.numpy()[:batches], 0.0)
    out["candidates"] = lists.wall_contacts.candidates.numpy().copy()
    out["wall grains"] = lists.wall_contacts.grain.numpy()[: lists.row_count].copy()
    start, count = lists.outer.start.numpy(), lists.outer.neighbors.numpy()
    entry = np.repeat(start[:-1], count) + np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    return out | {"totals": np.array(lists.totals), "contact": lists.outer.contact.numpy()[entry]}


@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize("materials", [1, 2])
def test_list_of_the_threads_is_that_of_the_launches(threads, materials):
    sim = Simulation(layers(materials), device="cpu", threads=threads)
    sim.step(20)
    build, found = sim.lists.build, []
    for make in (build.inner, lambda: HostBuild.inner(build), build.inner):
        build.batch.set_time()
        make()
        found.append(listed(sim))
    assert found[0]["totals"][0] > 1000 and 0 < found[0]["totals"][2] < 1000
    assert (found[0]["touching"] > 0).any() and (found[0]["near"] > 0).any() and (found[0]["history"] != 0.0).any()
    for name, values in found[0].items():
        for other in found[1:]:
            np.testing.assert_array_equal(values, other[name], err_msg=name)


@pytest.mark.parametrize("threads", [1, 3])
def test_arrays_that_are_too_short_grow(threads):
    """Nothing is written then; the list is built again in longer arrays."""
    sim = Simulation(layers(), device="cpu", threads=threads)
    sim.step(20)
    build, lists = sim.lists.build, sim.lists
    build.inner()
    expected, length = listed(sim), lists.owner.shape[0]
    pool = lists.pool
    for name in ("contact batches", "force slots"):
        pool._capacities[name] = 8
    lists.set_totals([0, 0, 0])
    build.size_by_contacts()
    assert lists.owner.shape[0] == 8 < length
    build.inner()
    assert lists.owner.shape[0] >= lists.totals[0] // sim.plan.backend.lanes > 8
    for name, values in listed(sim).items():
        np.testing.assert_array_equal(values, expected[name], err_msg=name)


def test_how_often_grains_are_sorted_in_memory_changes_no_bit(monkeypatch):
    """And the arrays of the outer list, of which there are two each, hold what they should."""
    hashes, slots = set(), []
    for builds, threads in ((0, 1), (8, 1), (10**6, 3)):
        monkeypatch.setattr(host_build, "BUILDS_IN_ORDER", builds)
        sim = Simulation(layers(speed=0.3), device="cpu", threads=threads)
        sim.step(600)
        assert sim.lists.rebuilds > 10
        hashes.add(sim.state_hash())
        slots.append(sim.state.id.numpy().copy())
    assert len(hashes) == 1
    assert (slots[0] != slots[2]).any(), "memory was in the same order anyway"


def test_grains_that_came_are_sorted_in_with_the_others():
    """They are appended to the lists first; the next outer list is built in memory that has room for them."""
    scene = layers(speed=0.3).model_dump(exclude_unset=True)
    box = {"min": [0.0, 0.0, 25 * RADIUS], "max": [20 * RADIUS, 20 * RADIUS, 30 * RADIUS]}
    stream = {"material": "glass", "diameter": 2 * RADIUS, "box": box, "velocity": [0, 0, -1], "count_rate": 2e4}
    hashes = set()
    for threads in (1, 3):
        sim = Simulation(Scene.model_validate(scene | {"streams": [stream]}), device="cpu", threads=threads)
        sim.step(600)
        assert len(sim.state) > 1020 and sim.lists.rebuilds > 10
        hashes.add(sim.state_hash())
    assert len(hashes) == 1
