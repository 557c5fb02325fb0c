"""The formats of the frames: what each name of ``output.formats`` stands for."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple, Protocol

from warpdem.core.snapshot import Snapshot, WallMesh
from warpdem.scene.model import Scene


class FrameWriter(Protocol):
    """What every format of the results has."""

    def write(self, snapshot: Snapshot) -> None:
        """Write one frame; when this returns the frame is on disk."""

    def close(self) -> None:
        """Close the files."""


class Format(NamedTuple):
    """A format of the frames."""

    writer: Callable[[Path, list[WallMesh], Scene, bool], FrameWriter]
    """Makes the writer: folder, walls to draw in their body axes, scene, whether earlier frames are kept."""
    grain_bytes: int
    """Bytes of a grain in a frame [B], for the estimate of ``warpdem check``: 5000 that fly and spin."""


def _vtk(folder: Path, walls: list[WallMesh], scene: Scene, resume: bool) -> FrameWriter:
    from warpdem.output.write_vtk import VtkWriter

    return VtkWriter(folder, walls, contacts=scene.output.contacts, clumps=bool(scene.clumps), resume=resume)


def _vtkhdf(folder: Path, walls: list[WallMesh], scene: Scene, resume: bool) -> FrameWriter:
    from warpdem.output.write_vtkhdf import VtkhdfWriter

    return VtkhdfWriter(folder, walls, contacts=scene.output.contacts, clumps=bool(scene.clumps), resume=resume)


def _usd(folder: Path, walls: list[WallMesh], scene: Scene, resume: bool) -> FrameWriter:
    from warpdem.output.write_usd import UsdWriter

    return UsdWriter(folder, walls, scene=scene, resume=resume)


FORMATS = {
    "vtk": Format(_vtk, grain_bytes=110),
    "vtkhdf": Format(_vtkhdf, grain_bytes=100),
    "usd": Format(_usd, grain_bytes=110),
}
"""Every format that ``warpdem.scene.settings.Output.formats`` allows. Libraries are loaded when a writer is made."""


def writer_of(name: str, folder: Path, walls: list[WallMesh], scene: Scene, resume: bool = False) -> FrameWriter:
    """Writer of a format of ``output.formats``.

    Args:
        name: the format.
        folder: where the files go.
        walls: the walls to draw, each in its body axes.
        scene: the scene that is run.
        resume: keep the frames of an earlier run that come before the first new one.

    Raises:
        KeyError: ``FORMATS`` has no such format.
    """
    return FORMATS[name].writer(folder, walls, scene, resume)
