import functools

import numpy as np
import warp as wp
from warpdem.kernels.tangential import mindlin

RTOL = {wp.float32: 1e-6, wp.float64: 1e-15}


@functools.cache
def probe(real):
    """A kernel that calls the model once: Warp functions with ``wp.where`` cannot be called from Python."""
    model = mindlin.build(real)

    @wp.kernel(module="unique", enable_backward=False)
    def kernel(overlap: real, before: real, out: wp.array(dtype=real)):
        out[0] = model(overlap, before)

    return kernel


def kept(real, overlap, before):
    out = wp.zeros(1, dtype=real, device="cpu")
    wp.launch(probe(real), dim=1, inputs=[overlap, before, out], device="cpu")
    return float(out.numpy()[0])


def test_a_growing_contact_keeps_the_force_not_the_displacement(real):
    # k_t grows as sqrt(d): the stored spring shrinks by sqrt(1/4) when d grows fourfold, k_t s stays
    np.testing.assert_allclose(kept(real, 4e-5, 1e-5), 0.5, rtol=RTOL[real])
    np.testing.assert_allclose(kept(real, 2e-5, 1e-5), np.sqrt(0.5), rtol=RTOL[real])


def test_a_shrinking_contact_keeps_the_displacement_and_gives_up_force(real):
    assert kept(real, 1e-5, 4e-5) == 1.0
    assert kept(real, 1e-5, 1e-5) == 1.0


def test_a_new_contact_remembers_nothing(real):
    assert kept(real, 1e-5, 0.0) == 0.0
    assert kept(real, 1e-5, -1e-4) == 0.0


def test_a_contact_that_ends_is_no_division_by_zero(real):
    for overlap in (0.0, -1e-6):
        for before in (-1e-6, 0.0, 1e-6):
            assert 0.0 <= kept(real, overlap, before) <= 1.0
