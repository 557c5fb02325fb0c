"""Scenes that start from the checkpoint of another: what goes on does so in the laboratory, springs included."""

import math

import numpy as np
import pytest
import trimesh

from warpdem import Scene, SceneError, Simulation
from warpdem.scene.motion import FixedPlacement
from warpdem.scene.rotation import Rotation
from warpdem.state import checkpoint_file

STEP = 2e-5
RATE = 30.0
RAMP = {"axis": [0, 1, 0], "schedule": [{"until": 0.01, "rate": [0, RATE]}, {"rate": RATE}]}


def tables(**changes) -> dict:
    """A small heap on a floor, in axes that come to turn: springs stretched and bent."""
    cell = np.stack(np.meshgrid(np.arange(3), np.arange(3), np.arange(2), indexing="ij"), axis=-1).reshape(-1, 3)
    data = {
        "gravity": [0, 0, -60],
        "materials": {"glass": {"density": 2500, "young_modulus": 4e6, "poisson_ratio": 0.3}},
        "contact": {"rolling": "spring"},
        "pairs": [{"materials": ["glass", "glass"], "restitution": 0.6, "friction": 0.5, "rolling_friction": 0.2}],
        "grains": [
            {"material": "glass", "name": "heap", "positions": (cell - [1, 1, 0]) * 1.995e-3 + [0, 0, 0.99e-3],
             "radius": 1e-3, "ids": np.random.default_rng(1).permutation(18) + 5}
        ],
        "walls": [{"name": "floor", "material": "glass", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}],
        "frame": RAMP,
        "time": {"end": 1, "step": STEP, "max_speed": 1},
        "engine": {"max_overlap": 0.3},
    }  # fmt: skip
    return data | changes


def scene(**changes) -> Scene:
    return Scene.model_validate(tables(**changes))


def simulation(*args, **keys) -> Simulation:
    return Simulation(*args, device="cpu", threads=1, **keys)


@pytest.fixture(scope="module")
def before():
    sim = simulation(scene())
    sim.step(300)
    assert np.abs(sim.contacts().spring).max() > 1e-7
    return sim


@pytest.fixture(scope="module")
def saved(before, tmp_path_factory):
    path = tmp_path_factory.mktemp("start") / "before.h5"
    before.save_checkpoint(path)
    return path


def assert_same_motion(first, second, rtol=1e-13):
    a, b = first.particles, second.particles
    for name in ("id", "type", "radius", "mass", "position_lab", "velocity_lab", "spin_lab"):
        values = getattr(a, name)
        np.testing.assert_allclose(getattr(b, name), values, rtol=0, atol=rtol * np.abs(values).max(), err_msg=name)


@pytest.mark.parametrize("frame", [RAMP, {"axis": [0, 1, 0], "rate": RATE}, {"axis": [1, 0, 0], "rate": 5}, None])
def test_grains_go_on_in_the_laboratory_whatever_the_frame_does(before, saved, frame):
    after = simulation(scene(frame=frame), start=saved)
    assert (after.step_number, after.time) == (0, 0.0)
    assert_same_motion(before, after)
    # the axes stand where they stood, and gravity with them
    np.testing.assert_allclose(after.particles.position, before.particles.position, rtol=0, atol=1e-17)
    np.testing.assert_allclose(after.schedule.rows(0, 1)[0, 2:5], before.schedule.rows(300, 1)[0, 2:5], rtol=1e-14)


def test_springs_go_on(before, saved):
    after = simulation(scene(frame={"axis": [0, 1, 0], "rate": RATE}), start=saved)
    first, second = before.contacts(), after.contacts()
    np.testing.assert_array_equal(second.i, first.i)
    np.testing.assert_array_equal(second.j, first.j)
    np.testing.assert_allclose(second.spring, first.spring, rtol=0, atol=2e-3 * np.abs(first.spring).max())
    # dashpots see the velocity of the instant, not one predicted for it: not the same in contacts that have just begun
    apart = np.abs(second.force - first.force).max(axis=1)
    assert np.quantile(apart, 0.7) < 2e-3 * np.abs(first.force).max()
    assert np.abs(checkpoint_file.read(saved)["pair_history"][:, 3:]).max() > 0


