"""Scenes from USD stages: standard prims, units and axes, what contradicts itself, and what a stage may reach."""

import os
from pathlib import Path

import numpy as np
import pytest
import trimesh
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics, Vt

from usd_stages import MESH, author, collide, define_grains, define_mesh, new_stage, read, refusal
from warpdem import Scene, SceneError, Simulation, load_scene

SCENES = Path(__file__).resolve().parent.parent / "scenes"
START = np.random.default_rng(0).uniform(-0.03, 0.03, (6, 3))


def test_standard_prims_in_centimetres_with_y_upwards():
    scene = load_scene(SCENES / "stirrer.usda")
    assert scene.gravity == (0.0, 0.0, -9.81)
    assert {name: m.density for name, m in scene.materials.items()} == {"Glass": 2500.0, "Steel": 7800.0}
    # from the prim of the pair, and from the material's own numbers
    assert (scene.pair("Glass", "Steel").friction, scene.pair("Glass", "Glass").friction) == (0.3, 0.4)
    assert scene.pair("Glass", "Glass").restitution == 0.6
    box, paddle = scene.walls
    assert (box.name, box.mesh, box.prim, box.motion) == ("Box", "stirrer.usda", "/World/Box", None)
    (turn,) = paddle.motion
    assert (turn.axis, turn.rate) == ((0.0, 0.0, 1.0), pytest.approx(4.0 * np.pi, rel=1e-15))
    assert paddle.fixed_to == "laboratory"
    front, back, large = scene.grains
    assert (front.material, front.name, front.fill.wall, front.fill.count) == ("Glass", "front", "Box", 150)
    assert back.fill.region.min == (-0.02, 0.001, 0.0)
    np.testing.assert_allclose(large.positions[0], [-0.012, 0.012, 0.018], rtol=1e-15)
    np.testing.assert_array_equal(large.explicit_radii, np.full(8, 0.003))


def test_whole_scene_in_centimetres_nested_is_that_of_the_stl_bit_for_bit(tmp_path):
    stage = new_stage(tmp_path / "scene.usda", 0.01, "Y")
    world = UsdGeom.Xform.Define(stage, "/World")
    world.AddTranslateOp().Set(Gf.Vec3d(30.0, 20.0, -10.0))
    world.AddRotateXOp().Set(-90.0)
    far = UsdGeom.Xform.Define(stage, "/World/Far")
    far.AddTranslateOp().Set(Gf.Vec3d(-30.0, -10.0, -20.0))
    far.AddScaleOp().Set(Gf.Vec3f(50.0))
    # the shifts cancel and the scale leaves a power of two, so that single precision rounds nothing
    define_mesh(stage, "/World/Far/drum", 2.0 * MESH)
    y_up = 100.0 * np.stack([START[:, 0], START[:, 2], -START[:, 1]], axis=1)
    grains = define_grains(stage, points=y_up, width=1.0)
    exact = UsdGeom.PrimvarsAPI(grains).CreatePrimvar("dem:positions", Sdf.ValueTypeNames.Double3Array)
    exact.Set(Vt.Vec3dArray.FromNumpy(START))
    usd = read(stage)
    number = np.arange(3 * len(MESH)).reshape(-1, 3)
    trimesh.Trimesh(MESH.reshape(-1, 3), number, process=False).export(tmp_path / "drum.stl")
    stl = Scene.model_validate(
        {
            "materials": {"g": {"density": 2500.0, "young_modulus": 5e6, "poisson_ratio": 0.3}},
            "pairs": [{"materials": ["g", "g"], "restitution": 0.5, "friction": 0.5}],
            "grains": [{"material": "g", "positions": START, "radius": 0.005}],
            "walls": [{"name": "drum", "material": "g", "mesh": str(tmp_path / "drum.stl")}],
            "engine": {"max_overlap": 0.5},
            "time": {"end": 1.0, "step": 2e-5, "max_speed": 2.0},
        }
    )
    hashes = set()
    for scene in (usd, stl):
        sim = Simulation(scene, device="cpu", threads=1)
        sim.run(until=0.16)
        assert sim.extremes["wall_overlap_share"] > 0.0
        hashes.add(sim.state_hash())
    assert len(hashes) == 1


