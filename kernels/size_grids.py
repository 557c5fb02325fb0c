"""Grains sorted by size, each class of sizes on a grid of cells of its own, whose grains are linked in a list.

One grid has cells as wide as two of the largest grains reach; in such a cell lie as many small grains as fit into it, a
thousand at a size ratio of 10. On a grid of its own a class has cells as wide as two of *its* grains reach, and whoever looks
for neighbours asks the grids one after the other, each only as far as its own radius and the largest of that class reach.
With sizes within a factor of about two there is one class, and one grid.

A grid wraps around: cells that are a multiple of its size apart share a list, so that a grain far from the others costs no
memory. To find the grains near a place, walk the lists of the cells that the box around it overlaps, no cell twice.

Making the lists takes one launch and no memory but their own, so that a branch of a captured graph can do it (``wp.HashGrid``
sorts, with memory that it asks for, and copies from the host). The order within a list is by chance on a GPU: nothing may
depend on it.
"""

import warp as wp


@wp.struct
class SizeGrids:
    """Classes of sizes, the largest first; see ``warpdem.filling.size_grids``."""

    # of each class
    largest: wp.array(dtype=wp.float64)  # radius [m]
    per_length: wp.array(dtype=wp.float64)  # cells [1/m]
    cells: wp.array(dtype=wp.vec3i)  # in each direction
    first: wp.array(dtype=wp.int32)  # number of its first cell
    # of each cell: 1 + the grain at its list's head, 0 when it is empty
    head: wp.array(dtype=wp.int32)
    # of each grain: 1 + the grain that follows it in its cell's list, 0 at the end
    next: wp.array(dtype=wp.int32)


@wp.func
def class_of(grids: SizeGrids, radius: wp.float64) -> int:
    """Class of a grain of this radius [m]."""
    size = int(0)
    while size + 1 < grids.largest.shape[0] and radius <= grids.largest[size + 1]:
        size += 1
    return size


@wp.func
def cell_of(grids: SizeGrids, size: int, place: wp.vec3d) -> wp.vec3i:
    """Cell that a place lies in, not wrapped."""
    s = grids.per_length[size]
    return wp.vec3i(int(wp.floor(place[0] * s)), int(wp.floor(place[1] * s)), int(wp.floor(place[2] * s)))


@wp.func
def wrapped(cell: int, cells: int) -> int:
    """Number of a cell within the grid, in one direction."""
    rest = cell % cells
    return rest + cells if rest < 0 else rest


@wp.func
def following(cell: int, cells: int) -> int:
    """The next cell in one direction: a division less than to wrap it."""
    return cell + 1 if cell + 1 < cells else 0


@wp.func
def insert(grids: SizeGrids, i: int, place: wp.vec3d, radius: wp.float64):
    """Put grain ``i`` at the head of its cell's list."""
    size = class_of(grids, radius)
    cells = grids.cells[size]
    cell = cell_of(grids, size, place)
    x = wrapped(cell[0], cells[0])
    y = wrapped(cell[1], cells[1])
    z = wrapped(cell[2], cells[2])
    grids.next[i] = wp.atomic_exch(grids.head, grids.first[size] + x + cells[0] * (y + cells[1] * z), i + 1)
