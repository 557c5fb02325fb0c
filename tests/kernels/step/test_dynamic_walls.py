"""Placements of walls that move along or about an axis; the mass of a servo, and the torque on it, by hand."""

import numpy as np
import pytest
import warp as wp
from warpdem.kernels.step.dynamic_walls import NUMBERS, STATE, displaced, rotation_about
from warpdem.kernels.step.schedule import Placement

from placements import moving_axes, point_and_velocity
from warpdem import Scene, Simulation
from warpdem.core import rigid_motion

AXIS = np.array([2.0, -1.0, 2.0]) / 3.0
ORIGIN = np.array([0.3, -0.2, 0.5])


@wp.kernel(enable_backward=False)
def place(
    p: wp.array(dtype=Placement), turns: wp.float64, axis: wp.vec3d, origin: wp.vec3d, s: wp.float64, u: wp.float64,
    out: wp.array(dtype=Placement),
):  # fmt: skip
    out[0] = displaced(p[0], turns, axis, origin, s, u)


@wp.kernel(enable_backward=False)
def turn(axis: wp.vec3d, angle: wp.float64, out: wp.array(dtype=wp.mat33d)):
    out[0] = rotation_about(axis, angle)


def displacement(turns, s, u):
    out = wp.zeros(1, dtype=Placement, device="cpu")
    given = wp.array(moving_axes()[None], dtype=Placement, device="cpu")
    inputs = [given, float(turns), wp.vec3d(*AXIS), wp.vec3d(*ORIGIN), s, u, out]
    wp.launch(place, dim=1, inputs=inputs, device="cpu")
    return out.numpy()[0]


@pytest.mark.parametrize("angle", [1e-9, 0.3, -2.0, 100.0])
def test_the_rotation_is_that_of_the_angle(angle):
    out = wp.zeros(1, dtype=wp.mat33d, device="cpu")
    wp.launch(turn, dim=1, inputs=[wp.vec3d(*AXIS), angle, out], device="cpu")
    exact = rigid_motion.rotation_increment(rigid_motion.unit(AXIS), np.array([angle]))[0].astype(float)
    np.testing.assert_allclose(out.numpy()[0], exact, rtol=0, atol=1e-15 * max(abs(angle), 1.0))


@pytest.mark.parametrize("turns", [0, 1])
def test_points_go_along_or_about_the_axis_and_their_velocity_is_the_change(turns):
    """Velocity of a body point: that of the axes it moves in, and the derivative of its place in them."""
    p, s, u, h = moving_axes(), 0.4, 1.7, 1e-6
    body = np.array([0.1, 0.9, -0.3])
    found, velocity = point_and_velocity(displacement(turns, s, u), body)
    ahead, _ = point_and_velocity(displacement(turns, s + h * u, u), body)
    behind, _ = point_and_velocity(displacement(turns, s - h * u, u), body)
    carried = p[15:18] + np.cross(p[12:15], found)
    np.testing.assert_allclose(velocity - carried, (ahead - behind) / (2 * h), rtol=0, atol=1e-8)
    if turns:
        on_axis = ORIGIN + 0.7 * AXIS
        np.testing.assert_allclose(*(point_and_velocity(q, on_axis)[0] for q in (displacement(1, s, u), p)), rtol=0, atol=1e-15)
        np.testing.assert_allclose(displacement(1, s, u)[12:15], p[12:15] + p[:9].reshape(3, 3) @ AXIS * u, rtol=1e-15)
    else:
        np.testing.assert_allclose(found - point_and_velocity(p, body)[0], p[:9].reshape(3, 3) @ AXIS * s, rtol=0, atol=1e-15)


def test_the_velocity_of_the_surface_turns_with_the_wall():
    """Vectors in body axes keep their components there."""
    before, after = moving_axes(), displacement(1, 0.4, 0.0)
    for first in (18, 21):
        one = before[:9].reshape(3, 3).T @ before[first : first + 3]
        other = after[:9].reshape(3, 3).T @ after[first : first + 3]
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(displacement(0, 0.4, 1.0)[18:], before[18:])


def test_a_turning_servo_has_the_inertia_of_what_it_touches():
    """Two grains at 10 and 20 mm from an oblique axis; first kick (dt/2)(D - L)/sum m r^2, L by cross products."""
    radius, step, depth = 1e-3, 1e-6, 2e-5
    positions = np.array([[0.01, 0.0, radius], [0.02, 0.003, radius]])
    origin, axis, drive = np.array([0.0, 0.0, 2e-3]), np.array([0.0, 1.0, 0.0]), 5e-3
    scene = Scene.model_validate(
        {
            "gravity": [0, 0, 0],
            "materials": {"g": {"density": 2500, "young_modulus": "50 MPa", "poisson_ratio": 0.3}},
            "pairs": [{"materials": ["g", "g"], "restitution": 0.5}],
            "grains": [{"material": "g", "radius": radius, "positions": positions}],
            "walls": [{"name": "lid", "material": "g", "plane": {"point": [0, 0, 2 * radius - depth], "normal": [0, 0, -1]},
                       "servo": {"axis": axis, "origin": origin, "torque": drive, "max_rate": 1e3}}],
            "time": {"end": 1, "step": step},
        }
    )  # fmt: skip
    sim = Simulation(scene, device="cpu", threads=1)
    force = -sim.loads()[0]
    contacts = positions + np.array([0, 0, radius - depth])
    arm = contacts - origin
    load = -sum(np.cross(a, f) @ axis for a, f in zip(arm, force, strict=True))
    arm -= np.outer(arm @ axis, axis)
    mass = 2500 * 4 / 3 * np.pi * radius**3
    sim.step(1)
    (one,) = sim.schedule.dynamic
    assert one.value("rate") == pytest.approx(0.5 * step * (drive - load) / (mass * (arm**2).sum()), rel=1e-12)
    assert one.least == pytest.approx(mass * (0.02**2 + 1e-5**2), rel=1e-2)


def test_numbers_have_their_columns():
    assert NUMBERS.width == 19
    assert STATE.names[:4] == ("position", "rate", "predicted", "correction")
