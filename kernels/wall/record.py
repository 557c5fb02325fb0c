"""The records of a touching place: what it remembers from step to step, and what the last force call made of it.

Packed, because a place is read and written once a step: two cache lines each instead of one per quantity.
"""

import numpy as np
import warp as wp

MEMORY = {
    "wall": 0,  # number of the wall
    "overlap": 1,  # [m]
    "weight": 2,  # share of a full contact [-]
    "point": slice(3, 6),  # contact point in body axes of the wall [m]
    "normal": slice(6, 9),  # unit vector from the wall to the grain, frame axes
    "spring": slice(9, 12),  # of the tangential law
    "angle": slice(12, 15),  # of the rolling law
}
RESULT = {
    "feature": 0,  # number of the feature that is touched
    "force": slice(1, 4),  # on the grain [N]
    "moment": slice(4, 7),  # rolling torque on the grain [N m]
}


def memory_type(history: int):
    """Vector that holds MEMORY; ``history`` numbers of it belong to the contact law (0, 3 or 6)."""
    return wp.types.vector(9 + history, wp.float64)


def result_type(rolling: bool):
    """Vector that holds RESULT."""
    return wp.types.vector(7 if rolling else 4, wp.float64)


def unpacked(memory: np.ndarray, result: np.ndarray) -> dict[str, np.ndarray]:
    """The quantities of records by name, of shapes (n,) or (n, 3); numbers of walls and features as integers."""
    both = ((MEMORY, memory), (RESULT, result))
    out = {name: record[..., column] for columns, record in both for name, column in _held(columns, record.shape[-1])}
    return out | {name: out[name].astype(np.int64) for name in ("wall", "feature")}


def packed(columns: dict, data: dict[str, np.ndarray], width: int) -> np.ndarray:
    """Records of ``width`` numbers from the quantities ``place_NAME`` of a checkpoint, shape (n, width)."""
    record = np.zeros((len(data["place_wall"]), width))
    for name, column in _held(columns, width):
        record[:, column] = data[f"place_{name}"]
    return record


def _held(columns: dict, width: int):
    """Names and columns that a record of ``width`` numbers has."""
    return [(name, c) for name, c in columns.items() if (c.stop if isinstance(c, slice) else c + 1) <= width]
