"""Units of the numbers of a scene: plain numbers are SI, strings carry a unit ("30 rpm", "0.45 mm").

Each number of the scene declares its unit by one of the annotations below; inside warpdem everything is SI.
"""

from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np
from pydantic_core import core_schema

from warpdem.scene.parse_units import DIMENSIONS, numbers_text, to_si


@dataclass(frozen=True)
class Quantity:
    """Annotation of a number: its unit and range; with ``auto`` the string "auto" is allowed too.

    ``Annotated[float, Quantity("m", gt=0)]`` accepts 0.001 and "1 mm" and holds 0.001.
    """

    unit: str
    gt: float | None = None
    ge: float | None = None
    lt: float | None = None
    le: float | None = None
    auto: bool = False

    def range_text(self) -> str:
        """Text of the allowed range, such as "> 0 [m]" or "> 0 and <= 1"; empty without limits."""
        signs = {">": self.gt, ">=": self.ge, "<": self.lt, "<=": self.le}
        text = " and ".join(f"{sign} {limit:g}" for sign, limit in signs.items() if limit is not None)
        return f"{text} [{self.unit}]" if text and self.unit != "-" else text

    def magnitude_text(self) -> str:
        """Text of the magnitudes that the engine computes with."""
        known = DIMENSIONS[self.unit]
        least = f"from {known.least:g} to " if self.gt == 0 else "at most "
        sign = "" if self.gt == 0 or self.ge == 0 else " in magnitude"
        return f"{least}{known.most:g}{f' [{self.unit}]' if self.unit != '-' else ''}{sign}"

    def can_be_computed(self, value: Any) -> Any:
        """Whether the magnitude of a number or array [SI] is one that the engine computes with (elementwise)."""
        known, size = DIMENSIONS[self.unit], np.abs(value)
        return (size <= known.most) & (size >= known.least) if self.gt == 0 else size <= known.most

    def in_range(self, value: Any) -> Any:
        """Whether a number or array [SI] lies in the range (elementwise)."""
        inside = np.isfinite(value)
        if self.gt is not None:
            inside &= value > self.gt
        if self.ge is not None:
            inside &= value >= self.ge
        if self.lt is not None:
            inside &= value < self.lt
        if self.le is not None:
            inside &= value <= self.le
        return inside

    def validate(self, value: Any) -> float | str:
        """Value in SI units, or "auto".

        Raises:
            ValueError: not a number of this dimension, or out of range.
        """
        if self.auto and isinstance(value, str) and value.strip() == "auto":
            return "auto"
        try:
            number = to_si(value, self.unit)
        except ValueError as error:
            raise ValueError(f'{error}, or "auto"' if self.auto else str(error)) from None
        if not self.in_range(number):
            raise ValueError(f"must be {self.range_text()}" + (', or "auto"' if self.auto else ""))
        if not self.can_be_computed(number):
            auto = ', or "auto"' if self.auto else ""
            raise ValueError(f"must be {self.magnitude_text()}{auto}: beyond, numbers lose precision or overflow")
        return number

    def json_schema(self) -> dict[str, Any]:
        """JSON schema: a number in SI units, or a string with a unit."""
        limits = {
            "exclusiveMinimum": self.gt,
            "minimum": self.ge,
            "exclusiveMaximum": self.lt,
            "maximum": self.le,
        }
        number: dict[str, Any] = {"type": "number", "description": f"in [{self.unit}]"}
        number |= {key: limit for key, limit in limits.items() if limit is not None}
        text = {"type": "string", "description": f'with a unit, such as "{DIMENSIONS[self.unit].example}"'}
        if self.auto:
            text["description"] += ', or "auto"'
        return {"anyOf": [number, text]}

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        return core_schema.no_info_plain_validator_function(self.validate)

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> dict[str, Any]:
        return self.json_schema()


