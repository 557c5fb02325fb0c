"""Fillings of copies of a bed that is there already: grains of a checkpoint or state file, side by side along the axes.

Nothing is packed: a bed of any size is made in the time that its positions take to be written down. Grains start at rest
relative to the frame; springs of contacts are not taken over.
"""

import json
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from warpdem.core import memory
from warpdem.errors import SceneError
from warpdem.filling.grain_file import read_grain_file
from warpdem.kernels import grain
from warpdem.scene.grains import CHECKPOINT_SUFFIXES, Fill

BYTES = 200
"""Memory that a grain of the start takes while it is set up, beside that of the run [B]: see ``InitialGrains``."""


def tiled(fill: Fill, path: Path, key: str) -> tuple[np.ndarray, np.ndarray]:
    """Positions [m], shape (n, 3), and radii [m], shape (n,), of all copies, one copy after the other.

    Args:
        fill: what the scene says of the filling.
        path: the file of the tile.
        key: Scene key, for messages.

    Raises:
        SceneError: the file is missing, damaged, or holds clumps; there is no memory for so many copies.
    """
    position, radius, period = _read(path, f"{key}.tile")
    size = (position + radius[:, None]).max(axis=0) - (position - radius[:, None]).min(axis=0)
    spacing = np.where(period > 0.0, period, size) if fill.spacing is None else np.array(fill.spacing)
    count = int(np.prod(fill.copies)) * len(radius)
    memory.require(count * BYTES, f"{key}.copies", f"{count} grains", "take fewer copies")
    steps = np.stack(np.meshgrid(*[np.arange(n) for n in fill.copies], indexing="ij"), axis=-1).reshape(-1, 3)
    moved = (position + (steps * spacing)[:, None]).reshape(-1, 3)
    return moved, np.tile(radius, len(steps))


def _read(path: Path, key: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions and radii of a tile [m], and the period of its own borders along each axis [m], 0 where it has none."""
    if path.suffix.lower() in CHECKPOINT_SUFFIXES:
        return _read_checkpoint(path, key)
    fields = read_grain_file(path, key)
    assert fields["position"] is not None and fields["radius"] is not None
    return fields["position"], fields["radius"], np.zeros(3)


def _read_checkpoint(path: Path, key: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    if not path.is_file():
        raise SceneError(f"{key}: no such checkpoint: {path}")
    try:
        with h5py.File(path, "r") as file:
            if not str(file.attrs.get("format")).startswith("warpdem checkpoint"):
                raise SceneError(f"{key}: {path}: an HDF5 file, but not a checkpoint")
            record, scene = file["record"], json.loads(file.attrs["scene"])
            if record.is_virtual or record.external or record.nbytes > path.stat().st_size:
                raise SceneError(f"{key}: {path}: damaged: it claims more than it holds")
            if "clump_of_grain" in file and (file["clump_of_grain"][()] >= 0).any():
                raise SceneError(f"{key}: {path}: holds clumps, which cannot be copied; take start.checkpoint for all of them")
            position, radius = record[:, grain.POSITION], record[:, grain.RADIUS]
    except (OSError, KeyError, RuntimeError, ValueError, TypeError, AttributeError) as error:
        raise SceneError(f"{key}: {path}: damaged or not a checkpoint ({error})") from error
    if not len(radius):
        raise SceneError(f"{key}: {path}: holds no grains")
    if not (np.isfinite(position).all() and np.isfinite(radius).all() and (radius > 0.0).all()):
        raise SceneError(f"{key}: {path}: damaged: a position or radius is no number that a grain can have")
    borders = scene.get("borders") or {}
    period = [_period(borders.get(axis)) for axis in "xyz"]
    return position, radius, np.array(period)


def _period(border: dict[str, Any] | None) -> float:
    """Length between the borders across an axis [m] if they are periodic, else 0."""
    if not border or border.get("kind") != "periodic":
        return 0.0
    return float(border["max"]) - float(border["min"])
