"""A VTKHDF file of PolyData frames that grows by one frame at a time."""

from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import ArrayLike

from warpdem.core.journaled_file import JournaledFile
from warpdem.errors import WarpdemError

TOPOLOGIES = ("Vertices", "Lines", "Polygons", "Strips")
# rows of a chunk: of tables with a row per frame, and at least of arrays that grow by a frame of grains
_TABLE_ROWS, _LEAST_ROWS = 64, 1024
_LARGEST_CHUNK = 16e6  # [B]


@dataclass(frozen=True)
class Placed:
    """Where a frame is in a file."""

    points: int
    """Number of its points."""
    first: dict[str, int]
    """First row in each array of points or cells, by its name below VTKHDF."""
    layout: dict[str, tuple[str, tuple[int, ...]]]
    """Type of each of these arrays, and shape of a row."""


class Series:
    """One file of PolyData frames whose cells are all of one kind and size."""

    def __init__(self, path: Path, topology: str, size: int, *, resume: bool):
        """Nothing is opened before the first frame.

        Args:
            path: The file.
            topology: Kind of the cells: "Vertices", "Lines" or "Polygons".
            size: Corners of a cell.
            resume: Keep the frames of an earlier run that come before the first new one.

        Attributes:
            placed: Where the last frame is.
        """
        self.placed: Placed
        self._path, self._topology, self._size = path, topology, size
        self._resume = resume and path.exists()
        self._disk: JournaledFile | None = None
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
        if self._file is None or self._disk is None:
            self._disk, self._file = self._open(time, groups, points, about or {})
        # a file that is continued may lack an array that was added since
        groups = {
            group: {name: values for name, values in arrays.items() if f"{group}/{name}" in self._rows}
            for group, arrays in groups.items()
        }
        count, number = self._cells(cells), self._rows["Steps/Values"].length
        for name in TOPOLOGIES:
            number_here = count if name == self._topology else 0
            self._rows[f"{name}/NumberOfCells"].add([number_here])
            self._rows[f"{name}/NumberOfConnectivityIds"].add([number_here * self._size])
        self._rows["NumberOfPoints"].add([len(points)])
        held = {"Points": points} | {f"{group}/{name}": of[name] for group, of in groups.items() for name in of}
        first = {name: self._stored(name, values) for name, values in held.items()}
        for name, row in first.items():
            self._rows["Steps/PointOffsets" if name == "Points" else "Steps/" + name.replace("/", "Offsets/")].add([row])
        arrays = {name: self._rows[name] for name in held if not name.startswith("FieldData/")}
        layout = {name: (rows.type.str, rows.shape) for name, rows in arrays.items()}
        self.placed = Placed(len(points), {name: first[name] for name in arrays}, layout)
        for name, values in groups["FieldData"].items():
            self._rows[f"Steps/FieldDataSizes/{name}"].add([[int(np.prod(values.shape[1:])), len(values)]])
        for name, value in {"Values": time, "PartOffsets": number, "NumberOfParts": 1}.items():
            self._rows[f"Steps/{name}"].add([value])
        for name in ("CellOffsets", "ConnectivityIdOffsets"):  # cells stand once for all frames, from the first on
            self._rows[f"Steps/{name}"].add([[0] * len(TOPOLOGIES)])
        self._file["VTKHDF/Steps"].attrs.modify("NSteps", np.int64(number + 1))
        self._file.flush()
        self._disk.commit()

    def close(self) -> None:
        """Close the file; every frame is on disk already."""
        if self._file is not None and self._disk is not None:
            self._file.close()
            self._disk.close()

    def _open(
        self, time: float, groups: dict[str, dict[str, np.ndarray]], points: np.ndarray, about: dict[str, str]
    ) -> tuple[JournaledFile, h5py.File]:
        disk = JournaledFile(self._path, resume=self._resume)
        try:
            file = h5py.File(disk, "r+" if self._resume else "w")
        except OSError as error:
            raise WarpdemError(f"{self._path}: cannot be read as a VTKHDF file ({error})") from error
        if self._resume:
            _cut(file["VTKHDF"], time)
        else:
            self._create(file, groups, points, about)
        file["VTKHDF"].visititems(self._register)
        return disk, file

    def _create(
        self, file: h5py.File, groups: dict[str, dict[str, np.ndarray]], points: np.ndarray, about: dict[str, str]
    ) -> None:
        """Groups and empty datasets of a new file."""
        for name, value in about.items():
            file.attrs[name] = value
        root = file.create_group("VTKHDF")
        root.attrs["Version"] = np.array([2, 3])
        root.attrs.create("Type", np.bytes_("PolyData"))
        steps = root.create_group("Steps")
        steps.attrs["NSteps"] = np.int64(0)
        whole = np.zeros(0, np.int64)
        _dataset(root, "NumberOfPoints", whole)
        _dataset(root, "Points", points, _LEAST_ROWS)
        for name in TOPOLOGIES:
            topology = root.create_group(name)
            for key in ("NumberOfCells", "NumberOfConnectivityIds"):
                _dataset(topology, key, whole)
            _dataset(topology, "Connectivity", whole, _LEAST_ROWS)
            _Rows(_dataset(topology, "Offsets", whole, _LEAST_ROWS)).add([0])
        _dataset(steps, "Values", np.zeros(0))
        for name in ("PartOffsets", "NumberOfParts", "PointOffsets"):
            _dataset(steps, name, whole)
        for name in ("CellOffsets", "ConnectivityIdOffsets"):
            _dataset(steps, name, np.zeros((0, len(TOPOLOGIES)), np.int64))
        steps.create_group("FieldDataSizes")
        for group, arrays in groups.items():
            root.create_group(group)
            steps.create_group(f"{group}Offsets")
            for name, values in arrays.items():
                _dataset(root[group], name, values, _TABLE_ROWS if group == "FieldData" else _LEAST_ROWS)
                _dataset(steps[f"{group}Offsets"], name, whole)
                if group == "FieldData":
                    _dataset(steps["FieldDataSizes"], name, np.zeros((0, 2), np.int64))

    def _register(self, name: str, item: h5py.Group | h5py.Dataset) -> None:
        if isinstance(item, h5py.Dataset):
            self._rows[name] = _Rows(item)

    def _cells(self, cells: int | np.ndarray) -> int:
        """Number of cells, after their corners are stored up to it."""
        offsets = self._rows[f"{self._topology}/Offsets"]
        count, there = cells if isinstance(cells, int) else len(cells), offsets.length - 1
        if count > there:
            corners = (
                np.arange(there * self._size, count * self._size) if isinstance(cells, int) else cells[there:].ravel()
            )
            self._rows[f"{self._topology}/Connectivity"].add(corners)
            offsets.add(np.arange(there + 1, count + 1) * self._size)
        return count

    def _stored(self, name: str, values: np.ndarray) -> int:
        """First row of ``values`` in the dataset; they are stored unless they equal those of the frame before."""
        if name in self._last:
            before, first = self._last[name]
            # most arrays that change do so in their first rows
            if np.array_equal(before[:_TABLE_ROWS], values[:_TABLE_ROWS]) and np.array_equal(before, values):
                return first
        first = self._rows[name].add(values)
        self._last[name] = (values, first)
        return first


