"""Free walls as UsdPhysics states them: bodies, masses, joints, limits and drives, read, refused and written."""

import json
import math

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics

from usd_stages import MESH, author, collide, define_grains, define_mesh, new_stage, read, refusal, validation_errors
from warpdem import SceneError, load_scene
from warpdem.scene.tables import scene_tables
from warpdem.scene.write_usd import write_usd_scene
from warpdem.usd.reader.__main__ import answer

TYPES = Sdf.ValueTypeNames
IDENTITY = Gf.Quatf(1, 0, 0, 0)


def about_z(degrees):
    return Gf.Quatf(Gf.Rotation(Gf.Vec3d(0, 0, 1), degrees).GetQuat())


def flap(stage, path="/Flap", **masses):
    """A wall that moves by forces: 10 along x, turned by 90 degrees about z."""
    mesh = define_mesh(stage, path, MESH)
    mesh.AddTranslateOp().Set(Gf.Vec3d(10, 0, 0))
    mesh.AddRotateZOp().Set(90.0)
    UsdPhysics.RigidBodyAPI.Apply(mesh.GetPrim())
    api = UsdPhysics.MassAPI.Apply(mesh.GetPrim())
    for name, value in masses.items():
        getattr(api, f"Create{name}Attr")(value)
    return mesh.GetPrim()


def join(stage, kind=UsdPhysics.RevoluteJoint, axis="Z", begins=0.0, path="/Joint", **targets):
    """A joint of ``/Flap`` at (10, 0, 5), whose coordinate is ``begins`` degrees at time 0."""
    joint = kind.Define(stage, path)
    for end, target in (targets or {"Body1": "/Flap"}).items():
        getattr(joint, f"Create{end}Rel")().SetTargets([target])
    joint.CreateAxisAttr(axis)
    joint.CreateLocalPos0Attr(Gf.Vec3f(10, 0, 5))
    joint.CreateLocalPos1Attr(Gf.Vec3f(0, 0, 5))
    joint.CreateLocalRot0Attr(IDENTITY)
    joint.CreateLocalRot1Attr(about_z(begins - 90.0))
    return joint


def drive(joint, **values):
    kind = "angular" if joint.GetPrim().IsA(UsdPhysics.RevoluteJoint) else "linear"
    api = UsdPhysics.DriveAPI.Apply(joint.GetPrim(), kind)
    for name, value in values.items():
        getattr(api, f"Create{name}Attr")(value)


@pytest.fixture
def stage(tmp_path):
    """Centimetres and Y upwards: (x, y, z) of the stage is (x, -z, y)/100 of the scene."""
    stage = new_stage(tmp_path / "a.usda", 0.01, "Y")
    define_grains(stage)
    return stage


MASSES = {"Mass": 2.0, "CenterOfMass": Gf.Vec3f(1, 2, 0), "DiagonalInertia": Gf.Vec3f(100, 200, 250)}


def test_a_revolute_joint_is_a_hinge(stage):
    """By hand: the center is at (8, 1, 0), 5 cm^2 off the axis; limits and rest count from 30 degrees."""
    body = flap(stage, **MASSES)
    UsdPhysics.RigidBodyAPI(body).CreateAngularVelocityAttr(Gf.Vec3f(0, 0, 90))
    joint = join(stage, begins=30.0)
    joint.CreateLowerLimitAttr(-20.0)
    joint.CreateUpperLimitAttr(70.0)
    drive(joint, Stiffness=0.1, Damping=0.02, TargetPosition=45.0, TargetVelocity=10.0)
    (wall,) = read(stage).walls
    free = wall.free
    assert (wall.fixed_to, wall.mesh, wall.prim, free.joint, free.mass) == ("laboratory", "a.usda", "/Flap", "hinge", 2.0)
    near = {"rtol": 0, "atol": 1e-7}
    np.testing.assert_allclose(free.axis, [0, -1, 0], **near)
    np.testing.assert_allclose(free.origin, [0.1, -0.05, 0], **near)
    np.testing.assert_allclose(free.centre, [0.08, 0, 0.01], **near)
    assert free.inertia == pytest.approx(250e-4 + 2.0 * 5e-4, rel=1e-6)
    assert free.rate == pytest.approx(math.pi / 2, rel=1e-6)
    assert free.range == pytest.approx(np.radians([-50.0, 40.0]), abs=1e-6)
    per_radian = 1e-4 * 180 / math.pi
    assert (free.stiffness, free.damping) == pytest.approx((0.1 * per_radian, 0.02 * per_radian), rel=1e-6)
    assert free.rest == pytest.approx(math.radians(15.0), abs=1e-6)
    assert free.torque == pytest.approx(0.02e-4 * 10.0, rel=1e-6)


