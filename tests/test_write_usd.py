"""USD results as usd-core sees them: laboratory places, sizes, units, chunk borders, moving walls."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pxr import Usd, UsdGeom, UsdPhysics

from usd_stages import validation_errors
from warpdem import SceneError, Simulation, load_scene
from warpdem.app.run import run_scene
from warpdem.core.pose import FramePose, Placement, RotationPart, SampledPart, TranslationPart
from warpdem.core.snapshot import Snapshot, WallLoad, WallMesh
from warpdem.errors import WarpdemError
from warpdem.output.read_vtk import read_results
from warpdem.output.write_usd import UsdWriter
from warpdem.output.write_vtk import VtkWriter
from warpdem.scene.file import scene_from_dict

SCENES = Path(__file__).resolve().parent.parent / "scenes"
GRAINS = "/World/Frame/Grains"
# names that USD does not allow, and that would become equal
BOX = WallMesh("the box", np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]), np.array([[0, 1, 2], [0, 2, 3]]))
PADDLE = WallMesh("the-box", 0.5 * BOX.vertices, BOX.triangles)
SINGLE = 2e-7  # float32 rounding of numbers about 1


def turn(axis, angle):
    return FramePose.rotated(np.asarray(axis, dtype=float), np.zeros(3), angle, 0.0).rotation


def snapshot(k, axis=(0.48, 0.6, 0.64), origin=(0.1, -0.2, 0.3), count=30, seed=0):
    rng = np.random.default_rng([seed, k])
    return Snapshot(
        step=k,
        time=0.1 * k,
        # almost half a turn per frame: the least that quaternions or matrices would interpolate the wrong way
        frame=FramePose.rotated(np.array(axis, dtype=float), np.array(origin), 3.0 * k, 30.0),
        id=np.arange(count) * 3,
        type=np.zeros(count, dtype=np.int32),
        group=np.zeros(count, dtype=np.int32),
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
        assert_allclose(lab, wanted.frame.to_laboratory(wanted.position), rtol=0, atol=4 * SINGLE)


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
            place = FramePose.rotated(part.axis, part.origin, part.angle, 0.0)
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
        assert_allclose(laboratory(grains.GetPrim(), np.eye(3), code), nested(k).to_laboratory(np.eye(3)), rtol=0, atol=1e-12)
        points = np.array(grains.GetPointsAttr().Get(code), dtype=float)
        lab = nested(k).to_laboratory(wanted.position)
        assert_allclose(laboratory(grains.GetPrim(), points, code), lab, rtol=0, atol=4 * SINGLE)
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
        assert_allclose(lab, nested(k).to_laboratory(np.eye(3)), rtol=0, atol=1e-12)


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
        assert_allclose(grains.GetPointsAttr().Get(100.0 * k), snapshot(k).position, rtol=0, atol=SINGLE)


def test_grain_values_survive_across_chunks(tmp_path):
    write(tmp_path, range(8))
    assert len(list((tmp_path / "result_usd").glob("chunk_*.usdc"))) > 2
    _, grains = open_grains(tmp_path)
    assert_allclose(grains.GetPointsAttr().GetTimeSamples(), 100.0 * np.arange(8), rtol=0, atol=1e-9)
    for k in range(8):
        wanted, code = snapshot(k), 100.0 * k
        omega = UsdGeom.PrimvarsAPI(grains).GetPrimvar("omega")
        assert omega.GetInterpolation() == "vertex"
        assert_allclose(grains.GetWidthsAttr().Get(code), 2.0 * wanted.radius, rtol=SINGLE)
        assert_allclose(grains.GetVelocitiesAttr().Get(code), wanted.velocity, rtol=0, atol=SINGLE)
        assert_allclose(omega.Get(code), wanted.spin, rtol=0, atol=SINGLE)
        assert_array_equal(grains.GetIdsAttr().Get(code), wanted.id)
        radius = wanted.radius[:, None]
        extent = [(wanted.position - radius).min(axis=0), (wanted.position + radius).max(axis=0)]
        # the box holds all grains, with room for the largest one everywhere
        beyond = np.array([[1.0], [-1.0]]) * (np.array(extent) - np.array(grains.GetExtentAttr().Get(code)))
        assert (beyond >= -SINGLE).all() and (beyond <= wanted.radius.max() - wanted.radius.min() + SINGLE).all()


def test_points_between_frames_are_interpolated_within_and_across_chunks(tmp_path):
    write(tmp_path, range(8))
    _, grains = open_grains(tmp_path)
    for k in range(7):
        between = 0.25 * snapshot(k).position + 0.75 * snapshot(k + 1).position
        assert_allclose(grains.GetPointsAttr().Get(100.0 * k + 75.0), between, rtol=0, atol=SINGLE)


def test_frame_angle_is_interpolated_unwrapped(tmp_path):
    write(tmp_path, range(8))
    _, grains = open_grains(tmp_path)
    frame = snapshot(0).frame
    # at half past frame 6 the frame has turned by 19.5 rad, more than three turns
    [part] = frame.parts
    half = FramePose.rotated(part.axis, part.origin, 19.5, 0.0)
    points = np.eye(3)
    assert_allclose(laboratory(grains.GetPrim(), points, 650.0), half.to_laboratory(points), rtol=0, atol=1e-12)


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
        assert_allclose(mesh.GetPointsAttr().Get(), wall.vertices, rtol=0, atol=SINGLE)
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
        assert_allclose(lab, wanted.frame.to_laboratory(points), rtol=0, atol=1e-12)
    # at rest until frame 2, then 2 rad per frame the short way round; 0.1 m per frame
    local = np.array(paddle.GetLocalTransformation(150.0))
    assert_allclose(local, np.eye(4), rtol=0, atol=1e-14)
    local = np.array(paddle.GetLocalTransformation(450.0))
    assert_allclose(local[:3, :3].T, turn([0, 0, 1], 5.0), rtol=0, atol=1e-12)
    assert_allclose(local[3, :3], [0.25, 0.0, 0.0], rtol=0, atol=1e-14)


def test_stage_is_whole_after_each_write(tmp_path):
    writer = UsdWriter(tmp_path, [BOX, PADDLE], frames_per_chunk=3)
    for k in range(5):
        writer.write(snapshot(k))
        copy = Usd.Stage.Open(str(tmp_path / "result.usda"))
        copy.Reload()
        assert copy.GetEndTimeCode() == 100.0 * k
        points = UsdGeom.Points.Get(copy, GRAINS).GetPointsAttr().Get(100.0 * k)
        assert_allclose(points, snapshot(k).position, rtol=0, atol=SINGLE)
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
    assert_allclose(grains.GetPointsAttr().GetTimeSamples(), 100.0 * np.arange(9), rtol=0, atol=1e-9)
    for k in range(9):
        wanted, code = snapshot(k, seed=1 if k < 3 else 2), 100.0 * k
        points = np.array(grains.GetPointsAttr().Get(code), dtype=float)
        lab = laboratory(grains.GetPrim(), points, code)
        assert_allclose(lab, wanted.frame.to_laboratory(wanted.position), rtol=0, atol=4 * SINGLE)


def test_time_codes_per_second_is_free(tmp_path):
    writer = UsdWriter(tmp_path, [], time_codes_per_second=50.0)
    for k in range(2):
        writer.write(snapshot(k))
    stage, grains = open_grains(tmp_path)
    assert (stage.GetTimeCodesPerSecond(), stage.GetEndTimeCode()) == (50.0, 5.0)
    assert_allclose(grains.GetPointsAttr().Get(5.0), snapshot(1).position, rtol=0, atol=SINGLE)


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


def layers_of(folder) -> list[Path]:
    """All stages and layers of a result."""
    return [*folder.glob("*.usd?"), *(folder / "result_usd").glob("*.usd?")]


def test_stages_and_all_their_layers_are_valid(tmp_path):
    """With loads on walls, over several chunks, after a resume, and with grains that come after the first frame."""
    load = WallLoad(np.ones(3), np.zeros(3), np.zeros(3), 0.0, np.zeros((2, 3)), np.array([1.0, 2.0]))
    late = {"id": np.zeros(0, int), "position": np.zeros((0, 3)), "velocity": np.zeros((0, 3)), "spin": np.zeros((0, 3))}
    late |= {name: np.zeros(0) for name in ("radius", "mass")} | {name: np.zeros(0, np.int32) for name in ("type", "group")}
    for frames, options in ((range(5), {}), (range(3, 8), {"resume": True})):
        writer = UsdWriter(tmp_path, [BOX, PADDLE], frames_per_chunk=3, **options)
        for k in frames:
            shot = replace(snapshot(k), loads={BOX.name: load})
            writer.write(replace(shot, **late) if k == 0 else shot)
    assert len(layers_of(tmp_path)) > 8
    assert {path.name: validation_errors(path) for path in layers_of(tmp_path)} == {p.name: [] for p in layers_of(tmp_path)}


def test_without_a_time_the_grains_are_those_of_the_first_frame_that_has_any(tmp_path):
    write(tmp_path, range(5), seed=1)
    write(tmp_path, range(3, 6), seed=2, resume=True)
    stage, grains = open_grains(tmp_path)
    assert_allclose(grains.GetPointsAttr().Get(), snapshot(0, seed=1).position, rtol=0, atol=SINGLE)
    assert_allclose(grains.GetWidthsAttr().Get(), 2.0 * snapshot(0, seed=1).radius, rtol=SINGLE)
    # and hide no frame
    for k in range(6):
        wanted = snapshot(k, seed=1 if k < 3 else 2).position
        assert_allclose(grains.GetPointsAttr().Get(100.0 * k), wanted, rtol=0, atol=SINGLE)
    # a chunk by itself plays at the same pace
    chunk = Usd.Stage.Open(str(tmp_path / "result_usd" / "chunk_0000.usdc"))
    assert chunk.GetTimeCodesPerSecond() == stage.GetTimeCodesPerSecond()


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
        assert_allclose(laboratory(grains.GetPrim(), points, code), wanted[k], rtol=0, atol=1e-6)
        shot = results.frame(k)
        assert_allclose(shot.frame.to_laboratory(shot.position), wanted[k], rtol=0, atol=1e-14)


MOVING = {
    "title": "box on its way",
    "gravity": [0, 0, -9.81],
    "materials": {name: {"density": 2500.0, "young_modulus": 5e6, "poisson_ratio": 0.3} for name in ("glass", "wood bead")},
    "contact": {"tangential": "mindlin"},
    "pairs": [
        {"materials": [a, b], "restitution": 0.5, "friction": 0.5}
        for a, b in (("glass", "glass"), ("wood bead", "glass"), ("wood bead", "wood bead"))
    ],
    "grains": [
        {"material": "wood bead", "name": "tracer", "positions": [[0.011, 0.0, 0.03]], "radius": 0.004, "spins": [[1, 2, 3]]},
        {"material": "glass", "fill": {"box": {"min": [-0.04, -0.04, -0.04], "max": [0.04, 0.04, 0.0]}, "count": 20,
                                       "diameter": {"uniform": [0.006, 0.01]}}},
    ],
    "walls": [{"name": "the-box", "material": "glass", "mesh": "meshes/box.stl", "scale": 0.1,
               "translate": [-0.05, -0.05, -0.05], "fixed_to": "laboratory",
               "motion": [{"velocity": [1.0, 0.0, 0.0]}, {"axis": [0, 1, 0], "rate": 2.0}]}],
    "frame": [{"axis": [0, 0, 1], "schedule": [{"until": 0.1, "rate": [0, 3]}, {"rate": 3}]}, {"velocity": [0.1, 0, 0]}],
    "streams": [{"material": "glass", "diameter": 0.006, "count_rate": 1.0, "start": 1.0,
                 "box": {"min": [-0.01, -0.01, 0], "max": [0.01, 0.01, 0.02]}}],
    "time": {"end": 0.15, "step": 2e-5, "max_speed": 2.0},
    "output": {"formats": ["usd"], "interval": 0.05, "picture": False, "orientation": True},
}  # fmt: skip
"""A frame that turns and shifts, and a closed box that leaves it."""


@pytest.fixture(scope="module")
def moved(tmp_path_factory):
    """Folder of a run of MOVING, and its snapshots."""
    folder = tmp_path_factory.mktemp("moved")
    (folder / "meshes").symlink_to(SCENES / "meshes")
    scene = scene_from_dict(MOVING, folder)
    taken = []
    sim = Simulation(scene, device="cpu", threads=1)
    for time in (0.0, 0.05, 0.1, 0.15):
        sim.run(until=time)
        taken.append(sim.snapshot())
    run_scene(scene, folder / "out", device="cpu", threads=1, quiet=True)
    return folder / "out", taken


@pytest.mark.parametrize("k", [0, 1, 2, 3])
def test_a_frame_is_a_scene_that_goes_on_with_the_same_numbers(moved, k):
    folder, taken = moved
    scene = load_scene(folder / "result.usda", ["time.end=0.01"], at=0.05 * k)
    sim = Simulation(scene, device="cpu", threads=1)
    now, then = sim.snapshot(), taken[k]
    wanted_of = {"positions": then.position, "velocities": then.velocity, "spins": then.spin, "radii": then.radius}
    for key, wanted in wanted_of.items():
        held = np.concatenate([getattr(group, key) for group in scene.grains])
        order = np.argsort(np.concatenate([group.ids for group in scene.grains]))
        assert_array_equal(held[order], wanted, err_msg=key)
    for name in ("id", "type", "radius", "position"):
        assert_array_equal(getattr(now, name), getattr(then, name), err_msg=name)
    # the engine's own absolute velocities round once
    assert_allclose(now.velocity, then.velocity, rtol=0, atol=4e-16)
    assert_allclose(now.spin, then.spin, rtol=0, atol=4e-15)
    # numbers of groups may be others, names are not
    assert [sim.scene.groups[g] for g in now.group] == ["tracer", *["grains[1]"] * 20]
    assert_allclose(now.frame.rotation, then.frame.rotation, rtol=0, atol=1e-15)
    assert_allclose(now.frame.translation, then.frame.translation, rtol=0, atol=1e-15)
    assert_allclose(now.frame.spin, then.frame.spin, rtol=0, atol=1e-14)
    assert_allclose(now.walls["the-box"].translation, then.walls["the-box"].translation, rtol=0, atol=1e-15)
    assert sim.time == 0.0
    assert ("without contact history" in scene.title) == (k > 0)
    assert scene.streams[0].start == pytest.approx(1.0 - 0.05 * k)


def test_a_run_from_a_frame_goes_the_way_of_the_run_before(moved):
    """Frame, gravity and walls go on as they were: without the springs of contacts the ways part slowly only."""
    folder, taken = moved
    sim = Simulation(load_scene(folder / "result.usda", at=0.1), device="cpu", threads=1)
    assert sim.scene.time.end == pytest.approx(0.05)
    sim.run(until=0.05)
    last = sim.snapshot()
    assert_allclose(last.frame.rotation, taken[3].frame.rotation, rtol=0, atol=1e-14)
    assert_allclose(last.walls["the-box"].rotation, taken[3].walls["the-box"].rotation, rtol=0, atol=1e-14)
    assert np.abs(last.position - taken[3].position).max() < 0.1 * np.abs(taken[3].position - taken[2].position).max()


def test_result_holds_all_it_needs_and_is_found_by_time(moved, tmp_path):
    folder, _ = moved
    assert {path.name: validation_errors(path) for path in layers_of(folder)} == {p.name: [] for p in layers_of(folder)}
    # meshes lie beside the results, so that no other folder is asked for
    assert (folder / "result_usd" / "box.stl").is_file()
    first = load_scene(folder / "result.usda", at=0.0)
    assert first.walls[0].mesh == "result_usd/box.stl"
    assert first.notes == ("/World/Frame/Grains: not taken of the grains: primvars:orientation",)
    scene = load_scene(folder / "result.usda", at=0.06)
    assert scene.frame[0].elapsed == pytest.approx(0.05)
    with pytest.raises(SceneError, match="at = 0.2 s: its frames lie between 0 and 0.15 s"):
        load_scene(folder / "result.usda", at=0.2)
    with pytest.raises(SceneError, match=r"time.end\n +missing: End of the run"):
        load_scene(folder / "result.usda")
    # the scene as it was run, with grains of its own again
    again = load_scene(folder / "scene.usda")
    assert [group.fill is None for group in again.grains] == [True, False]
    assert again.grains[0].positions.tolist() == MOVING["grains"][0]["positions"]


def test_orientation_is_written_with_the_scalar_where_usd_has_it(moved):
    folder, taken = moved
    _, grains = open_grains(folder)
    turned = UsdGeom.PrimvarsAPI(grains).GetPrimvar("orientation").Get(150.0)[0]
    found = [turned.GetReal(), *turned.GetImaginary()]
    assert_allclose(found, taken[3].orientation[0], rtol=0, atol=SINGLE)
    assert abs(found[0]) < 0.99


def test_state_keeps_its_digits_over_chunks_and_resume(tmp_path):
    write(tmp_path, range(8), seed=1)
    write(tmp_path, range(3, 9), seed=2, resume=True)
    assert len(list((tmp_path / "result_usd").glob("state_*.usdc"))) > 2
    _, grains = open_grains(tmp_path)
    api = UsdGeom.PrimvarsAPI(grains)
    for k in range(9):
        wanted = snapshot(k, seed=1 if k < 3 else 2)
        for name, values in (("positions", wanted.position), ("velocities", wanted.velocity), ("spins", wanted.spin),
                             ("radii", wanted.radius), ("types", wanted.type)):  # fmt: skip
            assert_array_equal(np.array(api.GetPrimvar(f"dem:{name}").Get(100.0 * k)), values)


def test_mesh_files_of_one_name_are_kept_apart_and_equal_ones_once(tmp_path):
    """Two folders hold a file of the same name: each content is copied beside the results once, whoever names it."""
    files = []
    for folder, content in (("a", b"solid one"), ("b", b"solid two"), ("c", b"solid one")):
        (tmp_path / folder).mkdir()
        files.append(tmp_path / folder / "part.stl")
        files[-1].write_bytes(content)
    writer = UsdWriter(tmp_path / "out", [])
    kept = [writer._kept_file(file) for file in files]
    assert kept == ["result_usd/part.stl", "result_usd/part_2.stl", "result_usd/part.stl"]
    assert (tmp_path / "out" / kept[1]).read_bytes() == b"solid two"
