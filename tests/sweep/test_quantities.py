"""Numbers of a run: columns at times and over windows, entries of run.json, and what is none."""

import json
import math
from types import SimpleNamespace

import numpy as np
import pytest

from warpdem import SceneError, runs
from warpdem.sweep import last_frame
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


@pytest.mark.parametrize(
    ("text", "value"),
    [("ratio(lid force z:max, 2)", 2), ("angle(lid force z:max, lid force z:max)", 45), ("root(lid force z:max)", 2),
     ("size(lid force z:last)", 2), ("difference(product(lid force z:max, 3), run.left.hole.mass)", 9),
     ("ratio(1, lid force z:first)", math.nan), ("root(lid force z:last)", math.nan), ("ratio(heat:last, 2)", math.nan)],
)  # fmt: skip
def test_a_quantity_made_of_others(run, text, value):
    assert Quantity(text).of(run) == pytest.approx(value, nan_ok=True)


def test_what_is_made_of_others_is_checked_in_its_parts():
    with pytest.raises(SceneError, match="ratio takes 2 in its brackets, not 1"):
        Quantity("ratio(kinetic:last)")
    with pytest.raises(SceneError, match="'kinetic:lst': must be COLUMN"):
        Quantity("root(kinetic:lst)")
    with pytest.raises(SceneError, match="did you mean \"kinetic\""):
        Quantity("ratio(1, kinetik:last)").check(["time [s]", "kinetic [J]"])
    with pytest.raises(SceneError, match="there are frame.cone_angle, frame.height"):
        Quantity("frame.angle")


def test_the_cone_of_the_last_frame():
    """Grains that fill a cone of 30 degrees evenly, tilted with gravity; a flat layer one grain high has none."""
    random = np.random.default_rng(0).random((3, 200_000))
    height, around = 1.0 - random[0] ** (1 / 3), 2 * np.pi * random[1]
    away = (1.0 - height) * np.sqrt(random[2]) / np.tan(np.pi / 6)
    x = np.stack([away * np.cos(around), height, away * np.sin(around)], axis=1)  # up is y
    n = len(x)
    one = SimpleNamespace(position=x, radius=np.full(n, 1e-6), mass=np.ones(n), gravity=np.array([0, -9.81, 0]))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(last_frame, "in_laboratory", lambda shot: shot)
        assert last_frame.cone_angle(one) == pytest.approx(30.0, abs=0.2)
        assert last_frame.thickness(one) == pytest.approx(1.0, abs=0.03)
