from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from warpdem.core.access import Access
from warpdem.errors import SceneError
from warpdem.filling.fill_request import HEIGHT_FRACTION
from warpdem.filling.grain_file import read_grain_file
from warpdem.filling.initial_grains import InitialGrains, concatenated, load_grains
from warpdem.filling.packing_neighbors import worst_overlaps
from warpdem.filling.packing_run import OVERLAP
from warpdem.filling.start_check import check_start
from warpdem.mesh.triangle_mesh import build_mesh
from warpdem.scene.rotation import Rotation
from warpdem.scene.shapes.plane import Plane
from warpdem.scene.size_distribution import DiameterDistribution
from warpdem.scene.walls import Wall

REST = SimpleNamespace(positions=None, file=None, fill=None, ids=None, velocities_in="frame", material="glass", clump=None)


def explicit(positions, radii, **more):
    positions = np.asarray(positions, float)
    fields = {
        "positions": positions,
        "explicit_radii": np.broadcast_to(np.asarray(radii, float), len(positions)),
        "explicit_velocities": np.zeros_like(positions),
        "explicit_spins": np.zeros_like(positions),
    }
    return SimpleNamespace(**{**vars(REST), **fields, **more})


def filled(**fields):
    keys = ("wall", "box", "cylinder", "sphere", "mesh", "region", "point", "height", "count", "mass", "solid_fraction")
    asked = {**dict.fromkeys(keys), "seed": 0, **fields}
    return SimpleNamespace(**{**vars(REST), "fill": SimpleNamespace(**{"tile": None} | asked)})


def make_scene(*groups, walls=(), frame=None, base="."):
    return SimpleNamespace(
        materials={"steel": None, "glass": SimpleNamespace(density=2500.0)},
        gravity=(0.0, 0.0, -9.81),
        grains=list(groups),
        clumps={},
        apart=np.zeros((2, 2), dtype=bool),
        touched=lambda kind, wall: np.ones(len(kind), dtype=bool),
        walls=list(walls),
        frame=frame,
        source="scene.toml",
        engine=SimpleNamespace(max_overlap=0.1),
        resolve=lambda name: Path(base) / name,
        access=Access(),
        groups=[f"grains[{k}]" for k in range(len(groups))],
        group_names=[f"grains[{k}]" for k in range(len(groups))],
    )


def start(positions, radii=0.5, **fields):
    scene = make_scene(explicit(positions, radii, **fields))
    return scene, load_grains(scene, {})


def container(low, high):
    low, high = np.array(low, float), np.array(high, float)
    corners = np.array(trimesh.creation.box((1, 1, 1)).triangles) + 0.5
    return build_mesh(low + corners * (high - low), name="box.stl")


def test_explicit_arrays_become_float64_grains():
    _, grains = start([[0, 0, 0], [2, 0, 0]], [0.5, 1.0], explicit_spins=[[0, 0, 1], [0, 0, 2]])
    assert isinstance(grains, InitialGrains)
    assert len(grains) == 2
    assert (grains.id.dtype, grains.type.dtype) == (np.int64, np.int32)
    assert all(getattr(grains, name).dtype == np.float64 for name in ("radius", "position", "velocity", "spin"))
    np.testing.assert_array_equal(grains.type, 1)
    np.testing.assert_array_equal(grains.radius, [0.5, 1.0])
    np.testing.assert_array_equal(grains.spin, [[0, 0, 1], [0, 0, 2]])
    with pytest.raises(AttributeError):
        grains.radius = None


def test_groups_run_on_with_free_ids_and_keep_given_ones():
    scene = make_scene(
        explicit([[0, 0, 0], [2, 0, 0]], 0.5),
        explicit([[0, 5, 0], [2, 5, 0]], 0.5, ids=[3, 0], material="steel"),
        explicit([[0, 9, 0], [2, 9, 0]], 0.5),
    )
    grains = load_grains(scene, {})
    np.testing.assert_array_equal(grains.id, [1, 2, 3, 0, 4, 5])
    np.testing.assert_array_equal(grains.type, [1, 1, 0, 0, 1, 1])
    np.testing.assert_array_equal(grains.position[3], [2, 5, 0])


def test_id_in_two_groups_is_refused():
    scene = make_scene(explicit([[0, 0, 0]], 0.5, ids=[7]), explicit([[0, 5, 0]], 0.5, ids=[7]))
    with pytest.raises(SceneError, match=r"scene\.toml: grains\[1\]: grains\[0\] has the id 7 too"):
        load_grains(scene, {})


