"""The one call that measures everything on a GPU: its parts exist, their limits fit, and it starts nothing without a GPU."""

from dataclasses import replace

import numpy as np
import pytest
import warp as wp

from gpu import session


def test_every_part_is_a_function_and_each_call_fits_into_ten_minutes():
    parts = session.LIMITS
    assert all(callable(getattr(session, name)) and name in session.__doc__ for name in parts)
    alone = parts.keys() - session.TOGETHER
    assert alone == {"paper", "tests"} and set(session.TOGETHER) < parts.keys()
    assert sum(parts[name] for name in session.TOGETHER) < 600.0
    assert all(parts[name] < 600.0 for name in alone)


def test_without_a_gpu_it_says_so(tmp_path):
    if wp.get_cuda_device_count():
        pytest.skip("there is a GPU")
    with pytest.raises(SystemExit, match="cuda:0: not on this machine; there is cpu"):
        session.main(out=tmp_path / "out.json", work=tmp_path)
    assert not (tmp_path / "out.json").exists()


def test_a_run_of_the_paper_is_made_once_and_drawn(tmp_path):
    """Of a trial's size, and stopped at once: the instants of its pictures are what counts."""
    size = replace(session.paper_size("cpu", small=True), rest=0.05)
    start = session.paper_start(size, tmp_path)
    times = np.arange(0.0, 0.305, session.paper_hourglass.SAMPLE)
    made = session.paper_hourglass.Run(times, times / 0.3, np.tile(start["positions"], (5, 1, 1)), 0.01, 2.5)
    for setting, share in (("frame", 1.0), ("laboratory", 0.5)):
        np.savez(tmp_path / f"hourglass_False_120_{setting}.npz", **vars(replace(made, passed=share * made.passed)))
    found = session.paper("cpu", True, tmp_path)["120 rpm"]
    assert found["grains"] == 100 and found["seconds_per_run"]["frame"] == 2.5
    np.testing.assert_allclose(found["half_turn_s"]["frame"], 2.5 * 0.25 / 0.3)
    assert found["times_passed_s"]["25%"]["mean"] == {"frame": pytest.approx(0.075), "laboratory": pytest.approx(0.15)}
    assert np.isnan(found["standardised_rms"]), "single runs have no spread"
    assert all((tmp_path / f"figure_{number}.png").stat().st_size > 1000 for number in (11, 13))


def test_one_contact_by_the_graph_is_that_of_the_loop():
    own, graph = session.contact(None), session.contact("cpu")
    assert np.abs(np.diff(own, axis=0)).max() > 0.1, "the grains hit each other"
    np.testing.assert_array_equal(own, graph)
