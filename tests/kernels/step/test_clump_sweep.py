"""Clumps in lanes: the bits of each by itself, function by function, and of clumps of all sizes in a run."""

import numpy as np
import pytest
import warp as wp
from warpdem.kernels import grain
from warpdem.kernels.integrator import exact_drift
from warpdem.kernels.step import border, clumps, orientation
from warpdem.kernels.step.free_rotation import free_rotation, rotation_vector
from warpdem.kernels.step.schedule import Row

from lane_probes import assert_same_bits

N, LANES = 512, 8
Record = grain.build(True).Record


def given() -> dict[str, tuple]:
    """Clumps that turn slowly, quickly and by half a turn a step, bodies of revolution and one at rest among them."""
    rng = np.random.default_rng(4)
    rate = rng.uniform(0.5, 2.0, (N, 4))
    rate[::5, 2] = rate[::5, 1]
    turn = rng.normal(size=(N, 4))
    turn /= np.linalg.norm(turn, axis=1)[:, None]
    state = rng.normal(size=(N, 16))
    state[:, 10:13] *= 10.0 ** rng.uniform(-6, 1, N)[:, None]
    state[::31, 10:13] = 0.0
    row = rng.normal(size=(N, 29)) * 1e-2
    return {
        "state": (Record, state), "turn": (wp.vec4d, turn), "rate": (wp.vec4d, rate),
        "drive": (clumps.vec6, rng.normal(size=(N, 6)) * 1e-3), "row": (Row, row),
        "dt": (wp.float64, rng.uniform(0.01, 0.1, N)),
    }  # fmt: skip


def test_free_rotation_in_lanes_has_the_bits_of_a_body_by_itself():
    of = given()
    l, rates = of["state"][1][:, 10:13], of["rate"][1][:, 1:]
    arguments = {"l": (wp.vec3d, l), "rate": (wp.vec3d, rates), "dt": of["dt"]}
    (p,) = assert_same_bits(free_rotation, arguments, (wp.vec4d,), LANES)
    assert_same_bits(rotation_vector, {"p": (wp.vec4d, p)}, (wp.vec3d,), LANES)
    assert np.ptp(np.log10(np.abs(p[:, 1]) + 1e-30)) > 6


@pytest.mark.parametrize("turning", [True, False])
def test_the_step_of_a_clump_in_lanes_has_its_bits(turning):
    frame = {"turning_frame": turning, "moving_frame": turning}
    made = clumps.build_motion(
        exact_drift.build_drift(spins=True, **frame), orientation.build_axes(turning_axes=turning),
        border.build((2.0, 0.0, 0.0), (-1.0, 0.0, 0.0)),
    )  # fmt: skip
    of = given()
    state, turn, p = assert_same_bits(made.moved, of, (Record, wp.vec4d, wp.vec4d), LANES)
    arguments = {"state": (Record, state), "turn": (wp.vec4d, turn), "p": (wp.vec4d, p), "rate": of["rate"], "dt": of["dt"]}
    (body,) = assert_same_bits(made.body_of, arguments, (clumps.Body,), LANES)
    arm = np.random.default_rng(5).normal(size=(N, 3))
    member = {"body": (clumps.Body, body), "arm": (wp.vec3d, arm), "radius": (wp.float64, arm[:, 0]), "dt": of["dt"]}
    assert_same_bits(made.member_of, member, (Record, clumps.vec6), LANES)
    axes = wp.mat33d, body[:, clumps.BODY.of("axes")]
    load = {"total": of["drive"], "axes": axes, "arm": (wp.vec3d, arm), "one": of["drive"]}
    assert_same_bits(clumps.with_member, load, (clumps.vec6,), LANES)
