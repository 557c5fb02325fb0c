"""Fillings keep clear of all walls and find the space that is meant: around blades, in cavities, cups and open hoppers."""

import numpy as np
import pytest
import trimesh

from warpdem import Scene, SceneError
from warpdem.filling.fill_request import HEIGHT_FRACTION
from warpdem.filling.initial_grains import load_grains
from warpdem.filling.open_space import find_open_space
from warpdem.filling.packing_neighbors import worst_overlaps
from warpdem.filling.packing_run import OVERLAP
from warpdem.filling.placed_walls import PlacedWall, assign_sides, place_walls, wall_poses_at_start
from warpdem.filling.start_check import check_start
from warpdem.mesh.triangle_mesh import build_mesh, signed_distance
from warpdem.model.walls import load_meshes

D = 3e-3
GRAIN = np.pi / 6.0 * D**3


def box(low, high, inwards=False):
    """Triangles of a box, shape (12, 3, 3)."""
    corners = np.array(trimesh.creation.box((1, 1, 1)).triangles) + 0.5
    triangles = np.array(low) + corners * (np.array(high) - np.array(low))
    return triangles[:, ::-1] if inwards else triangles


def lathe(profile, facets=48):
    """Triangles of a surface of revolution about z, of points (radius, height) in turn."""
    angle = 2.0 * np.pi * np.arange(facets) / facets
    rings = [[np.array([r * np.cos(a), r * np.sin(a), z]) for a in angle] for r, z in profile]
    found = []
    for (r, _), (s, _), one, two in zip(profile[:-1], profile[1:], rings[:-1], rings[1:], strict=True):
        for k in range(facets):
            n = (k + 1) % facets
            found += [[one[k], one[n], two[n]]] if r else []
            found += [[one[k], two[n], two[k]]] if s else []
    return np.array(found)


def disk(radius, facets=48):
    """Area of a regular polygon with corners on a circle."""
    return 0.5 * facets * np.sin(2.0 * np.pi / facets) * radius**2


VESSEL = box([-0.03, -0.03, 0], [0.03, 0.03, 0.06])
THICK = box([-0.02, -0.002, 0.005], [0.02, 0.002, 0.035])
THIN = box([-0.02, -0.0005, 0.005], [0.02, 0.0005, 0.035])
HOPPER = lathe([(0.015, 0.0), (0.04, 0.04), (0.04, 0.08)])
CUP = lathe([(0.0, 0.005), (0.03, 0.005), (0.03, 0.05), (0.033, 0.05), (0.033, 0.0), (0.0, 0.0)])
SHELL = lathe([(0.0, 0.0), (0.03, 0.0), (0.03, 0.05)])
TANK = np.concatenate([box([-0.03] * 3, [0.03] * 3), box([-0.025] * 3, [0.025] * 3, inwards=True)])
HOLLOWS = [box([x, 0.005, 0.005], [x + 0.04, 0.045, 0.045], inwards=True) for x in (0.005, 0.055)]
TWO = np.concatenate([box([0, 0, 0], [0.1, 0.05, 0.05]), *HOLLOWS])


def loaded(folder, walls, fill, **keys):
    """Scene, meshes and grains of a filling; walls are triangles or tables of a shape, or these and more that a wall says."""
    entries = []
    for name, wall in walls.items():
        triangles, more = wall if isinstance(wall, tuple) else (wall, {})
        if not isinstance(triangles, dict):
            trimesh.Trimesh(**trimesh.triangles.to_kwargs(triangles)).export(folder / f"{name}.stl")
            triangles = {"mesh": f"{name}.stl"}
        entries.append({"name": name, "material": "m", **triangles, **more})
    data = {
        "materials": {"m": {"density": 2500.0, "young_modulus": 5e6, "poisson_ratio": 0.3}},
        "pairs": [{"materials": ["m", "m"], "restitution": 0.5}],
        "walls": entries,
        "grains": [{"material": "m", "fill": {"diameter": D, **one}} for one in (fill if isinstance(fill, list) else [fill])],
        "time": {"end": 0.1},
        **keys,
    }
    scene = Scene.model_validate({**data, "base": folder})
    meshes = load_meshes(scene)
    grains = load_grains(scene, meshes)
    check_start(grains, meshes, scene)
    return scene, meshes, grains


def clear(scene, meshes, grains, filled=()):
    """Whether no grain reaches into a wall, nor another grain, in radii: 1e-5 and `OVERLAP`."""
    walls = [w for w in place_walls(scene, meshes, wall_poses_at_start(scene)) if w.name not in filled]
    gap = np.min([wall.gap(grains.position, grains.radius) / grains.radius for wall in walls], axis=0)
    return gap.min() >= -1.001e-5 and worst_overlaps(grains.position, grains.radius)[0].max() <= OVERLAP


