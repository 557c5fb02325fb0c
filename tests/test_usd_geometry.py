"""Surfaces of USD stages: units, axes, transforms, instances and shapes; the run is that of the STL file."""

import io
import json
import math
from pathlib import Path

import numpy as np
import pytest
import trimesh
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, UsdUtils, Vt
from rich.console import Console

from usd_stages import define_loose_mesh
from warpdem import Scene, SceneError, Simulation
from warpdem.app.check import describe
from warpdem.app.run import run_scene
from warpdem.mesh import usd_geometry
from warpdem.mesh.triangle_mesh import build_mesh, load_mesh
from warpdem.mesh.usd_geometry import shape_triangles
from warpdem.usd import motion as usd_motion

MESH = np.array(trimesh.creation.icosphere(subdivisions=1, radius=0.1).triangles, np.float32)
"""Triangles of a ball [m], z upwards; none of its coordinates is special."""


def new_stage(path, metres=1.0, up="Z"):
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, metres)
    UsdGeom.SetStageUpAxis(stage, up)
    return stage


def drum(path, name="Drum"):
    """MESH in a stage in centimetres with y upwards, in nested transforms of which one has samples.

    The shifts cancel and the scale leaves a power of two for the points, so that float32 rounds nothing.
    """
    stage = new_stage(path, 0.01, "Y")
    world = UsdGeom.Xform.Define(stage, "/World")
    world.AddTranslateOp().Set(Gf.Vec3d(30.0, 20.0, -10.0))
    world.AddRotateXOp().Set(-90.0)
    turn = UsdGeom.Xform.Define(stage, "/World/Turn").AddRotateZOp()
    turn.Set(90.0, 0.0)
    turn.Set(180.0, 24.0)
    around = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]]) @ np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    far = UsdGeom.Xform.Define(stage, "/World/Turn/Far")
    far.AddTranslateOp().Set(Gf.Vec3d(*map(float, -np.array([30, 20, -10]) @ around)))
    far.AddScaleOp().Set(Gf.Vec3f(50.0))
    y_up = np.stack([MESH[..., 0], MESH[..., 2], -MESH[..., 1]], axis=-1)
    define_loose_mesh(stage, f"/World/Turn/Far/{name}", 2.0 * y_up @ around)
    stage.Save()


def scene(mesh, **keys):
    rng = np.random.default_rng(0)
    return Scene.model_validate(
        {
            "materials": {"g": {"density": 2500.0, "young_modulus": 5e6, "poisson_ratio": 0.3}},
            "pairs": [{"materials": ["g", "g"], "restitution": 0.5, "friction": 0.5}],
            "grains": [{"material": "g", "positions": rng.uniform(-0.03, 0.03, (6, 3)), "radius": 0.005}],
            "walls": [{"name": "drum", "material": "g", "mesh": str(mesh), **keys}],
            "engine": {"max_overlap": 0.5},
            "time": {"end": 1.0, "step": 2e-5, "max_speed": 2.0},
        }
    )


def write_stl(path, corners):
    number = np.arange(3 * len(corners)).reshape(-1, 3)
    trimesh.Trimesh(corners.reshape(-1, 3), number, process=False).export(path)


@pytest.mark.parametrize("suffix", ["usda", "usdz"])
def test_stage_in_centimetres_with_y_upwards_gives_the_points_of_the_stl_in_metres(tmp_path, suffix):
    path = tmp_path / f"drum.{suffix}"
    drum(tmp_path / ("drum.usdc" if suffix == "usdz" else "drum.usda"))
    if suffix == "usdz":
        UsdUtils.CreateNewUsdzPackage(str(tmp_path / "drum.usdc"), str(path))
    corners, notes = usd_geometry.read_triangles(path, "", "walls[0].mesh")
    np.testing.assert_array_equal(corners, MESH)
    assert notes == ("/World/Turn/Far/Drum is used at time 0; with wall.motion = {usd, prim} it follows its time samples",)


def test_run_is_that_of_the_stl_bit_for_bit(tmp_path):
    drum(tmp_path / "drum.usdc")
    write_stl(tmp_path / "drum.stl", MESH)
    usd, stl = load_mesh(tmp_path / "drum.usdc"), load_mesh(tmp_path / "drum.stl")
    for name in ("vertices", "triangles", "piece", "plane", "plane_normal", "plane_offset"):
        assert getattr(usd, name).tobytes() == getattr(stl, name).tobytes(), name
    hashes = set()
    for wall in ({"mesh": tmp_path / "drum.usdc", "prim": "/World/Turn"}, {"mesh": tmp_path / "drum.stl"}):
        sim = Simulation(scene(**wall), device="cpu", threads=1)
        sim.run(until=0.16)
        assert sim.extremes["wall_overlap_share"] > 0.0
        hashes.add(sim.state_hash())
    assert len(hashes) == 1


