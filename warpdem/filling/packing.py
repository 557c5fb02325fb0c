"""Filling regions with grains: random positions, pushing apart while the grains grow, shaking where that is not enough.

A start, not a settled bed: nothing has weight here. The result has no overlap beyond `OVERLAP` between grains,
and none with the walls. How it is done:

* Random positions; the grains start small and grow to their size within a few steps, while each step parts those that
  overlap (``kernels/packing.py``) and moves those that reach into a wall back. Each grain repeats a fraction of its last
  move (heavy ball), which saves nine steps in ten in a dense packing. This reaches a solid fraction of 0.59 in a region of
  a dozen diameters, 0.61 where walls matter less.
* What stays jammed is shaken: the grains shrink to a fluid and grow again slowly, while their motion is kept at one
  mean speed instead of dying out, so that they move past each other (as in the event-driven growth of
  B. D. Lubachevsky, F. H. Stillinger, J. Stat. Phys. 60 (1990) 561, with soft pushes in place of collisions). Longer
  shaking reaches further; it ends when it no longer helps.

Fillings whose regions meet are packed together: none overlaps another, in whatever order they are given.
"""

import numpy as np

from warpdem.core import memory
from warpdem.filling.fill_region import Corners, closed_region
from warpdem.filling.fill_request import PACKING_BYTES, Filling, filling
from warpdem.filling.packing_run import Packing, PackingRun
from warpdem.filling.rigid_moves import PlacedClumps
from warpdem.mesh.triangle_mesh import TriangleMesh
from warpdem.scene.size_distribution import DiameterDistribution, size_law


def pack(
    fillings: list[Filling], fixed: tuple[np.ndarray, np.ndarray] | None = None
) -> tuple[list[np.ndarray | PlacedClumps], list[Packing]]:
    """Positions for the grains of all fillings: inside their regions and without overlap.

    Fillings whose regions meet are packed together, others by themselves. The same arguments give the same bits, on any
    number of threads.

    Args:
        fillings: What is to be placed.
        fixed: Positions [m], shape (m, 3), and radii [m], shape (m,), of grains that do not move; or None.

    Returns:
        Positions [m] of each filling, shape (n, 3), or the clumps; what each group took.

    Raises:
        SceneError: A grain without a position, or a solid fraction that cannot be reached; says what was reached.
    """
    position, radius = (np.zeros((0, 3)), np.zeros(0)) if fixed is None else fixed
    if fillings:
        grains = sum(len(request.radius) for request in fillings)
        keys = ", ".join(request.key for request in fillings)
        memory.require(grains * PACKING_BYTES, keys, f"packing {grains} grains", "ask for fewer or larger grains")
    positions: list[np.ndarray | PlacedClumps] = [np.zeros((0, 3))] * len(fillings)
    took = []
    for group in _meeting([request.region.bounds for request in fillings]):
        low = np.min([fillings[k].region.bounds[0] for k in group], axis=0)
        high = np.max([fillings[k].region.bounds[1] for k in group], axis=0)
        near = ((position + radius[:, None] > low) & (position - radius[:, None] < high)).all(axis=1)
        with PackingRun([fillings[k] for k in group], position[near], radius[near]) as packed:
            took.append(packed.run())
            for k, points in zip(group, packed.positions(), strict=True):
                positions[k] = points
    return positions, took


def fill(
    mesh: TriangleMesh | None,
    box: Corners | None,
    diameter: float | DiameterDistribution,
    seed: int,
    count: int | None = None,
    solid_fraction: float | None = None,
    key: str = "fill",
) -> tuple[np.ndarray, np.ndarray]:
    """One filling by itself: grains inside a closed mesh, a box, or the part of the mesh within the box.

    Args:
        mesh: Closed mesh to fill, or None.
        box: Least and greatest corner [m], shape (2, 3), or None for the whole mesh.
        diameter: Diameter of all grains [m], or a distribution.
        seed: Seed of the random numbers.
        count: Number of grains; exactly one of ``count`` and ``solid_fraction`` is given.
        solid_fraction: Volume of the grains over the volume of the region [-].
        key: Scene key, for messages.

    Returns:
        Positions [m], shape (n, 3), and radii [m], shape (n,), in the order in which sizes were drawn.

    Raises:
        SceneError: No space, a grain too large for it, or a solid fraction that cannot be reached.
    """
    request = filling(closed_region(mesh, box, key), size_law(diameter), seed, count, solid_fraction, key=key)
    [positions], _ = pack([request])
    assert isinstance(positions, np.ndarray)  # no clumps were asked for
    return positions, request.radius


def _meeting(bounds: list[np.ndarray]) -> list[list[int]]:
    """Groups of boxes (2, 3) [m] that meet, directly or through others: numbers in ascending order."""
    groups: list[list[int]] = []
    for k, (low, high) in enumerate(bounds):
        meets = [group for group in groups if any((bounds[i][0] < high).all() and (low < bounds[i][1]).all() for i in group)]
        groups = [group for group in groups if group not in meets] + [sorted([k, *(i for group in meets for i in group)])]
    return groups
