"""Kernels that make a packing: which grains are near each other, and pushing overlapping grains apart.

One Jacobi step moves grain i by

    dx_i = sum_j  r_j / (r_i + r_j) * overlap_ij * n_ij / sqrt(contacts of i)

with n_ij from j to i; a grain that is held fast moves its partner by the whole overlap. A pair alone is parted to just
touching whatever the sizes; the square root lies between the full sum, which overshoots in a dense packing, and the
mean, which creeps.

A packing is geometry, not mechanics: no forces, no friction, and no float atomics, so equal input gives equal bits. All kernels
are needed by every packing, so they are one module.
"""

import warp as wp
from warpdem.kernels import MODULE_OPTIONS
from warpdem.kernels.clump import build as build_clumps
from warpdem.kernels.lists import cells
from warpdem.kernels.lists.cells import SizeGrids

wp.set_module_options(MODULE_OPTIONS)
of_clumps = build_clumps(True)


@wp.kernel(enable_backward=False)
def count_in_cells(
    grids: SizeGrids,
    # grains, read [m]
    position: wp.array[wp.vec3d],
    radius: wp.array[wp.float64],
):
    """Count the grains in their cells; on a CPU one thread does it."""
    i = wp.tid()
    cells.count(grids, i, position[i], radius[i])


@wp.kernel(enable_backward=False)
def sort_by_cell(grids: SizeGrids):
    """Put the grains in their places; on a CPU one thread does it, and the grains of a cell ascend."""
    cells.put(grids, wp.tid())


@wp.kernel(enable_backward=False)
def list_neighbours(
    first: wp.int32,
    grids: SizeGrids,
    # grains, read [m]
    position: wp.array[wp.vec3d],
    radius: wp.array[wp.float64],
    clump: wp.array[wp.int32],  # of each grain, of ``clump``: members of one are no neighbours; of size 0 without clumps
    material: wp.array[wp.int32],  # of each grain
    through: wp.array2d[wp.int32],  # 1 of two materials that pass through each other; of size 0: there are none
    skin: wp.float64,
    start: wp.array[wp.int32],  # of the room for each grain's row in the table
    # written: neighbours within r_i + r_j + skin, how many there are (also when there is no room for them),
    # largest overlap as a fraction of the smaller radius [-] (0 when none), and with which grain (-1 when none)
    neighbour_out: wp.array[wp.int32],
    count_out: wp.array[wp.int32],
    overlap_out: wp.array[wp.float64],
    partner_out: wp.array[wp.int32],
):
    """List the neighbours of each grain and find its worst overlap."""
    i = first + wp.tid()
    x = position[i]
    r = radius[i]
    count = wp.int32(0)
    worst = wp.float64(0.0)
    partner = wp.int32(-1)
    for size in range(grids.largest.shape[0]):
        low, box = cells.box_around(grids, size, x, r + grids.largest[size] + skin)
        runs = cells.runs_of(grids, size, low, box)
        for cz in range(box[2]):
            for cy in range(box[1]):
                line = cells.line_of(grids, size, low, cy, cz)
                for part in range(runs):
                    begin, end = cells.run(grids, size, line, low, box, part)
                    for e in range(begin, end):
                        j = grids.grain[e]
                        touch = r + radius[j]
                        apart = x - position[j]
                        square = wp.dot(apart, apart)
                        # most candidates are out of reach: they need no square root
                        near = square < (touch + skin) * (touch + skin) and j != i
                        if near and clump.shape[0] > 0:
                            near = not of_clumps.same_clump(clump, i, j)
                        if near and through.shape[0] > 0:
                            near = through[material[i], material[j]] == 0
                        if near:
                            if count < start[i + 1] - start[i]:
                                neighbour_out[start[i] + count] = j
                            count += 1
                            overlap = (touch - wp.sqrt(square)) / wp.min(r, radius[j])
                            if overlap > worst:
                                worst = overlap
                                partner = j
    count_out[i] = count
    overlap_out[i] = worst
    partner_out[i] = partner


@wp.kernel(enable_backward=False)
def push_apart(
    first: wp.int32,
    # grains, read [m]; those from number `loose` on are held fast; `growth` scales all radii [-]
    position: wp.array[wp.vec3d],
    radius: wp.array[wp.float64],
    loose: wp.int32,
    growth: wp.float64,
    start: wp.array[wp.int32],
    neighbour: wp.array[wp.int32],
    count: wp.array[wp.int32],
    # written: move [m], and largest overlap of the grown grains as a fraction of the smaller grown radius [-]
    move_out: wp.array[wp.vec3d],
    overlap_out: wp.array[wp.float64],
):
    """Move of each grain that parts it from those it overlaps."""
    i = first + wp.tid()
    x = position[i]
    r = radius[i] * growth
    move = wp.vec3d()
    contacts = wp.float64(0.0)
    worst = wp.float64(0.0)
    for k in range(start[i], start[i] + count[i]):
        j = neighbour[k]
        r_j = radius[j] * growth
        apart = x - position[j]
        square = wp.dot(apart, apart)
        if square < (r + r_j) * (r + r_j):
            distance = wp.sqrt(square)
            overlap = r + r_j - distance
            # grains that coincide are parted along x, the lower number to the left
            normal = wp.vec3d(wp.where(i < j, wp.float64(-1.0), wp.float64(1.0)), wp.float64(0.0), wp.float64(0.0))
            if distance > wp.float64(0.0):
                normal = apart / distance
            fraction = wp.where(j < loose, r_j / (r + r_j), wp.float64(1.0))
            move += normal * (overlap * fraction)
            contacts += wp.float64(1.0)
            worst = wp.max(worst, overlap / wp.min(r, r_j))
    if contacts > wp.float64(0.0):
        move /= wp.sqrt(contacts)
    move_out[i] = move
    overlap_out[i] = worst
