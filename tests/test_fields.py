"""External fields: what a scene may say of them, and the paths of grains in them against closed forms."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from warpdem.kernels.field import drag

from warpdem import Scene, SceneError, Simulation
from warpdem.model.coefficients import field_numbers
from warpdem.scene.file import scene_from_dict

RADII = np.array([1e-3, 1.5e-3])
MASS = 2500.0 * 4.0 / 3.0 * np.pi * RADII**3
PLACES = np.array([[0.1, 0.02, 0.0], [0.0, -0.1, 0.05]])
SPEEDS = np.array([[0.0, 0.3, 0.1], [0.2, 0.0, -0.1]])
FRAME = {"axis": [1, 2, 3], "origin": [0.02, 0.0, 0.01], "rate": 20.0}
STEP = 1e-4


def data(*fields, axes="laboratory", step=STEP, **changes) -> dict:
    """Two grains far apart in the given fields, without gravity."""
    return {
        "gravity": [0, 0, 0],
        "materials": {"g": {"density": 2500.0, "young_modulus": 5e6, "poisson_ratio": 0.3}},
        "contact": {"tangential": "none"},
        "pairs": [{"materials": ["g", "g"], "restitution": 0.5}],
        "grains": [
            {
                "material": "g",
                "positions": PLACES.tolist(),
                "radii": RADII.tolist(),
                "velocities": SPEEDS.tolist(),
                "velocities_in": "laboratory",
            }
        ],
        "fields": [{"model": model, "axes": axes, "parameters": given} for model, given in fields],
        "time": {"end": 10.0, "step": step, "max_speed": 1e-3},
        "engine": {"skin": 0.05},  # wide: fast grains would call for new lists all the time
        **changes,
    }


def run(until, *, stiffness=0.0, drag=None, charge=0.0, magnetic=(0, 0, 0), electric=(0, 0, 0), centre=(0, 0, 0), **keys):
    """Simulation at ``until``; always with the three fields, zero where not given, so that few kernels are compiled."""
    fields = [
        ("harmonic", {"stiffness": stiffness, "centre": centre}),
        ("drag", drag or {"coefficient": 0.0}),
        ("lorentz", {"charge": charge, "magnetic": magnetic, "electric": electric}),
    ]
    sim = Simulation(Scene.model_validate(data(*fields, **keys)), device="cpu", threads=1)
    sim.run(until=until)
    return sim


# --- the scene -------------------------------------------------------------------------------------------------------


def test_parameters_are_si_and_complete():
    given = ("lorentz", {"charge": "2 nC", "electric": [0, "1 kV/m", 3]})
    [field] = Scene.model_validate(data(given)).fields
    assert field.parameters == {"charge": 2e-9, "magnetic": (0.0, 0.0, 0.0), "electric": (0.0, 1000.0, 3.0)}
    assert list(field.parameters) == ["charge", "magnetic", "electric"], "in the order of the field's file"
    assert field.axes == "laboratory"


def test_dump_gives_the_same_fields_again():
    scene = Scene.model_validate(data(("harmonic", {"stiffness": "5 N/mm"}), ("drag", {"coefficient": 1}), axes="frame"))
    assert Scene.model_validate(json.loads(scene.model_dump_json())) == scene


def test_numbers_are_the_parameters_in_order():
    scene = Scene.model_validate(data(("drag", {"flow": [1, 2, 3], "coefficient": 4}), ("harmonic", {"stiffness": 5})))
    np.testing.assert_array_equal(field_numbers(scene), [[4, 1, 2, 3, *[0] * 8], [5, *[0] * 11]])
    assert field_numbers(Scene.model_validate(data())).shape == (0, 12)


@pytest.mark.parametrize(
    ("field", "words"),
    [
        ({"model": "harmonc"}, ['fields[0].model = "harmonc"', '"drag", "harmonic" or "lorentz"', 'mean "harmonic"']),
        ({"model": "own.py"}, ['fields[0].model = "own.py"', "own.py", "No such file"]),
        ({"model": "drag", "axes": "lab"}, ["fields[0].axes", "laboratory"]),
        ({"model": "drag"}, ["fields[0].parameters.coefficient", "missing", "[kg/s]"]),
        ({"model": "drag", "parameters": {"coeficient": 1}}, ["parameters.coeficient = 1", 'mean "coefficient"']),
        ({"model": "drag", "parameters": {"coefficient": 1, "q": 2}}, ["parameters.q", "known here: coefficient, flow"]),
        ({"model": "drag", "parameters": {"coefficient": "1 N"}}, ["parameters.coefficient", "drag coefficient", '"N"']),
        ({"model": "drag", "parameters": {"coefficient": [1, 2, 3]}}, ["parameters.coefficient", "plain number"]),
        ({"model": "drag", "parameters": {"coefficient": math.nan}}, ["parameters.coefficient", "finite"]),
        ({"model": "drag", "parameters": {"coefficient": 1, "flow": 3}}, ["parameters.flow = 3", "list of 3"]),
        ({"model": "drag", "parameters": {"coefficient": 1, "flow": [1, 2]}}, ["parameters.flow", "list of 3", "[m/s]"]),
        ({"model": "drag", "parameters": {"coefficient": 1, "flow": [1, 2, "3 m"]}}, ["parameters.flow", "a speed"]),
        ({"model": "drag", "parameters": 3}, ["fields[0].parameters = 3", "table"]),
        ({"parameters": {}}, ["fields[0].model", "missing"]),
        ({"model": "drag", "strength": 3}, ["fields[0].strength", "unknown key"]),
    ],
)
def test_wrong_field_is_answered_by_key_value_and_what_is_allowed(field, words):
    with pytest.raises(SceneError) as error:
        scene_from_dict(data(fields=[field]))
    for word in words:
        assert word in str(error.value)


# --- paths -----------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def everything():
    """Arguments of ``run`` with all fields in force."""
    return {
        "stiffness": 3e-3,
        "centre": (0.05, 0.0, 0.01),
        "drag": {"coefficient": 2e-5, "flow": [0.1, 0.0, 0.0]},
        "charge": 1e-4,
        "magnetic": (1.0, 2.0, 0.5),
        "electric": (3.0, 0.0, 1.0),
    }


@pytest.fixture(scope="module")
def in_the_laboratory(everything):
    return run(0.3, **everything)


def swing_error(step):
    """Largest distance from the path x0 cos(w t) + v0/w sin(w t) about the centre after 1 s [m], and the bound for it."""
    stiffness, centre = 3e-4, np.array([0.05, 0.0, 0.01])
    sim = run(1.0, stiffness=stiffness, centre=centre.tolist(), step=step)
    omega = np.sqrt(stiffness / sim.particles.mass)[:, None]
    exact = centre + (PLACES - centre) * np.cos(omega * sim.time) + SPEEDS / omega * np.sin(omega * sim.time)
    # kick and drift swing at the rate (2/dt) asin(w dt/2), which is ahead by w (w dt)^2/24
    size = np.linalg.norm(PLACES - centre, axis=1) + np.linalg.norm(SPEEDS, axis=1) / omega[:, 0]
    return np.linalg.norm(sim.particles.position - exact, axis=1), (size * omega[:, 0] ** 3 * step**2 / 24 * sim.time)


def test_harmonic_oscillator_swings_at_the_root_of_k_over_m():
    error, bound = swing_error(2.0**-13)
    assert np.all(error < 1.05 * bound)
    assert np.all(bound < 1e-6)


def test_linear_drag_lets_the_velocity_decay_to_the_flow():
    flow, coefficient = np.array([0.1, 0.0, -0.2]), 1e-4
    sim = run(0.5, drag={"coefficient": coefficient, "flow": flow.tolist()})
    rate = (coefficient / sim.particles.mass)[:, None]
    decay = np.exp(-rate * sim.time)
    assert 0.001 < decay.min() < decay.max() < 0.3
    tolerance = (rate.max() * STEP) ** 2  # second order
    np.testing.assert_allclose(sim.particles.velocity, flow + (SPEEDS - flow) * decay, rtol=0, atol=0.3 * tolerance)
    way = flow * sim.time + (SPEEDS - flow) * (1 - decay) / rate
    np.testing.assert_allclose(sim.particles.position, PLACES + way, rtol=0, atol=0.3 * tolerance)


def lorentz_error(step):
    """Largest distance from the helix of the closed form after 0.5 s [m], and the bound for it."""
    charge, field = 1e-4, 3.0
    sim = run(0.5, charge=charge, magnetic=(0.0, 0.0, field), step=step)
    omega = (-charge * field / sim.particles.mass)[:, None]
    angle = omega * sim.time
    x, y, z = SPEEDS.T[:, :, None]
    turned = np.hstack([np.sin(angle) * x + (np.cos(angle) - 1) * y, (1 - np.cos(angle)) * x + np.sin(angle) * y])
    exact = PLACES + np.hstack([turned / omega, z * sim.time])
    assert np.all(np.abs(angle) > 4.0), "a good part of a turn"
    radius = np.linalg.norm(SPEEDS[:, :2], axis=1)[:, None] / np.abs(omega)
    # v* = V + (dt/2) a of the step before: the error constant of the second Adams-Bashforth formula
    bound = 5.0 / 12.0 * (omega * step) ** 2 * np.abs(angle) * radius
    return float(np.abs(sim.particles.position - exact).max()), float(bound.max())


def test_lorentz_force_leads_round_the_circle_in_second_order():
    errors, bounds = np.transpose([lorentz_error(step) for step in (3.2e-4, 1.6e-4, 0.8e-4)])
    assert np.all(errors < 1.05 * bounds)
    np.testing.assert_allclose(np.log2(errors[:-1] / errors[1:]), 2.0, rtol=0, atol=0.1)


def test_fields_of_the_laboratory_give_one_path_in_a_turning_frame(everything, in_the_laboratory):
    turning = run(0.3, **everything, frame=FRAME)
    assert turning.plan.frame.rotates
    for name in ("position_lab", "velocity_lab"):
        here, there = getattr(turning.particles, name), getattr(in_the_laboratory.particles, name)
        np.testing.assert_allclose(here, there, rtol=0, atol=1e-12, err_msg=name)
    assert turning.energy()["fields"] == pytest.approx(in_the_laboratory.energy()["fields"], rel=1e-11)


def test_fields_of_the_frame_turn_with_it():
    """Spring and drag that turn about z hold a grain where the spring balances the centrifugal force, at rest in the frame."""
    rate, stiffness, centre = 10.0, 2e-2, np.array([0.05, 0.0, 0.0])
    spring = {"stiffness": stiffness, "centre": centre.tolist(), "drag": {"coefficient": 1e-3}}
    sim = run(2.5, axes="frame", **spring, frame={"axis": [0, 0, 1], "rate": rate})
    stretch = stiffness / (stiffness - sim.particles.mass * rate**2)
    assert np.all(stretch > 1.05)
    np.testing.assert_allclose(sim.particles.position, stretch[:, None] * centre, rtol=0, atol=1e-7)
    np.testing.assert_allclose(sim.particles.velocity, 0.0, rtol=0, atol=1e-5)
    assert np.linalg.norm(sim.particles.velocity_lab, axis=1).min() > 0.2


def test_magnetic_field_of_the_frame_acts_on_the_relative_velocity():
    """A grain that turns with the frame feels nothing of a magnetic field at rest in it, one at rest in the laboratory does."""
    spring = {"axes": "frame", "frame": {"axis": [0, 0, 1], "rate": 5.0}, "charge": 1e-4, "magnetic": (0, 0, 10)}
    grains = {"material": "g", "positions": PLACES.tolist(), "radii": RADII.tolist()}
    still, turning = (
        run(10 * STEP, **spring, grains=[{**grains, "velocities_in": where}]) for where in ("laboratory", "frame")
    )
    straight = PLACES + 10 * STEP * np.cross([0, 0, 5.0], PLACES)
    np.testing.assert_allclose(turning.particles.position_lab, straight, rtol=0, atol=1e-7)
    pushed = still.particles.velocity_lab
    expected = 10 * STEP * 1e-4 * 10 / MASS[:, None] * np.cross(np.cross(PLACES, [0, 0, 5.0]), [0, 0, 1.0])
    np.testing.assert_allclose(pushed, expected, rtol=0, atol=0.1 * np.abs(expected).max())


# --- energy and plan -------------------------------------------------------------------------------------------------


def test_energy_of_spring_and_electric_field_is_conserved():
    sim = run(0.0, stiffness=3e-3, charge=1e-4, electric=(3.0, 0.0, 1.0), magnetic=(0.0, 1.0, 0.0))
    totals, parts = [], []
    for _ in range(20):
        energy = sim.energy()
        parts.append(energy["fields"])
        totals.append(energy["kinetic"] + energy["fields"])
        sim.step(50)
    spread = max(parts) - min(parts)
    assert spread > 1e-5
    assert max(totals) - min(totals) < 1e-4 * spread


def test_energy_of_fields_is_that_of_the_formulas(in_the_laboratory, everything):
    q = in_the_laboratory.particles.position
    spring = 0.5 * everything["stiffness"] * np.sum((q - everything["centre"]) ** 2)
    electric = -everything["charge"] * np.sum(q @ everything["electric"])
    assert in_the_laboratory.energy()["fields"] == pytest.approx(spring + electric, rel=1e-12)


def test_an_energy_of_one_number_is_that_of_each_grain(tmp_path):
    """A field of the user's own whose potential is the same everywhere."""
    source = Path(drag.__file__).read_text(encoding="utf-8")
    (tmp_path / "even.py").write_text(f"{source}\n\ndef energy(position, mass, radius, numbers):\n    return 2.0\n")
    outlet = {"name": "out", "box": {"min": [0.01, -1, -1], "max": [0.05, 0, 1]}}  # takes the second grain after 50 ms
    given = data(("even.py", {"coefficient": 1e-9}), measures={"energy": True}, outlets=[outlet])
    sim = Simulation(scene_from_dict(given, tmp_path), device="cpu", threads=1)
    start = sim.energy()["fields"]
    sim.step(600)
    assert [start, sim.energy()["fields"]] == [4.0, 2.0]
    assert sim.measure()["integration_error [J]"] == pytest.approx(0.0, abs=1e-9)


def test_plan_names_fields_or_their_absence():
    none = Simulation(Scene.model_validate(data()), device="cpu", threads=1)
    assert none.plan.fields == ()
    assert "left out  external fields: the scene has none" in none.plan.explain()
    assert "fields" not in none.energy(), "no field with a potential"
    given = Scene.model_validate(data(("drag", {"coefficient": 1e-9}), axes="frame"))
    plan = Simulation(given, device="cpu", threads=1).plan
    assert plan.fields == (("drag", "frame"),)
    assert "runs      external field: drag in frame axes" in plan.explain()
    assert plan != none.plan
