"""Grain-wall contacts: one contact per touching place, whatever the triangles, wherever the wall moves."""

import numpy as np
import pytest
import trimesh

from warpdem import Scene, Simulation

RADIUS = 1.0e-3
SIZE = 5.0 / 256.0
"""Edge of the square floors and of the box [m]; its half is exact in the float32 of an STL file."""
WEIGHT = 2500 * 4 / 3 * np.pi * RADIUS**3 * 9.81
DEPTH = (WEIGHT / (4 / 3 * (1e7 / (2 * (1 - 0.3**2))) * np.sqrt(RADIUS))) ** (2 / 3)
"""Overlap at which a grain rests on a floor [m]."""


def square(count: int, pattern: str = "diagonal") -> np.ndarray:
    """Square floor z = 0 of 2 count^2 triangles facing up, shape (t, 3, 3); "skew" shifts the inner corners."""
    x = np.linspace(-0.5, 0.5, count + 1) * SIZE
    grid = np.stack([*np.meshgrid(x, x, indexing="ij"), np.zeros((count + 1, count + 1))], axis=-1)
    if pattern == "skew":
        inner = grid[1:-1, 1:-1, :2]
        inner += np.random.default_rng(3).uniform(-0.3, 0.3, inner.shape) * SIZE / count
    a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
    return np.concatenate([np.stack([a, b, c], 2).reshape(-1, 3, 3), np.stack([a, c, d], 2).reshape(-1, 3, 3)])


def write(folder, triangles, name="wall") -> dict:
    """Mesh wall of these triangles."""
    path = folder / f"{name}.stl"
    trimesh.Trimesh(**trimesh.triangles.to_kwargs(np.asarray(triangles, float))).export(path)
    return {"name": name, "material": "glass", "mesh": str(path), "open": True}


def plane(point=(0, 0, 0), normal=(0, 0, 1), name="floor") -> dict:
    return {"name": name, "material": "glass", "plane": {"point": list(point), "normal": list(normal)}}


def simulate(walls, position, velocity=(0, 0, 0), spin=(0, 0, 0), *, gravity=(0, 0, -9.81), end=1.0, **changes):
    """One or more grains of the law hertz, mindlin, constant rolling: all tests here share its kernels."""
    position = np.atleast_2d(position).astype(float)
    n = len(position)
    data = {
        "gravity": list(gravity),
        "materials": {"glass": {"density": 2500, "young_modulus": 1e7, "poisson_ratio": 0.3}},
        "contact": {"rolling": "constant"},
        "pairs": [{"materials": ["glass", "glass"], "restitution": 0.7, "friction": 0.4, "rolling_friction": 0.02}],
        "grains": [
            {
                "material": "glass",
                "positions": position,
                "radius": RADIUS,
                "velocities": np.broadcast_to(velocity, (n, 3)),
                "spins": np.broadcast_to(spin, (n, 3)),
            }
        ],
        "walls": walls,
        "time": {"end": end, "step": 1e-5, "max_speed": 1.0},
    }
    return Simulation(Scene.model_validate(data | changes), device="cpu", threads=1)


def at_walls(sim):
    """Contacts with walls."""
    contacts = sim.contacts()
    return contacts.j[contacts.j < 0], contacts


def path(sim, steps=1500, every=50) -> np.ndarray:
    """Positions and spins on the way."""
    rows = []
    for _ in range(steps // every):
        sim.step(every)
        rows.append(np.concatenate([sim.particles.position.ravel() / RADIUS, sim.particles.spin.ravel() * 1e-3]))
    return np.array(rows)


MOTIONS = {
    "sliding": ([-4.321e-3, 0.1e-3, RADIUS], [0.6, 0.17, 0.0], [0, 0, 0]),
    "rolling": ([-4.321e-3, 0.1e-3, RADIUS], [0.5, 0.0, 0.0], [0, 500.0, 0]),
    "bouncing": ([-4.321e-3, 0.1e-3, 1.2 * RADIUS], [0.4, -0.2, -0.4], [0, 0, 100.0]),
}


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize(("count", "pattern"), [(1, "diagonal"), (10, "diagonal"), (10, "skew")])
def test_flat_floor_is_one_wall_however_it_is_cut(tmp_path, motion, count, pattern):
    """Equal to the analytic plane to 1e-10 of the radius: no double force on edges, no history lost across them."""
    start = MOTIONS[motion]
    expected = path(simulate([plane()], *start))
    assert np.ptp(expected[:, 0]) > 3.0, "the grain must cross triangles"
    found = path(simulate([write(tmp_path, square(count, pattern))], *start))
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10)


