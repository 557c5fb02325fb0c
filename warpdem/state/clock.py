"""Where a run is in time."""

from dataclasses import dataclass


@dataclass
class Clock:
    """Number of the present step, and whether its forces are known."""

    dt: float
    """Time step [s]."""
    step_number: int = 0
    """Steps since the start of the scene."""
    forces_evaluated: bool = False
    """The contact forces belong to the present positions."""

    @property
    def time(self) -> float:
        """Simulated time [s]: step number times time step, never a running sum."""
        return self.step_number * self.dt
