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
import shutil
from collections.abc import Sequence
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
from warpdem.output.vtkhdf_joined import JoinedSeries
from warpdem.output.vtkhdf_series import Placed, Series

GRAINS, WALLS, CONTACTS = "result.vtkhdf", "result_walls.vtkhdf", "result_contacts.vtkhdf"
CLUMPS = "result_clumps.vtkhdf"
PIECES = "result_vtkhdf"
"""Folder of the pieces of frames that several ranks write, with a folder for each."""


class VtkhdfWriter:
    """Write ``result.vtkhdf`` and its companions."""

    def __init__(
        self, folder: Path, walls: list[WallMesh], *, contacts: bool = False, clumps: bool = False, resume: bool = False,
        pieces: bool = False,
    ):  # fmt: skip
        """Prepare the folder.

        Args:
            folder: Where the files go; made if it is missing.
            walls: The walls to draw, each in its body axes.
            contacts: Whether the snapshots hold the contact network.
            clumps: Whether the snapshots hold clumps.
            resume: Keep the frames of an earlier run that come before the first new one.
            pieces: Whether the frames are joined of pieces.
        """
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        self._walls = walls
        self._shapes = Series(folder / WALLS, "Polygons", 3, resume=resume) if walls else None
        # the grains come last: a frame of theirs has its walls, contacts and clumps
        kinds = {CONTACTS: ("Lines", 2)} if contacts else {}
        kinds |= {CLUMPS: ("Vertices", 1)} if clumps else {}
        kinds |= {GRAINS: ("Vertices", 1)}
        self._series, self._joined = {}, {}
        if not resume:
            shutil.rmtree(folder / PIECES, ignore_errors=True)  # a run with more ranks would go on with what is there
        if pieces:
            self._joined = {
                name: JoinedSeries(folder / name, f"{PIECES}/{{}}/{name}", *kind, resume=resume) for name, kind in kinds.items()
            }
        else:
            self._series = {name: Series(folder / name, *kind, resume=resume) for name, kind in kinds.items()}
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
        for name, series in self._series.items():
            _write(name, series, snapshot)

    def join(self, around: Snapshot, pieces: Sequence[dict[str, Placed]]) -> None:
        """As ``write``, of a frame whose grains, contacts and clumps are in pieces that ``VtkhdfPieceWriter`` has written.

        Args:
            around: The frame; its grains, contacts and clumps are not looked at.
            pieces: What those writers gave, in the order of their parts.
        """
        if self._shapes is not None:
            self._write_walls(self._shapes, around)
        for name, joined in self._joined.items():
            joined.write(around.time, [piece[name] for piece in pieces], frame_arrays(around) if name == GRAINS else {})

    @property
    def placed(self) -> dict[str, Placed]:
        """Where the last frame is in each file but that of the walls."""
        return {name: series.placed for name, series in self._series.items()}

    def close(self) -> None:
        """Close the files; every frame is on disk already."""
        for series in (*self._series.values(), self._shapes):
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


class VtkhdfPieceWriter:
    """Write the files of one rank, ``result_vtkhdf/PART/result.vtkhdf`` and its companions: each can be read by itself."""

    def __init__(self, folder: Path, part: int, *, contacts: bool = False, clumps: bool = False, resume: bool = False):
        """Prepare the folder; arguments as of ``VtkhdfWriter``, ``part`` is the number of the rank."""
        there = folder / PIECES / str(part)
        self._writer = VtkhdfWriter(there, [], contacts=contacts, clumps=clumps, resume=resume)

    def write(self, piece: Snapshot) -> dict[str, Placed]:
        """Write the piece of one frame; returns where it is.

        Raises:
            OutputError: A file cannot be written.
        """
        self._writer.write(piece)
        return self._writer.placed


def _write(name: str, series: Series, snapshot: Snapshot) -> None:
    """Write the grains, contacts or clumps of a frame."""
    if name == CONTACTS:
        assert snapshot.contacts is not None
        points, cells = contact_arrays(snapshot.contacts)
        series.write(snapshot.time, points, cells=len(points) // 2, cell_data=cells)
    elif name == CLUMPS:
        assert snapshot.clumps is not None
        clumps = snapshot.clumps
        series.write(snapshot.time, clumps.position, cells=len(clumps.id), point_data=clump_arrays(clumps))
    else:
        position, arrays, fields = snapshot.position, grain_arrays(snapshot), frame_arrays(snapshot)
        series.write(snapshot.time, position, cells=len(snapshot.id), point_data=arrays, field_data=fields)


def _placed(vertices: np.ndarray, placement: Placement) -> np.ndarray:
    return np.asarray(vertices @ placement.rotation.T + placement.translation)


def _padded(values: np.ndarray, rows: int) -> np.ndarray:
    return values if len(values) else np.zeros((rows, *values.shape[1:]))
