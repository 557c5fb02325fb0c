"""The one call that measures everything on a GPU: its parts exist, their limits fit, and it starts nothing without a GPU."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import warp as wp

sys.path.insert(0, str(Path(__file__).parents[1] / "tools"))
import gpu_session


def test_every_part_is_a_function_and_each_call_fits_into_ten_minutes():
    parts = gpu_session.LIMITS
    assert all(callable(getattr(gpu_session, name)) and name in gpu_session.__doc__ for name in parts)
    alone = parts.keys() - gpu_session.TOGETHER
    assert alone == {"paper", "tests"} and set(gpu_session.TOGETHER) < parts.keys()
    assert sum(parts[name] for name in gpu_session.TOGETHER) < 600.0
    assert all(parts[name] < 600.0 for name in alone)


def test_without_a_gpu_it_says_so(tmp_path):
    if wp.get_cuda_device_count():
        pytest.skip("there is a GPU")
    with pytest.raises(SystemExit, match="cuda:0: not on this machine; there is cpu"):
        gpu_session.main(out=tmp_path / "out.json", work=tmp_path)
    assert not (tmp_path / "out.json").exists()


def test_a_run_of_the_paper_is_made_once_and_drawn(tmp_path):
    """Of a trial's size, and stopped at once: the instants of its pictures are what counts."""
    size = replace(gpu_session.paper_size("cpu", small=True), rest=0.05)
    start = gpu_session.paper_start(size, tmp_path)
    times = np.arange(0.0, 0.305, gpu_session.paper_hourglass.SAMPLE)
    made = gpu_session.paper_hourglass.Run(times, times / 0.3, np.tile(start["positions"], (5, 1, 1)), 0.01, 2.5)
    for setting, share in (("frame", 1.0), ("laboratory", 0.5)):
        np.savez(tmp_path / f"hourglass_False_120_{setting}.npz", **vars(replace(made, passed=share * made.passed)))
    found = gpu_session.paper("cpu", True, tmp_path)["120 rpm"]
    assert found["grains"] == 100 and found["seconds_per_run"]["frame"] == 2.5
    np.testing.assert_allclose(found["half_turn_s"]["frame"], 2.5 * 0.25 / 0.3)
    assert found["times_passed_s"]["25%"]["mean"] == {"frame": pytest.approx(0.075), "laboratory": pytest.approx(0.15)}
    assert np.isnan(found["standardised_rms"]), "single runs have no spread"
    assert all((tmp_path / f"figure_{number}.png").stat().st_size > 1000 for number in (11, 13))


def test_one_contact_by_the_graph_is_that_of_the_loop():
    own, graph = gpu_session.contact(None), gpu_session.contact("cpu")
    assert np.abs(np.diff(own, axis=0)).max() > 0.1, "the grains hit each other"
    np.testing.assert_array_equal(own, graph)
