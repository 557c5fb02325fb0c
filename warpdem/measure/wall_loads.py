"""Loads on walls: force, torque and power of each wall, force and pressure of each triangle.

    F_w = -sum F,     T_w = -sum ((x - p) x F + M),     P = sum (F . v + M . w),     v = u + w x x

F and M are the force of a contact on the grain and its rolling torque as the force call of the instant t_k left them,
x = q - n (R - overlap) is the contact point; v is the absolute velocity of the wall's material there, w the wall's absolute
spin. The grains' momenta change in every step by -F_w dt and -T_w dt and what gravity and fields add, to round-off. A contact
at an edge or corner counts for one of the triangles that meet there.
"""

import numpy as np

from warpdem.core.snapshot import WallLoad
from warpdem.kernels import grain
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
    model, time = view.model, view.clock.time
    if model.walls is None:
        return {}
    place = _places(view)
    wall_of = model.walls.wall_of
    feature_force = _sums(-place["force"], place["feature"], len(wall_of))
    feature_push = _sums(np.einsum("ij,ij->i", place["force"], place["normal"]), place["feature"], len(wall_of))
    loads = {}
    for number, (wall, body) in enumerate(zip(model.scene.walls, model.schedule.bodies(time), strict=True)):
        here = wall_of[place["feature"]] == number
        force, moment, point = (place[name][here] for name in ("force", "moment", "point"))
        about = body[:9].reshape(3, 3) @ torque_point(model.scene, number) + body[9:12]
        spin, velocity = body[12:15], body[15:18]
        mesh = model.meshes.get(wall.name)
        own = np.flatnonzero(wall_of == number) if mesh is not None else np.zeros(0, dtype=int)
        loads[wall.name] = WallLoad(
            force=0.0 - force.sum(axis=0),
            torque=0.0 - (np.cross(point - about, force) + moment).sum(axis=0),
            about=about,
            power=float(np.sum(force * (velocity + np.cross(spin, point))) + np.sum(moment @ spin)),
            triangle_force=feature_force[own],
            pressure=feature_push[own] / _areas(mesh) if mesh is not None else np.zeros(0),
        )
    if not lab:
        return loads
    pose = model.schedule.pose(time)
    return {name: load.in_laboratory(pose) for name, load in loads.items()}


def _places(view: RunView) -> dict[str, np.ndarray]:
    """Feature, force [N] and rolling torque [N m] on the grain, normal and contact point [m] of all places.

    In order of grain id, so that sums over them do not depend on the order of the lists.
    """
    lists, state, parity = view.contacts, view.state, view.clock.step_number & 1
    g = lists.wall_grains if len(state) else np.zeros(0, dtype=np.int32)
    slot, holder = lists.place_slots(parity, g[np.argsort(state.id.numpy()[g])])
    place, record = lists.places(parity, slot), state.record.numpy()[holder]
    point = record[:, grain.POSITION] - place["normal"] * (record[:, grain.RADIUS] - place["overlap"])[:, None]
    return {"moment": np.zeros((len(slot), 3)), **place, "point": point}


def _sums(values: np.ndarray, group: np.ndarray, groups: int) -> np.ndarray:
    """Sums of ``values`` over the members of each group, one after the other, shape (groups, ...)."""
    out = np.zeros((groups, *values.shape[1:]))
    np.add.at(out, group, values)
    return out


def _areas(mesh: TriangleMesh) -> np.ndarray:
    """Area of each triangle [m2], shape (t,)."""
    a, b, c = mesh.corners.transpose(1, 0, 2)
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
