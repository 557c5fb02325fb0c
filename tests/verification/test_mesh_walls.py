"""A wall is its surface, however it is cut into triangles: motions on meshes against the same on analytic walls."""

import numpy as np
import pytest
import trimesh

from warpdem import Scene, Simulation

RADIUS = 1.0e-3
MASS = 2500 * 4 / 3 * np.pi * RADIUS**3
WEIGHT = MASS * 9.81
STIFFNESS = 4 / 3 * (1e7 / (2 * (1 - 0.3**2))) * np.sqrt(RADIUS)
DEPTH = (WEIGHT / STIFFNESS) ** (2 / 3)
"""Overlap at which a grain rests on a floor [m]."""
SIZE = 5.0 / 256.0
"""Edge of the floors [m]; its half is exact in the float32 of an STL file."""


def simulate(walls, position, velocity=(0, 0, 0), spin=(0, 0, 0), *, gravity=(0, 0, -9.81), radius=RADIUS, **pair):
    """Grains of one law with both springs: all tests here share its kernels."""
    position = np.atleast_2d(position).astype(float)
    n = len(position)
    coefficients = {"restitution": 0.7, "friction": 0.4, "rolling_friction": 0.02} | pair
    scene = {
        "gravity": list(gravity),
        "materials": {"glass": {"density": 2500, "young_modulus": 1e7, "poisson_ratio": 0.3}},
        "contact": {"rolling": "spring"},
        "pairs": [{"materials": ["glass", "glass"], **coefficients}],
        "grains": [
            {
                "material": "glass",
                "positions": position,
                "radius": radius,
                "velocities": np.broadcast_to(velocity, (n, 3)),
                "spins": np.broadcast_to(spin, (n, 3)),
            }
        ],
        "walls": [{"material": "glass", **wall} for wall in walls],
        "time": {"end": 1.0, "step": 1e-5, "max_speed": 1.0},
    }
    return Simulation(Scene.model_validate(scene), device="cpu", threads=1)


