"""From the values of a field to colours: which field, its title and unit, the range of the scale bar."""

from dataclasses import dataclass
from functools import cached_property

import matplotlib
import numpy as np
from matplotlib.colors import Normalize

from warpdem.core.pose import FramePose
from warpdem.errors import WarpdemError
from warpdem.output.result_arrays import CONTACT_ARRAYS, GRAIN_ARRAYS, TRIANGLE_ARRAYS, WEAR_ARRAYS

CATEGORIES = "#4477aa #ee6677 #228833 #ccbb44 #66ccee #aa3377 #ee8866 #44bb99 #bbcc33 #999999".split()
"""Colours of categories, which have no order (Tol, colour schemes, 2021: distinct for the colour-blind too)."""
_SHORT = {"speed": "v", "spin": "omega", "force": "f", "size": "radius", "speed_lab": "v"}
"""Short names of fields, and the array that holds each."""
_ARRAYS = {array.name: array for array in (*CONTACT_ARRAYS, *GRAIN_ARRAYS, *TRIANGLE_ARRAYS, *WEAR_ARRAYS)}
_RELATIVE = ("v", "omega")
"""Arrays that are relative to the frame."""
_CATEGORICAL = ("type", "group", "clump")
_NO_NUMBER = "#6b6f73"
"""Colour of a value that is no number."""
_TAIL = 0.01
"""Fraction of the values at each end that the range may leave out, so that a few grains in free fall do not leave one colour
for all others."""
_FEW = 20
"""Grains in a frame below which the range holds all values."""
_FAR = 1.5
"""The ends are left out if the range of all values is more than this factor longer than the range without them [-]."""
_SAMPLES = 4096
"""Values of each frame that are stored, at equal steps of their sorted order."""


@dataclass(frozen=True)
class Field:
    """A quantity that colours grains or triangles."""

    name: str
    """Name given by the user."""
    array: str
    """Array that holds it."""
    component: str
    """x, y or z; empty for the length of a vector and for plain numbers."""

    @property
    def is_category(self) -> bool:
        """Whether values are categories, without an order."""
        return self.array in _CATEGORICAL

    def values(
        self, arrays: dict[str, np.ndarray], pose: FramePose | None = None, points: np.ndarray | None = None
    ) -> np.ndarray:
        """Values of the field, shape (n,).

        Args:
            arrays: Arrays of the grains or triangles by name.
            pose: Pose of the frame of reference; only for grains.
            points: Positions of the grains in frame axes [m], shape (n, 3).
        """
        values = arrays[self.array]
        if self.name.split(".")[0] == "speed_lab":
            assert pose is not None and points is not None, "speed_lab is a field of grains"
            values = values + pose.velocity_at(points)
        if values.ndim == 1:
            return values
        return values[:, "xyz".index(self.component)] if self.component else np.linalg.norm(values, axis=1)

    def title(self, moving_frame: bool) -> str:
        """Name and unit beside the scale bar; ``moving_frame`` if the frame is not the laboratory."""
        known = _ARRAYS.get(self.array)
        meaning, unit = (known.meaning, known.unit) if known else (self.array, "")
        if self.array == "v" and not self.component:
            meaning = "speed"
        elif self.component:
            meaning += f", {self.component} component"
        if moving_frame and self.array in _RELATIVE:
            meaning += " in the laboratory" if self.name.startswith("speed_lab") else " in the frame"
        return f"{meaning} [{unit}]" if unit else meaning


def field_of(name: str, arrays: dict[str, np.ndarray], key: str, whose: str) -> Field:
    """The field that a user names.

    Args:
        name: As in ``speed``, ``v`` or ``v.x``.
        arrays: Arrays there are.
        key: Choice that has the name, for the message.
        whose: What the arrays belong to, for the message.

    Raises:
        WarpdemError: There is no such field; the message lists those there are.
    """
    short, _, component = name.partition(".")
    array = short if key == "wall_colour" else _SHORT.get(short, short)
    values = arrays.get(array)
    if values is None or values.dtype.kind not in "fiu" or values.ndim > 2:
        there = [n for n in (*_SHORT, *arrays) if n in arrays or (key == "colour" and _SHORT.get(n) in arrays)]
        raise WarpdemError(f"{key} {name!r} is unknown; {whose} have {', '.join(dict.fromkeys(there)) or 'no field'}")
    if component and (values.ndim != 2 or values.shape[1] != 3 or component not in ("x", "y", "z")):
        raise WarpdemError(f"{key} {name!r}: only a vector has components, and they are .x, .y and .z")
    return Field(name, array, component)


