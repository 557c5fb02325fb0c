"""Free walls that the time step may be too long for: those lighter than the grains that may lie on them.

The other limits are made for walls that nothing can push. Between a wall of M and n grains of m that all touch it, each with
the stiffness k of its share of the load on the wall,

    w^2 <= k (2/m + n/M)                 the grains also lying on something else

For a hinge M is its moment of inertia, and m that of a grain where the wall is widest. The guards watch the run itself, by the
contacts that there are (``guards.free_walls``).
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from warpdem.filling.initial_grains import InitialGrains
from warpdem.mesh.triangle_mesh import TriangleMesh
from warpdem.model.coefficients import coefficient_columns
from warpdem.model.contact_cases import contact_cases
from warpdem.model.dynamic_walls import DynamicWall, largest_arm
from warpdem.model.impact import lessening, pressed
from warpdem.model.stability_limit import along, stable_step
from warpdem.scene.free import Hinge, Slider
from warpdem.scene.model import Scene

TIMES = 1000  # at which the drive is looked at


class LightWall(NamedTuple):
    """A free wall lighter than the grains that may lie on it."""

    number: int
    """Of the wall in the scene."""
    grains: int
    """That may lie on it."""
    share: float
    """Its mass over theirs [-], of a hinge moments of inertia."""
    step: float
    """Largest time step that would do [s]."""


def light_walls(
    scene: Scene, dynamic: list[DynamicWall], start: InitialGrains, meshes: dict[str, TriangleMesh]
) -> Iterator[LightWall]:
    """Free walls lighter than their grains, and on which a load is known that acts from the start."""
    law, at = scene.normal_law, coefficient_columns(scene)
    for one in dynamic:
        if not isinstance(one.given, Slider | Hinge) or not len(start.id):
            continue
        mesh, shape = meshes.get(one.wall.name), one.wall.shape
        points = mesh.vertices if mesh is not None else shape.nearest(start.position)[0] if shape is not None else None
        assert points is not None
        arm = largest_arm(one.given, points) if one.given.turns else 1.0
        count = _grains(mesh, start)
        load = _load(scene, one) / arm if arm else 0.0
        for case in contact_cases(scene, start):
            if not (case.wall and case.materials[1] == one.wall.material and load):
                continue
            share = one.inertia / (count * case.reduced_mass * arm**2)
            if share >= 1.0:
                continue
            secant, slope = pressed(law, case.row[at.stiffness], case.reduced_radius, load / count, case.own)
            dashpot = case.row[at.damping] * np.sqrt(secant * case.reduced_mass)
            spring = along(slope, dashpot, case.reduced_mass, lessening(law, slope, secant))
            moved = case.reduced_mass / (2.0 + 1.0 / share)
            yield LightWall(one.number, count, share, stable_step(spring.stiffness, spring.acting, moved))


def _grains(mesh: TriangleMesh | None, start: InitialGrains) -> int:
    """Grains that may lie on a wall: all, or those that the area of its mesh has room for, close-packed."""
    count = len(start.id)
    if mesh is None:
        return count
    a, b, c = mesh.corners.transpose(1, 0, 2)
    area = 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
    return max(1, min(count, round(area / (2.0 * np.sqrt(3.0) * float(start.radius.min()) ** 2))))


def _load(scene: Scene, one: DynamicWall) -> float:
    """Largest load of drive and weight on a wall [N or N m]."""
    drive = np.nan_to_num(one.drive(np.linspace(0.0, scene.time.end, TIMES)))
    pull = one.mass * np.array(scene.gravity)
    arm = np.linalg.norm(one.center - np.array(one.given.origin)) if one.given.turns else 1.0
    return float(np.abs(drive).max() + np.linalg.norm(pull) * arm)