def distance(first, second) -> float:
    return float(np.abs(first.particles.position_lab - second.particles.position_lab).max())


def test_a_cut_run_keeps_to_the_path_of_the_whole_one(before, saved, tmp_path):
    """The frame's schedule goes on when asked to; without the springs the path is another."""
    whole = simulation(scene())
    whole.step(600)
    going = {"checkpoint": str(saved), "continues": ["frame"]}
    cut = simulation(scene(grains=[], start=going))
    assert cut.scene.frame[0].elapsed == 300 * STEP
    cut.step(300)
    cut.save_checkpoint(tmp_path / "again.h5")
    again = simulation(scene(grains=[], start={**going, "checkpoint": str(tmp_path / "again.h5")}))
    assert again.scene.frame[0].elapsed == pytest.approx(600 * STEP)
    bare = simulation(scene(grains=[], contact={"rolling": "none"}, pairs=NO_ROLLING, start=going))
    bare.step(300)
    assert distance(whole, cut) < 1e-7 < 1e-6 < distance(whole, bare)
    assert_same_motion(cut, again)


NO_ROLLING = [{"materials": ["glass", "glass"], "restitution": 0.6, "friction": 0.5}]


@pytest.mark.parametrize("integrator", ["velocity_verlet", "exact_drift"])
def test_other_integrators_hand_on_the_same_motion(integrator, tmp_path):
    first = simulation(scene(engine={"integrator": "velocity_verlet", "max_overlap": 0.3}))
    first.step(100)
    first.save_checkpoint(tmp_path / "first.h5")
    second = simulation(scene(engine={"integrator": integrator, "max_overlap": 0.3}), start=tmp_path / "first.h5")
    assert_same_motion(first, second)


@pytest.fixture(scope="module")
def box(tmp_path_factory):
    path = tmp_path_factory.mktemp("start") / "box.stl"
    trimesh.creation.box((30e-3, 30e-3, 10e-3)).export(path)
    return path


def boxed(box, fixed_to="frame", motion=None, **changes) -> Scene:
    wall = {"name": "box", "material": "glass", "mesh": str(box), "translate": [0, 0, 5e-3], "fixed_to": fixed_to}
    return scene(walls=[wall | ({"motion": motion} if motion else {})], **changes)


@pytest.mark.parametrize("then", ["frame", "laboratory"])
@pytest.mark.parametrize("now", ["frame", "laboratory"])
def test_walls_stand_where_they_stood(box, tmp_path, then, now):
    """A box that turns and a frame that turns, then a box that shifts in a frame that rests."""
    first = simulation(boxed(box, then, {"axis": [0, 0, 1], "rate": 20}))
    first.step(150)
    first.save_checkpoint(tmp_path / "first.h5")
    second = simulation(boxed(box, now, {"velocity": [0.1, 0, 0]}, frame=None), start=tmp_path / "first.h5")
    ended, begun = first.schedule.bodies(first.time)[0, :12], second.schedule.bodies(0.0)[0, :12]
    np.testing.assert_allclose(begun, ended, rtol=0, atol=1e-15)
    assert_same_motion(first, second)
    second.step(50)
    turn, shift = second.schedule.bodies(0.0)[0, :9].reshape(3, 3), second.schedule.bodies(second.time)[0, 9:12]
    way = shift - second.schedule.bodies(0.0)[0, 9:12]
    lab = second.schedule.frame.pose(np.zeros(1)).axes[0].astype(float)
    along = np.array([0.1 * second.time, 0, 0])
    np.testing.assert_allclose(lab @ way if now == "laboratory" else way, along, rtol=0, atol=1e-15)
    assert not np.allclose(turn, np.eye(3))
    # the springs at the wall went on: at rest on it the grains carry what they carried
    assert len(second.contacts().i) > 10