def test_a_prismatic_joint_is_a_slider_the_other_way_if_its_first_body_is_free(stage):
    """The coordinate is that of body1 from body0; a drive with a largest force is a motor."""
    body = flap(stage, Mass=2.0)
    UsdPhysics.RigidBodyAPI(body).CreateVelocityAttr(Gf.Vec3f(0, 0, 4))
    joint = join(stage, UsdPhysics.PrismaticJoint, Body0="/Flap")
    joint.GetLocalRot0Attr().Set(about_z(-90.0))
    joint.GetLocalRot1Attr().Set(IDENTITY)
    joint.GetLocalPos0Attr().Set(Gf.Vec3f(0, 0, 5))
    joint.GetLocalPos1Attr().Set(Gf.Vec3f(10, 0, 7))  # begins at 2 cm
    joint.CreateUpperLimitAttr(3.0)
    drive(joint, Damping=8.0, TargetVelocity=10.0, MaxForce=400.0, Stiffness=0.0)
    free = read(stage).walls[0].free
    assert (free.joint, free.mass) == ("slider", 2.0)
    np.testing.assert_allclose(free.axis, [0, 1, 0], rtol=0, atol=1e-7)
    # along the axis, which is that of the joint turned round
    assert free.velocity == pytest.approx(-0.04, rel=1e-6)
    assert free.range == pytest.approx((-1e9, 0.01), rel=1e-6)
    np.testing.assert_allclose(free.motor, [[0.1 - 4.0 / 8.0, 4.0], [0.1 + 4.0 / 8.0, -4.0]], rtol=1e-6)


def test_a_body_without_a_joint_has_six_degrees_of_freedom(stage):
    """Principal axes that are those of the scene give moments about these, others a quaternion."""
    axes = Gf.Quatf(Gf.Rotation(Gf.Vec3d(1, 0, 0), 90.0).GetQuat())  # of the prim: y to z, z to -y
    body = flap(stage, **MASSES, PrincipalAxes=axes)
    rigid = UsdPhysics.RigidBodyAPI(body)
    rigid.CreateVelocityAttr(Gf.Vec3f(1, 2, 3))
    rigid.CreateAngularVelocityAttr(Gf.Vec3f(0, 180, 0))
    free = read(stage).walls[0].free
    assert (free.joint, free.mass, free.axes) == ("none", 2.0, None)
    # principal x: prim x, stage y, scene z; y: prim z, stage z, scene -y; z: prim -y, stage x, scene x
    np.testing.assert_allclose(free.inertia, [250e-4, 200e-4, 100e-4], rtol=1e-6)
    np.testing.assert_allclose(free.velocity, [0.01, -0.03, 0.02], rtol=1e-6)
    np.testing.assert_allclose(free.spin, [0, 0, math.pi], rtol=0, atol=1e-6)
    UsdPhysics.MassAPI(body).GetPrincipalAxesAttr().Set(about_z(-60.0))
    free = read(stage).walls[0].free
    assert free.inertia == pytest.approx((100e-4, 200e-4, 250e-4), rel=1e-6)
    # stage: about z by 30 degrees; then z up, by 90 degrees about x
    wanted = Gf.Rotation(Gf.Vec3d(0, 0, 1), 30.0) * Gf.Rotation(Gf.Vec3d(1, 0, 0), 90.0)
    quaternion = wanted.GetQuat()
    given = np.array(free.axes)
    assert abs(given @ [quaternion.GetReal(), *quaternion.GetImaginary()]) == pytest.approx(1.0, abs=1e-7)


def test_masses_of_a_sphere_follow_from_its_density(stage):
    ball = collide(UsdGeom.Sphere.Define(stage, "/Ball"))
    ball.CreateRadiusAttr(3.0)
    UsdPhysics.RigidBodyAPI.Apply(ball.GetPrim())
    free = read(stage).walls[0].free
    mass = 2500 * 4 / 3 * math.pi * 0.03**3
    assert free.mass == pytest.approx(mass, rel=1e-6) and free.inertia == pytest.approx([0.4 * mass * 0.03**2] * 3, rel=1e-6)


def hinged(change, begins=0.0, **masses):
    def on(stage):
        body = flap(stage, **masses)
        change(join(stage, begins=begins), body)

    return on