@dataclass(frozen=True)
class Vector:
    """Annotation of a list of fixed length, each number plain or with its own unit; holds a tuple of floats."""

    item: Quantity
    length: int = 3

    def _example(self) -> str:
        """Example of such a list."""
        last = "1" if self.item.unit == "-" else f'"{DIMENSIONS[self.item.unit].example}"'
        return f"[{', '.join(['0'] * (self.length - 1) + [last])}]"

    def listed(self, value: Any) -> list[Any]:
        """Return the entries as a list.

        Raises:
            ValueError: not a list of this length.
        """
        entries = value.tolist() if isinstance(value, np.ndarray) else value
        if not isinstance(entries, (list, tuple)) or len(entries) != self.length:
            raise ValueError(f"must be a list of {self.length} {numbers_text(self.item.unit)}, such as {self._example()}")
        return list(entries)

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        item = core_schema.no_info_plain_validator_function(self.item.validate)
        entries = core_schema.tuple_schema([item] * self.length)
        return core_schema.no_info_before_validator_function(self.listed, entries)

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> dict[str, Any]:
        return {
            "type": "array",
            "items": self.item.json_schema(),
            "minItems": self.length,
            "maxItems": self.length,
        }


@dataclass(frozen=True)
class Array:
    """Annotation of an array of numbers, shape (n,) or (n, columns); holds a read-only float64 array [SI].

    Lists (also with strings that carry units) and NumPy arrays are accepted; 1e5 rows take some 20 ms.
    """

    item: Quantity
    columns: int | None = None

    def shape_text(self) -> str:
        """Text of the required shape."""
        numbers = numbers_text(self.item.unit)
        return f"a list of {numbers}" if self.columns is None else f"a list of rows of {self.columns} {numbers}"

    def validate(self, value: Any) -> np.ndarray:
        """Values in SI units, float64, read-only.

        Raises:
            ValueError: Wrong shape, or an entry that is no number of this dimension or out of range; the text names it.
        """
        wrong_shape = f"must be {self.shape_text()}"
        if isinstance(value, np.ndarray):
            value = value.tolist() if value.dtype.kind not in "iuf" else value
        if isinstance(value, np.ndarray):
            array = np.array(value, dtype=np.float64)
        else:
            array = self._from_list(value, wrong_shape)
        if array.size == 0 or array.ndim != (1 if self.columns is None else 2):
            raise ValueError(wrong_shape)
        if self.columns is not None and array.shape[1] != self.columns:
            raise ValueError(wrong_shape)
        finite = " and ".join(filter(None, ["finite", self.item.range_text()]))
        for good, rule in ((self.item.in_range, finite), (self.item.can_be_computed, self.item.magnitude_text())):
            bad = np.argwhere(~good(array))
            if bad.size:
                entry = tuple(bad[0])
                raise ValueError(f"entry {_index_text(entry)} = {array[entry]:g}: must be {rule}")
        array.flags.writeable = False
        return array

    def _from_list(self, value: Any, wrong_shape: str) -> np.ndarray:
        if not isinstance(value, (list, tuple)):
            raise ValueError(wrong_shape)
        rows = value
        if self.columns is not None:
            rows = [row.tolist() if isinstance(row, np.ndarray) else row for row in value]
            for i, row in enumerate(rows):
                if not isinstance(row, (list, tuple)) or len(row) != self.columns:
                    raise ValueError(f"{wrong_shape}; row [{i}] is not one")
        flat = list(rows if self.columns is None else chain.from_iterable(rows))
        if not set(map(type, flat)) <= {int, float}:
            flat = [self._entry(k, entry) for k, entry in enumerate(flat)]
        shape = -1 if self.columns is None else (-1, self.columns)
        try:
            return np.array(flat, dtype=np.float64).reshape(shape)
        except OverflowError:
            raise ValueError(f"{wrong_shape}; an entry is too large") from None

    def _entry(self, k: int, entry: Any) -> float:
        try:
            return to_si(entry, self.item.unit)
        except ValueError as error:
            index = (k,) if self.columns is None else divmod(k, self.columns)
            raise ValueError(f"entry {_index_text(index)}: {error}") from None

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        to_list = core_schema.plain_serializer_function_ser_schema(np.ndarray.tolist, when_used="json")
        return core_schema.no_info_plain_validator_function(self.validate, serialization=to_list)

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> dict[str, Any]:
        items = self.item.json_schema()
        if self.columns is not None:
            items = {"type": "array", "items": items, "minItems": self.columns, "maxItems": self.columns}
        return {"type": "array", "items": items, "minItems": 1}


def _index_text(index: tuple[int, ...]) -> str:
    return "".join(f"[{int(i)}]" for i in index)
