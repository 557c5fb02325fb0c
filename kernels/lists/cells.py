"""Grains sorted by size, each class of sizes on a grid of cells of its own, whose grains are linked in a list.

One grid has cells as wide as two of the largest grains reach; in such a cell lie as many small grains as fit into it, a
thousand at a size ratio of 10. On a grid of its own a class has cells as wide as two of *its* grains reach, and whoever looks
for neighbours asks the grids one after the other, each only as far as its own radius and the largest of that class reach.
With sizes within a factor of about two there is one class, and one grid.

A grid wraps around: cells that are a multiple of its size apart share a list, so that a grain far from the others costs no
memory. To find the grains near a place, walk the cells that the box around it overlaps, no cell twice:

    low, box = box_around(grids, size, place, half_width)
    for z in range(box[2]):
        for y in range(box[1]):
            line = line_of(grids, size, low, y, z)
            for x in range(box[0]):
                j = first_in(grids, size, line, low, x)
                while j >= 0:
                    ...
                    j = next_in(grids, j)

Making the lists takes one launch and no memory but their own, so that a branch of a captured graph can do it (``wp.HashGrid``
sorts, with memory that it asks for, and copies from the host). The order within a list is by chance on a GPU: nothing may
depend on it.
"""

import warp as wp


@wp.struct
class SizeGrids:
    """Classes of sizes, the largest first; see ``warpdem.filling.size_grids``."""

    # of each class; the radius of a grain may hold what it may move by
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
def wrapped(grids: SizeGrids, size: int, cell: wp.vec3i) -> wp.vec3i:
    """The cell within the grid whose list a cell shares."""
    cells = grids.cells[size]
    x = cell[0] % cells[0]
    y = cell[1] % cells[1]
    z = cell[2] % cells[2]
    return wp.vec3i(x + cells[0] if x < 0 else x, y + cells[1] if y < 0 else y, z + cells[2] if z < 0 else z)


@wp.func
def step(cell: int, steps: int, cells: int) -> int:
    """The cell ``steps`` further, up to once round, in one direction."""
    return cell + steps - cells if cell + steps >= cells else cell + steps


@wp.func
def line_of(grids: SizeGrids, size: int, low: wp.vec3i, y: int, z: int) -> int:
    """Number of the list of cell (0, y, z) counted from the cell ``low`` across x."""
    cells = grids.cells[size]
    return grids.first[size] + cells[0] * (step(low[1], y, cells[1]) + cells[1] * step(low[2], z, cells[2]))


@wp.func
def insert(grids: SizeGrids, i: int, place: wp.vec3d, radius: wp.float64):
    """Put grain ``i`` at the head of its cell's list."""
    size = class_of(grids, radius)
    cell = wrapped(grids, size, cell_of(grids, size, place))
    grids.next[i] = wp.atomic_exch(grids.head, line_of(grids, size, cell, 0, 0) + cell[0], i + 1)


@wp.func
def box_around(grids: SizeGrids, size: int, place: wp.vec3d, half_width: wp.float64):
    """First cell, within the grid, and number of different cells in each direction, of the box of this half width [m]."""
    corner = wp.vec3d(half_width, half_width, half_width)
    low = cell_of(grids, size, place - corner)
    box = wp.min(cell_of(grids, size, place + corner) - low + wp.vec3i(1, 1, 1), grids.cells[size])
    return wrapped(grids, size, low), box


@wp.func
def first_in(grids: SizeGrids, size: int, line: int, low: wp.vec3i, x: int) -> int:
    """First grain in the cell ``x`` further than ``low`` on a line of cells, -1 when there is none."""
    return grids.head[line + step(low[0], x, grids.cells[size][0])] - 1


@wp.func
def next_in(grids: SizeGrids, j: int) -> int:
    """Grain after ``j`` in its cell, -1 when it is the last."""
    return grids.next[j] - 1
