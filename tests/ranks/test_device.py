"""Messages of ranks from GPU to GPU: which way they go, what is asked of NCCL, and how steps end within a graph.

No GPU has run this: ``nccl.core`` is a module of the test that notes its calls. The bits of whole runs so are in ``test_bits``,
with MPI in the place of NCCL.
"""

import importlib
import inspect
import re
import sys
from contextlib import contextmanager, nullcontext
from types import SimpleNamespace

import numpy as np
import pytest
import warp as wp
from warpdem.kernels.step import clock as clock_slots
from warpdem.kernels.step.exchange import TOO_DEEP
from warpdem.kernels.step.motion import BEYOND, LEFT
from warpdem.kernels.step.structs import Control, Report

from rank_scenes import few
from warpdem.engine.cpu import CpuExecutor
from warpdem.engine.graph_of_stages import StageExecutor
from warpdem.engine.graph_of_steps import Steps, StepsExecutor
from warpdem.errors import SceneError
from warpdem.model.digests import Given
from warpdem.model.prepare import prepare
from warpdem.ranks import device_messages, follower, ways
from warpdem.ranks.device_exchange import DeviceExchange, Rows
from warpdem.ranks.device_messages import NcclMessages, nccl_messages

CPU = wp.get_device("cpu")


class Ranks:
    """One rank of several whose others are lines of the test: what they give, one call after the other."""

    def __init__(self, size: int, rank: int, *others: object) -> None:
        self.size, self.rank, self.local_rank, self._others = size, rank, rank, list(others)
        self.comm = SimpleNamespace(bcast=lambda value: value if rank == 0 else "id of rank 0")
        self.at_end: list = []

    def everyone(self, mine):
        given = self._others.pop(0)
        return [*given[: self.rank], mine, *given[self.rank :]]

    def raise_first(self, error) -> None:
        assert error is None


class Nccl:
    """In place of ``nccl.core``: notes calls; sums are those of ranks that all have the same."""

    SUM, MAX = "sum", "max"

    def __init__(self, fails: str = "", counted: int | None = None) -> None:
        self.calls: list[tuple] = []
        self._fails, self._counted = fails, counted
        self.Communicator = SimpleNamespace(init=self._init)

    def get_unique_id(self):
        if self._fails == "id":
            raise RuntimeError("no network")
        return "id of rank 0"

    def _init(self, **given):
        self.calls.append(("init", (), given))
        if self._fails == "init":
            raise RuntimeError("unhandled cuda error")
        self._size = self._counted or given["nranks"]
        return self

    @contextmanager
    def group(self):
        self.calls.append(("group", (), {}))
        yield
        self.calls.append(("end", (), {}))

    def send(self, *given, **named):
        self.calls.append(("send", given, named))

    def recv(self, *given, **named):
        self.calls.append(("recv", given, named))

    def allreduce(self, *given, **named):
        self.calls.append(("allreduce", given, named))
        source, target, operation = given
        target.assign(source.numpy() * (self._size if operation == self.SUM else 1))

    def destroy(self):
        self.calls.append(("destroy", (), {}))

    def abort(self):
        self.calls.append(("abort", (), {}))


@pytest.fixture
def nccl(monkeypatch):
    """Installs an ``Nccl`` in place of ``nccl.core``, and lets the CPU pass for a GPU."""

    def installed(there: Nccl | None) -> Nccl | None:
        if there is not None:
            monkeypatch.setitem(sys.modules, "nccl", SimpleNamespace(core=there))
        monkeypatch.setitem(sys.modules, "nccl.core", there)
        return there

    monkeypatch.setattr(CPU, "uuid", "GPU-0")
    monkeypatch.setattr(device_messages.wp, "get_stream", lambda device: f"stream of {device}")
    monkeypatch.setattr(device_messages.wp, "ScopedDevice", lambda device: nullcontext())
    return installed


# -- which way ------------------------------------------------------------------------------------