def test_one_contact_on_edges_and_corners_of_a_flat_floor(tmp_path):
    step = SIZE / 10
    spots = np.array([[0.0, 0.0], [0.5, 0.5], [0.5, 0.0], [0.0, 0.5], [0.3, 0.3], [0.2, 0.7], [1e-9, 0.0]]) * step
    apart = np.arange(len(spots))[:, None] * [0.0, 2.0 * step] - [0.0, 7 * step - SIZE / 2 + step]
    centres = np.column_stack([spots + np.round(apart / step) * step, np.full(len(spots), 0.995 * RADIUS)])
    centres = centres[np.abs(centres[:, :2]).max(axis=1) < 0.45 * SIZE]
    assert len(centres) >= 4
    sim = simulate([write(tmp_path, square(10))], centres)
    walls, contacts = at_walls(sim)
    assert len(walls) == len(centres)
    assert set(contacts.i.tolist()) == set(sim.particles.id.tolist())
    np.testing.assert_allclose(contacts.overlap, 0.005 * RADIUS, rtol=1e-6)
    np.testing.assert_allclose(contacts.normal, np.broadcast_to([0, 0, 1], contacts.normal.shape), rtol=0, atol=1e-12)
    np.testing.assert_allclose(contacts.force[:, 2], contacts.force[0, 2], rtol=1e-9)


@pytest.fixture
def box(tmp_path):
    wall = write(tmp_path, trimesh.creation.box((SIZE,) * 3).triangles, "box")
    return wall | {"open": False}


def six_planes() -> list[dict]:
    return [
        plane(point=sign * -0.5 * SIZE * np.eye(3)[axis], normal=sign * np.eye(3)[axis], name=f"side{axis}{sign}")
        for axis in range(3)
        for sign in (1, -1)
    ]


def test_grain_in_a_corner_of_a_box_has_three_contacts(box):
    sim = simulate([box], np.full(3, 0.5 * SIZE - 0.99 * RADIUS))
    walls, contacts = at_walls(sim)
    assert len(walls) == 3
    order = np.argmax(np.abs(contacts.normal), axis=1)
    np.testing.assert_allclose(contacts.normal[np.argsort(order)], -np.eye(3), rtol=0, atol=1e-12)
    np.testing.assert_allclose(contacts.overlap, 0.01 * RADIUS, rtol=1e-10)


def test_mesh_box_equals_six_planes(box):
    """A grain thrown about in a box, corners and edges included."""
    start = ([6.0e-3, 7.0e-3, -6.5e-3], [0.5, 0.45, -0.55], [200, -100, 50])
    limits = {"gravity": (3.0, 4.0, -9.81)}
    by_planes = path(simulate(six_planes(), *start, **limits), 3000)
    by_mesh = path(simulate([box], *start, **limits), 3000)
    np.testing.assert_allclose(by_mesh, by_planes, rtol=0, atol=1e-9)
    assert np.ptp(by_planes[:, :3], axis=0).min() > 1.0


def test_convex_edge_is_one_contact(tmp_path):
    """A grain on the ridge of a roof touches both faces at one place."""
    half = np.array([0.0, 4e-3, 0.0])
    ridge, low = 4e-3, 3e-3
    a, b = -half, half
    left, right = [np.array([side * ridge, 0, -low]) for side in (-1, 1)]
    roof = [
        [a, right - half, right + half],
        [a, right + half, b],
        [a, left + half, left - half],
        [a, b, left + half],
    ]
    sim = simulate([write(tmp_path, roof)], [0.0, 0.3e-3, 0.995 * RADIUS])
    walls, contacts = at_walls(sim)
    assert len(walls) == 1
    np.testing.assert_allclose(contacts.normal, [[0, 0, 1]], rtol=0, atol=1e-12)
    np.testing.assert_allclose(contacts.overlap, 0.005 * RADIUS, rtol=1e-9)


def tube(radius: float, sections: int) -> np.ndarray:
    """Inside of a tube along y, facing its axis, with many thin faces."""
    angle = np.linspace(0.0, 2.0 * np.pi, sections + 1)
    ring = np.stack([radius * np.sin(angle), np.zeros_like(angle), -radius * np.cos(angle)], axis=1)
    y = np.array([0.0, 5e-3, 0.0])
    a, b, c, d = ring[:-1] - y, ring[1:] - y, ring[1:] + y, ring[:-1] + y
    return np.concatenate([np.stack([a, c, b], axis=1), np.stack([a, d, c], axis=1)])


@pytest.mark.parametrize("turn", [0.0, 0.5])
def test_grain_in_a_tessellated_tube_has_one_contact(tmp_path, turn):
    """At rest on the middle of a face or on the edge between two, it touches one place."""
    sections, large = 48, 5e-3
    angle = 2.0 * np.pi / sections * turn
    wall = write(tmp_path, tube(large, sections)) | {"rotate": {"axis": [0, 1, 0], "angle": angle}}
    cosine = np.cos(np.pi / sections)
    depth = large * cosine - RADIUS + DEPTH if turn == 0.5 else large - (RADIUS - DEPTH) / cosine
    sim = simulate([wall], [0.0, 0.1e-3, -depth])
    walls, contacts = at_walls(sim)
    assert len(walls) == 1
    np.testing.assert_allclose(contacts.normal[0], [0, 0, 1], rtol=0, atol=0.08)
    forces = []
    for _ in range(100):
        sim.step(10)
        walls, contacts = at_walls(sim)
        assert len(walls) == 1
        forces.append(contacts.force[0, 2])
    print(forces)
    assert np.mean(forces) == pytest.approx(WEIGHT, rel=0.02)


