"""Device arrays of the lists: their memory is kept from one build to the next."""

import numpy as np
import warp as wp

from warpdem.core.array_view import array_view
from warpdem.core.huge_pages import in_huge_pages

SPARE = 0.125
"""Capacity of lists that a device builds itself beyond what they need at present [-]."""

LONGEST = 2**31 - 1
"""Entries of a list: what 32-bit numbers count."""


class BufferPool:
    """Arrays by name.

    Args:
        device: where they are.
        exact: arrays have the length asked for, and ``capacity`` says what to ask for: how a device builds lists itself; else
            arrays have memory for half as much more, and no list is longer than it needs to be.
    """

    def __init__(self, device: wp.Device, exact: bool) -> None:
        self._device, self._exact = device, exact
        self._buffers: dict[str, wp.array] = {}
        self._views: dict[str, wp.array] = {}
        self._capacities: dict[str, int] = {}

    def zeros(self, shape: int | tuple[int, ...], dtype: type) -> wp.array:
        """An array of its own."""
        return in_huge_pages(wp.zeros(shape, dtype=dtype, device=self._device))

    def upload(self, data: np.ndarray, dtype: type) -> wp.array:
        """``data`` in an array of its own."""
        return in_huge_pages(wp.array(np.ascontiguousarray(data), dtype=dtype, device=self._device))

    def buffer(self, name: str, shape: tuple[int, ...], dtype: type) -> wp.array:
        """An array whose memory is kept, the same one as long as it fits; its content is not set."""
        size = int(np.prod(shape))
        kept = self._buffers.get(name)
        if kept is None or kept.shape[0] < size:
            more = 0 if self._exact else size // 2 + 64
            kept = self._buffers[name] = in_huge_pages(wp.empty(size + more, dtype=dtype, device=self._device))
        view = self._views.get(name)
        if view is None or view.ptr != kept.ptr or view.shape != shape or view.dtype is not dtype:
            view = self._views[name] = array_view(kept, shape, dtype)
        return view

    def capacity(self, name: str, need: int) -> int:
        """Length of a list of ``need`` entries: a device that builds the next one in the same arrays has some to spare."""
        if not self._exact:
            return need
        if need > self._capacities.get(name, -1):
            self._capacities[name] = min(int(need * (1.0 + SPARE)) + 64, LONGEST)
        return self._capacities[name]
