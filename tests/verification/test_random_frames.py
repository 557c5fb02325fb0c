"""Random motions of the frame, random grains: the run in the frame, mapped back, is the laboratory run (invariant 1)."""

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

SETTINGS = settings(
    max_examples=8, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def numbers(low, high):
    return st.floats(low, high, allow_subnormal=False)


def vectors(size):
    return st.tuples(*[numbers(-size, size)] * 3).map(list)


def directions():
    return vectors(1.0).filter(lambda v: np.linalg.norm(v) > 0.1)


STRETCHES = st.tuples(numbers(-20, 20), st.tuples(numbers(-20, 20), numbers(-20, 20)).map(list), numbers(-20, 20)).map(
    lambda r: [{"until": 0.011, "rate": r[0]}, {"until": 0.023, "rate": r[1]}, {"rate": r[2]}]
)
RATES = st.one_of(
    numbers(-20, 20).map(lambda rate: {"rate": rate}),
    STRETCHES.map(lambda schedule: {"schedule": schedule}),
    st.tuples(numbers(-9, 9), numbers(-9, 9), numbers(1, 30)).map(
        lambda s: {"sinusoid": {"mean": s[0], "amplitude": s[1], "frequency": s[2]}}
    ),
)
ROTATIONS = st.tuples(directions(), vectors(0.05), RATES).map(lambda r: {"axis": r[0], "origin": r[1], **r[2]})
TRANSLATIONS = st.tuples(vectors(1.0), vectors(2e-3), numbers(1, 40), numbers(-3, 3)).map(
    lambda t: {"velocity": t[0], "amplitude": t[1], "frequency": t[2], "phase": t[3]}
)
FRAMES = st.lists(st.one_of(ROTATIONS, TRANSLATIONS), min_size=1, max_size=3)


def in_laboratory(sim):
    p = sim.particles
    return p.position_lab, p.velocity_lab, p.spin_lab


@given(frame=FRAMES, place=vectors(0.1), velocity=vectors(1.0), spin=vectors(50.0), gravity=vectors(10.0))
@SETTINGS
def test_free_flight(make_simulation, frame, place, velocity, spin, gravity):
    """Before any contact: the exact path within 1e-10 of its size, at a coarse step."""
    sim = make_simulation(
        [place], velocities=[velocity], spins=[spin], velocities_in="laboratory", gravity=gravity, frame=frame, step=1e-3,
        max_speed=1e-9,
    )  # fmt: skip
    sim.step(40)
    t, v, g = sim.time, np.array(velocity), np.array(gravity)
    q, speed, turn = in_laboratory(sim)
    np.testing.assert_allclose(q[0], place + v * t + 0.5 * g * t**2, rtol=0, atol=1e-10 * 0.1)
    np.testing.assert_allclose(speed[0], v + g * t, rtol=0, atol=1e-10)
    np.testing.assert_allclose(turn[0], spin, rtol=0, atol=1e-10 * 50)


@given(frame=FRAMES, offset=st.tuples(numbers(-0.7, 0.7), numbers(-0.7, 0.7)), spin=vectors(100.0))
@SETTINGS
def test_frictional_collision(make_simulation, frame, offset, spin):
    """Two grains collide: the same bits but for round-off in every frame, and an error that falls with the step."""
    r = 1e-3
    keys = {
        "positions": [[0, 0, 0], [2.2 * r, offset[0] * r, offset[1] * r]],
        "velocities": [[0.15, 0.02, 0.0], [-0.15, 0.0, 0.05]],
        "spins": [spin, [0.0, 0.0, 20.0]],
        "velocities_in": "laboratory",
        "radius": r,
        "restitution": 0.7,
        "friction": 0.4,
        "tangential": "mindlin",
    }
    end = 4e-3

    def run(step, **more):
        sim = make_simulation(**keys, **more, step=step)
        sim.run(until=end)
        assert len(sim.contacts().i) == 0, "the collision is not over"
        return in_laboratory(sim)

    reference = run(2.5e-7)
    error = []
    for step in (8e-6, 1e-6):
        laboratory, framed = run(step), run(step, frame=frame)
        for a, b, size in zip(laboratory, framed, (r, 0.2, 200.0), strict=True):
            np.testing.assert_allclose(b, a, rtol=0, atol=1e-9 * size)
        error.append(np.abs(framed[1] - reference[1]).max())
    # order 1.25 of a damped Hertz contact, over eight times the step: 13 times, less at some phases of the onset
    assert error[1] < 0.3 * error[0] or error[0] < 1e-5
