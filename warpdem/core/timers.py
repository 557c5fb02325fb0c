"""Wall time of a run by stage: set-up, steps, lists, output."""

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

STEPPING = ("steps", "lists", "refresh", "schedule")
"""Stages that the steps of a run are made of, without set-up and results."""


def stepping(seconds: Mapping[str, float]) -> float:
    """Wall time of the steps [s], of that of each stage."""
    return sum(seconds.get(stage, 0.0) for stage in STEPPING)


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