def test_wall_follows_the_samples_of_its_own_prim(tmp_path):
    """Where the motion takes the mesh read at time 0 is where the stage has it later."""
    drum(tmp_path / "drum.usdc")
    path, prim = str(tmp_path / "drum.usdc"), "/World/Turn/Far/Drum"
    stage = Usd.Stage.Open(path)
    matrices = [UsdGeom.XformCache(code).GetLocalToWorldTransform(stage.GetPrimAtPath(prim)) for code in (0.0, 12.0)]
    there = np.array(UsdGeom.Mesh(stage.GetPrimAtPath(prim)).GetPointsAttr().Get(), float)
    later = there @ np.array(matrices[1])[:3, :3] + np.array(matrices[1])[3, :3]
    later = 0.01 * np.stack([later[:, 0], -later[:, 2], later[:, 1]], axis=1)
    motion = usd_motion.read(tmp_path / "drum.usdc", "/World/Turn", "walls[0].motion")
    at = np.array([0.5])  # 24 time codes per second
    pose = motion.pose(at, at)
    moved = MESH.reshape(-1, 3) @ pose.axes[0].astype(float).T + pose.origin[0].astype(float)
    np.testing.assert_allclose(moved, later, rtol=0, atol=1e-8)


def read(stage, prim="", key="walls[0].mesh"):
    stage.Save()
    return usd_geometry.read_triangles(Path(stage.GetRootLayer().realPath), prim, key)


def refusal(stage, prim="") -> str:
    with pytest.raises(SceneError) as caught:
        read(stage, prim)
    return str(caught.value)


def test_instances_are_read_where_they_stand_and_mirrored_ones_keep_their_outside(tmp_path):
    stage = new_stage(tmp_path / "a.usda")
    define_loose_mesh(stage, "/Parts/Ball/Skin", MESH)
    stage.OverridePrim("/Parts").SetSpecifier(Sdf.SpecifierClass)
    for name, shift, scale in (("One", 1.0, (1, 1, 1)), ("Two", 2.0, (-1, 1, 2))):
        xform = UsdGeom.Xform.Define(stage, f"/World/{name}")
        xform.AddTranslateOp().Set(Gf.Vec3d(shift, 0, 0))
        xform.AddScaleOp().Set(Gf.Vec3f(*scale))
        xform.GetPrim().GetReferences().AddInternalReference("/Parts/Ball")
        xform.GetPrim().SetInstanceable(True)
    corners, _ = read(stage, "/World")
    mirrored = MESH * np.array([-1.0, 1.0, 2.0]) + [2.0, 0.0, 0.0]
    expected = np.concatenate([MESH + np.array([1.0, 0, 0]), mirrored[:, ::-1]])
    np.testing.assert_allclose(corners, expected, rtol=0, atol=2e-7)
    one, _ = read(stage, "/World/Two/Skin")
    np.testing.assert_allclose(one, expected[len(MESH) :], rtol=0, atol=2e-7)
    assert "the stage holds 2 surfaces (/World/One/Skin, /World/Two/Skin)" in refusal(stage)


def test_polygons_holes_handedness_and_what_is_left_out(tmp_path):
    stage = new_stage(tmp_path / "a.usda")
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
    mesh = UsdGeom.Mesh.Define(stage, "/World/Floor")
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
    mesh.CreateFaceVertexCountsAttr([3, 4])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 2, 0, 1, 2, 3])
    mesh.CreateHoleIndicesAttr([0])
    mesh.CreateOrientationAttr(UsdGeom.Tokens.leftHanded)
    mesh.CreateSubdivisionSchemeAttr("catmullClark")
    steel = UsdShade.Material.Define(stage, "/Looks/Steel")
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(steel)
    define_loose_mesh(stage, "/World/Hidden", MESH).MakeInvisible()
    define_loose_mesh(stage, "/World/Hull", MESH).CreatePurposeAttr("guide")
    UsdGeom.BasisCurves.Define(stage, "/World/Line")
    corners, notes = read(stage, "/World")
    assert corners.tolist() == [points[[2, 1, 0]].tolist(), points[[3, 2, 0]].tolist()]
    told = " ".join(notes)
    for part in (
        "/World/Hidden (invisible), /World/Hull (purpose guide), /World/Line (BasisCurves has no surface)",
        "its catmullClark subdivision is not evaluated",
        "bound material: /Looks/Steel",
    ):
        assert part in told
    # named itself, a guide is read
    np.testing.assert_array_equal(read(stage, "/World/Hull")[0], MESH)


def test_units_that_the_file_leaves_unsaid_are_those_of_usd_and_are_told(tmp_path):
    stage = Usd.Stage.CreateNew(str(tmp_path / "a.usda"))
    define_loose_mesh(stage, "/Ball", MESH)
    corners, notes = read(stage)
    turned = 0.01 * np.stack([MESH[..., 0], -MESH[..., 2], MESH[..., 1]], axis=-1).astype(float)
    np.testing.assert_allclose(corners, turned, rtol=1e-7)
    assert "metersPerUnit (0.01 then" in notes[0]
    assert "upAxis (Y then" in notes[1]


