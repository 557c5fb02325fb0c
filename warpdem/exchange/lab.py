"""Grains of a frame in the axes that are asked for."""

from __future__ import annotations

from typing import Literal

from warpdem.core.snapshot import Snapshot, in_laboratory

View = Literal["laboratory", "frame"]


def in_view(grains: Snapshot, view: View) -> Snapshot:
    """The same grains in the axes of a view.

    Args:
        grains: a frame of a run.
        view: "laboratory", absolute motion in laboratory axes; "frame", motion relative to the frame in its axes.
    """
    return grains if view == "frame" else in_laboratory(grains)
