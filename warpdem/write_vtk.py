"""Results as VTK files: one VTP per frame and body, one PVD that gives them their times; and the way back.

Everything stands in frame axes. The field data of each grain file tell where the frame stood, so that a reader can show
the laboratory view: x_lab = frame_rotation x + frame_translation (rotation row by row; frame_spin and frame_velocity in
frame axes; one row of frame_parts for each motion). All numbers are float64: a frame can start a new scene (but holds no
friction history). A wall file holds the load on the wall at its time: force [N] and pressure [Pa] of each triangle, and
force, torque [N m] about the point torque_about [m], and power [W] of the whole as field data.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields
from pathlib import Path
from urllib.parse import quote
from xml.etree import ElementTree
from xml.sax.saxutils import quoteattr

import numpy as np

from warpdem.errors import WarpdemError
from warpdem.snapshot import (
    FramePose,
    Part,
    Placement,
    RotationPart,
    SampledPart,
    Snapshot,
    TranslationPart,
    WallLoad,
    WallMesh,
)
from warpdem.write_tables import replaced

INDEX = "result.pvd"

# name in the file (as users of LIGGGHTS and LAMMPS know it), field of the snapshot
_GRAIN_ARRAYS = {
    "id": "id",
    "type": "type",
    "radius": "radius",
    "mass": "mass",
    "v": "velocity",
    "omega": "spin",
    "f": "force",
}


# field data of a wall file: field of its load, name in the file
_WALL_ARRAYS = {"force": "force", "torque": "torque", "about": "torque_about", "power": "power"}


@dataclass(frozen=True)
class _Entry:
    """One line of the index."""

    time: float
    part: int
    name: str
    file: str


class VtkWriter:
    """Write ``grains_000000.vtp`` ... and ``wall_NAME_000000.vtp`` ... with ``result.pvd``.

    A wall gets a new file when it has moved in frame axes, and in every frame if the snapshots hold its load; otherwise the
    index repeats the last one.
    """

    def __init__(self, folder: Path, walls: list[WallMesh], *, resume: bool = False):
        """Prepare the folder.

        Args:
            folder: Where the files go; made if it is missing.
            walls: The mesh walls, each in its body axes.
            resume: Keep the frames of an earlier run that come before the first new one.
        """
        self._folder = Path(folder)
        self._folder.mkdir(parents=True, exist_ok=True)
        self._walls = walls
        self._entries = _read_index(self._folder / INDEX) if resume and (self._folder / INDEX).exists() else []
        self._frame: int | None = None
        self._wall_files: dict[str, tuple[Placement, str]] = {}

    def write(self, snapshot: Snapshot) -> None:
        """Write one frame; when this returns the index holds it."""
        if self._frame is None:
            self._entries = [entry for entry in self._entries if entry.time < snapshot.time]
            self._frame = len({entry.time for entry in self._entries})
        name = f"grains_{self._frame:06d}.vtp"
        _save(_grains_polydata(snapshot), self._folder / name)
        self._entries.append(_Entry(snapshot.time, 0, "grains", name))
        for part, wall in enumerate(self._walls, start=1):
            file = self._write_wall(wall, snapshot.walls[wall.name], snapshot.loads.get(wall.name))
            self._entries.append(_Entry(snapshot.time, part, wall.name, file))
        self._write_index()
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
        _save(_wall_polydata(vertices, wall.triangles, load), self._folder / file)
        self._wall_files[wall.name] = (placement, file)
        return file

    def _write_index(self) -> None:
        lines = [
            f'<DataSet timestep="{entry.time!r}" group="{"walls" if entry.part else "grains"}" part="{entry.part}"'
            f" name={quoteattr(entry.name)} file={quoteattr(entry.file)}/>"
            for entry in self._entries
        ]
        text = "\n".join(['<VTKFile type="Collection" version="0.1">', "<Collection>", *lines, "</Collection>"])
        with replaced(self._folder / INDEX) as part:
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
    for entry in _read_index(index):
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
    field, point = data.GetFieldData(), data.GetPointData()

    def array(group, name: str) -> np.ndarray:
        values = group.GetArray(name)
        if values is None:
            raise WarpdemError(f"{path}: not a grain file of warpdem, array {name!r} is missing")
        return vtk_to_numpy(values)

    place = (array(field, f"frame_{name}")[0] for name in ("rotation", "translation", "spin", "velocity"))
    rotation, *vectors = place
    rows = array(field, "frame_parts") if field.HasArray("frame_parts") else ()  # an inertial frame has none
    frame = FramePose(rotation.reshape(3, 3), *vectors, tuple(_part(row) for row in rows))
    grains = {key: array(point, name) for name, key in _GRAIN_ARRAYS.items()}
    step, time = int(array(field, "step")[0]), float(array(field, "time")[0])
    return Snapshot(step=step, time=time, frame=frame, position=_points(data), **grains)


def read_wall(name: str, path: Path) -> WallMesh:
    """Mesh wall held by one wall file, vertices as they stand in frame axes.

    Raises:
        WarpdemError: The file is missing or broken.
    """
    from vtkmodules.util.numpy_support import vtk_to_numpy

    data = _load(path)
    triangles = vtk_to_numpy(data.GetPolys().GetConnectivityArray()).reshape(-1, 3).astype(np.int32)
    return WallMesh(name, _points(data), triangles)


def _read_index(path: Path) -> list[_Entry]:
    try:
        return [
            _Entry(float(e.attrib["timestep"]), int(e.attrib["part"]), e.attrib["name"], e.attrib["file"])
            for e in ElementTree.parse(path).iter("DataSet")
        ]
    except (OSError, ElementTree.ParseError, KeyError, ValueError) as error:
        raise WarpdemError(f"{path}: cannot be read as an index of results ({error!r})") from error


def _grains_polydata(snapshot: Snapshot):
    count = len(snapshot.id)
    data = _polydata(snapshot.position)
    # a vertex cell for each grain: without cells ParaView shows nothing
    data.SetVerts(_cells(1, np.arange(count)))
    for name, key in _GRAIN_ARRAYS.items():
        _add(data.GetPointData(), name, getattr(snapshot, key))
    frame = snapshot.frame
    for name, value in {
        "time": [float(snapshot.time)],
        "step": [int(snapshot.step)],
        "frame_angle": [float(frame.angle)],
        "frame_rotation": [frame.rotation.ravel()],
        "frame_translation": [frame.translation],
        "frame_spin": [frame.spin],
        "frame_velocity": [frame.velocity],
    }.items():
        _add(data.GetFieldData(), name, np.array(value))
    if frame.parts:
        _add(data.GetFieldData(), "frame_parts", np.array([_numbers(part) for part in frame.parts]))
    return data


_PARTS = (RotationPart, TranslationPart, SampledPart)


def _numbers(part: Part) -> np.ndarray:
    """A motion as a row of frame_parts: its kind, then its fields one after the other, filled up with zeros, shape (8,)."""
    row = np.zeros(8)
    values = np.hstack([_PARTS.index(type(part)), *(getattr(part, f.name) for f in fields(part))])
    row[: len(values)] = values
    return row


def _part(row: np.ndarray) -> Part:
    """The motion that a row of frame_parts holds."""
    kind, numbers = _PARTS[int(row[0])], row[1:]
    if kind is RotationPart:
        return RotationPart(numbers[:3], numbers[3:6], float(numbers[6]))
    return TranslationPart(numbers[:3]) if kind is TranslationPart else SampledPart(numbers[:4], numbers[4:7])


def _wall_polydata(vertices: np.ndarray, triangles: np.ndarray, load: WallLoad | None):
    data = _polydata(vertices)
    data.SetPolys(_cells(3, triangles))
    if load is not None:
        if len(load.pressure):
            _add(data.GetCellData(), "force", load.triangle_force)
            _add(data.GetCellData(), "pressure", load.pressure)
        for name in ("force", "torque", "about", "power"):
            _add(data.GetFieldData(), _WALL_ARRAYS[name], np.atleast_2d(getattr(load, name)))
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


def _add(group, name: str, values: np.ndarray) -> None:
    from vtkmodules.util.numpy_support import numpy_to_vtk

    array = numpy_to_vtk(np.ascontiguousarray(values))
    array.SetName(name)
    group.AddArray(array)


def _points(data) -> np.ndarray:
    from vtkmodules.util.numpy_support import vtk_to_numpy

    return vtk_to_numpy(data.GetPoints().GetData()).astype(np.float64, copy=False).reshape(-1, 3)


def _save(data, path: Path) -> None:
    """Write LZ4-packed blocks: as fast as raw ones and smaller; VTK's default, zlib, takes 15 times as long."""
    from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter

    with replaced(path) as part:
        writer = vtkXMLPolyDataWriter()
        writer.SetFileName(str(part))
        writer.SetInputData(data)
        writer.SetDataModeToAppended()
        writer.EncodeAppendedDataOff()
        writer.SetCompressorTypeToLZ4()
        writer.SetHeaderTypeToUInt64()
        if writer.Write() != 1:
            raise WarpdemError(f"{path}: cannot be written (disk full, or no right to write there?)")


def _load(path: Path):
    from vtkmodules.vtkIOXML import vtkXMLPolyDataReader

    if not Path(path).exists():
        raise WarpdemError(f"{path}: no such file")
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
