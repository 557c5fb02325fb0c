"""A small pool that runs one launch per CPU thread (Warp itself runs a CPU launch on one)."""

import ctypes
import os
import platform
import struct
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import suppress

import warp as wp

from warpdem.core.cpu_cores import available_cores
from warpdem.errors import SceneError

MOST_THREADS = 1024
"""Threads of a CPU run [-]: no machine has more cores."""
GRAINS_PER_THREAD = 24
"""Grains from which on one more thread pays: below them threads wait for each other longer than they work."""
SLICE = 100_000  # [ns], the least that Linux grants
SCHED_SETATTR = {"x86_64": 314, "aarch64": 274}  # number of the system call


def available_threads() -> int:
    """Cores that this process may use; see ``warpdem.core.cpu_cores``."""
    return available_cores()


def threads_for(grains: int) -> int:
    """Threads that pay for so many grains, up to the cores that this process may use."""
    return max(1, min(available_threads(), grains // GRAINS_PER_THREAD))


def run_threads(asked: int | None, grains: int, *, grows: bool, cpu: bool) -> "Threads":
    """The threads of a run.

    Args:
        asked: how many the user asked for; None: as many as pay for the number of grains.
        grains: grains at the start.
        grows: more may be inserted later.
        cpu: the run is on a CPU; a GPU takes one thread.

    Raises:
        SceneError: ``asked`` is below 1, or more than any machine has.
    """
    if asked is not None and not 1 <= asked <= MOST_THREADS:
        raise SceneError(f"threads = {asked}: at least 1 is needed, at most {MOST_THREADS} are taken")
    count = asked or (available_threads() if grows else threads_for(grains))
    return Threads(count if cpu else 1, as_pays=asked is None)


def ask_for_short_slices() -> None:
    """Let this thread run soon after it is woken, where other work wants its core too.

    It gets no more time than others by that, only sooner, in shorter slices. Linux (6.12 or later) would else let it wait for
    the end of another program's slice, a millisecond or more, at each meeting of the threads. Systems that do not know this
    leave all as it is.
    """
    number = SCHED_SETATTR.get(platform.machine())
    with suppress(OSError, AttributeError):
        if number is None or platform.system() != "Linux" or os.sched_getscheduler(0) != os.SCHED_OTHER:
            return
        nice = os.getpriority(os.PRIO_PROCESS, 0)
        wanted = struct.pack("=IIQiIQQQ", 48, os.SCHED_OTHER, 0, nice, 0, SLICE, 0, 0)  # struct sched_attr
        ctypes.CDLL(None).syscall(number, 0, wanted, 0)


def ranges(count: int, parts: int) -> list[tuple[int, int]]:
    """``count`` things in ``parts`` consecutive ranges of nearly equal length."""
    return [(count * p // parts, count * (p + 1) // parts) for p in range(parts)]


class Threads:
    """Runs launches side by side; ctypes releases the interpreter's lock during each.

    Args:
        count: threads.
        as_pays: use only as many of them for a batch of steps as pay for its grains.
    """

    def __init__(self, count: int, as_pays: bool = False) -> None:
        self.count = count
        self.as_pays = as_pays
        names = {"thread_name_prefix": "warpdem", "initializer": ask_for_short_slices}
        self._pool = ThreadPoolExecutor(count, **names) if count > 1 else None

    def at_work(self, grains: int) -> int:
        """Threads for a batch of steps of so many grains."""
        return max(1, min(self.count, grains // GRAINS_PER_THREAD)) if self.as_pays else self.count

    def together(self, jobs: Sequence[Callable[[], None]]) -> None:
        """Run all jobs at the same time; all must be running for barriers to open.

        Ctrl-C interrupts the calling thread alone, so it starts none of them: some would wait for ever for those that are not
        started. The interrupt is raised when all are done.
        """
        if len(jobs) == 1:
            jobs[0]()
            return
        done = self._pool.submit(self._start, jobs)
        try:
            done.result()
        except KeyboardInterrupt:
            wait([done])
            raise

    def _start(self, jobs: Sequence[Callable[[], None]]) -> None:
        """Run the first job on this thread of the pool and the others on the rest of it."""
        others = [self._pool.submit(job) for job in jobs[1:]]
        jobs[0]()
        for job in others:
            job.result()

    def split(self, kernel, count: int, inputs: Sequence, device) -> None:
        """Launch ``kernel`` over ``count`` indices, in one range per thread; its first argument is the first index."""
        if count == 0:
            return
        wp.load_module(kernel.module, device=device)  # loading is not safe from several threads
        parts = [r for r in ranges(count, self.count if device.is_cpu and count >= 512 else 1) if r[1] > r[0]]

        def job(first: int, last: int) -> Callable[[], None]:
            return lambda: wp.launch(kernel, dim=last - first, inputs=[first, *inputs], device=device)

        self.together([job(*part) for part in parts])

    def close(self) -> None:
        """End the pool."""
        if self._pool:
            self._pool.shutdown()