def test_planes_and_spheres_are_analytic_walls(tmp_path):
    stage = new_stage(tmp_path / "a.usda", 0.1, "Y")
    define_grains(stage)
    tilt = UsdGeom.Xform.Define(stage, "/Tilt")
    tilt.AddTranslateOp().Set(Gf.Vec3d(0.0, 1.0, 2.0))
    tilt.AddRotateZOp().Set(30.0)
    floor = collide(UsdGeom.Plane.Define(stage, "/Tilt/floor"))
    floor.CreateAxisAttr("Y")
    ball = collide(UsdGeom.Sphere.Define(stage, "/Tilt/ball"))
    ball.CreateRadiusAttr(0.3)
    ball.AddScaleOp().Set(Gf.Vec3f(2.0))
    bowl = collide(UsdGeom.Sphere.Define(stage, "/bowl"))
    author(bowl.GetPrim(), "inside", Sdf.ValueTypeNames.Bool, True)
    egg = collide(UsdGeom.Sphere.Define(stage, "/egg"))
    egg.AddScaleOp().Set(Gf.Vec3f(1.0, 2.0, 1.0))
    off = collide(UsdGeom.Sphere.Define(stage, "/off"))
    UsdPhysics.CollisionAPI(off.GetPrim()).CreateCollisionEnabledAttr(False)
    walls = {wall.name: wall for wall in read(stage).walls}
    assert set(walls) == {"floor", "ball", "bowl", "egg"}
    np.testing.assert_allclose(walls["floor"].plane.point, [0.0, -0.2, 0.1], rtol=0, atol=1e-16)
    # y upwards to z upwards: (-sin 30, cos 30, 0) in the stage
    np.testing.assert_allclose(walls["floor"].plane.normal, [-0.5, 0.0, np.sqrt(0.75)], rtol=0, atol=1e-15)
    np.testing.assert_allclose(walls["ball"].sphere.radius, 0.06, rtol=1e-15)
    assert (walls["ball"].sphere.inside, walls["bowl"].sphere.inside) == (False, True)
    # no sphere in the world: its facets
    assert (walls["egg"].mesh, walls["egg"].prim) == ("a.usda", "/egg")


def test_bodies_move_by_their_velocities_or_samples(tmp_path):
    stage = new_stage(tmp_path / "a.usda", 0.01, "Y")
    define_grains(stage)
    turned = UsdGeom.Xform.Define(stage, "/Turned")
    turned.AddRotateZOp().Set(90.0)
    body = UsdGeom.Xform.Define(stage, "/Turned/Body")
    body.AddTranslateOp().Set(Gf.Vec3d(10.0, 0.0, 0.0))
    rigid = UsdPhysics.RigidBodyAPI.Apply(body.GetPrim())
    rigid.CreateVelocityAttr(Gf.Vec3f(5.0, 0.0, 0.0))
    rigid.CreateAngularVelocityAttr(Gf.Vec3f(0.0, 90.0, 0.0))
    define_mesh(stage, "/Turned/Body/paddle", MESH)
    swing = define_mesh(stage, "/swing", MESH)
    swing.AddTranslateOp().Set(Gf.Vec3d(1, 0, 0), 0.0)
    swing.GetOrderedXformOps()[0].Set(Gf.Vec3d(2, 0, 0), 24.0)
    rigid.CreateKinematicEnabledAttr(True)
    paddle, swing = read(stage).walls
    shift, turn = paddle.motion
    # 5 cm/s along the parent's x, which is the stage's y, which is up
    np.testing.assert_allclose(shift.velocity, [0.0, 0.0, 0.05], rtol=0, atol=1e-16)
    np.testing.assert_allclose(turn.axis, [-1.0, 0.0, 0.0], rtol=0, atol=1e-15)
    np.testing.assert_allclose([*turn.origin, turn.rate], [0.0, 0.0, 0.1, np.pi / 2], rtol=0, atol=1e-15)
    assert swing.motion[0].usd == "a.usda" and swing.motion[0].prim == "/swing"
    assert paddle.fixed_to == swing.fixed_to == "laboratory"


