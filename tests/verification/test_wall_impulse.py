"""What walls report is what the grains receive: impulse and angular impulse of every step, to round-off.

Grains fall, bounce, slide and roll between a floor fixed to the laboratory and a tube that turns and shakes by itself in a
turning frame. In every step, about a fixed point of the laboratory,

    sum over grains of  m dV, m (x - p) x dV + I dW   =   gravity's share - sum over walls of  F dt, T dt

with V, W the velocities between the instants t_k, which the engine keeps, and F, T the loads at t_k. The error is 1e-16 of the
grains' momenta; a step changes them by about 1e-3, so that it is 1e-13 of what is compared.
"""

import numpy as np
import pytest
import trimesh
from warpdem.kernels import grain

from warpdem import Scene, Simulation
from warpdem.state import contact_history

GRAVITY = np.array([2.0, -5.0, -60.0])
POINT = np.array([0.02, -0.01, 0.03])
"""Point that angular momenta refer to, fixed in the laboratory [m]."""
STEPS = 600


def scene(tube, rolling: str) -> Scene:
    """Eighteen grains in a tube that does not reach the floor."""
    rng = np.random.default_rng(8)
    place = np.stack(np.meshgrid(np.arange(3), np.arange(3), np.arange(2), indexing="ij"), axis=-1).reshape(-1, 3)
    n = len(place)
    position = (place - [1, 1, 0]) * 2.1e-3 + [0, 0, 0.95e-3] + rng.uniform(0, 0.05e-3, (n, 3))
    return Scene.model_validate(
        {
            "gravity": GRAVITY,
            "materials": {"g": {"density": 2500, "young_modulus": 2e6, "poisson_ratio": 0.3},
                          "w": {"density": 7800, "young_modulus": 2e7, "poisson_ratio": 0.3}},
            "contact": {"rolling": rolling, "torsion": True},
            "pairs": [{"materials": ["g", "g"], "restitution": 0.6, "friction": 0.5, "rolling_friction": 0.2},
                      {"materials": ["g", "w"], "restitution": 0.8, "friction": 0.4, "rolling_friction": 0.1}],
            "grains": [{"material": "g", "positions": position, "radii": rng.uniform(0.7e-3, 0.95e-3, n),
                        "velocities": rng.normal(0, 0.1, (n, 3)), "spins": rng.normal(0, 100.0, (n, 3)),
                        "ids": rng.permutation(n) + 7}],
            "walls": [
                {"name": "tube", "material": "w", "mesh": str(tube), "torque_about": [0, 0.002, 0],
                 "motion": [{"axis": [0, 0.05, 1], "origin": [1e-3, 0, 0], "rate": 40.0},
                            {"amplitude": [3e-4, 0, 0], "velocity": [0.01, 0, 0], "frequency": 100.0}]},
                {"name": "floor", "material": "w", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]},
                 "fixed_to": "laboratory"},
            ],
            "frame": {"axis": [0.1, 0, 1], "origin": [0.01, 0, 0],
                      "schedule": [{"until": 0.004, "rate": [5, 25]}, {"rate": 25}]},
            "time": {"end": 1, "step": 1.5e-5, "max_speed": 1e-3},
            "engine": {"max_overlap": 0.3},
        }
    )  # fmt: skip


def momenta(sim) -> np.ndarray:
    """Linear momentum, then angular momentum about POINT, in the laboratory, shape (2, n, 3)."""
    record, inverse, pose = sim.state.record.numpy(), sim.state.inverse.numpy(), sim.schedule.pose(sim.time)
    v, w = record[:, grain.VELOCITY] @ pose.rotation.T, record[:, grain.SPIN] @ pose.rotation.T
    mass, inertia = 1.0 / inverse[:, :1], 1.0 / inverse[:, 1:]
    arm = pose.to_laboratory(record[:, grain.POSITION]) - POINT
    return np.array([mass * v, mass * np.cross(arm, v) + inertia * w])


class Census:
    """What the grains have done at the walls so far."""

    def __init__(self) -> None:
        self.touched = {"tube": 0, "floor": 0}
        self.both = self.slid = self.stuck = 0
        self.rolled = 0.0

    def add(self, sim, loads) -> None:
        contacts = sim.contacts()
        wall = contacts.j < 0
        push = np.einsum("ij,ij->i", contacts.force, contacts.normal)
        slides = np.linalg.norm(contacts.force - contacts.normal * push[:, None], axis=1) > 0.399 * push
        for name, load in loads.items():
            self.touched[name] += bool(np.any(load.force))
        self.both += len(set(contacts.i[wall].tolist())) < wall.sum()
        self.slid += np.sum(slides & wall & (push > 0))
        self.stuck += np.sum(~slides & wall & (push > 0))
        self.rolled = max(self.rolled, np.abs(contact_history.wall_contacts(sim.view)["wall_contact_moment"]).max(initial=0.0))


@pytest.mark.parametrize("rolling", ["constant", "spring"])
def test_impulse_of_every_step_is_the_change_of_the_grains_momentum(tmp_path, rolling):
    tube = trimesh.creation.annulus(4.4e-3, 5.4e-3, 8e-3, sections=24)
    tube.apply_translation([0, 0, 4.5e-3])
    tube.export(tmp_path / "tube.stl")
    sim = Simulation(scene(tmp_path / "tube.stl", rolling), device="cpu", threads=1)
    census, mass = Census(), sim.particles.mass
    for step in range(STEPS):
        kick = sim.dt if step else 0.5 * sim.dt
        loads = sim.wall_loads(lab=True)
        if step % 5 == 0:
            census.add(sim, loads)
        arm = mass @ (sim.particles.position_lab - POINT)
        before = momenta(sim)
        sim.step(1)
        change = momenta(sim) - before
        force = mass.sum() * GRAVITY - sum(load.force for load in loads.values())
        torque = np.cross(arm, GRAVITY) - sum(
            load.torque + np.cross(load.about - POINT, load.force) for load in loads.values()
        )
        for found, expected in zip(change, (force * kick, torque * kick), strict=True):
            error = np.linalg.norm(found.sum(axis=0) - expected)
            assert error < 1e-12 * np.linalg.norm(found, axis=1).sum(), f"step {step}"
    assert min(census.touched.values()) > 30
    assert min(census.slid, census.stuck) > 10
    assert census.both > 3, "no grain met both walls at once"
    assert census.rolled > 1e-7