class Scale:
    """Range and colour map of one scale bar; all values that will be shown must be included first."""

    def __init__(self, field: Field, colour_map: str | None, given: tuple[float, float] | None) -> None:
        name = colour_map or ("coolwarm" if field.component else "viridis")
        if name not in matplotlib.colormaps:
            raise WarpdemError(
                f"colour_map {name!r} is unknown; Matplotlib has viridis, plasma, cividis, turbo, coolwarm, gray and others"
            )
        self.field, self.map, self._given = field, matplotlib.colormaps[name].with_extremes(bad=_NO_NUMBER), given
        self._least, self._most = np.inf, -np.inf
        self._samples: list[tuple[np.ndarray, int]] = []  # sorted values of a frame, and how many they stand for; no zeros

    def include(self, values: np.ndarray) -> None:
        """Widen the range for values of a frame, shape (n,), that will be shown; values that are not finite are ignored."""
        values = np.sort(values[np.isfinite(values)])
        if len(values):
            self._least, self._most = min(self._least, float(values[0])), max(self._most, float(values[-1]))
            values = values[values != 0]  # most triangles of a wall carry no load, and most grains of a bed may be at rest
            sampled = np.round(np.linspace(0, len(values) - 1, min(len(values), _SAMPLES))).astype(int)
            self._samples.append((values[sampled].astype(float), len(values)))

    @cached_property
    def _usual(self) -> tuple[float, float]:
        """Ends of the values of all frames together, without outliers."""
        counts = [count for _, count in self._samples if count]
        grains = sum(counts) / max(len(counts), 1)
        if grains < _FEW:
            return self._least, self._most
        values = np.concatenate([values for values, _ in self._samples])
        weights = np.concatenate([np.full(len(values), count / max(len(values), 1)) for values, count in self._samples])
        order = np.argsort(values, kind="stable")
        fraction = np.cumsum(weights[order]) / weights.sum()
        tail = max(_TAIL, 1.5 / grains)  # at least one grain, even if it is fast in every frame
        low, high = (float(values[order][np.searchsorted(fraction, end)]) for end in (tail, 1.0 - tail))
        low, high = (
            low if high - self._least > _FAR * (high - low) else self._least,
            high if self._most - low > _FAR * (high - low) else self._most,
        )
        return (low, high) if high > low else (self._least, self._most)

    @property
    def limits(self) -> tuple[float, float]:
        """Values at the ends of the bar."""
        if self._given is not None:
            return self._given
        if not self._samples:
            return 0.0, 1.0
        whole = self.field.array in ("radius", "mass", "id")
        low, high = (self._least, self._most) if whole else self._usual
        if self.field.component:
            largest = _rounded_up(max(-low, high)) or 1.0
            return -largest, largest
        if low >= 0.0 and (low < 0.5 * high or low == high):
            return 0.0, _rounded_up(high) or 1.0
        return (low, high) if high > low else (low, 0.0)

    @property
    def beyond(self) -> str:
        """At which ends of the bar values lie beyond it: Matplotlib's ``extend``."""
        low, high = self.limits
        slack = 1e-9 * (high - low)
        under, over = bool(self._samples) and self._least < low - slack, bool(self._samples) and self._most > high + slack
        return {(0, 0): "neither", (1, 0): "min", (0, 1): "max", (1, 1): "both"}[under, over]

    @property
    def categories(self) -> range:
        """Numbers of the categories included, for a categorical field."""
        return range(int(self._most) + 1) if np.isfinite(self._most) else range(0)

    def colours(self, values: np.ndarray) -> np.ndarray:
        """Colours of values, shape (n,), as red, green, blue of 0 to 255, shape (n, 3), uint8."""
        if self.field.is_category:
            table = [matplotlib.colors.to_rgb(colour) for colour in CATEGORIES]
            return np.asarray(np.round(255.0 * np.array(table)).astype(np.uint8)[values.astype(int) % len(table)])
        return np.asarray(self.map(Normalize(*self.limits)(values.astype(float)), bytes=True))[:, :3]


def _rounded_up(value: float) -> float:
    """To two digits, so that the labels of the bar are short."""
    if value <= 0.0:
        return 0.0
    unit = 10.0 ** (np.floor(np.log10(value)) - 1.0)
    if not unit > 0.0:
        return value  # the smallest floats
    return float(np.ceil(value / unit * (1.0 - 1e-12)) * unit)
