"""A free grain seen from a turning frame: circle, spiral, parabola, at any step size (exact_solutions 6).

    q(t) = R(-theta)(q0 + V0 t + g t^2/2),    spin relative to the frame + Omega turns by -theta

The errors are round-off of the drift: its increments R - I keep 1e6 steps within 3e-14 of the path (design section 4).
Rates and time steps are short binary numbers, so that step x dt x rate is the exact angle.
"""

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom
from scipy.spatial.transform import Rotation

RATE = 16.0  # [rad/s]
STEPS = [2.0**-7, 2.0**-11, 2.0**-21]  # 2e-2, 1.2e-3 and 1.2e-6 of a revolution
AXIS = np.array([2.0, -1.0, 2.0]) / 3.0
ORIGIN = np.array([0.25, -0.5, 1.0])
POSITION = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, -1.0], [-1.0, 0.5, 0.25]])
VELOCITY = np.array([[0.0, 0.0, 0.0], [0.5, 0.25, -0.125], [-0.25, 1.0, 0.5]])  # laboratory: the first one is at rest
SPIN = np.array([[0.0, 0.0, 0.0], [3.0, -8.0, 5.0], [40.0, 10.0, -20.0]])
SOFT = {"young_modulus": 1.0, "engine": {"skin": 1e6}}  # one list for the whole flight


def flight(make_simulation, step, frame, gravity=(0.0, 0.0, 0.0)):
    return make_simulation(
        POSITION, velocities=VELOCITY, spins=SPIN, velocities_in="laboratory", step=step, gravity=gravity,
        frame={"axis": AXIS.tolist(), "origin": ORIGIN.tolist(), **frame}, **SOFT,
    )  # fmt: skip


def wrapped(angle):
    """``angle`` without its whole turns [rad]; in double, 2 pi is off by 2.4e-16 a turn: 5e-12 after a million steps."""
    turn = np.longdouble("6.28318530717958647692528676655900577")
    return float(angle - np.round(angle / turn) * turn)


def compare(sim, angle, rate, gravity=(0.0, 0.0, 0.0), tolerance=1e-12):
    """Positions, velocities and spins against the exact ones, relative to the size of the path and its speeds."""
    t, g = sim.time, np.array(gravity)
    back = Rotation.from_rotvec(-wrapped(angle) * AXIS).apply
    away = POSITION - ORIGIN + VELOCITY * t + 0.5 * g * t**2
    exact = back(away)
    omega = rate * AXIS
    velocity = back(VELOCITY + g * t) - np.cross(omega, exact)
    p = sim.particles
    size = np.maximum(np.linalg.norm(POSITION - ORIGIN, axis=1), np.linalg.norm(away, axis=1))[:, None]
    speed = np.linalg.norm(VELOCITY, axis=1)[:, None] + np.linalg.norm(g) * t + RATE * size
    assert np.max(np.abs(p.position - ORIGIN - exact) / size) < tolerance
    assert np.max(np.abs(p.velocity - velocity) / speed) < tolerance
    assert np.max(np.abs(p.spin - (back(SPIN) - omega))) < tolerance * (np.abs(SPIN).max() + RATE)


@pytest.mark.parametrize("step", STEPS)
def test_a_grain_in_free_fall_is_on_its_parabola_seen_from_the_frame(make_simulation, step):
    gravity = (1.0, 2.0, -9.75)
    sim = flight(make_simulation, step, {"rate": RATE}, gravity)
    for _ in range(5):
        sim.step(2000)
        compare(sim, RATE * sim.time, RATE, gravity)


@pytest.mark.parametrize("step", STEPS)
def test_a_free_grain_stays_on_its_circle_or_spiral_for_a_million_steps(make_simulation, step):
    sim = flight(make_simulation, step, {"rate": RATE})
    for _ in range(5):
        sim.step(200_000)
        compare(sim, RATE * sim.time, RATE)
        arm = np.linalg.norm(np.cross([sim.particles.position[0] - ORIGIN, POSITION[0] - ORIGIN], AXIS), axis=1)
        assert arm[0] == pytest.approx(arm[1], rel=1e-12), "the grain at rest in the laboratory leaves its circle"


def test_the_spiral_of_the_table_is_met():
    """The tabulated spiral of exact_solutions 6 checks the formula that these tests rest on."""
    for t, x, y in ((0.05, 0.56222457, -0.85710474), (0.5, -1.10324152, 0.59611924), (1.0, 0.79471214, -1.28780146)):
        z = (1.0 + (0.5 + 0.2j) * t) * np.exp(-20j * t)
        assert abs(z - (x + 1j * y)) < 1e-8


def test_a_ramp_a_sudden_stop_and_a_turn_back_leave_free_flight_exact(make_simulation):
    schedule = [
        {"until": 0.5, "rate": [0.0, 24.0]},
        {"until": 1.0, "rate": 24.0},
        {"until": 1.25, "rate": 0.0},
        {"rate": -16.0},
    ]
    gravity = (0.0, 3.0, -9.75)
    sim = flight(make_simulation, 2.0**-10, {"schedule": schedule}, gravity)
    # angle by hand: 24 t^2, then 6 + 24 (t - 1/2), then 18, then 18 - 16 (t - 5/4)
    for t, angle, rate in (
        (0.25, 1.5, 12.0), (0.75, 12.0, 24.0), (1.125, 18.0, 0.0), (1.5, 14.0, -16.0), (3.25, -14.0, -16.0),
    ):  # fmt: skip
        sim.run(until=t)
        assert sim.time == t
        compare(sim, angle, rate, gravity)


