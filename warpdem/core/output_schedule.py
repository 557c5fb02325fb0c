"""The steps of a run at which frames and history rows are due."""

import math
from dataclasses import dataclass
from fractions import Fraction

ROUNDING = 1e-6
"""Relative tolerance within which the ratio of two intervals counts as a whole number [-]: intervals come from decimals."""


@dataclass(frozen=True)
class OutputSchedule:
    """Steps at which frames and history rows are written, besides the first and the last step: every frame has a row."""

    frame_every: int
    """Steps between two frames."""
    row_every: Fraction
    """Steps between two rows; rows are due at the steps nearest to its multiples."""

    @classmethod
    def of(cls, interval: float, history_interval: float | None, dt: float) -> "OutputSchedule":
        """The schedule of a run.

        If the row interval divides the frame interval, rows divide the steps between two frames evenly, to the nearest step.
        If the row interval is a multiple of the frame interval, the rows are those of the frames. Otherwise rows are due at a
        whole number of steps of their own, and each frame between two of them has an additional row.

        Args:
            interval: Time between two frames [s].
            history_interval: Time between two rows [s]; None for a quarter of ``interval``.
            dt: Time step [s].
        """
        frame_every = max(1, round(interval / dt))
        row_interval = 0.25 * interval if history_interval is None else history_interval
        rows_per_frame = interval / row_interval
        ratio = max(rows_per_frame, 1.0 / rows_per_frame)
        if abs(ratio - round(ratio)) <= ROUNDING * ratio:
            return cls(frame_every, Fraction(frame_every, min(max(round(rows_per_frame), 1), frame_every)))
        return cls(frame_every, Fraction(max(1, round(row_interval / dt))))

    def is_frame(self, step: int) -> bool:
        """Whether a frame is due at ``step``."""
        return step % self.frame_every == 0

    def is_row(self, step: int) -> bool:
        """Whether a row is due at ``step``."""
        return self.is_frame(step) or self._at(self._count(step)) == step

    def next(self, step: int) -> int:
        """The first step after ``step`` at which a frame or a row is due."""
        return min((step // self.frame_every + 1) * self.frame_every, self._at(self._count(step) + 1))

    def frames(self, steps: int) -> int:
        """Number of frames of a run of ``steps`` steps, including those of its start and its end."""
        return 2 + (steps - 1) // self.frame_every

    def rows(self, steps: int) -> int:
        """Number of rows of a run of ``steps`` steps, including those of its start and its end."""
        if self.frame_every % self.row_every == 0:  # every frame coincides with a row
            return 2 + self._count(steps - 1)
        # both are whole numbers of steps
        shared = (steps - 1) // math.lcm(self.frame_every, int(self.row_every))
        return self.frames(steps) + self._count(steps - 1) - shared

    def _at(self, number: int) -> int:
        """The step of row ``number``."""
        return math.floor(number * self.row_every + Fraction(1, 2))

    def _count(self, step: int) -> int:
        """Number of the last row at or before ``step``."""
        return math.ceil((step + Fraction(1, 2)) / self.row_every) - 1
