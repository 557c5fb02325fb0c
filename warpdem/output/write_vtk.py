"""Results as VTK files: one VTP per frame and body, one PVD that gives them their times; and the way back.

The arrays are those of ``result_arrays``. The contact network has files and an index of its own, so that it can be left out.

Everything stands in frame axes. The field data of each grain file tell where the frame stood, so that a reader can show
the laboratory view: x_lab = frame_rotation x + frame_translation (rotation row by row; frame_spin and frame_velocity in
frame axes; one row of frame_parts for each motion), and gravity in laboratory axes [m/s2]. All numbers are float64: a frame
can start a new scene (but holds no friction history). A wall file holds the load on the wall at its time: force [N] and
pressure [Pa] of each triangle, and force, torque [N m] about the point torque_about [m], and power [W] of the whole as field
data.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from urllib.parse import quote
from xml.etree import ElementTree
from xml.sax.saxutils import quoteattr

import numpy as np

from warpdem.core.atomic_file import not_written, replaced
from warpdem.core.snapshot import ContactNetwork, Placement, Snapshot, WallLoad, WallMesh
from warpdem.core.vtk_header import overclaim
from warpdem.errors import WarpdemError
from warpdem.output.result_arrays import (
    contact_arrays,
    frame_arrays,
    grain_arrays,
    snapshot_of,
    triangle_arrays,
    wall_arrays,
)

INDEX, CONTACT_INDEX = "result.pvd", "contacts.pvd"


@dataclass(frozen=True)
class Entry:
    """One line of the index."""

    time: float
    part: int
    name: str
    file: str


class VtkWriter:
    """Write ``grains_000000.vtp`` ... and ``wall_NAME_000000.vtp`` ... with ``result.pvd``.

    A wall gets a new file when it has moved in frame axes, and in every frame if the snapshots hold its load; otherwise the
    index repeats the last one. With ``contacts`` the contact network is written beside them: ``contacts_000000.vtp`` ... with
    ``contacts.pvd``.
    """

    def __init__(self, folder: Path, walls: list[WallMesh], *, contacts: bool = False, resume: bool = False):
        """Prepare the folder.

        Args:
            folder: Where the files go; made if it is missing.
            walls: The mesh walls, each in its body axes.
            contacts: Whether the snapshots hold the contact network.
            resume: Keep the frames of an earlier run that come before the first new one.
        """
        self._folder = Path(folder)
        self._folder.mkdir(parents=True, exist_ok=True)
        self._walls = walls
        names = [INDEX, CONTACT_INDEX] if contacts else [INDEX]
        paths = {name: self._folder / name for name in names}
        self._entries = {name: read_index(path) if resume and path.exists() else [] for name, path in paths.items()}
        self._frame: int | None = None
        self._wall_files: dict[str, tuple[Placement, str]] = {}

    def write(self, snapshot: Snapshot) -> None:
        """Write one frame; when this returns the index holds it."""
        if self._frame is None:
            kept = {name: [entry for entry in entries if entry.time < snapshot.time] for name, entries in self._entries.items()}
            self._entries, self._frame = kept, len({entry.time for entry in kept[INDEX]})
        if CONTACT_INDEX in self._entries:
            name = f"contacts_{self._frame:06d}.vtp"
            save(_contacts_polydata(snapshot.contacts), self._folder / name)
            self._entries[CONTACT_INDEX].append(Entry(snapshot.time, 0, "contacts", name))
            write_index(self._folder / CONTACT_INDEX, self._entries[CONTACT_INDEX])
        name = f"grains_{self._frame:06d}.vtp"
        save(_grains_polydata(snapshot), self._folder / name)
        entries = self._entries[INDEX]
        entries.append(Entry(snapshot.time, 0, "grains", name))
        for part, wall in enumerate(self._walls, start=1):
            file = self._write_wall(wall, snapshot.walls[wall.name], snapshot.loads.get(wall.name))
            entries.append(Entry(snapshot.time, part, wall.name, file))
        write_index(self._folder / INDEX, self._entries[INDEX])
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


def write_index(path: Path, entries: list[Entry]) -> None:
    """Write a PVD file."""
    lines = [
        f'<DataSet timestep="{entry.time!r}" group="{"walls" if entry.part else entry.name}" part="{entry.part}"'
        f" name={quoteattr(entry.name)} file={quoteattr(entry.file)}/>"
        for entry in entries
    ]
    text = "\n".join(['<VTKFile type="Collection" version="0.1">', "<Collection>", *lines, "</Collection>"])
    with replaced(path) as part:
        part.write_text(f'<?xml version="1.0"?>\n{text}\n</VTKFile>\n', encoding="utf-8")


@dataclass(frozen=True)
class Results:
    """What a folder of results holds; frames are read when asked for."""

    folder: Path
    times: np.ndarray
    """Time of each frame [s], shape (frame_count,), ascending."""
    files: list[dict[str, Path]]
    """For each frame the wall files by wall name, and the grain file under ``""``."""

    def frame(self, k: int) -> Snapshot:
        """Snapshot of frame ``k``; its ``walls`` is empty, since wall files hold vertices that are in place already."""
        return read_frame(self.files[k][""])

    def walls(self, k: int) -> list[WallMesh]:
        """Mesh walls at frame ``k``, vertices in frame axes."""
        return [read_wall(name, path) for name, path in self.files[k].items() if name]

    def fields(self, k: int, wall: str = "") -> dict[str, np.ndarray]:
        """Arrays of the grains at frame ``k``, or those of the triangles of a wall, by name; vectors in frame axes."""
        return read_fields(self.files[k][wall])


@contextmanager
def quiet_vtk() -> Iterator[None]:
    """Keep VTK's own messages off the screen."""
    from vtkmodules.vtkCommonCore import vtkLogger

    before = vtkLogger.GetCurrentVerbosityCutoff()
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
    try:
        yield
    finally:
        vtkLogger.SetStderrVerbosity(before)


