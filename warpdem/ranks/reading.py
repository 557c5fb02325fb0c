"""What is read of a rank: its part of sums and frames; and all grains and contacts, gathered where they are written as one."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

from warpdem.engine.engine import Engine
from warpdem.measure.part import Part
from warpdem.output.own_pieces import OwnPieces
from warpdem.ranks import transfer
from warpdem.ranks.pieces import on_each
from warpdem.ranks.portion import OF_GRAINS, Portion, Table
from warpdem.ranks.world import World
from warpdem.state import contact_history
from warpdem.state.blocks import Rows, made
from warpdem.state.particles import State, changed
from warpdem.state.view import RunView

OF_FORCES = ("pair_share_", "wall_load", "wall_entry", "wall_power")
"""How the names of arrays begin that a rebuild makes again."""


class RankReadings:
    """The readings of a rank, each of which is called on all ranks together; ``Rank`` inherits them.

    Attributes:
        world: the ranks.
        state: own grains, then ghosts.
        engine: steps them.
        view: the rank as readers see it.
        sends: own grains that others see as ghosts: their memory slots by rank.
        rank_of_ghost: rank that each ghost comes from, in the order of the memory slots, shape (ghosts,).
        pieces: what this rank writes of the frames, once ``open_pieces`` was called.
        gathers: how often all grains and contacts were gathered on rank 0.
    """

    world: World
    state: State
    engine: Engine
    view: RunView
    pieces: OwnPieces

    def __init__(self) -> None:
        self.sends: dict[int, np.ndarray] = {}
        self.rank_of_ghost = np.zeros(0, dtype=np.int64)
        self.gathers = 0

    def evaluate(self) -> None:
        """Evaluate the forces of the present time if they are not."""
        raise NotImplementedError

    # -- sums -----------------------------------------------------------------------------------

    def read(self, read: Callable[[Part], Any]) -> list[Any]:
        """What ``read`` gives of the part of each rank, the forces of the present time evaluated; on rank 0."""
        return self.world.gathered(read(Part(self.view)))

    def extremes(self) -> np.ndarray:
        """Largest overlaps and approach speeds on all ranks, as ``Engine.extreme``."""
        return self.world.largest(self.engine.extreme)

    def read_ghosts(self, velocity: wp.array, spin: wp.array) -> None:
        """Take over what the owners of ghosts have read: a rank does not know all forces on these."""
        with changed(velocity) as v, changed(spin) as w:
            out: list[np.ndarray | None] = [None] * self.world.size
            for rank, rows in self.sends.items():
                out[rank] = np.concatenate([v[rows], w[rows]], axis=1)
            for rank, values in enumerate(self.world.swapped(out)):
                if values is not None:
                    rows = self.state.owned + np.flatnonzero(self.rank_of_ghost == rank)
                    v[rows], w[rows] = values[:, :3], values[:, 3:]

    # -- frames in pieces -----------------------------------------------------------------------

    def open_pieces(self, folder: Path, resume: bool) -> None:
        """Let each rank write its pieces of the frames to ``folder``, of a run that goes on if ``resume``."""
        on_each(self.world, lambda: self._open_pieces(folder, resume))

    def _open_pieces(self, folder: Path, resume: bool) -> None:
        self.pieces = OwnPieces(self.view.model.scene, folder, self.world.rank, resume)

    def write_pieces(self) -> list[list[Any]]:
        """Write the pieces of the present time; what joins them, for each rank and format, on rank 0."""
        self.evaluate()
        return on_each(self.world, lambda: self.pieces.write(self.view))

    # -- the whole ------------------------------------------------------------------------------

    def gather(self) -> tuple[Portion, list[dict[str, np.ndarray]]] | None:
        """All grains with the forces of the present time, and the digits of the sums of each rank; on rank 0."""
        self.evaluate()
        whole, digits = self.whole(self.view), self.world.gathered(self.engine.digits)
        return (whole, digits) if whole is not None else None

    def whole(self, view: RunView) -> Portion | None:
        """All grains with the forces of the last force call, at the time of ``view``; on rank 0."""
        mine = self.own(view)
        mine.keep_owned_pairs()
        self.gathers += 1
        return transfer.gather(self.world, mine)

    def gather_grains(self) -> Portion | None:
        """All grains as they are, without contacts; on rank 0."""
        slots = self.state.rank[self.state.rank < self.state.owned]
        return transfer.gather(self.world, Portion.of(self.arrays_of(self.state, slots)))

    def own(self, view: RunView, forces: bool = True) -> Portion:
        """The own grains with their contacts.

        Args:
            view: the rank at the time of its last force call.
            forces: with the forces.
        """
        state = self.state
        slots = state.rank[state.rank < state.owned]
        contacts = {k: v for k, v in contact_history.read(view).items() if forces or not k.startswith(OF_FORCES)}
        position = np.flatnonzero(state.rank < state.owned)
        beside = {name: made(contacts[name])[position] for name in contacts.keys() & set(OF_GRAINS)}
        return Portion.of({**contacts, **self.arrays_of(state, slots), **beside}).made()

    @staticmethod
    def arrays_of(state: State, slots: np.ndarray) -> Table:
        """Arrays of a checkpoint of the grains in memory slots ``slots``, whole clumps, in their order."""
        clumps = state.clumps.arrays(slots) if state.clumps is not None else {}
        return {name: Rows.picked(values, slots) for name, values in state.arrays().items()} | clumps
