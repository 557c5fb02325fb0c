"""Residence times of grains that leave: by group and outlet, from a stream, in history.csv, after a resume, and as a table."""

import csv

import numpy as np
import pytest

from warpdem import SceneError, Simulation
from warpdem.app.run import run_scene
from warpdem.scene.file import scene_from_dict

ASKED = {
    "residence": [
        {"name": "all"}, {"name": "red", "of": {"group": "red"}}, {"name": "right", "outlet": "right"},
        {"name": "low", "outlet": "x min"},
    ]
}  # fmt: skip


def data(**more):
    """Grains that fly apart, each on its lane: to the right in 10, 20 and 40 ms, to the left in 25 ms; one that stays."""
    def group(name, lane, x, speed):
        return {"name": name, "material": "g", "radius": 1e-3, "positions": [[x, lane, 0]], "velocities": [[speed, 0, 0]]}

    return {
        "gravity": [0, 0, 0],
        "materials": {"g": {"density": 2500.0, "young_modulus": 5e6, "poisson_ratio": 0.25}},
        "contact": {"tangential": "none"},
        "pairs": [{"materials": ["g", "g"], "restitution": 0.5}],
        "grains": [group("red", 0.00, 0.00, 1.0), group("blue", 0.01, 0.00, 0.5), group("red", 0.02, 0.00, 0.25),
                   group("blue", 0.03, 0.00, -1.0), group("blue", 0.04, 0.00, 0.0)],
        "outlets": [{"name": "right", "box": {"min": [0.01, -1, -1], "max": [1, 1, 1]}}],
        "borders": {"x": {"min": -0.025, "kind": "open"}},
        "time": {"end": 0.05, "step": 1e-5, "max_speed": 1e-3},
        "measures": ASKED,
        **more,
    }  # fmt: skip


def simulated(**more):
    return Simulation(scene_from_dict(data(**more)), device="cpu", threads=1)


def columns(found, name):
    return [found[f"residence {name} {what}"] for what in ("grains [-]", "mean [s]", "deviation [s]")]


@pytest.mark.parametrize("more", [{}, {"measures": {**ASKED, "energy": True}}], ids=["in the step", "on the host"])
def test_times_are_those_of_the_flights(more):
    """With a budget grains leave on the host, else in the step itself."""
    sim = simulated(**more)
    assert columns(sim.measure(), "all")[0] == 0 and np.isnan(columns(sim.measure(), "all")[1:]).all()
    sim.run(until=0.05)
    found = sim.measure()
    assert columns(found, "all") == pytest.approx([4, 0.02375, np.std([10, 20, 40, 25]) * 1e-3], rel=2e-3)
    assert columns(found, "red") == pytest.approx([2, 0.025, 0.015], rel=2e-3)
    assert columns(found, "right") == pytest.approx([3, 0.07 / 3, np.std([10, 20, 40]) * 1e-3], rel=2e-3)
    assert columns(found, "low") == pytest.approx([1, 0.025, 0.0], rel=2e-3, abs=1e-12)
    departed = sim.departed()
    assert departed.id.tolist() == [0, 1, 3, 2] and departed.way_out.tolist() == ["right", "right", "x min", "right"]
    assert not departed.came.any()


