import math
import struct
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from warpdem import geometry
from warpdem.errors import SceneError
from warpdem.geometry import build_mesh, check_size, clipped_volume, inside, load_mesh, require_closed, signed_distance

MESHES = Path(__file__).resolve().parent.parent / "scenes" / "meshes"


def box(size=(1.0, 2.0, 3.0)):
    """Triangles of a box about the origin, shape (12, 3, 3)."""
    return np.array(trimesh.creation.box(size).triangles)


def floor(count, tilt=0.3):
    """A tilted square floor of 2 count^2 triangles, rounded to float32 as in a binary file."""
    x = np.arange(count + 1) / count
    plane = np.stack([*np.meshgrid(x, x, indexing="ij"), np.zeros((count + 1, count + 1))], axis=-1).reshape(-1, 3)
    c, s = math.cos(tilt), math.sin(tilt)
    placed = plane @ np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]) + [3.0, 2.0, 0.3]
    i = (np.arange(count)[:, None] * (count + 1) + np.arange(count)).ravel()
    triangles = np.concatenate(
        [np.stack([i, i + count + 1, i + count + 2], axis=1), np.stack([i, i + count + 2, i + 1], axis=1)]
    )
    return placed.astype(np.float32)[triangles]


@pytest.mark.parametrize("kind", ["stl", "stl_ascii", "obj", "ply"])
def test_all_file_kinds_give_the_same_welded_box(tmp_path, kind):
    path = tmp_path / f"box.{kind[:3]}"
    trimesh.Trimesh(**trimesh.triangles.to_kwargs(box())).export(path, file_type=kind)
    mesh = load_mesh(path, key="walls[0].mesh")
    assert mesh.vertices.shape == (8, 3)
    assert mesh.vertices.dtype == np.float64
    assert mesh.triangles.shape == (12, 3)
    assert mesh.triangles.dtype == np.int32
    assert mesh.is_closed
    np.testing.assert_allclose(mesh.volume, 6.0, rtol=1e-14)
    np.testing.assert_array_equal(mesh.bounds, [[-0.5, -1.0, -1.5], [0.5, 1.0, 1.5]])


def test_pose_is_scale_then_rotate_then_translate(tmp_path):
    path = tmp_path / "box.stl"
    trimesh.creation.box((1.0, 2.0, 3.0)).export(path)
    quarter = SimpleNamespace(axis=(0.0, 0.0, 2.0), angle=math.pi / 2)
    mesh = load_mesh(path, 0.1, quarter, (1.0, 0.0, 0.0))
    # the side of 2 along y turns to -x: half widths 0.1 along x, 0.05 along y
    np.testing.assert_allclose(mesh.bounds, [[0.9, -0.05, -0.15], [1.1, 0.05, 0.15]], atol=1e-15)
    np.testing.assert_allclose(mesh.volume, 6e-3, rtol=1e-13)


@pytest.mark.parametrize(
    ("name", "neck", "length", "rim"), [("hourglass", 4.5, 2.2, 16.2), ("hourglass_paper", 2.025, 1.0, 23.2)]
)
def test_hourglass_of_the_scenes_is_one_smooth_piece_and_two_lids(name, neck, length, rim):
    mesh = load_mesh(MESHES / f"{name}.stl", 1e-3)
    require_closed(mesh, "walls[0].mesh")
    # the cones leave the neck at 29.95 degrees, measured across the middle of a facet
    assert mesh.piece.max() + 1 == 3
    # the facets of a cone run straight from the neck to the lid: 48 planes each for two cones and the neck
    assert mesh.plane.max() + 1 == 3 * 48 + 2
    cone = 2 * (rim - neck) / math.tan(math.radians(30)) / 3 * (rim**2 + rim * neck + neck**2)
    polygon = 24 * math.sin(2 * math.pi / 48)  # area of a 48-gon over the square of its radius
    np.testing.assert_allclose(mesh.volume, 1e-9 * polygon * (cone + length * neck**2), rtol=1e-6)
    np.testing.assert_allclose(mesh.bounds[1, 0], 1e-3 * rim, rtol=1e-6)


def test_box_of_the_scenes_is_the_unit_box():
    mesh = load_mesh(MESHES / "box.stl")
    require_closed(mesh, "walls[0].mesh")
    np.testing.assert_array_equal(mesh.bounds, [[0, 0, 0], [1, 1, 1]])
    assert mesh.volume == pytest.approx(1.0)
    assert mesh.plane.max() + 1 == 6


