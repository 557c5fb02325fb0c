"""Ranks whose steps are launches between which the host exchanges ghosts, as on GPUs, replayed on CPUs.

The bits of a whole run so are in ``test_bits``.
"""

from types import SimpleNamespace

import numpy as np
import pytest
import warp as wp
from warpdem.kernels.step import clock as clock_slots
from warpdem.kernels.step.exchange import TOO_DEEP
from warpdem.kernels.step.motion import BEYOND, LEFT
from warpdem.kernels.step.structs import Control, Report

from rank_scenes import few
from warpdem.errors import SceneError
from warpdem.model.digests import Given
from warpdem.model.prepare import prepare
from warpdem.ranks import devices
from warpdem.ranks.staging import HostMemory, Mirror


def test_rows_go_to_the_host_and_back():
    """Those sent as they are at present, in their order, column of a table or records; the rows beside stay."""
    rng, memory = np.random.default_rng(1), HostMemory()
    table = rng.normal(size=(9, 5))
    records: wp.array = wp.array(table, dtype=wp.types.vector(5, wp.float64), device="cpu")
    column: wp.array = wp.array(np.zeros((9, 3)), dtype=wp.float64, device="cpu")[:, 1]
    for array, new in ((records, table + 1.0), (column, rng.normal(size=9))):
        mirror = Mirror(array, np.array([4, 0]), np.array([8, 2, 7]), memory, "rows")
        sent: list[tuple[np.ndarray, int, int]] = []
        received: list[tuple[np.ndarray, int, int]] = []
        links = SimpleNamespace(send=lambda *one, to=sent: to.append(one), receive=lambda *one, to=received: to.append(one))
        mirror.link(links, 7, {1: 1, 2: 1}, {2: 2, 5: 1})
        array.assign(new)
        mirror.fetch()
        assert [(rank, tag) for _, rank, tag in sent] == [(1, 7), (2, 7)]
        np.testing.assert_array_equal(np.concatenate([values for values, _, _ in sent]), new[[4, 0]])
        came = rng.normal(size=new[:3].shape)
        for (values, rank, _), rows, number in zip(received, (came[:2], came[2:]), (2, 5), strict=True):
            assert rank == number
            values[:] = rows
        mirror.give()
        there = array.numpy()
        np.testing.assert_array_equal(there[[8, 2, 7]], came)
        np.testing.assert_array_equal(np.delete(there, [8, 2, 7], axis=0), np.delete(new, [8, 2, 7], axis=0))


def test_memory_of_the_host_is_kept():
    memory, like = HostMemory(), wp.zeros(1, dtype=wp.vec3d, device="cpu")
    first = memory.rows("a", 100, like)
    assert memory.rows("a", 110, like).ptr == first.ptr == memory.rows("a", 3, like).ptr
    assert memory.rows("b", 3, like).ptr != first.ptr
    assert memory.rows("a", 1000, like).shape == (1000,)


@pytest.mark.parametrize(
    ("moved_at", "beyond", "overlap", "wanted"),
    [(0, 0, 0.1, 0), (1, 1, 0.1, BEYOND), (1, 0, 0.1, LEFT), (0, 0, 0.3, TOO_DEEP), (1, 1, 0.3, BEYOND | TOO_DEEP)],
)
def test_what_was_found_in_a_step_is_said(moved_at, beyond, overlap, wanted):
    model, _ = prepare(Given.of(few()), wp.get_device("cpu"), resident=True, ranks=True)
    control, report = Control(), Report()
    control.max_overlap = wp.array([0.2], dtype=wp.float64, device="cpu")
    report.extreme = wp.array([overlap, 0.0, 0.0, 0.0], dtype=wp.float64, device="cpu")
    report.moved = wp.full(4, -1, dtype=wp.int32, device="cpu")
    clock = np.zeros(clock_slots.SLOTS, dtype=np.int32)
    clock[[clock_slots.MOVED_AT, clock_slots.BEYOND_LISTS, clock_slots.STEPS_LEFT]] = moved_at, beyond, 1
    inputs = [0, control, report, wp.array(clock, dtype=wp.int32, device="cpu")]
    wp.launch(model.kernels.graph.found, dim=1, inputs=inputs, device="cpu")
    assert report.moved.numpy().tolist() == [wanted, *(int(wanted & bit > 0) for bit in (BEYOND, LEFT, TOO_DEEP))]


def test_each_rank_of_a_machine_has_a_gpu_of_its_own(monkeypatch):
    assert [devices.device_name(asked, 3) for asked in (None, "cpu", "cuda:1")] == ["cpu", "cpu", "cuda:1"]
    monkeypatch.setattr(devices.wp, "get_cuda_device_count", lambda: 0)
    with pytest.raises(SceneError, match="no GPU on this machine"):
        devices.device_name("cuda", 0)
    monkeypatch.setattr(devices.wp, "get_cuda_device_count", lambda: 2)
    assert [devices.device_name("cuda", rank) for rank in range(3)] == ["cuda:0", "cuda:1", "cuda:0"]
