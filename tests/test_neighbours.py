"""Lists: every contact is found, whatever the sizes and distances, and its memory survives what happens to the lists."""

import numpy as np
import pytest
from warpdem.kernels.lists.numbering import starts

from warpdem import Scene, Simulation
from warpdem.engine import host_build
from warpdem.engine.flights import Flights
from warpdem.engine.host_build import morton_order
from warpdem.filling.size_grids import RowCapacity, finest_cell, size_classes


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
    for k in np.argsort(-radii, kind="stable"):  # large ones first, or none would find a place
        gap = np.linalg.norm(positions[kept] - positions[k], axis=1) - radii[kept] - radii[k]
        if np.all(gap > -0.9 * np.minimum(radii[kept], radii[k])):
            kept.append(k)
    return positions[kept], radii[kept]


def dense_cloud(kind: str, rng) -> tuple[np.ndarray, np.ndarray]:
    match kind:
        case "equal":
            return rng.uniform(0.0, 12e-3, (300, 3)), np.full(300, 1e-3)
        case "size ratio 10":
            radii = np.where(rng.random(2500) < 0.005, 5e-3, 0.5e-3)
            return rng.uniform(0.0, 25e-3, (2500, 3)), radii
        case "continuous 1 to 20":  # rows of hundreds beside rows of none
            radii = 0.15e-3 * 20.0 ** (rng.random(2500) ** 60)
            return rng.uniform(0.0, 7e-3, (2500, 3)), radii
        case "far clusters":
            # the grid has at most 256 cells along an axis: these are 4 000 cells apart, and it wraps around
            centres = rng.integers(-3, 4, (8, 3)) * 3.0
            return (centres[:, None] + rng.uniform(0.0, 5e-3, (8, 30, 3))).reshape(-1, 3), np.full(240, 1e-3)
        case "a line":
            positions = np.zeros((200, 3))
            positions[:, 0] = np.arange(200) * 1.9e-3
            return positions[rng.permutation(200)], np.full(200, 1e-3)


KINDS = ("equal", "size ratio 10", "continuous 1 to 20", "far clusters", "a line")


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


def speeds_of_a_flow(n: int, rng, few: float = 0.05, slow: float = 0.01, fast: float = 0.5) -> np.ndarray:
    """Velocities [m/s] of ``n`` grains, ``few`` of them much faster than the others, shape (n, 3)."""
    return rng.normal(0.0, 1.0, (n, 3)) * np.where(rng.random((n, 1)) < few, fast, slow)


def assert_outer_rows_are_complete(sim: Simulation) -> np.ndarray:
    """Every row against brute force, where the grains were when it was written; return the lengths of the rows."""
    outer = sim.lists.outer
    start, count, slot, allowance = (a.numpy() for a in (outer.start, outer.neighbors, outer.slot, outer.allowance))
    place, radius, ids = sim.lists.outer_reference.numpy()[:, 0], sim.state.record.numpy()[:, 3], sim.state.id.numpy()
    way = place[:, None] - place[None]
    gap = np.sqrt(np.einsum("ijk,ijk->ij", way, way)) - radius[:, None] - radius[None]
    np.fill_diagonal(gap, np.inf)
    for i in range(len(radius)):
        near = np.flatnonzero(gap[i] < allowance[i] + allowance)
        np.testing.assert_array_equal(slot[start[i] : start[i] + count[i]], near[np.argsort(ids[near])])
    return count


def test_outer_rows_are_complete_and_in_order_of_id():
    """Also one of hundreds; the room of the rows goes by the size of their grains."""
    rng = np.random.default_rng(12)
    positions, radii = cloud("continuous 1 to 20", rng)
    n = len(radii)
    sim = simulate(positions, radii, ids=rng.permutation(n), skin=0.3e-3)
    sim.contacts()
    count = assert_outer_rows_are_complete(sim)
    assert count.max() > 100
    assert len(sim.lists.outer.slot) < 0.3 * n * count.max(), "small grains have no room for as many neighbours as large ones"


