r"""Flow through planes: the mass whose centre crosses a plane in a step, counted along its normal.

    M = sum m (side(q_k+1) - side(q_k)),     side(q) = 1 where (q - p) . n >= 0, else 0

A plane with a radius counts only what crosses within that distance of its point; the place of crossing is taken on the
straight way of the step. A plane at rest in the laboratory looks at places there. No crossing is missed or counted twice,
whatever the interval of the output, and a grain that goes back is counted back.
"""

import functools

import warp as wp
from warpdem.kernels.step.schedule import FrameRow, frame_axes, frame_origin

Plane = wp.types.vector(8, wp.float64)
"""Point (0..2) [m], unit normal (3..5), radius (6) [m], 1 if it rests in the laboratory (7)."""


@functools.cache
def build(*, moving_frame: bool):
    """Return ``count``; ``moving_frame``: the frame moves, and there are rows that tell how."""

    @wp.func
    def in_laboratory(q: wp.vec3d, frames: wp.array(dtype=FrameRow), at: int) -> wp.vec3d:
        place = q
        if wp.static(moving_frame):
            place = frame_axes(frames[at]) * q + frame_origin(frames[at])
        return place

    @wp.func
    def count(
        i: int, before: wp.vec3d, after: wp.vec3d, mass: wp.float64, planes: wp.array(dtype=Plane),
        frames: wp.array(dtype=FrameRow), at: int, next: int, flow_out: wp.array2d(dtype=wp.float64),
    ):  # fmt: skip
        """Add what grain ``i`` carries through each plane: mass [kg] and number, 2 columns a plane."""
        for p in range(planes.shape[0]):
            plane = planes[p]
            old = before
            new = after
            if plane[7] > wp.float64(0.0):
                old = in_laboratory(before, frames, at)
                new = in_laboratory(after, frames, next)
            point = wp.vec3d(plane[0], plane[1], plane[2])
            normal = wp.vec3d(plane[3], plane[4], plane[5])
            here = wp.dot(old - point, normal)
            there = wp.dot(new - point, normal)
            sign = wp.float64(0.0)
            if here < wp.float64(0.0) and there >= wp.float64(0.0):
                sign = wp.float64(1.0)
            if here >= wp.float64(0.0) and there < wp.float64(0.0):
                sign = wp.float64(-1.0)
            if sign != wp.float64(0.0):
                crossing = old + (new - old) * (here / (here - there))
                if wp.length(crossing - point) <= plane[6]:
                    flow_out[i, 2 * p] = flow_out[i, 2 * p] + sign * mass
                    flow_out[i, 2 * p + 1] = flow_out[i, 2 * p + 1] + sign

    return count