def test_a_wall_that_continues_keeps_its_time(box, tmp_path):
    motion = {"axis": [0, 0, 1], "schedule": [{"until": 0.002, "rate": 20}, {"rate": 0}]}
    first = simulation(boxed(box, "frame", motion, frame=None))
    first.step(150)
    first.save_checkpoint(tmp_path / "first.h5")
    going = {"checkpoint": str(tmp_path / "first.h5"), "continues": ["box"]}
    second = simulation(boxed(box, "frame", motion, frame=None, grains=[], start=going))
    np.testing.assert_allclose(second.schedule.bodies(0.005)[0, :12], first.schedule.bodies(0.008)[0, :12], rtol=0, atol=1e-15)
    anew = simulation(boxed(box, "frame", motion, frame=None), start=tmp_path / "first.h5")
    angle = 2 * 0.002 * 20
    np.testing.assert_allclose(anew.schedule.bodies(0.005)[0, :2], [math.cos(angle), -math.sin(angle)], rtol=0, atol=1e-15)


def lidded(height, motion=None, name="lid", shape="plane", **changes) -> Scene:
    """The heap below a lid at ``height`` [m], in axes that do not move."""
    surface = {"point": [0, 0, height], "normal": [0, 0, -1]}
    if shape == "cylinder":
        surface = {"point": [0, 0, height + 1.0], "axis": [1, 0, 0], "radius": 1.0, "inside": False}
    lid = {"name": name, "material": "glass", shape: surface} | ({"motion": motion} if motion else {})
    return scene(walls=[*tables()["walls"], lid], frame=None, **changes)


@pytest.fixture(scope="module")
def lowered(tmp_path_factory):
    """A lid that has come down by 60 um."""
    sim = simulation(lidded(4.0e-3, {"velocity": [0, 0, -0.01]}))
    sim.step(300)
    path = tmp_path_factory.mktemp("start") / "lowered.h5"
    sim.save_checkpoint(path)
    assert sim.wall_loads()["lid"].force[2] > 1e-4
    return sim, path


@pytest.mark.parametrize("change", ["plane", "cylinder"])
def test_a_wall_with_another_geometry_stands_where_it_is_drawn_and_says_so(lowered, change):
    """Drawn where the run before had left it, and where it was: the same place, not one twice as far."""
    path = lowered[1]
    drawn = simulation(lidded(4.0e-3 - 6e-5, shape=change), start=path)
    np.testing.assert_array_equal(drawn.schedule.bodies(0.0)[1, :12], [1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0])
    (note,) = [note for note in drawn.notes if note.startswith("start: wall")]
    assert "'lid'" in note and "shifted by (0, 0, -6e-05) m" in note and "start.continues" in note
    if change == "plane":
        unchanged = simulation(lidded(4.0e-3), start=path)
        assert not any("geometry" in note for note in unchanged.notes)
        assert unchanged.schedule.bodies(0.0)[1, 11] == pytest.approx(-6e-5)
        one, two = unchanged.wall_loads()["lid"].force, drawn.wall_loads()["lid"].force
        np.testing.assert_allclose(two, one, rtol=0, atol=1e-9 * one[2])
        # its springs go on too
        np.testing.assert_allclose(drawn.contacts().spring, unchanged.contacts().spring, rtol=0, atol=1e-15)
        assert len(drawn.contacts().i) == len(unchanged.contacts().i)


def test_a_redrawn_wall_goes_on_in_its_own_time_if_that_is_asked_for(lowered):
    motion = {"velocity": [0, 0, -0.01]}
    going = {"checkpoint": str(lowered[1]), "continues": ["lid"]}
    sim = simulation(lidded(4.001e-3, motion, grains=[], start=going))
    assert sim.schedule.bodies(0.0)[1, 11] == pytest.approx(-6e-5)
    assert any("goes on from there" in note for note in sim.notes)


