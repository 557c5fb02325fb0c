"""Two bodies pressed together turn about their common normal: the tangential spring turns with them (design section 3).

Both spin with Omega about the normal while i creeps past j at the constant speed u (the contact is so soft that its
force changes nothing). Slip rate and spring, in the laboratory, with the normal swung by the way u t:

    slip = u - Omega x (u t),    s' = Omega x s + slip,    so    s = u t

A spring that is only projected on the tangent plane, not turned, would end at u t - Omega x u t^2/2: at Omega t = 3 rad
that is 1.8 times as long and points elsewhere.
"""

import numpy as np
import pytest

R, DEPTH, CREEP, OMEGA, DT, STEPS = 1e-3, 5e-6, 1e-6, 300.0, 5e-6, 2000  # Omega dt = 1.5e-3, Omega t = 3
SOFT = {"young_modulus": 1e-6, "density": 2500.0, "tangential": "mindlin", "friction": 1e6, "restitution": 1.0}


@pytest.fixture(params=["no frame", "turning frame"])
def frame(request):
    """The same in the laboratory and seen from axes that turn otherwise about the same normal."""
    return None if request.param == "no frame" else {"axis": [0, 0, 1], "rate": -170.0}


def check(sim):
    sim.step(STEPS)
    contacts = sim.contacts()
    assert len(contacts.i) == 1
    way = CREEP * sim.time
    assert way < 1e-4 * R
    spring = contacts.spring[0] @ sim.particles._pose.rotation.T
    # a step's slip is added where the step ends, not turned by the half step that follows it: Omega dt/2 of the way;
    # at a wall the material point is taken at the end of the step too, as much again
    tolerance = 1.02 * OMEGA * DT
    np.testing.assert_allclose(spring, [way, 0.0, 0.0], rtol=0, atol=tolerance * way)
    force = contacts.force[0] @ sim.particles._pose.rotation.T
    assert abs(force[1]) < tolerance * abs(force[0])
    assert force[0] < 0


def test_two_grains_turned_about_their_normal_carry_their_spring(make_simulation, frame):
    z = 2 * R - DEPTH
    sim = make_simulation(
        [[0, 0, z], [0, 0, 0]], radius=R, velocities=[[CREEP, 0, 0], [0, 0, 0]], spins=[[0, 0, OMEGA]] * 2,
        velocities_in="laboratory", frame=frame, step=DT, **SOFT,
    )  # fmt: skip
    check(sim)


def test_a_grain_on_a_turning_wall_carries_its_spring(make_simulation, frame):
    wall = {"name": "disk", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}
    wall |= {"fixed_to": "laboratory", "motion": {"axis": [0, 0, 1], "rate": OMEGA}}
    sim = make_simulation(
        [[0, 0, R - DEPTH]], radius=R, velocities=[[CREEP, 0, 0]], spins=[[0, 0, OMEGA]],
        velocities_in="laboratory", frame=frame, walls=(wall,), step=DT, **SOFT,
    )  # fmt: skip
    check(sim)


def test_a_pair_that_revolves_while_it_parts_does_not_slip(make_simulation):
    """Both turn with the line of centres while it grows by a thousandth: the arms of the slip are those of mid-step."""
    phi, before, after = 1e-2, 2 * R - 1e-5, 2 * R - 0.8e-5
    start, end = np.array([before, 0, 0]), after * np.array([np.cos(phi), np.sin(phi), 0])
    sim = make_simulation(
        [start, [0, 0, 0]], radius=R, velocities=[(end - start) / DT, [0, 0, 0]], spins=[[0, 0, phi / DT]] * 2, step=DT, **SOFT
    )
    sim.step(1)
    # the chord is shorter than the arc: (R_i + R_j) phi^3/24 on each side; with the arms of the end 60 times as much
    assert np.linalg.norm(sim.contacts().spring[0]) < 1.1 * (before + after) * phi**3 / 24


def test_a_grain_that_rolls_while_it_sinks_in_does_not_slip(make_simulation):
    """Its arm is the distance to the wall at mid-step."""
    depth, sunk, spin = 1e-5, 1.2e-5, 200.0
    floor = {"name": "floor", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}
    speed = spin * (R - 0.5 * (depth + sunk))
    sim = make_simulation(
        [[0, 0, R - depth]], radius=R, velocities=[[speed, 0, (depth - sunk) / DT]], spins=[[0, spin, 0]], walls=(floor,),
        step=DT, **SOFT,
    )  # fmt: skip
    sim.step(1)
    np.testing.assert_allclose(sim.contacts().overlap, sunk, rtol=1e-9)
    np.testing.assert_allclose(sim.contacts().spring[0], 0.0, rtol=0, atol=1e-9 * speed * DT)


def test_a_turning_wall_slips_past_by_the_way_of_its_point_halfway(make_simulation):
    """Slip of one step is V dt - Omega x (q + V dt/2) dt: with the point at the step's end it errs by Omega dt/2 of V dt."""
    place, velocity, turn = np.array([5e-3, 0, R - DEPTH]), np.array([0.3, 0.2, 0.0]), np.array([0, 0, OMEGA])
    disk = {"name": "disk", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}, "motion": {"axis": [0, 0, 1], "rate": OMEGA}}
    sim = make_simulation([place], radius=R, velocities=[velocity], walls=(disk,), step=DT, **SOFT)
    sim.step(1)
    slip = velocity * DT - np.cross(turn, place + 0.5 * velocity * DT) * DT
    # the wall's path is a chord: (Omega dt)^2 of V dt, and (Omega dt)^3/24 of q
    error = (OMEGA * DT) ** 2 * np.linalg.norm(velocity * DT) + (OMEGA * DT) ** 3 / 24 * np.linalg.norm(place)
    np.testing.assert_allclose(sim.contacts().spring[0], slip, rtol=0, atol=error)
