"""Numbers read from a finished run: a column of its history at a time or over one, or an entry of run.json."""

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
DEFAULT = ("kinetic:last", "potential:last", "largest_overlap:max")
RUN = "run."
"""Beginning of an entry of run.json."""
FORM = re.compile(r"(?P<column>.+?):(?P<how>[a-z]+)(?:@(?P<start>[^:]*):(?P<end>[^:]*))?$")


class Quantity:
    """A number of a run: ``COLUMN:HOW``, ``COLUMN:HOW@START:END`` or ``run.KEY.KEY``.

    Args:
        text: as above; HOW is one of `HOW`, START and END are times [s], either may be left out; KEYs are those of run.json.

    Raises:
        SceneError: the text is none.
    """

    def __init__(self, text: str) -> None:
        self.text = text
        self.keys = text.removeprefix(RUN).split(".") if text.startswith(RUN) else None
        if self.keys is not None:
            return
        found = FORM.fullmatch(text)
        if found is None or found["how"] not in HOW:
            raise SceneError(
                f"result {text!r}: must be COLUMN:HOW, COLUMN:HOW@START:END or {RUN}KEY, HOW one of {', '.join(HOW)}, such as "
                f'"kinetic:last", "lid force z:mean@0.5:1.0" or "run.extremes.pair_overlap_share"'
            )
        self.column, self.how = found["column"], found["how"]
        try:
            self.start = float(found["start"] or -math.inf)
            self.end = float(found["end"] or math.inf)
        except ValueError:
            raise SceneError(f"result {text!r}: {found['start']!r} and {found['end']!r} must be times in seconds") from None

    def check(self, headers: Sequence[str]) -> None:
        """Refuse a column that a history with these headers has not.

        Raises:
            SceneError: names the column and what there is.
        """
        if self.keys is None:
            try:
                History("the scene", dict.fromkeys(headers, np.zeros(0))).header(self.column)
            except WarpdemError as error:
                raise SceneError(f"result {self.text!r}: {error}") from error

    def of(self, run: Run) -> float:
        """The number of a run; nan if the run has none."""
        if self.keys is not None:
            value: Any = run.last
            for key in self.keys:
                value = value.get(key) if isinstance(value, Mapping) else None
            return float(value) if isinstance(value, int | float) else math.nan
        history = run.history
        time = history[TIME]
        inside = (time >= self.start * (1.0 - 1e-12)) & (time <= self.end * (1.0 + 1e-12))
        if self.column not in history or not inside.any():
            return math.nan
        return HOW[self.how](history[self.column][inside], time[inside])
