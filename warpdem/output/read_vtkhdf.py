"""Reads the VTKHDF results of a folder back: frames, walls, contacts and their arrays."""

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import h5py
import numpy as np

from warpdem.core.journaled_file import repair
from warpdem.core.snapshot import Snapshot, WallMesh
from warpdem.errors import WarpdemError
from warpdem.output.pieces import in_rows, order_by_id, order_of_contacts
from warpdem.output.result_arrays import snapshot_of
from warpdem.output.vtkhdf_joined import PIECES as PARTS
from warpdem.output.vtkhdf_series import TOPOLOGIES
from warpdem.output.write_vtkhdf import CLUMPS, CONTACTS, GRAINS, WALLS

T = TypeVar("T")


@dataclass(frozen=True)
class Frame:
    """Points and arrays of one frame of a file."""

    points: np.ndarray
    """Points [m], shape (n, 3)."""
    point_data: dict[str, np.ndarray]
    """Arrays of the points by name."""
    cell_data: dict[str, np.ndarray]
    """Arrays of the cells by name."""
    field_data: dict[str, np.ndarray]
    """Arrays of the frame by name."""


@dataclass(frozen=True)
class VtkhdfResults:
    """What ``result.vtkhdf`` and its companions hold; frames are read when asked for."""

    folder: Path
    times: np.ndarray
    """Time of each frame [s], shape (frame_count,), ascending."""

    def frame(self, k: int) -> Snapshot:
        """Snapshot of frame ``k``; its ``walls`` is empty, since the walls' vertices are in place already."""
        data = self._read(GRAINS, lambda root: _by_id(_frame(root, k)))
        return snapshot_of(self.folder / GRAINS, data.points, data.point_data, data.field_data)

    def walls(self, k: int) -> list[WallMesh]:
        """Walls at frame ``k``, vertices in frame axes."""
        if not (self.folder / WALLS).exists():
            return []
        return self._read(WALLS, lambda root: _walls(root, _frame(root, k)))

    def fields(self, k: int, wall: str = "") -> dict[str, np.ndarray]:
        """Arrays of the grains at frame ``k``, or those of the triangles of a wall, by name; vectors in frame axes."""
        if not wall:
            return self._read(GRAINS, lambda root: _by_id(_frame(root, k))).point_data
        return self._read(WALLS, lambda root: _of_wall(root, _frame(root, k), wall))

    def clumps(self, k: int) -> dict[str, np.ndarray]:
        """Arrays of the clumps at frame ``k`` by name, with their centres as ``position``, (c, 3) [m]; empty without clumps."""
        if not (self.folder / CLUMPS).exists():
            return {}
        data = self._read(CLUMPS, lambda root: _by_id(_frame(root, k)))
        return {**data.point_data, "position": data.points}

    @property
    def has_contacts(self) -> bool:
        """Whether the results hold the contact network."""
        return (self.folder / CONTACTS).exists()

    def contacts(self, k: int) -> dict[str, np.ndarray]:
        """Arrays of the contact network at frame ``k`` by name, with the two ends of each line as ``points``, (c, 2, 3) [m]."""
        data, in_pieces = self._read(CONTACTS, lambda root: (_frame(root, k), PARTS in root.parent))
        contacts = {**data.cell_data, "points": data.points.reshape(-1, 2, 3)}
        return in_rows(contacts, order_of_contacts(contacts) if in_pieces else None)

    def _read(self, name: str, what: Callable[[h5py.Group], T]) -> T:
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


def _opened(path: Path, what: Callable[[h5py.Group], T]) -> T:
    """Result of ``what`` for the group VTKHDF of a file."""
    if not path.exists():
        raise WarpdemError(f"{path}: no such file")
    try:
        repair(path)
        with h5py.File(path, "r", locking=False) as file:
            _require_pieces(file, path)
            return what(file["VTKHDF"])
    except (OSError, KeyError, ValueError, TypeError, AttributeError, IndexError, RuntimeError, MemoryError) as error:
        raise WarpdemError(f"{path}: cannot be read as a VTKHDF file ({error})") from error


def _require_pieces(file: h5py.File, path: Path) -> None:
    """Refuse a file whose pieces are not beside it: HDF5 would read zeros.

    Raises:
        WarpdemError: One is missing.
    """
    points = file["VTKHDF/Points"]
    for source in {source.file_name for source in points.virtual_sources()} if points.is_virtual else ():
        if not (path.parent / source).is_file():
            raise WarpdemError(f"{path}: its piece {source} is not beside it; keep the folder whole")
        repair(path.parent / source)


def _by_id(frame: Frame) -> Frame:
    """The same, grains or clumps in order of id: those of several ranks are one rank after the other."""
    order = order_by_id(frame.point_data.get("id", np.zeros(0)))
    if order is None:
        return frame
    return replace(frame, points=frame.points[order], point_data=in_rows(frame.point_data, order))


def _frame(root: h5py.Group, k: int) -> Frame:
    """Points and arrays of frame ``k``."""
    steps = root["Steps"]
    points = int(root["NumberOfPoints"][k])
    cells = sum(int(root[f"{name}/NumberOfCells"][k]) for name in TOPOLOGIES)

    def rows(name: str, offset: h5py.Dataset, count: int) -> np.ndarray:
        first = int(offset[k])
        return np.asarray(root[name][first : first + count])

    def arrays(group: str, count: int) -> dict[str, np.ndarray]:
        offsets = steps[f"{group}Offsets"]
        return {name: rows(f"{group}/{name}", offsets[name], count) for name in offsets}

    offsets, sizes = steps["FieldDataOffsets"], steps["FieldDataSizes"]
    field_data = {name: rows(f"FieldData/{name}", offsets[name], int(sizes[name][k, 1])) for name in offsets}
    position = rows("Points", steps["PointOffsets"], points)
    return Frame(position, arrays("PointData", points), arrays("CellData", cells), field_data)


def _names(root: h5py.Group) -> list[str]:
    names: list[str] = json.loads(root.parent.attrs["walls"])
    return names


def _walls(root: h5py.Group, data: Frame) -> list[WallMesh]:
    """Each wall with its own vertices."""
    number, infinite = data.cell_data["wall"], data.field_data["infinite"]
    corners = root["Polygons/Connectivity"][: 3 * len(number)].reshape(-1, 3)
    walls = []
    for k, name in enumerate(_names(root)):
        used, triangles = np.unique(corners[number == k], return_inverse=True)
        walls.append(WallMesh(name, data.points[used], triangles.reshape(-1, 3).astype(np.int32), bool(infinite[k])))
    return walls


def _of_wall(root: h5py.Group, data: Frame, wall: str) -> dict[str, np.ndarray]:
    here = data.cell_data["wall"] == _names(root).index(wall)
    return {name: values[here] for name, values in data.cell_data.items() if name != "wall"}
