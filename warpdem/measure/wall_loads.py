"""Loads on walls: force, torque and power of each wall, force and pressure of each triangle.

    F_w = -sum F,     T_w = -sum ((x - p) x F + M),     P = sum (F . v + M . w),     v = u + w x x

F and M are the force of a contact on the grain and its rolling torque as the force call at time t_k left them,
x = q - n (R - overlap) is the contact point; v is the absolute velocity of the wall's material there, with
its surface velocity, w the wall's absolute spin. The grains' momenta change in every step by -F_w dt and -T_w dt and what
gravity and fields add, to round-off. A contact at an edge or corner counts for one of the triangles that meet there.
"""

from dataclasses import replace

import numpy as np

from warpdem.core.snapshot import WallLoad
from warpdem.kernels.measure.readings import WALL_SUMS
from warpdem.measure.surface_power import contact_points
from warpdem.measure.totals import Totals
from warpdem.mesh.triangle_mesh import TriangleMesh
from warpdem.scene.model import Scene
from warpdem.scene.motion import FixedPlacement
from warpdem.scene.rotation import Rotation
from warpdem.state.view import RunView

AFTER, BEFORE = np.array([1, 2, 0]), np.array([2, 0, 1])  # components that follow and precede each


def torque_point(scene: Scene, number: int) -> np.ndarray:
    """Body point that the torque on a wall of the scene refers to [m], shape (3,)."""
    wall = scene.walls[number]
    if wall.torque_about is not None:
        return np.array(wall.torque_about)
    if wall.dynamic is not None and wall.dynamic.rotates:
        return np.array(wall.dynamic.origin)
    around = scene.frame or () if wall.fixed_to == "frame" else ()
    point = np.zeros(3)
    for motion in (*around, *(wall.motion or ())):
        if isinstance(motion, Rotation):
            point = np.array(motion.origin)
        elif isinstance(motion, FixedPlacement):
            point = motion.inverse(point)
    return point


def read_loads(view: RunView, lab: bool = False) -> dict[str, WallLoad]:
    """Load on each wall at the time of the view, by name; vectors in frame axes, or in the laboratory."""
    now = Totals(view)
    loads = total_loads(now, lab)
    if loads and view.model.meshes:
        _add_triangles(now, loads, now.pose.rotation if lab else None)
    return loads


def total_loads(now: Totals, lab: bool = False) -> dict[str, WallLoad]:
    """The same without forces and pressures of triangles: of size 0."""
    view, model = now.view, now.view.model
    if model.walls is None:
        return {}
    if "torque points" not in view.kept:
        view.kept["torque points"] = np.array([torque_point(model.scene, number) for number in range(len(model.scene.walls))])
    bodies = now.bodies  # all walls at once: of few numbers each a call takes longer than the work
    force, moment, rolling = (now.walls[:, WALL_SUMS.of(name)] for name in ("force", "moment", "torque"))
    about = np.einsum("wij,wj->wi", bodies[:, :9].reshape(-1, 3, 3), view.kept["torque points"]) + bodies[:, 9:12]
    torque = moment - cross(about, force) + rolling
    power = np.einsum("wi,wi->w", force, bodies[:, 15:18]) + np.einsum("wi,wi->w", moment + rolling, bodies[:, 12:15])
    force, torque = 0.0 - force, 0.0 - torque
    if lab:
        force, torque, about = force @ now.pose.rotation.T, torque @ now.pose.rotation.T, now.pose.to_laboratory(about)
    powers = dict(zip((wall.name for wall in model.scene.walls), power.tolist(), strict=True))
    if model.features.walls.conveying:
        powers |= {name: powers[name] + more for name, more in now.surface_powers.items()}
    rows = zip(powers.items(), force, torque, about, strict=True)
    return {name: WallLoad(f, t, a, p, np.zeros((0, 3)), np.zeros(0)) for (name, p), f, t, a in rows}


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """A x b of vectors, shapes (..., 3): a tenth of what ``np.cross`` takes for so few numbers."""
    return a[..., AFTER] * b[..., BEFORE] - a[..., BEFORE] * b[..., AFTER]


def _add_triangles(now: Totals, loads: dict[str, WallLoad], rotation: np.ndarray | None) -> None:
    """Force and pressure of each triangle of the meshes in place of none; ``rotation`` from frame axes to those of the loads.

    Summed in order of grain id, so that they do not depend on the order of the lists.
    """
    model = now.view.model
    point, wall_of = contact_points(now.each, model)
    force = _sums(-point["force"], point["feature"], len(wall_of))
    force = force if rotation is None else force @ rotation.T
    push = _sums(np.einsum("ij,ij->i", point["force"], point["normal"])[:, None], point["feature"], len(wall_of))[:, 0]
    for number, wall in enumerate(model.scene.walls):
        if (mesh := model.meshes.get(wall.name)) is not None:
            own = np.flatnonzero(wall_of == number)
            found = {"triangle_force": force[own], "pressure": push[own] / areas(mesh)}
            loads[wall.name] = replace(loads[wall.name], **found)


def _sums(values: np.ndarray, group: np.ndarray, groups: int) -> np.ndarray:
    """Sums of the columns of ``values`` over the members of each group, one after the other, shape (groups, width)."""
    return np.stack([np.bincount(group, column, groups) for column in values.T], axis=1)


def areas(mesh: TriangleMesh) -> np.ndarray:
    """Area of each triangle [m2], shape (t,)."""
    a, b, c = mesh.corners.transpose(1, 0, 2)
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
