"""The standard tests of calibration: their measures are there; in full (slow) they come out as their scenes say."""

import pytest

from warpdem import SceneError, load_scene, runs
from warpdem.calibration.standard import STANDARD, standard_scene, standard_text
from warpdem.output.history import history_columns
from warpdem.runner import run_scene
from warpdem.sweep.quantities import Quantity

EXPECTED = {
    "heap_test": ("angle", 18.0, 24.0), "drum_test": ("angle", 32.0, 39.0), "hopper_test": ("rate", 0.094, 0.14),
    "tumbled_test": ("density", 1420.0, 1530.0), "shear_cell": ("angle", 19.0, 23.0),
}  # fmt: skip


@pytest.mark.parametrize("test", STANDARD)
def test_its_measures_are_columns_of_its_scene(test):
    scene = load_scene(standard_scene(test))
    headers = [column.header for column in history_columns(scene)]
    for text in STANDARD[test].values():
        quantity = Quantity(text)
        quantity.check(headers)
        assert not quantity.needs_frame or "vtk" in scene.output.formats
    assert EXPECTED[test][0] in STANDARD[test]


def test_what_is_no_standard_test_is_told():
    with pytest.raises(SceneError, match='no such standard test; did you mean "heap_test"'):
        standard_scene("heap_tst")
    assert standard_text("heap_test", "kinetic:last") == standard_text(None, "kinetic:last") == "kinetic:last"


@pytest.mark.slow
@pytest.mark.parametrize("test", STANDARD)
def test_it_comes_out_as_its_scene_says(test, tmp_path):
    measure, low, high = EXPECTED[test]
    run_scene(load_scene(standard_scene(test)), tmp_path / "run", device="cpu", threads=1, quiet=True, picture=False)
    assert low < Quantity(STANDARD[test][measure]).of(runs.read(tmp_path / "run")) < high
