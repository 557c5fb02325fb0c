"""The share of each launch, on the graph's launches as a CPU runs them; and what the peer on a GPU is given."""

from types import SimpleNamespace

import numpy as np
import pytest

from bench import deme, launches, speed, states
from gpu import memory
from warpdem import Simulation


@pytest.fixture(scope="module")
def start(tmp_path_factory):
    return states.own_bed(200, tmp_path_factory.mktemp("bed"), states.Settings(), 20)


def test_launches_of_a_step_are_timed_one_by_one(start):
    sim = Simulation(states.scene_of(start, "full", states.Settings()), device="cpu", threads=1, resident=True)
    sim.step(5)
    found = launches.measured(sim, steps=5, repeats=1)
    assert found["launch_us"].keys() == {"pair_forces", "wall_forces", "move"}
    np.testing.assert_allclose(sum(found["launch_share"].values()), 1.0)
    assert all(us > 0.0 for us in found["launch_us"].values())
    # a contact: indices 16, memory 2 x 3 numbers, two shares of 6; a grain its record of 16 and masses of 2, in double
    contacts, n = sim.lists.contact_count, len(sim.state)
    assert contacts > n
    expected = 144 + contacts / n * (16 + 8 * 2 * 3 + 2 * 48)
    np.testing.assert_allclose(found["least_bytes_per_grain"]["pair_forces"], expected)


def test_what_a_gpu_does_is_summed_by_name(monkeypatch):
    kinds = [("graph", 3.0), ("memcpy DtoH", 0.5), ("graph", 4.0)]
    results = [SimpleNamespace(name=name, elapsed=ms) for name, ms in kinds]
    steps = []
    monkeypatch.setattr(launches.wp, "timing_begin", lambda cuda_filter: steps.append("begin"))
    monkeypatch.setattr(launches.wp, "timing_end", lambda: results)
    sim = SimpleNamespace(device=SimpleNamespace(is_cuda=True), step=steps.append)
    found = launches.activities(sim, 7)
    assert steps == ["begin", 7]
    assert list(found.items()) == [("graph", {"ms": 7.0, "count": 2}), ("memcpy DtoH", {"ms": 0.5, "count": 1})]


def test_every_array_counts_once(start):
    scene = states.scene_of(start, "full", states.Settings())
    found = memory.held(scene, "cpu", 5)
    arrays, sums = found["arrays"], found["bytes_per_grain"]
    assert arrays["state.record"] == 128.0 and "engine.lists.wall_contacts.load" in arrays
    assert list(arrays.values()) == sorted(arrays.values(), reverse=True)
    # what is not named are the hash grids; Warp's report has three digits
    assert 0.95 * sums["live"] < sums["named"] < 1.005 * sums["live"] <= 1.005 * sums["peak"]


def test_a_report_without_the_line_is_refused():
    report = "  Peak usage:\n    cpu        3.78 MB\n    cuda:0     1.50 GB\n  Live allocations:\n    cpu   63 (2.00 KB)\n"
    assert memory.allocated(report, "Peak usage", "cuda:0") == 1.5 * 2**30
    assert memory.allocated(report, "Live allocations", "cpu") == 2048
    with pytest.raises(ValueError, match="no 'Live allocations' of cuda:0"):
        memory.allocated(report, "Live allocations", "cuda:0")


def test_beds_side_by_side_touch_as_one_bed(start, tmp_path):
    both = states.tiled(start, 2, tmp_path)
    state, one = both.state, start.state
    assert len(state["r"]) == 800 and both.width == 2.0 * start.width
    np.testing.assert_array_equal(state["x"].min(axis=0), one["x"].min(axis=0))
    np.testing.assert_allclose(state["x"].max(axis=0)[:2], one["x"].max(axis=0)[:2] + start.width)
    # what overlapped a wall by a little overlaps its neighbour by no more than both did
    sim = Simulation(states.scene_of(both, "full", states.Settings()), device="cpu", threads=1)
    assert sim.contacts().overlap.max() < 0.05 * one["r"].min()


def test_sizes_of_the_peer_keep_each_grain_near_its_own():
    radius = np.random.default_rng(1).uniform(1.0e-4, 3.0e-4, 1000)
    radii, number = deme.rounded(radius)
    assert len(radii) == deme.TEMPLATES
    assert np.abs(radii[number] - radius).max() < 2.0e-4 / deme.TEMPLATES
    assert deme.rounded(np.full(5, 1e-3))[0] == pytest.approx([1e-3])


def test_a_gpu_that_is_not_there_and_a_peer_without_one_are_refused(tmp_path):
    with pytest.raises(SystemExit, match="--device cuda:7: not on this machine; there is cpu"):
        speed.bench(settings=states.Settings(device="cuda:7"), work=tmp_path)
    with pytest.raises(SystemExit, match="a GPU code"):
        speed.bench(peer="deme", models=["full"], work=tmp_path)
