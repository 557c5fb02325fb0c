"""A small pool that runs one launch per CPU thread (Warp itself runs a CPU launch on one)."""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait

import warp as wp


def available_threads() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def ranges(count: int, parts: int) -> list[tuple[int, int]]:
    """``count`` things in ``parts`` consecutive ranges of nearly equal length."""
    return [(count * p // parts, count * (p + 1) // parts) for p in range(parts)]


class Threads:
    """Runs launches side by side; ctypes releases the interpreter's lock during each."""

    def __init__(self, count: int) -> None:
        self.count = count
        self._pool = ThreadPoolExecutor(count, thread_name_prefix="warpdem") if count > 1 else None

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