def path(sim, steps, every=50):
    """Position in radii, spin in 1e3 rad/s and the sum of the springs in radii on the way: nine columns per grain."""
    rows = []
    for _ in range(steps // every):
        sim.step(every)
        particles, contacts = sim.particles, sim.contacts()
        assert (contacts.j < 0).all(), "grains meet"
        spring = np.zeros_like(particles.position)
        np.add.at(spring, contacts.i, contacts.spring)
        rows.append(np.concatenate([particles.position, 1e-6 * particles.spin, spring], axis=1).ravel() / RADIUS)
    return np.array(rows)


def write(folder, triangles, name="wall", **keys) -> dict:
    """Mesh wall of these triangles, shape (t, 3, 3); PLY keeps 17 digits of a text and thus float64."""
    triangles = np.asarray(triangles, float)
    path = folder / f"{name}.ply"
    lines = ["ply", "format ascii 1.0", f"element vertex {3 * len(triangles)}", *(f"property double {x}" for x in "xyz")]
    lines += [f"element face {len(triangles)}", "property list uchar int vertex_indices", "end_header"]
    lines += [" ".join(repr(float(x)) for x in corner) for corner in triangles.reshape(-1, 3)]
    lines += [f"3 {3 * k} {3 * k + 1} {3 * k + 2}" for k in range(len(triangles))]
    path.write_text("\n".join(lines) + "\n")
    return {"name": name, "mesh": str(path), "open": True} | keys


def plane(point=(0, 0, 0), normal=(0, 0, 1), name="floor") -> dict:
    return {"name": name, "plane": {"point": list(point), "normal": list(normal)}}


def patch(count, pattern="regular", origin=(0, 0, 0), u=(1, 0, 0), v=(0, 1, 0), size=(SIZE, SIZE)):
    """Flat rectangle of 2 count^2 triangles about ``origin``, edges along u and v.

    Patterns: "regular"; "skew" shifts the inner corners; "needles" crowds them into strips down to 1:1000.
    """
    x, y = (np.linspace(-0.5, 0.5, count + 1) for _ in range(2))
    if pattern == "needles":
        x = np.sign(x) * 0.5 * np.abs(2 * x) ** 4
    grid = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
    if pattern == "skew":
        inner = grid[1:-1, 1:-1]
        inner += np.random.default_rng(3).uniform(-0.3, 0.3, inner.shape) / count
    a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
    flat = np.concatenate([np.stack([a, b, c], 2).reshape(-1, 3, 2), np.stack([a, c, d], 2).reshape(-1, 3, 2)])
    return np.array(origin) + flat[..., :1] * size[0] * np.array(u) + flat[..., 1:] * size[1] * np.array(v)


FLOORS = [(1, "regular"), (10, "regular"), (100, "regular"), (10, "skew"), (100, "skew"), (100, "needles")]
MOTIONS = {
    "sliding": ([-4.321e-3, -7.0e-3, RADIUS], [0.6, 0.17, 0.0], [0, 0, 0]),
    "rolling": ([-4.321e-3, -2.4e-3, RADIUS], [0.5, 0.0, 0.0], [0, 500.0, 0]),
    "bouncing": ([-4.321e-3, 7.1e-3, 1.2 * RADIUS], [0.4, -0.2, -0.4], [0, 0, 100.0]),
    "resting": ([0.0, 1.0e-3, RADIUS - 0.9 * DEPTH], [0, 0, 0], [0, 0, 0]),
}
"""Side by side on a floor, where they do not meet."""


def motions(wall) -> dict[str, np.ndarray]:
    """Path of each of MOTIONS on ``wall``."""
    found = path(simulate([wall], *zip(*MOTIONS.values(), strict=True)), 1500)
    return dict(zip(MOTIONS, np.split(found, len(MOTIONS), axis=1), strict=True))


@pytest.fixture(scope="module")
def on_plane():
    """Motions on the analytic plane."""
    return motions(plane())


@pytest.mark.parametrize(("count", "pattern"), FLOORS)
def test_a_floor_of_many_triangles_is_the_plane(tmp_path, on_plane, count, pattern):
    """Position, spin and spring equal to 1e-10 of the radius."""
    for motion, found in motions(write(tmp_path, patch(count, pattern))).items():
        np.testing.assert_allclose(found, on_plane[motion], rtol=0, atol=1e-10, err_msg=motion)


def groove(slope, count, pattern="regular"):
    """Two slopes that meet in the line x = z = 0 at ``slope`` [rad] from the level."""
    c, s = np.cos(slope), np.sin(slope)
    sides = [
        patch(count, pattern, origin=(sign * 0.5 * SIZE * c, 0, 0.5 * SIZE * s), u=(c, 0, sign * s), v=(0, sign, 0))
        for sign in (1.0, -1.0)
    ]
    planes = [plane(normal=(-sign * s, 0, c), name=f"side{k}") for k, sign in enumerate((1, -1))]
    return np.concatenate(sides), planes


@pytest.mark.parametrize("slope", [25.0, 45.0])
@pytest.mark.parametrize(("count", "pattern"), [(1, "regular"), (10, "regular"), (10, "skew")])
def test_a_groove_of_triangles_is_two_planes(tmp_path, slope, count, pattern):
    """A grain falls in askew, bounces from side to side and rolls along; in the shallow one the places are close."""
    triangles, planes = groove(np.radians(slope), count, pattern)
    start = [[1.1e-3, -4e-3, 2.5e-3], [0.0, 0.4, -0.1], [50.0, 0.0, 30.0]]
    found = path(simulate([write(tmp_path, triangles)], *start), 2000)
    expected = path(simulate(planes, *start), 2000)
    assert np.ptp(expected[:, 1]) > 3.0
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10)


