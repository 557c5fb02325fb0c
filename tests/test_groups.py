"""Groups of grains: named by the scene, kept with the grain through streams, borders, reordering and checkpoints, shown."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from warpdem import Scene, Simulation
from warpdem.errors import SceneError
from warpdem.scene.file import scene_from_dict


def data(**keys) -> dict:
    def group(x, **more):
        return {"material": "g", "positions": [[x, 0.0, 0.0], [x, 0.004, 0.0]], "radius": 1e-3, **more}

    return {
        "gravity": [0, 0, 0],
        "materials": {"g": {"density": 2500.0, "young_modulus": 5e6, "poisson_ratio": 0.3}},
        "contact": {"tangential": "none", "rolling": "none"},
        "pairs": [{"materials": ["g", "g"], "restitution": 0.5}],
        "grains": [group(0.0, name="red", ids=[9, 4]), group(0.01), group(0.02, name="red", velocities=[[1, 0, 0]] * 2)],
        "time": {"end": 1.0, "step": 2e-5, "max_speed": 2.0},
        **keys,
    }


def simulated(**keys) -> Simulation:
    return Simulation(Scene.model_validate(data(**keys)), device="cpu", threads=1)


def test_entries_of_one_name_are_one_group_and_others_have_their_own():
    sim = simulated()
    assert sim.scene.groups == ["red", "grains[1]"]
    assert_array_equal(sim.particles.id, [0, 1, 2, 3, 4, 9])
    assert_array_equal(sim.particles.group, [1, 1, 0, 0, 0, 0])
    assert sim.snapshot().group.dtype == np.int32


def test_an_empty_name_is_refused():
    grains = [{"material": "g", "positions": [[0, 0, 0]], "radius": 1e-3, "name": ""}]
    with pytest.raises(SceneError, match=r"grains\[0\]\.name"):
        scene_from_dict(data(grains=grains))


def test_groups_stay_with_their_grains_through_streams_outlets_and_checkpoints(tmp_path):
    box = {"min": [0.0, 0.02, -0.002], "max": [0.004, 0.03, 0.002]}
    stream = {"name": "rain", "material": "g", "box": box, "diameter": 2e-3, "count_rate": 1e4}
    outlet = {"name": "out", "box": {"min": [0.03, -1, -1], "max": [0.04, 1, 1]}}
    sim = simulated(streams=[stream], outlets=[outlet])
    sim.step(100)
    sim.save_checkpoint(tmp_path / "a.h5")
    again = Simulation.from_checkpoint(tmp_path / "a.h5", device="cpu", threads=1)
    for run in (sim, again):
        run.step(600)
        p = run.particles
        assert sim.scene.groups == ["red", "grains[1]", "rain"]
        assert run.left["out"][0] == 2  # of the group red
        assert not {2, 3} & set(p.id)
        wanted = np.select([np.isin(p.id, [4, 9]), np.isin(p.id, [0, 1])], [0, 1], 2)
        assert (wanted == 2).sum() > 3
        assert_array_equal(p.group, wanted)
    assert_array_equal(again.particles.group, sim.particles.group)
