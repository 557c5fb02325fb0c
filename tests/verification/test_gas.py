"""A frictionless gas in a box: energy is kept when elastic and only lost when not (exact_solutions 9)."""


import numpy as np

import stability_scenes as scenes


def test_an_elastic_gas_keeps_its_energy_for_1e5_steps(device):
    """At t_c/50 within 1e-4, and the second half is like the first: what is lost and won in impacts goes up and down."""
    sim = scenes.gas(1.0, 50, device)
    start = scenes.total_energy(sim)
    drift = []
    for _ in range(100):
        sim.step(1000)
        drift.append(scenes.total_energy(sim) / start - 1.0)
    assert scenes.GAS_SPEED < sim.extremes["pair_approach_speed"] < scenes.FASTEST
    assert np.abs(drift).max() < 1e-4
    assert abs(np.mean(drift[50:]) - np.mean(drift[:50])) < 5e-5, "the energy has a trend"


def test_errors_of_the_energy_fall_with_order_2_4(device):
    """Rms change of the energy over some impacts, between instants without contact, at 8 to 64 steps per contact."""
    steps = (8, 16, 32, 64)
    rms = [np.sqrt(np.mean(scenes.energy_errors(n, device=device) ** 2)) for n in steps]
    order = -np.polyfit(np.log(steps), np.log(rms), 1)[0]
    assert order >= 2.4, rms


def test_an_inelastic_gas_only_loses_energy(device):
    sim = scenes.gas(0.8, 50, device)
    energy = [scenes.total_energy(sim)]
    for _ in range(400):
        sim.step(10)
        energy.append(scenes.total_energy(sim))
    # within a contact the scheme's energy swings like that of the elastic gas
    assert np.diff(energy).max() < 1e-4 * energy[0]
    assert energy[-1] < 0.8 * energy[0]
