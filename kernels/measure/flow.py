r"""Flow through planes: the mass whose centre crosses a plane in a step, counted along its normal.

    M = sum m (side(q_k+1) - side(q_k)),     side(q) = 1 where (q - p) . n >= 0, else 0

A plane with a radius counts only what crosses within that distance of its point; the place of crossing is taken on the
straight way of the step. A plane at rest in the laboratory looks at places there. No crossing is missed or counted twice,
whatever the interval of the output, and a grain that goes back is counted back.
"""

import functools

import warp as wp
from warpdem.kernels.contact.columns import Columns
from warpdem.kernels.step.schedule import FrameRow, frame_axes, frame_origin

PLANE_AT = Columns(
    (
        ("point", 3),  # [m]
        ("normal", 3),  # unit vector
        ("radius", 1),  # [m]
        ("in_laboratory", 1),  # 1 if it rests in the laboratory
    )
)
Plane = PLANE_AT.vector(wp.float64)


@wp.func
def vector_of(plane: Plane, first: int) -> wp.vec3d:
    """Vector of a plane from this column on."""
    return wp.vec3d(plane[first], plane[first + 1], plane[first + 2])


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
            if plane[wp.static(PLANE_AT.in_laboratory)] > wp.float64(0.0):
                old = in_laboratory(before, frames, at)
                new = in_laboratory(after, frames, next)
            point = vector_of(plane, wp.static(PLANE_AT.point))
            normal = vector_of(plane, wp.static(PLANE_AT.normal))
            here = wp.dot(old - point, normal)
            there = wp.dot(new - point, normal)
            sign = wp.float64(0.0)
            if here < wp.float64(0.0) and there >= wp.float64(0.0):
                sign = wp.float64(1.0)
            if here >= wp.float64(0.0) and there < wp.float64(0.0):
                sign = wp.float64(-1.0)
            if sign != wp.float64(0.0):
                crossing = old + (new - old) * (here / (here - there))
                if wp.length(crossing - point) <= plane[wp.static(PLANE_AT.radius)]:
                    flow_out[i, 2 * p] = flow_out[i, 2 * p] + sign * mass
                    flow_out[i, 2 * p + 1] = flow_out[i, 2 * p + 1] + sign

    return count
