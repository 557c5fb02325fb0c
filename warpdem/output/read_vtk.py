"""Reads the VTK results of a folder back: frames, walls and their arrays."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from warpdem.core.snapshot import Snapshot, WallMesh
from warpdem.errors import WarpdemError
from warpdem.output.pieces import in_rows, joined, joined_grains, order_by_id, order_of_contacts
from warpdem.output.pvd_index import Entry, read_index
from warpdem.output.result_arrays import snapshot_of
from warpdem.output.vtk_files import load_polydata, points_of
from warpdem.output.write_vtk import CLUMP_INDEX, CONTACT_INDEX, INDEX, WALLS


@dataclass(frozen=True)
class Results:
    """What a folder of results holds; frames are read when asked for."""

    folder: Path
    times: np.ndarray
    """Time of each frame [s], shape (frame_count,), ascending."""
    files: list[dict[str, Path]]
    """For each frame the wall files by wall name."""
    grain_files: list[list[Path]]
    """For each frame the file of the grains, or the pieces of the ranks."""
    clump_files: dict[float, list[Path]] = field(default_factory=dict)
    """Files of the clumps by time [s], as those of the grains; empty without any."""
    contact_files: dict[float, list[Path]] = field(default_factory=dict)
    """Files of the contact network by time [s], as those of the grains; empty without any."""

    def frame(self, k: int) -> Snapshot:
        """Snapshot of frame ``k``; its ``walls`` is empty, since wall files hold vertices that are in place already."""
        return joined_grains([read_frame(path) for path in self.grain_files[k]])

    def walls(self, k: int) -> list[WallMesh]:
        """Mesh walls at frame ``k``, vertices in frame axes."""
        return [read_wall(name, path) for name, path in self.files[k].items()]

    def fields(self, k: int, wall: str = "") -> dict[str, np.ndarray]:
        """Arrays of the grains at frame ``k``, or those of the triangles of a wall, by name; vectors in frame axes."""
        if wall:
            return read_fields(self.files[k][wall])
        fields = joined([read_fields(path) for path in self.grain_files[k]])
        return in_rows(fields, order_by_id(fields["id"])) if "id" in fields else fields

    def clumps(self, k: int) -> dict[str, np.ndarray]:
        """Arrays of the clumps at frame ``k`` by name, with their centres as ``position``, (c, 3) [m]; empty without clumps."""
        if float(self.times[k]) not in self.clump_files:
            return {}
        paths = self.clump_files[float(self.times[k])]
        clumps = joined([{**read_fields(path), "position": points_of(load_polydata(path))} for path in paths])
        return in_rows(clumps, order_by_id(clumps["id"]))

    @property
    def has_contacts(self) -> bool:
        """Whether the results hold the contact network."""
        return bool(self.contact_files)

    def contacts(self, k: int) -> dict[str, np.ndarray]:
        """Arrays of the contact network at frame ``k`` by name, with the two ends of each line as ``points``, (c, 2, 3) [m]."""
        time = float(self.times[k])
        if time not in self.contact_files:
            raise WarpdemError(f"{self.folder}: {CONTACT_INDEX} has no contacts at {time:g} s")
        paths = self.contact_files[time]
        contacts = joined(
            [{**read_fields(path), "points": points_of(load_polydata(path)).reshape(-1, 2, 3)} for path in paths]
        )
        return in_rows(contacts, order_of_contacts(contacts) if len(paths) > 1 else None)


def read_results(folder: Path) -> Results:
    """Index of the results in ``folder``.

    Raises:
        WarpdemError: There is no index, it cannot be read, or it holds no frame.
    """
    folder = Path(folder)
    index = folder / INDEX
    if not index.exists():
        raise WarpdemError(f'{folder}: no {INDEX} in this folder; run a scene with "vtk" among its output formats')
    entries = read_index(index)
    grains = _by_time([entry for entry in entries if entry.group != WALLS], folder)
    if not grains:
        raise WarpdemError(f"{index}: holds no frame")
    walls: dict[float, dict[str, Path]] = {time: {} for time in grains}
    for entry in entries:
        if entry.group == WALLS and entry.time in walls:
            walls[entry.time][entry.name] = folder / entry.file
    times = sorted(grains)
    clumps, contacts = (
        _by_time(read_index(beside), folder) if beside.exists() else {}
        for beside in (folder / CLUMP_INDEX, folder / CONTACT_INDEX)
    )
    return Results(
        folder, np.array(times), [walls[time] for time in times], [grains[time] for time in times], clumps, contacts
    )


def _by_time(entries: list[Entry], folder: Path) -> dict[float, list[Path]]:
    """The files of each time."""
    found: dict[float, list[Path]] = {}
    for entry in entries:
        found.setdefault(entry.time, []).append(folder / entry.file)
    return found


def read_frame(path: Path) -> Snapshot:
    """Snapshot held by one grain file.

    Raises:
        WarpdemError: The file is missing, broken, or not a grain file of warpdem.
    """
    from vtkmodules.util.numpy_support import vtk_to_numpy

    data = load_polydata(path)
    arrays = ({g.GetArrayName(k): vtk_to_numpy(g.GetArray(k)) for k in range(g.GetNumberOfArrays())} for g in
              (data.GetPointData(), data.GetFieldData()))  # fmt: skip
    return snapshot_of(path, points_of(data), *arrays)


def read_wall(name: str, path: Path) -> WallMesh:
    """Mesh wall held by one wall file, vertices as they stand in frame axes.

    Raises:
        WarpdemError: The file is missing or broken.
    """
    from vtkmodules.util.numpy_support import vtk_to_numpy

    data = load_polydata(path)
    triangles = vtk_to_numpy(data.GetPolys().GetConnectivityArray()).reshape(-1, 3).astype(np.int32)
    return WallMesh(name, points_of(data), triangles, bool(data.GetFieldData().HasArray("infinite")))


def read_fields(path: Path) -> dict[str, np.ndarray]:
    """What a file says of each grain or of each triangle, by the name of the array, shapes (n,) or (n, components).

    Raises:
        WarpdemError: The file is missing or broken.
    """
    from vtkmodules.util.numpy_support import vtk_to_numpy

    data = load_polydata(path)
    groups = (data.GetPointData(), data.GetCellData())
    return {g.GetArrayName(k): vtk_to_numpy(g.GetArray(k)) for g in groups for k in range(g.GetNumberOfArrays())}