def read_results(folder: Path) -> Results:
    """Index of the results in ``folder``.

    Raises:
        WarpdemError: There is no index, it cannot be read, or it holds no frame.
    """
    folder = Path(folder)
    index = folder / INDEX
    if not index.exists():
        raise WarpdemError(f'{folder}: no {INDEX} in this folder; run a scene with "vtk" among its output formats')
    frames: dict[float, dict[str, Path]] = {}
    for entry in read_index(index):
        frames.setdefault(entry.time, {})[entry.name if entry.part else ""] = folder / entry.file
    if not frames:
        raise WarpdemError(f"{index}: holds no frame")
    times = sorted(frames)
    return Results(folder, np.array(times), [frames[time] for time in times])


def read_frame(path: Path) -> Snapshot:
    """Snapshot held by one grain file.

    Raises:
        WarpdemError: The file is missing, broken, or not a grain file of warpdem.
    """
    from vtkmodules.util.numpy_support import vtk_to_numpy

    data = _load(path)
    arrays = ({g.GetArrayName(k): vtk_to_numpy(g.GetArray(k)) for k in range(g.GetNumberOfArrays())} for g in
              (data.GetPointData(), data.GetFieldData()))  # fmt: skip
    return snapshot_of(path, _points(data), *arrays)


def read_wall(name: str, path: Path) -> WallMesh:
    """Mesh wall held by one wall file, vertices as they stand in frame axes.

    Raises:
        WarpdemError: The file is missing or broken.
    """
    from vtkmodules.util.numpy_support import vtk_to_numpy

    data = _load(path)
    triangles = vtk_to_numpy(data.GetPolys().GetConnectivityArray()).reshape(-1, 3).astype(np.int32)
    return WallMesh(name, _points(data), triangles, bool(data.GetFieldData().HasArray("infinite")))


def read_fields(path: Path) -> dict[str, np.ndarray]:
    """What a file says of each grain or of each triangle, by the name of the array, shapes (n,) or (n, components).

    Raises:
        WarpdemError: The file is missing or broken.
    """
    from vtkmodules.util.numpy_support import vtk_to_numpy

    data = _load(path)
    groups = (data.GetPointData(), data.GetCellData())
    return {g.GetArrayName(k): vtk_to_numpy(g.GetArray(k)) for g in groups for k in range(g.GetNumberOfArrays())}


def read_index(path: Path) -> list[Entry]:
    """Lines of a PVD file.

    Raises:
        WarpdemError: It cannot be read.
    """
    try:
        return [
            Entry(float(e.attrib["timestep"]), int(e.attrib["part"]), e.attrib["name"], e.attrib["file"])
            for e in ElementTree.parse(path).iter("DataSet")
        ]
    except (OSError, ElementTree.ParseError, KeyError, ValueError) as error:
        raise WarpdemError(f"{path}: cannot be read as an index of results ({error!r})") from error


