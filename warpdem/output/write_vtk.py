"""Results as VTK files: one VTP per frame and body, one PVD that gives them their times; and the way back.

The arrays are those of ``result_arrays``. The contact network has files and an index of its own, so that it can be left out.

Everything stands in frame axes. The field data of each grain file tell where the frame stood, so that a reader can show
the laboratory view: x_lab = frame_rotation x + frame_translation (rotation row by row; frame_spin and frame_velocity in
frame axes; one row of frame_parts for each motion), and gravity in laboratory axes [m/s2]. All numbers are float64: a frame
can start a new scene (but holds no friction history). A wall file holds the load on the wall at its time: force [N] and
pressure [Pa] of each triangle, and force, torque [N m] about the point torque_about [m], and power [W] of the whole as field
data.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import quote

import numpy as np

from warpdem.core.pose import Placement
from warpdem.core.snapshot import ClumpShots, ContactNetwork, Snapshot, WallLoad, WallMesh
from warpdem.output.pieces import remove_pieces
from warpdem.output.pvd_index import Entry, read_index, write_index
from warpdem.output.result_arrays import (
    clump_arrays,
    contact_arrays,
    frame_arrays,
    grain_arrays,
    triangle_arrays,
    wall_arrays,
)
from warpdem.output.vtk_files import add_array, cells_of, polydata, save

if TYPE_CHECKING:
    from vtkmodules.vtkCommonDataModel import vtkPolyData

INDEX, CONTACT_INDEX, CLUMP_INDEX = "result.pvd", "contacts.pvd", "clumps.pvd"
INDICES = {"grains": INDEX, "contacts": CONTACT_INDEX, "clumps": CLUMP_INDEX}
"""Index of the files of each kind."""
WALLS = "walls"
"""Group of the walls in the index; that of other files is what they hold."""
PIECES = "result_vtk"
"""Folder of the pieces of frames that several ranks write."""


class VtkWriter:
    """Write ``grains_000000.vtp`` ... and ``wall_NAME_000000.vtp`` ... with ``result.pvd``.

    A wall gets a new file when it has moved in frame axes, and in every frame if the snapshots hold its load; otherwise the
    index repeats the last one. With ``contacts`` the contact network is written beside them: ``contacts_000000.vtp`` ... with
    ``contacts.pvd``; with ``clumps`` the clumps, a point each: ``clumps_000000.vtp`` ... with ``clumps.pvd``. Of frames in
    pieces (``VtkPieceWriter``) it writes walls and indices, where each piece is a part of its own.
    """

    def __init__(
        self, folder: Path, walls: list[WallMesh], *, contacts: bool = False, clumps: bool = False, resume: bool = False
    ):
        """Prepare the folder.

        Args:
            folder: Where the files go; made if it is missing.
            walls: The mesh walls, each in its body axes.
            contacts: Whether the snapshots hold the contact network.
            clumps: Whether the snapshots hold clumps.
            resume: Keep the frames of an earlier run that come before the first new one.
        """
        self._folder = Path(folder)
        self._folder.mkdir(parents=True, exist_ok=True)
        if not resume:
            remove_pieces(self._folder / PIECES, "*.vtp")
        self._walls = walls
        self._names = ["grains", *["contacts"] * contacts, *["clumps"] * clumps]
        paths = {name: self._folder / INDICES[name] for name in self._names}
        self._entries = {name: read_index(path) if resume and path.exists() else [] for name, path in paths.items()}
        self._frame: int | None = None
        self._wall_files: dict[str, tuple[Placement, str]] = {}

    def write(self, snapshot: Snapshot) -> None:
        """Write one frame; when this returns the index holds it."""
        number = self._number(snapshot.time)
        files = {name: [f"{name}_{number:06d}.vtp"] for name in self._names}
        for name, (file,) in files.items():
            save(polydata_of(name, snapshot), self._folder / file)
        self._add(snapshot, files)

    def join(self, around: Snapshot, pieces: Sequence[dict[str, int]]) -> None:
        """As ``write``, of a frame whose grains, contacts and clumps are in pieces that ``VtkPieceWriter`` has written.

        Args:
            around: The frame; its grains, contacts and clumps are not looked at.
            pieces: What those writers gave, in the order of their parts.
        """
        number = self._number(around.time)
        files = {
            name: [piece_file(name, number, part) for part, rows in enumerate(pieces) if rows[name] or part == 0]
            for name in self._names
        }
        self._add(around, files)

    def _number(self, time: float) -> int:
        """Number of the frame at ``time``; of those before it, only earlier ones are kept."""
        if self._frame is None:
            self._frame = frames_before(self._entries["grains"], time)
            self._entries = {name: [one for one in of if one.time < time] for name, of in self._entries.items()}
        return self._frame

    def _add(self, snapshot: Snapshot, files: dict[str, list[str]]) -> None:
        """Write the walls of a frame and add it to the indices; ``files`` that are there by what they hold."""
        time, entries = snapshot.time, self._entries["grains"]
        for name, of in files.items():
            beyond = len(self._walls) if name == "grains" else 0  # the walls are parts 1, 2 ...
            self._entries[name] += [Entry(time, part and beyond + part, name, file, name) for part, file in enumerate(of)]
        for part, wall in enumerate(self._walls, start=1):
            file = self._write_wall(wall, snapshot.walls[wall.name], snapshot.loads.get(wall.name))
            entries.append(Entry(time, part, wall.name, file, WALLS))
        for name in [*self._names[1:], "grains"]:  # last: a frame of theirs has its contacts and clumps
            write_index(self._folder / INDICES[name], self._entries[name])
        assert self._frame is not None
        self._frame += 1

    def close(self) -> None:
        """Nothing is held back: every frame is on disk when ``write`` returns."""

    def _write_wall(self, wall: WallMesh, placement: Placement, load: WallLoad | None) -> str:
        """Name of the file that shows the wall at this placement with its load, written if there is none."""
        if load is None and wall.name in self._wall_files:
            last, file = self._wall_files[wall.name]
            if np.array_equal(last.rotation, placement.rotation) and np.array_equal(
                last.translation, placement.translation
            ):
                return file
        file = f"wall_{quote(wall.name, safe='')}_{self._frame:06d}.vtp"
        vertices = wall.vertices @ placement.rotation.T + placement.translation
        save(_wall_polydata(replace(wall, vertices=vertices), load), self._folder / file)
        self._wall_files[wall.name] = (placement, file)
        return file


def frames_before(entries: list[Entry], time: float) -> int:
    """Number of frames that an index has before ``time`` [s]."""
    return len({entry.time for entry in entries if entry.time < time})


def piece_file(name: str, number: int, part: int) -> str:
    """File of a piece of a frame, from the folder of the indices: the grains, contacts or clumps of one rank."""
    return f"{PIECES}/{name}_{number:06d}_{part}.vtp"


def polydata_of(name: str, snapshot: Snapshot) -> vtkPolyData:
    """The grains, contacts or clumps of a frame."""
    if name == "grains":
        return _grains_polydata(snapshot)
    if name == "contacts":
        assert snapshot.contacts is not None
        return _contacts_polydata(snapshot.contacts)
    assert snapshot.clumps is not None
    return _clumps_polydata(snapshot.clumps)


def _grains_polydata(snapshot: Snapshot) -> vtkPolyData:
    count = len(snapshot.id)
    data = polydata(snapshot.position)
    # a vertex cell for each grain: without cells ParaView shows nothing
    data.SetVerts(cells_of(1, np.arange(count)))
    for name, values in grain_arrays(snapshot).items():
        add_array(data.GetPointData(), name, values)
    for name, values in frame_arrays(snapshot).items():
        add_array(data.GetFieldData(), name, values)
    return data


def _clumps_polydata(clumps: ClumpShots) -> vtkPolyData:
    data = polydata(clumps.position)
    data.SetVerts(cells_of(1, np.arange(len(clumps.id))))
    for name, values in clump_arrays(clumps).items():
        add_array(data.GetPointData(), name, values)
    return data


def _contacts_polydata(network: ContactNetwork) -> vtkPolyData:
    ends, arrays = contact_arrays(network)
    data = polydata(ends)
    data.SetLines(cells_of(2, np.arange(len(ends))))
    for name, values in arrays.items():
        add_array(data.GetCellData(), name, values)
    return data


def _wall_polydata(wall: WallMesh, load: WallLoad | None) -> vtkPolyData:
    data = polydata(wall.vertices)
    data.SetPolys(cells_of(3, wall.triangles))
    if wall.infinite:
        add_array(data.GetFieldData(), "infinite", np.array([1]))
    if load is not None:
        if len(load.pressure):
            for name, values in triangle_arrays(load).items():
                add_array(data.GetCellData(), name, values)
        for name, values in wall_arrays(load).items():
            add_array(data.GetFieldData(), name, np.atleast_2d(values))
    return data
