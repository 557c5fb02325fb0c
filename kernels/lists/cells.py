"""Grains sorted by size, each class of sizes on a grid of cells of its own, whose grains stand one after the other.

One grid has cells as wide as two of the largest grains reach; in such a cell lie as many small grains as fit into it, a
thousand at a size ratio of 10. On a grid of its own a class has cells as wide as two of *its* grains reach, and whoever looks
for neighbours asks the grids one after the other, each only as far as its own radius and the largest of that class reach.
With sizes within a factor of about two there is one class, and one grid.

A grid wraps around: cells that are a multiple of its size apart share their grains, so that a grain far from the others costs
no memory. The grains of a line of cells along x stand one after the other, so that those of neighbouring cells on it are one
run of ``SizeGrids.grain``, or two where the line goes round. To find the grains near a place, go through the runs of the box
around it, which hold no cell twice:

    if count_of(grids, size) > 0:
        low, box = box_around(grids, size, place, half_width)
        for z in range(box[2]):
            for y in range(box[1]):
                line = line_of(grids, size, low, y, z)
                for part in range(runs_of(grids, size, low, box)):
                    begin, end = run(grids, size, line, low, box, part)
                    for e in range(begin, end):
                        j = grids.grain[e]

Sorting takes three launches and no memory but the grids' own, so that a branch of a captured graph can do it: ``count`` each
grain in its cell, ``start_lines``, ``put`` each grain in its place. On a CPU one thread does it, and the grains of a cell
ascend. The order within a cell, and of the lines, is by chance on a GPU: nothing may depend on it.
"""

import warp as wp
from warpdem.kernels import MODULE_OPTIONS

wp.set_module_options(MODULE_OPTIONS)

SPARE = 8  # entries behind the sorted grains that a CPU may read
COPIED = 5  # numbers that a CPU copies of each: position, radius, allowance [m]


@wp.struct
class SizeGrids:
    """Classes of sizes, the largest first; see ``warpdem.filling.size_grids``."""

    # of each class; the radius of a grain may hold what it may move by
    largest: wp.array(dtype=wp.float64)  # radius [m]
    per_length: wp.array(dtype=wp.float64)  # cells [1/m]
    cells: wp.array(dtype=wp.vec3i)  # in each direction
    first: wp.array(dtype=wp.int32)  # entry in ``end`` of its first line of cells
    # of each line one entry more than it has cells: where its grains begin, and where those of each of its cells end
    end: wp.array(dtype=wp.int32)
    # grains that have a place, of all classes and of each
    placed: wp.array(dtype=wp.int32)
    cell: wp.array(dtype=wp.int32)  # (n,) of each grain the entry of its cell in ``end``
    grain: wp.array(dtype=wp.int32)  # (n + SPARE,) the grains sorted by cell
    copies: wp.array2d(dtype=wp.float64)  # (COPIED, n + SPARE) numbers of the sorted grains; of size 0 where nobody asks
    lines: wp.int32  # of all classes


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
    """The cell within the grid whose grains a cell shares."""
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
    """First entry of the line of cells (y, z) counted from the cell ``low``."""
    cells = grids.cells[size]
    return grids.first[size] + (cells[0] + 1) * (step(low[1], y, cells[1]) + cells[1] * step(low[2], z, cells[2]))


@wp.func
def count(grids: SizeGrids, i: int, place: wp.vec3d, radius: wp.float64):
    """Count grain ``i`` in its cell."""
    size = class_of(grids, radius)
    cell = wrapped(grids, size, cell_of(grids, size, place))
    entry = line_of(grids, size, cell, 0, 0) + cell[0] + 1
    grids.cell[i] = entry
    wp.atomic_add(grids.end, entry, 1)


@wp.kernel(enable_backward=False)
def start_lines(first: int, grids: SizeGrids):
    """Where the grains of each line of cells begin, and those of each of its cells; a thread per line."""
    line = first + wp.tid()
    size = int(0)
    while line >= grids.cells[size][1] * grids.cells[size][2]:
        line -= grids.cells[size][1] * grids.cells[size][2]
        size += 1
    cells = grids.cells[size][0]
    entry = grids.first[size] + (cells + 1) * line
    total = int(0)
    for x in range(1, cells + 1):
        total += grids.end[entry + x]
    begin = wp.atomic_add(grids.placed, 0, total)
    wp.atomic_add(grids.placed, 1 + size, total)
    grids.end[entry] = begin
    for x in range(1, cells + 1):
        here = grids.end[entry + x]
        grids.end[entry + x] = begin
        begin += here


@wp.func
def put(grids: SizeGrids, i: int) -> int:
    """Put grain ``i`` in its place among the sorted ones and return that; the end of its cell moves on."""
    e = wp.atomic_add(grids.end, grids.cell[i], 1)
    grids.grain[e] = i
    return e


@wp.func
def count_of(grids: SizeGrids, size: int) -> int:
    """Grains of a class."""
    return grids.placed[1 + size]


@wp.func
def box_around(grids: SizeGrids, size: int, place: wp.vec3d, half_width: wp.float64):
    """First cell, within the grid, and number of different cells in each direction, of the box of this half width [m]."""
    corner = wp.vec3d(half_width, half_width, half_width)
    low = cell_of(grids, size, place - corner)
    box = wp.min(cell_of(grids, size, place + corner) - low + wp.vec3i(1, 1, 1), grids.cells[size])
    return wrapped(grids, size, low), box


@wp.func
def runs_of(grids: SizeGrids, size: int, low: wp.vec3i, box: wp.vec3i) -> int:
    """Runs of a line of the box: two where it goes round."""
    return 2 if low[0] + box[0] > grids.cells[size][0] else 1


@wp.func
def run(grids: SizeGrids, size: int, line: int, low: wp.vec3i, box: wp.vec3i, part: int):
    """Where run ``part`` of a line of the box begins and ends in ``SizeGrids.grain``."""
    cells = grids.cells[size][0]
    begin = low[0] if part == 0 else 0
    end = wp.min(low[0] + box[0], cells) if part == 0 else low[0] + box[0] - cells
    return grids.end[line + begin], grids.end[line + end]