def test_laboratory_velocities_lose_the_motion_of_the_frame():
    frame = (Rotation(axis=(0, 0, 1), origin=(1, 0, 0), schedule=[{"until": 1.0, "rate": [2.0, 3.0]}]),)
    moving = explicit([[4, 1, 5]], 0.5, velocities_in="laboratory")
    moving.explicit_velocities = np.array([[0.5, 0.0, 0.0]])
    moving.explicit_spins = np.array([[1.0, 0.0, 0.0]])
    scene = make_scene(moving, explicit([[0, 5, 0]], 0.5), frame=frame)
    grains = load_grains(scene, {})
    # Omega x (q - origin) = 2 z x (3, 1, 5) = (-2, 6, 0)
    np.testing.assert_allclose(grains.velocity, [[2.5, -6.0, 0.0], [0, 0, 0]], rtol=0, atol=1e-15)
    np.testing.assert_allclose(grains.spin, [[1.0, 0.0, -2.0], [0, 0, 0]], rtol=0, atol=1e-15)
    moving.velocities_in = "frame"
    np.testing.assert_array_equal(load_grains(scene, {}).velocity, [[0.5, 0, 0], [0, 0, 0]])


def test_fill_of_a_wall_within_a_region():
    mesh = container([0, 0, 0], [8, 8, 8])
    region = SimpleNamespace(min=(0.0, 0.0, 0.0), max=(8.0, 8.0, 4.0))
    group = filled(wall="vessel", region=region, count=60, diameter=DiameterDistribution(uniform=(0.8, 1.2)), seed=2)
    wall = Wall(name="vessel", material="steel", mesh="box.stl")
    scene = make_scene(group, walls=[wall])
    grains = load_grains(scene, {"vessel": mesh})
    assert len(grains) == 60
    assert (grains.position[:, 2] + grains.radius <= 4.0 + 1e-12).all()
    assert (grains.position - grains.radius[:, None] >= -1e-3).all()
    check_start(grains, {"vessel": mesh}, scene)


def test_fill_of_a_box_with_one_diameter():
    box = SimpleNamespace(min=(0.0, 0.0, 0.0), max=(4.0, 4.0, 4.0))
    grains = load_grains(make_scene(filled(box=box, solid_fraction=0.3, diameter=1.0)), {})
    assert abs(len(grains) - 0.3 * 64 * 6 / np.pi) <= 0.5
    np.testing.assert_array_equal(grains.radius, 0.5)


def box_of(low, high):
    return SimpleNamespace(min=tuple(map(float, low)), max=tuple(map(float, high)))


def test_fill_to_a_mass_and_to_a_height_against_gravity():
    scene = make_scene(filled(box=box_of([0, 0, 0], [4, 4, 9]), mass=30_000.0, diameter=0.5, height=4.0))
    grains = load_grains(scene, {})
    mass = 2500.0 * 4.0 / 3.0 * np.pi * (grains.radius**3).sum()
    assert abs(mass - 30_000.0) <= 0.5 * 2500.0 * np.pi / 6.0 * 0.5**3
    assert (grains.position[:, 2] + grains.radius <= 4.0).all()
    # a height alone is filled densely; gravity that points up fills from the top
    scene = make_scene(filled(box=box_of([0, 0, 0], [4, 4, 9]), diameter=0.4, height=3.0))
    scene.gravity = (0.0, 0.0, 9.81)
    grains = load_grains(scene, {})
    solid = 4.0 / 3.0 * np.pi * (grains.radius**3).sum()
    np.testing.assert_allclose(solid, HEIGHT_FRACTION * 48.0, rtol=2e-3)
    assert (grains.position[:, 2] - grains.radius >= 6.0).all()