def unequal_limits(joint, body):
    joint.CreateLowerLimitAttr(1.0)
    joint.CreateUpperLimitAttr(-1.0)


def two_bodies(stage):
    flap(stage)
    flap(stage, "/Other")
    join(stage, Body0="/Other", Body1="/Flap")


def moving_holder(stage):
    flap(stage)
    arm = define_mesh(stage, "/Arm", MESH).GetPrim()
    UsdPhysics.RigidBodyAPI.Apply(arm).CreateKinematicEnabledAttr(True)
    UsdPhysics.RigidBodyAPI(arm).CreateVelocityAttr(Gf.Vec3f(1, 0, 0))
    join(stage, Body0="/Arm", Body1="/Flap")


def two_colliders(stage):
    UsdPhysics.RigidBodyAPI.Apply(UsdGeom.Xform.Define(stage, "/Body").GetPrim())
    define_mesh(stage, "/Body/a", MESH)
    define_mesh(stage, "/Body/b", MESH)


def sampled(stage):
    body = flap(stage)
    UsdGeom.Xformable(body).GetOrderedXformOps()[0].Set(Gf.Vec3d(0, 0, 0), 24.0)


def own_joint(kind):
    def on(joint, body):
        author(body, "free:joint", TYPES.String, kind)

    return on


def own_axis(joint, body):
    author(body, "free:joint", TYPES.String, "hinge")
    author(body, "free:axis", TYPES.Double3, Gf.Vec3d(0, -1, 0.01))


def physx(name, kind, value):
    return lambda joint, body: (joint.GetPrim() if "Joint" in name else body).CreateAttribute(name, kind).Set(value)


REFUSED = {
    "two bodies": (two_bodies, "/Joint joins two bodies that move by forces, /Other and /Flap"),
    "no body": (lambda stage: join(stage, Body1="/Grains"), "/Joint holds no body that moves by forces"),
    "holder that moves": (moving_holder, "/Joint: /Arm moves by its velocities"),
    "colliders": (two_colliders, "/Body moves by forces and has several colliders, /Body/a, /Body/b"),
    "samples": (sampled, "/Flap is a rigid body that moves by forces, and its transform has time samples"),
    "two joints": (hinged(lambda joint, _: join(joint.GetPrim().GetStage(), path="/Next")), "/Next: /Flap is held by /Joint"),
    "breaks": (hinged(lambda joint, _: joint.CreateBreakForceAttr(9.0)), "/Joint.physics:breakForce = 9: joints do not break"),
    "lost target": (hinged(lambda joint, _: joint.GetBody0Rel().SetTargets(["/Nowhere"])), "/Joint.physics:body0: there is no"),
    "apart": (hinged(lambda joint, _: joint.GetLocalPos0Attr().Set((10, 1, 5))), "/Joint: its two frames are apart at time 0"),
    "limits": (hinged(unequal_limits), "/Joint: physics:lowerLimit = 1 is above physics:upperLimit = -1"),
    "limits elsewhere": (
        hinged(lambda joint, _: (joint.CreateLowerLimitAttr(5.0), joint.CreateUpperLimitAttr(9.0))),
        "must be [lowest, highest] around 0, where the wall begins",
    ),
    "acceleration": (hinged(lambda joint, _: drive(joint, Type="acceleration")), "angular:physics:type = acceleration: "),
    "stiff motor": (
        hinged(lambda joint, _: drive(joint, Stiffness=1.0, MaxForce=2.0)),
        "/Joint: a drive with both a stiffness and a maxForce",
    ),
    "density": (hinged(lambda joint, _: None, Density=500.0), "/Flap: physics:density = 500.0: the mass of a free wall"),
    "inertia alone": (
        hinged(lambda joint, _: None, DiagonalInertia=Gf.Vec3f(1, 1, 1)),
        "does not follow from physics:diagonalInertia alone: give it physics:mass and physics:centerOfMass too",
    ),
    "spin off the axis": (
        hinged(lambda _, body: UsdPhysics.RigidBodyAPI(body).CreateAngularVelocityAttr((0, 9, 0))),
        "/Flap: its joint /Joint allows only physics:angularVelocity about its axis",
    ),
    "no gravity": (hinged(physx("physxRigidBody:disableGravity", TYPES.Bool, True)), "gravity pulls every free wall"),
    "friction": (hinged(physx("physxJoint:jointFriction", TYPES.Float, 0.1)), "friction and armature of joints"),
    "another joint": (hinged(own_joint("slider")), "/Flap.dem:free:joint = slider, but by UsdPhysics at /Joint it is hinge"),
    "another axis": (hinged(own_axis), "/Flap.dem:free:axis = [0.0, -1.0, 0.01], but by UsdPhysics"),
}  # fmt: skip


