"""Rows of memory to registers and back: every number arrives where plain indexing puts it."""

import numpy as np
import pytest
import warp as wp
from warpdem.kernels import MODULE_OPTIONS
from warpdem.kernels.simd import rows
from warpdem.kernels.simd.lane_types import declarations


@pytest.mark.parametrize("lanes", [2, 4, 8])
def test_rows_of_any_width_and_sums_of_two_rows(lanes):
    rng = np.random.default_rng(1)
    first, other = rng.permutation(50)[:lanes].astype(np.int32), rng.permutation(50)[:lanes].astype(np.int32)
    index = wp.array(first, dtype=wp.int32, device="cpu")
    second = wp.array(other, dtype=wp.int32, device="cpu")
    for width in (1, 2, 3, 4, 6, 8, 16):
        values = rng.normal(size=(50, width))
        text = (
            f"{declarations(lanes)}    struct batch {{\n{rows.helpers(wp.float64, lanes)}    }};\n"
            + rows.gathered("row", wp.types.vector(width, wp.float64), "table.data", "index.data", lanes)
            + f"    for (int f = 0; f < {width}; ++f) *(f64*)(out.data + f * {lanes}) = row.c[f];\n"
        )
        if width >= lanes:
            text += f"    f64 sum[{width}];\n" + "".join(
                f"    batch::read_sum(table.data + {at}, {width}, index.data, second.data, sum + {at});\n"
                for at in rows.starts(width, lanes)
            )
            text += f"    for (int f = 0; f < {width}; ++f) *(f64*)(total.data + f * {lanes}) = sum[f];\n"

        @wp.func_native(text)
        def gather(
            table: wp.array(dtype=wp.float64), index: wp.array(dtype=wp.int32), second: wp.array(dtype=wp.int32),
            out: wp.array(dtype=wp.float64), total: wp.array(dtype=wp.float64),
        ): ...  # fmt: skip

        @wp.kernel(enable_backward=False, module="unique", module_options=MODULE_OPTIONS)
        def run(
            table: wp.array(dtype=wp.float64), index: wp.array(dtype=wp.int32), second: wp.array(dtype=wp.int32),
            out: wp.array(dtype=wp.float64), total: wp.array(dtype=wp.float64),
        ):  # fmt: skip
            gather(table, index, second, out, total)

        out, total = (wp.zeros(width * lanes, dtype=wp.float64, device="cpu") for _ in range(2))
        table = wp.array(values.ravel(), dtype=wp.float64, device="cpu")
        wp.launch(run, 1, [table, index, second, out, total], device="cpu")
        np.testing.assert_array_equal(out.numpy().reshape(width, lanes), values[first].T)
        if width >= lanes:
            np.testing.assert_array_equal(total.numpy().reshape(width, lanes), (values[first] + values[other]).T)
