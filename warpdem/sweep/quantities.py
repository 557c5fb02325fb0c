"""Numbers read from a finished run: of its history, of run.json, of its last frame, and what is made of several of these."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from warpdem.errors import SceneError, WarpdemError
from warpdem.runs import History, Run
from warpdem.runs.compare import mean_in_time
from warpdem.runs.history import TIME
from warpdem.sweep.last_frame import SHAPES, shape_of

HOW: dict[str, Callable[[np.ndarray, np.ndarray], float]] = {
    "first": lambda x, t: float(x[0]),
    "last": lambda x, t: float(x[-1]),
    "min": lambda x, t: float(np.nanmin(x)),
    "max": lambda x, t: float(np.nanmax(x)),
    "mean": lambda x, t: float(mean_in_time(x, t)) if len(t) > 1 else float(x[0]),
    "std": lambda x, t: float(np.nanstd(x)),
    "rate": lambda x, t: float(np.polyfit(t, x, 1)[0]) if len(t) > 1 else math.nan,
}
"""What is made of a column; ``mean`` is the mean in time, ``rate`` the slope of a straight line through its rows."""
MADE: dict[str, tuple[int, Callable[..., float]]] = {
    "ratio": (2, lambda a, b: a / b if b else math.nan),
    "product": (2, lambda a, b: a * b),
    "difference": (2, lambda a, b: a - b),
    "angle": (2, lambda a, b: math.degrees(math.atan2(a, b))),
    "root": (1, lambda a: math.sqrt(a) if a >= 0.0 else math.nan),
    "size": (1, abs),
}
"""What is made of other quantities, and of how many; ``angle`` is atan2(a, b) in degrees."""
DEFAULT = ("kinetic:last", "potential:last", "largest_overlap:max")
RUN, FRAME = "run.", "frame."
"""Beginnings of an entry of run.json, and of what the grains of the last frame have."""
FORM = re.compile(r"(?P<column>.+?):(?P<how>[a-z]+)(?:@(?P<start>[^:]*):(?P<end>[^:]*))?$")
CALL = re.compile(rf"\s*({'|'.join(MADE)})\s*\((.*)\)\s*$", re.DOTALL)
NUMBER = re.compile(r"\s*[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?\s*$")


class Quantity:
    """A number of a run: ``COLUMN:HOW``, ``COLUMN:HOW@START:END``, ``run.KEY.KEY``, ``frame.SHAPE``, ``MADE(A, B)`` of others.

    Args:
        text: as above; HOW is one of `HOW`, START and END are times [s], either may be left out; KEYs are those of run.json;
            SHAPE is one of ``last_frame.SHAPES``; MADE is one of `MADE`, A and B are quantities or plain numbers.

    Raises:
        SceneError: the text is none.
    """

    def __init__(self, text: str) -> None:
        self.text = text
        self._of: Callable[[Run], float]
        self.columns: list[str] = []
        """Columns of the history that are read."""
        self.needs_frame = False
        """Whether the last frame is read."""
        if call := CALL.match(text):
            self._make(call[1], _arguments(call[2]))
        elif NUMBER.match(text):
            number = float(text)
            self._of = lambda run: number
        elif text.startswith(RUN):
            self._of = lambda run: _entry(run, text.removeprefix(RUN).split("."))
        elif text.startswith(FRAME):
            shape = text.removeprefix(FRAME)
            if shape not in SHAPES:
                raise SceneError(f"result {text!r}: of the last frame there are {', '.join(FRAME + name for name in SHAPES)}")
            self.needs_frame = True
            self._of = lambda run: shape_of(run, shape)
        else:
            self._read_column()

    def _make(self, name: str, texts: list[str]) -> None:
        count, make = MADE[name]
        if len(texts) != count:
            raise SceneError(f"result {self.text!r}: {name} takes {count} in its brackets, not {len(texts)}")
        parts = [Quantity(text.strip()) for text in texts]
        self.columns = [column for part in parts for column in part.columns]
        self.needs_frame = any(part.needs_frame for part in parts)
        self._of = lambda run: float(make(*(part.of(run) for part in parts)))

    def _read_column(self) -> None:
        found = FORM.fullmatch(self.text)
        if found is None or found["how"] not in HOW:
            raise SceneError(
                f"result {self.text!r}: must be COLUMN:HOW, COLUMN:HOW@START:END or {RUN}KEY, HOW one of {', '.join(HOW)}, "
                f'such as "kinetic:last", "lid force z:mean@0.5:1.0" or "run.extremes.pair_overlap_share"; {FRAME}SHAPE, SHAPE '
                f'one of {", ".join(SHAPES)}; or made of such by {", ".join(MADE)}, as in '
                '"angle(size(centre_x:mean@1:), size(centre_z:mean@1:))"'
            )
        column, how = found["column"], found["how"]
        try:
            start, end = float(found["start"] or -math.inf), float(found["end"] or math.inf)
        except ValueError:
            raise SceneError(
                f"result {self.text!r}: {found['start']!r} and {found['end']!r} must be times in seconds"
            ) from None
        self.columns = [column]

        def of(run: Run) -> float:
            history = run.history
            time = history[TIME]
            inside = (time >= start * (1.0 - 1e-12)) & (time <= end * (1.0 + 1e-12))
            if column not in history or not inside.any():
                return math.nan
            return HOW[how](history[column][inside], time[inside])

        self._of = of

    def check(self, headers: Sequence[str]) -> None:
        """Refuse a column that a history with these headers has not.

        Raises:
            SceneError: names the column and what there is.
        """
        for column in self.columns:
            try:
                History("the scene", dict.fromkeys(headers, np.zeros(0))).header(column)
            except WarpdemError as error:
                raise SceneError(f"result {self.text!r}: {error}") from error

    def of(self, run: Run) -> float:
        """The number of a run; nan if the run has none."""
        return self._of(run)


def _entry(run: Run, keys: Sequence[str]) -> float:
    value: Any = run.last
    for key in keys:
        value = value.get(key) if isinstance(value, Mapping) else None
    return float(value) if isinstance(value, int | float) else math.nan


def _arguments(text: str) -> list[str]:
    """What stands between commas that no brackets enclose."""
    parts, depth = [""], 0
    for sign in text:
        depth += (sign == "(") - (sign == ")")
        if sign == "," and not depth:
            parts.append("")
        else:
            parts[-1] += sign
    return parts
