"""The contacts of a run by column, in the order of the lists: each column is made when it is asked for.

Most readings need few of the columns, and no order: sums over them are exact. ``observers.read_contacts`` gives all of them, by
ids.
"""

from functools import cached_property

import numpy as np
import warp as wp

from warpdem.kernels.contact.columns import LOAD, TWIST
from warpdem.kernels.contact.liquid import COUNT
from warpdem.kernels.measure import readings as kernels
from warpdem.measure.sums import Reader
from warpdem.model.impact import own_constants, own_of, stiffness
from warpdem.state.listed_contacts import ListedContacts
from warpdem.state.view import RunView


class ContactColumns:
    """Touching pairs of grains, then contacts with walls, from the results of the last force call.

    To be read before the run goes on or reads its contacts once more: what a column is made of stays in the arrays of the run.
    Names and units of the columns are those of ``observers.Contacts``.

    Args:
        view: the run.
        reader: launches on its device.
        since: steps since that force call.
        listed: the contacts of its lists, where the reader has asked for them already.
    """

    def __init__(self, view: RunView, reader: Reader, since: int = 0, listed: ListedContacts | None = None) -> None:
        self._view, self._lists, self._since = view, listed or view.contacts, since
        self._law, self._state, self._reader = view.model.features.contact, view.state, reader
        self._find_pairs(reader)
        self._find_wall_contacts()

    def _find_pairs(self, reader: Reader) -> None:
        """Lanes and overlap of the touching pairs."""
        lists, model = self._lists, self._view.model
        self._lane, self._pair_overlap = np.zeros(0, dtype=np.int64), np.zeros(0)
        if not len(self._state) or not lists.contact_count:
            return
        assert lists.owner is not None and lists.partner is not None
        assert lists.slot_i is not None and lists.slot_force is not None
        owner, partner, slot = (reader.flat(k, getattr(lists, k)) for k in ("owner", "partner", "slot_i"))
        count, record = owner.shape[0], reader.plain("record", self._state.record)
        overlap, normal = (reader.buffer(k, (count,), t) for k, t in (("overlap", wp.float64), ("normal", wp.vec3d)))
        period = self._view.kept.setdefault("period", wp.vec3d(*model.domain.period))  # the same for each launch
        inputs = owner, partner, slot, lists.slot_force.shape[0] - 1, period, overlap, normal
        reader.each(kernels.pair_overlaps, count, record, *inputs)
        overlaps = overlap.numpy()
        acts = overlaps > -self._law.force_gap
        if self._law.wet:
            assert lists.history is not None
            held = lists.history.numpy()[:, self._law.history.of(COUNT), :].reshape(-1) > 0.0
            acts |= held & (overlaps > -self._law.gap)  # lanes without a contact are further apart, and hold anything
        self._lane = np.flatnonzero(acts)
        self._pair_overlap, self._normals = overlaps[self._lane], normal

    @cached_property
    def _record(self) -> np.ndarray:
        return self._state.record.numpy()

    @cached_property
    def _ids(self) -> np.ndarray:
        return self._state.id.numpy()

    @cached_property
    def _a(self) -> np.ndarray:
        """Memory slots of i of the pairs."""
        return self._of_lanes("owner")

    @cached_property
    def _b(self) -> np.ndarray:
        """Memory slots of j of the pairs."""
        return self._of_lanes("partner")

    def _of_lanes(self, name: str) -> np.ndarray:
        if not self.pairs:
            return np.zeros(0, dtype=np.int64)
        return self._reader.flat(name, getattr(self._lists, name)).numpy()[self._lane]

    @cached_property
    def _pair_normal(self) -> np.ndarray:
        return self._normals.numpy()[self._lane] if self.pairs else np.zeros((0, 3))

    def _find_wall_contacts(self) -> None:
        """Memory slot of the grain, history and results of each contact point at a wall."""
        lists, law = self._lists, self._law
        self._g, self._points = np.zeros(0, dtype=np.int64), {}
        if len(self._state) and self._view.model.walls is not None and lists.row_count:
            parity = (self._view.clock.step_number - self._since) & 1
            slot, self._g = lists.point_slots(parity, lists.wall_grains)
            self._points = lists.contact_points(parity, slot)
            if law.wet:
                acts = np.flatnonzero((self._points["overlap"] > -law.force_gap) | (self._points[COUNT] > 0.0))
                self._g = self._g[acts]
                self._points = {name: values[acts] for name, values in self._points.items()}
        # of how many pairs, and whether there are contacts at walls
        self.pairs, self._walls = len(self._lane), bool(self._points)
        self._law = law

    def __len__(self) -> int:
        return self.pairs + len(self._g)

    @property
    def counted(self) -> np.ndarray | None:
        """Those that count in this process, where they are in the lists of others too; None: all."""
        state = self._state
        if not state.ghosts:
            return None
        own = self._a < state.owned
        return np.flatnonzero(self._joined(own, np.ones(len(self._g), dtype=bool)))

    def _joined(self, of_pairs: np.ndarray, at_walls: np.ndarray) -> np.ndarray:
        return np.concatenate([of_pairs, at_walls]) if self._walls else of_pairs

    def _history(self, name: str) -> np.ndarray:
        """Contact history of the pairs, shape (pairs,) or (pairs, 3)."""
        at, shape = self._law.history, (3,) if name in ("spring", "angle") else ()
        if name not in at or not self.pairs:
            return np.zeros((self.pairs, *shape))
        assert self._lists.history is not None
        history = self._lists.history.numpy()
        column = history[:, at.of(name), :]
        if shape:
            return column.transpose(0, 2, 1).reshape(-1, 3)[self._lane]
        return column.reshape(-1)[self._lane]

    def _constant(self, name: str) -> np.ndarray:
        """What does not change of the pairs, shape (pairs,)."""
        if not self.pairs:
            return np.zeros(0)
        return self._constants[:, self._law.constants.of(name), :].reshape(-1)[self._lane]

    @cached_property
    def _constants(self) -> np.ndarray:
        return self._lists.constants().numpy()

    def _at_walls(self, name: str) -> np.ndarray:
        """A quantity of the contact points at walls, zero where the law has none, shape (c,) or (c, 3)."""
        return self._points[name] if name in self._points else np.zeros((len(self._g), 3))

    @cached_property
    def _wall_rows(self) -> np.ndarray:
        """Rows of the table of coefficients, shape (c, numbers); all in one where there is one."""
        run, law = self._view.model, self._law
        if not law.table:
            return run.coefficient_table[:1]
        assert run.walls is not None
        kind = self._state.material.numpy()[self._g]
        return run.coefficient_table[kind * law.materials + run.walls.material[self._points["wall"]]]

    @cached_property
    def _wall_own(self) -> dict[str, np.ndarray]:
        law, radius = self._law, self._record[self._g, 3]
        own = own_constants(law.normal, own_of(law.normal, self._wall_rows), radius)
        return {name: np.broadcast_to(values, radius.shape) for name, values in own.items()}

    # -- columns --------------------------------------------------------------------------------

    @cached_property
    def i(self) -> np.ndarray:
        """Id of the grain."""
        return self._joined(self._ids[self._a], self._ids[self._g])

    @cached_property
    def j(self) -> np.ndarray:
        """Id of the partner, or -1 - w for wall w."""
        return self._joined(self._ids[self._b], -1 - self._points["wall"] if self._walls else self._g)

    @cached_property
    def overlap(self) -> np.ndarray:
        """Overlap [m]."""
        return self._joined(self._pair_overlap, self._points.get("overlap", self._g))

    @cached_property
    def normal(self) -> np.ndarray:
        """From j to i."""
        return self._joined(self._pair_normal, self._points.get("normal", self._g))

    @cached_property
    def force(self) -> np.ndarray:
        """On i [N]."""
        if not self.pairs:
            return self._points["force"] if self._walls else np.zeros((0, 3))
        assert self._lists.slot_force is not None and self._lists.slot_i is not None
        pairs = self._lists.slot_force.numpy()[self._lists.slot_i.numpy().ravel()[self._lane], :3]
        return self._joined(pairs, self._points.get("force", self._g))

    @cached_property
    def spring(self) -> np.ndarray:
        """Tangential spring [m]."""
        return self._joined(self._history("spring"), self._at_walls("spring"))

    @cached_property
    def spring_square(self) -> np.ndarray:
        """Square of the length of the tangential spring [m2]."""
        at_walls = self._at_walls("spring")
        squares = np.zeros(self.pairs)
        if self.pairs and "spring" in self._law.history:
            assert self._lists.history is not None
            column = self._lists.history.numpy()[:, self._law.history.of("spring"), :]
            squares = np.einsum("bfl,bfl->bl", column, column).reshape(-1)[self._lane]
        return self._joined(squares, np.einsum("ij,ij->i", at_walls, at_walls))

    @cached_property
    def angle(self) -> np.ndarray:
        """Rolling spring [rad]."""
        return self._joined(self._history("angle"), self._at_walls("angle"))

    @cached_property
    def twist(self) -> np.ndarray:
        """Twisting spring [rad]."""
        return self._joined(self._history(TWIST), self._points.get(TWIST, np.zeros(len(self._g))))

    @cached_property
    def point(self) -> np.ndarray:
        """Contact point [m]."""
        a, g, overlap = self._record[self._a], self._record[self._g], self.overlap
        pairs = a[:, :3] - self._pair_normal * (a[:, 3] - 0.5 * self._pair_overlap)[:, None]
        if not self._walls:
            return pairs
        return self._joined(pairs, g[:, :3] - self._points["normal"] * (g[:, 3] - overlap[self.pairs :])[:, None])

    @cached_property
    def share(self) -> np.ndarray:
        """Overlap over the smaller radius [-]."""
        radius = self._record[:, 3]
        return self.overlap / self._joined(np.minimum(radius[self._a], radius[self._b]), radius[self._g])

    @cached_property
    def radius(self) -> np.ndarray:
        """R* [m]."""
        radius = self._record[:, 3]
        a, b = radius[self._a], radius[self._b]
        return self._joined(a * b / (a + b), radius[self._g])

    @cached_property
    def weight(self) -> np.ndarray:
        """Fraction of a full contact [-]."""
        return self._joined(np.ones(self.pairs), self._points.get("weight", self._g))

    @cached_property
    def stiffness(self) -> np.ndarray:
        """Constant of the normal law."""
        pairs = self._constant("stiffness")
        if not self._walls:
            return pairs
        # the law is linear in its constant: a contact point that carries part of a force has that part of it
        base = self._wall_rows[:, self._law.coefficients.stiffness]
        return self._joined(pairs, stiffness(self._law.normal, base, self._record[self._g, 3]) * self._points["weight"])

    @cached_property
    def load(self) -> np.ndarray:
        """Coulomb load of the force call [N]."""
        if LOAD not in self._law.history:  # of a law without numbers of its own
            return np.maximum(np.einsum("ij,ij->i", self.force, self.normal), 0.0)
        at_walls = self._points[LOAD] * self._points["weight"] if self._walls else np.zeros(0)
        return self._joined(self._history(LOAD), at_walls)

    @cached_property
    def bridge(self) -> np.ndarray:
        """Liquid in the bridge [m3]; 0 without one."""
        liquid = self._view.model.liquid
        if liquid is None:
            return np.zeros(len(self))
        counts = self._joined(self._history(COUNT), self._points.get(COUNT, np.zeros(len(self._g))))
        return np.maximum(counts, 0.0) * liquid.quantum

    @cached_property
    def own(self) -> dict[str, np.ndarray]:
        """The normal law's own constants and history by name."""
        none = np.zeros(0)
        constants = {
            name: self._joined(self._constant(name), self._wall_own[name] if self._walls else none)
            for name in self._law.own_constants
        }
        history = {
            name: self._joined(self._history(name), self._points.get(name, none)) for name in self._law.own_history
        }
        return constants | history

    @cached_property
    def coefficients(self) -> np.ndarray:
        """Coefficients, columns as of ``ContactFeatures.coefficients``, shape (c, their number)."""
        table, law = self._view.model.coefficient_table, self._law
        if not law.table:
            return np.broadcast_to(table[:1], (len(self), table.shape[1]))
        kind = self._state.material.numpy()
        pairs = table[kind[self._a] * law.materials + kind[self._b]]
        return self._joined(pairs, self._wall_rows if self._walls else self._g)

    def slots(self) -> tuple[np.ndarray, np.ndarray]:
        """Memory slots of i and of j, that of a wall being the number of slots; shapes (c,)."""
        walls = np.full(len(self._g), self._state.slots)
        return self._joined(self._a, self._g), self._joined(self._b, walls)
