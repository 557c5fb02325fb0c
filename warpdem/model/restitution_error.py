"""How far a time step makes the restitution of an impact differ from the one asked for."""

from dataclasses import dataclass

import numpy as np

from warpdem.filling.initial_grains import InitialGrains
from warpdem.model.coefficients import coefficient_columns
from warpdem.model.contact_cases import contact_cases, impact_of
from warpdem.model.impact import rebound
from warpdem.scene.model import Scene
from warpdem.scene.models import model

FINE_STEPS = 400  # in a contact, of the impact that an error is measured against


@dataclass(frozen=True)
class RestitutionError:
    """How far the restitution of impacts at ``max_speed`` is from the one asked for [-]."""

    materials: tuple[str, str]
    asked: float
    mean: float
    """Over the times within a step at which a contact may begin."""
    worst: float


def restitution_error(scene: Scene, start: InitialGrains, speed: float, dt: float) -> RestitutionError | None:
    """The largest error in the mean that the time step ``dt`` [s] makes in an impact at ``speed`` [m/s].

    None where nothing collides, and for a law with a memory or a reach beyond contact: what it gives back is not one number.
    """
    law, at = scene.normal_law, coefficient_columns(scene)
    module = model("normal", law)
    if hasattr(module, "HISTORY") or hasattr(module, "gap") or speed <= 0.0:
        return None
    found = []
    for one in contact_cases(scene, start):
        of = (law, one.row[at.stiffness], one.row[at.damping], one.reduced_mass, one.reduced_radius, speed)
        fine = impact_of(law, at.stiffness, one, speed).time / FINE_STEPS
        out = rebound(*of, dt, one.own) - rebound(*of, min(fine, dt), one.own).mean()
        found.append(RestitutionError(one.materials, one.restitution, float(out.mean()), float(out[np.argmax(np.abs(out))])))
    return max(found, key=lambda error: abs(error.mean), default=None)
