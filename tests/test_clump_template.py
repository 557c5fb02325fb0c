"""Clumps of a scene: templates, members, and every mistake in words."""

import numpy as np
import pytest
import trimesh

import warpdem
from warpdem.filling.clump_grains import InitialClumps
from warpdem.filling.clump_template import clump_templates
from warpdem.filling.initial_grains import load_grains

TWO = [{"centre": [0, 0, 0], "radius": "1 mm"}, {"centre": [0, 0, "2 mm"], "radius": "1 mm"}]


def table(clump, grains=None, **more):
    return {
        "materials": {"stone": {"density": 2500.0, "young_modulus": 5e7, "poisson_ratio": 0.3}},
        "pairs": [{"materials": ["stone", "stone"], "restitution": 0.5}],
        "clumps": {"pea": clump},
        "grains": [{"material": "stone", "clump": "pea", "positions": [[0, 0, 0]], **(grains or {})}],
        "time": {"end": 1.0}, "output": {"formats": ["vtk"]}, **more,
    }  # fmt: skip


def template(clump, base=None):
    scene = warpdem.Scene.model_validate(table(clump) | ({"base": base} if base else {}))
    return clump_templates(scene)["pea"]


def test_a_dumbbell_is_a_body_of_revolution_about_its_axis():
    found = template({"spheres": TWO})
    np.testing.assert_allclose(found.moments, [1.4e-6, 1.4e-6, 0.4e-6], rtol=1e-12)
    assert found.moments[0] == found.moments[1]
    np.testing.assert_allclose(found.arm, [[0, 0, -1e-3], [0, 0, 1e-3]], rtol=0, atol=1e-17)
    assert found.mass_at(2500.0) == pytest.approx(2500.0 * 2.0 * 4.0 / 3.0 * np.pi * 1e-9, rel=1e-13)
    assert found.parts == 1


def test_equal_moments_come_first_and_equal_to_the_bit():
    disc = template({"spheres": [
        {"centre": [np.cos(a), np.sin(a), 0.3], "radius": 0.6} for a in (0.1, 0.1 + np.pi / 2, 0.1 + np.pi, 0.1 + 3 * np.pi / 2)
    ]})  # fmt: skip
    assert disc.moments[0] == disc.moments[1] < disc.moments[2]
    np.testing.assert_allclose(disc.arm[:, 2], 0.0, rtol=0, atol=1e-12)
    ball = template({"spheres": [{"centre": c, "radius": 1.0} for c in ([1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1])]})
    assert ball.moments[0] == ball.moments[1] == ball.moments[2]
    np.testing.assert_array_equal(ball.axes, [1, 0, 0, 0])


def test_principal_axes_lead_back_to_the_axes_of_the_scene():
    rng = np.random.default_rng(0)
    spheres = [{"centre": rng.normal(size=3).tolist(), "radius": float(r)} for r in rng.uniform(1.0, 2.0, 4)]
    found = template({"spheres": spheres})
    w, v = found.axes[0], found.axes[1:]
    turned = found.arm + 2.0 * np.cross(v, np.cross(v, found.arm) + w * found.arm)
    apart = turned - turned[0]
    np.testing.assert_allclose(apart, np.array([s["centre"] for s in spheres]) - spheres[0]["centre"], rtol=0, atol=1e-13)


def test_mass_properties_of_a_mesh_and_given_ones(tmp_path):
    trimesh.creation.box([4e-3, 2e-3, 2e-3]).apply_translation([1e-3, 0, 0]).export(tmp_path / "box.stl")
    spheres = [{"centre": [0, 0, 0], "radius": 1e-3}, {"centre": [2e-3, 0, 0], "radius": 1e-3}]
    box = template({"spheres": spheres, "inertia": "mesh", "mesh": "box.stl"}, tmp_path)
    assert box.volume == pytest.approx(16e-9, rel=1e-6)
    np.testing.assert_allclose(box.moments, np.array([20.0, 20.0, 8.0]) / 12.0 * 1e-6, rtol=1e-6)
    np.testing.assert_allclose(np.sort(box.arm[:, 2]), [-1e-3, 1e-3], rtol=0, atol=1e-9)
    given = template({
        "spheres": spheres, "inertia": "given", "mass": "2 g", "moments": [3e-9, 1e-9, 2e-9], "centre": ["1 mm", 0, 0],
        "axes": [1, 1, 0, 0],
    })  # fmt: skip
    assert given.mass_at(1.0) == given.mass_at(9.0) == 2e-3
    np.testing.assert_allclose(given.moments * 2e-3, [1e-9, 2e-9, 3e-9], rtol=1e-14)


