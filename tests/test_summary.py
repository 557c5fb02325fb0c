"""Rossby and Froude number of a run, in its summary and run.json."""

import io
import json

import numpy as np
import pytest
from rich.console import Console

from warpdem import Scene, Simulation
from warpdem.app.run import run_scene
from warpdem.app.summary import turning_line
from warpdem.measure.dimensionless import TurningNumbers, rotating_axes
from warpdem.measure.totals import Totals

RATE, RADIUS, SPEED = 4.0, 0.05, 0.3
HALF_TURN = {"axis": [0, 0, 1], "schedule": [{"until": 5e-3, "rate": RATE}]}


def scene(frame=None, walls=(), **changes) -> Scene:
    """One free grain that moves outwards in the axes that turn, and one on the axis."""
    data = {
        "gravity": [0, 0, -2.0],
        "materials": {"g": {"density": 2500, "young_modulus": 1e7, "poisson_ratio": 0.3}},
        "contact": {"tangential": "none"},
        "pairs": [{"materials": ["g", "g"], "restitution": 0.5}],
        "grains": [
            {
                "material": "g",
                "radius": 1e-3,
                "positions": [[RADIUS, 0, 0], [0, 0, 0.02]],
                "velocities": [[SPEED, 0, 0], [0, 0, 0]],
            }
        ],
        "walls": [{"material": "g", "plane": {"point": [0, 0, -1], "normal": [0, 0, 1]}, **wall} for wall in walls],
        "frame": frame,
        "time": {"end": 0.01, "step": 1e-4, "max_speed": 0.1},
        "output": {"interval": 0.01, "history_interval": 1e-3, "formats": [], "picture": False},
    }
    return Scene.model_validate(data | changes)


def numbers(of: Scene):
    gathered = TurningNumbers(of)
    gathered.add(Totals(Simulation(of, device="cpu", threads=1).view))
    return gathered.result()


def test_numbers_of_a_turning_frame():
    """Two grains of equal mass, one at rest: v = SPEED/sqrt 2; R is that of the outer one."""
    turning = numbers(scene({"axis": [0, 0, 1], "rate": -RATE}))
    assert turning.axes == "frame"
    assert turning.angular_velocity == pytest.approx(RATE, rel=1e-14)
    assert turning.radius == pytest.approx(RADIUS, rel=1e-14)
    assert turning.speed == pytest.approx(SPEED / np.sqrt(2), rel=1e-6)  # after the half kick of gravity back and forth
    assert turning.rossby == pytest.approx(turning.speed / (2 * RATE * RADIUS), rel=1e-14)
    assert turning.froude == pytest.approx(RATE**2 * RADIUS / 2.0, rel=1e-14)


def test_axis_through_any_point():
    about = {"axis": [0, 0, 1], "origin": [0, -0.12, 0], "rate": RATE}
    assert numbers(scene(about)).radius == pytest.approx(np.hypot(0.12, RADIUS), rel=1e-14)


def test_frame_and_turning_wall_have_the_same_numbers():
    """The grain's velocity is relative to the axes that turn, whether they are the frame's or a wall's."""
    spin = {"axis": [0, 0, 1], "rate": RATE}
    wall = {"name": "disk", "motion": spin}
    slower = {"name": "other", "motion": {"axis": [0, 1, 0], "rate": 0.5 * RATE}}
    carried = [[SPEED, RATE * RADIUS, 0], [0, 0, 0]]
    laboratory = scene(walls=[slower, wall])
    moving = laboratory.grains[0].model_copy(update={"velocities": np.array(carried)})
    a, b = numbers(scene(spin)), numbers(laboratory.model_copy(update={"grains": [moving]}))
    assert (a.axes, b.axes) == ("frame", "wall disk")
    for name in ("angular_velocity", "speed", "radius", "rossby", "froude"):
        assert getattr(a, name) == pytest.approx(getattr(b, name), rel=1e-12), name


def test_a_wall_that_turns_in_a_shifting_frame_is_carried_by_it():
    """The grains move with the frame: relative to the wall's axes they do not notice the shift."""
    shift = {"velocity": [0.0, 0.0, 3.0]}
    turning = numbers(scene(shift, walls=[{"name": "disk", "motion": {"axis": [0, 0, 1], "rate": RATE}}]))
    assert turning.axes == "wall disk"
    assert turning.speed == pytest.approx(np.hypot(SPEED, RATE * RADIUS) / np.sqrt(2), rel=1e-6)


def test_nested_rotations_count_from_the_instantaneous_axis():
    """Revolution at W about z and rotation at 3 W about a parallel axis at distance d: axis where W r = 3 W (d - r)."""
    planetary = [{"axis": [0, 0, 1], "rate": RATE}, {"axis": [0, 0, 1], "origin": [0.2, 0, 0], "rate": 3 * RATE}]
    turning = numbers(scene(planetary))
    assert turning.angular_velocity == pytest.approx(4 * RATE, rel=1e-14)
    assert turning.radius == pytest.approx(0.75 * 0.2, rel=1e-13)  # the grain at the origin is the further one


def test_nothing_turns_no_numbers():
    assert rotating_axes(scene()) is None
    assert numbers(scene()) is None
    assert numbers(scene({"velocity": [1, 0, 0]})) is None


def test_a_grain_on_the_axis_without_gravity_has_neither_number():
    alone = [{"material": "g", "positions": [[0, 0, 0]], "radius": 1e-3}]
    turning = numbers(scene({"axis": [0, 0, 1], "rate": RATE}, grains=alone, gravity=[0, 0, 0]))
    assert turning.rossby is None and turning.froude is None
    assert "neither" in turning_line(turning)


def test_run_tells_the_numbers_of_the_time_it_turned(tmp_path):
    text = io.StringIO()
    run_scene(scene(HALF_TURN), tmp_path, device="cpu", threads=1, console=Console(file=text, width=250))
    turning = json.loads((tmp_path / "run.json").read_text())["turning"]
    assert turning["axes"] == "frame"
    assert turning["angular_velocity"] == pytest.approx(RATE, rel=1e-12), "instants after the half turn do not count"
    assert RADIUS < turning["radius"] < RADIUS + 5.1e-3 * SPEED
    assert f"Rossby number {turning['rossby']:.3g}, Froude number {turning['froude']:.3g}: frame at 4 rad/s" in text.getvalue()


def test_run_without_turning_says_nothing(tmp_path):
    text = io.StringIO()
    run_scene(scene(), tmp_path, device="cpu", threads=1, console=Console(file=text, width=250))
    assert json.loads((tmp_path / "run.json").read_text())["turning"] is None
    assert "Rossby" not in text.getvalue()
