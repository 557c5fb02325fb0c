"""Every integrator in every kind of frame converges to the exact path with its order: no frame term is dropped or doubled."""

import numpy as np
import pytest

from warpdem.scene.models import model, model_names

SCHEMES = model_names("integrator")
ORDER_IN_A_FRAME = {  # with the velocity-dependent Coriolis force; None: exact
    "exact_drift": None,
    "explicit_euler": 1,
    "velocity_verlet": 1,
    "modified_verlet": 1,
    "scovel": 2,
    "lobatto": 2,
    "rk2": 2,
    "rk4": 4,
}
RAMP = [{"until": 0.1, "rate": 3.0}, {"until": 0.25, "rate": [3.0, 9.0]}, {"until": 0.4, "rate": -2.0}]
FRAMES = {
    # steps, a ramp and a stop about a tilted axis: Coriolis, centrifugal and Euler term, jumps, the spin's turn
    "ramped": {"axis": [1, 2, 2], "origin": [0.1, 0.2, 0.3], "schedule": RAMP},
    # an origin that is accelerated, alone and on a turning arm
    "shaken": {"amplitude": [0.02, 0.01, 0.03], "frequency": 3.0},
    "planetary": [{"axis": [0, 0, 1], "rate": 3.0}, {"axis": [0, 1, 0], "origin": [0.3, 0, 0], "rate": -5.0}],
}
START = {"positions": [[1.0, 0.0, 0.0]], "velocities": [[0.3, 0.2, -0.4]], "spins": [[1.0, 2.0, 3.0]]}
GRAVITY = np.array([1.0, -2.0, -9.81])
FLOOR = {"name": "floor", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}, "fixed_to": "laboratory"}
WITH_CONTACTS = {"tangential": "mindlin", "rolling": "constant", "rolling_friction": 0.05, "walls": [FLOOR]}
"""In a frame that turns about z: tests that share it share the kernels of each scheme."""


def test_the_table_of_orders_names_every_scheme():
    assert set(ORDER_IN_A_FRAME) == set(SCHEMES)


def flown(make_simulation, scheme, frame, step, end=0.6):
    """Errors of position, velocity and spin in the laboratory after free flight, each in its own unit."""
    sim = make_simulation(
        **START, radius=0.05, gravity=GRAVITY.tolist(), frame=frame, velocities_in="laboratory", step=step,
        engine={"integrator": scheme, "guards": "record"},
    )  # fmt: skip
    sim.run(until=end)
    t, p = sim.time, sim.particles
    v = np.array(START["velocities"])
    exact = (START["positions"] + v * t + 0.5 * GRAVITY * t**2, v + GRAVITY * t, np.array(START["spins"]))
    return np.array(
        [np.abs(a - b).max() for a, b in zip((p.position_lab, p.velocity_lab, p.spin_lab), exact, strict=True)]
    )


@pytest.mark.parametrize("frame", FRAMES)
@pytest.mark.parametrize("scheme", SCHEMES)
def test_free_flight_converges_to_the_laboratory_path(make_simulation, scheme, frame):
    if ORDER_IN_A_FRAME[scheme] is None:
        error = flown(make_simulation, scheme, FRAMES[frame], 2e-3)
        assert (error < 1e-12).all()
        return
    coarse, fine = (flown(make_simulation, scheme, FRAMES[frame], step) for step in (2e-3, 1e-3))
    expected = model("integrator", scheme).ORDER if frame == "shaken" else ORDER_IN_A_FRAME[scheme]
    turning = fine > 1e-13  # a frame that only shifts leaves spins alone, and some schemes turn them exactly
    assert turning[:2].all()
    np.testing.assert_allclose(np.log2(coarse[turning] / fine[turning]), expected, rtol=0, atol=0.12)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_order_with_a_force_of_position(make_simulation, scheme):
    """Harmonic oscillator: the order that the file states."""
    w = 2.0 * np.pi
    mass = 2500.0 * 4.0 / 3.0 * np.pi * 0.05**3
    field = {"model": "harmonic", "parameters": {"stiffness": mass * w**2}}
    error = []
    for step in (1 / 256, 1 / 512):
        engine = {"integrator": scheme, "guards": "record"}
        sim = make_simulation([[1.0, 0, 0]], radius=0.05, step=step, fields=[field], engine=engine)
        sim.run(until=0.625)
        error.append(np.abs(sim.particles.position[0, 0] - np.cos(w * sim.time)))
    assert np.log2(error[0] / error[1]) == pytest.approx(model("integrator", scheme).ORDER, abs=0.1)


