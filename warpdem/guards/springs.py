"""Contacts as linear springs and dashpots, as the guard of the time step takes them."""

from dataclasses import dataclass, replace

import numpy as np

from warpdem.kernels.contact.normal_law import NORMAL_CAP, TANGENTIAL_CAP

CAPS = np.array([[NORMAL_CAP], [TANGENTIAL_CAP]])


@dataclass(frozen=True)
class Springs:
    """Contacts as linear springs and dashpots between rows of grains; row n is the walls."""

    i: np.ndarray
    j: np.ndarray
    normal: np.ndarray
    """From j to i, shape (c, 3)."""
    stiffness: np.ndarray
    """Along the normal and across [N/m], shape (2, c)."""
    dashpot_slope: np.ndarray
    """Slopes that the dashpots are reduced by [N/m], shape (2, c): below ``stiffness`` where a law unloads more steeply."""
    damping: np.ndarray
    """Of the law, along the normal and across [N s/m], shape (2, c)."""
    mass: np.ndarray
    """That moves along the normal and across [kg], shape (2, c)."""
    arm: np.ndarray
    """From the centres of i and j to the contact [m], shape (2, c)."""

    def acting(self, dt: float) -> np.ndarray:
        """Damping coefficients that act at time step ``dt`` [s], shape (2, c)."""
        reduction = 1.0 + self.dashpot_slope * dt**2 / (2.0 * self.mass)
        return self.damping / np.maximum(reduction, self.damping * dt / (CAPS * self.mass))

    def subset(self, which: np.ndarray) -> "Springs":
        """The contacts ``which``."""
        return Springs(
            self.i[which], self.j[which], self.normal[which], self.stiffness[:, which], self.dashpot_slope[:, which],
            self.damping[:, which], self.mass[:, which], self.arm[:, which],
        )  # fmt: skip

    def between(self, i: np.ndarray, j: np.ndarray) -> "Springs":
        """The same between rows ``i`` and ``j``."""
        return replace(self, i=i, j=j)
