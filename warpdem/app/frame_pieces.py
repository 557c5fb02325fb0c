"""Frames in pieces: each rank writes its own grains, then the first one what joins them."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from warpdem.core.snapshot import WallLoad
from warpdem.measure.snapshot import take_loads
from warpdem.output import own_pieces
from warpdem.output.formats import JoiningWriter
from warpdem.output.own_pieces import OwnPieces
from warpdem.ranks.front import Front
from warpdem.simulation import Simulation


def in_pieces(sim: Simulation) -> bool:
    """Whether the frames of a run are written in pieces, by its scene alone: a run that goes on does it in the same way."""
    return own_pieces.in_pieces(sim.scene, len(sim.expected.id))


class Pieces:
    """The frames of a run in pieces.

    Args:
        sim: the run.
        folder: where the results go.
        resume: keep the frames of an earlier run that come before the first new one.
        joiners: what joins the pieces, for each format.
    """

    def __init__(self, sim: Simulation, folder: Path, resume: bool, joiners: list[JoiningWriter]) -> None:
        self._sim, self._joiners = sim, joiners
        self._front = sim.loop if isinstance(sim.loop, Front) else None
        self._own: OwnPieces
        self._found: list[list[Any]] = []
        self._loads: dict[str, WallLoad] = {}
        if self._front is not None:
            self._front.on_all("open_pieces", folder.absolute(), resume)
            self._own = self._front.rank.pieces
        else:
            self._own = OwnPieces(sim.scene, folder, 0, resume)

    def write(self) -> None:
        """Write the pieces of the present time, whose forces are evaluated, all ranks at once.

        Raises:
            OutputError: a rank cannot write its own.
        """
        self._loads = take_loads(self._sim.live)
        self._found = self._front.write_pieces() if self._front is not None else [self._own.write(self._sim.live)]

    def join(self) -> None:
        """Write what joins the pieces that were written last.

        Raises:
            OutputError: it cannot be written.
        """
        around = replace(self._own.around, loads=self._loads)
        for joiner, pieces in zip(self._joiners, zip(*self._found, strict=True), strict=True):
            joiner.join(around, pieces)

    def close(self) -> None:
        """Close the files of this rank that join the pieces."""
        for joiner in self._joiners:
            joiner.close()
