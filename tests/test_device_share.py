"""The share of each launch, on the graph's launches as a CPU runs them; and what the peer on a GPU is given."""

import sys
from pathlib import Path

import numpy as np
import pytest

from warpdem import Simulation

sys.path.insert(0, str(Path(__file__).parents[1] / "tools"))
import bench_speed
import deme_peer
import device_share


@pytest.fixture(scope="module")
def start(tmp_path_factory):
    return bench_speed.own_bed(200, tmp_path_factory.mktemp("bed"), bench_speed.Settings(), 20)


def test_launches_of_a_step_are_timed_one_by_one(start):
    sim = Simulation(bench_speed.scene_of(start, "full", bench_speed.Settings()), device="cpu", threads=1, resident=True)
    sim.step(5)
    found = device_share.measured(sim, repeats=1)
    assert found["launch_us"].keys() == {"pair_forces", "wall_forces", "move"}
    np.testing.assert_allclose(sum(found["launch_share"].values()), 1.0)
    assert all(us > 0.0 for us in found["launch_us"].values())
    # a contact: indices 16, constants 4 and memory 2 x 3 numbers, two shares of 6; a grain its record of 16, in double
    contacts, n = sim.lists.contact_count, len(sim.state)
    assert contacts > n
    expected = 128 + contacts / n * (16 + 8 * (4 + 2 * 3) + 2 * 48)
    np.testing.assert_allclose(found["least_bytes_per_grain"]["pair_forces"], expected)


def test_beds_side_by_side_touch_as_one_bed(start, tmp_path):
    both = bench_speed.tiled(start, 2, tmp_path)
    state, one = both.state, start.state
    assert len(state["r"]) == 800 and both.width == 2.0 * start.width
    np.testing.assert_array_equal(state["x"].min(axis=0), one["x"].min(axis=0))
    np.testing.assert_allclose(state["x"].max(axis=0)[:2], one["x"].max(axis=0)[:2] + start.width)
    # what overlapped a wall by a little overlaps its neighbour by no more than both did
    sim = Simulation(bench_speed.scene_of(both, "full", bench_speed.Settings()), device="cpu", threads=1)
    assert sim.contacts().overlap.max() < 0.05 * one["r"].min()


def test_sizes_of_the_peer_keep_each_grain_near_its_own():
    radius = np.random.default_rng(1).uniform(1.0e-4, 3.0e-4, 1000)
    radii, number = deme_peer.rounded(radius)
    assert len(radii) == deme_peer.TEMPLATES
    assert np.abs(radii[number] - radius).max() < 2.0e-4 / deme_peer.TEMPLATES
    assert deme_peer.rounded(np.full(5, 1e-3))[0] == pytest.approx([1e-3])


def test_a_gpu_that_is_not_there_and_a_peer_without_one_are_refused(tmp_path):
    with pytest.raises(SystemExit, match="--device cuda:7: not on this machine; there is cpu"):
        bench_speed.bench(settings=bench_speed.Settings(device="cuda:7"), work=tmp_path)
    with pytest.raises(SystemExit, match="a GPU code"):
        bench_speed.bench(peer="deme", models=["full"], work=tmp_path)
