"""What a guard finds, and how it names time and grain."""

from typing import NamedTuple

from warpdem.kernels import grain
from warpdem.state.clock import Clock
from warpdem.state.particles import State


class Verdict(NamedTuple):
    """One way in which the result of a run becomes worthless."""

    guard: str
    """Name of the guard."""
    message: str
    """Time, grain and place, and what to change."""


def at_time(clock: Clock) -> str:
    """The present time as text."""
    return f"at t = {clock.time:.6g} s (step {clock.step_number})"


def grain_at(state: State, row: int) -> str:
    """Grain number ``row`` in order of id with its position, as text."""
    where = ", ".join(f"{x:.4g}" for x in state.by_id(grain.POSITION)[row])
    return f"grain {int(state.ids[row])} at ({where}) m"