def test_a_step_across_a_sudden_stop_takes_the_angle_that_was_turned(make_simulation):
    """A stop in the middle of a step: the axes have turned by RATE t_stop, whatever the steps."""
    sim = flight(make_simulation, 0.125, {"schedule": [{"until": 0.3125, "rate": RATE}, {"rate": 0.0}]})
    sim.step(4)
    compare(sim, RATE * 0.3125, 0.0)


# --- any motion of the frame -----------------------------------------------------------------------------------------

MILL = [
    {"axis": [0, 0, 1], "origin": [0.5, 0, 0.25], "rate": 16.0},
    {"axis": AXIS.tolist(), "origin": ORIGIN.tolist(), "rate": -40.0},
]
SHAKER = {"amplitude": [0.25, 0, 0.125], "frequency": 8, "phase": 1}
STOP = {"axis": AXIS.tolist(), "origin": ORIGIN.tolist(), "schedule": [{"until": 0.75, "rate": 16.0}]}
FRAMES = {
    "planetary mill": MILL,
    "shaker": [SHAKER],
    "drum on a shaker that stops": [SHAKER, STOP],
    "shaker in a swinging drum": [
        {"axis": [0, 1, 0], "sinusoid": {"amplitude": 8, "frequency": 2}},
        SHAKER | {"velocity": [0.5, 0, -0.25]},
    ],
}


def compare_paths(sim, gravity, tolerance=1e-12):
    """Position, velocity and spin in the laboratory against the parabola, relative to the path as the frame sees it."""
    t, g, p = sim.time, np.array(gravity), sim.particles
    exact = POSITION + VELOCITY * t + 0.5 * g * t**2
    size = max(1.0, np.abs(exact).max(), np.abs(p.position).max())
    speed = np.abs(VELOCITY).max() + np.linalg.norm(g) * t + np.abs(p.velocity).max()
    assert np.max(np.abs(p.position_lab - exact)) < tolerance * size
    assert np.max(np.abs(p.velocity_lab - VELOCITY - g * t)) < tolerance * speed
    assert np.max(np.abs(p.spin_lab - SPIN)) < tolerance * (np.abs(SPIN).max() + np.abs(p.spin).max())


def fly(make_simulation, frame, gravity, steps=20_000, step=2.0**-14):
    sim = make_simulation(
        POSITION, velocities=VELOCITY, spins=SPIN, velocities_in="laboratory", step=step, gravity=gravity,
        frame=frame, **SOFT,
    )  # fmt: skip
    compare_paths(sim, gravity)
    for _ in range(4):
        sim.step(steps // 4)
        compare_paths(sim, gravity)
    return sim


@pytest.mark.parametrize("frame", FRAMES.values(), ids=FRAMES)
def test_a_free_grain_keeps_its_parabola_in_the_laboratory_whatever_the_frame_does(make_simulation, frame):
    sim = fly(make_simulation, frame, (1.0, 2.0, -9.75))
    assert np.abs(sim.particles.position - sim.particles.position_lab).max() > 0.1, "the frame has not moved"


def test_a_free_grain_keeps_its_parabola_in_a_sampled_frame(make_simulation, tmp_path):
    """Kinks at the samples, which lie between the instants; held before the first and after the last."""
    stage = Usd.Stage.CreateNew(str(tmp_path / "path.usda"))
    stage.SetTimeCodesPerSecond(24)
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    xform = UsdGeom.Xform.Define(stage, "/Arm")
    shift, turn = xform.AddTranslateOp(), xform.AddRotateXYZOp(UsdGeom.XformOp.PrecisionDouble)
    rng = np.random.default_rng(0)
    for code in range(2, 26):
        shift.Set(Gf.Vec3d(*rng.uniform(-20, 20, 3)), code)
        turn.Set(Gf.Vec3d(*rng.uniform(-60, 60, 3)), code)
    stage.Save()
    frame = {"usd": str(tmp_path / "path.usda"), "prim": "/Arm"}
    sim = fly(make_simulation, frame, (1.0, 2.0, -9.75))
    assert sim.time > 26 / 24
    assert np.abs(sim.particles.position - sim.particles.position_lab).max() > 0.1, "the frame has not moved"


def test_velocities_relative_to_a_nested_frame_are_those_of_its_points(make_simulation):
    """A grain with the velocity of a point of the frame is at rest there: eq. 8 of the paper and its spin counterpart."""
    sim = make_simulation(POSITION, step=2.0**-14, frame=[SHAKER, *MILL], **SOFT)
    pose = sim.schedule.pose(0.0)
    np.testing.assert_allclose(sim.particles.velocity, 0.0, rtol=0, atol=1e-14)
    np.testing.assert_allclose(sim.particles.velocity_lab, pose.velocity_at(POSITION), rtol=0, atol=1e-13)
    outer = np.array([0, 0, 16.0])
    inner = -40.0 * AXIS
    spin = outer + inner
    swing = 16 * np.pi * np.cos(1) * np.array([0.25, 0, 0.125])
    velocity = swing + np.cross(outer, POSITION - [0.5, 0, 0.25]) + np.cross(inner, POSITION - ORIGIN)
    np.testing.assert_allclose(sim.particles.velocity_lab, velocity, rtol=0, atol=1e-12)
    spun = make_simulation(POSITION, spins=SPIN, step=2.0**-14, frame=[SHAKER, *MILL], **SOFT)
    np.testing.assert_allclose(spun.particles.spin_lab, SPIN + spin, rtol=0, atol=1e-12)
    np.testing.assert_allclose(spun.particles.spin, SPIN, rtol=0, atol=1e-12)
