"""Grains of a frame in the axes that are asked for."""

from __future__ import annotations

from typing import Literal

import numpy as np

from warpdem.core.snapshot import Snapshot

View = Literal["laboratory", "frame"]


def in_view(grains: Snapshot, view: View) -> dict[str, np.ndarray]:
    """Position [m], velocity [m/s], spin [rad/s] and force [N] of the grains, shapes (n, 3).

    Args:
        grains: a frame of a run.
        view: "laboratory", absolute motion in laboratory axes; "frame", motion relative to the frame in its axes.
    """
    if view == "frame":
        return {"position": grains.position, "velocity": grains.velocity, "spin": grains.spin, "force": grains.force}
    pose = grains.frame
    turn = pose.rotation.T
    return {
        "position": pose.to_laboratory(grains.position),
        "velocity": (grains.velocity + pose.velocity_at(grains.position)) @ turn,
        "spin": (grains.spin + pose.spin) @ turn,
        "force": grains.force @ turn,
    }