def _grains_polydata(snapshot: Snapshot):
    count = len(snapshot.id)
    data = _polydata(snapshot.position)
    # a vertex cell for each grain: without cells ParaView shows nothing
    data.SetVerts(_cells(1, np.arange(count)))
    for name, values in grain_arrays(snapshot).items():
        add_array(data.GetPointData(), name, values)
    for name, values in frame_arrays(snapshot).items():
        add_array(data.GetFieldData(), name, values)
    return data


def _contacts_polydata(network: ContactNetwork):
    ends, arrays = contact_arrays(network)
    data = _polydata(ends)
    data.SetLines(_cells(2, np.arange(len(ends))))
    for name, values in arrays.items():
        add_array(data.GetCellData(), name, values)
    return data


def _wall_polydata(wall: WallMesh, load: WallLoad | None):
    data = _polydata(wall.vertices)
    data.SetPolys(_cells(3, wall.triangles))
    if wall.infinite:
        add_array(data.GetFieldData(), "infinite", np.array([1]))
    if load is not None:
        if len(load.pressure):
            for name, values in triangle_arrays(load).items():
                add_array(data.GetCellData(), name, values)
        for name, values in wall_arrays(load).items():
            add_array(data.GetFieldData(), name, np.atleast_2d(values))
    return data


def _polydata(points: np.ndarray):
    from vtkmodules.util.numpy_support import numpy_to_vtk
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkPolyData

    corners = vtkPoints()
    corners.SetData(numpy_to_vtk(np.ascontiguousarray(points, dtype=np.float64)))
    data = vtkPolyData()
    data.SetPoints(corners)
    return data


def _cells(size: int, numbers: np.ndarray):
    from vtkmodules.util.numpy_support import numpy_to_vtkIdTypeArray
    from vtkmodules.vtkCommonDataModel import vtkCellArray

    cells = vtkCellArray()
    cells.SetData(size, numpy_to_vtkIdTypeArray(np.ascontiguousarray(numbers, dtype=np.int64).ravel(), deep=True))
    return cells


def add_array(group, name: str, values: np.ndarray) -> None:
    """Add an array to point, cell or field data."""
    from vtkmodules.util.numpy_support import numpy_to_vtk

    array = numpy_to_vtk(np.ascontiguousarray(values))
    array.SetName(name)
    group.AddArray(array)


def _points(data) -> np.ndarray:
    from vtkmodules.util.numpy_support import vtk_to_numpy

    return vtk_to_numpy(data.GetPoints().GetData()).astype(np.float64, copy=False).reshape(-1, 3)


def save(data, path: Path) -> None:
    """Write LZ4-packed blocks: as fast as raw ones and smaller; VTK's default, zlib, takes 15 times as long."""
    from vtkmodules import vtkIOXML

    with replaced(path) as part:
        writer = vtkIOXML.vtkXMLPolyDataWriter() if data.IsA("vtkPolyData") else vtkIOXML.vtkXMLImageDataWriter()
        writer.SetFileName(str(part))
        writer.SetInputData(data)
        writer.SetDataModeToAppended()
        writer.EncodeAppendedDataOff()
        writer.SetCompressorTypeToLZ4()
        writer.SetHeaderTypeToUInt64()
        if writer.Write() != 1:
            raise not_written(path)


def _load(path: Path):
    from vtkmodules.vtkIOXML import vtkXMLPolyDataReader

    if not Path(path).is_file():
        raise WarpdemError(f"{path}: no such file")
    if reason := overclaim(path):
        raise WarpdemError(f"{path}: {reason}")
    problems: list[str] = []
    reader = vtkXMLPolyDataReader()
    reader.AddObserver("ErrorEvent", lambda *_: problems.append("error"))
    reader.SetFileName(str(path))
    with quiet_vtk():  # VTK would print pages about a broken file; the error below says it once
        reader.Update()
    data = reader.GetOutput()
    if problems or reader.GetErrorCode() or data.GetPoints() is None:
        raise WarpdemError(f"{path}: cannot be read as a VTP file; is it cut off?")
    return data