@pytest.mark.parametrize("axis", ["X", "Y", "Z"])
def test_shapes_have_their_volume_and_the_extent_that_usd_gives_them(tmp_path, axis):
    stage = new_stage(tmp_path / "a.usda")
    sizes = {"radius": 0.5, "height": 3.0}
    volumes = {
        "Cube": ({"size": 2.0}, 8.0),
        "Sphere": ({"radius": 0.5}, math.pi / 6),
        "Cylinder": (sizes, math.pi * 0.75),
        "Cone": (sizes, math.pi * 0.25),
        "Capsule": (sizes, math.pi * (0.75 + 1 / 6)),
        "Plane": ({"width": 2.0, "length": 3.0}, None),
    }
    for kind, (given, volume) in volumes.items():
        shape = getattr(UsdGeom, kind).Define(stage, f"/{kind}")
        for name, value in given.items():
            shape.GetPrim().GetAttribute(name).Set(value)
        if shape.GetPrim().HasAttribute("axis"):
            shape.CreateAxisAttr(axis)
        points, triangles = shape_triangles({"kind": kind, "sizes": given, "axis": axis})
        mesh = build_mesh(points[triangles])
        extent = UsdGeom.Boundable.ComputeExtentFromPlugins(UsdGeom.Boundable(shape), Usd.TimeCode.Default())
        np.testing.assert_allclose(mesh.bounds, np.array(extent), rtol=0, atol=1e-7, err_msg=kind)
        if volume is None:
            assert mesh.plane_normal[0] @ np.eye(3)["XYZ".index(axis)] == pytest.approx(1.0)
        else:
            assert (mesh.open_edges, mesh.nonmanifold_edges, mesh.flipped, mesh.notes) == (0, 0, 0, ())
            np.testing.assert_allclose(mesh.volume, volume, rtol=2e-3 if kind != "Cube" else 1e-12, err_msg=kind)
    if axis == "Y":
        corners, notes = read(stage, "/Cone")
        assert corners[..., 1].max() == 1.5
        assert "/Cone (Cone) was divided into 96 facets" in notes[0]


def test_what_is_no_surface_at_rest_is_refused(tmp_path):
    stage = new_stage(tmp_path / "a.usda")
    assert "it holds no surface" in refusal(stage)
    assert "prim = '/Nowhere': no such prim; there is none" in refusal(stage, "/Nowhere")
    UsdGeom.PointInstancer.Define(stage, "/Many/Balls")
    assert "/Many/Balls is a point instancer" in refusal(stage, "/Many")
    UsdGeom.NurbsPatch.Define(stage, "/Patch")
    assert "/Patch is a NurbsPatch; supported are Mesh" in refusal(stage, "/Patch")
    mesh = define_loose_mesh(stage, "/Bellows", MESH)
    mesh.GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy(MESH.reshape(-1, 3)), 0.0)
    mesh.GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy(2 * MESH.reshape(-1, 3)), 10.0)
    assert "/Bellows: its points change with time" in refusal(stage, "/Bellows")
    define_loose_mesh(stage, "/Odd", MESH).GetFaceVertexIndicesAttr().Set([0, 1, 900])
    assert "/Odd: the faces have" in refusal(stage, "/Odd")
    UsdGeom.Sphere.Define(stage, "/Ball").CreateRadiusAttr(-1.0)
    assert "/Ball: radius = -1, must be above 0" in refusal(stage, "/Ball")
    UsdGeom.Xform.Define(stage, "/Missing").GetPrim().GetReferences().AddReference("./nowhere.usda")
    assert "cannot be composed" in refusal(stage, "/Ball")


def test_notes_reach_the_run_and_its_record(tmp_path):
    """A wall with two triangles twice, and so large that its unit is in doubt: said by the run and kept in run.json."""
    write_stl(tmp_path / "a.stl", 500.0 * np.concatenate([MESH, MESH[:2]]).astype(float))
    of = scene(tmp_path / "a.stl").model_dump() | {"base": tmp_path}
    of["time"]["end"] = of["time"]["step"]
    of["output"] |= {"formats": [], "picture": False}
    (tmp_path / "out").mkdir()
    console = Console(record=True, width=400, file=io.StringIO())
    sim = run_scene(Scene.model_validate(of), tmp_path / "out", device="cpu", threads=1, console=console)
    told = console.export_text()
    kept, described = json.loads((tmp_path / "out" / "run.json").read_text()), describe(sim, probe=False)
    assert kept["notes"] == sim.notes == described["notes"]
    assert len(kept["notes"]) == 1 and "2 triangles given twice left out" in kept["notes"][0]
    assert f"note: {kept['notes'][0]}" in told
    assert kept["warnings"] == described["warnings"]
    (size,) = (warning for warning in kept["warnings"] if "scale = 0.001" in warning)
    assert f"warning {size}" in told