def test_groups_that_share_a_space_do_not_overlap():
    box = box_of([0, 0, 0], [6, 6, 6])
    scene = make_scene(
        filled(box=box, solid_fraction=0.2, diameter=1.0),
        explicit([[3, 3, 3], [20, 0, 0]], [1.2, 0.5], material="steel", ids=[5, 9]),
        filled(box=box, solid_fraction=0.2, diameter=0.6),
    )
    grains = load_grains(scene, {})
    assert worst_overlaps(grains.position, grains.radius)[0].max() <= OVERLAP
    steel = np.isin(grains.id, [5, 9])
    np.testing.assert_array_equal(grains.position[steel], [[3, 3, 3], [20, 0, 0]])
    # in the order of the scene
    first = int(np.argmax(steel))
    np.testing.assert_array_equal(grains.radius[:first], 0.5)
    np.testing.assert_array_equal(grains.radius[first + 2 :], 0.3)
    assert (grains.packings[0].grains, len(grains.packings)) == (len(grains) - 2, 1)
    assert grains.packings[0].keys == ("scene.toml: grains[0].fill", "scene.toml: grains[2].fill")
    assert len(concatenated(grains, grains).packings) == 2
    check_start(grains, {}, scene)


STATE = {
    "position": np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 1.0]]),
    "radius": np.array([0.5, 0.75]),
    "velocity": np.array([[1.0, 2.0, 3.0], [0.0, 0.0, 0.1]]),
    "spin": np.array([[0.0, 1.0, 0.0], [4.0, 5.0, 6.0]]),
    "id": np.array([9, 4]),
}


def write_npz(path, **changes):
    np.savez(path, **{**STATE, **changes})


def write_npz_short_names(path):
    names = {"position": "x", "radius": "r", "velocity": "v", "spin": "w", "id": "id"}
    np.savez(path, L=3.0, **{names[key]: value for key, value in STATE.items()})


def write_csv(path):
    table = np.column_stack(list(STATE.values()))
    np.savetxt(path, table, delimiter=",", header="x,y,z,radius,vx,vy,vz,wx,wy,wz,id", comments="", fmt="%.17g")


def write_vtp(path):
    import pyvista

    cloud = pyvista.PolyData(STATE["position"])
    for name, field in (("radius", "radius"), ("v", "velocity"), ("omega", "spin"), ("id", "id")):
        cloud.point_data[name] = STATE[field]
    cloud.save(path)


@pytest.mark.parametrize(
    ("name", "write"),
    [("a.npz", write_npz), ("b.npz", write_npz_short_names), ("c.csv", write_csv), ("d.vtp", write_vtp)],
)
def test_state_files_of_all_kinds_give_the_same_grains(tmp_path, name, write):
    write(tmp_path / name)
    scene = make_scene(SimpleNamespace(**{**vars(REST), "file": name}), base=tmp_path)
    grains = load_grains(scene, {})
    for field, values in STATE.items():
        np.testing.assert_array_equal(getattr(grains, field), values, err_msg=field)


def test_state_file_may_hold_places_and_radii_only(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("radius, x, y, z\n0.5,1,2,3\n\n0.25,4,5,6\n")
    fields = read_grain_file(path, "grains[0].file")
    np.testing.assert_array_equal(fields["position"], [[1, 2, 3], [4, 5, 6]])
    np.testing.assert_array_equal(fields["velocity"], 0.0)
    assert fields["id"] is None


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"radius": [0.5, 0.0]}, r"row 2: radius = 0\.0 must be above 0 \(1 of 2 rows\)"),
        ({"radius": [-1.0, 0.5]}, r"row 1: radius = -1\.0 must be above 0"),
        ({"position": [[0, 0, 0], [0, np.nan, 0.0]]}, r"row 2: position = \[0\.0, nan, 0\.0\] must be finite"),
        ({"velocity": [[np.inf, 0, 0], [0, 0, 0]]}, "row 1: velocity = .*inf.* must be finite"),
        ({"spin": np.zeros((3, 3))}, r"spin has the shape \(3, 3\), must be \(2, 3\)"),
        ({"position": np.zeros((2, 2))}, r"position has the shape \(2, 2\), must be \(2, 3\)"),
        ({"radius": np.array(["a", "b"])}, "radius must hold numbers"),
        ({"id": [3, 3]}, "row 2: id = 3 comes twice"),
        ({"id": [3.0, 3.5]}, r"row 2: id = 3\.5 must be a whole number"),
        ({"radius": np.zeros(0)}, "holds no grains"),
    ],
)
def test_bad_state_is_refused_with_row_and_value(tmp_path, changes, message):
    path = tmp_path / "bad.npz"
    write_npz(path, **changes)
    with pytest.raises(SceneError, match=rf"grains\[0\]\.file: bad\.npz: {message}"):
        read_grain_file(path, "grains[0].file")


