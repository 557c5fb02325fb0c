"""Spheres fitted to meshes: within them, more volume with more spheres, and measured as the spheres are."""

import numpy as np
import pytest
import trimesh

import warpdem
from warpdem.filling.clump_template import clump_templates
from warpdem.mesh.sphere_fit import fit_spheres
from warpdem.mesh.sphere_union import union_of_spheres
from warpdem.mesh.triangle_mesh import load_mesh, signed_distance


@pytest.fixture(scope="module")
def box(tmp_path_factory):
    path = tmp_path_factory.mktemp("fit") / "box.stl"
    trimesh.creation.box([2.0, 1.0, 1.0]).export(path)
    return path


def test_spheres_of_a_box_touch_it_from_within_and_cover_what_they_say(box):
    mesh = load_mesh(box)
    one, eight = fit_spheres(mesh, 1), fit_spheres(mesh, 8)
    assert one.radius[0] == pytest.approx(0.5, rel=0.03)  # a point of the grid beside the middle
    assert len(eight.radius) == 8
    np.testing.assert_allclose(-signed_distance(mesh, eight.centre)[0], eight.radius, rtol=0, atol=1e-12)
    whole = union_of_spheres(eight.centre, eight.radius).volume / 2.0
    assert eight.coverage == pytest.approx(whole, abs=0.01)
    assert eight.coverage > 0.67  # a peer covers 63 % with as many
    assert one.coverage == pytest.approx(np.pi / 12.0, abs=0.01)


def test_deviation_is_that_of_a_sphere_in_a_box(box):
    found = fit_spheres(load_mesh(box), 1)
    corner = np.linalg.norm(np.abs(found.centre[0]) + np.array([1.0, 0.5, 0.5])) - found.radius[0]
    assert found.deviation == pytest.approx(corner, rel=0.03)  # the farthest corner
    rng = np.random.default_rng(0)  # both ends, and the four sides
    sides = [rng.uniform(-1.0, 1.0, (40_000, 3)) * [1.0, 0.5, 0.5] for _ in range(2)]
    sides[0][:, 0] = np.sign(sides[0][:, 0])
    sides[1][:, 1] = 0.5 * np.sign(sides[1][:, 1])
    ends, long = (np.mean(np.linalg.norm(points - found.centre, axis=1)) - found.radius[0] for points in sides)
    assert found.mean_deviation == pytest.approx(0.2 * ends + 0.8 * long, rel=0.02)


def test_more_may_stick_out_and_fewer_may_be_enough(box):
    mesh = load_mesh(box)
    wide = fit_spheres(mesh, 8, outside=0.05)
    np.testing.assert_allclose(wide.radius + signed_distance(mesh, wide.centre)[0], 0.05, rtol=0, atol=1e-12)
    assert wide.coverage > fit_spheres(mesh, 8).coverage + 0.05
    enough = fit_spheres(mesh, 100, coverage=0.6)
    assert enough.coverage >= 0.6 > fit_spheres(mesh, len(enough.radius) - 1).coverage


def scene(box, **clump):
    return warpdem.Scene.model_validate({
        "materials": {"stone": {"density": 2500.0, "young_modulus": 5e7, "poisson_ratio": 0.3}},
        "pairs": [{"materials": ["stone", "stone"], "restitution": 0.5}],
        "clumps": {"brick": {"mesh": "box.stl", **clump}},
        "grains": [{"material": "stone", "clump": "brick", "positions": [[0, 0, 0]]}],
        "time": {"end": 1.0}, "base": box.parent,
    })  # fmt: skip


def test_a_fitted_clump_has_the_mass_of_its_mesh_unless_asked_otherwise(box):
    brick = clump_templates(scene(box, fit={"spheres": 8}, scale=1e-3))["brick"]
    assert brick.volume == pytest.approx(2e-9, rel=1e-6)
    np.testing.assert_allclose(brick.moments, np.array([5.0, 5.0, 2.0]) / 12.0 * 1e-6, rtol=1e-6)
    assert brick.fit is not None
    assert brick.fit.coverage > 0.67
    union = clump_templates(scene(box, fit={"spheres": 3}, inertia="union"))["brick"]
    assert union.volume == pytest.approx(2.0 * union.fit.coverage, rel=0.02)
    assert clump_templates(scene(box, fit={"spheres": 3}, inertia="union"))["brick"] is union  # not fitted again


@pytest.mark.parametrize(
    ("clump", "reason"),
    [
        ({"fit": {"spheres": 1}}, "fit.spheres"),
        ({"fit": {"spheres": 8, "coverage": 1.5}}, "fit.coverage"),
        ({"fit": {"spheres": 8, "outside": -1.0}}, "fit.outside"),
        ({"fit": {"spheres": 8}, "mesh": None}, "missing: fit needs it"),
        ({"fit": {"spheres": 8}, "scale": 0}, "scale"),
        ({"fit": {"spheres": 8, "coverage": 0.1}}, r"1 sphere covers 26\.\d % of box.stl; a clump has at least 2"),
    ],
)
def test_what_cannot_be_fitted_is_named(box, clump, reason):
    with pytest.raises(warpdem.SceneError, match=reason) as error:
        clump_templates(scene(box, **clump))
    assert "clumps.brick" in str(error.value)
