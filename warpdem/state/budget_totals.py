"""What the budgets of energy and momentum hold beside the sums per grain: part of what changes in a run."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any


@dataclass
class BudgetTotals:
    """Totals since the first step; ``measure.budget`` adds to them and reads them."""

    gone: dict[str, list[float]]
    """Sums of the grains that have left, by the names of ``MeasureFeatures.sums``."""
    start: dict[str, list[float]] = field(default_factory=dict)
    """Energy [J] and momenta at the start; empty before."""
    carried: list[float] = field(default_factory=lambda: [0.0] * 7)
    """Energy [J], momentum [N s] and angular momentum [N m s] of grains that were inserted less those that have left."""

    @classmethod
    def of(cls, sums: Mapping[str, int]) -> "BudgetTotals":
        """Totals before the first step, of sums of so many numbers each."""
        return cls({name: [0.0] * width for name, width in sums.items()})

    def state(self) -> dict[str, Any]:
        """What a checkpoint holds of it, as JSON."""
        return asdict(self)

    def restore(self, state: dict[str, Any]) -> None:
        """Take over what ``state`` gave."""
        self.start, self.gone, self.carried = state["start"], state["gone"], state["carried"]
