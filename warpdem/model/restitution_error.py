"""How far a time step makes the restitution of an impact differ from the one asked for."""

from collections.abc import Sequence
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
    """As ``restitution_errors``, of one time step ``dt`` [s]; None where there is no such number."""
    return next(iter(restitution_errors(scene, start, speed, [dt])), None)


def restitution_errors(
    scene: Scene, start: InitialGrains, speed: float, steps: Sequence[float]
) -> list[RestitutionError]:  # fmt: skip
    """The largest error in the mean that each of several time steps [s] makes in an impact at ``speed`` [m/s].

    None of them where nothing collides, and for a law with a memory or a reach beyond contact: what it gives back is not one
    number.
    """
    law, at = scene.normal_law, coefficient_columns(scene)
    module = model("normal", law)
    cases = [] if hasattr(module, "HISTORY") or hasattr(module, "gap") or speed <= 0.0 else contact_cases(scene, start)
    largest: list[RestitutionError] = []
    for one in cases:
        of = (law, one.row[at.stiffness], one.row[at.damping], one.reduced_mass, one.reduced_radius, speed)
        exact = rebound(*of, impact_of(law, at.stiffness, one, speed).time / FINE_STEPS, one.own).mean()
        found = []
        for dt in steps:
            off = rebound(*of, dt, one.own) - exact
            worst = float(off[np.argmax(np.abs(off))])
            found.append(RestitutionError(one.materials, one.restitution, float(off.mean()), worst))
        largest = [max(pair, key=lambda error: abs(error.mean)) for pair in zip(largest or found, found, strict=True)]
    return largest
