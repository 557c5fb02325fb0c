"""Members as a step of their clump writes them: what dashpots see is the motion predicted for the time of the force."""

import numpy as np
from scipy.spatial.transform import Rotation
from warpdem.kernels import grain

from warpdem import Scene, Simulation

STEP = 5e-6


def landing() -> Simulation:
    """A dumbbell of two sizes that spins and slides on the floor it has just met."""
    spheres = [{"centre": [0, 0, 0], "radius": 1e-3}, {"centre": [1.5e-3, 0, 0], "radius": 0.7e-3}]
    scene = Scene.model_validate({
        "gravity": [0, 0, -9.81],
        "materials": {"g": {"density": 2500, "young_modulus": 5e6, "poisson_ratio": 0.3}},
        "pairs": [{"materials": ["g", "g"], "restitution": 0.5, "friction": 0.4}],
        "clumps": {"dumbbell": {"spheres": spheres}},
        "grains": [{"material": "g", "clump": "dumbbell", "positions": [[0, 0, 1.1e-3]], "velocities": [[0.1, 0, -0.5]],
                    "spins": [[20, 90, -40]]}],
        "walls": [{"name": "floor", "material": "g", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}],
        "time": {"end": 1, "step": STEP, "max_speed": 1},
    })  # fmt: skip
    sim = Simulation(scene, device="cpu", threads=1)
    while not len(sim.contacts().i):
        sim.step(1)
    sim.step(3)
    return sim


def test_half_a_step_after_the_members_the_motion_is_that_of_the_clump():
    """V + (dt/2) A and W = I^-1 (L + (dt/2) M) of the clump, at each member by the acceleration written beside its velocity."""
    sim = landing()
    clumps, members = sim.state.clumps, sim.state.record.numpy()
    assert clumps is not None
    body, half = clumps.record.numpy()[0], 0.5 * STEP
    velocity, momentum = (body[grain.VELOCITY] + half * body[7:10], body[grain.SPIN] + half * body[13:16])
    assert np.linalg.norm(half * body[13:16]) > 1e-3 * np.linalg.norm(momentum), "a torque must act"
    axes = Rotation.from_quat(clumps.turn.numpy()[0], scalar_first=True).as_matrix()
    spin = axes @ (clumps.rate.numpy()[0, 1:] * (axes.T @ momentum))
    for member, arm in zip(members, clumps.arm.numpy()[:, :3], strict=True):
        there = velocity + np.cross(spin, axes @ arm)
        np.testing.assert_allclose(member[grain.SPIN] + half * member[13:16], spin, rtol=1e-9)
        np.testing.assert_allclose(member[grain.VELOCITY] + half * member[7:10], there, rtol=1e-9, atol=1e-10)
