"""Borders and outlets where they stand: for the kernels, and for the start on the host."""

from collections.abc import Sequence

import numpy as np
import warp as wp

from warpdem.errors import SceneError
from warpdem.kernels.step.region import BOX, CYLINDER, MESH, REGION_AT, SPHERE, Region, Regions
from warpdem.mesh.solid import Bounded, MeshSolid
from warpdem.model.schedule import Schedule
from warpdem.scene.regions import Box, CylinderRegion, Placed, PlaneRegion


class Exits:
    """Regions in which grains leave the domain.

    Args:
        shapes: shape of each, in its own axes.
        places: what each is at rest in.
        keys: its key in the scene, for messages.
        schedule: motions; those of the regions are added to it.

    Raises:
        SceneError: a mesh of several bodies.
    """

    def __init__(
        self, shapes: Sequence[Bounded | PlaneRegion], places: Sequence[Placed], keys: Sequence[str], schedule: Schedule
    ) -> None:
        self._shapes, self._schedule = shapes, schedule
        self._motion = [schedule.motion_of(place) for place in places]
        self._carriers = [schedule.carrier(place) for place in places]
        for shape, key in zip(shapes, keys, strict=True):
            if isinstance(shape, MeshSolid) and shape.mesh.bodies is not None:
                raise SceneError(
                    f"{key}.mesh.file: {shape.mesh.name}: the mesh of an outlet must be one closed body, and this one has "
                    "several that may lie in each other: give an outlet for each"
                )
        self._trees: list[wp.Mesh] = []

    def left_by(self, position: np.ndarray) -> np.ndarray:
        """Number of the region that each position (n, 3) [m] is in at time 0, -1 if none; shape (n,)."""
        out = np.full(len(position), -1)
        for number in reversed(range(len(self._shapes))):
            place = position
            if (carrier := self._carriers[number]) is not None:
                axes, origin = self._schedule.place(carrier, 0.0)
                place = (position - origin) @ axes
            out[self._shapes[number].holds(place)] = number
        return out

    def on_device(self, device: wp.Device) -> Regions:
        """The regions as the kernels see them."""
        rows = np.zeros((len(self._shapes), REGION_AT.width))
        solids = [shape for shape in self._shapes if isinstance(shape, MeshSolid)]
        for row, shape, motion in zip(rows, self._shapes, self._motion, strict=True):
            row[REGION_AT.motion] = motion
            if isinstance(shape, MeshSolid):
                row[[REGION_AT.kind, REGION_AT.mesh]] = MESH, solids.index(shape)
            else:
                _write(row, shape)
        regions, bounds = Regions(), np.array([solid.bounds for solid in solids]).reshape(-1, 2, 3)
        centre, size = bounds.mean(axis=1), np.ptp(bounds, axis=1).max(axis=1, initial=0.0)
        self._trees = [_tree(*one, device) for one in zip(solids, centre, size, strict=True)]
        counts = [0, *(len(solid.mesh.triangles) for solid in solids)]
        regions.region = wp.array(rows, dtype=Region, device=device)
        regions.tree = wp.array(np.array([tree.id for tree in self._trees], dtype=np.uint64), dtype=wp.uint64, device=device)
        regions.size = wp.array(size, dtype=wp.float64, device=device)
        regions.first = wp.array(np.cumsum(counts)[:-1].astype(np.int32), dtype=wp.int32, device=device)
        corners = np.concatenate([np.zeros((0, 3, 3)), *(solid.mesh.vertices[_outward(solid)] for solid in solids)])
        regions.corner = wp.array(corners, dtype=wp.mat33d, device=device)
        for name, points in (("centre", centre), ("low", bounds[:, 0]), ("high", bounds[:, 1])):
            setattr(regions, name, wp.array(np.ascontiguousarray(points), dtype=wp.vec3d, device=device))
        return regions


def _write(row: np.ndarray, shape: Bounded | PlaneRegion) -> None:
    """Write a shape to its row of numbers."""
    point, axis = (slice(first, first + 3) for first in (REGION_AT.point, REGION_AT.axis))
    if isinstance(shape, Box):
        row[REGION_AT.kind], row[point], row[axis] = BOX, shape.min, shape.max
    elif isinstance(shape, CylinderRegion):
        row[REGION_AT.kind], row[point], row[axis] = CYLINDER, shape.point, shape.axis
        row[[REGION_AT.radius, REGION_AT.start, REGION_AT.end]] = shape.radius, *shape.ends
    elif isinstance(shape, PlaneRegion):
        row[REGION_AT.kind], row[point], row[axis] = CYLINDER, shape.point, shape.normal
        row[[REGION_AT.radius, REGION_AT.start, REGION_AT.end]] = shape.radius or np.inf, 0.0, np.inf
    else:
        assert not isinstance(shape, MeshSolid)
        row[REGION_AT.kind], row[point], row[REGION_AT.radius] = SPHERE, shape.centre, shape.radius


def _outward(solid: MeshSolid) -> np.ndarray:
    """Corner numbers of the triangles (t, 3), wound so that normals point outwards."""
    triangles = solid.mesh.triangles
    return np.ascontiguousarray(triangles if solid.mesh.volume >= 0.0 else triangles[:, ::-1])


def _tree(solid: MeshSolid, centre: np.ndarray, size: float, device: wp.Device) -> wp.Mesh:
    """Search tree of a mesh in unit coordinates."""
    unit = ((solid.mesh.vertices - centre) / size).astype(np.float32)
    return wp.Mesh(
        points=wp.array(unit, dtype=wp.vec3, device=device),
        indices=wp.array(_outward(solid).astype(np.int32).ravel(), dtype=wp.int32, device=device),
        support_winding_number=True,
    )
