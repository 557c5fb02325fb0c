"""The motion of several grains in lanes: the bits of each by itself, of a step and in runs of all kinds."""

import numpy as np
import pytest
import warp as wp
from warpdem.kernels import grain
from warpdem.kernels.integrator import exact_drift
from warpdem.kernels.step import border, motion_sweep
from warpdem.kernels.step.schedule import Row

import warpdem
from lane_probes import assert_same_bits
from switches import in_lanes

N = 512


@pytest.mark.parametrize(("spins", "turning"), [(True, True), (True, False), (False, True)])
def test_the_step_of_a_grain_in_lanes_has_its_bits(spins, turning):
    rng = np.random.default_rng(3)
    drift = exact_drift.build_drift(spins=spins, rotating_frame=turning, moving_frame=turning)
    moved = motion_sweep.build_moved(drift, border.build((2.0, 0.0, 0.0), (-1.0, 0.0, 0.0)), spins=spins)
    Record = grain.build(spins).Record
    state = {"state": (Record, rng.normal(size=(N, grain.WIDTH[spins])))}
    acted = {"total": (motion_sweep.vec6, rng.normal(size=(N, 6))), "inverse": (wp.vec2d, rng.uniform(0.5, 2.0, (N, 2)))}
    step = {"row": (Row, rng.normal(size=(N, 29)) * 1e-2), "dt": (wp.float64, rng.uniform(0.01, 0.1, N))}
    (after,) = assert_same_bits(moved, state | acted | step, (Record,), 8)
    wrapped = np.abs(after[:, 0] - state["state"][1][:, 0]) > 1.0
    assert 0.1 < wrapped.mean() < 0.9  # some grains cross the border, others do not


def heap(friction: float, precision: str, outlet: bool, moving: bool):
    """39 small grains, which the lanes do not divide, fall onto a large one that has more contacts than any register sums."""
    rng = np.random.default_rng(8)
    across = np.stack(np.meshgrid(*[np.arange(4)] * 2, np.arange(3), indexing="ij"), axis=-1).reshape(-1, 3)[:39]
    small = across * 2.1e-3 + np.array([-3.2e-3, -3.2e-3, 8.2e-3]) + rng.uniform(-2e-5, 2e-5, (39, 3))
    motion = {"amplitude": [0, 0, "0.2 mm"], "frequency": "60 Hz"}
    floor = {"name": "floor", "material": "stone", "plane": {"point": [0, 0, -1e-4], "normal": [0, 0, 1]}}
    borders = {"x": {"kind": "periodic", "min": -7.5e-3, "max": 7.5e-3}}
    if outlet:  # for what falls off the large one
        borders |= {"z": {"kind": "open", "min": 1.5e-3, "max": 1.0}}
    return warpdem.Scene.model_validate({
        "materials": {"stone": {"density": 2500.0, "young_modulus": 5e7, "poisson_ratio": 0.3}},
        "contact": {} if friction else {"tangential": "none", "rolling": "none"},
        "pairs": [{"materials": ["stone", "stone"], "restitution": 0.3, "friction": friction}],
        "walls": [floor | ({"motion": motion} if moving else {})],
        "grains": [
            {"material": "stone", "positions": small.tolist(), "radius": 1e-3},
            {"material": "stone", "positions": [[0.0, 0.0, 3.5e-3]], "radius": 3.6e-3},
        ],
        "borders": borders,
        "gravity": [2.0, 0, -60.0],
        "time": {"end": 1.0, "step": "5 us"},
        "engine": {"precision": precision, "max_overlap": 0.4},
        "output": {"orientation": moving},
    })  # fmt: skip


@pytest.mark.parametrize(
    ("width", "friction", "precision", "outlet", "moving"),
    [
        (8, 0.5, "double", False, False),
        (4, 0.5, "mixed", False, True),
        (8, 0.0, "double", True, False),
        (4, 0.0, "double", False, False),
        (8, 0.5, "mixed", False, False),
    ],
)
def test_lanes_change_no_bit_of_a_run(width, friction, precision, outlet, moving, monkeypatch):
    hashes, most, at_wall = set(), 0, 0
    for lanes in (1, width):
        sim = in_lanes(heap(friction, precision, outlet, moving), lanes, monkeypatch)
        for _ in range(10):
            sim.step(300)
            most = max(most, int(np.diff(sim.lists.slot_start.numpy()).max()))
            at_wall += int((sim.contacts().j < 0).sum())
        hashes.add(sim.state_hash())
        assert (len(sim.particles.id) < 40) == outlet
    assert len(hashes) == 1
    assert most > motion_sweep.SLOTS
    assert at_wall > 0