def test_a_redrawn_wall_is_looked_at_like_a_new_one(lowered):
    with pytest.raises(SceneError, match="lid"):
        simulation(lidded(3.0e-3), start=lowered[1])


def test_a_wall_by_another_name_says_where_it_stands(lowered):
    sim = simulation(lidded(4.0e-3, name="top"), start=lowered[1])
    assert any(note.startswith("start: wall 'top' stands where this scene draws it; 'lid'") for note in sim.notes)
    assert not any("stands where" in note for note in simulation(lidded(3.99e-3, name="top"), start=lowered[1]).notes)


def test_contents_of_a_mesh_file_are_its_geometry_whatever_it_is_called(box, tmp_path):
    mine, other = tmp_path / "box.stl", tmp_path / "other.stl"
    mine.write_bytes(box.read_bytes())
    first = simulation(boxed(mine, motion={"axis": [0, 0, 1], "rate": 20}, frame=None))
    first.step(150)
    first.save_checkpoint(tmp_path / "first.h5")
    other.write_bytes(mine.read_bytes())
    same = simulation(boxed(other, frame=None), start=tmp_path / "first.h5")
    assert same.schedule.bodies(0.0)[0, 1] != 0.0
    trimesh.creation.box((31e-3, 30e-3, 10e-3)).export(mine)
    edited = simulation(boxed(mine, frame=None), start=tmp_path / "first.h5")
    np.testing.assert_array_equal(edited.schedule.bodies(0.0)[0, :12], [1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0])
    assert any("turned by 3.43775 degrees" in note for note in edited.notes)


def test_other_walls_and_laws_drop_springs_and_say_so(saved):
    floor = {"name": "ground", "material": "glass", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}
    sim = simulation(scene(walls=[floor], contact={"tangential": "mindlin_displacement", "rolling": "spring"}), start=saved)
    assert any("springs at wall floor begin at zero" in note for note in sim.notes)
    assert any("contact.tangential differs" in note for note in sim.notes)
    assert np.abs(sim.contacts().spring).max() == 0.0


def test_groups_orientation_and_ids_go_on(tmp_path):
    kept = {"orientation": True}
    first = simulation(scene(output=kept))
    first.step(100)
    first.save_checkpoint(tmp_path / "first.h5")
    second = simulation(scene(output=kept, streams=[RAIN | {"count_rate": 1e5}]), start=tmp_path / "first.h5")
    assert second.scene.groups == ["heap", "rain"]
    np.testing.assert_array_equal(second.particles.orientation, first.particles.orientation)
    assert np.abs(first.particles.orientation[:, 1:]).max() > 1e-3
    second.step(60)
    came = second.particles.id[second.particles.group == 1]
    assert len(came) and came.min() == first.particles.id.max() + 1


RAIN = {
    "material": "glass", "name": "rain", "box": {"min": [-0.01, -0.01, 0.02], "max": [0.01, 0.01, 0.03]},
    "diameter": 2e-3, "count_rate": 1e4, "until": 0.01,
}  # fmt: skip


def test_streams_begin_anew_or_go_on(tmp_path):
    first = simulation(scene(streams=[RAIN]))
    first.step(200)
    first.save_checkpoint(tmp_path / "first.h5")
    came = len(first.state)
    start = {"checkpoint": str(tmp_path / "first.h5")}
    for continues, until in (([], 0.01), (["streams"], 0.006)):
        then = simulation(scene(streams=[RAIN], grains=[], start={**start, "continues": continues}))
        assert then.scene.streams[0].until == pytest.approx(until)
        then.step(350)
        more = then.particles.radius[then.particles.id > first.particles.id.max()]
        assert len(more) == pytest.approx(1e4 * min(until, then.time), abs=10)
    assert came == pytest.approx(18 + 40, abs=10)


