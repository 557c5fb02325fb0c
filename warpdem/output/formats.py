"""The formats of the frames: what each name of ``output.formats`` stands for."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from warpdem.core.snapshot import Snapshot, WallMesh
from warpdem.scene.model import Scene


class FrameWriter(Protocol):
    """What writes frames as a whole."""

    def write(self, snapshot: Snapshot) -> None:
        """Write one frame; when this returns the frame is on disk."""

    def close(self) -> None:
        """Close the files."""


class JoiningWriter(FrameWriter, Protocol):
    """What every format of the results has: it writes frames as a whole, or around the pieces that ranks write."""

    def join(self, around: Snapshot, pieces: Sequence[Any]) -> None:
        """Write a frame, without grains, contacts and clumps, around the pieces for which their writers gave this."""


class PieceWriter(Protocol):
    """What writes the grains, contacts and clumps of one rank."""

    def write(self, piece: Snapshot) -> Any:
        """Write the piece of one frame, to disk; returns what ``JoiningWriter.join`` has to know of it."""


class Format(NamedTuple):
    """A format of the frames."""

    writer: Callable[[Path, list[WallMesh], Scene, bool, bool], JoiningWriter]
    """Makes the writer: folder, walls to draw in their body axes, scene, whether earlier frames are kept, whether frames are
    joined of pieces."""
    piece: Callable[[Path, int, Scene, bool], PieceWriter]
    """Makes the writer of the pieces of a rank: folder, number of the rank, scene, whether earlier frames are kept. The writer
    that joins them is made before."""
    grain_bytes: int
    """Bytes of a grain in a frame [B], for the estimate of ``warpdem check``: 5000 that fly and spin."""


def _vtk(folder: Path, walls: list[WallMesh], scene: Scene, resume: bool, pieces: bool) -> JoiningWriter:
    from warpdem.output.write_vtk import VtkWriter

    return VtkWriter(folder, walls, contacts=scene.output.contacts, clumps=bool(scene.clumps), resume=resume)


def _vtk_piece(folder: Path, part: int, scene: Scene, resume: bool) -> PieceWriter:
    from warpdem.output.vtk_pieces import VtkPieceWriter

    return VtkPieceWriter(folder, part, contacts=scene.output.contacts, clumps=bool(scene.clumps), resume=resume)


def _vtkhdf(folder: Path, walls: list[WallMesh], scene: Scene, resume: bool, pieces: bool) -> JoiningWriter:
    from warpdem.output.write_vtkhdf import VtkhdfWriter

    contacts, clumps = scene.output.contacts, bool(scene.clumps)
    return VtkhdfWriter(folder, walls, contacts=contacts, clumps=clumps, resume=resume, pieces=pieces)


def _vtkhdf_piece(folder: Path, part: int, scene: Scene, resume: bool) -> PieceWriter:
    from warpdem.output.write_vtkhdf import VtkhdfPieceWriter

    return VtkhdfPieceWriter(folder, part, contacts=scene.output.contacts, clumps=bool(scene.clumps), resume=resume)


def _usd(folder: Path, walls: list[WallMesh], scene: Scene, resume: bool, pieces: bool) -> JoiningWriter:
    from warpdem.output.write_usd import UsdWriter

    return UsdWriter(folder, walls, scene=scene, resume=resume)


def _usd_piece(folder: Path, part: int, scene: Scene, resume: bool) -> PieceWriter:
    from warpdem.output.usd_pieces import UsdPieceWriter

    return UsdPieceWriter(folder, part, scene, resume=resume)


FORMATS = {
    "vtk": Format(_vtk, _vtk_piece, grain_bytes=110),
    "vtkhdf": Format(_vtkhdf, _vtkhdf_piece, grain_bytes=100),
    "usd": Format(_usd, _usd_piece, grain_bytes=110),
}
"""Every format that ``warpdem.scene.settings.Output.formats`` allows. Libraries are loaded when a writer is made."""


def writer_of(
    name: str, folder: Path, walls: list[WallMesh], scene: Scene, resume: bool = False, pieces: bool = False
) -> JoiningWriter:
    """Writer of a format of ``output.formats``.

    Args:
        name: the format.
        folder: where the files go.
        walls: the walls to draw, each in its body axes.
        scene: the scene that is run.
        resume: keep the frames of an earlier run that come before the first new one.
        pieces: frames are joined of pieces (``JoiningWriter.join``), not written as a whole (``write``).

    Raises:
        KeyError: ``FORMATS`` has no such format.
    """
    return FORMATS[name].writer(folder, walls, scene, resume, pieces)