def test_ranks_with_gpus_of_their_own_take_nccl(nccl):
    there = nccl(Nccl())
    messages, why = nccl_messages(Ranks(3, 1, ["GPU-1", "GPU-2"], ["", ""], ["", ""]), CPU)
    assert isinstance(messages, NcclMessages) and why == ""
    name, _, given = there.calls[0]
    assert name == "init" and given == {"nranks": 3, "rank": 1, "unique_id": "id of rank 0"}


@pytest.mark.parametrize(
    ("there", "others", "why"),
    [
        (Nccl(), (["GPU-1", None],), "rank 2 has no GPU"),
        (Nccl(), (["GPU-1", "GPU-1"],), "ranks 1 and 2 share a GPU"),
        (Nccl(), (["GPU-0", "GPU-1"],), "ranks 0 and 1 share a GPU"),
        (None, (["GPU-1", "GPU-2"], ["", ""]), r"rank 0: nccl4py cannot be used .*pip install 'warpdem\[nccl\]'"),
        (Nccl(), (["GPU-1", "GPU-2"], ["", "none"]), "rank 2: none"),
        (Nccl("id"), (["GPU-1", "GPU-2"], ["", ""]), "rank 0: nccl4py cannot be used .no network"),
        (Nccl("init"), (["GPU-1", "GPU-2"], ["", ""], ["", ""]), "rank 0: NCCL does not start .unhandled cuda error"),
        (Nccl(counted=2), (["GPU-1", "GPU-2"], ["", ""], ["", ""]), "rank 0: NCCL counts 2 of 3 ranks"),
        (Nccl(), (["GPU-1", "GPU-2"], ["", ""], ["broken", ""]), "rank 1: broken"),
    ],
)  # fmt: skip
def test_where_nccl_cannot_be_all_ranks_know_and_why(nccl, there, others, why):
    nccl(there)
    messages, found = nccl_messages(Ranks(3, 0, *others), CPU)
    assert messages is None
    assert re.match(why, found), found
    if there is not None and any(name == "allreduce" for name, _, _ in there.calls):
        assert there.calls[-1][0] == "abort"  # of those that had begun, without the others


def test_a_run_says_which_way_its_messages_go(monkeypatch, caplog):
    """Where ranks step by graphs they ask for messages between devices; those on CPUs ask for nothing."""
    model, _ = prepare(Given.of(few()), CPU, resident=True, ranks=True)
    caplog.set_level("INFO", logger="warpdem")
    way = ways.way_of(Ranks(2, 0, [None]), model)
    assert way.executor is StageExecutor and way.messages is None
    assert way.text == "MPI through memory of the host after each stage (rank 0 has no GPU)"
    messages = SimpleNamespace(name="carrier")
    monkeypatch.setattr(ways, "messages_of", lambda world, device: (messages, ""))
    way = ways.way_of(Ranks(2, 0), model)
    assert way.executor is StepsExecutor and way.messages is messages
    assert way.text == "carrier from device to device, in graphs of 8 steps"
    said = [record.message for record in caplog.records]
    assert "rank 0 has no GPU" in said[-2] and said[-1] == f"ranks exchange by {way.text}"
    alone, _ = prepare(Given.of(few()), CPU, resident=False, ranks=True)
    assert ways.way_of(Ranks(2, 0), alone).executor is CpuExecutor


def test_a_rank_that_failed_before_is_not_asked_for_its_gpu(monkeypatch):
    """Its error is that of all ranks, said to each other once."""
    model, _ = prepare(Given.of(few()), CPU, resident=True, ranks=True)
    world, said = Ranks(2, 1), []

    def raise_first(error) -> None:
        said.append(error)
        world.agreed = SceneError("rank 0 has no GPU")
        raise world.agreed

    world.raise_first = raise_first
    monkeypatch.setattr(ways, "messages_of", lambda world, device: pytest.fail("asked"))
    monkeypatch.setattr(follower, "without_grains", lambda decided, device: model)
    with pytest.raises(SceneError, match="rank 0 has no GPU"):
        follower._new_rank(world, None, 1, "cpu")
    assert said == [None]