@pytest.mark.parametrize("blade", [THICK, THIN, (THICK, {"open": True})], ids=["thick", "thin", "said to be open"])
@pytest.mark.parametrize("amount", [{"count": 1500}, {"height": 0.03}])
def test_a_vessel_is_filled_around_a_blade(tmp_path, blade, amount):
    scene, meshes, grains = loaded(tmp_path, {"vessel": VESSEL, "blade": blade}, {"wall": "vessel", **amount})
    assert clear(scene, meshes, grains, ["vessel"])
    assert (signed_distance(meshes["vessel"], grains.position)[0] <= -grains.radius).all()
    if "height" in amount:  # of what the blade leaves
        triangles = blade[0] if isinstance(blade, tuple) else blade
        metal = np.prod(np.ptp(triangles.reshape(-1, 3), axis=0) * [1, 1, 25.0 / 30.0])
        np.testing.assert_allclose(len(grains) * GRAIN, HEIGHT_FRACTION * (0.06 * 0.06 * 0.03 - metal), rtol=2e-3)
    # and grains are on both sides of it, right up to it
    assert ((grains.position[:, 1] > 0).mean()) == pytest.approx(0.5, abs=0.05)
    near = place_walls(scene, meshes, wall_poses_at_start(scene))[1].gap(grains.position, grains.radius)
    assert (near < 0.05 * D).sum() > 10


def test_a_box_is_filled_around_a_shaft_a_floor_and_a_sheet(tmp_path):
    shaft = {"cylinder": {"point": [0, 0, 0], "axis": [0, 0, 1], "radius": 0.006, "inside": False}}
    floor = {"plane": {"point": [0, 0, 0.01], "normal": [0, 0, 1]}}
    sheet = (np.array([[[0.01, -1, -1], [0.01, 1, -1], [0.01, 0, 2]]], float), {"open": True})
    region = {"box": {"min": [-0.03, -0.03, 0], "max": [0.03, 0.03, 0.03]}, "solid_fraction": 0.5}
    scene, meshes, grains = loaded(tmp_path, {"shaft": shaft, "floor": floor, "sheet": sheet}, region)
    assert clear(scene, meshes, grains)
    left = 0.02 * (0.06 * 0.06 - np.pi * 0.006**2)
    np.testing.assert_allclose(len(grains) * GRAIN, 0.5 * left, rtol=2e-3)
    assert (grains.position[:, 0] > 0.01).mean() == pytest.approx(0.34, abs=0.05)


def test_a_moving_wall_is_kept_clear_of_where_it_stands_at_the_start(tmp_path):
    turn = {"motion": {"axis": [0, 0, 1], "rate": "60 rpm", "elapsed": 0.25}}  # by 90 degrees
    scene, meshes, grains = loaded(tmp_path, {"vessel": VESSEL, "blade": (THICK, turn)}, {"wall": "vessel", "count": 1500})
    assert clear(scene, meshes, grains, ["vessel"])
    x, y, z = grains.position.T
    beside = (np.abs(y) < 0.02) & (z > 0.006) & (z < 0.034)
    assert np.abs(x[beside]).min() >= 0.002 + 0.5 * D - 1e-7
    inside = (np.abs(y) < 0.002) & (np.abs(x) > 0.01)
    assert inside.sum() > 10  # where it would be if it had not turned


def test_which_closed_meshes_hold_a_box(tmp_path):
    """A vessel that it pokes out of; not a block amid it, nor a blade in a vessel."""
    points = np.random.default_rng(0).uniform([-0.012, -0.012, -0.008], [0.012, 0.012, 0.008], (2000, 3))

    def held(**meshes):
        walls = [PlacedWall(name, build_mesh(t), 1, np.eye(3), np.zeros(3)) for name, t in meshes.items()]
        return assign_sides(walls, points)[1]

    block = box([-0.01, -0.01, -0.006], [0.01, 0.01, 0.006])  # takes 52 % of it
    assert held(block=block) == []
    assert held(vessel=lathe([(0, -0.02), (0.015, -0.02), (0.015, 0.02), (0, 0.02)])) == ["vessel"]
    blade = box([-0.02, -0.02, -0.01], [0.02, 0.02, 0.01])
    assert held(blade=blade) == ["blade"]  # no other is there: it may be a vessel
    assert held(blade=blade, vessel=box([-0.1] * 3, [0.1] * 3)) == ["vessel"]


def test_a_box_that_straddles_a_closed_mesh_is_told_and_its_metal_left_out(tmp_path):
    region = {"box": {"min": [-0.03] * 3, "max": [0.03] * 3}, "count": 800}
    scene, meshes, grains = loaded(tmp_path, {"block": box([-0.02] * 3, [0.02] * 3)}, region)
    assert clear(scene, meshes, grains)
    [note] = grains.notes
    assert note.startswith("grains[0].fill.box: 30% of it is inside the closed mesh 'block'") or "29%" in note


