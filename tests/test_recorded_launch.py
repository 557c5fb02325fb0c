"""A recorded launch does what a new one would do: with other arrays, numbers, structs and counts than when recorded."""

import numpy as np
import warp as wp
from warpdem.kernels import MODULE_OPTIONS

from warpdem.core.recorded_launch import RecordedLaunch


@wp.struct
class Pair:
    factor: float
    values: wp.array[wp.float64]


@wp.kernel(enable_backward=False, module="unique", module_options=MODULE_OPTIONS)
def scaled(pair: Pair, more: int, out: wp.array[wp.float64]):
    i = wp.tid()
    out[i] = wp.float64(pair.factor) * pair.values[i] + wp.float64(more)


def test_every_launch_reads_what_it_was_given_last(device):
    pair, n = Pair(), 6
    values = [wp.array(np.arange(n) + 10.0 * k, dtype=wp.float64, device=device) for k in range(2)]
    outs = [wp.zeros(n, dtype=wp.float64, device=device) for _ in range(2)]
    pair.factor, pair.values = 2.0, values[0]
    one = RecordedLaunch(scaled, n, [pair, 1, outs[0]], device)
    one.launch()
    np.testing.assert_array_equal(outs[0].numpy(), 2.0 * np.arange(n) + 1.0)
    pair.factor, pair.values = 3.0, values[1]  # the same struct, with something else in it
    one.launch()
    np.testing.assert_array_equal(outs[0].numpy(), 3.0 * (np.arange(n) + 10.0) + 1.0)
    one.prepare(4, [pair, 5, outs[1]])
    one.launch()
    np.testing.assert_array_equal(outs[1].numpy(), np.where(np.arange(n) < 4, 3.0 * (np.arange(n) + 10.0) + 5.0, 0.0))
    np.testing.assert_array_equal(outs[0].numpy(), 3.0 * (np.arange(n) + 10.0) + 1.0)
