"""The clumps of a run at one time."""

import numpy as np

from warpdem.core.snapshot import ClumpShots
from warpdem.kernels import grain
from warpdem.kernels.clump import NONE
from warpdem.state.view import RunView
from warpdem.usd.motion import conjugate, multiply_quaternions


def read_clumps(view: RunView) -> ClumpShots:
    """The clumps of a run that has some, at the time of the view."""
    state, clumps = view.state, view.state.clumps
    assert clumps is not None
    view.reader.read()  # writes their motion
    slots, first = clumps.in_order(state.rank)
    reading, pose = clumps.reading.numpy()[slots], view.model.schedule.pose(view.clock.time)
    record = clumps.record.numpy()[slots]
    position = record[:, grain.POSITION]
    axes = conjugate(clumps.axes[slots]).astype(float)
    return ClumpShots(
        id=state.id.numpy()[first],
        type=clumps.template[slots],
        members=clumps.count.numpy()[slots],
        mass=1.0 / clumps.rate.numpy()[slots, 0],
        radius=record[:, grain.RADIUS],
        position=position,
        orientation=multiply_quaternions(clumps.turn.numpy()[slots], axes),
        velocity=reading[:, :3] - pose.velocity_at(position),
        spin=reading[:, 3:6] - pose.spin,
        angular_momentum=reading[:, 6:].copy(),
    )


def of_grains(view: RunView) -> np.ndarray:
    """Id of the clump of each grain, -1 for a grain of its own, shape (n,), in order of the ids of the grains."""
    state, clumps = view.state, view.state.clumps
    assert clumps is not None
    of = clumps.of_grain.numpy()[state.rank]
    first = state.id.numpy()[clumps.first.numpy()]
    return np.where(of == NONE, np.int64(-1), first[of])