@pytest.mark.parametrize("threads", [1, 3])
def test_rows_of_fast_grains_are_complete_too(threads, monkeypatch):
    """Grains of sizes 1 to 5 with an allowance each, over lists built in another order and in the same."""
    monkeypatch.setattr(Flights, "_possible", False)
    rng = np.random.default_rng(15)
    radii = 0.11e-3 * 5.0 ** rng.random(700)
    positions = np.stack(np.meshgrid(*[np.arange(9)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)[:700] * 1.2e-3
    sim = simulate(positions, radii, velocities=speeds_of_a_flow(700, rng), skin=0.06e-3, threads=threads)
    for _ in range(5):
        before = sim.lists.rebuilds
        while sim.lists.rebuilds == before:
            sim.step(20)
        assert_outer_rows_are_complete(sim)
        allowance = sim.lists.outer.allowance.numpy()
        assert allowance.min() == 0.03e-3 and 0.02 < np.mean(allowance > 0.03e-3) < 0.12
        assert allowance.max() > 0.1e-3
    contacts, p = sim.contacts(), sim.particles
    found = set(zip(contacts.i.tolist(), contacts.j.tolist(), strict=True))
    assert found == brute_force(p.position, p.radius, p.id)


def test_few_fast_grains_need_few_lists(monkeypatch):
    """At 1 m/s 4 in 100 cross half the skin in 50 steps; they are allowed more."""
    monkeypatch.setattr(Flights, "_possible", False)
    positions = np.stack(np.meshgrid(*[np.arange(8)] * 3, indexing="ij"), axis=-1).reshape(-1, 3) * 2.4e-3
    velocities = np.where(np.arange(512)[:, None] % 25 == 0, [[1.0, 0, 0]], [[0.0, 0, 0]])
    rebuilds, hashes = [], set()
    for fast in (host_build.FAST, 0.0):
        monkeypatch.setattr(host_build, "FAST", fast)
        sim = simulate(positions, np.full(512, 1e-3), velocities=velocities, skin=0.1e-3)
        sim.step(1000)
        rebuilds.append(sim.lists.rebuilds)
        hashes.add(sim.state_hash())
    assert rebuilds[1] > 20 and rebuilds[0] < 6
    assert len(hashes) == 1


def test_broad_sizes_change_no_bit_with_threads_skin_or_order():
    """Large grains fly through small ones: the longest rows are carried over rebuilds, with their springs."""
    rng = np.random.default_rng(13)
    positions, radii = cloud("size ratio 10", rng)
    n = len(radii)
    velocities = rng.normal(0.0, 0.3, (n, 3))
    hashes, rebuilds = set(), set()
    for threads, skin, order in ((1, 0.1e-3, np.arange(n)), (3, 0.3e-3, np.arange(n)), (1, "auto", rng.permutation(n))):
        sim = simulate(
            positions[order], radii[order], velocities=velocities[order], ids=order, skin=skin, threads=threads,
            materials={"glass": {"density": 2500, "young_modulus": 1e5, "poisson_ratio": 0.3}},
        )  # fmt: skip
        sim.step(600)
        hashes.add(sim.state_hash())
        rebuilds.add(sim.lists.rebuilds)
    assert len(hashes) == 1
    assert len(rebuilds) > 1 and max(rebuilds) > 5
    assert np.count_nonzero(np.linalg.norm(sim.contacts().spring, axis=1)) > 200


@pytest.mark.parametrize("skin", [0.05e-3, 1e-3])
def test_broad_sizes_meet_across_periodic_borders(skin):
    rng, side = np.random.default_rng(14), 0.02
    radii = np.where(np.arange(2500) < 12, 2e-3, 0.3e-3)
    positions = rng.uniform(0.0, side, (2500, 3))

    def gaps(points, sizes):
        way = points[:, None] - points[None]
        way -= side * np.round(way / side)
        return np.linalg.norm(way, axis=2) - sizes[:, None] - sizes[None]

    deep = np.triu(gaps(positions, radii) < -0.9 * np.minimum(radii[:, None], radii[None]), 1).any(axis=0)
    positions, radii = positions[~deep], radii[~deep]
    sim = simulate(
        positions, radii, skin=skin, contact={"rolling": "none"},
        pairs=[{"materials": ["glass", "glass"], "restitution": 0.7, "friction": 0.5}],
        borders={axis: {"min": 0.0, "max": side, "kind": "periodic"} for axis in "xyz"},
    )  # fmt: skip
    contacts = sim.contacts()
    expected = {(a, b) for a, b in np.argwhere(np.triu(gaps(positions, radii) < 0.0, 1)).tolist()}
    across = sum(np.abs(positions[a] - positions[b]).max() > 0.5 * side for a, b in expected)
    assert across > 20
    assert sorted(zip(contacts.i.tolist(), contacts.j.tolist(), strict=True)) == sorted(expected)


def test_sizes_are_classed_by_equal_ratios():
    assert not size_classes(np.array([0.3, 0.6, 0.45])).any(), "one grid for sizes within a factor of 2"
    assert not size_classes(np.full(3, 1e-3)).any()
    radii = 1e-3 * 10.0 ** np.linspace(0.0, 1.0, 400)
    classes = size_classes(radii)
    np.testing.assert_array_equal(np.unique(classes), [0, 1, 2])
    for number in range(3):
        assert np.ptp(np.log10(radii[classes == number])) <= 1.0 / 3.0 + 1e-12
    assert classes[-1] == 0 and (np.diff(classes) <= 0).all()


def test_cells_are_as_wide_as_the_smallest_grains_reach():
    """Of that width is what is kept together in memory too."""
    radii = np.array([0.1, 0.12, 1.0, 0.5])
    np.testing.assert_allclose(finest_cell(radii, size_classes(radii), 0.02), 0.26)


def test_room_of_rows_grows_by_class():
    room, classes = RowCapacity(12), np.array([1, 0, 1])
    np.testing.assert_array_equal(room.starts(classes), [0, 12, 24, 36])
    assert not room.holds(classes, np.array([5, 400, 9]))
    np.testing.assert_array_equal(room.starts(classes), [0, 12, 12 + 450, 24 + 450])
    assert room.holds(classes, np.array([12, 450, 0]))


def test_contact_readings_are_the_geometry():
    rng = np.random.default_rng(7)
    positions, radii = cloud("equal", rng)
    contacts = simulate(positions, radii).contacts()
    way = positions[contacts.i] - positions[contacts.j]
    distance = np.linalg.norm(way, axis=1)
    np.testing.assert_allclose(contacts.overlap, radii[contacts.i] + radii[contacts.j] - distance, rtol=1e-12)
    np.testing.assert_allclose(contacts.normal, way / distance[:, None], rtol=0, atol=1e-14)
    np.testing.assert_allclose(contacts.share, contacts.overlap / 1e-3, rtol=1e-12)
    middle = positions[contacts.j] + contacts.normal * (radii[contacts.j] - 0.5 * contacts.overlap)[:, None]
    np.testing.assert_allclose(contacts.point, middle, rtol=0, atol=1e-15)


def test_loads_are_the_sums_of_contact_forces():
    rng = np.random.default_rng(8)
    positions, radii = cloud("size ratio 10", rng)
    sim = simulate(positions, radii)
    contacts, (force, _) = sim.contacts(), sim.loads()
    expected = np.zeros_like(force)
    np.add.at(expected, contacts.i, contacts.force)
    np.add.at(expected, contacts.j, -contacts.force)
    np.testing.assert_allclose(force, expected, rtol=0, atol=1e-12 * np.abs(contacts.force).max())
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


def test_force_and_damping_of_unequal_grains_are_those_of_their_reduced_radius_and_mass_and_materials():
    """Three pairs of two materials, pressed, parting and spinning: the forces of each pair's own K, C and k_t."""
    soft, hard = 1e7, 4e7
    materials = {n: {"density": 2500, "young_modulus": e, "poisson_ratio": 0.3} for n, e in (("soft", soft), ("hard", hard))}
    restitution = {("soft", "soft"): 0.9, ("soft", "hard"): 0.5, ("hard", "hard"): 0.2}
    law = {"friction": 100.0, "rolling_friction": 0.1}
    large, small, depth, speed, spins = 1e-3, 0.4e-3, 2e-5, 0.01, (30.0, 10.0)
    places = np.array([[0.0, 0, 0], [1.0, 0, 0], [2.0, 0, 0]]) * 0.01
    beside = places + np.array([0, large + small - depth, 0])
    grains = [
        {"material": m, "positions": p, "radius": r, "velocities": [[0, v, 0]] * len(p), "spins": [[0, 0, w]] * len(p)}
        for m, p, r, v, w in (("soft", places[:2], large, 0.0, spins[0]), ("hard", places[2:], large, 0.0, spins[0]),
                              ("soft", beside[:1], small, speed, spins[1]), ("hard", beside[1:], small, speed, spins[1]))
    ]  # fmt: skip
    pairs = [{"materials": list(names), "restitution": e, **law} for names, e in restitution.items()]
    sim = simulate([], [], materials=materials, pairs=pairs, grains=grains)
    contacts, dt = sim.contacts(), sim.dt
    assert contacts.i.tolist() == [0, 1, 2]
    radius = large * small / (large + small)
    mass = 2500 * 4 / 3 * np.pi / (large**-3 + small**-3)
    for force, (a, b), e in zip(contacts.force, ((soft, soft), (soft, hard), (hard, hard)), restitution.values(), strict=True):
        stiffness = 4 / 3 / ((1 - 0.3**2) * (1 / a + 1 / b)) * np.sqrt(radius)
        damping = -np.log(e) / np.hypot(np.log(e), np.pi) * np.sqrt(5 * mass * stiffness)
        # grain j at +y parts from i: what pushes i is the spring less the dashpot, as it acts at this time step
        dashpot = damping * depth**0.25
        acting = dashpot / max(1 + 1.5 * stiffness * depth**0.5 * dt**2 / (2 * mass), dashpot * dt / (0.3 * mass))
        normal = stiffness * depth**1.5 - acting * speed
        # no spring yet: the tangential dashpot alone, 2 sqrt(5/6) |beta| sqrt(k_t m*) with k_t = 8 G* sqrt(R* d)
        k_t = 8 / (2 * (2 - 0.3) * (1 + 0.3) * (1 / a + 1 / b)) * np.sqrt(radius * depth)
        dashpot = 2 * np.sqrt(5 / 6 * k_t * mass) * -np.log(e) / np.hypot(np.log(e), np.pi)
        rolling = 2 / 7 * mass
        acting = dashpot / max(1 + k_t * dt**2 / (2 * rolling), dashpot * dt / (0.25 * rolling))
        slipping = spins[0] * (large - 0.5 * depth) + spins[1] * (small - 0.5 * depth)
        np.testing.assert_allclose(force, [acting * slipping, -normal, 0], rtol=1e-10, atol=1e-12 * abs(normal))


def test_rolling_stops_two_unequal_grains_against_each_other():
    """The largest torque stops the relative spin in one step: it needs the reduced moment of inertia."""
    pair = {"materials": ["glass", "glass"], "restitution": 0.7, "friction": 0.0, "rolling_friction": 0.5}
    grains = {"material": "glass", "positions": [[0, 0, 0], [0, 0, 1.39e-3]], "radii": [1e-3, 0.4e-3],
              "spins": [[1e-3, 0, 0], [-2e-3, 3e-3, 0]]}  # fmt: skip
    sim = simulate([], [], contact={"tangential": "none", "rolling": "constant"}, pairs=[pair], grains=[grains])
    turning = sim.particles.inertia @ sim.particles.spin
    sim.step(3)  # the first kick is half of one
    spin = sim.particles.spin
    np.testing.assert_allclose(spin[0], spin[1], rtol=0, atol=1e-15)
    np.testing.assert_allclose(sim.particles.inertia @ spin, turning, rtol=1e-12)


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


def test_grains_that_go_with_a_turning_wall_have_not_moved(make_simulation, monkeypatch):
    """Where every wall moves, lists look at ways in the walls' axes: a drum costs the same in the laboratory and its frame."""
    monkeypatch.setattr(Flights, "_possible", False)  # no path is laid in the laboratory
    turn, r = {"axis": [0, 0, 1], "rate": 30.0}, 1e-3
    places = np.array([[0.01, 0, r], [0.0125, 0, r], [-0.01, 0.002, r]])
    disk = {"name": "disk", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}
    keys = {"radius": r, "friction": 0.5, "tangential": "mindlin", "gravity": [0, 0, -9.81], "step": 1e-5}
    framed = make_simulation(places.tolist(), walls=[disk], frame=turn, **keys)
    laboratory = make_simulation(
        places.tolist(), walls=[{**disk, "motion": turn}], velocities=np.cross([0, 0, 30.0], places).tolist(),
        spins=[[0, 0, 30.0]] * 3, **keys,
    )  # fmt: skip
    framed.lists.flights.take = lambda stray, hasty: (stray, np.zeros(0, dtype=int))  # where all walls move nobody flies
    for sim in (framed, laboratory):
        sim.step(3_000)
    assert np.linalg.norm(laboratory.particles.position - places, axis=1).min() > 5e-3
    assert np.linalg.norm(framed.particles.position - places, axis=1).max() < 4e-3
    assert laboratory.lists.rebuilds == framed.lists.rebuilds


def test_a_grain_that_goes_with_a_fast_wall_needs_no_new_lists(make_simulation):
    """Its way in the wall's axes is taken at one instant: a step's way of the wall is five times the skin."""
    floor = {"name": "belt", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}, "motion": {"velocity": [5.0, 0, 0]}}
    sim = make_simulation(
        [[0, 0, 1.2e-3]], radius=1e-3, velocities=[[5.0, 0, 0]], walls=[floor], step=1e-5, engine={"skin": 1e-5}
    )
    sim.lists.flights.take = lambda stray, hasty: (stray, np.zeros(0, dtype=int))  # a path of its own would need no lists
    sim.step(1)
    update, asked = sim.lists.update, []
    sim.lists.update = lambda **keys: (asked.append(1), update(**keys))
    sim.step(100)
    assert max(sim.lists.rebuilds, sim.lists.inner_rebuilds, len(asked)) < 10