@pytest.mark.parametrize(("count", "pattern"), [(1, "regular"), (10, "skew")])
def test_a_corner_of_triangles_is_three_planes(tmp_path, count, pattern):
    half, axes = 0.5 * SIZE, np.eye(3)
    sides = [
        patch(count, pattern, origin=half * (axes[k - 2] + axes[k - 1]), u=axes[k - 2], v=axes[k - 1]) for k in range(3)
    ]
    start = [[1.3e-3, 1.4e-3, 1.2e-3], [-0.1, -0.15, -0.1], [50.0, 0.0, 30.0]]
    keys = {"gravity": (-8.0, -9.0, -9.81), "restitution": 0.2}
    found = path(simulate([write(tmp_path, np.concatenate(sides))], *start, **keys), 3000)
    expected = path(simulate([plane(normal=n, name=f"side{k}") for k, n in enumerate(axes)], *start, **keys), 3000)
    assert (expected[:, :3].min(axis=0) < 1.0).all(), "it must touch all three"
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10)


@pytest.mark.parametrize("turn", [30.5, 60.0, 90.0])
def test_a_grain_rolls_off_a_convex_edge_however_the_faces_are_cut(tmp_path, turn):
    """From the level over the edge at x = 0, where the far face falls by ``turn`` [degree], and on down."""
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    paths = []
    for count, pattern in ((1, "regular"), (10, "regular"), (10, "skew")):
        level = patch(count, pattern, origin=(-0.5 * SIZE, 0, 0))
        down = patch(count, pattern, origin=(0.5 * SIZE * c, 0, -0.5 * SIZE * s), u=(c, 0, -s))
        wall = write(tmp_path, np.concatenate([level, down]), f"{count}{pattern}")
        paths.append(path(simulate([wall], [-1e-3, 0.1e-3, RADIUS - DEPTH], [0.05, 0.01, 0], [-10.0, 50.0, 0]), 4000))
    assert paths[0][-1, 0] > 0.5 and paths[0][-1, 2] < 0.9
    for found in paths[1:]:
        np.testing.assert_allclose(found, paths[0], rtol=0, atol=1e-10)


def test_seams_of_parts_that_share_no_corners_are_not_felt(tmp_path, on_plane):
    """Strips cut differently: corners lie in the middle of the neighbours' edges, only their place joins them."""
    counts = (3, 5, 2, 7, 4, 3, 5, 6, 3, 4)
    width = SIZE / len(counts)
    strips = [
        patch(n, origin=((k + 0.5) * width - 0.5 * SIZE, 0, 0), size=(width, SIZE)) for k, n in enumerate(counts)
    ]
    for motion, found in motions(write(tmp_path, np.concatenate(strips))).items():
        np.testing.assert_allclose(found, on_plane[motion], rtol=0, atol=1e-10, err_msg=motion)


def tube(radius, sections, half_length=5e-3, phase=0.0):
    """Inside of a tube along y, facing its axis, corners on the cylinder."""
    angle = 2.0 * np.pi * (np.arange(sections + 1) + phase) / sections
    ring = radius * np.stack([np.sin(angle), np.zeros_like(angle), -np.cos(angle)], axis=1)
    y = np.array([0.0, half_length, 0.0])
    a, b, c, d = ring[:-1] - y, ring[1:] - y, ring[1:] + y, ring[:-1] + y
    return np.concatenate([np.stack([a, c, b], axis=1), np.stack([a, d, c], axis=1)])


def cylinder(radius, **keys) -> dict:
    """The same along y without end."""
    return {"name": "tube", "cylinder": {"point": [0, 0, 0], "axis": [0, 1, 0], "radius": radius, **keys}}


@pytest.mark.parametrize("away", [0.0, 0.5])
@pytest.mark.parametrize(("count", "pattern"), [(1, "regular"), (10, "skew"), (100, "regular"), (100, "skew")])
def test_a_tilted_floor_from_a_float32_file_is_off_by_the_rounding_of_its_corners(tmp_path, count, pattern, away):
    """A grain bounces and rolls down: no edge is felt, only that the fitted plane lies and leans a rounding off.

    Half a metre away from the origin of the file, the rounding of a corner is 3e-5 of the radius.
    """
    axis, angle, origin = np.array([0.6, 0.8, 0.0]), 0.3, away * np.array([0.5, 0.7, -0.5])
    turn = trimesh.transformations.rotation_matrix(angle, axis)[:3, :3]
    file = tmp_path / "floor.stl"
    trimesh.Trimesh(**trimesh.triangles.to_kwargs(patch(count, pattern) @ turn.T + origin)).export(file)
    wall = {"name": "floor", "mesh": str(file), "open": True, "translate": (-origin).tolist()}
    start = [turn @ [-2e-3, 2e-3, 1.1 * RADIUS], turn @ [0.1, 0.0, -0.1], [0, 0, 0]]
    expected = path(simulate([plane(normal=turn @ [0, 0, 1])], *start), 2000)
    assert np.ptp(expected[:, :3], axis=0).max() > 1.0
    found = path(simulate([wall], *start), 2000)
    difference = np.abs(found - expected).max()
    rounding = 2.0**-25 * max(SIZE, away)
    print(f"{count} {pattern} {away} m away: {difference:.1e} of the radius, rounding {rounding / RADIUS:.1e}")
    assert 1e-12 < difference < 2.0 * rounding / RADIUS


