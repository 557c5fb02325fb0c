"""Calibrations from file to page, with an executor that runs nothing: tables, errors, resuming, what the targets determine."""

import csv
import io
import json
import math

import pytest
from rich.console import Console

from browser import check_access
from page_check import check_html
from scene_text import GLASS
from stub_executor import StubExecutor
from warpdem import SceneError, load_scene
from warpdem.app.calibrate import calibrate
from warpdem.calibration.search import NoFit
from warpdem.sweep.sweep import RowsFailed

SCENE = GLASS + """
friction = 0.3
[[grains]]
material = "glass"
fill = { box = { min = [0, 0, 0], max = [0.02, 0.02, 0.02] }, count = 5, diameter = "1 mm", seed = 4 }
[measures]
energy = true
[time]
end = 1
step = 1e-6
"""
FILE = """
title = "beads"
runs = 18
[[parameters]]
name = "friction"
key = "pairs.0.friction"
range = "0.1:0.9"
[[parameters]]
name = "stiffness"
key = ["materials.glass.young_modulus"]
range = "1:100 MPa:log"
[[experiments]]
name = "heap"
scene = "s.toml"
set = ["time.end=2"]
[[experiments.targets]]
name = "height"
measure = "centre_z:last"
value = {height}
uncertainty = 0.02
[[experiments]]
name = "box"
scene = "s.toml"
[[experiments.targets]]
measure = "ratio(kinetic:last, 2)"
value = {kinetic}
uncertainty = 0.02
"""
TRUE = {"friction": 0.4, "stiffness": 20.0}


def respond(values):
    friction, stiffness = float(values["pairs.0.friction"]), float(values["materials.glass.young_modulus"][1:-5])
    chance = math.sin(1000.0 * int(values["grains.0.fill.seed"]) + friction)
    height = friction + 0.1 * math.log10(stiffness)
    kinetic = 0.4 * math.log10(stiffness) + 0.01 * chance
    return {"centre_z [m]": height + 0.01 * chance, "kinetic [J]": 2 * kinetic}


@pytest.fixture
def file(tmp_path):
    (tmp_path / "s.toml").write_text(SCENE)
    known = {"height": 0.4 + 0.1 * math.log10(20), "kinetic": 0.4 * math.log10(20)}
    (tmp_path / "c.toml").write_text(FILE.format(**known))
    return tmp_path / "c.toml"


def run(file, executor, folder="out"):
    screen = io.StringIO()
    done = calibrate(file, file.parent / folder, on=executor, console=Console(file=screen, width=200))
    return done, screen.getvalue()


def test_it_finds_the_values_and_leaves_tables_scenes_and_a_page(file):
    executor = StubExecutor(respond)
    done, said = run(file, executor)
    folder = file.parent / "out"
    result = json.loads((folder / "calibration.json").read_text())
    friction, stiffness = result["parameters"]
    assert friction["low"] < 0.4 < friction["high"] and friction["high"] - friction["low"] < 0.2
    assert stiffness["low"] < 20.0 < stiffness["high"] and stiffness["unit"] == "MPa"
    assert result["targets"][0]["name"] == "heap: height" and result["notes"] == []
    assert abs(result["targets"][1]["off"]) < 1.0
    with (folder / "calibration.csv").open(newline="") as lines:
        rows = list(csv.DictReader(lines))
    assert len(rows) == 17 == len(done.found.x) and executor.ran == 34
    assert rows[-1]["friction"] == rows[-2]["friction"] and int(rows[-1]["round"]) == len(result["rounds"])
    assert len({row["heap: height"] for row in rows[-4:]}) > 1  # other seeds
    best = load_scene(folder / "best" / "heap.toml")
    assert best.pairs[0].friction == pytest.approx(friction["value"]) and best.time.end == 2
    assert best.materials["glass"].young_modulus == pytest.approx(1e6 * stiffness["value"])
    check_html(folder / "calibration.html")
    assert (folder / "calibration.html").stat().st_size < 5_000_000
    assert "friction" in said and "95 % interval" in said and "round 1: 9 runs" in said


