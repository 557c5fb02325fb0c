"""A normal law with numbers of its own, called once per contact in the form that all laws have in the engine."""

import functools

import numpy as np
import warp as wp
from warpdem.kernels.contact import normal_law


@functools.cache
def _kernels(module, real):
    of = normal_law.build(real, module, predicted=False)

    @wp.kernel(module="unique", enable_backward=False)
    def constants(
        c: wp.array(dtype=of.Coefficients), radius: wp.array(dtype=real), mass: wp.array(dtype=real),
        closeness: wp.array(dtype=real), out: wp.array(dtype=of.Constants),
    ):  # fmt: skip
        t = wp.tid()
        out[t] = of.constants(c[t], radius[t], mass[t], closeness[t])

    @wp.kernel(module="unique", enable_backward=False)
    def force(
        overlap: wp.array(dtype=real), before: wp.array(dtype=real), speed: wp.array(dtype=real),
        k: wp.array(dtype=of.Constants), c: wp.array(dtype=of.Coefficients), history: wp.array(dtype=of.History),
        out: wp.array2d(dtype=real), now: wp.array(dtype=of.History), losses: wp.array2d(dtype=real),
    ):  # fmt: skip
        t = wp.tid()
        f_n, load, dashpot, k_n, gamma_t, depth, depth_before, own, squeezed, drag = of.force(
            overlap[t], before[t], speed[t], k[t], c[t], history[t], real(0.0)
        )
        out[t, 0] = f_n
        out[t, 1] = load
        out[t, 2] = dashpot
        out[t, 3] = k_n
        out[t, 4] = depth
        out[t, 5] = depth_before
        out[t, 6] = squeezed
        out[t, 7] = drag
        now[t] = own
        lost = of.lost(overlap[t], before[t], k[t], history[t], own)
        for f in range(wp.static(len(of.losses))):
            losses[t, f] = lost[f]

    return of, constants, force


class Contacts:
    """Contacts of two materials under a normal law; one for each overlap given.

    Args:
        module: the law.
        coefficients: what its ``coefficients`` returns.
        radius: R* [m].
        mass: m* [kg].
        closeness: 1/(R_i + R_j), 0 at a wall [1/m].
        real: precision.
    """

    def __init__(self, module, coefficients, radius, mass=1.0, closeness=0.0, real=wp.float64) -> None:
        self._of, constants, self._force = _kernels(module, real)
        self._real, at = real, self._of.at
        row = np.zeros(at.width)
        row[:4], row[7:] = coefficients[:4], coefficients[4:]
        self._row = row
        inputs = [
            self._array([row], self._of.Coefficients),
            *(self._array([x], real) for x in (radius, mass, closeness)),
        ]
        out = wp.zeros(1, dtype=self._of.Constants, device="cpu")
        wp.launch(constants, dim=1, inputs=[*inputs, out], device="cpu")
        self.constants = out.numpy()[0].astype(float)
        """Stiffness, damping, 1/m*, then the law's own."""

    def _array(self, values, dtype):
        return wp.array(np.asarray(values, np.float32 if self._real is wp.float32 else float), dtype=dtype, device="cpu")

    def force(self, overlap, before=None, speed=0.0, history=None) -> dict[str, np.ndarray]:
        """What the law gives at ``overlap`` [m], shape (n,), and ``before`` a step earlier; ``history`` (n, m) after it.

        With the LOSSES of the step [J], each under its name.
        """
        overlap = np.atleast_1d(np.asarray(overlap, float))
        before = np.broadcast_to(overlap if before is None else before, overlap.shape)
        n, width = len(overlap), self._of.History._length_
        past = np.zeros((n, width)) if history is None else np.broadcast_to(history, (n, width))
        inputs = [
            *(self._array(np.broadcast_to(x, (n,)), self._real) for x in (overlap, before, speed)),
            self._array(np.tile(self.constants, (n, 1)), self._of.Constants),
            self._array(np.tile(self._row, (n, 1)), self._of.Coefficients),
            self._array(past, self._of.History),
        ]
        out, now = wp.zeros((n, 8), dtype=self._real, device="cpu"), wp.zeros(n, dtype=self._of.History, device="cpu")
        lost = wp.zeros((n, len(self._of.losses)), dtype=self._real, device="cpu")
        wp.launch(self._force, dim=n, inputs=[*inputs, out, now, lost], device="cpu")
        names = ("force", "load", "dashpot", "k_n", "depth", "depth_before", "squeezed", "drag")
        found = zip((*names, *self._of.losses), np.hstack([out.numpy(), lost.numpy()]).astype(float).T, strict=True)
        return dict(found) | {"history": now.numpy().astype(float)}
