"""The thread pool: every index once, all jobs at once, errors come through."""

import os
import signal
import threading
import time

import numpy as np
import pytest
import warp as wp
from warpdem.kernels.step import barrier

from warpdem.core.threads import (
    GRAINS_PER_THREAD,
    Threads,
    available_threads,
    ranges,
    request_short_time_slices,
    threads_for,
)


@pytest.mark.parametrize(("count", "parts"), [(0, 1), (0, 4), (3, 5), (10, 3), (1000, 7), (7, 1)])
def test_ranges_are_consecutive_and_even(count, parts):
    found = ranges(count, parts)
    assert len(found) == parts
    assert [i for first, last in found for i in range(first, last)] == list(range(count))
    sizes = [last - first for first, last in found]
    assert max(sizes) - min(sizes) <= 1


def test_available_threads_is_a_count():
    assert available_threads() >= 1


def test_threads_are_as_many_as_pay(monkeypatch):
    monkeypatch.setattr("warpdem.core.threads.available_cores", lambda: 16)
    least = GRAINS_PER_THREAD
    assert [threads_for(n) for n in (0, 2, 2 * least - 1, 2 * least, 5 * least, 10**6)] == [1, 1, 1, 2, 5, 16]
    assert [Threads(4, as_pays=True).at_work(n) for n in (0, 2, 2 * least, 10**6)] == [1, 1, 2, 4]
    assert Threads(4).at_work(2) == 4, "what was asked for is used"


def test_a_thread_that_asks_for_short_slices_keeps_its_policy():
    found = []

    def asks():
        request_short_time_slices()
        found.append((os.sched_getscheduler(0), os.getpriority(os.PRIO_PROCESS, 0)))

    before = os.sched_getscheduler(0), os.getpriority(os.PRIO_PROCESS, 0)
    other = threading.Thread(target=asks)
    other.start()
    other.join()
    assert found == [before]


@wp.kernel(enable_backward=False, module="unique")
def meetings(
    thread: int, threads: int, rounds: int, work: int, modes: wp.array(dtype=wp.uint64),
    counter: wp.array(dtype=wp.int32),
    turn: wp.array2d(dtype=wp.int32), wrong: wp.array(dtype=wp.int32),
):  # fmt: skip
    """Each thread writes the round to its place, and after the meeting looks at the others'; ``work`` makes some late."""
    target = int(0)
    for r in range(rounds):
        x = wp.float32(0.0)
        if (r + thread) % threads == 0:
            for k in range(work):
                x = wp.sin(x + wp.float32(k))
        turn[thread, 0] = r + 1 + wp.int32(x * wp.float32(0.0))
        target += threads
        barrier.arrive_and_wait(counter, target, modes)
        for t in range(threads):
            if turn[t, 0] != r + 1:
                wrong[thread] = wrong[thread] + 1
        target += threads
        barrier.arrive_and_wait(counter, target, modes)


@pytest.mark.parametrize("modes", ["all", "yields only", "spins only"])
@pytest.mark.parametrize(("threads", "work"), [(2, 0), (2, 300_000), (5, 3000)])
def test_threads_meet_however_they_wait(threads, work, modes):
    """Also more of them than cores, and so late that the others sleep."""
    known = barrier.wait_modes()
    if modes != "all":
        known[0 if modes == "spins only" else 1 :] = 0
    if modes == "spins only" and threads > (os.cpu_count() or 1):
        pytest.skip("threads that spin on too few cores take for ever")
    rounds = 40 if work else 3000
    pool = Threads(threads)
    counter, wrong = (wp.zeros(n, dtype=wp.int32, device="cpu") for n in (barrier.LENGTH, threads))
    turn = wp.zeros((threads, 16), dtype=wp.int32, device="cpu")
    way = wp.array(known, dtype=wp.uint64, device="cpu")
    wp.load_module(meetings.module, device="cpu")

    def job(thread: int):
        inputs = [thread, threads, rounds, work, way, counter, turn, wrong]
        return lambda: wp.launch(meetings, dim=1, inputs=inputs, device="cpu")

    pool.together([job(t) for t in range(threads)])
    pool.close()
    assert wrong.numpy().tolist() == [0] * threads
    assert turn.numpy()[:, 0].tolist() == [rounds] * threads
    assert counter.numpy()[0] == 2 * rounds * threads
    assert counter.numpy()[barrier.SLEEPERS] == 0


@pytest.mark.skipif(not barrier.wait_modes()[2], reason="threads cannot sleep on this system")
def test_a_thread_that_waits_long_sleeps():
    """It takes no processor time while the other one works."""
    counter = wp.zeros(barrier.LENGTH, dtype=wp.int32, device="cpu")
    turn, wrong = wp.zeros((2, 16), dtype=wp.int32, device="cpu"), wp.zeros(2, dtype=wp.int32, device="cpu")
    way = wp.array(barrier.wait_modes(), dtype=wp.uint64, device="cpu")
    wp.load_module(meetings.module, device="cpu")
    used, pool = [], Threads(2)

    def waits():
        begin = time.thread_time()
        wp.launch(meetings, dim=1, inputs=[0, 2, 1, 0, way, counter, turn, wrong], device="cpu")
        used.append(time.thread_time() - begin)

    def comes_late():
        time.sleep(0.5)
        wp.launch(meetings, dim=1, inputs=[1, 2, 1, 0, way, counter, turn, wrong], device="cpu")

    pool.together([waits, comes_late])
    pool.close()
    assert used[0] < 0.1


def test_jobs_run_at_the_same_time():
    """A barrier opens only when all jobs are inside at once."""
    pool = Threads(4)
    barrier = threading.Barrier(4, timeout=10.0)
    names = []

    def job():
        barrier.wait()
        names.append(threading.current_thread().name)

    pool.together([job] * 4)
    pool.close()
    assert len(set(names)) == 4


def test_an_error_in_any_job_comes_through():
    pool = Threads(2)

    def fail():
        raise ValueError("from a thread")

    with pytest.raises(ValueError, match="from a thread"):
        pool.together([lambda: None, fail])
    pool.close()


def test_an_interrupt_leaves_no_job_waiting_for_another():
    pool = Threads(2)
    barrier, done = threading.Barrier(2, timeout=10.0), []

    def interrupted():
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(0.1)
        meeting()

    def meeting():
        barrier.wait()
        done.append(1)

    with pytest.raises(KeyboardInterrupt):
        pool.together([interrupted, meeting])
    pool.close()
    assert done == [1, 1]


@wp.kernel(enable_backward=False, module="unique")
def mark(first: int, count_out: wp.array(dtype=wp.int32)):
    i = first + wp.tid()
    count_out[i] = count_out[i] + 1


@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize("count", [0, 1, 511, 512, 5000])
def test_split_covers_every_index_once(threads, count):
    pool = Threads(threads)
    marks = wp.zeros(count + 1, dtype=wp.int32, device="cpu")
    pool.split(mark, count, [marks], wp.get_device("cpu"))
    pool.close()
    np.testing.assert_array_equal(marks.numpy(), [1] * count + [0])
