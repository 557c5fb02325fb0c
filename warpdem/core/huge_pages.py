"""Huge pages for large arrays on a CPU: contacts and grains are read in scattered order, and each page needs an address.

Linux only, and only where the system lets programs ask for them; elsewhere nothing happens.
"""

import ctypes
import functools
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import warp as wp

LEAST = 4 * 2**20
"""Bytes of an array from which on it is worth the call."""
SETTINGS = Path("/sys/kernel/mm/transparent_hugepage")
MADV_HUGEPAGE, MADV_COLLAPSE = 14, 25  # from <asm-generic/mman-common.h>; the second since Linux 6.1


@functools.cache
def page_size() -> int:
    """Bytes of a huge page; 0 where there are none to ask for."""
    try:
        never = "[never]" in (SETTINGS / "enabled").read_text()
        return 0 if never else int((SETTINGS / "hpage_pmd_size").read_text())
    except (OSError, ValueError):
        return 0


@functools.cache
def _advice() -> Callable[[int, int, int], int] | None:
    """The system's ``madvise``, or None."""
    if sys.platform != "linux" or not page_size():
        return None
    try:
        madvise = ctypes.CDLL(None).madvise
    except (OSError, AttributeError):
        return None
    madvise.argtypes, madvise.restype = (ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int), ctypes.c_int
    return madvise


def inside(start: int, size: int, page: int) -> tuple[int, int]:
    """Address and length of the whole pages between ``start`` and ``start + size`` [B]."""
    first = -(-start // page) * page
    return first, max((start + size) // page * page - first, 0)


def in_huge_pages(array: wp.array[Any]) -> wp.array[Any]:
    """The same array, in huge pages if it is large, contiguous and on a CPU.

    The pages are asked for where they are touched first, and the ones that are there already are joined. A refusal is no
    error: the array stays as it is.
    """
    madvise = _advice()
    if madvise is None or array.capacity < LEAST or array.device is None or not array.device.is_cpu:
        return array
    start, size = inside(array.ptr or 0, array.capacity, page_size())
    if size and madvise(start, size, MADV_HUGEPAGE) == 0:
        madvise(start, size, MADV_COLLAPSE)
    return array
