"""Pictures that a notebook shows by itself."""

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from warpdem.drawing.rendering import render
from warpdem.measure.contact_network import read_network
from warpdem.output.write_vtk import VtkWriter
from warpdem.simulation import Simulation


class Picture:
    """A PNG; a notebook shows it when it is the last value of a cell."""

    def __init__(self, png: bytes) -> None:
        self.png = png
        """The bytes of the file."""

    def _repr_png_(self) -> bytes:
        return self.png

    def save(self, path: Path | str) -> Path:
        """Write the file, and return its path."""
        Path(path).write_bytes(self.png)
        return Path(path)


def picture(source: Simulation | Path | str, *, time: float | None = None, **style: Any) -> Picture:
    """Picture of a simulation as it stands, or of results in a folder.

    Args:
        source: The simulation, or the folder of the results.
        time: Time of the picture [s]; the last one for None. Only of results.
        **style: Choices of ``warpdem.drawing.style.PictureStyle``: view, colour, camera, cut and so on.

    Raises:
        WarpdemError: As ``warpdem.render``.
    """
    with TemporaryDirectory() as made:
        if isinstance(source, Simulation):
            folder = Path(made)
            snapshot = source.snapshot()
            if style.get("chains") and snapshot.contacts is None:
                snapshot = replace(snapshot, contacts=read_network(source.view))
            writer = VtkWriter(
                folder, source.wall_meshes(), contacts=snapshot.contacts is not None, clumps=snapshot.clumps is not None
            )
            writer.write(snapshot)
        else:
            folder = Path(source)
        return Picture(render(folder, Path(made) / "picture.png", time=time, **style).read_bytes())
