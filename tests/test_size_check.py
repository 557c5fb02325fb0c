"""The size of a mesh compared with that of the grains."""

import numpy as np
import pytest

from warpdem.errors import SceneError
from warpdem.mesh.size_check import size_warning


def warning(size, diameters, key="walls[1].mesh"):
    return size_warning("drum.stl", np.array([np.zeros(3), size]), diameters, key)


def test_millimetres_read_as_metres_are_refused_with_the_remedy():
    with pytest.raises(SceneError, match=r"walls\[1\]\.mesh: .*300 m large.*0\.005 m in diameter.*scale = 0\.001"):
        warning((100.0, 100.0, 300.0), [0.004, 0.006])
    with pytest.raises(SceneError, match=r"diameters in the wrong unit\? A number without a unit is in metres$"):
        warning((100.0, 100.0, 300.0), [0.004, 0.006])
    assert warning((0.1, 0.1, 0.3), [0.004, 0.006]) is None


def test_mesh_smaller_than_its_grains_is_refused_with_the_remedy():
    with pytest.raises(SceneError, match=r"0\.0003 m large.*0\.005 m in diameter.*scale = 1000"):
        warning((1e-4, 1e-4, 3e-4), 0.005)
    with pytest.raises(SceneError, match=r"or was it scaled twice.*diameters lack their unit, as in \"5 mm\"\? A number"):
        warning((0.3, 0.1, 0.1), 5.0)
    # a thin plate is no mistake
    assert warning((0.1, 0.1, 1e-4), 0.005) is None


def test_odd_sizes_are_told_with_both_sizes_and_the_remedy():
    # a vessel of 10 grains across, read in millimetres
    told = warning((57.0, 57.0, 57.0), 0.005)
    for part in ("walls[1].mesh: drum.stl", "57 m large", "0.005 m in diameter", "11400 diameters", "scale = 0.001"):
        assert part in told
    assert "scale" in warning((0.01, 0.01, 0.01), 0.005)
    # one that a thousandth would not mend has no such advice
    assert "0.001" not in warning((10.0, 1.0, 1.0), 0.009).split(";")[1]
    assert warning((0.015, 0.0, 0.0), 0.005) is None
    assert warning((5.0, 0.0, 0.0), 0.005) is None
