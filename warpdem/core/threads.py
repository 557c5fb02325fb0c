"""A small pool that splits CPU launches over threads (Warp itself runs a CPU launch on one thread)."""

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
"""Minimum grains per thread: with fewer the threads wait for each other longer than they work."""
SLICE = 100_000  # [ns], the minimum that Linux grants
SCHED_SETATTR = {"x86_64": 314, "aarch64": 274}  # number of the system call


def available_threads() -> int:
    """Cores that this process may use; see ``warpdem.core.cpu_cores``."""
    return available_cores()


def threads_for(grains: int) -> int:
    """Number of threads that is efficient for so many grains, up to the cores that this process may use."""
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


def request_short_time_slices() -> None:
    """Let this thread run soon after it is woken, where other processes compete for its core.

    Its total share of processor time does not change; its time slices get shorter and begin sooner. Otherwise Linux (6.12 or
    later) lets it wait for the end of another program's slice, a millisecond or more, at each barrier. Other systems ignore
    the request.
    """
    number = SCHED_SETATTR.get(platform.machine())
    with suppress(OSError, AttributeError):
        if number is None or platform.system() != "Linux" or os.sched_getscheduler(0) != os.SCHED_OTHER:
            return
        nice = os.getpriority(os.PRIO_PROCESS, 0)
        wanted = struct.pack("=IIQiIQQQ", 48, os.SCHED_OTHER, 0, nice, 0, SLICE, 0, 0)  # struct sched_attr
        ctypes.CDLL(None).syscall(number, 0, wanted, 0)


def ranges(count: int, parts: int) -> list[tuple[int, int]]:
    """Split ``count`` indices into ``parts`` consecutive ranges of nearly equal length."""
    return [(count * p // parts, count * (p + 1) // parts) for p in range(parts)]


class Threads:
    """Runs launches concurrently; ctypes releases the interpreter's lock during each.

    Args:
        count: Number of threads.
        as_pays: Use for a batch of steps only as many threads as are efficient for its grains.
    """

    def __init__(self, count: int, as_pays: bool = False) -> None:
        self.count = count
        self.as_pays = as_pays
        self._loaded: set[tuple[wp.Kernel, str]] = set()
        self._pool = (
            ThreadPoolExecutor(count, thread_name_prefix="warpdem", initializer=request_short_time_slices)
            if count > 1
            else None
        )

    def at_work(self, grains: int) -> int:
        """Number of threads for a batch of steps of so many grains."""
        return max(1, min(self.count, grains // GRAINS_PER_THREAD)) if self.as_pays else self.count

    def together(self, jobs: Sequence[Callable[[], None]]) -> None:
        """Run all jobs at the same time, since they may wait for each other at barriers.

        Ctrl-C interrupts only the calling thread. The jobs are therefore started by a thread of the pool: otherwise some jobs
        could wait for ever for others that were never started. The interrupt is raised when all are done.
        """
        if len(jobs) == 1:
            jobs[0]()
            return
        pool = self._pool
        if pool is None:
            raise ValueError(f"{len(jobs)} jobs need a pool of as many threads, this one has {self.count}")
        done = pool.submit(self._start, pool, jobs)
        try:
            done.result()
        except KeyboardInterrupt:
            wait([done])
            raise

    @staticmethod
    def _start(pool: ThreadPoolExecutor, jobs: Sequence[Callable[[], None]]) -> None:
        """Run the first job on this thread of the pool and the others on its other threads."""
        others = [pool.submit(job) for job in jobs[1:]]
        jobs[0]()
        for job in others:
            job.result()

    def load(self, kernel: wp.Kernel, device: wp.Device) -> None:
        """Load the module of a kernel, once: loading is not safe from several threads, and asking costs as much as a launch."""
        if (kernel, device.alias) not in self._loaded:
            wp.load_module(kernel.module, device=device)
            self._loaded.add((kernel, device.alias))

    def split(self, kernel: wp.Kernel, count: int, inputs: Sequence[object], device: wp.Device) -> None:
        """Launch ``kernel`` over ``count`` indices, in one range per thread; its first argument is the first index."""
        if count == 0:
            return
        self.load(kernel, device)
        parts = [r for r in ranges(count, self.count if device.is_cpu and count >= 512 else 1) if r[1] > r[0]]

        def job(first: int, last: int) -> Callable[[], None]:
            return lambda: wp.launch(kernel, dim=last - first, inputs=[first, *inputs], device=device)

        self.together([job(*part) for part in parts])

    def close(self) -> None:
        """Stop the threads of the pool."""
        if self._pool:
            self._pool.shutdown()
