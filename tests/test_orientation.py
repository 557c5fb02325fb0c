"""How grains are turned: exact for a steady spin in any frame, kept bit for bit, and left out when nobody asks."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from warpdem import Scene, SceneError, Simulation

STEPS, DT = 400, 4e-5
SPINS = np.array([[0.0, 0.0, 0.0], [30.0, -50.0, 20.0], [0.0, 0.0, 200.0]])
FRAMES = {
    "rest": None,
    "turning": {"axis": [0.0, 0.6, 0.8], "rate": 60.0, "origin": [0.1, 0.0, 0.0]},
    "stopping": [
        {"axis": [0, 0, 1], "schedule": [{"until": 0.007, "rate": 80.0}, {"rate": 0.0}]},
        {"axis": [1, 0, 0], "rate": 40.0},
    ],
}


def scene(positions, frame=None, integrator="exact_drift", orientation=True, **keys) -> Scene:
    grains = {"material": "g", "positions": positions, "radius": 1e-3, **keys.pop("grains", {})}
    return Scene.model_validate(
        {
            "gravity": [0, 0, 0],
            "materials": {"g": {"density": 2500.0, "young_modulus": 5e6, "poisson_ratio": 0.3}},
            "contact": {"normal": "hertz", "tangential": "mindlin", "rolling": "none"},
            "pairs": [{"materials": ["g", "g"], "restitution": 0.5, "friction": 0.5}],
            "grains": [grains],
            "time": {"end": 1.0, "step": DT, "max_speed": 0.01},
            "output": {"orientation": orientation},
            "engine": {"integrator": integrator, **keys.pop("engine", {})},
            **({} if frame is None else {"frame": frame}),
            **keys,
        }
    )


def rotation(quaternions) -> Rotation:
    return Rotation.from_quat(quaternions, scalar_first=True)


def flight(frame, integrator="exact_drift") -> Simulation:
    """Three grains far apart, spinning steadily in the laboratory."""
    grains = {"spins": SPINS, "velocities_in": "laboratory"}
    return Simulation(scene(np.eye(3) * 0.05, FRAMES[frame], integrator, grains=grains), device="cpu", threads=1)


def error(sim) -> float:
    """Largest angle between how grains are turned in the laboratory and exp(t w) [rad]."""
    axes = Rotation.from_matrix(sim.schedule.pose(sim.time).rotation)
    found = axes * rotation(sim.particles.orientation)
    return float((found * Rotation.from_rotvec(SPINS * sim.time).inv()).magnitude().max())


@pytest.mark.parametrize("frame", FRAMES)
def test_a_steady_spin_turns_a_grain_exactly_in_any_frame(frame):
    sim = flight(frame)
    np.testing.assert_array_equal(sim.particles.orientation, np.tile([1.0, 0.0, 0.0, 0.0], (3, 1)))
    sim.step(STEPS)
    assert error(sim) < 1e-13
    np.testing.assert_allclose(np.linalg.norm(sim.particles.orientation, axis=1), 1.0, rtol=0, atol=3e-16)


@pytest.mark.parametrize("integrator", ["scovel", "rk2"])
def test_schemes_with_relative_spins_agree_to_their_order(integrator):
    """Their spins relative to the frame are turned by second-order steps: (60/s 4e-5 s)^2 / 12 per radian."""
    sim = flight("turning", integrator)
    sim.step(STEPS)
    assert 0.0 < error(sim) < 1e-4


def heap(**keys) -> Scene:
    """Grains that fall together on a floor in a turning frame."""
    cell = np.stack(np.meshgrid(np.arange(3), np.arange(3), np.arange(2), indexing="ij"), axis=-1).reshape(-1, 3)
    velocities = np.random.default_rng(3).normal(0, 0.1, (18, 3))
    return scene(
        cell * 2.02e-3 + [0, 0, 1.1e-3],
        {"axis": [0, 1, 0], "rate": 20.0},
        gravity=[0, 0, -60],
        grains={"velocities": velocities, "ids": np.random.default_rng(1).permutation(18)},
        walls=[{"name": "floor", "material": "g", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}],
        **keys,
    )


def test_orientation_follows_the_spins_of_touching_grains():
    """The product of the turns by the spins read between two steps, second order in the step."""
    sim = Simulation(heap(), device="cpu", threads=1)
    turned = Rotation.identity(18)
    for _ in range(60):
        before = sim.particles.spin
        sim.step()
        turned = Rotation.from_rotvec(0.5 * DT * (before + sim.particles.spin)) * turned
    assert turned.magnitude().max() > 0.2
    assert (rotation(sim.particles.orientation) * turned.inv()).magnitude().max() < 2e-3


def test_bits_do_not_depend_on_threads_memory_order_or_resume_and_asking_changes_none(tmp_path):
    whole = Simulation(heap(), device="cpu", threads=1)
    whole.step(200)
    first = Simulation(heap(engine={"skin": 3e-5}), device="cpu", threads=2)
    first.step(77)
    assert first.lists.rebuilds > whole.lists.rebuilds
    first.save_checkpoint(tmp_path / "cut.h5")
    second = Simulation.from_checkpoint(tmp_path / "cut.h5", device="cpu", threads=1)
    np.testing.assert_array_equal(second.particles.orientation, first.particles.orientation)
    second.step(123)
    np.testing.assert_array_equal(second.particles.orientation, whole.particles.orientation)
    without = Simulation(heap(orientation=False), device="cpu", threads=1)
    without.step(200)
    assert without.state_hash() == whole.state_hash() == second.state_hash()


def test_nothing_is_allocated_or_compiled_when_nobody_asks():
    sim = Simulation(heap(orientation=False), device="cpu", threads=1)
    assert (sim.plan.measures.orientation, sim.state.orientation, sim.snapshot().orientation) == (False, None, None)
    assert "left out  orientation of the grains: output.orientation is false" in sim.plan.explain()
    with pytest.raises(SceneError, match=r"output\.orientation = false"):
        _ = sim.particles.orientation


def test_grains_that_nothing_turns_stay_as_they_are():
    pair = [{"materials": ["g", "g"], "restitution": 0.5, "friction": 0.0}]
    sim = Simulation(scene(np.eye(3) * 0.05, pairs=pair), device="cpu", threads=1)
    sim.step(3)
    assert "left out  orientation of the grains: nothing turns a grain" in sim.plan.explain()
    np.testing.assert_array_equal(sim.snapshot().orientation, np.tile([1.0, 0.0, 0.0, 0.0], (3, 1)))
