"""Views of the memory of Warp arrays, as arrays of another shape and type."""

from typing import Any

import warp as wp


def array_view(
    memory: wp.array[Any], shape: tuple[int, ...], dtype: type, strides: tuple[int, ...] | None = None
) -> wp.array[Any]:
    """The first numbers of an array's memory as an array of this shape and type; it holds the memory as long as it is there.

    ``strides`` [B]: between its numbers in each direction; None where they stand side by side.
    """
    out: wp.array[Any] = wp.array(ptr=memory.ptr, shape=shape, dtype=dtype, device=memory.device, strides=strides)
    out._ref = memory  # type: ignore[assignment]  # as in Warp's own views
    return out
