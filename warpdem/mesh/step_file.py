"""Triangles of STEP files: their surfaces are divided by OpenCASCADE, through `cascadio`, within a tolerance."""

from pathlib import Path

import numpy as np

from warpdem.core import memory, reader_process
from warpdem.errors import SceneError

TOLERANCE = 1.0e-4
"""Largest distance between triangles and surfaces where a scene does not give one [m]."""
TIME_LIMIT = 300.0
"""Wall time that dividing a file may take [s]."""
PROGRAM = Path(__file__).with_name("step_program.py")
MILLIMETRES = 1000.0
"""Per metre."""


def read_triangles(path: Path, key: str, part: str, tolerance: float | None) -> tuple[np.ndarray, tuple[str, ...]]:
    """Corners of all triangles of a file [m], shape (t, 3, 3), and a note on how far they are from the surfaces.

    A STEP file states its unit; lengths are in metres. The note holds the tolerance, which OpenCASCADE keeps, and the distance
    of points of a finer division, which lie on the surfaces, from the triangles.

    Args:
        path: File ending in .step or .stp.
        key: Scene key, for messages.
        part: Name of the part (solid) that is wanted; "" for all.
        tolerance: Largest distance between triangles and surfaces [m]; None for `TOLERANCE`.

    Raises:
        SceneError: The file is missing or cannot be read, has no such part, or the library is not installed.
    """
    if not path.is_file():
        raise SceneError(f"{key}: no such mesh file: {path}")
    size, within = path.stat().st_size, TOLERANCE if tolerance is None else tolerance
    head = f"{key}: {path.name}"
    memory.require(size, head, f"a file of {size} bytes", "take a smaller one")
    try:
        arguments = [str(path), repr(within * MILLIMETRES)]
        answer, arrays = reader_process.run_reader(str(PROGRAM), arguments, TIME_LIMIT, head, "OpenCASCADE")
    except SceneError as error:
        if not str(error).endswith(": missing"):
            raise
        raise SceneError(
            f'{head}: STEP files need the library cascadio: pip install "warpdem[cad]"; or write the mesh as STL, OBJ or PLY'
        ) from None
    names, counts = answer["names"], arrays["counts"]
    corners, points = arrays["corners"], arrays["points"]
    if part and part not in names:
        raise SceneError(f"{head}: part = {part!r}: no such part; there are {', '.join(names)}")
    apart = _farthest(corners, points)
    if part:
        corners = corners[np.repeat(np.array([name == part for name in names]), counts)]
    return corners, (
        f"{len(corners)} triangles within {within:.3g} m of the surfaces in the file (tolerance), "
        f"{apart:.2g} m as measured by a finer division",
    )


def _farthest(corners: np.ndarray, points: np.ndarray) -> float:
    """Largest distance of points, shape (n, 3), from triangles, shape (t, 3, 3) [m]."""
    from warpdem.mesh.distance import DistanceQuery  # compiles a kernel: only such files pay

    faces = np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3)
    distance, _ = DistanceQuery(corners.reshape(-1, 3), faces)(points)
    return float(np.abs(distance).max(initial=0.0))
