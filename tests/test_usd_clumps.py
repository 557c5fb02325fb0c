"""Clumps in USD results: instances where the run has them, their surfaces, and frames that are scenes again."""

import tomllib
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pxr import Usd, UsdGeom

import warpdem
from warpdem.app.run import run_scene
from warpdem.filling.initial_grains import load_grains
from warpdem.mesh.sphere_mesh import union_mesh
from warpdem.usd.clump_groups import clump_groups

SCENE = """
gravity = [0, 0, -9.81]
frame = { axis = [0, 1, 0], rate = "60 rpm" }
time = { end = 0.02, step = "20 us" }
output = { formats = ["usd", "vtk"], interval = 0.01 }
materials.a = { density = 1000, young_modulus = "5 MPa", poisson_ratio = 0.3 }
materials.b = { density = 3000, young_modulus = "5 MPa", poisson_ratio = 0.3 }
pairs = [
  { materials = ["a", "a"], restitution = 0.5 }, { materials = ["a", "b"], restitution = 0.5 },
  { materials = ["b", "b"], restitution = 0.5 },
]
[clumps.hook]
spheres = [{ centre = [0, 0, 0], radius = "2 mm" }, { centre = ["3 mm", 0, 0], radius = "1.5 mm" },
           { centre = ["3 mm", "3 mm", 0], radius = "1 mm" }]
[clumps.pair]
spheres = [{ centre = [0, 0, "1 cm"], radius = "1 mm" }, { centre = [0, 0, "1.1 cm"], radius = "1 mm" }]
[clumps.spare]
spheres = [{ centre = [0, 0, 0], radius = 1 }, { centre = [1, 0, 0], radius = 1 }]
[[grains]]
name = "first"
material = "b"
clump = "pair"
positions = [[0, 0, 0.05], [0.02, 0, 0.05]]
orientations = [[1, 0, 0, 0], [1, 2, 3, 4]]
sizes = [1, 1.5]
spins = [[10, 0, 5], [0, 200, 0]]
[[grains]]
material = "a"
radius = "1 mm"
positions = [[0, 0.03, 0]]
velocities = [[0.1, 0, 0]]
[[grains]]
material = "a"
clump = "hook"
positions = [[0.02, 0.02, 0]]
spins = [[30, 40, 50]]
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The folder of a run, and its last snapshot."""
    folder = tmp_path_factory.mktemp("clumps")
    (folder / "scene.toml").write_text(SCENE)
    sim = run_scene(warpdem.load_scene(folder / "scene.toml"), folder / "out", device="cpu", threads=1)
    return folder / "out", sim.snapshot()


def test_instances_place_the_surfaces_where_the_members_are(made):
    folder, snapshot = made
    stage = Usd.Stage.Open(str(folder / "result.usda"))
    code = stage.GetEndTimeCode()
    instancer = UsdGeom.PointInstancer.Get(stage, "/World/Frame/Clumps")
    places = instancer.ComputeInstanceTransformsAtTime(code, code, UsdGeom.PointInstancer.ExcludeProtoXform)
    paths = instancer.GetPrototypesRel().GetTargets()
    assert len(places) == len(snapshot.clumps.id) == 3
    for k, matrix in enumerate(places):
        mesh = UsdGeom.Mesh.Get(stage, paths[instancer.GetProtoIndicesAttr().Get(code)[k]])
        points = np.array(mesh.GetPointsAttr().Get()) @ np.array(matrix)[:3, :3] + np.array(matrix)[3, :3]
        member = snapshot.clump == snapshot.clumps.id[k]
        apart = np.linalg.norm(points[:, None] - snapshot.position[member][None], axis=2) - snapshot.radius[member]
        assert_allclose(np.abs(apart).min(axis=1), 0.0, atol=2e-6 * np.abs(points).max())  # half floats would be 1e-3 off
    spins = np.array(instancer.GetAngularVelocitiesAttr().Get(code))
    assert_allclose(np.radians(spins), snapshot.clumps.spin, rtol=1e-5, atol=1e-4)
    grains = UsdGeom.Points.Get(stage, "/World/Frame/Grains")
    assert_allclose(np.array(grains.GetPointsAttr().Get(code)), snapshot.position[snapshot.clump < 0], atol=1e-8)


def test_a_frame_is_a_scene_again(made):
    folder, snapshot = made
    scene = warpdem.load_scene(folder / "result.usda", overrides=["time.end=0.01"])
    assert not any("Clumps" in note for note in scene.notes)
    again = warpdem.Simulation(scene, device="cpu", threads=1).snapshot()
    same(again, snapshot)
    assert "first" in scene.groups


