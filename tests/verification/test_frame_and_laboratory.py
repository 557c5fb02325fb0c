"""One motion computed in a turning frame and in the laboratory (exact_solutions 7): equal after the change of frame."""

import numpy as np
import pytest

R = 1e-3
GRAIN = {"radius": R, "young_modulus": 5e7, "restitution": 0.7, "friction": 0.3, "tangential": "mindlin"}


def both(make_simulation, planes, rotation, **keys):
    """Simulation with walls that turn in the laboratory, and the one in the frame that turns with them."""
    laboratory = [{"name": f"w{k}", "plane": p, "motion": rotation} for k, p in enumerate(planes)]
    frame = [{"name": f"w{k}", "plane": p} for k, p in enumerate(planes)]
    keys = GRAIN | keys | {"velocities_in": "laboratory"}
    return make_simulation(walls=laboratory, **keys), make_simulation(walls=frame, frame=rotation, **keys)


def compare(a, b, tolerance, size, speed):
    """Largest differences after mapping both to the laboratory."""
    p, q = a.particles, b.particles
    assert np.abs(p.position_lab - q.position_lab).max() < tolerance * size
    assert np.abs(p.velocity_lab - q.velocity_lab).max() < tolerance * speed
    assert np.abs(p.spin_lab - q.spin_lab).max() < tolerance * speed / R


def test_a_grain_sliding_on_a_turning_disk(make_simulation):
    """Friction must not depend on the frame: the spring is carried by the turn of the axes and of the bodies."""
    disk = [{"point": [0, 0, 0], "normal": [0, 0, 1]}]
    rotation = {"axis": [0, 0, 1], "rate": 20.0}
    keys = {"positions": [[0.01, 0, R]], "gravity": [0, 0, -9.81], "step": 1e-5}
    a, b = both(make_simulation, disk, rotation, **keys)
    for _ in range(5):
        a.step(1000)
        b.step(1000)
        compare(a, b, 1e-9, R, 0.2)
    assert a.particles.velocity_lab[0, 1] > 0.02, "the disk does not drag the grain"
    assert np.linalg.norm(a.particles.spin_lab[0]) > 10.0


@pytest.mark.parametrize("schedule", [False, True], ids=["steady", "ramp and stop"])
def test_a_grain_bouncing_in_a_turning_box(make_simulation, schedule):
    """Until the third bounce and 1e-6; later small differences grow with each bounce."""
    half = 0.01
    planes = [{"point": (-half * n).tolist(), "normal": n.tolist()} for n in np.concatenate([np.eye(3), -np.eye(3)])]
    turn = {"schedule": [{"until": 0.02, "rate": [0.0, 15.0]}, {"until": 0.05, "rate": 15.0}]}
    rotation = {"axis": [0, 1, 0], "origin": [0.002, 0, 0], **(turn if schedule else {"rate": 15.0})}
    start = {"positions": [[0.001, 0.002, 0.003]], "velocities": [[0.3, 0.4, 0.2]], "spins": [[50.0, 20.0, -80.0]]}
    a, b = both(make_simulation, planes, rotation, gravity=[0, 0, -9.81], step=1e-5, **start)
    bounces, touching = 0, False
    while bounces < 3 and a.step_number < 12_000:
        a.step(10)
        b.step(10)
        compare(a, b, 1e-6, half, 0.5)
        now = len(a.contacts().i) > 0
        bounces += touching and not now
        touching = now
    assert bounces == 3


SHAKER = {"amplitude": [0.002, 0, 0.003], "frequency": 30, "phase": 0.4}
MILL = [
    {"axis": [0, 1, 0], "origin": [0.002, 0, 0], "rate": 15.0},
    {"axis": [0.3, 0, 1], "origin": [0, 0.01, 0], "sinusoid": {"amplitude": 20, "frequency": 7}},
]


@pytest.mark.parametrize("fixed_to", ["laboratory", "frame"])
@pytest.mark.parametrize("frame", [[SHAKER], [SHAKER, *MILL]], ids=["shaker", "mill on a shaker"])
def test_two_grains_in_a_box_with_its_own_motion_whatever_the_frame_does(make_simulation, frame, fixed_to):
    """Wall motions of the frame, of their own, or both: the same motion told in two ways, through two bounces at least."""
    half, own = 0.01, [MILL[1]]
    planes = [{"point": (-half * n).tolist(), "normal": n.tolist()} for n in np.concatenate([np.eye(3), -np.eye(3)])]

    def simulation(frame, motion, fixed_to):
        walls = [
            {"name": f"w{k}", "plane": p, "fixed_to": fixed_to, "motion": motion} for k, p in enumerate(planes)
        ]
        return make_simulation(
            [[0.001, 0.002, 0.003], [0.004, 0.002, 0.0032]], velocities=[[0.3, 0.4, 0.2], [-0.2, 0.1, 0.3]],
            spins=[[50, 20, -80], [0, 0, 0]], velocities_in="laboratory", step=1e-5, gravity=[0, 0, -9.81],
            walls=walls, frame=frame, **GRAIN,
        )  # fmt: skip

    a = simulation(None, frame + own if fixed_to == "frame" else own, "frame")
    b = simulation(frame, own, fixed_to)
    bounces, touching = 0, False
    while bounces < 2 and a.step_number < 8000:
        a.step(20)
        b.step(20)
        compare(a, b, 1e-6, half, 0.5)
        now = len(a.contacts().i) > 0
        bounces += touching and not now
        touching = now
    assert bounces == 2


ROLLING = {"rolling": "spring", "rolling_friction": 0.3, "rolling_damping": 0.3}
"""So rough that the rolling springs bend and do not slide all the time."""


def test_rolling_springs_turn_with_the_axes(make_simulation):
    """A grain that rocks on a floor and two that rock on each other, in axes that turn quickly about a tilted one."""
    floor = {"name": "floor", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}, "fixed_to": "laboratory"}
    keys = GRAIN | ROLLING | {"positions": [[0.01, 0, 0.995 * R], [0, 0, 0.02], [0, 0, 0.02 + 1.99 * R]],
            "spins": [[2.0, 1.0, 0.5], [3.0, -2.0, 1.0], [0.0, 1.0, 0.0]], "velocities_in": "laboratory", "step": 1e-6,
            "walls": (floor,)}  # fmt: skip
    still, turning = make_simulation(**keys), make_simulation(frame={"axis": [1, 2, 2], "rate": 800.0}, **keys)
    for _ in range(20):
        still.step(20)
        turning.step(20)
        compare(still, turning, 1e-9, R, 0.2)
    slowed = np.linalg.norm(still.particles.spin_lab - keys["spins"], axis=1)
    assert slowed.min() > 0.1, "nothing acts on a grain's rolling"
