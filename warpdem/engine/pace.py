"""How many of its threads a run uses while other programs want the cores too.

Threads that meet after every phase go at the pace of the one whose core is taken: on a busy machine fewer of them are faster.
A run without a given number of threads tries half as many, or one, when its threads did not get the cores, and twice
as many from time to time. No bit of the result depends on it, and where cores are free nothing is tried.
"""

WINDOW = 0.1
"""Wall time of steps between two looks [s]."""
FREE = 0.8
"""Processor time over that of all threads at work all the time, from which on the cores were free [-]."""
FASTER = 0.95
"""Time of a step over that before, below which a change is kept [-]."""
PATIENCE = 1.0, 30.0
"""Wall time until the next trial [s]: at first, and at most; it doubles after each that brought nothing."""


class Pace:
    """Threads for the next batch of steps, from how the ones before went."""

    def __init__(self) -> None:
        self._count: int | None = None  # threads at work; None: as many as pay
        self._before: tuple[int | None, float] | None = None  # during a trial: threads before it, and their time of a step [s]
        self._patience, self._waited = PATIENCE[0], 0.0
        self._halves = True  # whether half as many are tried next, else one
        self._steps, self._wall, self._used = 0, 0.0, 0.0

    def threads(self, most: int) -> int:
        """Threads for the next batch, of ``most`` that pay."""
        return most if self._count is None else min(self._count, most)

    def done(self, most: int, steps: int, wall: float, used: float) -> None:
        """Take note of a batch.

        Args:
            most: threads that pay.
            steps: steps of the batch.
            wall: its wall time [s].
            used: processor time of the whole process in it [s].
        """
        self._steps, self._wall, self._used = self._steps + steps, self._wall + wall, self._used + used
        if self._wall < WINDOW or not self._steps:
            return
        count, per_step, got = self.threads(most), self._wall / self._steps, self._used / self._wall
        self._waited += self._wall
        self._steps, self._wall, self._used = 0, 0.0, 0.0
        if self._before is not None:
            count_before, time_before = self._before
            self._before, self._waited = None, 0.0
            kept = per_step < FASTER * time_before
            self._patience = PATIENCE[0] if kept else min(2.0 * self._patience, PATIENCE[1])
            if not kept:
                self._count, self._halves = count_before, not self._halves
        elif self._waited < self._patience:
            return
        elif count > 1 and got < FREE * count:
            self._before, self._count = (self._count, per_step), count // 2 if self._halves else 1
        elif count < most:
            self._before, self._count = (self._count, per_step), 2 * count if 2 * count < most else None