def test_welding_is_by_float32_and_keeps_the_digits_of_the_first_corner():
    corners = box((0.2, 0.2, 0.2))
    corners[3:] *= 1.0 + 1e-9
    corners[0, corners[0] == 0.1] = 0.1
    mesh = build_mesh(corners)
    assert len(mesh.vertices) == 8
    assert mesh.is_closed
    assert 0.1 in mesh.vertices
    signed_zero = np.array([[[0.0, 0.0, 0.0], [1, 0, 0], [0, 1, 0]], [[-0.0, -0.0, 0.0], [0, 1, 0], [-1, 0, 0]]])
    assert len(build_mesh(signed_zero).vertices) == 4


def test_triangles_without_area_are_dropped_and_do_not_open_the_mesh():
    corners = box()
    a, b, c = corners[0]
    middle = 0.5 * (a + b)
    # the edge ab split on one side only, the gap closed by a triangle with its corners on a line
    split = [[a, middle, c], [middle, b, c], [a, b, middle], [a, a, b]]
    mesh = build_mesh(np.concatenate([corners[1:], split]))
    assert mesh.dropped == 2
    assert len(mesh.triangles) == 13
    assert mesh.is_closed
    assert mesh.plane.max() + 1 == 6
    np.testing.assert_allclose(mesh.volume, 6.0, rtol=1e-14)


def test_box_has_six_pieces_and_six_planes_with_outward_normals():
    mesh = build_mesh(box())
    assert mesh.piece.dtype == mesh.plane.dtype == np.int32
    assert set(mesh.piece) == set(mesh.plane) == set(range(6))
    np.testing.assert_array_equal(np.bincount(mesh.plane), 2)
    np.testing.assert_allclose(np.abs(mesh.plane_normal).max(axis=1), 1.0)
    np.testing.assert_allclose(np.sort(mesh.plane_offset), [0.5, 0.5, 1.0, 1.0, 1.5, 1.5])
    for triangle, plane in zip(mesh.corners, mesh.plane, strict=True):
        normal = np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0])
        assert normal @ mesh.plane_normal[plane] > 0.0
        np.testing.assert_allclose(triangle @ mesh.plane_normal[plane], mesh.plane_offset[plane], atol=1e-15)


@pytest.mark.parametrize(("sections", "pieces"), [(48, 3), (13, 3), (12, 14), (6, 8)])
def test_cylinder_side_is_smooth_when_its_facets_meet_below_30_degrees(sections, pieces):
    # 13 facets meet at 27.7 degrees; 12 at 30, which is not below
    mesh = build_mesh(np.array(trimesh.creation.cylinder(1.0, 2.0, sections=sections).triangles, np.float32))
    assert mesh.piece.max() + 1 == pieces
    assert mesh.plane.max() + 1 == sections + 2


def test_floor_of_many_triangles_is_one_plane_despite_float32_rounding():
    mesh = build_mesh(floor(60))
    assert len(mesh.triangles) == 7200
    assert mesh.piece.max() == mesh.plane.max() == 0
    # rounding of the corners is 1e-7; what is left of it in the mean of many triangles
    np.testing.assert_allclose(mesh.plane_normal, [[-math.sin(0.3), 0.0, math.cos(0.3)]], atol=1e-7)
    off = mesh.vertices @ mesh.plane_normal[0] - mesh.plane_offset[0]
    assert 0.0 < np.abs(off).max() < 4e-7


def test_small_bend_is_not_taken_for_rounding():
    corners = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 2e-6]]])
    assert build_mesh(corners).plane.max() == 1
    corners[1, 2, 2] = 2e-7
    assert build_mesh(corners).plane.max() == 0


def test_finely_bent_surface_is_not_one_plane():
    # strips of a cylinder of radius 1 so narrow that neighbours differ by less than rounding
    count, step = 1000, 2e-4
    angle = step * np.arange(count + 1)
    low = np.stack([np.cos(angle), np.sin(angle), np.zeros(count + 1)], axis=1)
    high = low + np.array([0.0, 0.0, 1e-3])
    corners = np.concatenate(
        [np.stack([low[:-1], low[1:], high[1:]], axis=1), np.stack([low[:-1], high[1:], high[:-1]], axis=1)]
    )
    mesh = build_mesh(corners)
    assert mesh.piece.max() == 0
    off = (mesh.corners * mesh.plane_normal[mesh.plane][:, None]).sum(axis=2) - mesh.plane_offset[mesh.plane][:, None]
    assert np.abs(off).max() < 2e-6


