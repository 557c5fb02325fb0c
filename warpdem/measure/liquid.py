"""Where the liquid of a run is, in whole counts: in films, in bridges, with grains that have left, and what walls have given.

    films + bridges + left - from walls  =  what the grains brought

holds to the last count at any time: nothing here is a difference of the other terms.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from warpdem.errors import SceneError
from warpdem.kernels.contact.films import FILM_AT, RELEASED
from warpdem.kernels.contact.liquid import COUNT
from warpdem.measure.part import Each, Part
from warpdem.state.liquid_account import gifts
from warpdem.state.listed_contacts import ListedContacts
from warpdem.state.view import RunView


@dataclass(frozen=True)
class LiquidTotals:
    """The liquid of a run at one time [counts]; volumes are ``quantum`` times these [m3]."""

    films: int
    """On the grains, with what broken bridges are about to give back to them."""
    bridges: int
    """In bridges."""
    bridge_count: int
    """Bridges."""
    from_walls: int
    """Given by wet walls, less what they got back."""
    left: int
    """Gone with grains that left the domain."""
    quantum: float
    """Volume of a count [m3]."""

    @property
    def brought(self) -> int:
        """What the grains have brought [counts]: the same for ever, but for grains that come."""
        return self.films + self.bridges + self.left - self.from_walls

    def volume(self, name: str) -> float:
        """Volume of ``films``, ``bridges``, ``from_walls``, ``left`` or ``brought`` [m3]."""
        return float(getattr(self, name) * self.quantum)


class LiquidCounts(NamedTuple):
    """What the grains and contacts of one process hold [counts]; they add up to ``LiquidTotals``."""

    films: int
    bridges: int
    bridge_count: int
    from_walls: int
    left: int


def read_liquid(each: Each, view: RunView) -> LiquidTotals:
    """The liquid of a run at the time of the view.

    Args:
        each: of ``Totals``.
        view: the run, the forces of its present time evaluated.

    Raises:
        SceneError: the scene has no law of bridges.
    """
    state, liquid = view.state, view.model.liquid
    if liquid is None or state.film is None:
        raise SceneError(f'{view.model.scene.source}: contact.liquid = "none": there is no liquid')
    found = LiquidCounts(*(sum(each_one) for each_one in zip(*each(own_liquid), strict=True)))
    gone = state.liquid_left
    left = found.left + int(gone[FILM_AT.film] + gone[FILM_AT.returned])
    drawn = found.from_walls + int(gone[FILM_AT.drawn])
    return LiquidTotals(found.films, found.bridges, found.bridge_count, drawn, left, liquid.quantum)


def own_liquid(part: Part) -> LiquidCounts:
    """What the grains of one process hold, those that have left but are still in memory too."""
    view, state = part.view, part.view.state
    assert state.film is not None
    film, here = state.film.numpy()[: state.owned], state.here[: state.owned]
    present, gone = film[here].sum(axis=0), film[~here].sum(axis=0)
    held, count, given, lost = 0, 0, 0, 0
    if len(state):
        lists = part.listed
        held, count, given, lost = (a + b for a, b in zip(_of_pairs(view, lists), _at_walls(view, lists), strict=True))
    films = int(present[FILM_AT.film] + present[FILM_AT.returned]) + given
    left = int(gone[FILM_AT.film] + gone[FILM_AT.returned]) + lost
    return LiquidCounts(films, held, count, int(present[FILM_AT.drawn] + gone[FILM_AT.drawn]), left)


def _of_pairs(view: RunView, lists: ListedContacts) -> tuple[int, int, int, int]:
    """Counts in bridges between grains, how many there are, counts given to grains that are present, and to others."""
    if not lists.contact_count or lists.owner is None:
        return 0, 0, 0, 0
    assert lists.history is not None and lists.slot_i is not None and lists.slot_force is not None
    history = lists.history.numpy()[:, view.model.features.contact.history.of(COUNT), :].ravel()
    owned = view.state.owned
    real = lists.slot_i.numpy().ravel() < lists.slot_force.shape[0] - 1
    if view.state.ghosts:
        real &= lists.owner.numpy().ravel() < owned
    held = history[real & (history > 0.0)]
    given, here = gifts(lists, view.state.slots)[:owned], view.state.here[:owned]
    return int(held.astype(np.int64).sum()), len(held), int(given[here].sum()), int(given[~here].sum())


def _at_walls(view: RunView, lists: ListedContacts) -> tuple[int, int, int, int]:
    """The same of bridges at walls; what one that broke held is its grain's, but for the half of a wet wall."""
    if lists.walls is None or not lists.row_count:
        return 0, 0, 0, 0
    assert view.model.liquid is not None
    slot, _ = lists.point_slots(view.clock.step_number & 1, lists.wall_grains)
    points = lists.contact_points(view.clock.step_number & 1, slot)
    held = points[COUNT][points[COUNT] > 0.0]
    freed = np.maximum(RELEASED - points[COUNT], 0.0) * (points[COUNT] < RELEASED)
    return int(held.astype(np.int64).sum()), len(held), int(freed.astype(np.int64).sum()), 0
