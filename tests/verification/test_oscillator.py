"""Each scheme's own exact solution of the harmonic oscillator, and a pendulum whose plane turns (exact_solutions 6 and 8).

With z = w dt, q(0) = q0 and v(0) = 0:

    kick and drift      q_n = q0 cos(n th), v_n = -w sqrt(1 - z^2/4) q0 sin(n th), sin(th/2) = z/2,
                        E_n/E_0 = 1 - (z^2/4) sin^2(n th): bounded for ever
    explicit Euler      E_n/E_0 = (1 + z^2)^n
    rk2, rk4            E_n/E_0 = (1 + z^4/4)^n, (1 - z^6/72 + z^8/576)^n

The n steps of a simulation must be these to round-off, n eps: no tolerance for the step is left.
"""

import numpy as np
import pytest

from warpdem.scene.models import model_names

W, Z, STEPS = 2.0 * np.pi, 0.3, 1000
MASS = 2500.0 * 4.0 / 3.0 * np.pi * 0.05**3
SPRING = {"model": "harmonic", "parameters": {"stiffness": MASS * W**2}}
GROWTH = {
    "explicit_euler": 1.0 + Z**2, "rk2": 1.0 + Z**4 / 4.0, "rk4": 1.0 - Z**6 / 72.0 + Z**8 / 576.0,
}  # fmt: skip
SYMPLECTIC = ["exact_drift", "velocity_verlet", "modified_verlet", "scovel", "lobatto"]


def test_every_scheme_is_here():
    assert {*SYMPLECTIC, *GROWTH} == set(model_names("integrator"))


def swung(make_simulation, scheme, step, **keys):
    return make_simulation(
        [[1.0, 0.0, 0.0]], radius=0.05, step=step, fields=[SPRING], engine={"integrator": scheme, "guards": "record"}, **keys
    )


@pytest.mark.parametrize("scheme", SYMPLECTIC)
def test_kick_and_drift_is_the_discrete_oscillator(make_simulation, scheme):
    sim = swung(make_simulation, scheme, Z / W)
    th = 2.0 * np.arcsin(Z / 2.0)
    for n in (1, 2, 17, STEPS):
        sim.step(n - sim.step_number)
        q, v = sim.particles.position[0], sim.particles.velocity[0]
        np.testing.assert_allclose(q, [np.cos(n * th), 0, 0], rtol=0, atol=1e-15 * (n + 5))
        # scovel and lobatto read the velocity from the same kick: v_n is that of velocity Verlet
        np.testing.assert_allclose(v / W, [-np.sqrt(1.0 - Z**2 / 4.0) * np.sin(n * th), 0, 0], rtol=0, atol=2e-15 * (n + 5))
        energy = q[0] ** 2 + (v[0] / W) ** 2
        assert 1.0 - Z**2 / 4.0 - 1e-12 < energy < 1.0 + 1e-12


@pytest.mark.parametrize("scheme", GROWTH)
def test_energy_of_the_other_schemes_grows_or_falls_as_it_must(make_simulation, scheme):
    steps = 40 if scheme == "explicit_euler" else STEPS
    sim = swung(make_simulation, scheme, Z / W)
    sim.step(steps)
    energy = sim.particles.position[0, 0] ** 2 + (sim.particles.velocity[0, 0] / W) ** 2
    assert np.log(energy) == pytest.approx(steps * np.log(GROWTH[scheme]), rel=1e-12, abs=1e-12)


def test_the_plane_of_a_pendulum_turns_against_the_frame(make_simulation):
    """A swing of the laboratory seen from a turning frame: its plane turns at -Om, exactly (Foucault; w >> Om)."""
    rate, step = 0.05 * W, Z / W
    sim = swung(
        make_simulation, "exact_drift", step, frame={"axis": [0, 0, 1], "rate": rate}, velocities=[[0.0, 0.0, 0.0]],
        velocities_in="laboratory",
    )  # fmt: skip
    th = 2.0 * np.arcsin(Z / 2.0)
    for n in (10, 111, STEPS):
        sim.step(n - sim.step_number)
        p, turn = sim.particles, rate * sim.time
        away = np.cos(n * th)
        np.testing.assert_allclose(p.position[0], [away * np.cos(turn), -away * np.sin(turn), 0], rtol=0, atol=2e-15 * (n + 5))
        np.testing.assert_allclose(p.position_lab[0], [away, 0, 0], rtol=0, atol=2e-15 * (n + 5))