def test_surfaces_move_along_themselves_by_the_schema_of_physx(tmp_path):
    stage = new_stage(tmp_path / "a.usda", 0.01, "Y")
    define_grains(stage)
    belt = define_mesh(stage, "/belt", MESH)
    belt.AddScaleOp().Set(Gf.Vec3f(2, 2, 2))
    belt.AddRotateZOp().Set(90.0)
    belt.GetPrim().AddAppliedSchema("PhysxSurfaceVelocityAPI")
    velocity = belt.GetPrim().CreateAttribute("physxSurfaceVelocity:surfaceVelocity", Sdf.ValueTypeNames.Vector3f)
    velocity.Set(Gf.Vec3f(5, 0, 0))
    # 5 cm/s along the prim's x, which is the stage's y, which is up; its scale does not count
    np.testing.assert_allclose(read(stage).walls[0].surface_velocity.velocity, [0, 0, 0.05], rtol=0, atol=1e-16)
    local = belt.GetPrim().CreateAttribute("physxSurfaceVelocity:surfaceVelocityLocalSpace", Sdf.ValueTypeNames.Bool)
    local.Set(False)
    np.testing.assert_allclose(read(stage).walls[0].surface_velocity.velocity, [0.05, 0, 0], rtol=0, atol=1e-16)
    own = belt.GetPrim().CreateAttribute("dem:surface_velocity", Sdf.ValueTypeNames.Double3)
    own.Set(Gf.Vec3d(0.05, 0, 0))
    assert read(stage).walls[0].surface_velocity.velocity == (0.05, 0.0, 0.0)
    own.Set(Gf.Vec3d(0.06, 0, 0))
    assert "physxSurfaceVelocity:surfaceVelocity = [0.05" in refusal(stage)
    velocity.Set(Gf.Vec3f(0, 0, 0))
    assert read(stage).walls[0].surface_velocity.velocity == (0.06, 0.0, 0.0)


def test_points_are_grains_with_all_that_usd_knows_of_them(tmp_path):
    stage = new_stage(tmp_path / "a.usda", 0.01, "Y")
    up = UsdGeom.Xform.Define(stage, "/Up")
    up.AddTranslateOp().Set(Gf.Vec3d(0.0, 5.0, 0.0))
    up.AddScaleOp().Set(Gf.Vec3f(2.0))
    grains = define_grains(stage, "/Up/Grains", [(1, 0, 0), (2, 0, 0.5)], width=9.0)
    UsdGeom.PrimvarsAPI(grains).CreatePrimvar("widths", Sdf.ValueTypeNames.FloatArray, "vertex").Set([0.1, 0.2])
    grains.CreateVelocitiesAttr([(0, 1, 0), (0, 0, 1)])
    UsdGeom.PrimvarsAPI(grains).CreatePrimvar("omega", Sdf.ValueTypeNames.Vector3fArray, "vertex").Set([(0, 7, 0), (0, 0, 0)])
    grains.CreateIdsAttr([30, 10])
    (group,) = read(stage).grains
    np.testing.assert_allclose(group.positions, [[0.02, 0, 0.05], [0.04, -0.01, 0.05]], rtol=0, atol=1e-17)
    np.testing.assert_allclose(group.diameters, [0.002, 0.004], rtol=1e-15)
    np.testing.assert_allclose(group.velocities, [[0, 0, 0.02], [0, -0.02, 0]], rtol=0, atol=1e-17)
    np.testing.assert_array_equal(group.spins, [[0, 0, 7], [0, 0, 0]])
    assert (group.material, group.ids.tolist()) == ("g", [30, 10])
    up.GetOrderedXformOps()[1].Set(Gf.Vec3f(2.0, 1.0, 2.0))
    assert "/Up/Grains: a transform with shear or unequal scales" in refusal(stage)


def test_newton_names_are_taken_where_they_exist(tmp_path):
    stage = new_stage(tmp_path / "a.usda")
    define_grains(stage)
    physics, material = stage.GetPrimAtPath("/Physics"), stage.GetPrimAtPath("/Looks/g")
    physics.RemoveProperty("dem:time:step")
    physics.CreateAttribute("newton:timeStepsPerSecond", Sdf.ValueTypeNames.Int).Set(100000)
    physics.CreateAttribute("newton:gravityEnabled", Sdf.ValueTypeNames.Bool).Set(False)
    author(physics, "contact:rolling", Sdf.ValueTypeNames.Token, "constant")
    material.RemoveProperty("dem:young_modulus")
    material.RemoveProperty("dem:poisson_ratio")
    for name, value in (("mpm:youngsModulus", 7e6), ("mpm:poissonsRatio", 0.2), ("rollingFriction", 0.1)):
        material.CreateAttribute(f"newton:{name}", Sdf.ValueTypeNames.Float).Set(value)
    scene = read(stage)
    assert (scene.time.step, scene.gravity) == (1e-5, (0.0, 0.0, 0.0))
    assert (scene.materials["g"].young_modulus, scene.materials["g"].poisson_ratio) == (7e6, 0.2)
    assert scene.pair("g", "g").rolling_friction == 0.1


