"""Loads on walls: force, torque and power of each wall, force and pressure of each triangle.

    F_w = -sum F,     T_w = -sum ((x - p) x F + M),     P = sum (F . v + M . w),     v = u + w x x

F and M are the force of a contact on the grain and its rolling torque as the force call at time t_k left them,
x = q - n (R - overlap) is the contact point; v is the absolute velocity of the wall's material there, with
its surface velocity, w the wall's absolute spin. The grains' momenta change in every step by -F_w dt and -T_w dt and what
gravity and fields add, to round-off. A contact at an edge or corner counts for one of the triangles that meet there.
"""

from dataclasses import replace

import numpy as np

from warpdem.core.pose import FramePose
from warpdem.core.snapshot import WallLoad
from warpdem.kernels.measure.readings import WALL_SUMS
from warpdem.measure.surface_power import contact_points
from warpdem.measure.totals import Totals
from warpdem.mesh.triangle_mesh import TriangleMesh
from warpdem.scene.model import Scene
from warpdem.scene.motion import FixedPlacement
from warpdem.scene.rotation import Rotation
from warpdem.state.view import RunView


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
    loads = total_loads(now)
    if loads and view.model.meshes:
        _add_triangles(view, loads)
    return _in_laboratory(now.pose, loads) if lab else loads


def total_loads(now: Totals, lab: bool = False) -> dict[str, WallLoad]:
    """The same without forces and pressures of triangles: of size 0."""
    model = now.view.model
    if model.walls is None:
        return {}
    loads = {}
    for number, (wall, body, sums) in enumerate(zip(model.scene.walls, now.bodies, now.walls, strict=True)):
        force, moment, rolling = (sums[WALL_SUMS.of(name)] for name in ("force", "moment", "torque"))
        about = body[:9].reshape(3, 3) @ torque_point(model.scene, number) + body[9:12]
        spin, velocity = body[12:15], body[15:18]
        loads[wall.name] = WallLoad(
            force=0.0 - force,
            torque=0.0 - (moment - cross(about, force) + rolling),
            about=about,
            power=float(force @ velocity + (moment + rolling) @ spin),
            triangle_force=np.zeros((0, 3)),
            pressure=np.zeros(0),
        )
    if model.features.walls.conveying:
        for name, power in now.surface_powers.items():
            loads[name] = replace(loads[name], power=loads[name].power + power)
    return _in_laboratory(now.pose, loads) if lab else loads


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """A x b of two vectors, shape (3,): a tenth of what ``np.cross`` takes for so few numbers."""
    (a0, a1, a2), (b0, b1, b2) = a.tolist(), b.tolist()
    return np.array([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0])


def _in_laboratory(pose: FramePose, loads: dict[str, WallLoad]) -> dict[str, WallLoad]:
    return {name: load.in_laboratory(pose) for name, load in loads.items()}


def _add_triangles(view: RunView, loads: dict[str, WallLoad]) -> None:
    """Force and pressure of each triangle of the meshes, in frame axes, in place of none.

    Summed in order of grain id, so that they do not depend on the order of the lists.
    """
    model, (point, wall_of) = view.model, contact_points(view)
    force = _sums(-point["force"], point["feature"], len(wall_of))
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