def test_spheres_from_a_file(tmp_path):
    (tmp_path / "pea.csv").write_text("x,y,z,radius\n0,0,0,0.001\n0,0,0.002,0.001\n")
    np.testing.assert_array_equal(template({"file": "pea.csv"}, tmp_path).arm, template({"spheres": TWO}).arm)


def test_members_lie_and_move_as_the_clump():
    half = np.sqrt(0.5)
    grains = {
        "positions": [[0, 0, 0], [1.0, 2.0, 3.0]], "velocities": [[0, 0, 0], [1, 0, 0]], "spins": [[0, 0, 0], [0, 10, 0]],
        "orientations": [[2, 0, 0, 0], [half, half, 0, 0]], "sizes": [1.0, 2.0],
    }  # fmt: skip
    scene = warpdem.Scene.model_validate(table({"spheres": TWO}, grains))
    found = load_grains(scene, {})
    assert isinstance(found.clumps, InitialClumps)
    np.testing.assert_allclose(found.position[:2], [[0, 0, -1e-3], [0, 0, 1e-3]], rtol=0, atol=1e-17)
    # turned by 90 degrees about x: +z becomes -y; twice as large
    np.testing.assert_allclose(found.position[2:] - [1, 2, 3], [[0, 2e-3, 0], [0, -2e-3, 0]], rtol=0, atol=1e-15)
    np.testing.assert_allclose(found.velocity[2:], [[1.0, 0, 0], [1.0, 0, 0]], rtol=0, atol=1e-15)
    np.testing.assert_array_equal(found.radius, [1e-3, 1e-3, 2e-3, 2e-3])
    np.testing.assert_allclose(found.clumps.mass[1] / found.clumps.mass[0], 8.0)
    np.testing.assert_allclose(found.clumps.moments[1] / found.clumps.moments[0], 32.0)
    np.testing.assert_array_equal(found.clumps.of_grain, [0, 0, 1, 1])
    np.testing.assert_array_equal(found.id, [0, 1, 2, 3])


def test_ids_of_the_members_follow_each_other_beside_given_ones():
    made = table({"spheres": TWO}, {"positions": [[0, 0, 0], [0.1, 0, 0]]})
    made["grains"].append({"material": "stone", "positions": [[0, 0.1, 0], [0, 0.2, 0]], "radius": 1e-3, "ids": [1, 7]})
    np.testing.assert_array_equal(load_grains(warpdem.Scene.model_validate(made), {}).id, [8, 9, 10, 11, 1, 7])


def test_the_mass_that_a_force_on_a_member_meets():
    """1/m + r^2/I at the end of the arm, and its share of the mass at most."""
    one = 2500.0 * 4.0 / 3.0 * np.pi * 1e-9
    light = {"spheres": TWO, "inertia": "given", "mass": 2.0 * one, "moments": [0.5e-6 * one] * 3, "centre": [0, 0, "1 mm"]}
    for clump, least in ((light, 0.4 * one), ({"spheres": TWO}, one)):
        found = load_grains(warpdem.Scene.model_validate(table(clump)), {})
        np.testing.assert_allclose(found.clumps.least_mass(found.radius), least, rtol=1e-12)
        np.testing.assert_allclose(found.clumps.member_mass(found.radius), one, rtol=1e-12)


def test_a_clump_in_pieces_is_allowed_and_noted():
    spheres = [{"centre": [0, 0, 0], "radius": 1e-3}, {"centre": [0, 0, 5e-3], "radius": 1e-3}]
    found = load_grains(warpdem.Scene.model_validate(table({"spheres": spheres})), {})
    assert any("clumps.pea: its spheres are 2 groups that do not touch" in note for note in found.notes)


GIVEN = {"spheres": TWO, "inertia": "given", "mass": 1e-3, "moments": [1e-9, 1e-9, 1e-9]}


