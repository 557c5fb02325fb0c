"""Arrays of a group of grains of a stage, in SI and in the scene's axes."""

from pathlib import Path

import numpy as np

from warpdem.errors import SceneError

GRAIN_KEYS = ("positions", "velocities", "spins", "radii", "diameters")
"""Arrays of a group of grains that ``primvars:dem:`` may hold in float64."""
ROUNDING = 2.0**-22
"""Relative tolerance between a number and its single-precision copy [-]: two roundings."""


def grain_columns(
    file: Path, path: str, held: dict[str, np.ndarray], up: np.ndarray, metres: float
) -> dict[str, np.ndarray]:
    """Arrays of grains in SI and the scene's axes: those in float64, else USD's own in single precision.

    Args:
        file: The stage, for messages.
        path: Path of the Points prim, for messages.
        held: Arrays of the prim by name, with its local-to-world ``matrix``.
        up: Rotation from the stage's axes to the scene's, shape (3, 3).
        metres: Metres per unit of the stage.

    Raises:
        SceneError: The transform is no similarity, or the two arrays of positions differ.
    """
    columns = {key: held[f"dem.{key}"] for key in GRAIN_KEYS if f"dem.{key}" in held}
    linear, origin = up @ held["matrix"][:3, :3], up @ held["matrix"][:3, 3]
    factor = similarity(linear)
    if not factor:
        raise SceneError(f"{file}: {path}: a transform with shear or unequal scales does not keep spheres")
    points = held.get("points", np.zeros((0, 3)))
    world = (points @ linear.T + origin) * metres
    # in a result the points are in frame axes, below the transform of the frame
    if columns.setdefault("positions", world) is not world and not any(
        _equal_in_single(single, columns["positions"]) for single in (world, points * metres)
    ):
        raise SceneError(
            f"{file}: {path}: points and primvars:dem:positions differ: the grains were moved in one of them; to use "
            "the points, remove all primvars:dem: of the prim"
        )
    if "radii" not in columns and "diameters" not in columns and "widths" in held:
        widths, count = held["widths"] * (metres * factor), len(columns["positions"])
        columns["diameters"] = np.full(count, widths[0]) if len(widths) == 1 else widths
    if "velocities" not in columns and len(held.get("velocities", ())):
        columns["velocities"] = held["velocities"] @ linear.T * metres
    if "spins" not in columns and len(held.get("omega", ())):
        columns["spins"] = held["omega"] @ (linear.T / factor)
    return columns | ({"ids": held["ids"]} if len(held.get("ids", ())) else {})


def similarity(matrix: np.ndarray) -> float:
    """Scale factor of a matrix (3, 3) that rotates and scales equally in all directions; 0 for any other matrix."""
    square = matrix.T @ matrix
    factor = float(np.sqrt(np.trace(square) / 3.0))
    if np.abs(square - factor**2 * np.eye(3)).max() > 1e-6 * factor**2:
        return 0.0
    return 1.0 if abs(factor - 1.0) < 1e-12 else factor


def _equal_in_single(single: np.ndarray, double: np.ndarray) -> bool:
    """Whether points agree with others within single precision."""
    slack = ROUNDING * np.abs(double).max(initial=0.0)
    return single.shape == double.shape and bool(np.abs(single - double).max(initial=0.0) <= slack)


def require_equal_lengths(file: Path, path: str, columns: dict[str, np.ndarray]) -> None:
    """Refuse arrays of different length."""
    counts = {key: len(values) for key, values in columns.items()}
    if len(set(counts.values())) > 1:
        listed = ", ".join(f"{key} {count}" for key, count in counts.items())
        raise SceneError(f"{file}: {path}: its arrays have different numbers of grains: {listed}")