def test_the_cavity_of_a_tank_is_filled_and_its_metal_only_if_asked(tmp_path):
    scene, meshes, grains = loaded(tmp_path, {"tank": TANK}, {"wall": "tank", "solid_fraction": 0.5})
    assert (np.abs(grains.position) <= 0.025 - grains.radius[:, None] + 1e-8).all()
    np.testing.assert_allclose(len(grains) * GRAIN, 0.5 * 0.05**3, rtol=2e-3)
    assert grains.vessels == ()
    [note] = grains.notes
    assert "cavity of 0.000125 m3, which is filled; point = [" in note
    inside = [float(x) for x in note.split("point = [")[1].split("]")[0].split(",")]
    _, _, grains = loaded(tmp_path, {"tank": TANK}, {"wall": "tank", "count": 200, "point": inside})
    assert (np.abs(grains.position).max(axis=1) > 0.025).all()
    assert grains.vessels == ("tank",)


def test_too_many_grains_are_refused_with_where_the_space_is(tmp_path):
    words = r"in 0\.000125 m3, .* reaches from \(-0\.025, -0\.025, -0\.025\) to \(0\.025, .*fill\.point says which"
    with pytest.raises(SceneError, match=words):
        loaded(tmp_path, {"tank": TANK}, {"wall": "tank", "count": 20_000})


def test_a_loose_body_in_a_vessel_is_no_cavity(tmp_path):
    """Its skin is wound like that of the vessel in the file; once mended it looks like that of a cavity."""
    loose = np.concatenate([VESSEL, box([-0.01, -0.01, 0.02], [0.01, 0.01, 0.04])])
    _, meshes, grains = loaded(tmp_path, {"vessel": loose}, {"wall": "vessel", "count": 1500})
    assert (signed_distance(meshes["vessel"], grains.position)[0] <= -grains.radius).all()
    assert np.ptp(grains.position[:, 0]) > 0.05


def test_of_two_cavities_one_is_named_by_a_point(tmp_path):
    with pytest.raises(SceneError, match=r"two.stl has 2 cavities: say by a point .* point = \[0\.0.*; point = \[0\.0"):
        loaded(tmp_path, {"two": TWO}, {"wall": "two", "count": 10})
    _, _, grains = loaded(tmp_path, {"two": TWO}, {"wall": "two", "count": 300, "point": [0.07, 0.02, 0.02]})
    assert (grains.position[:, 0] > 0.055).all()


def test_a_cup_of_solid_walls_is_filled_from_its_floor(tmp_path):
    scene, meshes, grains = loaded(tmp_path, {"cup": CUP}, {"wall": "cup", "height": 0.03})
    assert clear(scene, meshes, grains)
    assert (grains.position[:, 2] + grains.radius <= 0.035 + 1e-5).all()
    np.testing.assert_allclose(len(grains) * GRAIN, HEIGHT_FRACTION * 0.03 * disk(0.03), rtol=5e-3)
    assert "as a cup, which is filled" in grains.notes[0]
    metal = {"wall": "cup", "count": 50, "diameter": 1e-3, "point": [0.0315, 0, 0.03]}
    _, meshes, grains = loaded(tmp_path, {"cup": CUP}, metal)
    assert (signed_distance(meshes["cup"], grains.position)[0] < 0).all()


@pytest.mark.parametrize("gravity", [[0, 0, 0], [0, 0, -9.81]], ids=["weightless", "heavy"])
def test_a_tube_with_lids_in_one_file_is_filled_between_them(tmp_path, gravity):
    """Bodies that share corners bound no skin of their own around the space that they shut in."""
    lids = [lathe([(0, z), (0.055, z), (0.055, z + 0.005), (0, z + 0.005)], 32) for z in (-0.035, 0.03)]
    tube = lathe([(0.05, 0.03), (0.05, -0.03), (0.055, -0.03), (0.055, 0.03), (0.05, 0.03)], 32)
    fill = {"wall": "drum", "solid_fraction": 0.1, "diameter": 6e-3}
    for more in ({}, {"point": [0, 0, 0]}):
        _, _, grains = loaded(tmp_path, {"drum": np.concatenate([tube, *lids])}, fill | more, gravity=gravity)
        volume = disk(0.05, 32) * 0.06
        np.testing.assert_allclose(len(grains) * GRAIN * 8.0, 0.1 * volume, rtol=6e-3)
        assert (np.hypot(*grains.position[:, :2].T) < 0.05).all() and (np.abs(grains.position[:, 2]) < 0.03).all()


