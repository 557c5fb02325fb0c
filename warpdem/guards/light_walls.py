"""Free walls that the time step may be too long for, before a run: those lighter than the grains that may lie on them.

The other limits are made for walls that nothing can push. Here as many grains as a wall has room for lie all over it, each on
something else too, with the stiffness of its share of the load on the wall. The limit is that of the guard of a run
(``guards.free_walls``): with friction, grains that turn and all motions of the wall. Of many grains some stand for several.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from warpdem.filling.initial_grains import InitialGrains
from warpdem.guards.free_walls import Coupling, inverse_mass, levers, quotient, stable_step
from warpdem.guards.springs import Springs
from warpdem.kernels.contact.normal_law import ROLLING_MASS
from warpdem.mesh.triangle_mesh import TriangleMesh
from warpdem.model.coefficients import coefficient_columns
from warpdem.model.contact_cases import ContactCase, contact_cases
from warpdem.model.dynamic_walls import DynamicWall, largest_arm
from warpdem.model.impact import damping_coefficient, dashpot_slope, pressed, stiffness
from warpdem.scene.free import FreeBody
from warpdem.scene.model import Scene
from warpdem.scene.servo import Servo

TIMES = 1000  # at which the drive is looked at
PLACES = 100  # on a wall at most


class LightWall(NamedTuple):
    """A free wall lighter than the grains that may lie on it."""

    number: int
    """Of the wall in the scene."""
    grains: int
    """That may lie on it."""
    ratio: float
    """Its mass over theirs [-], of a hinge moments of inertia."""
    step: float
    """Largest time step that would do [s]."""


def light_walls(
    scene: Scene, dynamic: list[DynamicWall], start: InitialGrains, meshes: dict[str, TriangleMesh], dt: float
) -> Iterator[LightWall]:
    """Free walls for which the time step ``dt`` [s] is too long."""
    for one in dynamic:
        if isinstance(one.given, Servo) or not len(start.id):
            continue
        count, point, normal = _touched(one, meshes.get(one.wall.name), start)
        arm = 1.0 if isinstance(one.given, FreeBody) or not one.given.rotates else largest_arm(one.given, point)
        for case in contact_cases(scene, start):
            if not (case.wall and case.materials[1] == one.wall.material and arm > 0.0):
                continue
            force = _load(scene, one) / arm / count + case.reduced_mass * float(np.linalg.norm(scene.gravity))
            if force <= 0.0:
                continue
            coupling = _coupling(scene, one, case, count, point, normal, force)
            s = coupling.springs
            if quotient(coupling, s.stiffness * dt**2 / 4.0 + s.acting(dt) * dt) <= 1.0:
                continue
            own = one.mass if isinstance(one.given, FreeBody) else one.inertia
            yield LightWall(one.number, count, own / (count * case.reduced_mass * arm**2), stable_step(coupling, dt))


def _touched(one: DynamicWall, mesh: TriangleMesh | None, start: InitialGrains) -> tuple[int, np.ndarray, np.ndarray]:
    """How many grains may lie on a wall, places of some of them [m] and the normals there, shapes (p, 3)."""
    count = len(start.id)
    if mesh is None:
        assert one.wall.shape is not None
        foot = one.wall.shape.nearest(start.position)[0]
        way = start.position - foot
        size = np.linalg.norm(way, axis=1)
        there = np.flatnonzero(size > 0.0)
        there = there[np.linspace(0, len(there) - 1, min(PLACES, len(there))).astype(int)]
        return count, foot[there], way[there] / size[there, None]
    a, b, c = mesh.corners.transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    area = 0.5 * np.linalg.norm(normal, axis=1)
    # those that it has room for, close-packed
    count = max(1, min(count, round(area.sum() / (2.0 * np.sqrt(3.0) * float(start.radius.min()) ** 2))))
    number = min(PLACES, count)
    reached = np.cumsum(area)
    share = (np.arange(number) + 0.5) / number
    chosen = np.minimum(np.searchsorted(reached, share * reached[-1]), len(area) - 1)
    # points that fill a triangle evenly, one after the other
    u, v = np.modf(np.outer([0.7548776662, 0.5698402910], np.arange(1, number + 1)))[0]
    u, v = np.where(u + v > 1.0, 1.0 - u, u)[:, None], np.where(u + v > 1.0, 1.0 - v, v)[:, None]
    point = a[chosen] + u * (b - a)[chosen] + v * (c - a)[chosen]
    return count, point, normal[chosen] / (2.0 * area[chosen, None])


def _coupling(
    scene: Scene, one: DynamicWall, case: ContactCase, count: int, point: np.ndarray, normal: np.ndarray, force: float
) -> Coupling:
    """``count`` grains that ``force`` [N] presses on a wall at some places, each held from the other side."""
    at, n, each = coefficient_columns(scene), len(point), count / max(len(point), 1)
    k, slope = pressed(scene.normal_law, case.row[at.stiffness], case.reduced_radius, force, case.own)
    sticks = scene.contact.tangential != "none" and case.row[at.friction] > 0.0
    shear, shear_damping = (case.row[at.of(name)] if sticks else 0.0 for name in ("shear", "shear_damping"))
    yielding = np.append(inverse_mass(one.mobility, normal, point), np.zeros(n))
    mass = 1.0 / (1.0 / case.reduced_mass + yielding)
    constant = stiffness(scene.normal_law, case.row[at.stiffness], case.reduced_radius)
    damping = damping_coefficient(scene.normal_law, k, constant, case.row[at.damping], mass)
    same, grain, held = np.ones(2 * n), np.tile(np.arange(n), 2), np.full(2 * n, n)
    springs = Springs(
        grain, held, np.concatenate([normal, -normal]), each * np.outer([slope, shear * k], same),
        each * np.outer([dashpot_slope(scene.normal_law, slope, k), shear * k], same),
        each * np.stack([damping, shear_damping * damping]), each * np.stack([mass, ROLLING_MASS * mass]),
        np.stack([case.radius * same, 0.0 * same]),
    )  # fmt: skip
    still = np.concatenate([np.eye(3).ravel(), np.zeros(15)])
    lever, wall = levers(one, still, point)
    heavy = np.full(n, each * case.reduced_mass)
    moved = np.concatenate([lever, np.zeros_like(lever)])
    return Coupling(springs, moved, np.append(heavy, one.inertia), 0.4 * heavy * case.radius**2, wall)


def _load(scene: Scene, one: DynamicWall) -> float:
    """Largest load of drive and weight on a wall [N or N m]."""
    weight = one.mass * float(np.linalg.norm(scene.gravity))
    if isinstance(one.given, FreeBody):
        return float(np.linalg.norm(one.given.force)) + weight
    drive = np.nan_to_num(one.drive(np.linspace(0.0, scene.time.end, TIMES)))
    arm = np.linalg.norm(one.center - np.array(one.given.origin)) if one.given.rotates else 1.0
    return float(np.abs(drive).max() + weight * arm)