def test_the_rounding_of_a_sharp_edge_does_not_make_two_contacts_of_one(tmp_path):
    """Grains over a convex edge of 60 degrees from a float32 file, where plane and edge differ by 3e-5 of the radius."""
    turn = trimesh.transformations.rotation_matrix(0.3, [0.6, 0.8, 0.0])[:3, :3]
    origin, c, s = 0.5 * np.array([0.5, 0.7, -0.5]), 0.5, np.sqrt(0.75)
    level = patch(10, "skew", origin=(-0.5 * SIZE, 0, 0))
    down = patch(10, "skew", origin=(0.5 * SIZE * c, 0, -0.5 * SIZE * s), u=(c, 0, -s))
    file = tmp_path / "roof.stl"
    trimesh.Trimesh(**trimesh.triangles.to_kwargs(np.concatenate([level, down]) @ turn.T + origin)).export(file)
    wall = {"name": "roof", "mesh": str(file), "open": True, "translate": (-origin).tolist()}
    for shift in np.linspace(-0.03, 0.01, 81) * RADIUS:
        sim = simulate([wall], turn @ [shift, 0.3e-3, 0.999 * RADIUS])
        contacts = sim.contacts()
        assert len(contacts.i) == 1, shift / RADIUS
        assert contacts.overlap[0] == pytest.approx(1e-3 * RADIUS - 0.5 * max(shift, 0) ** 2 / RADIUS, abs=1e-4 * RADIUS)


@pytest.mark.parametrize("side", [-1, 1])
def test_a_contact_on_two_facets_of_a_smooth_valley_has_the_depth_of_the_deeper_one(tmp_path, side):
    """A grain 2 um deep in one facet and 1 um in the other, 5 degrees from it: one contact, whichever facet comes first."""
    tilt, length = np.radians(2.5), 4e-3
    corners = [[[x, -length, abs(x) * np.tan(tilt)], [x, length, abs(x) * np.tan(tilt)]] for x in (-length, 0.0, length)]
    (a, b), (c, d), (e, f) = corners
    valley = np.array([[a, c, d], [a, d, b], [c, e, f], [c, f, d]])
    depths = 2e-6, 1e-6
    # both distances from the planes (side sin, 0, cos) through the edge
    x = side * 0.5 * (depths[1] - depths[0]) / np.sin(tilt)
    z = (RADIUS - 0.5 * sum(depths)) / np.cos(tilt)
    contacts = simulate([write(tmp_path, valley)], [x, 0.3e-3, z]).contacts()
    assert len(contacts.i) == 1
    assert contacts.overlap[0] == pytest.approx(depths[0], rel=1e-6)


def test_the_error_of_a_tessellated_cylinder_falls_with_the_square_of_its_edges(tmp_path):
    """A grain rolls down inside a tube and up the other side."""
    large = 5 * RADIUS
    down = (large - RADIUS + DEPTH) * np.array([np.sin(0.8), 0.0, -np.cos(0.8)]) - [0, 2e-3, 0]
    fast = -0.2 * np.array([np.cos(0.8), 0.0, np.sin(0.8)])
    start, keys = [down, fast, [0, 0, 0]], {"rolling_friction": 0.0}
    expected = path(simulate([cylinder(large)], *start, **keys), 2500)
    assert np.ptp(expected[:, 0]) > 4.0
    sections = np.array([64, 128, 256, 512, 1024])
    errors = []
    for n in sections:
        found = path(simulate([write(tmp_path, tube(large, n, phase=0.3), f"tube{n}")], *start, **keys), 2500)
        errors.append(np.abs(found - expected)[:, :6].max())
    slope = -np.polyfit(np.log(sections), np.log(errors), 1)[0]
    print("errors in radii", errors, "order", slope)
    assert slope > 1.8
    assert errors[-1] < 2e-4


