"""Results as VTKHDF: all frames of the grains in one file, those of the walls and of the contacts in one each beside it.

    result.vtkhdf            the grains; arrays and field data as in the VTP files
    result_walls.vtkhdf      all drawn walls: triangles with wall (number in the attribute ``walls`` of the file), force and
                             pressure; force, torque, torque_about and power of each wall as rows of field data
    result_contacts.vtkhdf   the contact network, if the scene asks for it
    result_clumps.vtkhdf     the clumps, a point each, if the scene has any

Each is a temporal PolyData of VTKHDF 2.3, which ParaView reads as it stands (composite types with time are read too, but their
reader does not follow the time that is asked for; so there are several files, not one). An array that did not change
since the frame before is not stored again. A frame is there for a reader as a whole or not at all: see
`warpdem.core.journaled_file`.
"""

import json
from pathlib import Path

import numpy as np

from warpdem.core.pose import Placement
from warpdem.core.snapshot import Snapshot, WallMesh
from warpdem.output.result_arrays import (
    WALL_ARRAYS,
    clump_arrays,
    contact_arrays,
    frame_arrays,
    grain_arrays,
    triangle_arrays,
)
from warpdem.output.vtkhdf_series import Series

GRAINS, WALLS, CONTACTS = "result.vtkhdf", "result_walls.vtkhdf", "result_contacts.vtkhdf"
CLUMPS = "result_clumps.vtkhdf"


class VtkhdfWriter:
    """Write ``result.vtkhdf`` and its companions."""

    def __init__(
        self, folder: Path, walls: list[WallMesh], *, contacts: bool = False, clumps: bool = False, resume: bool = False
    ):
        """Prepare the folder.

        Args:
            folder: Where the files go; made if it is missing.
            walls: The walls to draw, each in its body axes.
            contacts: Whether the snapshots hold the contact network.
            clumps: Whether the snapshots hold clumps.
            resume: Keep the frames of an earlier run that come before the first new one.
        """
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        self._walls = walls
        self._grains = Series(folder / GRAINS, "Vertices", 1, resume=resume)
        self._shapes = Series(folder / WALLS, "Polygons", 3, resume=resume) if walls else None
        self._lines = Series(folder / CONTACTS, "Lines", 2, resume=resume) if contacts else None
        self._bodies = Series(folder / CLUMPS, "Vertices", 1, resume=resume) if clumps else None
        # what does not change from wall to wall and from frame to frame
        sizes = [len(wall.triangles) for wall in walls]
        self._number = np.repeat(np.arange(len(walls), dtype=np.int32), sizes)
        corners = np.cumsum([0, *(len(wall.vertices) for wall in walls)])
        self._triangles = [wall.triangles + first for wall, first in zip(walls, corners, strict=False)]

    def write(self, snapshot: Snapshot) -> None:
        """Write one frame; when this returns every file holds it.

        Raises:
            OutputError: A file cannot be written; it then holds the frames before this one.
        """
        if self._shapes is not None:
            self._write_walls(self._shapes, snapshot)
        if self._lines is not None and snapshot.contacts is not None:
            points, cells = contact_arrays(snapshot.contacts)
            self._lines.write(snapshot.time, points, cells=len(points) // 2, cell_data=cells)
        if self._bodies is not None and snapshot.clumps is not None:
            clumps = snapshot.clumps
            self._bodies.write(snapshot.time, clumps.position, cells=len(clumps.id), point_data=clump_arrays(clumps))
        # the grains come last: a frame of theirs has its walls, contacts and clumps
        position, count = snapshot.position, len(snapshot.id)
        fields = frame_arrays(snapshot)
        self._grains.write(snapshot.time, position, cells=count, point_data=grain_arrays(snapshot), field_data=fields)

    def close(self) -> None:
        """Close the files; every frame is on disk already."""
        for series in (self._grains, self._shapes, self._lines, self._bodies):
            if series is not None:
                series.close()

    def _write_walls(self, shapes: Series, snapshot: Snapshot) -> None:
        placed = [_placed(wall.vertices, snapshot.walls[wall.name]) for wall in self._walls]
        cell_data, field_data = (
            {"wall": self._number},
            {"infinite": np.array([wall.infinite for wall in self._walls], np.int8)},
        )
        if snapshot.loads:
            loads = [snapshot.loads[wall.name] for wall in self._walls]
            rows = [len(wall.triangles) for wall in self._walls]
            # walls that are not meshes have a load of their own but none of their triangles
            of_walls = [triangle_arrays(load) for load in loads]
            for name in dict.fromkeys(name for arrays in of_walls for name in arrays):
                own = [arrays.get(name, np.zeros(0)) for arrays in of_walls]
                cell_data[name] = np.concatenate([_padded(values, n) for values, n in zip(own, rows, strict=True)])
            for entry in WALL_ARRAYS:
                field_data[entry.name] = np.array([getattr(load, entry.field) for load in loads])
        shapes.write(
            snapshot.time, np.concatenate(placed), cells=np.concatenate(self._triangles), cell_data=cell_data,
            field_data=field_data, about={"walls": json.dumps([wall.name for wall in self._walls])},
        )  # fmt: skip


def _placed(vertices: np.ndarray, placement: Placement) -> np.ndarray:
    return np.asarray(vertices @ placement.rotation.T + placement.translation)


def _padded(values: np.ndarray, rows: int) -> np.ndarray:
    return values if len(values) else np.zeros((rows, *values.shape[1:]))