def test_tracers_on_a_belt_are_plug_flow_to_the_step():
    """Grains that come in at the speed of a belt fall on it and go along: all take way over speed, counted in whole steps."""
    floor = {"plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}
    belt = {"name": "belt", "material": "g", **floor, "surface_velocity": [0.6, 0, 0]}
    fed = {"name": "tracer", "material": "g", "diameter": 2e-3, "velocity": [0.6, 0, 0], "count_rate": 100, "until": 0.1,
           "disk": {"point": [0, 0, 3e-3], "normal": [1, 0, 0], "radius": 1.8e-3}}  # fmt: skip
    sim = simulated(
        gravity=[0, 0, -9.81], contact={}, pairs=[{"materials": ["g", "g"], "restitution": 0.5, "friction": 0.5}], grains=[],
        walls=[belt], streams=[fed], outlets=[{"name": "end", "plane": {"point": [0.09, 0, 0], "normal": [1, 0, 0]}}],
        borders=None, measures={"residence": [{"name": "tracer", "outlet": "end"}]}, time={"end": 0.3, "step": 2e-5},
    )  # fmt: skip
    sim.run(until=0.3)
    number, mean, deviation = columns(sim.measure(), "tracer")
    assert number == sim.inlets[0].count >= 9
    assert sim.extremes["wall_overlap_share"] > 1e-4
    assert mean == pytest.approx(0.09 / 0.6, abs=2e-5) and deviation < 1.5e-5


STREAM = {"name": "drops", "material": "g", "box": {"min": [-0.02, 0.1, -0.004], "max": [-0.016, 0.104, 0.004]},
          "diameter": 2e-3, "velocity": [2, 0, 0], "count_rate": 400, "until": 0.02}  # fmt: skip


def test_grains_of_a_stream_count_from_their_insertion_also_after_a_resume(tmp_path):
    sim = simulated(streams=[STREAM], measures={"residence": [{"name": "drops", "of": {"group": "drops"}}]})
    sim.run(until=0.01)
    sim.save_checkpoint(tmp_path / "some.h5")
    again = Simulation.from_checkpoint(tmp_path / "some.h5", device="cpu", threads=1)
    for run in (sim, again):
        run.run(until=0.045)
        departed = run.departed()
        theirs = departed.group == run.scene.groups.index("drops")
        assert theirs.sum() == 8
        came = departed.came[theirs]
        assert (np.diff(came) >= 0).all() and came[0] > 0 and came[-1] <= 0.0201
        # from 16 to 20 mm before the origin to 10 mm behind it at 2 m/s
        assert (departed.residence[theirs] > 0.0129).all() and (departed.residence[theirs] < 0.0151).all()
        assert columns(run.measure(), "drops")[1] == departed.residence[theirs].mean()
    for name in vars(sim.departed()):
        np.testing.assert_array_equal(getattr(again.departed(), name), getattr(sim.departed(), name))


def test_a_run_writes_the_table_and_a_resumed_one_the_same(tmp_path):
    scene = scene_from_dict(data(output={"formats": ["vtk"], "picture": False, "interval": 0.01}))
    run_scene(scene, tmp_path / "whole", device="cpu", threads=1, quiet=True)
    run_scene(scene, tmp_path / "parts", device="cpu", threads=1, quiet=True, until=0.015)
    run_scene(scene, tmp_path / "parts", device="cpu", threads=1, quiet=True, resume=True)
    whole, parts = ((tmp_path / name / "departures.csv").read_text() for name in ("whole", "parts"))
    assert whole == parts
    rows = list(csv.DictReader(whole.splitlines()))
    assert [(row["group"], row["material"], row["outlet"]) for row in rows[:3]] == [
        ("red", "g", "right"), ("blue", "g", "right"), ("blue", "g", "x min")
    ]  # fmt: skip
    assert float(rows[0]["residence [s]"]) == pytest.approx(0.01, rel=2e-3)
    histories = [(tmp_path / name / "history.csv").read_text() for name in ("whole", "parts")]
    assert histories[0] == histories[1] and "residence low mean [s]" in histories[0]


def test_a_run_that_does_not_ask_keeps_nothing():
    sim = simulated(measures={})
    assert sim.state.came is None and sim.engine.leavers.departures is None
    with pytest.raises(ValueError, match=r"measures\.residence; it has none"):
        sim.departed()


def test_an_outlet_that_is_none_is_refused():
    for outlet in ("left", "y max", "x max"):
        with pytest.raises(SceneError, match=r"(?s)residence\[0\]\.outlet.*grains do not leave there.*x min, right"):
            scene_from_dict(data(measures={"residence": [{"name": "a", "outlet": outlet}]}))
    with pytest.raises(SceneError, match=r"(?s)residence\[0\]\.of\.group"):
        scene_from_dict(data(measures={"residence": [{"name": "a", "of": {"group": "green"}}]}))
