"""Physics of a stage that a scene does not take: refused or noted by path, whatever program it is from."""

import json

import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics

from usd_stages import MESH, author, collide, define_grains, define_mesh, new_stage, read, refusal
from warpdem import load_scene
from warpdem.app.cli import app
from warpdem.usd.schemas import RULES, Prim, rule_of
from warpdem.usd.unsupported import notes

TYPES = Sdf.ValueTypeNames
SURFACE = "physxSurfaceVelocity:surfaceVelocity"


def apply(prim, *schemas):
    """Name schemas at a prim, registered or not."""
    for schema in schemas:
        prim.GetPrim().AddAppliedSchema(schema)
    return prim.GetPrim()


def put(prim, name, kind, value):
    prim.GetPrim().CreateAttribute(name, kind).Set(value)


def belt(stage, **values):
    """A wall of a kinematic body with a surface velocity."""
    prim = apply(define_mesh(stage, "/Belt", MESH), "PhysicsRigidBodyAPI", "PhysxSurfaceVelocityAPI")
    put(prim, "physics:kinematicEnabled", TYPES.Bool, True)
    for name, value in values.items():
        kind = TYPES.Bool if isinstance(value, bool) else TYPES.Vector3f
        put(prim, f"physxSurfaceVelocity:{name}", kind, value)
    return prim


def conveyor_node(stage):
    apply(stage.DefinePrim("/Graph", "OmniGraph"))
    put(stage.DefinePrim("/Graph/belt", "OmniGraphNode"), "node:type", TYPES.Token, "isaacsim.asset.gen.conveyor.IsaacConveyor")


def sampled_spin(stage):
    body = apply(define_mesh(stage, "/Mill", MESH), "PhysicsRigidBodyAPI")
    put(body, "physics:kinematicEnabled", TYPES.Bool, True)
    spin = UsdPhysics.RigidBodyAPI(body).CreateAngularVelocityAttr()
    spin.Set(Gf.Vec3f(0, 0, 1), 0.0)
    spin.Set(Gf.Vec3f(0, 0, 9), 24.0)


def sampled_belt(stage):
    surface = belt(stage).CreateAttribute(SURFACE, TYPES.Vector3f)
    surface.Set(Gf.Vec3f(0, 0, 0), 0.0)
    surface.Set(Gf.Vec3f(0.5, 0, 0), 24.0)


def typed(path, kind):
    return lambda stage: stage.DefinePrim(path, kind)


def schema(name, on=lambda stage: define_mesh(stage, "/Wall", MESH), **values):
    """A change of a stage: a schema and numbers, given by their names with _ for the colon, at a prim."""

    def change(stage):
        prim = apply(on(stage), name)
        for key, value in values.items():
            kind = TYPES.Bool if isinstance(value, bool) else TYPES.Double if isinstance(value, float) else TYPES.Float3
            put(prim, key.replace("_", ":"), kind, value)

    return change


def at_grains(stage):
    return UsdGeom.Points.Get(stage, "/Grains")


def filtered(stage):
    prim = apply(define_mesh(stage, "/Wall", MESH), "PhysicsFilteredPairsAPI")
    UsdPhysics.FilteredPairsAPI(prim).CreateFilteredPairsRel().SetTargets(["/Grains"])


def group(stage):
    UsdPhysics.CollisionGroup.Define(stage, "/Group").CreateFilteredGroupsRel().SetTargets(["/Group"])


def stiff_grains(stage):
    apply(at_grains(stage), "PhysicsRigidBodyAPI")


def moving_without_body(stage):
    put(define_mesh(stage, "/Wall", MESH), "physics:velocity", TYPES.Vector3f, Gf.Vec3f(1, 0, 0))


def static_friction_only(stage):
    prim = stage.GetPrimAtPath("/Looks/g")
    prim.RemoveProperty("physics:dynamicFriction")
    put(prim, "physics:staticFriction", TYPES.Float, 0.5)


def colliding_group(stage):
    apply(UsdGeom.Xform.Define(stage, "/Parts"), "PhysicsCollisionAPI")
    UsdGeom.Cube.Define(stage, "/Parts/Cube")


def instancer(stage):
    many = UsdGeom.PointInstancer.Define(stage, "/Many")
    collide(UsdGeom.Cube.Define(stage, "/Many/Cube"))
    many.CreatePrototypesRel().SetTargets(["/Many/Cube"])


def nested_bodies(stage):
    for path, speed in (("/Outer", 1.0), ("/Outer/Inner", 2.0)):
        body = apply(UsdGeom.Xform.Define(stage, path), "PhysicsRigidBodyAPI")
        put(body, "physics:kinematicEnabled", TYPES.Bool, True)
        put(body, "physics:velocity", TYPES.Vector3f, Gf.Vec3f(speed, 0, 0))
    define_mesh(stage, "/Outer/Inner/Wall", MESH)