GATE = {"plane": {"point": [0, 0, 0.001], "normal": [0, 0, 1]}}


@pytest.mark.parametrize(("closed_by", "bottom"), [("gate", 1e-3), ("region", 0.0)])
def test_an_open_hopper_that_something_closes_is_filled_to_a_height(tmp_path, closed_by, bottom):
    walls = {"hopper": (HOPPER, {"open": True}), **({"gate": GATE} if closed_by == "gate" else {})}
    fill = {"wall": "hopper", "height": 0.06}
    if closed_by == "region":
        fill["region"] = {"min": [-1, -1, 0], "max": [1, 1, 1]}
    scene, meshes, grains = loaded(tmp_path, walls, fill)
    assert clear(scene, meshes, grains)
    z = grains.position[:, 2]
    assert (z - grains.radius >= bottom - 1e-7).all() and (z + grains.radius <= 0.06 + 1e-7).all()
    assert (np.hypot(*grains.position[:, :2].T) < 0.04).all()
    low = 0.015 + bottom * 25.0 / 40.0
    volume = disk(1.0) * ((0.04 - bottom) * (low**2 + low * 0.04 + 0.04**2) / 3.0 + 0.02 * 0.04**2)
    np.testing.assert_allclose(len(grains) * GRAIN, HEIGHT_FRACTION * volume, rtol=5e-3)


def test_a_filling_that_would_run_out_is_refused_with_the_place(tmp_path):
    words = r"fill: hopper.stl: the filling would run out at about \(.*\) m, .* 0\.0(29|3)\d* m wide"
    with pytest.raises(SceneError, match=words) as e:
        loaded(tmp_path, {"hopper": (HOPPER, {"open": True})}, {"wall": "hopper", "height": 0.06})
    x, y, z = (float(v) for v in str(e.value).split("at about (")[1].split(")")[0].split(","))
    assert np.hypot(x, y) < 0.004 and abs(z) < 0.003
    # a hole that no grain passes holds them
    small = lathe([(0.001, 0.0), (0.04, 0.04), (0.04, 0.08)])
    loaded(tmp_path, {"hopper": (small, {"open": True})}, {"wall": "hopper", "count": 300})
    with pytest.raises(SceneError, match=r"at point = \[1, 0, 0\] m no grain of 0.003 m in diameter fits"):
        loaded(tmp_path, {"cup": (SHELL, {"open": True})}, {"wall": "cup", "count": 9, "point": [1, 0, 0]})
    # without gravity nothing tells which side is up
    with pytest.raises(SceneError, match="would run out"):
        loaded(tmp_path, {"cup": (SHELL, {"open": True})}, {"wall": "cup", "count": 300}, gravity=[0, 0, 0])
    _, _, grains = loaded(tmp_path, {"cup": (SHELL, {"open": True})}, {"wall": "cup", "count": 300})
    assert len(grains) == 300


def test_the_space_between_walls_has_the_right_volume_however_the_grid_lies():
    wall = [PlacedWall("cup", build_mesh(SHELL), 0, np.eye(3), np.zeros(3))]
    leaks = np.array([[True, True, True], [True, True, False]])
    for height in (0.02, 0.025, 0.03, 0.05):
        open_space = find_open_space(wall, np.array([[-0.03, -0.03, 0], [0.03, 0.03, height]]), np.eye(3), leaks, 2e-3, "fill")
        np.testing.assert_allclose(open_space.volume, disk(0.03) * height, rtol=2e-3)


def test_a_box_within_metal_is_refused(tmp_path):
    region = {"box": {"min": [0.0302, -0.001, 0.02], "max": [0.0328, 0.001, 0.03]}, "count": 2, "diameter": 1e-3}
    with pytest.raises(SceneError, match=r"grains\[0\]\.fill: the region lies wholly within or behind 'cup'"):
        loaded(tmp_path, {"cup": CUP}, region)


def test_a_periodic_image_of_a_mesh_is_kept_clear_of(tmp_path):
    post = box([-0.004, -1, -1], [0.004, 1, 1])
    region = {"box": {"min": [0, 0, 0], "max": [0.03, 0.03, 0.03]}, "solid_fraction": 0.4}
    borders = {"x": {"min": 0, "max": 0.03, "kind": "periodic"}}
    _, _, grains = loaded(tmp_path, {"post": post}, region, borders=borders)
    assert (grains.position[:, 0] >= 0.004 + 0.5 * D - 1e-7).all()
    assert (grains.position[:, 0] <= 0.026 - 0.5 * D + 1e-7).all()
    np.testing.assert_allclose(len(grains) * GRAIN, 0.4 * 0.022 * 0.03**2, rtol=2e-3)
