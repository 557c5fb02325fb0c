"""Features: what a scene lacks is neither compiled nor allocated, and leaving it out changes nothing."""

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from warpdem.kernels import grain

from switches import switched
from warpdem import Scene, SceneError, Simulation
from warpdem.model.choose_features import choose_features
from warpdem.scene import models, user_models

ROOT = Path(__file__).resolve().parent.parent
GLASS = {"density": 2500, "young_modulus": 1e7, "poisson_ratio": 0.3}
STEPS = 600


def scene(*, tangential="mindlin", rolling="constant", mu=0.5, mu_r=0.1, materials=("glass",), spins=True, **changes):
    """27 grains that fall together on a floor in which they also roll."""
    rng = np.random.default_rng(11)
    cell = np.stack(np.meshgrid(*[np.arange(3)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    pair = {"restitution": 0.6, "friction": mu, "rolling_friction": mu_r}
    velocity, spin = rng.normal(0, 0.1, (27, 3)), rng.normal(0, 50, (27, 3))
    parts = np.arange(27) % len(materials)
    data = {
        "gravity": [0, 0, -60],
        "materials": dict.fromkeys(materials, GLASS),
        "contact": {"tangential": tangential, "rolling": rolling},
        "pairs": [{"materials": [a, b], **pair} for k, a in enumerate(materials) for b in materials[k:]],
        "grains": [
            {
                "material": name,
                "positions": (cell * 2.0e-3 + [0, 0, 1.05e-3])[parts == k],
                "radius": 1e-3,
                "velocities": velocity[parts == k],
                "spins": (spin * spins)[parts == k],
                "ids": np.arange(27)[parts == k],
            }
            for k, name in enumerate(materials)
        ],
        "walls": [{"name": "floor", "material": materials[-1], "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}],
        "time": {"end": 1, "step": 1e-5, "max_speed": 1},
        "engine": {"max_overlap": 0.3},
    }
    return Scene.model_validate(data | changes)


def run(of: Scene) -> Simulation:
    sim = Simulation(of, device="cpu", threads=1)
    sim.step(STEPS)
    assert len(sim.contacts().i) > 5
    return sim


def with_everything(of: Scene, monkeypatch, **switches) -> Simulation:
    """The same scene on kernels with these ``switches`` of its features."""
    chosen = choose_features
    full = lambda *args, **keys: switched(chosen(*args, **keys), **switches)  # noqa: E731
    monkeypatch.setattr("warpdem.model.prepare.choose_features", full)
    sim = run(of)
    monkeypatch.undo()
    return sim


def assert_same_motion(first, second, *, spin=True, tolerance=0.0):
    for name in ("position", "velocity", *(["spin"] if spin else [])):
        a, b = getattr(first.particles, name), getattr(second.particles, name)
        np.testing.assert_allclose(a, b, rtol=tolerance, atol=tolerance * np.abs(b).max(), err_msg=name)


@pytest.fixture(scope="module")
def full():
    """The full law on one floor, in an inertial frame."""
    return run(scene())


def test_the_full_law_turns_and_slows_grains(full):
    assert np.abs(full.particles.spin).max() > 10.0
    assert full.plan.memory == 3


def test_no_friction_equals_friction_zero(monkeypatch):
    """Left out because its coefficient is zero, because the law is "none", or computed with zero: one motion."""
    left_out = run(scene(tangential="none", rolling="none", mu=0, mu_r=0, spins=False))
    zero = run(scene(mu=0, mu_r=0, spins=False))
    assert (left_out.plan.contact.tangential, zero.plan.contact.tangential) == (None, None)
    computed = with_everything(
        scene(mu=0, mu_r=0, spins=False), monkeypatch, contact={"tangential": "mindlin", "rolling": "constant", "spins": True}
    )
    assert computed.plan.contact.tangential == "mindlin"
    assert_same_motion(left_out, zero)
    # another kernel: the compiler may group a sum otherwise, which shows in the last bit
    assert_same_motion(left_out, computed, spin=False, tolerance=1e-13)
    # the torque n x F of a force along n is rounding
    np.testing.assert_allclose(computed.particles.spin, 0.0, rtol=0, atol=1e-12)


def test_no_rolling_equals_rolling_zero(monkeypatch):
    left_out = run(scene(rolling="none", mu_r=0))
    assert left_out.plan.contact.rolling is None
    computed = with_everything(scene(mu_r=0), monkeypatch, contact={"rolling": "constant"})
    assert computed.plan.contact.rolling == "constant"
    assert_same_motion(left_out, computed)


def test_frame_at_rest_equals_no_frame(full, monkeypatch):
    resting = run(scene(frame={"axis": [0, 1, 1], "origin": [0.1, 0, 0], "rate": 0.0}))
    assert not resting.plan.frame.rotates
    assert_same_motion(full, resting)
    assert full.state_hash() == resting.state_hash()
    computed = with_everything(
        scene(frame={"axis": [0, 1, 1], "origin": [0.1, 0, 0], "rate": 0.0}), monkeypatch, frame={"rotates": True}
    )
    assert computed.plan.frame.rotates
    assert full.state_hash() == computed.state_hash()


def test_table_of_equal_materials_equals_one_material(full, monkeypatch):
    """Two materials of one kind share one set; a table of equal rows gives the same bits."""
    two = run(scene(materials=("glass", "other")))
    assert not two.plan.contact.table
    assert full.state_hash() == two.state_hash()
    computed = with_everything(scene(materials=("glass", "other")), monkeypatch, contact={"table": True})
    assert computed.plan.contact.table
    assert full.state_hash() == computed.state_hash()


def test_different_materials_need_a_table():
    pairs = [
        {"materials": ["a", "a"], "restitution": 0.6, "friction": 0.5, "rolling_friction": 0.1},
        {"materials": ["a", "b"], "restitution": 0.6, "friction": 0.2, "rolling_friction": 0.1},
        {"materials": ["b", "b"], "restitution": 0.6, "friction": 0.5, "rolling_friction": 0.1},
    ]
    made = Simulation(scene(materials=("a", "b"), pairs=pairs), device="cpu", threads=1)
    assert made.plan.contact.table
    assert made.coefficients.shape == (4,)


def test_one_lane_equals_four(full, monkeypatch):
    """A GPU thread takes one contact, a CPU core four side by side: the law's bits do not see it."""
    computed = with_everything(scene(), monkeypatch, backend={"lanes": 1})
    assert computed.plan.backend.lanes == 1
    assert full.state_hash() == computed.state_hash()


def test_left_out_features_allocate_nothing(full):
    bare = run(scene(tangential="none", rolling="none", mu=0, mu_r=0, spins=False))
    assert bare.plan.memory == 0
    assert bare.state.record.numpy().shape[1] == grain.WIDTH[False] == 10
    assert bare.lists.slot_force.numpy().shape[1] == 3
    assert bare.lists.kind.size == 0
    assert bare.lists.constants.shape[1] == 3
    assert bare.lists.wall_contacts.point.numpy().shape[2] == 9
    assert full.state.record.numpy().shape[1] == 16
    assert full.lists.constants.shape[1] == 5
    assert full.lists.wall_contacts.point.numpy().shape[::2] == (2, 12)


def test_without_walls_there_are_no_rows():
    free = Simulation(scene(walls=[]), device="cpu", threads=1)
    assert (free.walls, free.lists.wall_contacts, free.kernels.walls) == (None, None, None)


def test_memory_estimate_grows_with_features():
    bare, rolling, spring = (
        Simulation(scene(**keys), device="cpu", threads=1).plan.bytes_per_grain
        for keys in (
            {"tangential": "none", "rolling": "none", "mu": 0, "mu_r": 0, "spins": False},
            {},
            {"rolling": "spring"},
        )
    )
    assert bare < rolling < spring


LEFT_OUT = (
    ({"tangential": "none", "rolling": "none", "mu": 0, "mu_r": 0, "spins": False}, "tangential", "is none"),
    ({"mu": 0}, "tangential", "every friction coefficient is zero"),
    ({"rolling": "none", "mu_r": 0}, "rolling", "is none"),
    ({"mu_r": 0}, "rolling", "every rolling_friction is zero"),
    ({"tangential": "none", "rolling": "none", "mu": 0, "mu_r": 0, "spins": False}, "spins", "nothing turns a grain"),
    ({}, "turning of the axes", "no frame"),
    ({"frame": {"axis": [0, 0, 1], "rate": 0}}, "turning of the axes", "the frame never moves"),
    ({"walls": []}, "walls", "the scene has none"),
    ({}, "external fields", "the scene has none"),
    ({}, "wall motion", "all walls rest"),
    ({}, "table of coefficients", "one set"),
)


@pytest.mark.parametrize(("keys", "what", "why"), LEFT_OUT)
def test_explain_names_what_is_left_out_and_why(keys, what, why):
    lines = Simulation(scene(**keys), device="cpu", threads=1).plan.explain()
    assert [line for line in lines if line.startswith("left out") and what in line and why in line]


def test_explain_names_what_runs():
    turning = scene(rolling="spring", frame={"axis": [0, 0, 1], "rate": 3.0})
    lines = "\n".join(Simulation(turning, device="cpu", threads=1).plan.explain())
    for what in (
        "normal: hertz",
        "tangential: mindlin",
        "rolling: spring",
        "in a moving frame",
        "walls: of the shape plane, 0 of their motions",
        "48 B",
    ):
        assert what in lines
    assert "left out  rolling" not in lines


def test_models_are_the_files_of_their_folder():
    assert {"hertz", "hooke"} <= set(models.model_names("normal"))
    for role in user_models.REQUIRED:
        on_disk = sorted(p.stem for p in (ROOT / "kernels" / role).glob("*.py") if p.stem != "__init__")
        assert list(models.model_names(role)) == on_disk


def test_unknown_model_is_answered_with_the_list():
    with pytest.raises(SceneError, match=r'normal model "herz": must be .*"hertz".*mean "hertz"'):
        models.model("normal", "herz")


MAIN_JOB = """
import json, sys
import trimesh, warp
from warpdem import Scene, Simulation
warp.config.log_level = warp.LOG_INFO
folder = sys.argv[1]
trimesh.creation.box((0.1, 0.1, 0.2)).export(folder + "/glass.stl")
region = {"min": [-1, -1, -1], "max": [1, 1, 0]}
fill = {"wall": "glass", "region": region, "count": 150, "diameter": {"uniform": [8e-3, 12e-3]}}
sim = Simulation(Scene.model_validate({
    "materials": {"g": {"density": 2653, "young_modulus": 5e7, "poisson_ratio": 0.3}},
    "contact": {"normal": "hertz", "tangential": "mindlin", "rolling": "constant"},
    "pairs": [{"materials": ["g", "g"], "restitution": 0.3, "friction": 0.5, "rolling_friction": 0.3}],
    "walls": [{"name": "glass", "material": "g", "mesh": folder + "/glass.stl"}],
    "grains": [{"material": "g", "fill": fill}],
    "frame": {"axis": [0, 1, 0], "schedule": [{"until": 0.01, "rate": 0}, {"until": 0.02, "rate": 3}, {"rate": 0}]},
    "time": {"end": 0.03}}), device="cpu", threads=2)
sim.run(until=0.03)
sim.snapshot(), sim.energy(), sim.contacts(), sim.state_hash()
print(json.dumps({"rebuilds": sim.lists.rebuilds}))
"""


def test_main_job_uses_at_most_eighteen_modules(tmp_path):
    """Counted by what Warp says of each module that it compiles or finds in its cache."""
    done = subprocess.run([sys.executable, "-c", MAIN_JOB, str(tmp_path)], capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stderr[-3000:]
    assert json.loads(done.stdout.strip().splitlines()[-1])["rebuilds"] > 1, "carrying over must have run"
    modules = set(re.findall(r"^Module (\S+ \w+) load on device 'cpu'", done.stdout + done.stderr, re.MULTILINE))
    assert 5 < len(modules) <= 18, modules