def test_errors_name_stage_prim_and_attribute(tmp_path):
    stage = new_stage(tmp_path / "a.usda")
    ball = define_grains(stage)
    physics = stage.GetPrimAtPath("/Physics")
    author(physics, "time:end", Sdf.ValueTypeNames.Double, -1.0)
    author(physics, "engine:skni", Sdf.ValueTypeNames.Double, 1.0)
    author(ball.GetPrim(), "velocities_in", Sdf.ValueTypeNames.Token, "moon")
    told = refusal(stage)
    assert "a.usda: 3 problems" in told
    for part in (
        "time.end = -1.0\n      must be > 0 [s]\n      at /Physics.dem:time:end",
        'engine.skni = 1.0\n      unknown key; did you mean "skin"?\n      at /Physics.dem:engine:skni',
        'grains[0].velocities_in = "moon"\n',
        "at /Grains.dem:velocities_in",
    ):
        assert part in told


def stray(stage):
    author(UsdGeom.Xform.Define(stage, "/Stray").GetPrim(), "rate", Sdf.ValueTypeNames.Double, 1.0)


def joint(stage):
    UsdPhysics.RevoluteJoint.Define(stage, "/Hinge")


def hull(stage):
    mesh = define_mesh(stage, "/Hull", MESH)
    UsdPhysics.MeshCollisionAPI.Apply(mesh.GetPrim()).CreateApproximationAttr("convexHull")


def unlike_twin(stage):
    author(stage.GetPrimAtPath("/Looks/g"), "density", Sdf.ValueTypeNames.Double, 2600.0)


def unlike_pair(stage):
    pair = stage.DefinePrim("/pair")
    author(pair, "list", Sdf.ValueTypeNames.String, "pairs")
    pair.CreateRelationship("dem:materials").SetTargets(["/Looks/g"])
    author(pair, "restitution", Sdf.ValueTypeNames.Double, 0.7)


def moved_points(stage):
    grains = UsdGeom.Points.Get(stage, "/Grains")
    exact = UsdGeom.PrimvarsAPI(grains).CreatePrimvar("dem:positions", Sdf.ValueTypeNames.Double3Array)
    exact.Set(Vt.Vec3dArray([(0.0, 0.0, 0.1)]))


def twice_moved(stage):
    mesh = define_mesh(stage, "/Mill", MESH)
    UsdPhysics.RigidBodyAPI.Apply(mesh.GetPrim()).CreateKinematicEnabledAttr(True)
    UsdPhysics.RigidBodyAPI(mesh.GetPrim()).CreateAngularVelocityAttr(Gf.Vec3f(0, 0, 1))
    author(mesh.GetPrim(), "motion:rate", Sdf.ValueTypeNames.Double, 1.0)


def lost_target(stage):
    stage.GetPrimAtPath("/Grains").CreateRelationship("dem:material").SetTargets(["/Nowhere"])


@pytest.mark.parametrize(
    ("change", "parts"),
    [
        (stray, "/Stray.dem:rate: the prim is no physics scene"),
        (joint, "/Hinge holds no body that moves by forces"),
        (hull, "/Hull: approximation = convexHull: walls are the true triangles"),
        (unlike_twin, "/Looks/g.physics:density = 2500.0, but /Looks/g.dem:density = 2600.0"),
        (unlike_pair, "/Looks/g.physics:restitution = 0.5, but /pair.dem:restitution = 0.7"),
        (moved_points, "/Grains: points and primvars:dem:positions differ"),
        (twice_moved, "/Mill moves by USD's own attributes and by dem:motion"),
        (lost_target, "/Grains.dem:material: /Nowhere: must target prims of the scene"),
        (lambda stage: UsdPhysics.Scene.Define(stage, "/More"), "needs one PhysicsScene prim"),
        (lambda stage: stage.ClearMetadata("metersPerUnit"), "does not state its metersPerUnit"),
        (lambda stage: stage.SetMetadata("kilogramsPerUnit", 0.0), "kilogramsPerUnit = 0"),
    ],
)
def test_what_is_no_scene_or_contradicts_itself_is_refused(tmp_path, change, parts):
    stage = new_stage(tmp_path / "a.usda")
    define_grains(stage)
    change(stage)
    assert parts in refusal(stage)