@pytest.mark.parametrize("scheme", ["exact_drift", "velocity_verlet"])
def test_fields_act_on_the_absolute_velocity_whatever_the_scheme_holds(make_simulation, scheme):
    """Drag of the laboratory in a turning frame: v = v0 exp(-c t/m), to the first order of the lesser scheme."""
    mass = 2500.0 * 4.0 / 3.0 * np.pi * 0.05**3
    field = {"model": "drag", "parameters": {"coefficient": 2.0 * mass}}
    sim = make_simulation(
        **START, radius=0.05, frame={"axis": [1, 2, 2], "rate": 5.0}, velocities_in="laboratory", step=2e-4, fields=[field],
        engine={"integrator": scheme, "guards": "record"},
    )  # fmt: skip
    sim.run(until=0.5)
    left = np.exp(-2.0 * sim.time)
    v = np.array(START["velocities"])
    np.testing.assert_allclose(sim.particles.velocity_lab, v * left, rtol=0, atol=0.02)
    np.testing.assert_allclose(sim.particles.position_lab, START["positions"] + v * (1 - left) / 2.0, rtol=0, atol=0.02)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_frictional_bounce_in_a_turning_frame(make_simulation, scheme):
    """All schemes meet the same contacts: an oblique bounce and a collision of the laboratory, with friction, in a frame."""
    r, rate = 1e-3, 40.0
    keys = {
        "positions": [[5e-3, 2e-3, r + 2e-5], [-3e-3, 1e-3, 0.02], [-3e-3 + 2.02 * r, 1e-3, 0.02]],
        "velocities": [[0.1, 0.05, -0.2], [0.2, 0.1, 0.0], [-0.2, 0.0, 0.1]],
        "radius": r,
        "restitution": 0.6,
        "friction": 0.4,
        **WITH_CONTACTS,
        "velocities_in": "laboratory",
        "step": 1e-6,
    }
    reference = make_simulation(**keys)
    framed = make_simulation(**keys, frame={"axis": [0, 0, 1], "rate": rate}, engine={"integrator": scheme})
    for sim in (reference, framed):
        sim.step(700)
        assert len(sim.contacts().i) == 0, "the bounce is not over"
    a, b = reference.particles, framed.particles
    assert np.linalg.norm(a.spin_lab, axis=1).min() > 20.0, "friction did not act"
    # of 200 steps per contact; the default meets the same forces as in the laboratory, the others as far as they are accurate
    of_speed, of_spin = {
        "exact_drift": (1e-12, 1e-11), "explicit_euler": (0.015, 0.007), "rk2": (2e-5, 1e-4), "rk4": (4e-4, 1e-4),
    }.get(scheme, (4e-4, 2e-3))  # fmt: skip
    np.testing.assert_allclose(b.velocity_lab, a.velocity_lab, rtol=0, atol=of_speed * 0.2)
    np.testing.assert_allclose(b.spin_lab, a.spin_lab, rtol=0, atol=of_spin * np.linalg.norm(a.spin_lab[0]))


@pytest.mark.parametrize("scheme", ["modified_verlet", "rk4"])
def test_bits_of_a_scheme_with_stages(make_simulation, scheme):
    """Stages keep the memory of the step's beginning, on any number of threads and with any skin."""
    grid = np.stack(np.meshgrid(*[np.arange(4)] * 3), -1).reshape(-1, 3) * 1.9995e-3 + [0, 0, 1e-3]
    keys = {
        "velocities": np.random.default_rng(3).normal(scale=0.02, size=grid.shape).tolist(),
        "friction": 0.5, "gravity": [0, 0, -9.81], "frame": {"axis": [0, 0, 1], "rate": 5.0}, "step": 1e-5, **WITH_CONTACTS,
    }  # fmt: skip
    hashes = set()
    for threads, skin in ((1, "auto"), (2, "auto"), (1, 3e-4)):
        sim = make_simulation(grid.tolist(), **keys, engine={"integrator": scheme, "skin": skin}, threads=threads)
        sim.step(150)
        assert len(sim.contacts().i) > 20
        hashes.add(sim.state_hash())
    assert len(hashes) == 1
