"""The limits of the time step, and the step as a fraction of each."""

import math
from typing import Any

from warpdem.model.time_step import FIELD_ANGLE, FRAME_ANGLE, STABLE_SHARE
from warpdem.simulation import Simulation


def limit_rows(sim: Simulation) -> list[dict[str, Any]]:
    """Each limit of the time step: ``seconds`` [s], the step as a ``share`` of it [-], and the share that "auto" keeps below.

    Where ``refused``, a longer step is an error. ``seconds`` and ``share`` are None where nothing limits.
    """
    found, speed = sim.limits, sim.limits.max_speed
    travel = 0.5 * sim.lists.skin / speed if speed > 0 and len(sim.state) else math.inf
    rows = [
        ("rayleigh", "Rayleigh time", found.rayleigh, None),
        ("contact", "contact time of an undamped impact", found.contact_time, 1.0 / found.contact_steps),
        ("bed", "stability limit of the bed at rest", found.settled, 1.0),
        ("impact", "stability limit of one impact", found.stable, STABLE_SHARE),
        ("frame", "one radian of the frame's turn", found.frame / FRAME_ANGLE, FRAME_ANGLE),
        ("fields", "one radian of the external fields", found.field / FIELD_ANGLE, FIELD_ANGLE),
        ("travel", "limit of travel beside meshes", found.travel, 0.5),
        ("skin", "half the skin of the lists crossed", travel, None),
    ]
    if math.isfinite(found.thin_gap):
        rows.append(("liquid", "dashpot of the thinnest liquid gap", found.thin_gap, 1.0))
    return [
        {
            "key": key,
            "name": name,
            "seconds": value if math.isfinite(value) else None,
            "share": sim.dt / value if math.isfinite(value) else None,
            "auto_share": share,
            "refused": key in ("impact", "travel"),
        }
        for key, name, value, share in rows
    ]