@pytest.mark.parametrize(
    ("clump", "reason"),
    [
        ({"spheres": []}, "at least 2, are 0"),
        ({"spheres": TWO[:1]}, "single sphere is a grain without a clump"),
        ({"spheres": [TWO[0], TWO[0]]}, r"spheres\[0\]: leave it out"),
        ({}, "exactly one of spheres, file"),
        ({"spheres": TWO, "inertia": "mesh"}, "mesh.*\n.*missing"),
        ({"spheres": TWO, "mesh": "a.stl"}, 'inertia = "mesh" only'),
        ({"spheres": TWO, "inertia": "given", "mass": 1.0}, "moments.*\n.*missing"),
        ({"spheres": TWO, "mass": 1.0}, 'inertia = "given" only'),
        ({**GIVEN, "moments": [1e-9, 1e-9, 3e-9]}, "no body has these"),
        ({**GIVEN, "axes": [0, 0, 0, 0]}, "must not be zero"),
        ({**GIVEN, "moments": [1e-9, "3 g", 1e-9]}, "moment of inertia"),
    ],
)
def test_wrong_clumps_are_named(clump, reason):
    with pytest.raises(warpdem.SceneError, match=reason) as error:
        warpdem.Scene.model_validate(table(clump))
    assert "clumps.pea" in str(error.value)


@pytest.mark.parametrize(
    ("grains", "more", "reason"),
    [
        ({"clump": "bean"}, {}, 'no such clump; the scene has "pea"'),
        ({"radius": 1e-3}, {}, "cannot be given with clump"),
        ({"ids": [3]}, {}, "cannot be given with clump"),
        ({"sizes": [1.0, 2.0]}, {}, "as many entries as positions"),
        ({"orientations": [[0, 0, 0, 0]]}, {}, "must not be zero"),
        ({"clump": None, "radius": 1e-3, "sizes": [1.0]}, {}, "belongs to a clump"),
        ({}, {"engine": {"integrator": "rk4"}}, "engine.integrator.*\n.*exact_drift"),
        ({}, {"engine": {"precision": "mixed"}}, "engine.precision.*\n.*double"),
        ({}, {"contact": {"rolling": "spring"}}, "contact.rolling.*\n.*shape"),
    ],
)
def test_what_clumps_cannot_be_with_is_named(grains, more, reason):
    with pytest.raises(warpdem.SceneError, match=reason):
        warpdem.Scene.model_validate(table({"spheres": TWO}, grains, **more))


def test_a_period_below_two_lengths_of_a_clump_is_refused():
    """By its bounding sphere: with the largest member it would pass."""
    borders = {"x": {"kind": "periodic", "min": -3e-3, "max": 3e-3}}
    made = warpdem.Scene.model_validate(table({"spheres": TWO}, {}, borders=borders))
    with pytest.raises(warpdem.SceneError, match=r"borders.x: its length of 0.006 m is below 2.05 .* clump, end to end"):
        warpdem.Simulation(made, device="cpu")


@pytest.mark.parametrize(("height", "reason"), [(0.0, "enclose|thickness|closed"), (None, "closed|open")])
def test_meshes_without_an_inside_are_refused(tmp_path, height, reason):
    mesh = trimesh.creation.box([1e-3, 1e-3, 1e-3])
    if height is None:
        mesh.update_faces(np.arange(len(mesh.faces)) > 1)
    else:
        mesh.vertices[:, 2] = 0.0
    mesh.export(tmp_path / "thin.stl")
    with pytest.raises(warpdem.SceneError, match=reason):
        template({"spheres": TWO, "inertia": "mesh", "mesh": "thin.stl"}, tmp_path)


@pytest.mark.parametrize(
    ("text", "reason"),
    [("x,y,z,radius\n0,0,0,1\n", "at least 2"), ("x,y,z,radius\n0,0,0,1\n0,0,0,1\n", "twice"), ("x,y,z\n0,0,0\n", "radius")],
)
def test_wrong_files_are_named(tmp_path, text, reason):
    (tmp_path / "pea.csv").write_text(text)
    with pytest.raises(warpdem.SceneError, match=f"(?s)clumps.pea.file.*{reason}"):
        template({"file": "pea.csv"}, tmp_path)


def test_clumps_that_overlap_at_the_start_are_refused():
    scene = warpdem.Scene.model_validate(table({"spheres": TWO}, {"positions": [[0, 0, 0], [1e-3, 0, 1e-3]]}))
    with pytest.raises(warpdem.SceneError, match="overlap by"):
        warpdem.Simulation(scene, device="cpu")
