"""Frames in pieces: each rank writes its own grains, and an error of one is that of all."""

from collections.abc import Callable
from typing import Any

from warpdem.errors import WarpdemError
from warpdem.ranks.world import World


def on_each(world: World, work: Callable[[], Any]) -> list[Any]:
    """Let each rank do something by itself; returns what each gives, on rank 0.

    Raises:
        WarpdemError: on all ranks, that of the lowest one on which it was raised.
    """
    error, found = None, None
    try:
        found = work()
    except WarpdemError as raised:
        error = raised
    world.raise_first(error)
    return world.gathered(found)
