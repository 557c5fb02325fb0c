"""Wall time of a run by stage: set-up, steps, lists, output."""

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

STEPPING = ("steps", "lists", "refresh", "schedule")
"""Stages that the steps of a run are made of, without set-up and results."""

FEW = 100
"""Grains below which the time of a step is not given per grain."""


def stepping(seconds: Mapping[str, float]) -> float:
    """Wall time of the steps [s]: the sum over ``STEPPING`` of the wall time of each stage."""
    return sum(seconds.get(stage, 0.0) for stage in STEPPING)


def speed_text(seconds_per_step: float, grains: int) -> str:
    """Wall time [s] of a step in the unit to compare: per grain, but as it is where a step costs the same for fewer grains."""
    few = grains < FEW
    value = seconds_per_step * 1e6 if few else seconds_per_step / grains * 1e9
    return f"{float(f'{value:.3g}'):g} {'us per step' if few else 'ns per grain and step'}"


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
