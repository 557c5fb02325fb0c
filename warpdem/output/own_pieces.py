"""The pieces of the frames that one process writes: its own grains, with their contacts and clumps."""

from pathlib import Path
from typing import Any

from warpdem.core.atomic_file import not_written
from warpdem.core.snapshot import Snapshot
from warpdem.measure.snapshot import take_snapshot
from warpdem.output.formats import FORMATS
from warpdem.output.pieces import piece_of, without_grains
from warpdem.scene.model import Scene
from warpdem.state.view import RunView

MANY = 20_000_000
"""Grains at the start of a scene above which frames are written in pieces, where it leaves that open."""


def in_pieces(scene: Scene, grains: int) -> bool:
    """Whether the frames of a scene that begins with so many grains are in pieces, on any number of ranks, also on one."""
    return scene.output.pieces == "ranks" or (scene.output.pieces == "auto" and grains > MANY)


class OwnPieces:
    """The writers of the pieces of one process, for each format of the scene.

    Args:
        scene: the scene that is run.
        folder: where the results go.
        part: number of the process.
        resume: keep the frames of an earlier run that come before the first new one.

    Attributes:
        around: the last frame without grains, contacts, clumps and loads.

    Raises:
        OutputError: the folder cannot be written.
    """

    def __init__(self, scene: Scene, folder: Path, part: int, resume: bool) -> None:
        makers = [FORMATS[name].piece for name in scene.output.formats]
        try:
            self._writers = [make(folder, part, scene, resume) for make in makers]
        except OSError as error:
            raise not_written(folder, error) from error
        self.around: Snapshot

    def write(self, view: RunView) -> list[Any]:
        """Write the pieces of the present time; returns what joins them, for each format.

        Args:
            view: the process's part of the run, its forces evaluated; of ghosts nothing is written.

        Raises:
            OutputError: a file cannot be written.
        """
        state = view.state
        piece = piece_of(take_snapshot(view, loads=False), state.rank < state.owned)
        self.around = without_grains(piece)
        return [writer.write(piece) for writer in self._writers]
