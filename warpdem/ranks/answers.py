"""Force slots of contacts between grains of two ranks: there films answer the wishes of bridges (``kernels.contact.films``)."""

import numpy as np

from warpdem.state.listed_contacts import ListedContacts


def shared_slots(contacts: ListedContacts, rank_of_ghost: np.ndarray) -> dict[int, tuple[np.ndarray, np.ndarray]]:
    """Force slots of the contacts with ghosts, by the rank that owns these; both ranks list the same contacts.

    Args:
        contacts: of the inner list of this rank.
        rank_of_ghost: rank that each ghost comes from, in the order of the memory slots, shape (ghosts,).

    Returns:
        Slots of the own grains, in order of the own id, then that of the ghost; slots of the ghosts, in order of the ghost's
        id, then the own: what one rank sends is in the order in which the other receives it.
    """
    state = contacts.state
    if not (state.slots and contacts.contact_count):
        return {}
    assert contacts.owner is not None and contacts.partner is not None
    assert contacts.slot_i is not None and contacts.slot_j is not None
    lane, ids = contacts.real_lanes(), state.id.numpy()
    i, j, slot_i, slot_j = (
        values.numpy().ravel()[lane] for values in (contacts.owner, contacts.partner, contacts.slot_i, contacts.slot_j)
    )
    between = np.flatnonzero((i >= state.owned) | (j >= state.owned))
    i, j, slot_i, slot_j = i[between], j[between], slot_i[between], slot_j[between]
    ghost_first = i >= state.owned
    own, ghost = np.where(ghost_first, j, i), np.where(ghost_first, i, j)
    own_slot, ghost_slot = np.where(ghost_first, slot_j, slot_i), np.where(ghost_first, slot_i, slot_j)
    rank, out = rank_of_ghost[ghost - state.owned], {}
    for number in np.unique(rank):
        here = np.flatnonzero(rank == number)
        sent = here[np.lexsort((ids[ghost[here]], ids[own[here]]))]
        received = here[np.lexsort((ids[own[here]], ids[ghost[here]]))]
        out[int(number)] = own_slot[sent], ghost_slot[received]
    return out
