"""Large arrays come in huge pages where the system has some; nothing else changes."""

import re
from pathlib import Path

import numpy as np
import pytest
import warp as wp

from warpdem.core import huge_pages
from warpdem.engine.buffers import BufferPool

MB = 2**20


@pytest.fixture
def asked(monkeypatch):
    """The calls to the system, which are not carried out."""
    calls = []
    monkeypatch.setattr(huge_pages, "_advice", lambda: lambda *call: calls.append(call) or 0)
    monkeypatch.setattr(huge_pages, "page_size", lambda: 2 * MB)
    return calls


@pytest.mark.parametrize(
    ("start", "size", "expected"),
    [(0, 8, (0, 8)), (1, 8, (4, 4)), (4, 9, (4, 8)), (5, 3, (8, 0)), (5, 2, (8, 0)), (7, 18, (8, 16))],
)
def test_only_whole_pages_within_an_array_are_asked_for(start, size, expected):
    assert huge_pages.inside(start, size, 4) == expected


def test_large_arrays_of_the_pool_are_asked_for(asked):
    pool = BufferPool(wp.get_device("cpu"), exact=True)
    small, large = pool.buffer("a", (4 * MB // 8 - 1,), wp.float64), pool.buffer("b", (MB,), wp.float64)
    assert {advice for *_, advice in asked} == {huge_pages.MADV_HUGEPAGE, huge_pages.MADV_COLLAPSE}
    assert all(large.ptr <= start and start + size <= large.ptr + 8 * MB for start, size, _ in asked)
    assert all(start % (2 * MB) == 0 and size % (2 * MB) == 0 and size >= 4 * MB for start, size, _ in asked)
    assert small.ptr is not None


def test_a_refusal_is_no_error(monkeypatch):
    monkeypatch.setattr(huge_pages, "_advice", lambda: lambda *_: -1)
    monkeypatch.setattr(huge_pages, "page_size", lambda: 2 * MB)
    values = np.arange(MB, dtype=np.float64)
    array = huge_pages.in_huge_pages(wp.array(values, dtype=wp.float64, device="cpu"))
    assert array.numpy().tobytes() == values.tobytes()


@pytest.mark.parametrize("settings", [{}, {"enabled": "always madvise [never]\n", "hpage_pmd_size": "2097152\n"}])
def test_a_system_without_them_is_not_asked(monkeypatch, tmp_path, settings):
    for name, text in settings.items():
        (tmp_path / name).write_text(text)
    monkeypatch.setattr(huge_pages, "SETTINGS", tmp_path)
    for function in (huge_pages.page_size, huge_pages._advice):
        function.cache_clear()
    try:
        assert huge_pages._advice() is None
        array = wp.zeros(MB, dtype=wp.float64, device="cpu")
        assert huge_pages.in_huge_pages(array) is array
    finally:
        for function in (huge_pages.page_size, huge_pages._advice):
            function.cache_clear()


@pytest.mark.skipif(not huge_pages.page_size(), reason="the system offers no huge pages")
def test_the_system_knows_and_the_array_holds_what_it_held():
    values = np.random.default_rng(0).integers(0, 256, 64 * MB, dtype=np.uint8)
    array = huge_pages.in_huge_pages(wp.array(values, dtype=wp.uint8, device="cpu"))
    assert array.numpy().tobytes() == values.tobytes()
    maps = re.split(r"^(?=[0-9a-f]+-[0-9a-f]+ )", Path("/proc/self/smaps").read_text(), flags=re.MULTILINE)[1:]
    middle = (array.ptr or 0) + 32 * MB
    for text in maps:
        first, last = (int(address, 16) for address in text.split()[0].split("-"))
        if first <= middle < last:
            assert re.search(r"^VmFlags:.* hg\b", text, re.MULTILINE), text
            return
    raise AssertionError("the array is in no range of the memory")
