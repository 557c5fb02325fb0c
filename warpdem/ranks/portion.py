"""Grains with their contacts and clumps, on the way from rank to rank: arrays of a checkpoint, by what their rows belong to.

A clump is on the rank of its first member, with all others: by its number a checkpoint knows it, here by that member's id.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from warpdem.filling.clump_grains import NONE
from warpdem.kernels import grain
from warpdem.state.blocks import each_block, made
from warpdem.state.clumps import OF_CLUMPS

Table = dict[str, Any]
"""Arrays by name, or rows that are made when they are asked for (``state.blocks.Rows``)."""
PAIRS, POINTS = "pair", "wall_contact_"
"""How the names of arrays begin that have a row per contact between grains, and per contact point at a wall."""
OF_GRAINS = (
    "record", "inverse", "id", "material", "group", "came", "orientation", "energies", "momenta", "wall_work", "flow",
    "wall_load", "wall_entry", "wall_power", "film", "clump_arm",
)  # fmt: skip
"""Arrays that have a row per grain."""
NUMBERS_OF_CLUMPS = tuple(f"clump_{name}" for name in (*OF_CLUMPS, "template", "axes") if name != "first")
"""Arrays that have a row per clump."""
OF_GHOSTS = ("record", "inverse", "id", "material")
"""Those that a ghost needs: to its neighbors it is no member of a clump, as all members of one are on one rank."""


@dataclass
class Portion:
    """Some grains, what their contacts remember, and the forces there if they are known."""

    grains: Table
    """Rows in ascending order of ``id``."""
    pairs: Table
    """Contacts between grains of which one at least is among them, by the ids in ``pair``."""
    points: Table
    """Contact points at walls, by the id in ``wall_contact_grain``; those of a grain in their order."""
    clumps: Table = field(default_factory=dict)
    """Clumps in ascending order of ``id``, that of their first member, which ``clump`` of the grains names; -1: of its own."""

    @classmethod
    def of(cls, data: Mapping[str, Any]) -> "Portion":
        """What a checkpoint, or arrays of the same names, hold of grains; rows that are not made stay so but for ids."""
        grains = {name: data[name] for name in OF_GRAINS if name in data}
        pairs = {name: data[name] for name in data if name.startswith(PAIRS)}
        points = {name: data[name] for name in data if name.startswith(POINTS)}
        for table, name in (grains, "id"), (pairs, "pair"), (points, f"{POINTS}grain"):
            if name in table:
                table[name] = made(table[name])
        clumps: Table = {}
        if "clump_of_grain" in data:
            number = made(data["clump_of_grain"])
            first = np.flatnonzero((number != NONE) & (np.concatenate([[NONE], number[:-1]]) != number))
            first = first[np.argsort(number[first])]
            clumps = {"id": grains["id"][first]} | {name: data[name] for name in NUMBERS_OF_CLUMPS}
            grains["clump"] = np.append(clumps["id"], NONE)[number]
        return cls(grains, pairs, points, clumps)

    def made(self) -> "Portion":
        """The same, all rows made."""
        tables = self.grains, self.pairs, self.points, self.clumps
        return Portion(*({name: made(values) for name, values in table.items()} for table in tables))

    def __len__(self) -> int:
        return len(self.grains["id"])

    def key(self, table: str) -> np.ndarray:
        """What the rows of a table are in ascending order of, shape (rows, numbers)."""
        names = {"grains": "id", "pairs": "pair", "points": f"{POINTS}grain", "clumps": "id"}
        found: np.ndarray = getattr(self, table).get(names[table], np.zeros((0, 1 + (table == "pairs")), dtype=np.int64))
        return found if found.ndim == 2 else found[:, None]

    @property
    def data(self) -> Table:
        """The arrays of a checkpoint."""
        return {**numbered(self.grains, self.clumps), **self.pairs, **self.points}

    @property
    def places(self) -> np.ndarray:
        """Positions that say on which rank grains are [m], shape (n, 3): of a member that of the first of its clump."""
        blocks = [block[:, grain.POSITION] for _, block in each_block(self.grains["record"])]
        position = np.concatenate(blocks) if blocks else np.zeros((0, 3))
        return position[self._leads] if self.clumps else position

    @property
    def _leads(self) -> np.ndarray:
        """Row of the first member of the clump of each grain, its own of others, shape (n,)."""
        of = self.grains["clump"]
        return np.where(of == NONE, np.arange(len(of)), np.searchsorted(self.grains["id"], of))

    def bodies_of(self, some: np.ndarray) -> np.ndarray:
        """The grains of a mask, shape (n,), and all other members of their clumps, as a mask."""
        if not self.clumps:
            return some
        leads, of_lead = self._leads, np.zeros(len(some), dtype=bool)
        of_lead[leads[some]] = True
        out: np.ndarray = of_lead[leads]
        return out

    def split(self, owner: np.ndarray, parts: int) -> list["Portion"]:
        """What each of ``parts`` ranks gets; ``owner``: the rank of each grain, shape (n,)."""
        tables = self.grains, self.pairs, self.points, self.clumps
        each = zip(*self.shares(owner, parts), strict=True)
        return [Portion(*map(_rows, tables, rows)) for rows in each]

    def shares(self, owner: np.ndarray, parts: int) -> list[list[np.ndarray]]:
        """Rows of grains, pairs, points and clumps that each of ``parts`` ranks gets, ascending; ``owner`` as of ``split``."""
        ids, none = self.grains["id"], np.zeros(0)
        sides = [_looked_up(ids, owner, self.pairs["pair"][:, k]) for k in (0, 1)] if self.pairs else [none]
        of_point = _looked_up(ids, owner, self.points[f"{POINTS}grain"]) if self.points else none
        of_clump = _looked_up(ids, owner, self.clumps["id"]) if self.clumps else none
        of_rows = [owner], sides, [of_point], [of_clump]
        return [[np.flatnonzero(np.any([of == rank for of in each], axis=0)) for rank in range(parts)] for each in of_rows]

    @classmethod
    def joined(cls, parts: Iterable["Portion"]) -> "Portion":
        """All together; a contact that several hold, with the same bits, counts once."""
        each = list(parts)
        grains, pairs, points, clumps = (
            _joined([getattr(one, name) for one in each]) for name in ("grains", "pairs", "points", "clumps")
        )
        grains = _rows(grains, np.argsort(grains["id"], kind="stable"))
        if clumps:
            clumps = _rows(clumps, np.argsort(clumps["id"]))
        if pairs:
            order = np.lexsort((pairs["pair"][:, 1], pairs["pair"][:, 0]))
            pair = pairs["pair"][order]
            first = np.ones(len(order), dtype=bool)
            first[1:] = (pair[1:] != pair[:-1]).any(axis=1)
            pairs = _rows(pairs, order[first])
        if points:
            points = _rows(points, np.argsort(points["wall_contact_grain"], kind="stable"))
        return cls(grains, pairs, points, clumps)

    def with_grains(self, new: "Portion") -> "Portion":
        """The same with grains that touch nothing yet, whose ids are higher."""
        grains = _joined([self.grains, {name: new.grains[name] for name in self.grains}])
        return Portion(grains, self.pairs, self.points, _joined([self.clumps, new.clumps]))

    def around(self, some: np.ndarray) -> "Portion":
        """The grains with ids ``some`` and those in contact with them, whole clumps; contacts with ``some``, points of all."""
        pairs, near = self.pairs, some
        if pairs:
            pairs = _rows(pairs, np.flatnonzero(np.isin(pairs["pair"], some).any(axis=1)))
            near = np.union1d(some, pairs["pair"])
        kept = np.flatnonzero(self.bodies_of(np.isin(self.grains["id"], near)))
        ids = self.grains["id"][kept]
        points, clumps = (
            _rows(table, np.flatnonzero(np.isin(table[name], ids))) if table else table
            for table, name in ((self.points, f"{POINTS}grain"), (self.clumps, "id"))
        )
        return Portion(_rows(self.grains, kept), pairs, points, clumps)

    def keep_owned_pairs(self) -> None:
        """Keep of the contacts between grains those whose lower id is among the grains: each on one rank."""
        if self.pairs:
            mine = _looked_up(self.grains["id"], np.zeros(len(self), dtype=np.int64), self.pairs["pair"][:, 0])
            self.pairs = _rows(self.pairs, np.flatnonzero(mine == 0))

    def among(self, ids: np.ndarray) -> Table:
        """Contacts between grains of which both are among ``ids``, ascending: where one is out of sight they have parted."""
        if not self.pairs or not len(self.pairs["pair"]) or not len(ids):
            return self.pairs
        pair = self.pairs["pair"]
        at = np.minimum(np.searchsorted(ids, pair), len(ids) - 1)
        return _rows(self.pairs, np.flatnonzero((ids[at] == pair).all(axis=1)))


def numbered(grains: Table, clumps: Table) -> Table:
    """Arrays of grains and clumps as a checkpoint has them, where a grain has the number of its clump."""
    if not clumps:
        return grains
    of, out = grains["clump"], {name: values for name, values in grains.items() if name != "clump"}
    number = np.where(of == NONE, NONE, np.searchsorted(clumps["id"], of))
    return out | {"clump_of_grain": number} | {name: clumps[name] for name in NUMBERS_OF_CLUMPS}


def with_ghosts(grains: Table, ghosts: list[Table]) -> tuple[Table, np.ndarray]:
    """Own grains and ghosts together, in order of id, and the place of each there: own first, ghosts as they are given.

    All other arrays of a ghost are zero, as nothing reads them, and it belongs to no clump.
    """
    count = sum(len(one["id"]) for one in ghosts)
    both = {}
    for name, values in grains.items():
        if name in OF_GHOSTS:
            both[name] = np.concatenate([values, *(one[name] for one in ghosts)])
        else:
            unknown = NONE if name == "clump" else 0
            both[name] = np.concatenate([values, np.full((count, *values.shape[1:]), unknown, dtype=values.dtype)])
    by_id = np.argsort(both["id"], kind="stable")
    place = np.empty(len(by_id), dtype=np.int64)
    place[by_id] = np.arange(len(by_id))
    return _rows(both, by_id), place


def _rows(table: Table, index: np.ndarray) -> Table:
    return {name: values[index] for name, values in table.items()}


def _joined(tables: list[Table]) -> Table:
    """All rows; empty tables do not count, whose numbers may be of another type."""
    tables = [table for table in tables if table and len(next(iter(table.values())))] or tables[:1]
    return {name: np.concatenate([table[name] for table in tables]) for name in tables[0]}


def _looked_up(ids: np.ndarray, owner: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Owner of the grains ``wanted``, -1 of those that are not among ``ids``, which ascend."""
    if not len(ids):
        return np.full(len(wanted), -1)
    at = np.minimum(np.searchsorted(ids, wanted), len(ids) - 1)
    return np.where(ids[at] == wanted, owner[at], -1)
