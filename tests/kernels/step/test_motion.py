"""The sum over the force slots of a grain has the bits of the plain loop."""

import numpy as np
import pytest
import warp as wp
from warpdem.kernels import MODULE_OPTIONS
from warpdem.kernels.contact.pairs import pair_force_width
from warpdem.kernels.step.motion import build_load, vec6

COUNTS = [0, 1, 2, 7, 0, 12, 3]


@pytest.mark.parametrize("walls", [False, True])
@pytest.mark.parametrize("spins", [False, True])
@pytest.mark.parametrize(("real", "kind"), [(wp.float64, np.float64), (wp.float32, np.float32)])
def test_load_is_summed_in_order(device, real, kind, spins, walls):
    load = build_load(real, spins=spins, walls=walls)
    width, n = pair_force_width(spins), len(COUNTS)
    PairForce = wp.types.vector(width, real)

    @wp.kernel(enable_backward=False, module="unique", module_options=MODULE_OPTIONS)
    def sums(
        start: wp.array(dtype=wp.int32), row: wp.array(dtype=PairForce), candidates: wp.array(dtype=wp.int32),
        wall_load: wp.array(dtype=vec6), load_out: wp.array(dtype=vec6),
    ):  # fmt: skip
        i = wp.tid()
        load_out[i] = load(i, start, row, candidates, wall_load)

    rng = np.random.default_rng(0)
    start = np.concatenate([[0], np.cumsum(COUNTS)]).astype(np.int32)
    # of very different size, so that another order of additions would show; and negative zeros, which a sum from zero loses
    row = (rng.normal(size=(start[-1], width)) * 10.0 ** rng.integers(-9, 9, (start[-1], width))).astype(kind)
    row[0] = -0.0
    candidates, wall_load = rng.integers(0, 2, n).astype(np.int32), rng.normal(size=(n, 6))
    wanted = np.zeros((n, 6))
    for i in range(n):
        for e in range(start[i], start[i + 1]):
            wanted[i, :width] += row[e].astype(np.float64)
        if walls and candidates[i]:
            wanted[i] += wall_load[i]
    out = wp.zeros(n, dtype=vec6, device=device)
    inputs = [
        wp.array(values, dtype=dtype, device=device)
        for values, dtype in ((start, wp.int32), (row, PairForce), (candidates, wp.int32), (wall_load, vec6))
    ]
    wp.launch(sums, n, [*inputs, out], device=device)
    assert out.numpy().tobytes() == wanted.tobytes()
