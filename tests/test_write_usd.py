"""USD results as usd-core sees them: laboratory places, sizes, units, chunk borders, moving walls."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pxr import Usd, UsdGeom, UsdPhysics

from warpdem.errors import WarpdemError
from warpdem.snapshot import FramePose, Placement, RotationPart, SampledPart, Snapshot, TranslationPart, WallMesh
from warpdem.write_usd import UsdWriter
from warpdem.write_vtk import VtkWriter, read_results

GRAINS = "/World/Frame/Grains"
# names that USD does not allow, and that would become equal
BOX = WallMesh("the box", np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]), np.array([[0, 1, 2], [0, 2, 3]]))
PADDLE = WallMesh("the-box", 0.5 * BOX.vertices, BOX.triangles)
SINGLE = 2e-7  # float32 rounding of numbers about 1


def turn(axis, angle):
    return FramePose.turned(np.asarray(axis, dtype=float), np.zeros(3), angle, 0.0).rotation


def snapshot(k, axis=(0.48, 0.6, 0.64), origin=(0.1, -0.2, 0.3), count=30, seed=0):
    rng = np.random.default_rng([seed, k])
    return Snapshot(
        step=k,
        time=0.1 * k,
        # almost half a turn per frame: the least that quaternions or matrices would interpolate the wrong way
        frame=FramePose.turned(np.array(axis, dtype=float), np.array(origin), 3.0 * k, 30.0),
        id=np.arange(count) * 3,
        type=np.zeros(count, dtype=np.int32),
        radius=rng.uniform(0.01, 0.02, count),
        mass=np.ones(count),
        position=rng.random((count, 3)),
        velocity=rng.random((count, 3)),
        spin=rng.random((count, 3)),
        force=np.zeros((count, 3)),
        walls={
            BOX.name: Placement(np.eye(3), np.zeros(3)),
            PADDLE.name: Placement(turn([0, 0, 1], 2.0 * max(0, k - 2)), np.array([0.1 * max(0, k - 2), 0.0, 0.0])),
        },
    )


def write(folder, frames, seed=0, **options):
    writer = UsdWriter(folder, [BOX, PADDLE], frames_per_chunk=3, **options)
    for k in frames:
        writer.write(snapshot(k, seed=seed))
    writer.close()


def open_grains(folder):
    stage = Usd.Stage.Open(str(folder / "result.usda"))
    return stage, UsdGeom.Points.Get(stage, GRAINS)


def laboratory(prim, points, code):
    matrix = np.array(UsdGeom.XformCache(code).GetLocalToWorldTransform(prim))
    return points @ matrix[:3, :3] + matrix[3, :3]


@pytest.mark.parametrize("axis", [(0, 1, 0), (1, 0, 0), (0, 0, 1), (0, 0, -1), (-0.48, 0.6, -0.64)])
def test_grains_stand_in_the_laboratory_where_the_frame_takes_them(tmp_path, axis):
    writer = UsdWriter(tmp_path, [BOX, PADDLE], frames_per_chunk=3)
    for k in range(8):
        writer.write(snapshot(k, axis=axis))
    _, grains = open_grains(tmp_path)
    for k in range(8):
        wanted, code = snapshot(k, axis=axis), 100.0 * k
        points = np.array(grains.GetPointsAttr().Get(code), dtype=float)
        lab = laboratory(grains.GetPrim(), points, code)
        assert_allclose(lab, wanted.frame.to_laboratory(wanted.position), atol=4 * SINGLE)


def nested(k) -> FramePose:
    """A turn within a shift within a turn within a sampled motion, almost half a turn per frame."""
    parts = (
        RotationPart(np.array([0.0, 0.6, 0.8]), np.array([0.5, 0.0, 0.1]), 3.0 * k),
        TranslationPart(np.array([0.3 * k, 0.0, -0.1])),
        RotationPart(np.array([-0.48, 0.6, -0.64]), np.array([0.1, -0.2, 0.3]), -2.5 * k),
        SampledPart(np.array([np.cos(0.5 * k), 0.0, np.sin(0.5 * k), 0.0]), np.array([0.0, 0.2 * k, 0.0])),
    )
    rotation, translation = np.eye(3), np.zeros(3)
    for part in reversed(parts):
        if isinstance(part, RotationPart):
            place = FramePose.turned(part.axis, part.origin, part.angle, 0.0)
            own, shift = place.rotation, place.translation
        elif isinstance(part, TranslationPart):
            own, shift = np.eye(3), part.shift
        else:
            own, shift = turn([0, 1, 0], 1.0 * k), part.shift
        rotation, translation = own @ rotation, own @ translation + shift
    return FramePose(rotation, translation, np.zeros(3), np.zeros(3), parts)


def test_nested_frame_stands_in_the_laboratory_where_its_parts_take_it(tmp_path):
    writer = UsdWriter(tmp_path, [BOX, PADDLE], frames_per_chunk=3)
    for k in range(5):
        writer.write(replace(snapshot(k), frame=nested(k)))
    stage, grains = open_grains(tmp_path)
    for k in range(5):
        code, wanted = 100.0 * k, snapshot(k)
        assert_allclose(laboratory(grains.GetPrim(), np.eye(3), code), nested(k).to_laboratory(np.eye(3)), atol=1e-12)
        points = np.array(grains.GetPointsAttr().Get(code), dtype=float)
        lab = nested(k).to_laboratory(wanted.position)
        assert_allclose(laboratory(grains.GetPrim(), points, code), lab, atol=4 * SINGLE)
    # half way between two frames each angle is half way, unwrapped, and each shift too
    frame = UsdGeom.Xformable(stage.GetPrimAtPath("/World/Frame"))
    angles = [op for op in frame.GetOrderedXformOps() if "angle" in op.GetName()]
    assert_allclose([op.Get(350.0) for op in angles], np.degrees([10.5, -8.75]), rtol=1e-12)
    assert all(op.GetOpType() != UsdGeom.XformOp.TypeTransform for op in frame.GetOrderedXformOps())


def test_resumed_run_keeps_the_nested_motion(tmp_path):
    for frames, options in ((range(4), {}), (range(2, 6), {"resume": True})):
        writer = UsdWriter(tmp_path, [], frames_per_chunk=3, **options)
        for k in frames:
            writer.write(replace(snapshot(k), frame=nested(k)))
    _, grains = open_grains(tmp_path)
    for k in range(6):
        lab = laboratory(grains.GetPrim(), np.eye(3), 100.0 * k)
        assert_allclose(lab, nested(k).to_laboratory(np.eye(3)), atol=1e-12)


def test_inertial_frame_has_no_ops_and_resumes(tmp_path):
    inertial = FramePose(np.eye(3), np.zeros(3), np.zeros(3), np.zeros(3))
    for frames, options in ((range(3), {}), (range(2, 4), {"resume": True})):
        writer = UsdWriter(tmp_path, [], **options)
        for k in frames:
            writer.write(replace(snapshot(k), frame=inertial))
    stage, grains = open_grains(tmp_path)
    assert UsdGeom.Xformable(stage.GetPrimAtPath("/World/Frame")).GetOrderedXformOps() == []
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (0.0, 300.0)
    for k in range(4):
        assert_allclose(grains.GetPointsAttr().Get(100.0 * k), snapshot(k).position, atol=SINGLE)


def test_grain_values_survive_across_chunks(tmp_path):
    write(tmp_path, range(8))
    assert len(list((tmp_path / "result_usd").glob("chunk_*.usdc"))) > 2
    _, grains = open_grains(tmp_path)
    assert_allclose(grains.GetPointsAttr().GetTimeSamples(), 100.0 * np.arange(8), atol=1e-9)
    for k in range(8):
        wanted, code = snapshot(k), 100.0 * k
        omega = UsdGeom.PrimvarsAPI(grains).GetPrimvar("omega")
        assert omega.GetInterpolation() == "vertex"
        assert_allclose(grains.GetWidthsAttr().Get(code), 2.0 * wanted.radius, rtol=SINGLE)
        assert_allclose(grains.GetVelocitiesAttr().Get(code), wanted.velocity, atol=SINGLE)
        assert_allclose(omega.Get(code), wanted.spin, atol=SINGLE)
        assert_array_equal(grains.GetIdsAttr().Get(code), wanted.id)
        radius = wanted.radius[:, None]
        extent = [(wanted.position - radius).min(axis=0), (wanted.position + radius).max(axis=0)]
        assert_allclose(grains.GetExtentAttr().Get(code), extent, atol=SINGLE)


def test_points_between_frames_are_interpolated_within_and_across_chunks(tmp_path):
    write(tmp_path, range(8))
    _, grains = open_grains(tmp_path)
    for k in range(7):
        between = 0.25 * snapshot(k).position + 0.75 * snapshot(k + 1).position
        assert_allclose(grains.GetPointsAttr().Get(100.0 * k + 75.0), between, atol=SINGLE)


def test_frame_angle_is_interpolated_unwrapped(tmp_path):
    write(tmp_path, range(8))
    _, grains = open_grains(tmp_path)
    frame = snapshot(0).frame
    # at half past frame 6 the frame has turned by 19.5 rad, more than three turns
    [part] = frame.parts
    half = FramePose.turned(part.axis, part.origin, 19.5, 0.0)
    points = np.eye(3)
    assert_allclose(laboratory(grains.GetPrim(), points, 650.0), half.to_laboratory(points), atol=1e-12)


def test_frame_view_is_one_variant_away(tmp_path):
    write(tmp_path, range(3))
    stage, grains = open_grains(tmp_path)
    view = stage.GetPrimAtPath("/World/Frame").GetVariantSet("view")
    assert view.GetVariantSelection() == "laboratory"
    view.SetVariantSelection("frame")
    assert_array_equal(laboratory(grains.GetPrim(), np.eye(3), 200.0), np.eye(3))


def test_stage_states_units_and_times_and_uses_no_matrices(tmp_path):
    write(tmp_path, range(8))
    stage, _ = open_grains(tmp_path)
    layer = stage.GetRootLayer()
    for key in ("metersPerUnit", "kilogramsPerUnit", "upAxis", "timeCodesPerSecond", "startTimeCode", "endTimeCode"):
        assert layer.pseudoRoot.HasInfo(key), key
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    assert UsdPhysics.GetStageKilogramsPerUnit(stage) == 1.0
    assert UsdGeom.GetStageUpAxis(stage) == "Z"
    assert (stage.GetTimeCodesPerSecond(), stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (1000.0, 0.0, 700.0)
    assert stage.GetDefaultPrim().GetPath() == "/World"
    for prim in stage.Traverse():
        for op in UsdGeom.Xformable(prim).GetOrderedXformOps() if prim.IsA(UsdGeom.Xformable) else []:
            assert op.GetOpType() != UsdGeom.XformOp.TypeTransform


def test_walls_are_two_sided_meshes_that_move_only_when_they_do(tmp_path):
    write(tmp_path, range(6))
    stage, _ = open_grains(tmp_path)
    prims = stage.GetPrimAtPath("/World/Frame/Walls").GetChildren()
    assert [prim.GetDisplayName() for prim in prims] == [BOX.name, PADDLE.name]
    box, paddle = (UsdGeom.Mesh(prim) for prim in prims)
    for mesh, wall in [(box, BOX), (paddle, PADDLE)]:
        assert_allclose(mesh.GetPointsAttr().Get(), wall.vertices, atol=SINGLE)
        assert_array_equal(mesh.GetFaceVertexIndicesAttr().Get(), wall.triangles.ravel())
        assert_array_equal(mesh.GetFaceVertexCountsAttr().Get(), [3, 3])
        assert mesh.GetDoubleSidedAttr().Get()
        assert_allclose(mesh.GetExtentAttr().Get(), [wall.vertices.min(axis=0), wall.vertices.max(axis=0)])
    assert not box.TransformMightBeTimeVarying()
    for k in range(6):
        wanted = snapshot(k)
        place = wanted.walls[PADDLE.name]
        points = PADDLE.vertices @ place.rotation.T + place.translation
        lab = laboratory(paddle.GetPrim(), PADDLE.vertices, 100.0 * k)
        assert_allclose(lab, wanted.frame.to_laboratory(points), atol=1e-12)
    # at rest until frame 2, then 2 rad per frame the short way round; 0.1 m per frame
    local = np.array(paddle.GetLocalTransformation(150.0))
    assert_allclose(local, np.eye(4), atol=1e-14)
    local = np.array(paddle.GetLocalTransformation(450.0))
    assert_allclose(local[:3, :3].T, turn([0, 0, 1], 5.0), atol=1e-12)
    assert_allclose(local[3, :3], [0.25, 0.0, 0.0], atol=1e-14)


def test_stage_is_whole_after_each_write(tmp_path):
    writer = UsdWriter(tmp_path, [BOX, PADDLE], frames_per_chunk=3)
    for k in range(5):
        writer.write(snapshot(k))
        copy = Usd.Stage.Open(str(tmp_path / "result.usda"))
        copy.Reload()
        assert copy.GetEndTimeCode() == 100.0 * k
        points = UsdGeom.Points.Get(copy, GRAINS).GetPointsAttr().Get(100.0 * k)
        assert_allclose(points, snapshot(k).position, atol=SINGLE)
    assert not [path for path in tmp_path.rglob("*") if ".part" in path.name]


def test_root_layer_stays_small(tmp_path):
    writer = UsdWriter(tmp_path, [BOX, PADDLE])
    for k in range(3):
        writer.write(snapshot(k, count=5000))
    assert (tmp_path / "result.usda").stat().st_size < 5000


def test_resumed_run_plays_old_and_new_frames(tmp_path):
    write(tmp_path, range(8), seed=1)
    write(tmp_path, range(3, 9), seed=2, resume=True)
    stage, grains = open_grains(tmp_path)
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (0.0, 800.0)
    assert_allclose(grains.GetPointsAttr().GetTimeSamples(), 100.0 * np.arange(9), atol=1e-9)
    for k in range(9):
        wanted, code = snapshot(k, seed=1 if k < 3 else 2), 100.0 * k
        points = np.array(grains.GetPointsAttr().Get(code), dtype=float)
        lab = laboratory(grains.GetPrim(), points, code)
        assert_allclose(lab, wanted.frame.to_laboratory(wanted.position), atol=4 * SINGLE)


def test_time_codes_per_second_is_free(tmp_path):
    writer = UsdWriter(tmp_path, [], time_codes_per_second=50.0)
    for k in range(2):
        writer.write(snapshot(k))
    stage, grains = open_grains(tmp_path)
    assert (stage.GetTimeCodesPerSecond(), stage.GetEndTimeCode()) == (50.0, 5.0)
    assert_allclose(grains.GetPointsAttr().Get(5.0), snapshot(1).position, atol=SINGLE)


def test_other_axis_in_mid_run_is_refused(tmp_path):
    writer = UsdWriter(tmp_path, [BOX, PADDLE])
    writer.write(snapshot(0))
    with pytest.raises(WarpdemError, match="axes or motions changed"):
        writer.write(snapshot(1, axis=(0, 0, 1)))


def test_frame_without_grains_is_written(tmp_path):
    writer = UsdWriter(tmp_path, [BOX, PADDLE])
    writer.write(snapshot(0, count=0))
    _, grains = open_grains(tmp_path)
    assert len(grains.GetPointsAttr().Get(0.0)) == 0


def test_a_simulation_in_a_nested_frame_is_shown_where_it_stands(tmp_path, make_simulation):
    """Grains of the USD stage and of the VTK files, taken to the laboratory, are those of the simulation."""
    frame = [
        {"amplitude": [0.25, 0, 0.125], "frequency": 8},
        {"axis": [0, 0, 1], "origin": [0.5, 0, 0.25], "rate": 16.0},
        {"axis": [0.6, 0, 0.8], "sinusoid": {"mean": 3, "amplitude": 8, "frequency": 2}},
    ]
    positions = [[1.0, 0, 0], [0, 1, -1], [-1, 0.5, 0.25]]
    sim = make_simulation(positions, step=2.0**-10, frame=frame, young_modulus=1.0, engine={"skin": 1e6})
    usd, vtk = UsdWriter(tmp_path, []), VtkWriter(tmp_path, [])
    wanted = []
    for _ in range(3):
        sim.step(300)
        wanted.append(sim.particles.position_lab)
        for writer in (usd, vtk):
            writer.write(sim.snapshot())
    _, grains = open_grains(tmp_path)
    results = read_results(tmp_path)
    for k, code in enumerate(grains.GetPointsAttr().GetTimeSamples()):
        points = np.array(grains.GetPointsAttr().Get(code), dtype=float)
        assert_allclose(laboratory(grains.GetPrim(), points, code), wanted[k], atol=1e-6)
        shot = results.frame(k)
        assert_allclose(shot.frame.to_laboratory(shot.position), wanted[k], atol=1e-14)
