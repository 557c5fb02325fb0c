"""A VTKHDF file that shows PolyData frames whose arrays lie in the files of several ranks.

It has the structure of a file of ``vtkhdf_series``, with one part per frame; but arrays of points and cells are virtual: their
rows are those of the ranks, one rank after the other, in files that stand at a fixed place beside it. It is small, and written
again with each frame.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

from warpdem.core.atomic_file import not_written, replaced
from warpdem.errors import WarpdemError
from warpdem.output.vtkhdf_series import TOPOLOGIES, Placed

PIECES = "pieces"
"""Dataset of the file with a row for each frame and rank: number of points, then the first row in each array of the rank."""


@dataclass(frozen=True)
class _Frame:
    time: float
    parts: np.ndarray
    """Number of points of each rank and the first row of each of its arrays, shape (ranks, 1 + arrays)."""
    field_data: dict[str, np.ndarray]


class JoinedSeries:
    """One such file.

    Args:
        path: The file.
        source: Place of the file of a rank from its folder, with ``{}`` for the number of the rank.
        topology: Kind of the cells: "Vertices" or "Lines".
        size: Corners of a cell.
        resume: Keep the frames of an earlier run that come before the first new one.
    """

    def __init__(self, path: Path, source: str, topology: str, size: int, *, resume: bool) -> None:
        self._path, self._source, self._topology, self._size = path, source, topology, size
        self._layout: dict[str, tuple[str, tuple[int, ...]]] = {}
        self._frames: list[_Frame] = self._earlier() if resume and path.exists() else []
        self._started = False

    def write(self, time: float, placed: Sequence[Placed], field_data: dict[str, np.ndarray]) -> None:
        """Add a frame.

        Args:
            time: Its time [s].
            placed: Where each rank has put its rows.
            field_data: Arrays of the frame, of any number of rows.

        Raises:
            OutputError: The file cannot be written.
        """
        if not self._started:
            self._frames = [frame for frame in self._frames if frame.time < time]
            self._layout, self._started = self._layout or placed[0].layout, True
        parts = np.array([[one.points, *(one.first[name] for name in self._layout)] for one in placed], dtype=np.int64)
        self._frames.append(_Frame(time, parts, field_data))
        with replaced(self._path) as part:
            try:
                with h5py.File(part, "w") as file:
                    self._fill(file)
            except RuntimeError as error:  # of HDF5 on a full disk
                raise not_written(self._path) from error

    def close(self) -> None:
        """Nothing is held back: every frame is on disk when ``write`` returns."""

    def _earlier(self) -> list[_Frame]:
        """The frames of the file.

        Raises:
            WarpdemError: It cannot be read.
        """
        try:
            with h5py.File(self._path, "r") as file:
                root = file["VTKHDF"]
                names: list[str] = json.loads(file[PIECES].attrs["arrays"])
                self._layout = {name: (root[name].dtype.str, root[name].shape[1:]) for name in names}
                times, parts = root["Steps/Values"][()], file[PIECES][()]
                return [_Frame(float(time), parts[k], _field_data(root, k)) for k, time in enumerate(times)]
        except (OSError, KeyError, ValueError) as error:
            raise WarpdemError(f"{self._path}: cannot be read as a VTKHDF file ({error})") from error

    def _fill(self, file: h5py.File) -> None:
        """Write all frames."""
        frames, n = self._frames, len(self._frames)
        most = max(len(frame.parts) for frame in frames)
        table = np.zeros((n, most, 1 + len(self._layout)), dtype=np.int64)  # ranks that are no more have no rows
        for row, frame in zip(table, frames, strict=True):
            row[: len(frame.parts)] = frame.parts
        file[PIECES] = table
        file[PIECES].attrs["arrays"] = json.dumps(list(self._layout))
        root = file.create_group("VTKHDF")
        root.attrs["Version"] = np.array([2, 3])
        root.attrs.create("Type", np.bytes_("PolyData"))
        points = table[:, :, 0].sum(axis=1)
        root["NumberOfPoints"] = points
        cells = points // self._size
        for name in TOPOLOGIES:
            count = cells if name == self._topology else np.zeros(n, dtype=np.int64)
            end = int(count.max()) * self._size  # cells stand once for all frames, from the first on
            root[f"{name}/NumberOfCells"], root[f"{name}/NumberOfConnectivityIds"] = count, count * self._size
            root[f"{name}/Connectivity"], root[f"{name}/Offsets"] = np.arange(end), np.arange(0, end + 1, self._size)
        steps = root.create_group("Steps")
        steps.attrs["NSteps"] = np.int64(n)
        steps["Values"] = np.array([frame.time for frame in frames])
        steps["PartOffsets"], steps["NumberOfParts"] = np.arange(n), np.ones(n, dtype=np.int64)
        for name in ("CellOffsets", "ConnectivityIdOffsets"):
            steps[name] = np.zeros((n, len(TOPOLOGIES)), dtype=np.int64)
        for group in ("PointData", "CellData", "FieldData"):
            root.create_group(group)
            steps.create_group(f"{group}Offsets")
        steps.create_group("FieldDataSizes")
        for column, name in enumerate(self._layout, start=1):
            offsets = self._join(root, name, table[:, :, [0, column]])
            steps["PointOffsets" if name == "Points" else name.replace("/", "Offsets/")] = offsets
        for name in frames[0].field_data:
            rows = [frame.field_data[name] for frame in frames]
            counts = np.array([len(values) for values in rows])
            root[f"FieldData/{name}"] = np.concatenate(rows)
            steps[f"FieldDataOffsets/{name}"] = np.cumsum(counts) - counts
            steps[f"FieldDataSizes/{name}"] = np.array([[int(np.prod(values.shape[1:])), len(values)] for values in rows])

    def _join(self, root: h5py.Group, name: str, where: np.ndarray) -> np.ndarray:
        """Make a virtual array; returns the first row of each frame.

        Args:
            root: Where the array goes.
            name: Its name there, and in the files of the ranks.
            where: Number of points of each rank in each frame and its first row there, shape (frames, ranks, 2).
        """
        kind, tail = self._layout[name]
        counts = where[:, :, 0] // (self._size if name.startswith("CellData/") else 1)
        same = (where[1:] == where[:-1]).all(axis=(1, 2))  # rows that no rank has written again stand once
        begins = np.concatenate([[True], ~same])
        lengths = np.where(begins, counts.sum(axis=1), 0)
        first = (np.cumsum(lengths) - lengths)[np.maximum.accumulate(np.where(begins, np.arange(len(where)), 0))]
        layout, path = h5py.VirtualLayout((int(lengths.sum()), *tail), kind), f"VTKHDF/{name}"
        for frame in np.flatnonzero(begins):
            at = int(first[frame])
            for rank, (count, begin) in enumerate(zip(counts[frame].tolist(), where[frame, :, 1].tolist(), strict=True)):
                if count:
                    there = h5py.VirtualSource(self._source.format(rank), path, (begin + count, *tail), kind)
                    layout[at : at + count] = there[begin : begin + count]
                    at += count
        if lengths.sum():
            root.create_virtual_dataset(name, layout)
        else:
            root.create_dataset(name, (0, *tail), kind)
        return first


def _field_data(root: h5py.Group, k: int) -> dict[str, np.ndarray]:
    """Field data of frame ``k`` by name."""
    out = {}
    for name, values in root["FieldData"].items():
        first = root[f"Steps/FieldDataOffsets/{name}"][k]
        out[name] = values[first : first + root[f"Steps/FieldDataSizes/{name}"][k, 1]]
    return out