def test_pieces_do_not_depend_on_winding():
    corners = np.array(box())
    corners[::2] = corners[::2, ::-1]
    mesh = build_mesh(corners)
    assert mesh.plane.max() + 1 == mesh.piece.max() + 1 == 6
    assert mesh.twisted_edges > 0
    np.testing.assert_allclose(np.abs(mesh.plane_normal).max(axis=1), 1.0)


def test_many_triangles_give_the_same_arrays_twice():
    corners = np.array(trimesh.creation.icosphere(subdivisions=4).triangles, np.float32)
    one, two = build_mesh(corners), build_mesh(corners)
    for name in ("vertices", "triangles", "piece", "plane", "plane_normal", "plane_offset"):
        assert getattr(one, name).tobytes() == getattr(two, name).tobytes()
    assert one.piece.max() == 0


def test_components_are_found_along_a_long_shuffled_chain():
    order = np.random.default_rng(0).permutation(2000)
    chain = np.stack([order[:-1], order[1:]], axis=1)
    cut = np.delete(chain, 700, axis=0)
    label = geometry._components(2001, cut)
    assert len(np.unique(label)) == 3
    assert len(np.unique(label[order[:701]])) == len(np.unique(label[order[701:]])) == 1


def test_open_mesh_is_refused_with_the_place_of_the_hole():
    mesh = build_mesh(box()[1:])
    assert not mesh.is_closed
    assert mesh.open_edges == 3
    with pytest.raises(SceneError, match=r"walls\[2\]\.mesh: mesh: .* 3 open edges .* at \(") as caught:
        require_closed(mesh, "walls[2].mesh")
    assert ", ".join(f"{v:.6g}" for v in mesh.open_at) in str(caught.value)
    gone = box()[0]
    middles = 0.5 * (gone + np.roll(gone, -1, axis=0))
    assert np.linalg.norm(middles - mesh.open_at, axis=1).min() < 1e-12


def test_mesh_wound_against_itself_is_refused():
    corners = box()
    corners[4] = corners[4, ::-1]
    mesh = build_mesh(corners)
    assert mesh.is_closed
    with pytest.raises(SceneError, match="at 3 edges"):
        require_closed(mesh, "walls[0].mesh")
    require_closed(build_mesh(box()), "walls[0].mesh")


def test_missing_file_is_named(tmp_path):
    with pytest.raises(SceneError, match=r"walls\[0\]\.mesh: no such mesh file: .*none\.stl"):
        load_mesh(tmp_path / "none.stl", key="walls[0].mesh")


def test_unreadable_file_is_named(tmp_path):
    path = tmp_path / "bad.ply"
    path.write_bytes(b"\x00\x01 no mesh at all")
    with pytest.raises(SceneError, match=r"walls\[0\]\.mesh: bad\.ply \(17 bytes\) cannot be read"):
        load_mesh(path, key="walls[0].mesh")


@pytest.mark.parametrize(
    "content",
    [b" " * 80 + struct.pack("<I", 0), b"solid nothing\nendsolid nothing\n", b"some words"],
    ids=["binary", "ascii", "no mesh"],
)
def test_empty_mesh_is_refused(tmp_path, content):
    path = tmp_path / "empty.stl"
    path.write_bytes(content)
    with pytest.raises(SceneError, match=r"walls\[0\]\.mesh: empty\.stl.*(empty|cannot be read)"):
        load_mesh(path, key="walls[0].mesh")


