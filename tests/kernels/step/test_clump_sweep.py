"""Clumps in lanes: the bits of each by itself, function by function, and of clumps of all sizes in a run."""

import numpy as np
import pytest
import warp as wp
from warpdem.kernels import grain
from warpdem.kernels.integrator import exact_drift
from warpdem.kernels.step import border, clumps, orientation
from warpdem.kernels.step.free_rotation import free_rotation, rotation_vector
from warpdem.kernels.step.schedule import Row

import warpdem
from lane_probes import assert_same_bits
from switches import in_lanes

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
    frame = {"rotating_frame": turning, "moving_frame": turning}
    made = clumps.build_motion(
        exact_drift.build_drift(spins=True, **frame), orientation.build_axes(rotating_axes=turning),
        border.build((2.0, 0.0, 0.0), (-1.0, 0.0, 0.0)),
    )  # fmt: skip
    of = given()
    state, turn, p = assert_same_bits(made.moved, of, (Record, wp.vec4d, wp.vec4d), LANES)
    arguments = {"state": (Record, state), "turn": (wp.vec4d, turn), "p": (wp.vec4d, p), "rate": of["rate"], "dt": of["dt"]}
    (body,) = assert_same_bits(made.body_of, arguments, (clumps.Body,), LANES)
    arm = np.random.default_rng(5).normal(size=(N, 4))
    member = {"body": (clumps.Body, body), "arm": (wp.vec4d, arm), "dt": of["dt"]}
    assert_same_bits(made.member_of, member, (Record, clumps.vec6), LANES)
    axes = wp.mat33d, body[:, clumps.BODY.of("axes")]
    load = {"total": of["drive"], "axes": axes, "arm": (wp.vec4d, arm), "one": of["drive"]}
    assert_same_bits(clumps.with_member, load, (clumps.vec6,), LANES)


def bed(field: bool):
    """34 clumps of two, three and five members (34 does not divide by the lanes) and 9 spheres that fall onto a floor."""
    rng = np.random.default_rng(7)
    rod = [{"centre": [0, 0, z], "radius": 1e-3} for z in (-2e-3, -1e-3, 0.0, 1e-3, 2e-3)]
    grid = np.stack(np.meshgrid(*[np.arange(4)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)[rng.permutation(64)] * 6.2e-3
    groups, at = [], 0
    for clump, count in (("pair", 13), ("triple", 10), ("rod", 11), (None, 9)):
        places, at = grid[at : at + count], at + count
        velocities = rng.normal(0.0, 0.8, (count, 3)) - np.array([0.0, 0.0, 1.0])
        group = {"material": "stone", "positions": places.tolist(), "velocities": velocities.tolist()}
        groups.append(group | ({"clump": clump} if clump else {"radius": 1.2e-3}))
    return warpdem.Scene.model_validate({
        "materials": {"stone": {"density": 2500.0, "young_modulus": 5e7, "poisson_ratio": 0.3}},
        "pairs": [{"materials": ["stone", "stone"], "restitution": 0.7, "friction": 0.4}],
        "clumps": {"pair": {"spheres": rod[1:3]}, "triple": {"spheres": rod[:3]}, "rod": {"spheres": rod}},
        "walls": [{"name": "floor", "material": "stone", "plane": {"point": [0, 0, -4e-3], "normal": [0, 0, 1]}}],
        "borders": {axis: {"kind": "periodic", "min": -3.1e-3, "max": 21.7e-3} for axis in "xy"}, "grains": groups,
        "gravity": [0, 0, -200.0],
        "time": {"end": 1.0, "step": "2 us"}, "engine": {"max_overlap": 0.4},
        "fields": [{"model": "drag", "parameters": {"coefficient": 1e-6}}] if field else [],
    })  # fmt: skip


@pytest.mark.parametrize(("width", "field"), [(8, False), (4, True)])
def test_lanes_change_no_bit_of_a_run(width, field, monkeypatch):
    """With a field, what drives a clump is found before it comes into a lane."""
    hashes, touched = set(), 0
    for lanes in (1, width):
        sim = in_lanes(bed(field), lanes, monkeypatch)
        for _ in range(8):
            sim.step(1000)
            touched += len(sim.contacts().i)
        hashes.add(sim.state_hash())
    assert len(hashes) == 1
    assert touched > 10
