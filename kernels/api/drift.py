"""Kick and drift of the grains, and how far they have moved."""

import functools

import numpy as np
import warp as wp
from warpdem.kernels import MODULE_OPTIONS, KernelSet, grain
from warpdem.kernels.api.grains import Grains, Load, Pair, Record
from warpdem.kernels.integrator import exact_drift
from warpdem.kernels.step import motion
from warpdem.kernels.step.schedule import FrameRow, Row


@functools.cache
def motion_kernels() -> KernelSet:
    """Kernels that know no contact law."""
    kernel = functools.partial(wp.kernel, enable_backward=False, module="unique", module_options=MODULE_OPTIONS)
    g = grain.build(True)
    acceleration_of = motion.build_acceleration((), spins=True, relative=False)
    advance, _ = exact_drift.build(spins=True, rotating_frame=False, moving_frame=False)
    Numbers = motion.Numbers

    @kernel
    def move(
        record: wp.array(dtype=Record), load: wp.array(dtype=Load), inverse: wp.array(dtype=Pair), row: wp.array(dtype=Row),
        frames: wp.array(dtype=FrameRow), numbers: wp.array(dtype=Numbers), dt: wp.float64, store: wp.array2d(dtype=wp.vec3d),
    ):  # fmt: skip
        """Kick and drift of one grain per thread."""
        i = wp.tid()
        a, b = acceleration_of(record[i], load[i], inverse[i], row[0], frames, 0, dt, numbers)
        record[i] = advance(0, i, record[i], a, b, row[0], frames, 0, dt, store)

    @kernel
    def displaced(
        record: wp.array(dtype=Record), reference: wp.array(dtype=wp.vec3d), most: wp.float64, out: wp.array(dtype=wp.int32)
    ):  # fmt: skip
        """Set ``out`` when a grain is further than ``most`` [m] from its reference, or no number."""
        i = wp.tid()
        if not (wp.length(g.position(record[i]) - reference[i]) <= most):
            out[0] = 1

    return KernelSet(move=move, displaced=displaced)


@functools.cache
def step_row(dt: float, acceleration: tuple[float, float, float], first: bool, device: str) -> wp.array:
    """What the kernels must know of a step in axes at rest, ``schedule.Row``, shape (1,)."""
    numbers = np.zeros(29)
    numbers[0], numbers[1], numbers[2:5] = 0.0 if first else dt, 0.5 * dt if first else dt, acceleration
    return wp.array(numbers[None], dtype=Row, device=device)


def drift(grains: Grains, dt: float, gravity=(0.0, 0.0, 0.0)) -> None:
    """Kick by the load and gravity, then drift: V += dt (F/m + g), q += dt V; the first kick is half a step.

    Args:
        grains: whose ``load`` is that of the present time; positions are those of the next step afterwards.
        dt: time step [s], the same in all steps.
        gravity: [m/s2].
    """
    device = grains.device
    row = step_row(float(dt), tuple(float(g) for g in gravity), grains.steps == 0, device.alias)
    frames, store = wp.zeros(0, dtype=FrameRow, device=device), wp.zeros((0, 0), dtype=wp.vec3d, device=device)
    numbers = wp.zeros(0, dtype=motion.Numbers, device=device)
    inputs = [grains.record, grains.load, grains.inverse, row, frames, numbers, dt, store]
    wp.launch(motion_kernels().move, len(grains), inputs, device=device)
    grains.steps += 1