def test_mesh_without_area_is_refused():
    with pytest.raises(SceneError, match=r"empty.*2 triangles"):
        build_mesh(np.ones((2, 3, 3)))
    with pytest.raises(SceneError, match="empty"):
        build_mesh(np.arange(9.0).reshape(1, 3, 3))


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_corner_that_is_no_number_is_refused(tmp_path, value):
    path = tmp_path / "bad.stl"
    corners = box()
    corners[5, 1, 2] = value
    record = np.zeros(12, dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    record["corners"] = corners
    path.write_bytes(b" " * 80 + struct.pack("<I", 12) + record.tobytes())
    with pytest.raises(SceneError, match=rf"walls\[0\]\.mesh: bad\.stl: 1 of 12 .* triangle 5: .*{value}"):
        load_mesh(path, key="walls[0].mesh")


def test_millimetres_read_as_metres_are_refused_with_the_remedy():
    drum = build_mesh(box((100.0, 100.0, 300.0)))
    with pytest.raises(SceneError, match=r"walls\[1\]\.mesh: .*300 m large.*0\.005 m in diameter.*scale = 0\.001"):
        check_size(drum, [0.004, 0.006], "walls[1].mesh")
    check_size(build_mesh(box((0.1, 0.1, 0.3))), [0.004, 0.006], "walls[1].mesh")


def test_mesh_smaller_than_its_grains_is_refused_with_the_remedy():
    with pytest.raises(SceneError, match=r"0\.0003 m large.*0\.005 m in diameter.*scale = 1000"):
        check_size(build_mesh(box((1e-4, 1e-4, 3e-4))), 0.005, "walls[1].mesh")
    # a thin plate is no mistake
    check_size(build_mesh(box((0.1, 0.1, 1e-4))), 0.005, "walls[1].mesh")


def test_distance_to_a_box_is_exact_near_far_and_away_from_the_origin():
    points = np.random.default_rng(1).uniform(-2.0, 2.0, (4000, 3))
    out = np.abs(points) - [0.5, 1.0, 1.5]
    expected = np.linalg.norm(np.maximum(out, 0.0), axis=1) + np.minimum(out.max(axis=1), 0.0)
    shift = np.array([30.0, -20.0, 10.0])
    mesh = build_mesh(box(), (1e-3 * np.eye(3), shift))
    distance, gradient = signed_distance(mesh, shift + 1e-3 * points)
    # float32 may take the farther of two nearly equally near faces; the rest is float64
    np.testing.assert_allclose(distance, 1e-3 * expected, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(gradient, axis=1), 1.0, atol=1e-14)
    np.testing.assert_array_equal(inside(mesh, shift + 1e-3 * points), expected < 0.0)
    # going down the gradient by the distance ends on the surface
    on_surface = shift + 1e-3 * points - distance[:, None] * gradient
    np.testing.assert_allclose(signed_distance(mesh, on_surface)[0], 0.0, atol=1e-12)


def test_gradient_leads_to_the_surface_at_edges_seen_from_inside():
    # the rim of the neck stands into the hourglass: the closest point to many inner points is on an edge
    mesh = load_mesh(MESHES / "hourglass.stl")
    points = np.random.default_rng(4).uniform(-1.0, 1.0, (2000, 3)) * [5.0, 5.0, 3.0]
    distance, gradient = signed_distance(mesh, points)
    assert (distance < 0.0).sum() > 500
    on_surface = signed_distance(mesh, points - distance[:, None] * gradient)[0]
    np.testing.assert_allclose(on_surface, 0.0, atol=1e-5)


def test_distance_to_a_sphere_of_triangles():
    ball = trimesh.creation.icosphere(subdivisions=4)
    points = np.random.default_rng(2).normal(size=(2000, 3))
    points *= (np.random.default_rng(3).uniform(0.2, 2.0, 2000) / np.linalg.norm(points, axis=1))[:, None]
    expected = np.linalg.norm(points, axis=1) - 1.0
    distance, _ = signed_distance(build_mesh(np.array(ball.triangles)), points)
    # the flat triangles stand back by at most h^2 / 6, h their edge
    np.testing.assert_allclose(distance, expected, atol=1.5e-3)
    clear = np.abs(expected) > 1.5e-3
    np.testing.assert_array_equal((distance < 0)[clear], (expected < 0)[clear])


def test_inside_does_not_depend_on_which_way_the_normals_point():
    mesh = build_mesh(box()[:, ::-1])
    assert mesh.volume < 0.0
    np.testing.assert_array_equal(inside(mesh, [[0.0, 0.0, 0.0], [0.6, 1.1, 1.6], [0.0, 0.0, 1.6]]), [1, 0, 0])


def test_volume_clipped_by_a_box_is_exact():
    mesh = build_mesh(box(), (1e-3 * np.eye(3), np.zeros(3)))
    region = 1e-3 * np.array([[-0.1, -0.3, -9.0], [0.2, 0.5, 0.7]])
    np.testing.assert_allclose(clipped_volume(mesh, region), 0.3 * 0.8 * 2.2 * 1e-9, rtol=1e-13)
    np.testing.assert_allclose(clipped_volume(mesh, 10.0 * mesh.bounds), mesh.volume, rtol=1e-13)
    # the octant of a ball, and its half between two heights
    ball = build_mesh(np.array(trimesh.creation.icosphere(subdivisions=3).triangles))
    np.testing.assert_allclose(clipped_volume(ball, [[0, 0, 0], [2, 2, 2]]), ball.volume / 8, rtol=1e-3)
    np.testing.assert_allclose(clipped_volume(ball, [[-2, -2, -0.5], [2, 2, 0.5]]), math.pi * 11 / 12, rtol=1e-2)
    assert clipped_volume(ball, [[1.5, 1.5, 1.5], [2, 2, 2]]) == pytest.approx(0.0, abs=1e-14)
