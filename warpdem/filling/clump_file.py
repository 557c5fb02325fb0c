"""Clumps one by one: given, or those of a frame in VTK, ``clumps_*.vtp`` of a run."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from warpdem.errors import SceneError
from warpdem.filling.clump_template import ClumpTemplate
from warpdem.filling.vtp_file import read_vtp

ARRAYS = ("type", "radius", "orientation", "v", "omega")
"""Arrays of the file that are read, beside its points."""


@dataclass(frozen=True)
class ClumpRows:
    """Clumps of one kind; vectors in frame axes, motion relative to the frame."""

    position: np.ndarray
    """Centres of mass [m], shape (c, 3)."""
    velocity: np.ndarray
    """Of the centres [m/s], shape (c, 3)."""
    spin: np.ndarray
    """Angular velocities [rad/s], shape (c, 3)."""
    orientation: np.ndarray | None
    """Quaternions (w, x, y, z) from the axes of the clump to the frame axes, shape (c, 4); None: all are (1, 0, 0, 0)."""
    size: np.ndarray | None
    """Factors on the lengths [-], shape (c,); None: 1."""


def read_clump_file(path: Path, template: ClumpTemplate, number: int, key: str) -> ClumpRows:
    """The clumps of one kind in a file.

    Args:
        path: The file.
        template: The clump.
        number: Its number in the scene, which is its ``type`` in the file.
        key: Scene key, for messages.

    Raises:
        SceneError: The file is missing, is none of clumps, holds none of this kind, or numbers that are not finite.
    """
    there, arrays = read_vtp(path, ARRAYS, key)
    if missing := [name for name in ARRAYS if name not in arrays]:
        raise SceneError(
            f"{key}: {path.name}: has no point array {missing[0]}; it has {there}: take clumps_*.vtp of a run with clumps"
        )
    mine = arrays["type"] == number
    if not mine.any():
        kinds = ", ".join(str(kind) for kind in np.unique(arrays["type"])) or "none"
        raise SceneError(
            f"{key}: {path.name}: holds no clump of the type {number}, which {template.name!r} is in the scene; it holds "
            f"those of {kinds}"
        )
    found = {name: np.asarray(values[mine], float) for name, values in (("points", arrays["points"]), *arrays.items())}
    for name in ("points", "radius", "orientation", "v", "omega"):
        if not np.isfinite(found[name]).all():
            raise SceneError(f"{key}: {path.name}: {name} holds a number that is not finite")
    if not (found["radius"] > 0.0).all() or not np.square(found["orientation"]).sum(axis=1).all():
        raise SceneError(f"{key}: {path.name}: a radius that is not above 0, or an orientation of zeros")
    size = found["radius"] / template.equal_radius
    return ClumpRows(found["points"], found["v"], found["omega"], found["orientation"], size)
