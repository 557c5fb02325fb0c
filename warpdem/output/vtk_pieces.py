"""One rank's pieces of the frames in VTK: files of its own, which the index of the first rank joins."""

from pathlib import Path

from warpdem.core.snapshot import Snapshot
from warpdem.output.pvd_index import read_index
from warpdem.output.vtk_files import save
from warpdem.output.write_vtk import INDEX, PIECES, frames_before, piece_file, polydata_of


class VtkPieceWriter:
    """Write ``result_vtk/grains_000000_PART.vtp`` ..., and contacts and clumps likewise."""

    def __init__(self, folder: Path, part: int, *, contacts: bool = False, clumps: bool = False, resume: bool = False):
        """Prepare the folder, before any frame of the run is written.

        Args:
            folder: Where the indices go.
            part: Number of the rank.
            contacts: Whether the snapshots hold the contact network.
            clumps: Whether the snapshots hold clumps.
            resume: As of ``VtkWriter``, which numbers the frames in the same way.
        """
        self._folder, self._part = folder, part
        (folder / PIECES).mkdir(parents=True, exist_ok=True)
        self._names = ["grains", *["contacts"] * contacts, *["clumps"] * clumps]
        index = folder / INDEX
        self._earlier = read_index(index) if resume and index.exists() else []
        self._frame: int | None = None

    def write(self, piece: Snapshot) -> dict[str, int]:
        """Write the piece of the next frame; returns its numbers of grains, contacts and clumps.

        A rank other than the first writes no file without rows.

        Raises:
            OutputError: A file cannot be written.
        """
        self._frame = frames_before(self._earlier, piece.time) if self._frame is None else self._frame + 1
        rows = {}
        for name in self._names:
            data = polydata_of(name, piece)
            rows[name] = data.GetNumberOfCells()
            if rows[name] or self._part == 0:
                save(data, self._folder / piece_file(name, self._frame, self._part))
        return rows
