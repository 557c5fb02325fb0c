"""History kept in memory: rows when asked for, those of a run with files, after a resume, and what is no interval."""

import numpy as np
import pytest

import twelve_grains
from warpdem import Simulation, runs


def simulation():
    return Simulation(twelve_grains.scene(), device="cpu", threads=1)


def test_a_run_records_rows_at_its_interval_and_both_ends():
    sim = simulation()
    assert sim.history.rows == 0 and "kinetic [J]" in sim.history
    sim.run(until=1.05e-3, record=2e-4)
    np.testing.assert_allclose(sim.history["time"], [0, 2e-4, 4e-4, 6e-4, 8e-4, 1e-3, 1.05e-3], rtol=1e-12)
    assert sim.history["kinetic"][-1] == sim.energy()["kinetic"]
    assert sim.history["floor force z"][-1] == sim.wall_loads(lab=True)["floor"].force[2]
    sim.run(until=1.2e-3, record=1.0)  # its first row is of a time that has one
    assert sim.history["time"][-2:].tolist() == pytest.approx([1.05e-3, 1.2e-3]) and sim.history.rows == 8


def test_recording_changes_no_bit():
    one, other = simulation(), simulation()
    one.run(until=2e-3, record=1e-4)
    other.run(until=2e-3)
    assert one.state_hash() == other.state_hash() and other.history.rows == 0


def test_a_run_with_files_has_their_rows_also_after_a_resume(tmp_path):
    scene = twelve_grains.scene(output=twelve_grains.OFTEN)
    twelve_grains.run(scene, tmp_path, until=3.1e-3)
    sim, _ = twelve_grains.run(scene, tmp_path, resume=True)
    of_file = runs.read(tmp_path).history
    assert list(sim.history) == list(of_file) and sim.history.rows == of_file.rows > 10
    np.testing.assert_array_equal(list(sim.history.values()), list(of_file.values()))


@pytest.mark.parametrize("interval", [0.0, -1.0, float("nan"), float("inf")])
def test_what_is_no_interval_is_told(interval):
    with pytest.raises(ValueError, match=r"run\(record=.*must be finite and above 0"):
        simulation().run(until=1e-3, record=interval)
