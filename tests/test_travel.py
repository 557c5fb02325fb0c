"""A grain that goes too far in one step beside a mesh is refused before the run, and stops it when it gets so fast."""

import re
from pathlib import Path

import numpy as np
import pytest

from warpdem import Scene, Simulation
from warpdem.errors import SceneError, StabilityError
from warpdem.model.travel import CLOSED, OPEN

BOX = str(Path(__file__).resolve().parents[1] / "scenes/meshes/box.stl")
RADIUS, STEP = 0.02, 1e-3


def scene(speed, place=(0.0, 0.0, 0.0), **changes):
    """A soft grain in the closed box, flying along x at ``speed`` [m/s]."""
    wall = dict(name="box", material="g", mesh=BOX) | changes.pop("wall", {})
    data = dict(
        gravity=[0, 0, 0],
        materials=dict(g=dict(density=2500.0, young_modulus=1e4, poisson_ratio=0.3)),
        pairs=[dict(materials=["g", "g"], restitution=0.9, friction=0.3)],
        grains=[dict(material="g", positions=[place], radius=RADIUS, velocities=[[speed, 0.0, 0.0]])],
        walls=[wall],
        time=dict(end=1.0, step=STEP, max_speed=1.0),
        engine=dict(max_overlap=1.0),
    )
    return Scene.model_validate(data | changes)


@pytest.fixture(scope="module")
def middle():
    from warpdem.mesh.triangle_mesh import load_mesh

    return load_mesh(BOX).vertices.mean(axis=0)


@pytest.mark.parametrize("opened", [False, True])
def test_too_fast_a_grain_stops_the_run(middle, opened):
    share = OPEN if opened else CLOSED
    slow = Simulation(scene(0.99 * share * RADIUS / STEP, middle, wall=dict(open=opened)), device="cpu", threads=1)
    slow.step(5)
    fast = Simulation(scene(1.01 * share * RADIUS / STEP, middle, wall=dict(open=opened)), device="cpu", threads=1)
    with pytest.raises(StabilityError) as stopped:
        fast.step(5)
    text = str(stopped.value)
    assert "grain 0 at (" in text and "beside the wall 'box'" in text and f"allowed is {share:g}" in text
    step = float(re.search(r"time.step below ([0-9.e-]+) s", text)[1])
    assert step == pytest.approx(STEP, rel=0.05)


def test_speed_is_that_relative_to_the_wall(middle):
    """A grain at rest beside a wall that moves is as dangerous as one that moves; one that moves along with it is not."""
    shift = dict(motion=dict(velocity=[5.0, 0.0, 0.0]))
    with pytest.raises(StabilityError, match="beside the wall"):
        Simulation(scene(0.0, middle, wall=shift), device="cpu", threads=1).step(5)
    Simulation(scene(5.0, middle, wall=shift), device="cpu", threads=1).step(5)


def test_grains_out_of_reach_do_not_count(middle):
    away = middle + np.array([0.0, 0.0, 50.0])
    Simulation(scene(20.0, away, wall=dict(open=True)), device="cpu", threads=1).step(5)


def test_declared_speed_is_refused_before_the_run(middle):
    with pytest.raises(SceneError, match="time.step = 0.001 s is over the limit of travel beside meshes 0.00099 s"):
        Simulation(scene(0.0, middle, time=dict(end=1.0, step=STEP, max_speed=1.01 * CLOSED * RADIUS / STEP)), device="cpu")
