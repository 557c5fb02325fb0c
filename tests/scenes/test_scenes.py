"""Every scene file loads; short ones come out as their first lines say, long ones run shortened and stay finite."""

from pathlib import Path

import numpy as np
import pytest

import warpdem

SCENES = Path(__file__).parents[2] / "scenes"


def simulation(name: str, *overrides: str) -> warpdem.Simulation:
    return warpdem.Simulation(warpdem.load_scene(SCENES / name, overrides), device="cpu", threads=1)


def angular_momentum(sim: warpdem.Simulation) -> np.ndarray:
    p = sim.particles
    return (p.mass[:, None] * np.cross(p.position, p.velocity) + p.inertia[:, None] * p.spin).sum(axis=0)


@pytest.mark.parametrize("path", sorted(SCENES.glob("*.toml")), ids=lambda path: path.stem)
def test_scene_file_loads_and_says_what_must_come_out(path):
    assert warpdem.load_scene(path).title
    head = path.read_text().split("title =")[0]
    assert "Shown:" in head and "Must come out" in head


def test_two_spheres_part_as_stated():
    sim = simulation("two_spheres.toml")
    start = angular_momentum(sim)
    sim.run(until=sim.scene.time.end)
    p = sim.particles
    momentum = (p.mass[:, None] * p.velocity).sum(axis=0)
    np.testing.assert_allclose(momentum, 0.0, rtol=0, atol=1e-12 * p.mass[0] * 0.5)
    np.testing.assert_allclose(angular_momentum(sim), start, rtol=1e-12, atol=1e-12 * np.linalg.norm(start))
    parting = (p.velocity[1] - p.velocity[0]) @ [0.8, 0.6, 0.0]
    np.testing.assert_allclose(parting, 0.64, rtol=0, atol=0.003)
    np.testing.assert_allclose(p.spin, [[0.0, 0.0, 36.0]] * 2, rtol=0.01, atol=1e-12)


def test_bouncing_sphere_reaches_the_heights_stated():
    sim = simulation("bouncing_sphere.toml")
    every, heights = 500, []
    while sim.time < sim.scene.time.end:
        sim.step(every)
        heights.append(sim.particles.position[0, 2] - 0.01)
    height = np.array(heights)
    inner = height[1:-1]
    peaks = inner[(inner > height[:-2]) & (inner >= height[2:])]
    np.testing.assert_allclose(peaks[:5], 0.1 * 0.64 ** np.arange(1, 6), rtol=0.005)
    last_flight = sim.dt * every * (1 + np.flatnonzero(height > 0.0)[-1])
    np.testing.assert_allclose(last_flight, 1.285, rtol=0.01)


def test_the_tennis_racket_turns_over_when_stated():
    sim = simulation("tennis_racket.toml")
    momentum, energy = np.linalg.norm(sim.clumps.angular_momentum), sim.energy()["rotational"]
    before, found = 20.0, []
    while sim.time < sim.scene.time.end - 1e-9:
        sim.step()
        clumps, (w, *v) = sim.clumps, sim.clumps.orientation[0]
        spin, v = clumps.spin[0] + sim.schedule.pose(sim.time).spin, np.array(v)
        along = (spin + 2.0 * np.cross(v, np.cross(v, spin) - w * spin))[0]  # in the axes of the clump
        if along * before < 0.0:
            found.append(sim.time - sim.dt * along / (along - before))
        before = along
    np.testing.assert_allclose(found, [1.00575549, 3.01726648], rtol=0, atol=2e-7)
    assert np.linalg.norm(sim.clumps.angular_momentum) == pytest.approx(momentum, rel=1e-12)
    assert sim.energy()["rotational"] == pytest.approx(energy, rel=1e-12)


@pytest.mark.parametrize("name", ["box_bed.toml", "hourglass.toml"])
def test_long_scene_shortened_stays_finite(name):
    count = {"box_bed.toml": "grains.0.fill.solid_fraction=0.05", "hourglass.toml": "grains.0.fill.count=300"}[name]
    sim = simulation(name, count)
    start = sim.particles.position_lab
    sim.step(300)
    p = sim.particles
    assert len(p.id) >= 300
    assert all(np.isfinite(a).all() for a in (p.position, p.velocity, p.spin))
    # it falls: by g t^2 / 2 where nothing is in the way
    drop = start[:, 2] - p.position_lab[:, 2]
    np.testing.assert_allclose(np.median(drop), 0.5 * 9.81 * sim.time**2, rtol=0.05)
