"""Lists that hold until a grain has moved by half the skin."""

import numpy as np
import warp as wp
from warpdem.kernels.api.contact_law import ContactLaw, build_kernels
from warpdem.kernels.api.drift import motion_kernels
from warpdem.kernels.api.grains import Grains


class ListedGrains:
    """What was listed for grains at a reference position, and holds until one has moved by half the skin."""

    def __init__(self, grains: Grains, law: ContactLaw, skin: float) -> None:
        self.grains, self.law, self.skin, self.rebuilds = grains, law, skin, 0
        self.kernels = build_kernels(*law.models, law.torsion, law.gap)
        self._table = law.coefficients(grains.device)
        self._allowance = wp.full(len(grains), 0.5 * skin, dtype=wp.float64, device=grains.device)
        self._flag = wp.zeros(1, dtype=wp.int32, device=grains.device)
        self._reference: wp.array | None = None

    def launch(self, kernel, size: int, inputs: list) -> None:
        """Launch over ``size`` threads on the device of the grains."""
        wp.launch(kernel, size, inputs, device=self.grains.device)

    def ints(self, shape, fill: int = 0) -> wp.array:
        """Array of int32 of one value on the device of the grains."""
        return wp.full(shape, fill, dtype=wp.int32, device=self.grains.device)

    def listed(self):
        """What the list kernels read of the grains; every material touches."""
        g, out = self.grains, self.kernels.neighbors.ListedGrains()
        out.record, out.inverse, out.material, out.id = g.record, g.inverse, g.material, g.id
        out.through, out.owned = self.ints((0, 0)), len(g)
        return out

    def outdated(self) -> bool:
        """Whether a grain has moved by more than half the skin since the list was made; waits for the device.

        Raises:
            ValueError: a position is no number.
        """
        if self._reference is None:
            return True
        self._flag.zero_()
        inputs = [self.grains.record, self._reference, 0.5 * self.skin, self._flag]
        self.launch(motion_kernels().displaced, len(self.grains), inputs)
        if not self._flag.numpy()[0]:
            return False
        if not np.isfinite(self.grains.position.numpy()).all():
            raise ValueError("the position of a grain is no number")
        return True

    def update(self) -> bool:
        """Make the list if it is outdated; whether it was."""
        if not len(self.grains) or not self.outdated():
            return False
        self._make()
        self._reference = wp.clone(self.grains.position.contiguous())
        self.rebuilds += 1
        return True
