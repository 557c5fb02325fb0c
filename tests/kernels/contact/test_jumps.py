"""Shares of a force that begins or ends within a step."""

import functools

import numpy as np
import pytest
import warp as wp
from warpdem.kernels.contact import jumps


@functools.cache
def kernel(real):
    share = jumps.build(real)

    @wp.kernel(module="unique", enable_backward=False)
    def probe(overlap: wp.array(dtype=real), before: wp.array(dtype=real), at: real, out: wp.array(dtype=real)):
        i = wp.tid()
        out[i] = share(overlap[i], before[i], at)

    return probe


def shares(overlap, before, at, real):
    overlap = np.asarray(overlap, dtype=float)
    out = wp.zeros(len(overlap), dtype=real, device="cpu")
    given = [wp.array(np.asarray(x, dtype=float), dtype=real, device="cpu") for x in (overlap, before)]
    wp.launch(kernel(real), dim=len(overlap), inputs=[*given, at, out], device="cpu")
    return out.numpy().astype(float)


@pytest.mark.parametrize("at", [0.0, -2e-6])
def test_shares_follow_the_place_of_the_jump_within_the_step(real, at):
    tau, step = np.array([0.0, 0.1, 0.5, 0.9, 1.0]), 3e-6
    tolerance = 1e-14 if real is wp.float64 else 1e-6
    first = shares(at + tau * step, at - (1 - tau) * step, at, real)
    np.testing.assert_allclose(first, tau + 0.5, rtol=tolerance, atol=tolerance)
    last = shares(at - tau * step, at + (1 - tau) * step, at, real)
    np.testing.assert_allclose(last, 0.5 - tau, rtol=tolerance, atol=tolerance)


def test_a_contact_at_rest_gives_a_number(real):
    assert np.isfinite(shares([1e-6, 0.0, -1e-6], [1e-6, 0.0, -1e-6], 0.0, real)).all()


@pytest.mark.parametrize("start", np.linspace(0.05, 0.95, 7))
def test_the_impulse_of_a_force_that_jumps_on_and_off_is_exact_for_an_even_motion(start):
    # kicks of a constant force between -a and 0, at even steps through both: their sum is the time it acts
    step, a = 0.13, 1.0
    there = step * (start + np.arange(-4, 14)) - 0.4  # grows through 0, where the force begins
    back = there[::-1] - 1.0  # falls through -a, where it ends
    first = shares(there[1:], there[:-1], 0.0, wp.float64)
    last = shares(back[1:], back[:-1], -a, wp.float64)
    begins = (there[1:] > 0) & (there[:-1] <= 0)
    ends = (back[1:] < -a) & (back[:-1] >= -a)
    weight_in = np.where(begins, first, there[1:] > 0)
    weight_out = np.where(ends, last, back[1:] >= -a)
    # from the crossing to the middle of the last step, and from the middle of the first
    assert weight_in.sum() * step == pytest.approx(there[-1] + 0.5 * step, rel=1e-12)
    assert weight_out.sum() * step == pytest.approx(back[1] + 0.5 * step + a, rel=1e-12)
