"""Reads USD files as plain arrays: runs `warpdem.usd.reader` in a process of its own and checks its answer."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from warpdem.core import memory, reader_process
from warpdem.core.process_limits import BYTES_PER_SECOND
from warpdem.errors import SceneError

USD_SUFFIXES = (".usd", ".usda", ".usdc", ".usdz")
PROGRAM = Path(__file__).with_name("reader") / "__main__.py"
"""The program that opens USD files."""
TIME_LIMIT = 300.0
"""Wall time that reading a file may take [s], with ten seconds for each `BYTES_PER_SECOND`. The reader itself limits its
processor time, which does not depend on the load of the machine."""
TO_Z_UP = {"Y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]), "Z": np.eye(3)}
"""Rotation from a stage's axes to the scene's, z upwards, by its upAxis: for Y by 90 degrees about x; exact."""


def read(
    file: Path, what: str, target: str, where: str, folders: Sequence[Path] | None = None
) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Content of a USD file.

    Args:
        file: USD file.
        what: "geometry" or "motion" of a prim, or "scene".
        target: Path of the prim, "" for the whole stage; for a scene the time of the frame [s], "" for the last frame.
        where: Source and key of the scene, for messages.
        folders: Folders that must hold all files it refers to; None for no restriction.

    Returns:
        Numbers and texts as `warpdem.usd.reader` gives them (with ``metres`` per unit, ``up`` axis, time codes per second
        ``rate`` and the units that the file leaves ``unsaid``), and arrays by name.

    Raises:
        SceneError: There is no such file, or it cannot be read: damaged, refused, too slow, or too large for the memory.
    """
    if not file.is_file():
        raise SceneError(f"{where}: no such USD file: {file}")
    head = where if where == str(file) else f"{where}: {file.name}"
    limit = TIME_LIMIT + 10.0 * file.stat().st_size / BYTES_PER_SECOND
    memory.require(file.stat().st_size, head, f"a file of {file.stat().st_size} bytes", "take a smaller one")
    arguments = [what, str(file), target, *map(str, folders or ())]
    answer, arrays = reader_process.run_reader(str(PROGRAM), arguments, limit, head, "the USD library")
    if answer.get("up", "Z") not in TO_Z_UP:
        raise SceneError(f"{head}: upAxis = {answer['up']!r}, must be Y or Z")
    return answer, arrays
