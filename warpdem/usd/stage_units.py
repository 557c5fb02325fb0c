"""Units and axes of a stage: its numbers in SI and in the scene's axes."""

from dataclasses import dataclass
from decimal import Decimal
from typing import Any

import numpy as np

from warpdem.usd.stage import TO_Z_UP


@dataclass(frozen=True)
class StageUnits:
    """How lengths, masses and vectors of a stage become those of a scene.

    Numbers in single precision are read as decimals, so that 0.01 metres per unit must be a decimal too.
    """

    up: np.ndarray
    """Rotation from the stage's axes to the scene's, shape (3, 3)."""
    metres: float
    """Per unit of length."""
    kilograms: float
    """Per unit of mass."""

    @classmethod
    def of(cls, content: dict[str, Any]) -> "StageUnits":
        """Those that the reader found."""
        return cls(TO_Z_UP[content["up"]], content["metres"], content["kilograms"])

    def convert(self, value: float, length: int = 0, mass: int = 0) -> float:
        """A number of the stage in SI, given the exponents of length and mass in its unit."""
        return float(Decimal(repr(value)) * Decimal(repr(self.metres)) ** length * Decimal(repr(self.kilograms)) ** mass)

    def place(self, matrix: Any, point: Any) -> np.ndarray:
        """A point of a prim, by its local-to-world ``matrix`` (4, 4), in the scene [m], shape (3,)."""
        whole = np.array(matrix)
        return np.asarray(self.up @ (whole[:3, :3] @ np.array(point) + whole[:3, 3]) * self.metres)

    def rotation(self, matrix: Any) -> np.ndarray | None:
        """Rotation from a prim's axes to the scene's, shape (3, 3); None where its ``matrix`` scales unequally or mirrors."""
        linear = self.up @ np.array(matrix)[:3, :3]
        factor = float(np.cbrt(np.linalg.det(linear)))
        if factor <= 0.0 or np.abs(linear @ linear.T - factor**2 * np.eye(3)).max() > 1e-6 * factor**2:
            return None
        return np.asarray(linear / factor)