def test_npz_without_radius_names_what_it_has(tmp_path):
    np.savez(tmp_path / "bad.npz", position=np.zeros((1, 3)), size=1.0)
    with pytest.raises(SceneError, match=r"bad\.npz: has no key radius or r; it has position, size"):
        read_grain_file(tmp_path / "bad.npz", "grains[0].file")


def test_vtp_without_radius_names_what_it_has(tmp_path):
    import pyvista

    cloud = pyvista.PolyData(STATE["position"])
    cloud.point_data["size"] = STATE["radius"]
    cloud.save(tmp_path / "bad.vtp")
    with pytest.raises(SceneError, match=r"bad\.vtp: has no point array radius; it has size"):
        read_grain_file(tmp_path / "bad.vtp", "grains[0].file")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x,y,z\n1,2,3\n", "missing column radius; it has x, y, z"),
        ("x,y,z,radius,vx,vy\n1,2,3,1,0,0\n", "missing column vz"),
        ("x,y,z,radius,speed\n1,2,3,1,0\n", "unknown column 'speed'; allowed: x, y, z, radius, vx"),
        ("x,y,z,z,radius\n1,2,3,3,1\n", "a column comes twice"),
        ("x,y,z,radius\n1,2,3,1\n1,2,three,1\n", "'three'.* row 1"),
        ("x,y,z,radius\n1,2,3\n", "header names 4 columns, the rows have 3"),
        ("x,y,z,radius\n", "holds no grains"),
    ],
)
def test_bad_csv_is_refused(tmp_path, text, message):
    (tmp_path / "bad.csv").write_text(text)
    with pytest.raises(SceneError, match=rf"grains\[0\]\.file: bad\.csv: .*{message}"):
        read_grain_file(tmp_path / "bad.csv", "grains[0].file")


def test_missing_broken_and_foreign_state_files_are_refused(tmp_path):
    with pytest.raises(SceneError, match=r"grains\[0\]\.file: no such state file: .*none\.npz"):
        read_grain_file(tmp_path / "none.npz", "grains[0].file")
    (tmp_path / "broken.npz").write_bytes(b"nothing")
    with pytest.raises(SceneError, match=r"broken\.npz: cannot be read"):
        read_grain_file(tmp_path / "broken.npz", "grains[0].file")
    (tmp_path / "state.txt").write_text("1 2 3")
    with pytest.raises(SceneError, match=r"state\.txt: a state file ends in one of \.npz, \.csv, \.vtp"):
        read_grain_file(tmp_path / "state.txt", "grains[0].file")


def test_overlapping_start_names_both_grains_and_the_overlap():
    scene, grains = start([[0, 0, 0], [0, 0, 3], [0, 0.96, 0], [5, 5, 5]], ids=[10, 11, 12, 13])
    check_start(grains, {}, scene)
    scene, grains = start([[0, 0, 0], [0, 0, 3], [0, 0.9, 0], [5, 5, 5]], ids=[12, 11, 10, 13])
    with pytest.raises(
        SceneError, match=r"grain 10 at \(0, 0\.9, 0\) m and grain 12 at \(0, 0, 0\) m overlap by 0\.1 m, 0\.2 of"
    ):
        check_start(grains, {}, scene)


def test_overlap_counts_against_the_smaller_radius():
    scene, grains = start([[0, 0, 0], [1.091, 0, 0]], [1.0, 0.1])
    check_start(grains, {}, scene)
    scene, grains = start([[0, 0, 0], [1.08, 0, 0]], [1.0, 0.1])
    with pytest.raises(SceneError, match=r"0\.2 of the smaller radius"):
        check_start(grains, {}, scene)


def test_coinciding_grains_are_named():
    scene, grains = start([[1, 2, 3], [0, 0, 0], [1, 2, 3]], 0.1)
    with pytest.raises(SceneError, match=r"grain 0 at \(1, 2, 3\) m and grain 2 at \(1, 2, 3\) m coincide"):
        check_start(grains, {}, scene)


def test_grain_behind_a_plane_is_named():
    plane = Plane(point=(0.0, 0.0, 1.0), normal=(0.0, 0.0, -1.0))
    scene, grains = start([[0, 0, 0], [3, 0, 2.5]], ids=[0, 8])
    scene.walls = [Wall(name="lid", material="steel", plane=plane)]
    with pytest.raises(SceneError, match=r"walls\[0\]\.plane: grain 8 at \(3, 0, 2\.5\) m is 1\.5 m behind .*'lid'"):
        check_start(grains, {}, scene)
    scene, grains = start([[0, 0, 0], [3, 0, 0.9]])
    check_start(grains, {}, scene)


