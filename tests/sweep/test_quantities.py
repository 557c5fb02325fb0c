"""Numbers of a run: columns at times and over windows, entries of run.json, and what is none."""

import json
import math

import pytest

from warpdem import SceneError, runs
from warpdem.sweep.quantities import Quantity


@pytest.fixture
def run(tmp_path):
    record = {"status": "done", "extremes": {"overlap": 0.02}, "left": {"hole": {"mass": 3}}, "title": "x"}
    (tmp_path / "run.json").write_text(json.dumps(record))
    (tmp_path / "history.csv").write_text("time [s],lid force z [N]\n0,0\n1,4\n3,4\n4,-2\n")
    return runs.read(tmp_path)


@pytest.mark.parametrize(
    ("text", "value"),
    [("lid force z:first", 0), ("lid force z [N]:last", -2), ("lid force z:max", 4), ("lid force z:min", -2),
     ("lid force z:mean", 11 / 4), ("lid force z:mean@1:3", 4), ("lid force z:mean@3:", 1), ("lid force z:max@:0", 0),
     ("lid force z:rate@0:1", 4), ("lid force z:std@1:3", 0), ("run.extremes.overlap", 0.02), ("run.left.hole.mass", 3),
     ("run.left.drain.mass", math.nan), ("run.title", math.nan), ("lid force z:last@7:9", math.nan),
     ("heat:last", math.nan), ("lid force z:mean@3:3", 4)],
)  # fmt: skip
def test_a_quantity_of_a_run(run, text, value):
    assert Quantity(text).of(run) == pytest.approx(value, nan_ok=True)


@pytest.mark.parametrize("text", ["kinetic", "kinetic:median", ":last", "kinetic:last@", "kinetic:last@1"])
def test_what_is_no_quantity_is_told(text):
    with pytest.raises(SceneError, match="must be COLUMN:HOW"):
        Quantity(text)


def test_times_that_are_none_are_told():
    with pytest.raises(SceneError, match="'a' and '' must be times in seconds"):
        Quantity("kinetic:last@a:")


def test_a_column_that_a_scene_has_not_is_told():
    Quantity("kinetic:last").check(["time [s]", "kinetic [J]"])
    Quantity("run.anything").check([])
    with pytest.raises(SceneError, match="result 'kinetik:last'.*did you mean \"kinetic\""):
        Quantity("kinetik:last").check(["time [s]", "kinetic [J]"])
