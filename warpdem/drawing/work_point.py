"""A run as a work-precision diagram shows it."""

from dataclasses import dataclass


@dataclass(frozen=True)
class WorkPoint:
    """A run."""

    step: float
    """Time step [s]."""
    precision: str
    """Precision of the contact law."""
    value: float
    """The measure [its unit]."""
    error: float
    """How far that is from the measure without error of the step, over it [-]; in its unit where that is zero."""
    seconds: float
    """Wall time of the steps [s]."""
