"""Results as VTKHDF: all frames of the grains in one file, those of the walls and of the contacts in one each beside it.

    result.vtkhdf            the grains; arrays and field data as in the VTP files
    result_walls.vtkhdf      all drawn walls: triangles with wall (number in the attribute ``walls`` of the file), force and
                             pressure; force, torque, torque_about and power of each wall as rows of field data
    result_contacts.vtkhdf   the contact network, if the scene asks for it

Each is a temporal PolyData of VTKHDF 2.3, which ParaView reads as it stands (composite types with time are read too, but their
reader does not follow the time that is asked for; so there are three files, not one). An array that did not change
since the frame before is not stored again. A frame is there for a reader as a whole or not at all: see ``committed_file``.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

from warpdem.core.committed_file import CommittedFile, repair
from warpdem.core.snapshot import Placement, Snapshot, WallMesh
from warpdem.errors import WarpdemError
from warpdem.output.result_arrays import (
    TRIANGLE_ARRAYS,
    WALL_ARRAYS,
    contact_arrays,
    frame_arrays,
    grain_arrays,
    snapshot_of,
)

GRAINS, WALLS, CONTACTS = "result.vtkhdf", "result_walls.vtkhdf", "result_contacts.vtkhdf"

_TOPOLOGIES = ("Vertices", "Lines", "Polygons", "Strips")
# rows in a piece of an array: of tables with a row per frame, and the least of those that grow by a frame of grains
_TABLE_ROWS, _LEAST_ROWS = 64, 1024
_LARGEST_PIECE = 16e6  # [B]


class VtkhdfWriter:
    """Write ``result.vtkhdf`` and its companions."""

    def __init__(self, folder: Path, walls: list[WallMesh], *, contacts: bool = False, resume: bool = False):
        """Prepare the folder.

        Args:
            folder: Where the files go; made if it is missing.
            walls: The walls to draw, each in its body axes.
            contacts: Whether the snapshots hold the contact network.
            resume: Keep the frames of an earlier run that come before the first new one.
        """
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        self._walls = walls
        self._grains = Series(folder / GRAINS, "Vertices", 1, resume=resume)
        self._shapes = Series(folder / WALLS, "Polygons", 3, resume=resume) if walls else None
        self._lines = Series(folder / CONTACTS, "Lines", 2, resume=resume) if contacts else None
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
            self._write_walls(snapshot)
        if self._lines is not None and snapshot.contacts is not None:
            points, cells = contact_arrays(snapshot.contacts)
            self._lines.write(snapshot.time, points, cells=len(points) // 2, cell_data=cells)
        # the grains come last: a frame of theirs has its walls and contacts
        position, count = snapshot.position, len(snapshot.id)
        fields = frame_arrays(snapshot)
        self._grains.write(snapshot.time, position, cells=count, point_data=grain_arrays(snapshot), field_data=fields)

    def close(self) -> None:
        """Close the files; every frame is on disk already."""
        for series in (self._grains, self._shapes, self._lines):
            if series is not None:
                series.close()

    def _write_walls(self, snapshot: Snapshot) -> None:
        placed = [_placed(wall.vertices, snapshot.walls[wall.name]) for wall in self._walls]
        cell_data, field_data = {"wall": self._number}, {"infinite": np.array([wall.infinite for wall in self._walls], np.int8)}
        if snapshot.loads:
            loads = [snapshot.loads[wall.name] for wall in self._walls]
            rows = [len(wall.triangles) for wall in self._walls]
            # walls that are not meshes have a load of their own but none of their triangles
            for entry in TRIANGLE_ARRAYS:
                own = [getattr(load, entry.field) for load in loads]
                cell_data[entry.name] = np.concatenate([_padded(values, n) for values, n in zip(own, rows, strict=True)])
            for entry in WALL_ARRAYS:
                field_data[entry.name] = np.array([getattr(load, entry.field) for load in loads])
        self._shapes.write(
            snapshot.time, np.concatenate(placed), cells=np.concatenate(self._triangles), cell_data=cell_data,
            field_data=field_data, about={"walls": json.dumps([wall.name for wall in self._walls])},
        )  # fmt: skip


def _placed(vertices: np.ndarray, placement: Placement) -> np.ndarray:
    return vertices @ placement.rotation.T + placement.translation


def _padded(values: np.ndarray, rows: int) -> np.ndarray:
    return values if len(values) else np.zeros((rows, *values.shape[1:]))


class Series:
    """One file of PolyData frames whose cells are all of one kind and size."""

    def __init__(self, path: Path, topology: str, size: int, *, resume: bool):
        """Nothing is opened before the first frame.

        Args:
            path: The file.
            topology: Kind of the cells: "Vertices", "Lines" or "Polygons".
            size: Corners of a cell.
            resume: Keep the frames of an earlier run that come before the first new one.
        """
        self._path, self._topology, self._size = path, topology, size
        self._resume = resume and path.exists()
        self._disk: CommittedFile | None = None
        self._file: h5py.File | None = None
        self._rows: dict[str, _Rows] = {}  # datasets by their path below VTKHDF
        self._last: dict[str, tuple[np.ndarray, int]] = {}  # array as it was last stored, and its first row

    def write(
        self,
        time: float,
        points: np.ndarray,
        *,
        cells: int | np.ndarray,
        point_data: dict[str, np.ndarray] | None = None,
        cell_data: dict[str, np.ndarray] | None = None,
        field_data: dict[str, np.ndarray] | None = None,
        about: dict[str, str] | None = None,
    ) -> None:
        """Append a frame; the names of its arrays are those of the first one.

        Args:
            time: Its time [s].
            points: Its points [m], shape (n, 3).
            cells: Corners of each cell, the same in all frames, shape (c, size); or the number of cells that have the points
                one after the other.
            point_data: Arrays of the points by name, shape (n,) or (n, components).
            cell_data: Arrays of the cells.
            field_data: Arrays of the frame, of any number of rows.
            about: Attributes of the file.

        Raises:
            OutputError: The file cannot be written.
        """
        groups = {"PointData": point_data or {}, "CellData": cell_data or {}, "FieldData": field_data or {}}
        if self._file is None:
            self._open(time, groups, points, about or {})
        # a file that is gone on with may be older than an array
        groups = {
            group: {name: values for name, values in arrays.items() if f"{group}/{name}" in self._rows}
            for group, arrays in groups.items()
        }
        count, number = self._cells(cells), self._rows["Steps/Values"].length
        for name in _TOPOLOGIES:
            mine = count if name == self._topology else 0
            self._rows[f"{name}/NumberOfCells"].add([mine])
            self._rows[f"{name}/NumberOfConnectivityIds"].add([mine * self._size])
        self._rows["NumberOfPoints"].add([len(points)])
        self._rows["Steps/PointOffsets"].add([self._stored("Points", points)])
        for group, arrays in groups.items():
            for name, values in arrays.items():
                self._rows[f"Steps/{group}Offsets/{name}"].add([self._stored(f"{group}/{name}", values)])
        for name, values in groups["FieldData"].items():
            self._rows[f"Steps/FieldDataSizes/{name}"].add([[int(np.prod(values.shape[1:])), len(values)]])
        for name, value in {"Values": time, "PartOffsets": number, "NumberOfParts": 1}.items():
            self._rows[f"Steps/{name}"].add([value])
        for name in ("CellOffsets", "ConnectivityIdOffsets"):  # cells stand once for all frames, from the first on
            self._rows[f"Steps/{name}"].add([[0] * len(_TOPOLOGIES)])
        self._file["VTKHDF/Steps"].attrs.modify("NSteps", np.int64(number + 1))
        self._file.flush()
        self._disk.commit()

    def close(self) -> None:
        """Close the file; every frame is on disk already."""
        if self._file is not None:
            self._file.close()
            self._disk.close()

    def _open(self, time: float, groups: dict[str, dict[str, np.ndarray]], points: np.ndarray, about: dict[str, str]) -> None:
        self._disk = CommittedFile(self._path, resume=self._resume)
        try:
            self._file = h5py.File(self._disk, "r+" if self._resume else "w")
        except OSError as error:
            raise WarpdemError(f"{self._path}: cannot be read as a VTKHDF file ({error})") from error
        if self._resume:
            _cut(self._file["VTKHDF"], time)
        else:
            self._create(groups, points, about)
        self._file["VTKHDF"].visititems(self._know)

    def _create(self, groups: dict[str, dict[str, np.ndarray]], points: np.ndarray, about: dict[str, str]) -> None:
        """Groups and empty datasets of a new file."""
        for name, value in about.items():
            self._file.attrs[name] = value
        root = self._file.create_group("VTKHDF")
        root.attrs["Version"] = np.array([2, 3])
        root.attrs.create("Type", np.bytes_("PolyData"))
        steps = root.create_group("Steps")
        steps.attrs["NSteps"] = np.int64(0)
        whole = np.zeros(0, np.int64)
        _dataset(root, "NumberOfPoints", whole)
        _dataset(root, "Points", points, _LEAST_ROWS)
        for name in _TOPOLOGIES:
            topology = root.create_group(name)
            for key in ("NumberOfCells", "NumberOfConnectivityIds"):
                _dataset(topology, key, whole)
            _dataset(topology, "Connectivity", whole, _LEAST_ROWS)
            _Rows(_dataset(topology, "Offsets", whole, _LEAST_ROWS)).add([0])
        _dataset(steps, "Values", np.zeros(0))
        for name in ("PartOffsets", "NumberOfParts", "PointOffsets"):
            _dataset(steps, name, whole)
        for name in ("CellOffsets", "ConnectivityIdOffsets"):
            _dataset(steps, name, np.zeros((0, len(_TOPOLOGIES)), np.int64))
        steps.create_group("FieldDataSizes")
        for group, arrays in groups.items():
            root.create_group(group)
            steps.create_group(f"{group}Offsets")
            for name, values in arrays.items():
                _dataset(root[group], name, values, _TABLE_ROWS if group == "FieldData" else _LEAST_ROWS)
                _dataset(steps[f"{group}Offsets"], name, whole)
                if group == "FieldData":
                    _dataset(steps["FieldDataSizes"], name, np.zeros((0, 2), np.int64))

    def _know(self, name: str, item: h5py.Group | h5py.Dataset) -> None:
        if isinstance(item, h5py.Dataset):
            self._rows[name] = _Rows(item)

    def _cells(self, cells: int | np.ndarray) -> int:
        """Number of cells, after their corners are stored up to it."""
        offsets = self._rows[f"{self._topology}/Offsets"]
        count, there = cells if isinstance(cells, int) else len(cells), offsets.length - 1
        if count > there:
            corners = np.arange(there * self._size, count * self._size) if isinstance(cells, int) else cells[there:].ravel()
            self._rows[f"{self._topology}/Connectivity"].add(corners)
            offsets.add(np.arange(there + 1, count + 1) * self._size)
        return count

    def _stored(self, name: str, values: np.ndarray) -> int:
        """First row of ``values`` in the dataset, after they are stored unless they are those of the frame before."""
        if name in self._last:
            before, first = self._last[name]
            # most arrays that change do so in their first rows
            if np.array_equal(before[:_TABLE_ROWS], values[:_TABLE_ROWS]) and np.array_equal(before, values):
                return first
        first = self._rows[name].add(values)
        self._last[name] = (values, first)
        return first


class _Rows:
    """A dataset that grows by rows, opened once: to look one up takes h5py longer than to write a short one."""

    def __init__(self, dataset: h5py.Dataset):
        self.length = len(dataset)
        self._id, self._shape, self._type = dataset.id, dataset.shape[1:], dataset.dtype

    def add(self, rows) -> int:
        """Add ``rows``; returns the number of the first."""
        rows = np.ascontiguousarray(rows, self._type)
        first, count = self.length, len(rows)
        if count:
            self.length += count
            self._id.set_extent((self.length, *self._shape))
            there = self._id.get_space()
            there.select_hyperslab((first, *(0 for _ in self._shape)), (count, *self._shape))
            self._id.write(h5py.h5s.create_simple((count, *self._shape)), there, rows)
        return first


def _dataset(group: h5py.Group, name: str, like: np.ndarray, least: int = _TABLE_ROWS) -> h5py.Dataset:
    """An empty dataset for rows such as those of ``like``, in pieces of a frame each but not of less than ``least`` rows."""
    size = max(int(np.prod(like.shape[1:])), 1) * like.dtype.itemsize
    rows = max(least, min(len(like), int(_LARGEST_PIECE / size)))
    shape = like.shape[1:]
    return group.create_dataset(name, (0, *shape), like.dtype, maxshape=(None, *shape), chunks=(rows, *shape))


def _cut(root: h5py.Group, time: float) -> None:
    """Drop the frames from ``time`` on."""
    steps = root["Steps"]
    kept = int(np.searchsorted(steps["Values"][: steps.attrs["NSteps"]], time))
    points = root["NumberOfPoints"][:kept]
    cells = sum(root[f"{name}/NumberOfCells"][:kept] for name in _TOPOLOGIES)
    ends = {"Points": steps["PointOffsets"][:kept] + points}
    for group, rows in {"PointData": points, "CellData": cells}.items():
        ends |= {f"{group}/{name}": offset[:kept] + rows for name, offset in steps[f"{group}Offsets"].items()}
    for name, offset in steps["FieldDataOffsets"].items():
        ends[f"FieldData/{name}"] = offset[:kept] + steps[f"FieldDataSizes/{name}"][:kept, 1]
    for name, end in ends.items():
        root[name].resize(int(end.max(initial=0)), axis=0)
    counts = [root["NumberOfPoints"], *(root[f"{name}/{key}"] for name in _TOPOLOGIES for key in
              ("NumberOfCells", "NumberOfConnectivityIds"))]  # fmt: skip
    steps.visititems(lambda _, item: counts.append(item) if isinstance(item, h5py.Dataset) else None)
    for dataset in counts:
        dataset.resize(kept, axis=0)
    steps.attrs.modify("NSteps", np.int64(kept))


@dataclass(frozen=True)
class VtkhdfResults:
    """What ``result.vtkhdf`` and its companions hold; frames are read when asked for."""

    folder: Path
    times: np.ndarray
    """Time of each frame [s], shape (frame_count,), ascending."""

    def frame(self, k: int) -> Snapshot:
        """Snapshot of frame ``k``; its ``walls`` is empty, since the walls' vertices are in place already."""
        data = self._read(GRAINS, lambda root: _frame(root, k))
        return snapshot_of(self.folder / GRAINS, data["Points"], data["PointData"], data["FieldData"])

    def walls(self, k: int) -> list[WallMesh]:
        """Walls at frame ``k``, vertices in frame axes."""
        if not (self.folder / WALLS).exists():
            return []
        return self._read(WALLS, lambda root: _walls(root, _frame(root, k)))

    def fields(self, k: int, wall: str = "") -> dict[str, np.ndarray]:
        """Arrays of the grains at frame ``k``, or those of the triangles of a wall, by name; vectors in frame axes."""
        if not wall:
            return self._read(GRAINS, lambda root: _frame(root, k))["PointData"]
        return self._read(WALLS, lambda root: _of_wall(root, _frame(root, k), wall))

    def contacts(self, k: int) -> dict[str, np.ndarray]:
        """Arrays of the contact network at frame ``k`` by name, with the two ends of each line as ``points``, (c, 2, 3) [m]."""
        data = self._read(CONTACTS, lambda root: _frame(root, k))
        return {**data["CellData"], "points": data["Points"].reshape(-1, 2, 3)}

    def _read(self, name: str, what: Callable):
        return _opened(self.folder / name, what)


