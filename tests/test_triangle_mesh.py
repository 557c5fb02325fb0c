import math
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from warpdem.errors import SceneError
from warpdem.mesh.clipped_volume import clipped_volume
from warpdem.mesh.triangle_mesh import build_mesh, inside, load_mesh, require_closed, signed_distance

MESHES = Path(__file__).resolve().parent.parent / "scenes" / "meshes"


def box(size=(1.0, 2.0, 3.0)):
    """Triangles of a box about the origin, shape (12, 3, 3)."""
    return np.array(trimesh.creation.box(size).triangles)


def test_pose_is_scale_then_rotate_then_translate(tmp_path):
    path = tmp_path / "box.stl"
    trimesh.creation.box((1.0, 2.0, 3.0)).export(path)
    quarter = SimpleNamespace(axis=(0.0, 0.0, 2.0), angle=math.pi / 2)
    mesh = load_mesh(path, 0.1, quarter, (1.0, 0.0, 0.0))
    # the side of 2 along y turns to -x: half widths 0.1 along x, 0.05 along y
    np.testing.assert_allclose(mesh.bounds, [[0.9, -0.05, -0.15], [1.1, 0.05, 0.15]], rtol=0, atol=1e-15)
    np.testing.assert_allclose(mesh.volume, 6e-3, rtol=1e-13)


@pytest.mark.parametrize(
    ("name", "neck", "length", "rim"), [("hourglass", 4.5, 2.2, 16.2), ("hourglass_paper", 2.025, 1.0, 23.2)]
)
def test_hourglass_of_the_scenes_is_one_smooth_piece_and_two_lids(name, neck, length, rim):
    mesh = load_mesh(MESHES / f"{name}.stl", 1e-3)
    require_closed(mesh, "walls[0].mesh", "mend it")
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
    require_closed(mesh, "walls[0].mesh", "mend it")
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


def test_many_triangles_give_the_same_arrays_twice():
    corners = np.array(trimesh.creation.icosphere(subdivisions=4).triangles, np.float32)
    one, two = build_mesh(corners), build_mesh(corners)
    for name in ("vertices", "triangles", "piece", "plane", "plane_normal", "plane_offset"):
        assert getattr(one, name).tobytes() == getattr(two, name).tobytes()
    assert one.piece.max() == 0


def test_open_mesh_is_refused_with_the_place_of_the_hole():
    mesh = build_mesh(box()[1:])
    assert not mesh.is_closed
    assert mesh.open_edges == 3
    with pytest.raises(SceneError, match=r"walls\[2\]\.mesh: mesh: .* 3 open edges .* at \(.*\) m; mend it$") as caught:
        require_closed(mesh, "walls[2].mesh", "mend it")
    place = [float(v) for v in re.search(r"at \((.*?)\) m", str(caught.value))[1].split(",")]
    gone = box()[0]
    middles = 0.5 * (gone + np.roll(gone, -1, axis=0))
    assert np.linalg.norm(middles - place, axis=1).min() < 1e-5


def test_surface_with_one_side_is_refused():
    # the projective plane of six corners: each edge joins two triangles, and yet no winding fits
    faces = "123 124 135 146 156 236 245 256 345 346"
    corners = np.random.default_rng(0).normal(size=(7, 3))[np.array([[int(c) for c in f] for f in faces.split()])]
    mesh = build_mesh(corners)
    assert mesh.is_closed
    assert mesh.flipped == 0
    with pytest.raises(SceneError, match=r"[1-9] edges whose two triangles have inconsistent windings"):
        require_closed(mesh, "walls[0].mesh", "mend it")
    for way in (1, -1):  # nor is it known which way a body beside it should be wound
        assert build_mesh(np.concatenate([corners, 0.1 * box()[:, ::way] + 9.0])).flipped == 0
    require_closed(build_mesh(box()), "walls[0].mesh", "mend it")


def test_what_was_mended_is_noted_with_count_and_place():
    corners = box()
    corners[4] = corners[4, ::-1]
    shift = np.array([10.0, 20.0, 30.0])
    flat = np.tile(corners[0, :1], (1, 3, 1))
    with np.errstate(all="raise"):
        mesh = build_mesh(np.concatenate([corners, corners[:2], flat]), (np.eye(3), shift), notes=("as read",))
    assert (mesh.dropped, mesh.duplicates, mesh.flipped) == (1, 2, 1)
    assert len(mesh.triangles) == 12
    np.testing.assert_allclose(mesh.volume, 6.0, rtol=1e-12)

    def at(triangle):
        return re.escape("at (" + ", ".join(f"{v:.6g}" for v in triangle.mean(axis=0) + shift) + ") m")

    read, dropped, twice, turned = mesh.notes
    assert read == "as read"
    assert re.fullmatch(f"1 triangle without area left out, the first {at(flat[0])}", dropped)
    assert re.fullmatch(f"2 triangles given twice left out, the first {at(corners[0])}", twice)
    assert re.fullmatch(f"1 triangle of wrong winding flipped, the first {at(corners[4])}", turned)
    assert build_mesh(box()).notes == ()


