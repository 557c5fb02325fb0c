"""Lists: every contact is found, whatever the sizes and distances, and its memory survives what happens to the lists."""

import numpy as np
import pytest

from warpdem import Scene, Simulation
from warpdem.engine.neighbours import morton_order, starts


def simulate(positions, radii, *, velocities=None, ids=None, skin="auto", threads=1, rolling=0.1, **changes):
    """Grains without walls and gravity; the same kernels for all tests of this file."""
    n = len(positions)
    data = {
        "gravity": [0, 0, 0],
        "materials": {"glass": {"density": 2500, "young_modulus": 1e7, "poisson_ratio": 0.3}},
        "contact": {"rolling": "constant"},
        "pairs": [{"materials": ["glass", "glass"], "restitution": 0.7, "friction": 0.5, "rolling_friction": rolling}],
        "grains": [
            {
                "material": "glass",
                "positions": positions,
                "radii": radii,
                "velocities": np.zeros((n, 3)) if velocities is None else velocities,
                "ids": np.arange(n) if ids is None else ids,
            }
        ],
        "time": {"end": 1, "step": 1e-6, "max_speed": 0.5},
        "engine": {"skin": skin, "max_overlap": 1.0},
    }
    return Simulation(Scene.model_validate(data | changes), device="cpu", threads=threads)


def brute_force(positions, radii, ids) -> set[tuple[int, int]]:
    """Touching pairs (lower id, higher id)."""
    way = positions[:, None] - positions[None]
    touching = np.linalg.norm(way, axis=2) < radii[:, None] + radii[None]
    return {(min(ids[a], ids[b]), max(ids[a], ids[b])) for a, b in np.argwhere(np.triu(touching, 1))}


def cloud(kind: str, rng) -> tuple[np.ndarray, np.ndarray]:
    """Positions [m] and radii [m] with many overlaps, none of them over 0.9 of the smaller radius (a start is checked)."""
    positions, radii = dense_cloud(kind, rng)
    kept: list[int] = []
    for k in range(len(radii)):
        gap = np.linalg.norm(positions[kept] - positions[k], axis=1) - radii[kept] - radii[k]
        if np.all(gap > -0.9 * np.minimum(radii[kept], radii[k])):
            kept.append(k)
    return positions[kept], radii[kept]


def dense_cloud(kind: str, rng) -> tuple[np.ndarray, np.ndarray]:
    match kind:
        case "equal":
            return rng.uniform(0.0, 12e-3, (300, 3)), np.full(300, 1e-3)
        case "size ratio 10":
            radii = np.where(rng.random(900) < 0.05, 5e-3, 0.5e-3)
            return rng.uniform(0.0, 25e-3, (900, 3)), radii
        case "far clusters":
            # the grid has at most 256 cells along an axis: these are 4 000 cells apart, and it wraps around
            centres = rng.integers(-3, 4, (8, 3)) * 3.0
            return (centres[:, None] + rng.uniform(0.0, 5e-3, (8, 30, 3))).reshape(-1, 3), np.full(240, 1e-3)
        case "a line":
            positions = np.zeros((200, 3))
            positions[:, 0] = np.arange(200) * 1.9e-3
            return positions[rng.permutation(200)], np.full(200, 1e-3)


KINDS = ("equal", "size ratio 10", "far clusters", "a line")


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("skin", [0.05e-3, 1e-3])
def test_contacts_are_those_of_brute_force(kind, skin):
    rng = np.random.default_rng(5)
    positions, radii = cloud(kind, rng)
    ids = rng.permutation(len(radii)) * 2 + 1
    sim = simulate(positions, radii, ids=ids, skin=skin)
    contacts = sim.contacts()
    found = list(zip(contacts.i.tolist(), contacts.j.tolist(), strict=True))
    expected = brute_force(positions, radii, ids)
    assert len(expected) > 50
    assert len(found) == len(set(found)), "no pair twice"
    assert set(found) == expected, "i is the lower id"


@pytest.mark.parametrize("threads", [1, 3])
def test_contacts_stay_those_of_brute_force_while_grains_fly(threads):
    """Grains cross many skins; the list must never miss one that comes near."""
    rng = np.random.default_rng(6)
    grid = np.stack(np.meshgrid(*[np.arange(9)] * 3, indexing="ij"), axis=-1).reshape(-1, 3) * 2.3e-3
    n = len(grid)
    assert n > 512, "threads split the list kernels from 512 on"
    radii = rng.uniform(0.5e-3, 1.1e-3, n)
    sim = simulate(grid, radii, velocities=rng.normal(0, 0.4, (n, 3)), skin=0.1e-3, threads=threads)
    for _ in range(8):
        sim.step(250)
        contacts = sim.contacts()
        p = sim.particles
        assert set(zip(contacts.i.tolist(), contacts.j.tolist(), strict=True)) == brute_force(
            p.position, p.radius, p.id
        )
    assert sim.lists.rebuilds > 5