# -- what is asked of NCCL ------------------------------------------------------------------------


def exchanged(there: Nccl) -> DeviceExchange:
    """An exchange of rank 1 of 3 that has made the messages of a step once."""
    messages = NcclMessages(there, Ranks(3, 1), CPU, "id")
    moved = wp.zeros(16, dtype=wp.int32, device="cpu")
    record: wp.array = wp.array(np.arange(50.0).reshape(10, 5), dtype=wp.types.vector(5, wp.float64), device="cpu")
    table: wp.array = wp.array(np.arange(18).reshape(6, 3), dtype=wp.float32, device="cpu")
    exchange = DeviceExchange(messages, moved, 2)
    exchange.loads = wp.zeros((1, 4, 3), dtype=wp.int64, device="cpu")
    exchange.connect([record], 7, {0: np.array([5, 2]), 2: np.array([4])}, {0: 1, 2: 2})
    exchange.connect_answers(table[:, 1], {2: (np.array([0, 3]), np.array([5, 1]))})
    there.calls.clear()
    exchange.add_loads()
    exchange.after_stage()
    exchange.agree()
    exchange.repeated(8)
    return exchange


def test_messages_of_a_step(nccl):
    """Bytes beside each other, to and from each rank in the order in which it makes the same calls; sums and flags in place."""
    there = nccl(Nccl())
    exchange = exchanged(there)
    names = [name for name, _, _ in there.calls]
    assert names == ["allreduce", "group", *["send"] * 2, *["recv"] * 2, "send", "recv", "end", "allreduce"]
    assert {named["stream"] for name, _, named in there.calls if name not in ("group", "end")} == {"stream of cpu"}
    sums, flags = there.calls[0][1], there.calls[-1][1]
    assert [x.ptr for x in sums[:2]] == [exchange.loads.ptr] * 2 and sums[0].shape == (12,) and sums[2] == "sum"
    assert flags[0].dtype is wp.int32 and flags[0].shape == (3,) and flags[2] == "max"
    ghosts = [(given[0].numpy(), given[1]) for name, given, _ in there.calls if name in ("send", "recv")]
    record = np.arange(50.0).reshape(10, 5)
    for (values, to), wanted in zip(ghosts[:4], [(record[[5, 2]], 0), (record[[4]], 2), (record[[7]], 0), (record[8:], 2)],
                                    strict=True):  # fmt: skip
        assert to == wanted[1]
        np.testing.assert_array_equal(values.view(np.float64).reshape(-1, 5), wanted[0])
    np.testing.assert_array_equal(ghosts[4][0].view(np.float32), [1, 10])
    assert ghosts[4][1] == ghosts[5][1] == 2 and ghosts[5][0].size == 8
    sent = 3 * 40 + 2 * 4
    assert (exchange.calls, exchange.bytes) == (8, 8 * (2 * sent + 96))


def test_other_memory_asks_for_another_graph(nccl):
    """Slots of answers change with the inner list, whose arrays may be those of before."""
    exchange = exchanged(nccl(Nccl()))
    steps = Steps(SimpleNamespace(device=CPU), None, None, exchange)
    before = steps.key()
    assert steps.key() == before
    exchange.connect_answers(None, {})
    between = steps.key()
    exchange.connect([], 0, {}, {})
    assert len({before, between, steps.key()}) == 3


def test_calls_are_those_that_nccl4py_takes(nccl):
    """Names, arguments and the kind of memory; needs nccl4py, but no GPU."""
    real = pytest.importorskip("nccl.core")
    buffers = importlib.import_module("nccl.core.buffer")
    there = nccl(Nccl())
    exchanged(there)
    assert (int(real.SUM), int(real.MAX)) == (0, 2)
    inspect.signature(real.Communicator.init).bind(nranks=3, rank=1, unique_id=None)
    for name, given, named in there.calls:
        if name in ("group", "end"):
            continue
        inspect.signature(getattr(real.Communicator, name)).bind(None, *given, **named)
        seen = buffers.NcclBuffer(given[0])
        assert (seen.ptr, seen.count) == (given[0].ptr, given[0].size)
        kinds = {wp.uint8: real.UINT8, wp.int32: real.INT32, wp.int64: real.INT64}
        assert seen.dtype == kinds[given[0].dtype]
    for end in (real.Communicator.destroy, real.Communicator.abort):
        inspect.signature(end).bind(None)
    inspect.signature(real.group).bind()


