"""Observers: what they read, their columns, the bits of a run beside them; and the examples of kernels/README.md, run."""

import re
from pathlib import Path

import numpy as np
import pytest

from warpdem import Scene, SceneError, Simulation
from warpdem.app.run import run_scene

PAGE = Path(__file__).resolve().parent.parent / "kernels" / "README.md"
RATE = 20.0

MOMENT = '''
"""Everything that an observer is told, in one number."""
import functools
import warp as wp
from warpdem.kernels.field import Numbers
UNIT = "x"
PARAMETERS = {"a": ("m", 3, None), "b": ("1/s", 1, 2.0)}
@functools.cache
def build():
    @wp.func
    def observe(q: wp.vec3d, v: wp.vec3d, w: wp.vec3d, mass: wp.float64, radius: wp.float64, time: wp.float64, p: Numbers
    ) -> wp.float64:
        return wp.dot(q, wp.vec3d(p[0], p[1], p[2])) * p[3] + v[0] + v[1] * w[2] + mass * p[3] + radius + time
    return observe
'''


def scene(folder=Path(), observers=(), **changes) -> Scene:
    """Three free grains of two sizes in a turning frame, ids not in order."""
    data = {
        "base": folder,
        "gravity": [0, 0, -2.0],
        "materials": {"g": {"density": 2500, "young_modulus": 1e7, "poisson_ratio": 0.3}},
        "contact": {"tangential": "none"},
        "pairs": [{"materials": ["g", "g"], "restitution": 0.5}],
        "grains": [
            {
                "material": "g",
                "ids": [7, 3, 5],
                "radii": [1e-3, 2e-3, 1e-3],
                "positions": [[0.05, 0, 0], [0, 0.02, 0], [0, 0, 0.07]],
                "velocities": [[1, 2, 0], [0, 0.5, 3], [0, 0, 0]],
                "spins": [[0, 0, 5.0], [1, 0, 0], [0, 0, 0]],
            }
        ],
        "frame": {"axis": [0, 0, 1], "rate": RATE},
        "observers": list(observers),
        "time": {"end": 0.01, "step": 1e-4, "max_speed": 0.1},
        "output": {"interval": 0.01, "history_interval": 5e-3, "formats": [], "picture": False},
    }
    return Scene.model_validate(data | changes)


@pytest.mark.parametrize("axes", ["frame", "laboratory"])
def test_an_observer_is_told_position_velocity_spin_mass_radius_time_and_parameters(tmp_path, axes):
    (tmp_path / "moment.py").write_text(MOMENT)
    asked = {"name": "m", "model": "moment.py", "axes": axes, "parameters": {"a": [1, 2, "3 m"]}}
    sim = Simulation(scene(tmp_path, [asked]), device="cpu", threads=1)
    sim.step(31)
    p = sim.particles
    q, v, w = (p.position, p.velocity, p.spin) if axes == "frame" else (p.position_lab, p.velocity_lab, p.spin_lab)
    wanted = 2.0 * q @ [1, 2, 3] + v[:, 0] + v[:, 1] * w[:, 2] + 2.0 * p.mass + p.radius + sim.time
    np.testing.assert_allclose(sim.observe("m"), wanted, rtol=1e-14)
    assert p.id.tolist() == [3, 5, 7]


