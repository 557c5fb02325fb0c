"""Points and point arrays of a .vtp file, read in a process of its own."""

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from warpdem.core import memory, reader_process
from warpdem.errors import SceneError
from warpdem.filling import vtp_reader

TIME_LIMIT, BYTES_PER_SECOND = 60.0, 1e6
"""Time that reading a file may take [s], with another second for each so many bytes."""


def read_vtp(path: Path, names: Sequence[str], key: str) -> tuple[str, dict[str, np.ndarray]]:
    """Names of the arrays that a file has, as text, and those of ``names`` that it has, with its points as ``points`` [m].

    Raises:
        SceneError: The file is missing, cannot be read, or is larger than the memory.
    """
    if not path.is_file():
        raise SceneError(f"{key}: no such state file: {path}")
    size = path.stat().st_size
    memory.require(size, key, f"a file of {size} bytes", "take fewer grains")
    limit = TIME_LIMIT + size / BYTES_PER_SECOND
    said, arrays = reader_process.run_reader(vtp_reader.__file__, [str(path), *names], limit, key, "VTK")
    return listed(said["there"]), arrays


def listed(names: Iterable[str]) -> str:
    """The first of some names, as they may be shown."""
    shown = [ascii(name)[1:-1][:60] for name in names]
    return ", ".join(shown[:12]) + (f" and {len(shown) - 12} more" if len(shown) > 12 else "") or "none"