def animated_part_of_a_moving_body(stage):
    body = apply(UsdGeom.Xform.Define(stage, "/Body"), "PhysicsRigidBodyAPI")
    put(body, "physics:kinematicEnabled", TYPES.Bool, True)
    put(body, "physics:velocity", TYPES.Vector3f, Gf.Vec3f(1, 0, 0))
    define_mesh(stage, "/Body/Wall", MESH).AddTranslateOp().Set(Gf.Vec3d(1, 0, 0), 24.0)


def unknown_array(stage):
    UsdGeom.PrimvarsAPI(at_grains(stage)).CreatePrimvar("dem:postions", TYPES.Double3Array).Set([(0, 0, 0)])


def misspelt_over(stage):
    author(stage.OverridePrim("/Grians"), "name", TYPES.String, "tracer")


REFUSED = {
    "turning surface": (
        lambda stage: belt(stage, surfaceAngularVelocity=Gf.Vec3f(0, 0, 9)),
        "/Belt: physxSurfaceVelocity:surfaceAngularVelocity = [0.0, 0.0, 9.0]: ",
    ),
    "sampled surface velocity": (sampled_belt, f"/Belt: {SURFACE} changes with time"),
    "curved belt": (schema("PhysxSplinesSurfaceVelocityAPI"), "/Wall: PhysxSplinesSurfaceVelocityAPI: "),
    "conveyor graph": (conveyor_node, "/Graph/belt: OmniGraphNode: the node of a conveyor is not executed"),
    "force": (schema("PhysxForceAPI", physxForce_force=Gf.Vec3f(0, 0, 1)), "/Wall: physxForce:force = [0.0, 0.0, 1.0]: "),
    "trigger": (schema("PhysxTriggerAPI"), "/Wall: PhysxTriggerAPI: a trigger is not solid"),
    "deformable": (schema("PhysxDeformableSurfaceAPI"), "/Wall: PhysxDeformableSurfaceAPI: walls are rigid"),
    "new deformable": (schema("OmniPhysicsSurfaceDeformableSimAPI"), "/Wall: OmniPhysicsSurfaceDeformableSimAPI: "),
    "cloth": (schema("PhysxParticleClothAPI"), "/Wall: PhysxParticleClothAPI: walls are rigid"),
    "fixed joint": (lambda stage: UsdPhysics.FixedJoint.Define(stage, "/Joint"), "/Joint: PhysicsFixedJoint: "),
    "gears": (typed("/Gears", "PhysxPhysicsGearJoint"), "/Gears: PhysxPhysicsGearJoint: "),
    "drive": (schema("PhysicsDriveAPI:angular"), "/Wall: PhysicsDriveAPI:angular: joints, drives and tendons"),
    "articulation": (schema("PhysicsArticulationRootAPI"), "/Wall: PhysicsArticulationRootAPI: "),
    "actuator": (typed("/Motor", "MjcActuator"), "/Motor: MjcActuator: "),
    "mimic": (schema("NewtonMimicAPI"), "/Wall: NewtonMimicAPI: "),
    "particles": (
        schema("PhysxParticleSetAPI", on=lambda stage: UsdGeom.Points.Define(stage, "/Sand")),
        "/Sand: PhysxParticleSetAPI: its particles are no grains: apply PhysicsCollisionAPI",
    ),
    "sampling": (schema("PhysxParticleSamplingAPI"), "/Wall: PhysxParticleSamplingAPI: "),
    "mass of grains": (schema("PhysicsMassAPI", on=at_grains, physics_mass=0.1), "/Grains: physics:mass = 0.1"),
    "filtered pair": (filtered, "/Wall: PhysicsFilteredPairsAPI: grains are in contact with all walls"),
    "collision group": (group, "/Group: PhysicsCollisionGroup: grains are in contact with all walls"),
    "grains as one body": (stiff_grains, "/Grains: its points would be one rigid body"),
    "velocity without a body": (moving_without_body, "/Wall: physics:velocity = [1.0, 0.0, 0.0]: has no effect"),
    "velocity with samples": (sampled_spin, "/Mill: physics:angularVelocity changes with time"),
    "nested bodies": (nested_bodies, "/Outer/Inner is a body within the body /Outer, which moves by its velocities"),
    "two motions": (animated_part_of_a_moving_body, "/Body/Wall moves by time samples of transforms, and its body /Body by"),
    "static friction alone": (static_friction_only, "/Looks/g: physics:staticFriction = 0.5: grains have one coefficient"),
    "collider without a shape": (colliding_group, "/Parts collides (PhysicsCollisionAPI) but is a Xform, which cannot"),
    "colliding curves": (
        schema("PhysicsCollisionAPI", on=lambda stage: UsdGeom.BasisCurves.Define(stage, "/Rope")),
        "/Rope collides (PhysicsCollisionAPI) but is a BasisCurves",
    ),
    "point instancer": (instancer, "/Many is a point instancer of /Many/Cube, which has physics"),
    "unknown array": (unknown_array, "/Grains.primvars:dem:postions: no such array of grains; there are positions, "),
    "over of nothing": (misspelt_over, "/Grians is an over, and nothing defines the prim"),
    "gravity off elsewhere": (
        schema("MjcSceneAPI", on=lambda stage: stage.GetPrimAtPath("/Physics"), mjc_flag_gravity=False),
        "/Physics: mjc:flag:gravity = False: ",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_would_give_another_flow_is_refused_by_its_path(tmp_path, case):
    stage = new_stage(tmp_path / "a.usda")
    define_grains(stage)
    change, words = REFUSED[case]
    change(stage)
    assert words in refusal(stage)


def test_all_refusals_of_a_stage_are_told_at_once(tmp_path):
    stage = new_stage(tmp_path / "a.usda")
    define_grains(stage)
    belt(stage, surfaceVelocity=Gf.Vec3f(0.5, 0, 0), surfaceAngularVelocity=Gf.Vec3f(0, 0, 1))
    UsdPhysics.FixedJoint.Define(stage, "/Joint")
    told = refusal(stage)
    assert "a.usda: 2 problems\n  /Belt: " in told and "\n  /Joint: " in told


def off_belt(stage):
    belt(stage, surfaceVelocity=Gf.Vec3f(0.5, 0, 0), surfaceVelocityEnabled=False)


def off_joint(stage):
    UsdPhysics.FixedJoint.Define(stage, "/Joint").CreateJointEnabledAttr(False)


def off_collider(stage):
    prim = apply(define_mesh(stage, "/Ghost", MESH), "PhysxTriggerAPI")
    put(prim, "physics:collisionEnabled", TYPES.Bool, False)


def off_grains(stage):
    put(define_grains(stage, "/More"), "physics:collisionEnabled", TYPES.Bool, False)


def two_frictions(stage):
    put(stage.GetPrimAtPath("/Looks/g"), "physics:staticFriction", TYPES.Float, 0.7)


def sampled_body(stage):
    body = define_mesh(stage, "/Mill", MESH)
    body.AddTranslateOp().Set(Gf.Vec3d(1, 0, 0), 24.0)
    put(apply(body, "PhysicsRigidBodyAPI"), "physics:kinematicEnabled", TYPES.Bool, True)
    put(body, "physics:velocity", TYPES.Vector3f, Gf.Vec3f(1, 0, 0))


def more_of_grains(stage):
    at_grains(stage).CreateAccelerationsAttr([(0, 0, 1)])


def animated_grains(stage):
    for code in (0.0, 24.0):
        at_grains(stage).GetPointsAttr().Set([(0, 0, code)], code)


def unchosen(stage):
    sets = UsdGeom.Xform.Define(stage, "/Size").GetPrim().GetVariantSets().AddVariantSet("size")
    sets.AddVariant("big")


NOTED = {
    "belt that is off": (off_belt, "/Belt: PhysxSurfaceVelocityAPI, physxSurfaceVelocity:surfaceVelocity, "),
    "joint that is off": (off_joint, "/Joint: PhysicsFixedJoint, physics:jointEnabled: not taken"),
    "collider that is off": (off_collider, "/Ghost: no walls or grains, since physics:collisionEnabled = false"),
    "grains that are off": (off_grains, "/More: no walls or grains, since physics:collisionEnabled = false"),
    "mass": (schema("PhysicsMassAPI", physics_mass=2.0), "/Wall: PhysicsMassAPI, physics:mass: not taken: the motion of walls"),
    "settings of PhysX": (
        schema("PhysxCollisionAPI", physxCollision_contactOffset=0.1),
        "/Wall: PhysxCollisionAPI, physxCollision:contactOffset: settings of another program",
    ),
    "distance of PhysX": (
        schema("PhysxCollisionAPI", physxCollision_restOffset=0.1),
        "/Wall: physxCollision:restOffset: not taken: the surface of a wall",
    ),
    "unknown schema": (schema("NewtonNeverHeardOfAPI"), "/Wall: NewtonNeverHeardOfAPI: settings of another program"),
    "unknown attribute": (schema("PhysicsCollisionAPI", mjc_solref=0.1), "/Wall: mjc:solref: settings of another program"),
    "two frictions": (two_frictions, "/Looks/g: physics:staticFriction: not taken: grains have one coefficient"),
    "samples beside velocities": (sampled_body, "/Mill: physics:velocity: not taken: the time samples of the transform"),
    "particles with collisions": (schema("PhysxParticleSetAPI", on=at_grains), "/Grains: PhysxParticleSetAPI: settings"),
    "arrays of grains": (more_of_grains, "/Grains: not taken of the grains: accelerations"),
    "animated grains": (animated_grains, "/Grains: points: changes with time; grains start as they are at time 0"),
    "no collider": (lambda stage: UsdGeom.Cube.Define(stage, "/Looks/Cube"), "/Looks/Cube: no walls or grains, since Physics"),
    "picture of many": (
        lambda stage: UsdGeom.PointInstancer.Define(stage, "/Trees"), "/Trees (a point instancer): no walls or grains, since"
    ),
    "graph": (typed("/Graph", "OmniGraph"), "/Graph: OmniGraph: the graph is not executed"),
    "variant": (unchosen, "/Size: no variant of size is selected (big)"),
}  # fmt: skip


@pytest.mark.parametrize("case", NOTED)
def test_what_is_not_taken_is_noted_by_its_path(tmp_path, case):
    stage = new_stage(tmp_path / "a.usda")
    define_grains(stage)
    before = read(stage)
    assert before.notes == ()
    change, words = NOTED[case]
    change(stage)
    scene = read(stage)
    assert len([note for note in scene.notes if words in note]) == 1
    assert len(scene.grains) == 1


def test_what_grains_know_nothing_of_is_taken_without_a_word(tmp_path):
    """Filters among walls, true triangles by another name, a zero surface velocity of nothing."""
    stage = new_stage(tmp_path / "a.usda")
    define_grains(stage)
    wall = define_mesh(stage, "/Wall", MESH)
    UsdPhysics.MeshCollisionAPI.Apply(wall.GetPrim()).CreateApproximationAttr("sdf")
    UsdPhysics.FilteredPairsAPI.Apply(wall.GetPrim()).CreateFilteredPairsRel().SetTargets(["/Other"])
    define_mesh(stage, "/Other", MESH)
    UsdPhysics.CollisionGroup.Define(stage, "/Group")
    put(stage.GetPrimAtPath("/Looks/g"), "physics:staticFriction", TYPES.Float, 0.5)
    scene = read(stage)
    assert scene.notes == ()
    assert [wall.name for wall in scene.walls] == ["Wall", "Other"]


def test_notes_reach_check_run_and_convert(tmp_path, capsys):
    stage = new_stage(tmp_path / "a.usda")
    define_grains(stage)
    apply(define_mesh(stage, "/Wall", MESH), "PhysxCollisionAPI")
    physics = stage.GetPrimAtPath("/Physics")
    author(physics, "output:formats", TYPES.StringArray, [])
    stage.Save()
    words = "/Wall: PhysxCollisionAPI: settings of another program, not taken"
    path, out = str(tmp_path / "a.usda"), tmp_path / "out"
    app(["check", path, "--json", "--no-probe"], result_action="return_value")
    assert words in json.loads(capsys.readouterr().out)["notes"]
    app(["run", path, "--out", str(out), "--until", "2e-5"], result_action="return_value")
    assert f"note: {words}" in " ".join(capsys.readouterr().out.split())
    assert words in json.loads((out / "run.json").read_text())["notes"]
    app(["convert", path, str(tmp_path / "b.toml")], result_action="return_value")
    assert f"note: {words}" in " ".join(capsys.readouterr().out.split())
    assert load_scene(tmp_path / "b.toml", allow_paths=[tmp_path]).notes == ()


def test_a_mesh_file_says_which_physics_stays_behind(tmp_path):
    stage = Usd.Stage.CreateNew(str(tmp_path / "a.usda"))
    stage.SetMetadata("metersPerUnit", 1.0)
    stage.SetMetadata("upAxis", "Z")
    apply(UsdGeom.Xform.Define(stage, "/Body"), "PhysicsRigidBodyAPI")
    apply(UsdGeom.Cube.Define(stage, "/Body/Belt"), "PhysicsCollisionAPI", "PhysxSurfaceVelocityAPI")
    stage.Save()
    from warpdem.mesh.usd_geometry import read_triangles

    told = read_triangles(tmp_path / "a.usda", "/Body/Belt", "walls[0].mesh")[1]
    assert told == ("physics is not read: /Body (PhysicsRigidBodyAPI), /Body/Belt (PhysxSurfaceVelocityAPI)",)


def test_notes_of_prims_alike_are_one(tmp_path):
    said = [{"path": f"/W{k}", "type": "", "schemas": ["PhysxCollisionAPI"], "values": {}} for k in range(9)]
    (note,) = notes(tmp_path, said)
    assert note.startswith("/W0, /W1, /W2, /W3 and 5 more: PhysxCollisionAPI: ")


def test_every_rule_of_the_table_has_a_reason_and_the_last_one_fits_all():
    assert all(rule.why for rule in RULES if rule.verdict != "taken")
    assert rule_of("anything:at:all", Prim("/A", "", (), {})) is RULES[-1]
