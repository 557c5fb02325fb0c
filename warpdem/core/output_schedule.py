"""When frames and rows of the history are due, counted in whole steps of a run."""

import math
from dataclasses import dataclass
from fractions import Fraction

ROUNDING = 1e-6
"""How far an interval may be beside a whole number of others and still count as one [-]: intervals come from decimals."""


@dataclass(frozen=True)
class OutputSchedule:
    """Steps at which frames and rows are written, besides the first and the last one: every frame has its row."""

    frame_every: int
    """Steps between two frames."""
    row_every: Fraction
    """Steps between two rows; rows come at the whole steps nearest to its multiples."""

    @classmethod
    def of(cls, interval: float, history_interval: float | None, dt: float) -> "OutputSchedule":
        """The cadence of a run.

        Where the interval of rows divides the one of frames, rows divide the steps between two frames evenly, to the nearest
        step. Where it does not, rows keep to their own whole number of steps, and a frame between two of them has one more.
        Where it is a whole number of intervals of frames, only these are left.

        Args:
            interval: time between two frames [s].
            history_interval: time between two rows [s]; None for a quarter of ``interval``.
            dt: time step [s].
        """
        frame_every = max(1, round(interval / dt))
        share = 4.0 if history_interval is None else interval / history_interval
        whole = max(share, 1.0 / share)
        if abs(whole - round(whole)) <= ROUNDING * whole:
            return cls(frame_every, Fraction(frame_every, min(max(round(share), 1), frame_every)))
        return cls(frame_every, Fraction(max(1, round(history_interval / dt))))

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
        """Number of frames of a run of ``steps`` steps, those of its start and its end among them."""
        return 2 + (steps - 1) // self.frame_every

    def rows(self, steps: int) -> int:
        """Number of rows of a run of ``steps`` steps, those of its start and its end among them."""
        if self.frame_every % self.row_every == 0:  # each frame is at a row
            return 2 + self._count(steps - 1)
        # both are whole numbers of steps
        shared = (steps - 1) // math.lcm(self.frame_every, int(self.row_every))
        return self.frames(steps) + self._count(steps - 1) - shared

    def _at(self, number: int) -> int:
        """The step of the row of that number."""
        return math.floor(number * self.row_every + Fraction(1, 2))

    def _count(self, step: int) -> int:
        """Number of the last row at or before ``step``."""
        return math.ceil((step + Fraction(1, 2)) / self.row_every) - 1
