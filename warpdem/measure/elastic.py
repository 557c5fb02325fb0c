"""Energy and stiffness of contacts under the scene's laws."""

from collections.abc import Callable
from typing import Protocol

import numpy as np

from warpdem.model.features import ContactFeatures
from warpdem.model.impact import DIFFERENCE, elastic_energy, secant, tangent
from warpdem.scene.models import model
from warpdem.state.view import RunView

SPRINGS = ("normal", "tangential", "rolling")
"""What holds energy in a contact."""
LEAST_OVERLAP = 1.0e-100  # [m]: a law that acts beyond contact has contacts of none; its square is not yet zero


class NormalState(Protocol):
    """Contacts as a normal law sees them; columns as of ``observers.Contacts``."""

    @property
    def overlap(self) -> np.ndarray:
        """Overlap [m]."""

    @property
    def stiffness(self) -> np.ndarray:
        """Constant of the normal law."""

    @property
    def weight(self) -> np.ndarray:
        """Fraction of a full contact [-]."""

    @property
    def own(self) -> dict[str, np.ndarray]:
        """The normal law's own constants and history by name."""


class ElasticState(NormalState, Protocol):
    """Contacts with what their springs hold."""

    @property
    def spring_square(self) -> np.ndarray:
        """Square of the length of the tangential spring [m2]."""

    @property
    def twist(self) -> np.ndarray:
        """Twisting spring [rad]."""

    @property
    def angle(self) -> np.ndarray:
        """Rolling spring [rad]."""

    @property
    def radius(self) -> np.ndarray:
        """R* [m]."""

    @property
    def coefficients(self) -> np.ndarray:
        """Coefficients, columns as of ``ContactFeatures.coefficients``."""


def elastic_energies(view: RunView, contacts: ElasticState) -> dict[str, np.ndarray | None]:
    """Energy in the normal contact, the tangential and the rolling spring of each contact [J], shapes (c,).

    None where there is no such spring. A rolling law of the user with a spring says with ``energy(angle, spring)`` what is in
    it, as ``rolling.spring`` does.
    """
    law = view.model.features.contact
    at, there = law.coefficients, springs(law)
    normal = normal_energy(law.normal, contacts.overlap, contacts)
    out: dict[str, np.ndarray | None] = {**dict.fromkeys(SPRINGS), "normal": normal}
    if there["tangential"]:
        k_n = normal_secant(law.normal, np.maximum(contacts.overlap, LEAST_OVERLAP), contacts)
        table = contacts.coefficients
        out["tangential"] = 0.5 * table[:, at.shear] * k_n * contacts.spring_square
        if there["rolling"]:
            bent, rolling = _rolling_energy(law), np.zeros(len(k_n))
            if bent is not None:
                rolling = bent(contacts.angle, k_n * (table[:, at.rolling_friction] * contacts.radius) ** 2)
            if law.twisting is not None:
                area = contacts.radius * np.maximum(normal_depth(law.normal, contacts), 0.0)
                of_law = model("twisting", law.twisting).energy
                rolling = rolling + of_law(contacts.twist, np.sqrt(area), table[:, at.shear] * k_n)
            out["rolling"] = rolling
    return out


def springs(law: ContactFeatures) -> dict[str, bool]:
    """Which energies the contacts of a scene have, by the names of ``SPRINGS``."""
    tangential = "spring" in law.history
    resists = _rolling_energy(law) is not None or law.twisting is not None
    return {"normal": True, "tangential": tangential, "rolling": tangential and resists}


def _rolling_energy(law: ContactFeatures) -> Callable[[np.ndarray, np.ndarray], np.ndarray] | None:
    """Energy of rolling springs by the law's file; None if it has none."""
    if law.rolling is None or "angle" not in law.history:
        return None
    return getattr(model("rolling", law.rolling), "energy", None)


def normal_energy(normal: str, overlap: np.ndarray, contacts: NormalState) -> np.ndarray:
    """Energy that contacts of the normal law ``normal`` would hold if they had this ``overlap`` [m]; [J], shape (c,)."""
    if not contacts.own:  # linear in its one constant, which holds the weight already
        return elastic_energy(normal, overlap, contacts.stiffness)
    of_law = getattr(model("normal", normal), "stored", None)
    constant = contacts.stiffness / contacts.weight
    held = of_law(overlap, constant, **contacts.own) if of_law else elastic_energy(normal, overlap, constant, contacts.own)
    return contacts.weight * held


def normal_secant(normal: str, overlap: np.ndarray, contacts: NormalState) -> np.ndarray:
    """k_n of the normal law named ``normal`` in contacts if they had this ``overlap`` [m]; [N/m], shape (c,)."""
    if not contacts.own:
        return secant(normal, overlap, contacts.stiffness)
    return contacts.weight * secant(normal, overlap, contacts.stiffness / contacts.weight, contacts.own)


def normal_depth(normal: str, contacts: NormalState) -> np.ndarray:
    """Depth of contacts of the normal law named ``normal``, R* times which is the square of their radius; [m], shape (c,)."""
    of_law = getattr(model("normal", normal), "contact_depth", None)
    return of_law(contacts.overlap, contacts.stiffness / contacts.weight, **contacts.own) if of_law else contacts.overlap


def normal_slope(normal: str, overlap: np.ndarray, contacts: NormalState) -> np.ndarray:
    """Slope of the force of the normal law named ``normal`` in contacts if they had this ``overlap`` [m]; [N/m], shape (c,)."""
    if not contacts.own:
        return tangent(normal, overlap, contacts.stiffness)
    return contacts.weight * tangent(normal, overlap, contacts.stiffness / contacts.weight, contacts.own)


def elastic_normal_force(normal: str, contacts: NormalState) -> np.ndarray:
    """Slope of the energy of the normal law named ``normal`` over the overlap [N], shape (c,); to 1e-9 of it.

    Central differences: E'(d) = (E(d + h) - E(d - h)) / 2 h, h = 1e-4 d.
    """
    size = np.abs(contacts.overlap)
    step = DIFFERENCE * np.maximum(size, LEAST_OVERLAP)
    more, less = (normal_energy(normal, contacts.overlap + side * step, contacts) for side in (1.0, -1.0))
    return (more - less) / (2.0 * step)
