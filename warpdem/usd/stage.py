"""What a USD file holds, as arrays: asks `warpdem.usd.reader` in a process of its own and checks that it answers."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from warpdem.core import memory, reader_process
from warpdem.core.process_limits import BYTES_PER_SECOND
from warpdem.errors import SceneError

USD_SUFFIXES = (".usd", ".usda", ".usdc", ".usdz")
PROGRAM = Path(__file__).with_name("reader") / "__main__.py"
"""The program that opens USD files."""
TIME_LIMIT = 300.0
"""Time that reading a file may take on the clock [s], with ten seconds for each second of `reader.BYTES_PER_SECOND`: the reader
limits its processor time, which other work on the machine does not use up."""
TO_Z_UP = {"Y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]), "Z": np.eye(3)}
"""Turn of a stage's axes to the scene's, z upwards, by its upAxis: Y by 90 degrees about x; exact."""


def ask(
    file: Path, what: str, about: str, where: str, folders: Sequence[Path] | None = None
) -> tuple[dict, dict[str, np.ndarray]]:
    """What a USD file says.

    Args:
        file: USD file.
        what: "geometry" or "motion" of a prim, or "scene".
        about: Path of the prim, "" for the whole stage; of a scene the instant of the frame [s], "" for the last.
        where: Source and key of the scene, for messages.
        folders: Folders that all files it refers to must lie in; None is no bound.

    Returns:
        The answer of `warpdem.usd.reader`: numbers and texts (with ``metres`` per unit, ``up`` axis, time codes per
        second ``rate`` and what the file leaves ``unsaid``), and arrays by name.

    Raises:
        SceneError: There is no such file, or it cannot be read: damaged, refused, too slow, or too large for the memory.
    """
    if not file.is_file():
        raise SceneError(f"{where}: no such USD file: {file}")
    head = where if where == str(file) else f"{where}: {file.name}"
    limit = TIME_LIMIT + 10.0 * file.stat().st_size / BYTES_PER_SECOND
    memory.require(file.stat().st_size, head, f"a file of {file.stat().st_size} bytes", "take a smaller one")
    arguments = [what, str(file), about, *map(str, folders or ())]
    said, arrays = reader_process.run_reader(str(PROGRAM), arguments, limit, head, "the USD library")
    if said.get("up", "Z") not in TO_Z_UP:
        raise SceneError(f"{head}: upAxis = {said['up']!r}, must be Y or Z")
    return said, arrays