def read_here(file, what, target, where, folders=None):
    """The answer of the reader without a process of its own."""
    arrays = answer(what, str(file), target, list(map(str, folders or ())))
    content = json.loads(str(arrays.pop("answer")))
    if "refused" in content:
        raise SceneError(f"{where}: {content['refused']}")
    return content, arrays


@pytest.mark.parametrize("case", REFUSED)
def test_what_no_free_wall_can_be_is_refused_by_its_path(stage, case, monkeypatch):
    monkeypatch.setattr("warpdem.usd.stage.read", read_here)
    for name in ("limit_memory", "limit_time"):  # they are for the reader's own process: this one would end by them
        monkeypatch.setattr(f"warpdem.usd.reader.layers.{name}", lambda size: None)
    change, words = REFUSED[case]
    change(stage)
    assert words in refusal(stage)


def test_a_body_without_a_wall_is_noted(stage):
    UsdPhysics.RigidBodyAPI.Apply(UsdGeom.Xform.Define(stage, "/Ghost").GetPrim())
    assert any(note.startswith("/Ghost: no walls or grains") for note in read(stage).notes)


HEAD = """materials.g = { density = 2500, young_modulus = 5e6, poisson_ratio = 0.3 }
pairs = [{ materials = ["g", "g"], restitution = 0.5, friction = 0.5 }]
grains = [{ material = "g", positions = [[0, 0, 0.3]], radius = 0.01 }]
time = { end = 1, step = 1e-5 }
"""
WALL = """[[walls]]
name = "w{}"
material = "g"
plane = {{ point = [0, 0, -1], normal = [0, 0, 1] }}
fixed_to = "laboratory"
free = {{ {} }}
"""
FREE = (
    'joint = "hinge", axis = [1, 2, 3], origin = [0.1, 0.2, 0.3], mass = 2, inertia = 0.1, centre = [0.1, 0, 1], rate = 3, '
    "stiffness = 4, damping = 0.5, rest = 0.2, torque = 0.7, range = [-1, 2]",
    'joint = "hinge", axis = [0, 1, 0], mass = 2, inertia = 0.1, motor = [[-1, 0.7], [5, -0.7]]',
    'joint = "slider", axis = [0, 0, -2], mass = 2, velocity = 3, stiffness = 4, damping = 0.5, rest = 0.2, range = [-1, 2]',
    'joint = "slider", axis = [-1, 0, 0], mass = 2, motor = [[0, 9], [5, -9]]',
    'joint = "none", mass = 2, centre = [0.1, 0, 1], inertia = [1, 2, 2.5], axes = [1, 2, 3, 4], velocity = [1, 2, 3], '
    "spin = [4, 5, 6]",
)


def test_what_is_written_says_the_same_without_the_keys_of_the_scene(tmp_path):
    """Round trip by UsdPhysics alone, to single precision; but the moment about the axis of a hinge, which USD has not."""
    (tmp_path / "a.toml").write_text(HEAD + "".join(WALL.format(*pair) for pair in enumerate(FREE)), encoding="utf-8")
    scene = load_scene(tmp_path / "a.toml")
    write_usd_scene(tmp_path / "b.usda", scene_tables(scene, str))
    assert validation_errors(tmp_path / "b.usda") == []
    exact = load_scene(tmp_path / "b.usda")
    assert [wall.free for wall in exact.walls] == [wall.free for wall in scene.walls]
    stage = Usd.Stage.Open(str(tmp_path / "b.usda"))
    for prim in stage.Traverse():
        names = [name for name in prim.GetPropertyNames() if name.startswith("dem:free:")]
        hinge = prim.GetAttribute("dem:free:joint").Get() == "hinge"
        for name in names:
            if not (hinge and name == "dem:free:inertia"):
                prim.RemoveProperty(name)
    stage.Save()
    for wall, again in zip(scene.walls, load_scene(tmp_path / "b.usda").walls, strict=True):
        given, found = wall.free.model_dump(), again.free.model_dump()
        assert given.keys() == found.keys()
        for name, value in given.items():
            if value is None or isinstance(value, str):
                assert found[name] == value
            else:
                np.testing.assert_allclose(np.array(found[name]), np.array(value), rtol=0, atol=3e-6, err_msg=name)