def mesh_wall(name):
    return Wall(name=name, material="steel", mesh="x.stl")


def test_grain_outside_the_container_of_most_is_named():
    mesh = {"drum": container([0, 0, 0], [10, 10, 10])}
    scene, grains = start([[2, 2, 2], [5, 5, 5], [11.5, 5, 5]], ids=[0, 1, 6])
    scene.walls = [mesh_wall("drum")]
    with pytest.raises(SceneError, match=r"grains\[0\]\.positions\[2\] \(11\.5, 5, 5\) m is outside .*'drum'.*, 1\.5 m"):
        check_start(grains, mesh, scene)


def test_of_one_grain_inside_and_one_outside_the_outer_is_named():
    mesh = {"drum": container([0, 0, 0], [10, 10, 10]), "blade": container([4, 4, 4], [6, 6, 6])}
    scene, grains = start([[5, 5, 2], [10.6, 5, 5]])
    scene.walls = [mesh_wall("drum")]
    with pytest.raises(SceneError, match=r"grains\[0\]\.positions\[1\] \(10\.6, 5, 5\) m is outside the closed mesh 'drum' "):
        check_start(grains, {"drum": mesh["drum"]}, scene)
    # one that a container holds is where it should be
    scene, grains = start([[5, 5, 2], [5, 5, 5.2]])
    scene.walls = [mesh_wall("drum"), mesh_wall("blade")]
    with pytest.raises(SceneError, match=r"grains\[0\]\.positions\[1\] \(5, 5, 5\.2\) m is inside the closed mesh 'blade' "):
        check_start(grains, mesh, scene)


def test_a_grain_of_a_file_is_named_by_its_id(tmp_path):
    np.savez(tmp_path / "bed.npz", x=[[2.0, 2, 2], [5, 5, 5], [11.5, 5, 5]], r=np.full(3, 0.5), id=[4, 5, 6])
    scene = make_scene(SimpleNamespace(**{**vars(REST), "file": "bed.npz"}), base=tmp_path)
    scene.walls, mesh = [mesh_wall("drum")], {"drum": container([0, 0, 0], [10, 10, 10])}
    with pytest.raises(SceneError, match=r"grain 6 at \(11\.5, 5, 5\) m is outside the closed mesh 'drum' "):
        check_start(load_grains(scene, mesh), mesh, scene)


def test_grain_inside_an_obstacle_is_named():
    mesh = {"drum": container([0, 0, 0], [10, 10, 10]), "blade": container([4, 4, 4], [6, 6, 6])}
    scene, grains = start([[2, 2, 2], [2, 2, 8], [5, 5, 5.5]], ids=[0, 1, 6])
    scene.walls = walls = [mesh_wall("drum"), mesh_wall("blade")]
    with pytest.raises(SceneError, match=r"grains\[0\]\.positions\[2\] \(5, 5, 5\.5\) m is inside .*'blade'.*, 0\.5 m"):
        check_start(grains, mesh, scene)
    scene, grains = start([[2, 2, 2], [2, 2, 8], [5, 5, 7]])
    scene.walls = walls
    check_start(grains, mesh, scene)


def test_grains_shared_by_filled_vessels_are_no_mistake():
    mesh = {"left": container([0, 0, 0], [6, 6, 6]), "right": container([10, 0, 0], [16, 6, 6])}
    groups = [filled(wall=name, count=5, diameter=1.0) for name in mesh]
    scene = make_scene(*groups, walls=[mesh_wall(name) for name in mesh])
    grains = load_grains(scene, mesh)
    check_start(grains, mesh, scene)


def test_many_grains_are_checked_in_reasonable_memory():
    side = 30
    lattice = np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), axis=-1).reshape(-1, 3) * 1.0
    scene, grains = start(lattice, 0.5)
    check_start(grains, {}, scene)
    moved = lattice.copy()
    moved[1234] += [0.0, 0.0, 0.2]
    scene, grains = start(moved, 0.5)
    with pytest.raises(SceneError, match=r"grain 1234 .* and grain 1235 .*overlap by 0\.2 m"):
        check_start(grains, {}, scene)
