"""Wall time of a run by stage: set-up, steps, lists, output."""

import time
from collections.abc import Iterator
from contextlib import contextmanager


class Timers:
    """Adds up the wall time that each stage takes.

    Attributes:
        seconds: wall time so far by stage [s].
    """

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def measure(self, stage: str) -> Iterator[None]:
        """Add the time spent inside to ``seconds[stage]``."""
        begin = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[stage] = self.seconds.get(stage, 0.0) + time.perf_counter() - begin