def fillet(radius, sections):
    """Wall x = 0 and floor z = 0 joined by an arc."""
    angle = np.linspace(np.pi, 1.5 * np.pi, sections + 1)
    arc = radius * np.stack([1.0 + np.cos(angle), 1.0 + np.sin(angle)], axis=1)
    profile = np.concatenate([[[0.0, 4e-3]], arc, [[4e-3, 0.0]]])
    line = np.stack([profile[:, 0], np.zeros(len(profile)), profile[:, 1]], axis=1)
    y = np.array([0.0, 5e-3, 0.0])
    a, b, c, d = line[:-1] - y, line[1:] - y, line[1:] + y, line[:-1] + y
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


def funnel(half_angle, sections, height=8e-3):
    """Cone that opens upwards from its apex at the origin."""
    angle = 2.0 * np.pi * (np.arange(sections + 1) + 0.1) / sections
    rim = height * np.stack([np.tan(half_angle) * np.cos(angle), np.tan(half_angle) * np.sin(angle), 1 + 0 * angle], axis=1)
    return np.stack([np.zeros((sections, 3)), rim[1:], rim[:-1]], axis=1)


def settled(sim, steps):
    """Speed [m/s], force of the walls over the weight, and position in radii after ``steps``."""
    sim.step(steps)
    speed = np.abs(np.concatenate([sim.particles.velocity[0], RADIUS * sim.particles.spin[0]])).max()
    return speed, sim.contacts().force.sum(axis=0) / WEIGHT, sim.particles.position[0] / RADIUS


@pytest.mark.parametrize(("sections", "phase"), [(64, 0.0), (63, 0.3)])
@pytest.mark.parametrize("gravity", [(0, 0, 0), (0, -9.81, 0), (0, -9.81, -9.81)])
def test_a_grain_wedged_in_a_tube_narrower_than_itself_is_held(tmp_path, sections, phase, gravity):
    """By 0.5 %: it comes to rest, on the axis within a few percent of the overlap, and friction carries it along the axis."""
    wall = write(tmp_path, tube(0.995 * RADIUS, sections, phase=phase))
    sim = simulate([wall], [0.2e-3 * RADIUS, 0.0, 0.1e-3 * RADIUS], gravity=gravity)
    speed, force, place = settled(sim, 2000)
    assert speed < 1e-9
    np.testing.assert_allclose(force, -np.array(gravity) / 9.81, rtol=0, atol=1e-6)
    assert np.hypot(place[0], place[2]) < 0.05 * 0.005, "symmetric"
    assert abs(place[1]) < 1e-4, "does not creep"
    settled(sim, 2000)
    np.testing.assert_allclose(sim.particles.position[0] / RADIUS, place, rtol=0, atol=1e-12)


@pytest.mark.parametrize("sections", [15, 16])
@pytest.mark.parametrize("radius", [0.5, 0.995, 1.0, 2.0])
def test_a_grain_in_a_fillet_lies_still_in_the_middle(tmp_path, radius, sections):
    """Narrower than the grain (two places), of its radius (the whole arc) and wider (one place)."""
    lean = np.sqrt(0.5)
    middle = (max(radius, 1.0) - 0.7 * max(radius - 1.0, 0.0)) * RADIUS
    wall = write(tmp_path, fillet(radius * RADIUS, sections))
    sim = simulate([wall], [middle, 0, middle], gravity=(-9.81 * lean, 0, -9.81 * lean))
    speed, force, place = settled(sim, 4000)
    assert speed < 1e-9
    np.testing.assert_allclose(force, [lean, 0, lean], rtol=0, atol=1e-6)
    assert place[0] == pytest.approx(place[2], abs=1e-6)