def test_wedged_grain_has_two_contacts(tmp_path):
    """Between two parallel faces that are one connected smooth piece (a tube hardly wider than it) places stay apart."""
    sections, large = 64, 0.995 * RADIUS
    sim = simulate([write(tmp_path, tube(large, sections))], [0.0, 0.1e-3, 0.0], gravity=(0, 0, 0))
    walls, _ = at_walls(sim)
    assert len(walls) >= 2


@pytest.mark.parametrize("kind", ["plane", "mesh"])
def test_wall_turning_on_its_own_drags_a_grain(tmp_path, kind):
    """A grain that sits on a turntable takes its speed up by friction; on the resting floor it stays."""
    floor = plane() if kind == "plane" else write(tmp_path, square(10))
    start = [4e-3, 0.0, RADIUS - DEPTH]
    rate = 20.0
    still = simulate([floor], start)
    turning = simulate([floor | {"motion": {"axis": [0, 0, 1], "rate": rate}}], start)
    for sim in (still, turning):
        sim.step(200)
    np.testing.assert_allclose(still.particles.velocity[0], 0.0, rtol=0, atol=1e-9)
    # sliding friction alone while the contact slips: mu g t, along the wall's motion (+y at +x)
    velocity = turning.particles.velocity[0]
    assert velocity[1] == pytest.approx(0.4 * 9.81 * 200e-5, rel=0.05)
    assert abs(velocity[0]) < 0.2 * velocity[1]
    contacts = turning.contacts()
    assert contacts.force[0, 1] == pytest.approx(0.4 * WEIGHT, rel=0.01)


def test_grain_rests_on_a_wall_that_turns_with_the_frame_and_slips_on_one_that_does_not(tmp_path):
    """In a frame that turns about z: the frame's floor carries a grain round; the laboratory's floor does not."""
    floor = write(tmp_path, square(10))
    frame = {"axis": [0, 0, 1], "rate": 5.0}
    start = [2e-3, 0.0, 0.999 * RADIUS]
    carried = simulate([floor], start, frame=frame)
    left = simulate([floor | {"fixed_to": "laboratory"}], start, velocity=[0, -0.01, 0], spin=[0, 0, -5.0], frame=frame)
    for sim in (carried, left):
        sim.step(3000)
    assert np.linalg.norm(carried.particles.position[0, :2] - start[:2]) < 0.02 * RADIUS
    np.testing.assert_allclose(left.particles.position_lab[0, :2], start[:2], rtol=0, atol=1e-3 * RADIUS)
    angle = 5.0 * 3000e-5
    expected = 2e-3 * np.array([np.cos(angle), -np.sin(angle)])
    np.testing.assert_allclose(left.particles.position[0, :2], expected, rtol=0, atol=1e-3 * RADIUS)


def test_wall_material_decides_its_coefficients():
    """A rough and a smooth floor side by side."""
    glass = {"density": 2500, "young_modulus": 1e7, "poisson_ratio": 0.3}
    pair = {"restitution": 0.7, "friction": 0.4}
    sim = simulate(
        [plane(normal=(0, 0, 1)) | {"material": "ice"}],
        [0, 0, 0.999 * RADIUS],
        velocity=[0.5, 0, 0],
        materials={"glass": glass, "ice": glass},
        pairs=[
            pair | {"materials": ["glass", "glass"], "rolling_friction": 0.02},
            pair | {"materials": ["glass", "ice"], "friction": 0.1},
        ],
    )
    sim.step(10)
    contacts = sim.contacts()
    across = np.linalg.norm(contacts.force[:, :2], axis=1)
    assert across[0] == pytest.approx(0.1 * contacts.force[0, 2], rel=1e-12)


@pytest.mark.parametrize("kind", ["plane", "mesh"])
def test_spring_stays_with_a_grain_that_rolls_over_triangles(tmp_path, kind):
    """Steady rolling: the friction that slows it, 5/7 mu_r m g, is held by the spring alone, step after step."""
    floor = plane() if kind == "plane" else write(tmp_path, square(10))
    sim = simulate([floor], [-6e-3, 0.1e-3, RADIUS - DEPTH], [0.5, 0.0, 0.0], [0, 500.0, 0])
    sim.step(1500)
    shares = []
    for _ in range(20):
        sim.step(25)
        contacts = sim.contacts()
        across = contacts.force[0] - contacts.normal[0] * (contacts.force[0] @ contacts.normal[0])
        stiffness = sim.coefficients.numpy()[0, 2] * contacts.stiffness[0] * np.sqrt(contacts.overlap[0])
        assert np.linalg.norm(across) < 0.1 * WEIGHT, "sticks, far below the Coulomb limit"
        shares.append([np.linalg.norm(across) / WEIGHT, stiffness * np.linalg.norm(contacts.spring[0]) / WEIGHT])
    friction, held = np.mean(shares, axis=0)
    assert friction == pytest.approx(5.0 / 7.0 * 0.02, rel=0.05)
    assert held == pytest.approx(friction, rel=0.05)