def test_contact_readings_are_the_geometry():
    rng = np.random.default_rng(7)
    positions, radii = cloud("equal", rng)
    contacts = simulate(positions, radii).contacts()
    way = positions[contacts.i] - positions[contacts.j]
    distance = np.linalg.norm(way, axis=1)
    np.testing.assert_allclose(contacts.overlap, radii[contacts.i] + radii[contacts.j] - distance, rtol=1e-12)
    np.testing.assert_allclose(contacts.normal, way / distance[:, None], atol=1e-14)
    np.testing.assert_allclose(contacts.share, contacts.overlap / 1e-3, rtol=1e-12)
    middle = positions[contacts.j] + contacts.normal * (radii[contacts.j] - 0.5 * contacts.overlap)[:, None]
    np.testing.assert_allclose(contacts.point, middle, atol=1e-15)


def test_loads_are_the_sums_of_contact_forces():
    rng = np.random.default_rng(8)
    positions, radii = cloud("size ratio 10", rng)
    sim = simulate(positions, radii)
    contacts, (force, _) = sim.contacts(), sim.loads()
    expected = np.zeros_like(force)
    np.add.at(expected, contacts.i, contacts.force)
    np.add.at(expected, contacts.j, -contacts.force)
    np.testing.assert_allclose(force, expected, atol=1e-12 * np.abs(contacts.force).max())
    assert np.abs(force).max() > 0


def test_history_survives_rebuilds_and_reordering():
    """Springs of a sheared bed, by ids, over a forced rebuild that also puts the grains into another order."""
    rng = np.random.default_rng(9)
    grid = np.stack(np.meshgrid(np.arange(5), np.arange(5), np.arange(4), indexing="ij"), axis=-1).reshape(-1, 3)
    positions = (grid * 1.96e-3)[rng.permutation(100)]
    shear = np.zeros_like(positions)
    shear[:, 0] = 20.0 * positions[:, 2]
    sim = simulate(positions, np.full(100, 1e-3), velocities=shear, ids=rng.permutation(100))
    sim.step(200)

    def springs():
        c = sim.contacts()
        return {(i, j): tuple(s) for i, j, s in zip(c.i.tolist(), c.j.tolist(), c.spring, strict=True)}

    before = springs()
    assert sum(any(s) for s in before.values()) > 100
    order = sim.state.id.numpy().copy()
    # the memory itself, before the next forces move the springs on
    sim.state.reorder(np.arange(100))  # same order, so that only the lists change hands below
    sim.lists.update(force_rebuild=True)
    assert springs() == before
    assert sim.lists.rebuilds >= 2
    assert sorted(order) == sorted(sim.state.id.numpy())


def test_morton_order_is_a_permutation_along_space():
    rng = np.random.default_rng(10)
    points = rng.uniform(-1.0, 1.0, (4096, 3))
    order = morton_order(points, 0.05)
    np.testing.assert_array_equal(np.sort(order), np.arange(4096))

    def mean_step(p):
        return np.linalg.norm(np.diff(p, axis=0), axis=1).mean()

    assert mean_step(points[order]) < 0.3 * mean_step(points)


def test_morton_order_of_a_cube_is_the_z_curve():
    corners = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], dtype=float)
    np.testing.assert_array_equal(morton_order(corners, 1.0), np.arange(8))
    np.testing.assert_array_equal(morton_order(corners[::-1], 1.0), np.arange(8)[::-1])


def test_morton_order_keeps_ties_and_bears_any_extent():
    np.testing.assert_array_equal(morton_order(np.zeros((5, 3)), 1.0), np.arange(5))
    far = np.array([[0.0, 0, 0], [1e9, 0, 0], [1.0, 0, 0]])
    np.testing.assert_array_equal(np.sort(morton_order(far, 1e-3)), np.arange(3))


def test_starts_are_exclusive_sums_with_the_total():
    np.testing.assert_array_equal(starts(np.array([2, 0, 3])), [0, 2, 2, 5])
    np.testing.assert_array_equal(starts(np.zeros(0, dtype=int)), [0])


def test_grains_that_go_with_a_turning_wall_have_not_moved(make_simulation):
    """Where every wall moves, lists look at ways in the walls' axes: a drum costs the same in the laboratory and its frame."""
    turn, r = {"axis": [0, 0, 1], "rate": 30.0}, 1e-3
    places = np.array([[0.01, 0, r], [0.0125, 0, r], [-0.01, 0.002, r]])
    disk = {"name": "disk", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}
    keys = {"radius": r, "friction": 0.5, "tangential": "mindlin", "gravity": [0, 0, -9.81], "step": 1e-5}
    framed = make_simulation(places.tolist(), walls=[disk], frame=turn, **keys)
    laboratory = make_simulation(
        places.tolist(), walls=[{**disk, "motion": turn}], velocities=np.cross([0, 0, 30.0], places).tolist(),
        spins=[[0, 0, 30.0]] * 3, **keys,
    )  # fmt: skip
    for sim in (framed, laboratory):
        sim.step(3_000)
    assert np.linalg.norm(laboratory.particles.position - places, axis=1).min() > 5e-3
    assert np.linalg.norm(framed.particles.position - places, axis=1).max() < 4e-3
    assert laboratory.lists.rebuilds == framed.lists.rebuilds
