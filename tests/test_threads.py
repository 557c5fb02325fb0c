"""The thread pool: every index once, all jobs at once, errors come through."""

import os
import signal
import threading
import time

import numpy as np
import pytest
import warp as wp

from warpdem.threads import Threads, available_threads, ranges


@pytest.mark.parametrize(("count", "parts"), [(0, 1), (0, 4), (3, 5), (10, 3), (1000, 7), (7, 1)])
def test_ranges_are_consecutive_and_even(count, parts):
    found = ranges(count, parts)
    assert len(found) == parts
    assert [i for first, last in found for i in range(first, last)] == list(range(count))
    sizes = [last - first for first, last in found]
    assert max(sizes) - min(sizes) <= 1


def test_available_threads_is_a_count():
    assert available_threads() >= 1


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
