"""Numbers that a scene gives its models: coefficients by pair of materials, cutoff of the law, parameters of fields."""

import inspect

import numpy as np

from warpdem.kernels.contact import columns
from warpdem.kernels.contact.columns import Columns
from warpdem.kernels.field import NUMBERS
from warpdem.scene.model import Scene
from warpdem.scene.models import model
from warpdem.scene.parameters import numbers


def coefficient_table(scene: Scene) -> np.ndarray:
    """Coefficients of every pair of materials, shape (m * m, width of ``coefficient_columns``).

    Pairs that cannot meet or do not touch (no coefficients given) hold NaN.
    """
    names = list(scene.materials)
    normal, at = model("normal", scene.normal_law), coefficient_columns(scene)
    table = np.full((len(names), len(names), at.width), np.nan)
    for pair in scene.pairs:
        if not pair.contact:
            continue
        a, b = (names.index(m) for m in pair.materials)
        of_law = normal.coefficients(scene.materials[names[a]], scene.materials[names[b]], pair)
        of_pair = {key: getattr(pair, key) for key in columns.OF_PAIR}
        table[a, b] = table[b, a] = columns.coefficient_row(of_law, of_pair)
    return table.reshape(-1, at.width)


def coefficient_columns(scene: Scene) -> Columns:
    """Columns of ``coefficient_table``, by name."""
    return columns.coefficients(model("normal", scene.normal_law))


def field_numbers(scene: Scene) -> np.ndarray:
    """Parameters of each external field one after the other, filled up with zeros, SI units, shape (f, 12)."""
    return np.array([numbers(one.parameters) for one in scene.fields]).reshape(-1, NUMBERS)


def law_gap(scene: Scene, largest: float) -> float:
    """Largest distance beyond contact at which the normal law still acts [m]; 0 for a law of contact alone.

    Args:
        scene: the validated scene.
        largest: radius of the largest grain [m]; R* is at most that at a wall, and half of it between grains.
    """
    gap = getattr(model("normal", scene.normal_law), "gap", None)
    if gap is None:
        return 0.0
    materials = scene.materials
    radius = (largest if scene.walls else 0.5 * largest,) if len(inspect.signature(gap).parameters) > 3 else ()
    return max((float(gap(*(materials[m] for m in pair.materials), pair, *radius)) for pair in scene.pairs), default=0.0)
