"""The records of a wall contact: what it remembers from step to step, and what the last force call made of it.

Packed, because a contact is read and written once a step: two cache lines each instead of one per quantity.
"""

import numpy as np
import warp as wp
from warpdem.kernels.contact.columns import Columns, scalars

GEOMETRY = Columns(
    (
        ("wall", 1),  # number of the wall
        ("overlap", 1),  # [m]
        ("weight", 1),  # fraction of a full contact [-]
        ("point", 3),  # contact point in body axes of the wall [m]
        ("normal", 3),  # unit vector from the wall to the grain, frame axes
    )
)
"""What is remembered of any wall contact; the contact history of the law follows."""
RESULT = Columns(
    (
        ("feature", 1),  # number of the feature that is touched
        ("force", 3),  # on the grain [N]
        ("moment", 3),  # rolling torque on the grain [N m]; only with a rolling model, or where wear is added up
        ("wall_velocity", 3),  # of the wall's material there [m/s]; where wear is added up
        ("begins", 1),  # 1 in the first step of a touch, else 0; where wear is added up
    )
)
FOUND = scalars(
    (
        "grain",  # memory slot
        "hit",  # slot of the hit
        "before",  # slot of the contact point of the step before whose history it takes, -1 if there is none
        "slot",  # its own
        "feature",
        "wall",
        "motion",  # placement of the wall
        "coefficients",  # row of the table of coefficients
    )
)
"""What is known of a contact point before its law is evaluated: where to read and write."""
Found = FOUND.vector(wp.int32)
FRICTION, ROLLING = 4, 7  # numbers of RESULT without the moment, and with it


def columns(history: Columns) -> Columns:
    """What a wall contact remembers: its geometry and the ``history`` of its law."""
    return GEOMETRY.and_(history)


def history_type(history: Columns):
    """Vector that holds it."""
    return columns(history).vector(wp.float64)


def result_width(rolling: bool, wear: bool = False) -> int:
    """How many numbers of RESULT are kept."""
    return RESULT.width if wear else ROLLING if rolling else FRICTION


def result_type(rolling: bool, wear: bool = False):
    """Vector that holds them."""
    return wp.types.vector(result_width(rolling, wear), wp.float64)


def unpacked(history: Columns, memory: np.ndarray, result: np.ndarray) -> dict[str, np.ndarray]:
    """The quantities of records by name, of shapes (n,) or (n, 3); numbers of walls and features as integers."""
    both = ((columns(history), memory), (RESULT, result))
    out = {name: record[..., column] for at, record in both for name, column in _held(at, record.shape[-1])}
    return out | {name: out[name].astype(np.int64) for name in ("wall", "feature")}


def packed(at: Columns, data: dict[str, np.ndarray], width: int) -> np.ndarray:
    """Records of ``width`` numbers from the quantities ``wall_contact_NAME`` of a checkpoint, shape (n, width)."""
    record = np.zeros((len(data["wall_contact_wall"]), width))
    for name, column in _held(at, width):
        record[:, column] = data[f"wall_contact_{name}"]
    return record


def _held(at: Columns, width: int):
    """Names and columns that a record of ``width`` numbers has."""
    indices = [(name, at.of(name)) for name in at.names]
    return [(name, c) for name, c in indices if (c.stop if isinstance(c, slice) else c + 1) <= width]
