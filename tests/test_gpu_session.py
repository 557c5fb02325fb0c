"""The one call that measures everything on a GPU: its parts exist, their limits fit, and it starts nothing without a GPU."""

import sys
from pathlib import Path

import numpy as np
import pytest
import warp as wp

sys.path.insert(0, str(Path(__file__).parents[1] / "tools"))
import gpu_session


def test_every_part_is_a_function_and_all_fit_into_ten_minutes():
    assert all(callable(getattr(gpu_session, name)) for name in gpu_session.LIMITS)
    assert sum(gpu_session.LIMITS.values()) < 600.0
    assert all(name in gpu_session.__doc__ for name in gpu_session.LIMITS)


def test_without_a_gpu_it_says_so(tmp_path):
    if wp.get_cuda_device_count():
        pytest.skip("there is a GPU")
    with pytest.raises(SystemExit, match="cuda:0: not on this machine; there is cpu"):
        gpu_session.main(out=tmp_path / "out.json", work=tmp_path)
    assert not (tmp_path / "out.json").exists()


def test_one_contact_by_the_graph_is_that_of_the_loop():
    own, graph = gpu_session.contact(None), gpu_session.contact("cpu")
    assert np.abs(np.diff(own, axis=0)).max() > 0.1, "the grains hit each other"
    np.testing.assert_array_equal(own, graph)
