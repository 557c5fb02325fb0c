"""All analytic shapes of walls: the one list of them, and the choice among them at a feature.

A shape is a file beside this one, with what its ``Numbers`` are in its first lines, and two Warp functions in body axes,

    closest(q, radius, numbers)    closest point to q [m], unit direction from there to q, signed distance [m], and the weight
                                   of the contact [-]: 1 for a full one
    height(q, numbers)             signed distance [m], negative on the solid side; ``NO_SIDE`` where none is solid

Only the shapes that a scene has are compiled into its kernels.
"""

import functools
from typing import Any

import warp as wp
from warpdem.kernels.wall import plane, revolved, sphere
from warpdem.kernels.wall.surface import NO_SIDE, Numbers

SHAPES = {"plane": plane, "revolved": revolved, "sphere": sphere}
"""Every analytic shape by the name of its file; features of walls are in this order."""
NUMBER = {name: number for number, name in enumerate(SHAPES)}
"""Number of each shape, as ``Surface.shape`` has it."""


def _joined(before, number: int, closest):
    """``closest`` of shape ``number`` beside those of ``before`` (None: there are none)."""

    # no loop over the shapes: what ``wp.static`` takes from a loop does not count in the name under which Warp keeps a kernel
    @wp.func
    def closest_on_shape(shape: int, q: wp.vec3d, radius: wp.float64, numbers: Numbers):
        point = wp.vec3d()
        direction = wp.vec3d()
        distance = wp.float64(0.0)
        weight = wp.float64(1.0)
        if wp.static(before is not None):
            other_point, other_direction, other_distance, other_weight = before(shape, q, radius, numbers)
            point = other_point
            direction = other_direction
            distance = other_distance
            weight = other_weight
        if shape == wp.static(number):
            own_point, own_direction, own_distance, own_weight = closest(q, radius, numbers)
            point = own_point
            direction = own_direction
            distance = own_distance
            weight = own_weight
        return point, direction, distance, weight

    return closest_on_shape


@functools.cache
def build(names: tuple[str, ...]):
    """Return ``closest`` of whichever of the shapes of these names a feature is, None of none.

    It takes the number of the shape, a body point [m], the radius of the grain [m] and the numbers of the shape.
    """
    together = None
    for name in names:
        together = _joined(together, NUMBER[name], SHAPES[name].closest)
    return together


def _joined_heights(before, at: int, height_of):
    """``height`` of the shape of number ``at`` beside those of ``before`` (None: there are none)."""

    @wp.func
    def height_on_shape(shape: int, q: wp.vec3d, numbers: Numbers) -> wp.float64:
        distance = wp.float64(wp.static(NO_SIDE))
        if wp.static(before is not None):
            distance = before(shape, q, numbers)
        if shape == wp.static(at):
            distance = height_of(q, numbers)
        return distance

    return height_on_shape


height: Any = None
for _name, _shape in SHAPES.items():
    height = _joined_heights(height, NUMBER[_name], _shape.height)
