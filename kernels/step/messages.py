"""Rows of an array that go to other processes (ranks) from GPU to GPU: put side by side, and back to their places.

A row is a number of words of four bytes, whatever it holds: the record of a grain, a column of a table.
"""

import warp as wp
from warpdem.kernels import MODULE_OPTIONS

wp.set_module_options(MODULE_OPTIONS)


@wp.kernel(enable_backward=False)
def take_rows(array: wp.array2d(dtype=wp.uint32), rows: wp.array(dtype=wp.int32), rows_out: wp.array2d(dtype=wp.uint32)):
    """One word per thread: ``rows`` of the array, in their order."""
    k, word = wp.tid()
    rows_out[k, word] = array[rows[k], word]


@wp.kernel(enable_backward=False)
def put_rows(values: wp.array2d(dtype=wp.uint32), rows: wp.array(dtype=wp.int32), array_out: wp.array2d(dtype=wp.uint32)):
    """One word per thread: the values become ``rows`` of the array, of which none stands twice."""
    k, word = wp.tid()
    array_out[rows[k], word] = values[k, word]