def read_vtkhdf(folder: Path) -> VtkhdfResults:
    """Index of the VTKHDF results in ``folder``.

    Raises:
        WarpdemError: There are none, they cannot be read, or hold no frame.
    """
    folder = Path(folder)
    if not (folder / GRAINS).exists():
        raise WarpdemError(f'{folder}: no {GRAINS} in this folder; run a scene with "vtkhdf" among its output formats')
    times = _opened(folder / GRAINS, lambda root: root["Steps/Values"][: root["Steps"].attrs["NSteps"]])
    if not len(times):
        raise WarpdemError(f"{folder / GRAINS}: holds no frame")
    return VtkhdfResults(folder, times)


def _opened(path: Path, what: Callable):
    """What ``what`` reads off the group VTKHDF of a file."""
    if not path.exists():
        raise WarpdemError(f"{path}: no such file")
    try:
        repair(path)
        with h5py.File(path, "r", locking=False) as file:
            return what(file["VTKHDF"])
    except (OSError, KeyError, ValueError, TypeError, AttributeError, IndexError, RuntimeError, MemoryError) as error:
        raise WarpdemError(f"{path}: cannot be read as a VTKHDF file ({error})") from error


def _frame(root: h5py.Group, k: int) -> dict:
    """Points and arrays of frame ``k``."""
    steps = root["Steps"]
    points = int(root["NumberOfPoints"][k])
    cells = sum(int(root[f"{name}/NumberOfCells"][k]) for name in _TOPOLOGIES)

    def rows(name: str, offset: h5py.Dataset, count: int) -> np.ndarray:
        first = int(offset[k])
        return root[name][first : first + count]

    data: dict = {"Points": rows("Points", steps["PointOffsets"], points)}
    for group, count in {"PointData": points, "CellData": cells}.items():
        offsets = steps[f"{group}Offsets"]
        data[group] = {name: rows(f"{group}/{name}", offsets[name], count) for name in offsets}
    offsets, sizes = steps["FieldDataOffsets"], steps["FieldDataSizes"]
    data["FieldData"] = {name: rows(f"FieldData/{name}", offsets[name], int(sizes[name][k, 1])) for name in offsets}
    return data


def _names(root: h5py.Group) -> list[str]:
    return json.loads(root.parent.attrs["walls"])


def _walls(root: h5py.Group, data: dict) -> list[WallMesh]:
    """Each wall with its own vertices."""
    number, infinite = data["CellData"]["wall"], data["FieldData"]["infinite"]
    corners = root["Polygons/Connectivity"][: 3 * len(number)].reshape(-1, 3)
    walls = []
    for k, name in enumerate(_names(root)):
        used, triangles = np.unique(corners[number == k], return_inverse=True)
        walls.append(WallMesh(name, data["Points"][used], triangles.reshape(-1, 3).astype(np.int32), bool(infinite[k])))
    return walls


def _of_wall(root: h5py.Group, data: dict, wall: str) -> dict[str, np.ndarray]:
    here = data["CellData"].pop("wall") == _names(root).index(wall)
    return {name: values[here] for name, values in data["CellData"].items()}