@pytest.mark.parametrize("sections", [47, 48])
@pytest.mark.parametrize("half_angle", [30.0, 60.0])
def test_a_grain_dropped_into_a_cone_seats_itself(tmp_path, half_angle, sections):
    """Off the axis at first: it comes to rest on the axis, touching all around."""
    half_angle = np.radians(half_angle)
    wall = write(tmp_path, funnel(half_angle, sections))
    sim = simulate([wall], [0.01e-3, 0.02e-3, RADIUS / np.sin(half_angle) + 0.05e-3])
    speed, force, place = settled(sim, 12000)
    assert speed < 1e-7
    np.testing.assert_allclose(force, [0, 0, 1], rtol=0, atol=1e-5)
    assert np.hypot(place[0], place[1]) < 1e-5
    assert place[2] == pytest.approx(1.0 / np.sin(half_angle), abs=4e-3)
    assert len(sim.contacts().i) == sections


def test_a_grain_rests_in_the_valley_between_two_facets(tmp_path):
    """A coarse tube, 13 facets: the direction turns from facet to facet with the depths, so there is a place to rest."""
    sim = simulate([write(tmp_path, tube(5 * RADIUS, 13))], [0.0, 0.0, -3.9705 * RADIUS], restitution=0.2)
    speed, force, place = settled(sim, 20000)
    assert speed < 1e-7
    np.testing.assert_allclose(force, [0, 0, 1], rtol=0, atol=1e-5)
    assert len(sim.contacts().i) == 1
    assert abs(place[0]) < 1e-4
    # the place carries the mean of F n_1 and F n_2: F cos(pi/13)
    assert sim.contacts().overlap[0] == pytest.approx(DEPTH * np.cos(np.pi / 13) ** (-2 / 3), rel=1e-3)


@pytest.mark.parametrize("lean", [0.0, 1e-5, 1e-3])
@pytest.mark.parametrize("thickness", [0.0, 1e-3, 0.5])
def test_a_plate_is_felt_on_its_near_side_only(tmp_path, on_plane, thickness, lean):
    """Thinner than the overlap, both faces are within reach, but one hides the other; also where the plate is a wedge."""
    top = patch(10, "skew")
    bottom = patch(7, "skew", origin=(0, 0, -thickness * DEPTH - 0.5 * lean * SIZE), u=(1, 0, lean))[:, ::-1]
    found = path(simulate([write(tmp_path, np.concatenate([top, bottom]))], *MOTIONS["rolling"]), 1500)
    np.testing.assert_allclose(found, on_plane["rolling"], rtol=0, atol=1e-10)


def test_a_thin_sheet_holds_from_both_sides(tmp_path):
    wall = write(tmp_path, patch(10, "skew"))
    above = path(simulate([wall], [0, 0, 1.2 * RADIUS], [0.1, 0, 0]), 1000)
    below = path(simulate([wall], [0, 0, -1.2 * RADIUS], [0.1, 0, 0], gravity=(0, 0, 9.81)), 1000)
    mirror = [1, 1, -1, -1, -1, 1, 1, 1, -1]
    np.testing.assert_allclose(below * mirror, above, rtol=0, atol=1e-12)


def test_a_grain_keeps_its_spring_when_another_part_of_the_wall_is_met(tmp_path):
    """Sliding down one side of a shallow groove until it meets the other: the spring of the first place stays with it."""
    slope = np.radians(20.0)
    triangles, planes = groove(slope, 1)
    normal = np.array([-np.sin(slope), 0.0, np.cos(slope)])
    start = [normal * (RADIUS - DEPTH) + 1.3e-3 * np.array([np.cos(slope), 0.0, np.sin(slope)]), [-0.1, 0.05, 0], [0, 0, 0]]
    for order in (triangles, triangles[::-1]):
        found = path(simulate([write(tmp_path, order)], *start, restitution=0.1), 1000, every=10)
        expected = path(simulate(planes, *start, restitution=0.1), 1000, every=10)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10)