def test_columns_of_the_history_and_bits_of_the_run(tmp_path):
    asked = [{"name": "v", "model": "speed", "reduce": ["sum", "mean", "min", "max"]}]
    asked += [{"name": "u", "model": "speed", "axes": "frame"}]
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
    sim = run_scene(scene(observers=asked), tmp_path / "a", device="cpu", threads=1, quiet=True)
    plain = run_scene(scene(), tmp_path / "b", device="cpu", threads=1, quiet=True)
    assert sim.state_hash() == plain.state_hash()
    table = np.genfromtxt(tmp_path / "a" / "history.csv", delimiter=",", names=True, deletechars="")
    header = (tmp_path / "a" / "history.csv").read_text().splitlines()[0]
    assert header.split(",")[-5:] == ["v sum [m/s]", "v mean [m/s]", "v min [m/s]", "v max [m/s]", "u mean [m/s]"]
    speed = np.linalg.norm(sim.particles.velocity_lab, axis=1)
    last = [float(x) for x in list(table[-1])[-5:]]
    wanted = [speed.sum(), speed.mean(), speed.min(), speed.max(), np.linalg.norm(sim.particles.velocity, axis=1).mean()]
    np.testing.assert_allclose(last, wanted, rtol=1e-8)
    assert speed.min() != speed.max()
    assert "runs      observer, at rows of the history: speed in frame axes" in sim.plan.explain()
    assert plain.plan.left_out["observers"]
    assert sim.plan == plain.plan, "the step is the same, compiled once"


def test_nothing_observed_where_there_are_no_grains():
    stream = {
        "material": "g", "box": {"min": [0, 0, 0], "max": [0.1, 0.1, 0.1]}, "diameter": 2e-3, "start": 5.0, "mass_rate": 1.0,
    }  # fmt: skip
    sim = Simulation(scene(observers=[{"name": "v", "model": "speed"}], grains=[], streams=[stream]), device="cpu", threads=1)
    assert sim.observe("v").shape == (0,)


def test_unknown_observer_names_those_there_are():
    sim = Simulation(scene(observers=[{"name": "v", "model": "speed"}]), device="cpu", threads=1)
    with pytest.raises(SceneError, match='no observer "w"; the scene has v'):
        sim.observe("w")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("UNIT = 3\nPARAMETERS = {}\ndef build(): ...\n", ["UNIT = 3", "must be a text"]),
        ("PARAMETERS = {}\ndef build(): ...\n", ["an observer model defines UNIT, PARAMETERS, build; missing here: UNIT"]),
        ("UNIT = 'm'\nPARAMETERS = 1\ndef build(): ...\n", ["PARAMETERS must be a dict"]),
    ],
)
def test_wrong_file_is_answered_by_file_and_what_is_allowed(tmp_path, text, words):
    (tmp_path / "own.py").write_text(text)
    with pytest.raises(SceneError) as error:
        scene(tmp_path, [{"name": "a", "model": "own.py"}])
    for word in [str(tmp_path / "own.py"), "observers[0].model", *words]:
        assert word in str(error.value)


# --- the examples of the page ----------------------------------------------------------------------------------------


def blocks() -> dict[str, str]:
    """The fenced Python blocks of kernels/README.md by the file name in their first line."""
    found = re.findall(r"```python\n(# (\w+\.py).*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    return {name: text for text, name in found}


@pytest.fixture(scope="module")
def example(tmp_path_factory):
    """Names left by the program of the page, run in a folder with its files."""
    folder = tmp_path_factory.mktemp("page")
    for name, text in blocks().items():
        (folder / name).write_text(text)
    left = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        exec(compile((folder / "main.py").read_text(), "main.py", "exec"), left)
    return left


def test_the_page_has_its_files():
    assert blocks().keys() == {"linear_modulus.py", "bridge.py", "moving_spring.py", "faster_than.py", "main.py"}


def test_the_program_of_the_page_runs(example):
    """Restitution 0.6 by the law, the pull by the field, and what the observer says of both."""
    sim = example["sim"]
    velocity = sim.particles.velocity
    np.testing.assert_allclose(velocity[:, 0], [-0.3, 0.3], rtol=5e-3)
    mass, stiffness, time = sim.particles.mass[0], 1e-3, sim.time
    w = np.sqrt(stiffness / mass)
    np.testing.assert_allclose(velocity[:, 1], 0.1 * (1.0 - np.cos(w * time)), rtol=1e-2)
    assert example["before"].tolist() == [1.0, 1.0]
    assert example["after"].tolist() == [0.0, 0.0]
    assert sim.limits.field == pytest.approx(0.1 / w, rel=1e-12)
