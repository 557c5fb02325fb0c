"""The contacts of a run as lines with what they carry: the network that force chains show."""

import numpy as np
import warp as wp

from warpdem.core.snapshot import ContactNetwork
from warpdem.kernels import grain
from warpdem.measure.elastic import LEAST_OVERLAP, elastic_normal_force, normal_secant
from warpdem.measure.observers import Contacts, coefficients_of, read_contacts
from warpdem.state.view import RunView

# of a force cut to the Coulomb limit, by the law's precision [-]
_ROUNDING: dict[type, float] = {wp.float64: 1.0e-9, wp.float32: 1.0e-4}


def read_network(view: RunView, damping: bool = True) -> ContactNetwork:
    """Contacts of a run at the time of the view, from the results of its last force call.

    F_n = F . n,  F_t = F - F_n n; a contact slides where |F_t| = mu L > 0, to the rounding of the law. L is the law's Coulomb
    load: max(F_n, 0), or what a normal law with numbers of its own says (``kernels.contact.normal_law``).

    The elastic part of a force is that of its springs, E'(d) n - k_t s, E the energy of the normal law; the damping part is the
    rest: dashpots, and what the Coulomb limit leaves of them.

    Args:
        view: the run.
        damping: whether the damping parts are worked out.
    """
    contacts = read_contacts(view)
    ids, position = view.state.ids, view.state.by_id(grain.POSITION)
    start = position[np.searchsorted(ids, contacts.i)]
    end = contacts.point.copy()
    pairs = contacts.j >= 0
    partner = position[np.searchsorted(ids, contacts.j[pairs])]
    end[pairs] = start[pairs] - view.model.domain.nearest(start[pairs] - partner)
    normal_force = np.einsum("ij,ij->i", contacts.force, contacts.normal)
    friction_force = contacts.force - normal_force[:, None] * contacts.normal
    features = view.model.features
    table = coefficients_of(view, contacts)
    limit = table[:, features.contact.coefficients.friction] * contacts.load
    reached = np.linalg.norm(friction_force, axis=1) >= (1.0 - _ROUNDING[features.backend.real]) * limit
    return ContactNetwork(
        i=contacts.i,
        j=np.where(pairs, contacts.j, -1),
        wall=np.where(pairs, -1, -1 - contacts.j).astype(np.int32),
        start=start,
        end=end,
        force=contacts.force,
        normal_force=normal_force,
        friction_force=friction_force,
        overlap=contacts.overlap,
        sliding=(reached & (limit > 0.0)).astype(np.int8),
        damping_force=contacts.force - _elastic_force(view, contacts, table) if damping else None,
        bridge=contacts.bridge if view.model.liquid is not None else None,
    )


def _elastic_force(view: RunView, contacts: Contacts, table: np.ndarray) -> np.ndarray:
    """Force of the springs of each contact on i [N], shape (c, 3); ``table``: coefficients of each contact."""
    law = view.model.features.contact
    out = elastic_normal_force(law.normal, contacts)[:, None] * contacts.normal
    if "spring" in law.history:
        k_n = normal_secant(law.normal, np.maximum(contacts.overlap, LEAST_OVERLAP), contacts)
        out = out - (table[:, law.coefficients.shear] * k_n)[:, None] * contacts.spring
    return out