def test_lid_that_folds_back_onto_itself_is_noted():
    """A prism whose lids are fans from a point that does not see all of their outline."""
    outline = np.array([[2, -1], [1, -2], [1, 2], [2, 1], [-2, 2], [-2, -2.0]])
    lids = [np.column_stack([outline, np.full(6, z)]) for z in (0.0, 1.0)]
    low, high = (np.stack([np.broadcast_to([0, 0, z], (6, 3)), lid, np.roll(lid, -1, axis=0)], axis=1)
                 for z, lid in zip((0.0, 1.0), lids, strict=True))  # fmt: skip
    below, above = (np.stack([lid, np.roll(lid, -1, axis=0)], axis=1) for lid in lids)
    corners = (below[:, 0], below[:, 1], above[:, 1]), (below[:, 0], above[:, 1], above[:, 0])
    sides = [np.stack(three, axis=1) for three in corners]
    mesh = build_mesh(np.concatenate([low[:, ::-1], high, *sides]))
    assert mesh.is_closed and mesh.folded_edges == 8
    assert any(note.startswith("8 edges at which the surface folds back onto itself") for note in mesh.notes)
    assert build_mesh(trimesh.creation.annulus(r_min=1.0, r_max=1.0001, height=1.0).triangles).folded_edges == 0


def test_edges_of_three_triangles_are_told_from_borders():
    # a sheet that stands on the bottom of the box, along its diagonal
    corners = box()
    bottom = corners[(corners[:, :, 2] == -1.5).all(axis=1)][0]
    length = np.linalg.norm(np.roll(bottom, -1, axis=0) - bottom, axis=1)
    k = int(np.argmax(length))
    a, b = bottom[k], bottom[(k + 1) % 3]
    sheet = np.array([[a, b, [0.0, 0.0, 0.5]]])
    mesh = build_mesh(np.concatenate([corners, sheet]))
    assert (mesh.open_edges, mesh.nonmanifold_edges) == (2, 1)
    assert not mesh.is_closed
    assert any("1 edges at which three or more triangles meet, the first at (0, 0, -1.5) m" in n for n in mesh.notes)
    with pytest.raises(SceneError, match="three or more triangles"):
        require_closed(mesh, "walls[0].mesh", "mend it")


def test_mesh_without_area_is_refused():
    with pytest.raises(SceneError, match=r"empty.*2 triangles"):
        build_mesh(np.ones((2, 3, 3)))
    with pytest.raises(SceneError, match="empty"):
        build_mesh(np.arange(9.0).reshape(1, 3, 3))


def test_distance_to_a_box_is_exact_near_far_and_away_from_the_origin():
    points = np.random.default_rng(1).uniform(-2.0, 2.0, (4000, 3))
    out = np.abs(points) - [0.5, 1.0, 1.5]
    expected = np.linalg.norm(np.maximum(out, 0.0), axis=1) + np.minimum(out.max(axis=1), 0.0)
    shift = np.array([30.0, -20.0, 10.0])
    mesh = build_mesh(box(), (1e-3 * np.eye(3), shift))
    distance, gradient = signed_distance(mesh, shift + 1e-3 * points)
    # float32 may take the farther of two nearly equally near faces; the rest is float64
    np.testing.assert_allclose(distance, 1e-3 * expected, rtol=0, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(gradient, axis=1), 1.0, rtol=0, atol=1e-14)
    np.testing.assert_array_equal(inside(mesh, shift + 1e-3 * points), expected < 0.0)
    # going down the gradient by the distance ends on the surface
    on_surface = shift + 1e-3 * points - distance[:, None] * gradient
    np.testing.assert_allclose(signed_distance(mesh, on_surface)[0], 0.0, rtol=0, atol=1e-12)


def test_gradient_leads_to_the_surface_at_edges_seen_from_inside():
    # the rim of the neck stands into the hourglass: the closest point to many inner points is on an edge
    mesh = load_mesh(MESHES / "hourglass.stl")
    points = np.random.default_rng(4).uniform(-1.0, 1.0, (2000, 3)) * [5.0, 5.0, 3.0]
    distance, gradient = signed_distance(mesh, points)
    assert (distance < 0.0).sum() > 500
    on_surface = signed_distance(mesh, points - distance[:, None] * gradient)[0]
    np.testing.assert_allclose(on_surface, 0.0, rtol=0, atol=1e-5)


def test_distance_to_a_sphere_of_triangles():
    ball = trimesh.creation.icosphere(subdivisions=4)
    points = np.random.default_rng(2).normal(size=(2000, 3))
    points *= (np.random.default_rng(3).uniform(0.2, 2.0, 2000) / np.linalg.norm(points, axis=1))[:, None]
    expected = np.linalg.norm(points, axis=1) - 1.0
    distance, _ = signed_distance(build_mesh(np.array(ball.triangles)), points)
    # the flat triangles stand back by at most h^2 / 6, h their edge
    np.testing.assert_allclose(distance, expected, rtol=0, atol=1.5e-3)
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
