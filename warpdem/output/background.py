"""Work that is done in a thread of its own while the run goes on, one piece at a time."""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor


class Background:
    """A thread that does one piece of work while the caller goes on; the next call raises the errors of that work."""

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="warpdem-output")
        self._work: Future[None] | None = None

    def start(self, work: Callable[[], None]) -> None:
        """Do ``work`` as soon as what was started before is done, which is waited for.

        Raises:
            Exception: what went wrong in the work before; ``work`` is not done then.
        """
        self.settle()
        self._work = self._thread.submit(work)

    def settle(self) -> None:
        """Wait until the work is done.

        Raises:
            Exception: what went wrong in it.
        """
        work, self._work = self._work, None
        if work is not None:
            work.result()

    def close(self) -> None:
        """Wait until the work is done, and end the thread.

        Raises:
            Exception: what went wrong in the work.
        """
        try:
            self.settle()
        finally:
            self._thread.shutdown()
