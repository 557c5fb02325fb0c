"""Corners that a file writes in more than one way."""

import numpy as np
import pytest
import trimesh

from warpdem.mesh.triangle_mesh import build_mesh, load_mesh

BALL = np.array(trimesh.creation.icosphere(subdivisions=3, radius=0.02).triangles, np.float32).astype(float)


def spoilt(corners, by, share=0.3, seed=0):
    """Triangles of which a share of all corners is off by up to ``by`` along each axis."""
    rng = np.random.default_rng(seed)
    return corners + by * rng.uniform(-1, 1, corners.shape) * (rng.uniform(size=corners.shape[:2]) < share)[..., None]


def test_a_corner_that_one_facet_writes_as_the_rest_of_a_cosine_is_the_same_point():
    a, b, c, d = np.array([[0.0, 0, 0], [0.02, 0, 0], [0, 0.02, 0], [0, 0, 0.02]])
    corners = np.array([[a, c, b], [a, b, d], [b, c, d], [a, d, c]])
    exact = build_mesh(corners)
    corners[3, 0, 0] = 1.2e-18
    mesh = build_mesh(corners, (np.eye(3) * 0.001, np.zeros(3)))
    assert mesh.is_closed
    assert len(mesh.vertices) == 4
    assert mesh.notes == ("1 corner joined with others at up to 1.2e-21 m: equal within rounding of the file",)
    np.testing.assert_array_equal(mesh.corners, 0.001 * exact.corners)


@pytest.mark.parametrize("far", [0.0, 3.0])
@pytest.mark.parametrize("seed", range(3))
def test_rounding_of_float32_opens_no_mesh_wherever_it_lies(far, seed):
    """Straddling the cells of any grid, and in any order of the triangles."""
    corners = BALL + far
    largest = np.abs(corners).max()
    torn = spoilt(corners, 0.4 * 2.0**-22 * largest, seed=seed).astype(np.float32)
    order = np.random.default_rng(seed).permutation(len(torn))
    for triangles in (torn, torn[order]):
        mesh = build_mesh(triangles)
        assert mesh.is_closed
        assert len(mesh.vertices) == 642
        assert np.abs(mesh.volume / build_mesh(BALL).volume - 1.0) < (1e-5 if far == 0.0 else 1e-2)
    one = np.sort(build_mesh(torn).vertices.view("f8,f8,f8").ravel())
    assert one.tobytes() == np.sort(build_mesh(torn[order]).vertices.view("f8,f8,f8").ravel()).tobytes()


@pytest.mark.parametrize(("digits", "off"), [(7, 0.5e-8), (6, 0.5e-7)])
def test_text_with_few_digits_is_rounded_in_its_last(tmp_path, digits, off):
    lines = ["solid ball"]
    for triangle in spoilt(BALL, off):
        lines += ["facet normal 0 0 0", "outer loop"]
        lines += ["vertex " + " ".join(f"{x:.{digits - 1}e}" for x in corner) for corner in triangle]
        lines += ["endloop", "endfacet"]
    path = tmp_path / "ball.stl"
    path.write_text("\n".join([*lines, "endsolid ball", ""]))
    assert load_mesh(path).is_closed


def test_a_closed_mesh_keeps_features_below_the_rounding():
    """A needle of a box, 1e-9 of its length thick, and a ball of 4e-8 beside it."""
    needle = np.array(trimesh.creation.box((1.0, 1e-9, 1e-9)).triangles)
    mesh = build_mesh(np.concatenate([needle, BALL * 1e-6 + 1e-6]))
    assert len(mesh.vertices) == 8 + 642
    np.testing.assert_array_equal(np.unique(mesh.vertices[:8, 1]), [-0.5e-9, 0.5e-9])
    assert not any("joined" in note for note in mesh.notes)


def test_corners_of_one_triangle_stay_two():
    """A flap on a closed body, with an edge shorter than the rounding: it stays a triangle, and open."""
    a, b, c, d = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    beside = np.array([1e-8, 0.0, 0.0])
    corners = np.array([[a, c, b], [a, b, d], [b, c, d], [a, d, c], [a, beside, [0.5, 0.5, 0.9]]])
    mesh = build_mesh(corners)
    assert len(mesh.vertices) == 6
    assert mesh.open_edges == 3


def test_borders_further_apart_than_the_rounding_stay_borders():
    sheet = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]], [[1, 1e-5, 0], [1, 1, 0], [1e-5, 1, 0]]])
    mesh = build_mesh(np.float32(sheet * 0.7))
    assert len(mesh.vertices) == 6
    assert mesh.notes == ("6 open edges (of one triangle only), the first at (0.35, 0, 0) m",)