def test_in_a_browser_nothing_of_the_page_is_out_of_reach_of_people_who_see_or_point_otherwise(file):
    run(file, StubExecutor(respond))
    for dark in (False, True):
        check_access(file.parent / "out" / "calibration.html", dark)


def test_what_was_cut_short_goes_on_to_the_same_table(file):
    run(file, StubExecutor(respond), "whole")
    ran = 0
    for stop in (3, 8, 5):
        executor = StubExecutor(respond, stop)
        with pytest.raises(KeyboardInterrupt):
            run(file, executor)
        ran += executor.ran
    executor = StubExecutor(respond)
    run(file, executor)
    assert ran + executor.ran == 34
    for name in ("calibration.csv", "calibration.json"):
        whole, cut = ((file.parent / folder / name).read_text() for folder in ("whole", "out"))
        assert cut == whole.replace("whole", "out")


def test_parameters_that_targets_do_not_tell_apart_are_named(file):
    def product(values):
        out = respond(values)
        both = float(values["pairs.0.friction"]) * math.log10(float(values["materials.glass.young_modulus"][1:-5]))
        return {"centre_z [m]": out["centre_z [m]"] * 0 + both, "kinetic [J]": 2 * both * both}

    file.write_text(FILE.format(height=0.5, kinetic=0.25))
    done, said = run(file, StubExecutor(product))
    assert [one.known for one in done.verdict.parameters] == [False, False]
    assert "the targets do not tell " in said and " apart: " in said and "not determined by the targets" in said


def test_targets_that_no_values_meet_are_told(file):
    more = "[[experiments.targets]]\nmeasure = 'kinetic:last'\nvalue = 0.2\nuncertainty = 0.01\n"
    file.write_text(file.read_text() + more)
    done, _ = run(file, StubExecutor(respond))
    assert any("no values within the ranges meet the targets" in note for note in done.verdict.notes)


def test_a_value_at_the_end_of_its_range_is_told(file):
    file.write_text(FILE.format(height=1.5, kinetic=0.5))
    done, _ = run(file, StubExecutor(respond))
    assert "friction lies at the greatest value of its range: widen it" in done.verdict.notes


def test_a_run_that_crashed_stops_the_search_and_is_tried_again(file):
    executor = StubExecutor(respond, crashes=4)
    with pytest.raises(RowsFailed, match="(?s)'heap': 1 of 9 runs are not done; the same command tries again:.run 4: crashed"):
        run(file, executor)
    assert not (file.parent / "out" / "calibration.json").exists()
    assert run(file, StubExecutor(respond))[0].found.rounds


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [("0.1:0.9", "0.9:0.1", "the lesser number must come first"), ("pairs.0.friction", "pair.0.friction", "no key of a scene"),
     ('name = "stiffness"', 'name = "friction"', r"parameters\[1\].name = 'friction': is there twice"),
     ('scene = "s.toml"', 'scene = "s.toml"\ntest = "heap"', "either scene, a file, or test"),
     ("uncertainty = 0.02", "uncertainty = 0", "uncertainty"), ("runs = 18", "run = 14", "runs"),
     ('"centre_z:last"', '"centre_z:middle"', "must be COLUMN:HOW"), ('"centre_z:last"', '"centre_y z:last"', "has no column"),
     ('set = ["time.end=2"]', "keys = { frction = [] }", 'no parameter \'frction\'; did you mean "friction"'),
     ("runs = 18", "runs = 9", "take 10 at least"), ('"s.toml"', '"t.toml"', "no such file"),
     ("s.toml", "s.toml\"\nseeds = [\"grains.7.fill.seed\"]#", "index from 0 to 0")],
)  # fmt: skip
def test_what_is_wrong_is_told_before_anything_is_run(file, old, new, said):
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new, 1))
    executor = StubExecutor(respond)
    with pytest.raises(SceneError, match=said):
        run(file, executor)
    assert not executor.ran


def test_runs_that_all_fail_are_told(file):
    with pytest.raises(NoFit, match="target 1: 0 of 9 runs"):
        run(file, StubExecutor(lambda values: {"centre_y [m]": 1.0}))