def test_a_run_from_a_start_resumes_to_the_same_bits(saved, tmp_path):
    whole = simulation(scene(), start=saved)
    whole.step(40)
    cut = simulation(scene(), start=saved)
    cut.step(15)
    cut.save_checkpoint(tmp_path / "cut.h5")
    again = Simulation.from_checkpoint(tmp_path / "cut.h5", device="cpu", threads=2)
    again.step(25)
    assert again.state_hash() == whole.state_hash()


def test_start_with_other_contents_is_another_scene(before, tmp_path):
    before.save_checkpoint(tmp_path / "start.h5")
    sim = simulation(scene(), start=tmp_path / "start.h5")
    sim.save_checkpoint(tmp_path / "saved.h5")
    other = simulation(scene())
    other.step(3)
    other.save_checkpoint(tmp_path / "start.h5")
    with pytest.raises(SceneError, match="other contents of the file of start.checkpoint"):
        Simulation.from_checkpoint(tmp_path / "saved.h5", device="cpu", threads=1)


def test_wrong_starts_are_named(saved, tmp_path):
    steel = {"density": 7800, "young_modulus": 1e7, "poisson_ratio": 0.3}
    with pytest.raises(SceneError, match=r"start.checkpoint = .*before.h5': its grains are of glass; the scene has no such"):
        simulation(
            scene(
                materials={"steel": steel}, pairs=[{"materials": ["steel", "steel"], "restitution": 0.5}],
                grains=[{"material": "steel", "positions": [[0, 0, 1]], "radius": 1e-3}], contact={},
                walls=[],
            ),
            start=saved,
        )  # fmt: skip
    both = {"glass": tables()["materials"]["glass"], "steel": steel}
    wall = {"name": "floor", "material": "steel", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}
    of_none = Scene.model_validate(tables(materials=both, walls=[wall], grains=[], start={"checkpoint": str(saved)}))
    with pytest.raises(SceneError, match=r'without coefficients: add \[\[pairs\]\] with materials = \["glass", "steel"\]'):
        simulation(of_none)
    for names, text in (
        (["lid"], r'start.continues: "lid" is not in both scenes; allowed: frame, streams, floor'),
        (["frame"], r'start.continues: "frame" is not what it was in .*before.h5'),
    ):
        going = {"checkpoint": str(saved), "continues": names}
        with pytest.raises(SceneError, match=text):
            simulation(scene(grains=[], frame=None, start=going))
    (tmp_path / "text.h5").write_text("nothing")
    with pytest.raises(SceneError, match=r"text.h5: damaged or not a checkpoint"):
        simulation(scene(), start=tmp_path / "text.h5")
    with pytest.raises(SceneError, match=r"none.h5: no checkpoint there"):
        simulation(scene(), start=tmp_path / "none.h5")


def test_grains_cannot_stand_beside_a_start(saved):
    with pytest.raises(SceneError, match="cannot be given together with start, which provides the grains"):
        scene(start={"checkpoint": str(saved)})


def test_later_moves_the_clock_of_motions_and_streams():
    stream = {"material": "glass", "box": {"min": [0, 0, 1], "max": [1, 1, 2]}, "diameter": 2e-3, "count_rate": 10.0}
    motion = [{"axis": [0, 0, 1], "rate": 1.0, "elapsed": 0.5}, {"shift": [1, 0, 0]}]
    was = scene(frame=motion, streams=[stream | {"until": 1.0}, stream | {"start": 3.0}, stream | {"until": 4.0}])
    then = was.later(2.0)
    assert [type(motion) for motion in then.frame] == [Rotation, FixedPlacement]
    assert then.frame[0].elapsed == 2.5
    assert [(s.start, s.until) for s in then.streams] == [(1.0, None), (0.0, 2.0)]
