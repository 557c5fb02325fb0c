"""What stops a run within the engine: states that no list and no step can go on from."""

import numpy as np
import warp as wp

from warpdem.engine.buffers import LONGEST
from warpdem.errors import StabilityError
from warpdem.kernels import grain
from warpdem.state.clock import Clock
from warpdem.state.particles import State


def _now(clock: Clock) -> str:
    return f"stopped at t = {clock.time:.6g} s (step {clock.step_number})"


def _place(state: State, slot: int) -> str:
    return ", ".join(f"{x:.4g}" for x in state.record.numpy()[slot, grain.POSITION])


def not_finite(state: State, clock: Clock, fastest: float) -> StabilityError:
    """The state of a grain is no number; ``fastest``: largest approach speed so far [m/s]."""
    bad = ~np.isfinite(state.record.numpy()[state.rank]).all(axis=1)
    ids = state.ids[bad]
    return StabilityError(
        f"{_now(clock)}: the state of grain {ids[0]} is not finite ({len(ids)} of {len(bad)} grains). Largest approach speed "
        f"met before: {fastest:.3g} m/s; time step {clock.dt:.3g} s. Take a smaller time.step."
    )


def too_long_a_list(state: State, clock: Clock, entries: int, count: wp.array) -> StabilityError:
    """A list would have more entries than 32-bit numbers count, which only grains within each other bring about.

    Args:
        state: the grains.
        clock: where the run is in time.
        entries: length of the list.
        count: neighbors or wall features of each grain, shape (n,).
    """
    most = int(np.argmax(count.numpy()))
    return StabilityError(
        f"{_now(clock)}: the lists need {entries} entries, more than {LONGEST}: grain {state.id.numpy()[most]} at "
        f"({_place(state, most)}) m has {int(count.numpy()[most])} neighbours. Take a smaller time.step, or fewer grains."
    )


def crossed_domain(state: State, clock: Clock, slot: int) -> StabilityError:
    """A grain went further in a step than a periodic domain is long."""
    speed = float(np.linalg.norm(state.record.numpy()[slot, grain.VELOCITY]))
    return StabilityError(
        f"{_now(clock)}: grain {state.id.numpy()[slot]} crossed the whole periodic domain in one step of {clock.dt:.3g} s, at "
        f"{speed:.3g} m/s. Take a smaller time.step."
    )


def beyond_border(state: State, clock: Clock, slot: int, name: str) -> StabilityError:
    """A grain is beyond a border that stops the run."""
    return StabilityError(
        f"{_now(clock)}: grain {state.id.numpy()[slot]} at ({_place(state, slot)}) m is beyond the border {name}, which the "
        f"scene says stops the run"
    )
