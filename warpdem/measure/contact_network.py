"""The contacts of a run as lines with what they carry: the network that force chains show."""

import numpy as np
import warp as wp

from warpdem.core.snapshot import ContactNetwork
from warpdem.kernels import grain
from warpdem.measure.observers import coefficients_of, read_contacts
from warpdem.state.view import RunView

# of a force cut to the Coulomb limit, by the law's precision [-]
_ROUNDING: dict[type, float] = {wp.float64: 1.0e-9, wp.float32: 1.0e-4}


def read_network(view: RunView) -> ContactNetwork:
    """Contacts of a run at the time of the view, from the results of its last force call.

    F_n = F . n,  F_t = F - F_n n; a contact slides where |F_t| = mu L > 0, to the rounding of the law. L is the law's Coulomb
    load: max(F_n, 0), or what a normal law with numbers of its own says (``kernels.contact.normal_law``).
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
    limit = coefficients_of(view, contacts)[:, features.contact.coefficients.friction] * contacts.load
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
    )