def test_a_frame_is_asked_of_results_only(tmp_path):
    stage = new_stage(tmp_path / "a.usda")
    define_grains(stage)
    assert "at = 0.5 s: it holds no frames of a run" in refusal(stage, at=0.5)
    with pytest.raises(SceneError, match="only the result stage of a run"):
        load_scene(SCENES / "hourglass.toml", at=0.5)


def sublayer(stage, name):
    stage.GetRootLayer().subLayerPaths.append(name)


def reference(stage, name):
    stage.DefinePrim("/Far").GetReferences().AddReference(name)


def payload_in_variant(stage, name):
    sets = stage.DefinePrim("/Far").GetVariantSets().AddVariantSet("size")
    sets.AddVariant("big")
    sets.SetVariantSelection("big")
    with sets.GetVariantEditContext():
        stage.GetPrimAtPath("/Far").GetPayloads().AddPayload(name)


def clip(stage, name):
    clips = Usd.ClipsAPI(stage.DefinePrim("/Far"))
    clips.SetClipAssetPaths([Sdf.AssetPath(name)])
    clips.SetClipPrimPath("/Far")


@pytest.mark.parametrize("refer", [sublayer, reference, payload_in_variant, clip])
@pytest.mark.parametrize("way", ["path", "link", "address", "expression"])
def test_a_stage_reads_nothing_outside_its_folder(tmp_path, refer, way):
    home, outside = tmp_path / "home", tmp_path / "outside"
    home.mkdir(), outside.mkdir()
    other = Usd.Stage.CreateNew(str(outside / "other.usda"))
    UsdGeom.Xform.Define(other, "/Far")
    other.SetDefaultPrim(other.GetPrimAtPath("/Far"))
    other.Save()
    name = {"path": "../outside/other.usda", "link": "./link.usda", "address": "http://a.b/c.usda", "expression": '`"x.usda"`'}
    os.symlink(outside / "other.usda", home / "link.usda")
    stage = new_stage(home / "a.usda")
    define_grains(stage)
    refer(stage, name[way])
    told = refusal(stage)
    if way in ("path", "link"):
        assert f"which leads to {outside / 'other.usda'}, outside the folders" in told
        assert len(read(stage, allow_paths=[outside]).grains) == 1
    else:
        assert "only plain file names are read" in told


def test_walls_and_motions_from_stages_are_bound_too(tmp_path):
    home, outside = tmp_path / "home", tmp_path / "outside"
    home.mkdir(), outside.mkdir()
    other = Usd.Stage.CreateNew(str(outside / "other.usda"))
    UsdGeom.Xform.Define(other, "/Far")
    other.Save()
    wall = Usd.Stage.CreateNew(str(home / "wall.usda"))
    wall.DefinePrim("/Far").GetReferences().AddReference("../outside/other.usda", "/Far")
    UsdGeom.Cube.Define(wall, "/Far/Cube")
    wall.Save()
    (home / "scene.toml").write_text(
        """time = { end = 1 }
        materials.g = { density = 1e3, young_modulus = 1e6, poisson_ratio = 0.3 }
        pairs = [{ materials = ["g", "g"], restitution = 0.5 }]
        grains = [{ material = "g", positions = [[0, 0, 0]], radius = 0.1 }]
        walls = [{ name = "a", material = "g", mesh = "wall.usda" }]"""
    )
    with pytest.raises(SceneError, match="outside the folders that may be read"):
        Simulation(load_scene(home / "scene.toml"), device="cpu", threads=1)
    with pytest.raises(SceneError, match="outside the folders that may be read"):
        Simulation(
            load_scene(home / "scene.toml", ['walls.0={name="a", material="g", plane={point=[0,0,-1],normal=[0,0,1]}}',
                                             'frame={usd="wall.usda", prim="/Far"}']), device="cpu", threads=1)  # fmt: skip


@pytest.mark.slow
def test_stirrer_does_what_it_says():
    scene = load_scene(SCENES / "stirrer.usda")
    sim = Simulation(scene, device="cpu", threads=1)
    group, start = sim.particles.group, sim.particles.position[:, 1]
    work, share = 0.0, 20
    for k in range(share):
        sim.run(until=scene.time.end * (k + 1) / share)
        work += sim.wall_loads()["Paddle"].power * scene.time.end / share
    position = sim.particles.position
    assert (np.abs(position[:, :2]) < 0.02).all() and (position[:, 2] > 0.0).all()
    changed = np.sign(position[:, 1]) != np.sign(start)
    assert [changed[group == k].mean() > 0.1 for k in (0, 1)] == [True, True]
    assert work > 0.0
