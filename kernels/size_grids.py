"""Grains sorted by size, each class of sizes on a hash grid of its own.

One grid has cells as wide as two of the largest grains reach; in such a cell lie as many small grains as fit into it, a
thousand at a size ratio of 10. On a grid of its own a class has cells as wide as two of *its* grains reach, and whoever looks
for neighbours asks the grids one after the other, each only as far as its own radius and the largest of that class reach.
With sizes within a factor of about two there is one class, and one grid.
"""

import warp as wp


@wp.struct
class SizeGrids:
    """Grains in order of class, the largest first; see ``warpdem.size_grids``."""

    grid: wp.array(dtype=wp.uint64)  # of each class; its point p is grain first + p
    first: wp.array(dtype=wp.int32)
    largest: wp.array(dtype=wp.float64)  # radius in each class [m]
    sphere: wp.array(dtype=wp.vec4d)  # position and radius [m]: all that most candidates are asked for
    slot: wp.array(dtype=wp.int32)  # where the grain is among the others