def same(again, snapshot):
    """Whether grains and clumps are the same, whose ids are given anew."""
    order, there = (np.lexsort(np.round(one.position, 6).T) for one in (again, snapshot))
    for name in ("radius", "mass", "position", "velocity", "spin", "type"):
        assert_allclose(getattr(again, name)[order], getattr(snapshot, name)[there], rtol=1e-9, atol=1e-12)
    order, there = np.argsort(again.clumps.mass), np.argsort(snapshot.clumps.mass)
    for name in ("mass", "radius", "members", "position", "velocity", "spin", "type", "orientation", "angular_momentum"):
        assert_allclose(getattr(again.clumps, name)[order], getattr(snapshot.clumps, name)[there], rtol=1e-9, atol=1e-12)


def from_vtk(folder, tmp_path, **changes):
    """The scene that starts from the last frame in VTK."""
    data = tomllib.loads(SCENE)
    # a frame stands in its own axes, and so does the new run: only its own motion is left
    data["grains"] = [
        {"material": "b", "clump": "pair", "file": "clumps_000002.vtp"},
        {"material": "a", "file": "grains_000002.vtp"},
        {"material": "a", "clump": "hook", "file": "clumps_000002.vtp"},
    ]
    data["grains"][0] |= changes
    return warpdem.Scene.model_validate({**data, "base": folder})


def test_a_frame_in_vtk_brings_its_clumps_and_spheres(made, tmp_path):
    folder, snapshot = made
    same(warpdem.Simulation(from_vtk(folder, tmp_path), device="cpu", threads=1).snapshot(), snapshot)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"file": "grains_000002.vtp"}, r"grains\[0\].file: grains_000002.vtp: has no point array orientation"),
        ({"file": "none.vtp"}, "no such state file"),
        ({"file": "g.csv"}, "clumps come from clumps_"),
        ({"clump": "spare"}, "holds no clump of the type 2, which 'spare' is in the scene; it holds those of 0, 1"),
    ],
)
def test_files_without_the_clumps_are_named(made, tmp_path, changes, reason):
    with pytest.raises(warpdem.SceneError, match=reason):
        scene = from_vtk(made[0], tmp_path, **changes)
        load_grains(scene, {})


def test_the_surface_of_a_union_has_no_triangle_inside():
    centre, radius = np.array([[0.0, 0, 0], [1.0, 0, 0], [0.3, 0, 0]]), np.array([1.0, 0.7, 0.2])
    mesh = union_mesh(centre, radius)
    corners = mesh.vertices[mesh.triangles]
    inside = np.linalg.norm(corners[:, :, None] - centre, axis=3) < radius - 1e-6
    assert not inside.any(axis=2).all(axis=1).any()
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum("ti,ti->t", normal, mesh.normals[mesh.triangles[:, 0]]) > 0.0).all()
    area = 0.5 * np.linalg.norm(normal, axis=1).sum()
    along = 0.5 * (1.0 + 1.0 - 0.49)  # of the circle where the two meet, from the first
    wanted = 2.0 * np.pi * 1.0 * (1.0 + along) + 2.0 * np.pi * 0.7 * (0.7 + 1.0 - along)
    assert wanted < area < 1.06 * wanted  # triangles that cross the circle are whole


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("clumps", None, "primvars:dem:clumps: missing"),
        ("sizes", np.ones(1), "its arrays have different numbers"),
        ("types", np.array([0, 7]), "primvars:dem:types: holds 7, must be from 0 to 1"),
    ],
)
def test_damaged_arrays_are_named(name, value, message):
    whole = {"positions": 3, "velocities": 3, "spins": 3, "orientations": 4}
    arrays = {f"dem.{key}": np.ones((2, width)) for key, width in whole.items()} | {"dem.sizes": np.ones(2)}
    arrays |= {f"dem.{key}": np.zeros(2, int) for key in ("clumps", "types", "groups")}
    names = ["pair"], ["a", "b"], ["first"]
    assert len(list(clump_groups(Path("result.usda"), "/Clumps", arrays, *names))) == 1
    arrays[f"dem.{name}"] = value
    if value is None:
        del arrays[f"dem.{name}"]
    with pytest.raises(warpdem.SceneError, match=message):
        list(clump_groups(Path("result.usda"), "/Clumps", arrays, *names))
