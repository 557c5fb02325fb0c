"""A normal law that acts beyond contact: lists, force loop and walls reach as far as the law says (its ``gap``)."""

import numpy as np
import pytest

from warpdem import Scene, Simulation
from warpdem.measure.elastic import LEAST_OVERLAP
from warpdem.model.impact import secant

GAP, PULL = 4e-4, 2e-3
BRIDGE = f'''"""Attraction that fades linearly with the gap between two bodies, and a linear spring when they touch."""

import functools

import warp as wp


def coefficients(a, b, pair):
    return pair.stiffness, 0.0, 1.0, 0.0


def gap(a, b, pair):
    return {GAP}


@functools.cache
def build(real):
    @wp.func
    def constants(base: real, damping: real, radius: real, mass: real):
        return base, damping

    @wp.func
    def force(overlap: real, speed: real, stiffness: real, damping: real):
        inside = real(1.0) if overlap > real(0.0) else real(0.0)
        fading = real(1.0) + overlap * real({1 / GAP})
        share = fading if fading > real(0.0) else real(0.0)
        pull = real({PULL}) * (share if share < real(1.0) else real(1.0))
        return inside * stiffness * overlap - pull, inside * stiffness, real(0.0)

    return constants, force


def energy(overlap, stiffness):
    return 0.5 * stiffness * overlap**2
'''


@pytest.fixture
def make(tmp_path, device):
    (tmp_path / "bridge.py").write_text(BRIDGE)

    def build(positions, walls=(), **engine):
        scene = Scene.model_validate(
            {
                "gravity": [0, 0, 0],
                "materials": {"g": {"density": 2500.0, "young_modulus": 5e6, "poisson_ratio": 0.3}},
                "contact": {"normal": "bridge.py", "tangential": "none"},
                "pairs": [{"materials": ["g", "g"], "restitution": 1.0, "stiffness": 1000.0}],
                "grains": [{"material": "g", "positions": positions, "radius": 1e-3}],
                "walls": [{"material": "g", **w} for w in walls],
                "time": {"end": 1.0, "step": 1e-6, "max_speed": 1e-3},
                "engine": engine,
                "base": tmp_path,
            }
        )
        return Simulation(scene, device=device, threads=1)

    return build


@pytest.mark.parametrize("skin", ["auto", 1e-5], ids=["wide skin", "thin skin"])
def test_grains_attract_across_the_gap_and_not_beyond(make, skin):
    """Four pairs, each at a gap of its own: force PULL (1 - gap / GAP), zero from GAP on."""
    gaps = np.array([0.25, 0.5, 0.99, 1.01]) * GAP
    positions = [[x, y, 0.0] for y, gap in zip(np.arange(4) * 0.01, gaps, strict=True) for x in (0.0, 2e-3 + gap)]
    sim = make(positions, skin=skin)
    assert sim.plan.contact.gap == GAP
    force = sim.loads()[0]
    expected = PULL * np.maximum(1.0 - gaps / GAP, 0.0)
    np.testing.assert_allclose(force[::2, 0], expected, rtol=0, atol=1e-15)
    np.testing.assert_allclose(force[1::2, 0], -expected, rtol=0, atol=1e-15)
    assert len(sim.contacts().i) == 3


@pytest.mark.filterwarnings("error::RuntimeWarning")  # of the looks of the guards
def test_a_pair_that_drifts_into_reach_is_seen(make):
    """No contact when the lists are made: they must be renewed for the reach of the law, not of the spheres."""
    sim = make([[0, 0, 0], [2e-3 + 1.2 * GAP, 0, 0], [2e-3, 5e-3, 0]], skin=1e-5)
    assert not sim.loads()[0].any()
    sim.state.record.assign(_with_speed(sim, 1, -0.1))
    sim.step(1500)
    assert sim.particles.velocity[1, 0] < -0.1, "it was not pulled"


def _with_speed(sim, grain, speed):
    record = sim.state.record.numpy()
    record[sim.state.rank[grain], 4] = speed
    return record


@pytest.mark.parametrize("skin", ["auto", 1e-5], ids=["wide skin", "thin skin"])
def test_walls_attract_too(make, skin):
    floor = {"name": "floor", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}
    sim = make([[0, 0, 1e-3 + 0.5 * GAP]], skin=skin, walls=[floor])
    np.testing.assert_allclose(sim.loads()[0][0], [0, 0, -0.5 * PULL], rtol=0, atol=1e-15)


@pytest.mark.parametrize(("normal", "expected"), [("hooke", 1000.0), ("hertz", 0.0)])
def test_a_contact_without_overlap_has_the_stiffness_of_the_first_touch(normal, expected):
    """The springs of a pair within the law's reach that does not touch are told with it: not 0/0."""
    assert secant(normal, np.array([LEAST_OVERLAP]), 1000.0)[0] == pytest.approx(expected, rel=1e-6, abs=1e-30)


def test_laws_of_contact_alone_have_no_gap(make_simulation):
    assert make_simulation([[0, 0, 0]], step=1e-5).plan.contact.gap == 0.0