class _Rows:
    """A dataset that grows by rows. It is opened once, since h5py takes longer to find a dataset than to write a short one."""

    def __init__(self, dataset: h5py.Dataset):
        self.length = len(dataset)
        self._id, self.shape, self.type = dataset.id, dataset.shape[1:], dataset.dtype

    def add(self, rows: ArrayLike) -> int:
        """Add ``rows``; returns the number of the first."""
        values = np.ascontiguousarray(rows, self.type)
        first, count = self.length, len(values)
        if count:
            self.length += count
            self._id.set_extent((self.length, *self.shape))
            there = self._id.get_space()
            there.select_hyperslab((first, *(0 for _ in self.shape)), (count, *self.shape))
            self._id.write(h5py.h5s.create_simple((count, *self.shape)), there, values)
        return first


def _dataset(group: h5py.Group, name: str, like: np.ndarray, least: int = _TABLE_ROWS) -> h5py.Dataset:
    """An empty dataset for rows such as those of ``like``, in chunks of a frame each but of at least ``least`` rows."""
    size = max(int(np.prod(like.shape[1:])), 1) * like.dtype.itemsize
    rows = max(least, min(len(like), int(_LARGEST_CHUNK / size)))
    shape = like.shape[1:]
    return group.create_dataset(name, (0, *shape), like.dtype, maxshape=(None, *shape), chunks=(rows, *shape))


def _cut(root: h5py.Group, time: float) -> None:
    """Drop the frames from ``time`` on."""
    steps = root["Steps"]
    kept = int(np.searchsorted(steps["Values"][: steps.attrs["NSteps"]], time))
    points = root["NumberOfPoints"][:kept]
    cells = sum(root[f"{name}/NumberOfCells"][:kept] for name in TOPOLOGIES)
    ends = {"Points": steps["PointOffsets"][:kept] + points}
    for group, rows in {"PointData": points, "CellData": cells}.items():
        ends |= {f"{group}/{name}": offset[:kept] + rows for name, offset in steps[f"{group}Offsets"].items()}
    for name, offset in steps["FieldDataOffsets"].items():
        ends[f"FieldData/{name}"] = offset[:kept] + steps[f"FieldDataSizes/{name}"][:kept, 1]
    for name, end in ends.items():
        root[name].resize(int(end.max(initial=0)), axis=0)
    counts = [root["NumberOfPoints"], *(root[f"{name}/{key}"] for name in TOPOLOGIES for key in
              ("NumberOfCells", "NumberOfConnectivityIds"))]  # fmt: skip
    steps.visititems(lambda _, item: counts.append(item) if isinstance(item, h5py.Dataset) else None)
    for dataset in counts:
        dataset.resize(kept, axis=0)
    steps.attrs.modify("NSteps", np.int64(kept))