def test_rows_stand_beside_each_other_and_go_back():
    """Records, and the column of a table of short numbers; the rows beside stay."""
    rng = np.random.default_rng(1)
    table: wp.array = wp.array(rng.normal(size=(6, 3)), dtype=wp.float32, device="cpu")
    records: wp.array = wp.array(rng.normal(size=(6, 5)), dtype=wp.types.vector(5, wp.float64), device="cpu")
    for array in (table[:, 1], records):
        before = array.numpy().copy()
        rows = Rows(array, np.array([4, 0, 3]))
        rows.take()
        np.testing.assert_array_equal(rows.values.numpy(), before[[4, 0, 3]])
        rows.values.assign(-rows.values.numpy())
        rows.put()
        np.testing.assert_array_equal(array.numpy()[[4, 0, 3]], -before[[4, 0, 3]])
        np.testing.assert_array_equal(array.numpy()[[1, 2, 5]], before[[1, 2, 5]])


# -- how steps end --------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def kernels():
    return prepare(Given.of(few()), CPU, resident=True, ranks=True)[0].kernels.graph


def clock_of(**slots: int) -> wp.array:
    values = np.zeros(clock_slots.SLOTS, dtype=np.int32)
    for name, value in slots.items():
        values[getattr(clock_slots, name)] = value
    return wp.array(values, dtype=wp.int32, device="cpu")


@pytest.mark.parametrize("found", [0, BEYOND, LEFT, TOO_DEEP, BEYOND | TOO_DEEP, BEYOND | LEFT | TOO_DEEP])
def test_what_any_rank_found_ends_the_steps_of_all(kernels, found):
    """The flags of all ranks are here already; this one has found nothing by itself."""
    report, clock = Report(), clock_of(STEPS_LEFT=4)
    report.moved = wp.array([0, *(int(found & bit > 0) for bit in (BEYOND, LEFT, TOO_DEEP)), 7], dtype=wp.int32, device="cpu")
    wp.launch(kernels.agreed, dim=1, inputs=[2, report, clock], device="cpu")
    assert report.moved.numpy().tolist()[::4] == [found, 7]
    assert clock.numpy()[clock_slots.MOVED_AT] == (3 if found else 0)


@pytest.mark.parametrize("clock", [{"STEPS_LEFT": 4, "MOVED_AT": 2}, {"STEPS_LEFT": 2}, {"STEPS_LEFT": 4, "MOVED_AT": 1}])
def test_a_step_that_was_not_taken_says_nothing(kernels, clock):
    """Step 2 of a graph whose steps have ended before it: what was found there stays, with the step that it names."""
    there, control, report = clock_of(BEYOND_LISTS=1, **clock), Control(), Report()
    control.max_overlap = wp.array([0.2], dtype=wp.float64, device="cpu")
    report.extreme = wp.array([0.3, 0.0, 0.0, 0.0], dtype=wp.float64, device="cpu")
    report.moved = wp.array([LEFT, 0, 1, 0], dtype=wp.int32, device="cpu")
    wp.launch(kernels.found, dim=1, inputs=[2, control, report, there], device="cpu")
    assert report.moved.numpy().tolist() == [LEFT, 0, 1, 0]
    report.moved = wp.array([LEFT, 1, 1, 1], dtype=wp.int32, device="cpu")
    wp.launch(kernels.agreed, dim=1, inputs=[2, report, there], device="cpu")
    assert report.moved.numpy()[0] == LEFT
    assert there.numpy()[clock_slots.MOVED_AT] == clock.get("MOVED_AT", 0)
