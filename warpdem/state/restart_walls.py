"""Walls of a checkpoint beside those of the scene that starts from it: which are the same, and how far they had moved."""

import hashlib
from collections.abc import Collection
from typing import Any

import numpy as np

from warpdem.filling.placed_walls import in_body_axes
from warpdem.scene.model import Scene
from warpdem.scene.walls import SHAPES


def _geometry(wall: dict[str, Any], contents: str | None) -> tuple[Any, ...]:
    """What a wall's table says of its surface; ``contents`` of its mesh file count, not what that is called."""
    return contents, *(wall.get(key) for key in ("prim", "part", "scale", "translate", "rotate", *SHAPES))


def _geometries(scene: Scene, data: dict[str, Any]) -> tuple[dict[str, tuple[Any, ...]], dict[str, tuple[Any, ...]]]:
    """Geometry of each wall by name, in the scene and in the checkpoint."""
    here = {}
    for wall in scene.walls:
        path = scene.resolve(wall.mesh) if wall.mesh is not None else None
        # a file that is not there is refused with its mesh
        contents = hashlib.sha256(path.read_bytes()).hexdigest() if path is not None and path.is_file() else None
        here[wall.name] = _geometry(wall.model_dump(mode="json"), contents)
    there = {
        wall["name"]: _geometry(wall, data["files"].get(f"walls[{k}].mesh")) for k, wall in enumerate(data["scene"]["walls"])
    }
    return here, there


def redrawn_walls(scene: Scene, data: dict[str, Any]) -> set[str]:
    """Names of walls of both whose geometry is not the same."""
    here, there = _geometries(scene, data)
    return {name for name in here if name in there and here[name] != there[name]}


def _displacement_text(data: dict[str, Any], name: str) -> str:
    """How far a wall of the checkpoint had moved from where its scene drew it, as text; "" if it had not."""
    pose, frame = pose_matrix(data["places"]["walls"][name]), pose_matrix(data["places"]["frame"])
    if next(wall["fixed_to"] for wall in data["scene"]["walls"] if wall["name"] == name) == "laboratory":
        pose = frame @ pose
    rotation = np.linalg.norm(pose[:3, :3] - np.eye(3)) / np.sqrt(2.0)  # 2 sin(angle/2)
    shift = pose[:3, 3]
    if rotation < 1e-9 and np.abs(shift).max() < 1e-12:
        return ""
    words = [f"shifted by ({', '.join(f'{x:.6g}' for x in shift)}) m"] if np.abs(shift).max() >= 1e-12 else []
    words += [f"turned by {np.degrees(2.0 * np.arcsin(min(0.5 * rotation, 1.0))):.6g} degrees"] if rotation >= 1e-9 else []
    return " and ".join(words)


def notes_on_walls(scene: Scene, data: dict[str, Any], redrawn: set[str], continues: Collection[str]) -> list[str]:
    """Which walls do not stand where the run before left one of their name or of their geometry.

    Args:
        scene: the scene that starts.
        data: the checkpoint.
        redrawn: names of walls whose geometry is another now.
        continues: names of walls that go on in their own time.
    """
    notes, (here, there) = [], _geometries(scene, data)
    for name in here:
        moved = _displacement_text(data, name) if name in there else ""
        if name in redrawn and moved:
            said = f"start: wall {name!r} has another geometry than in {data['path']}, where it had been {moved}"
            if name in continues:
                notes.append(f"{said}: it goes on from there, since start.continues names it")
            else:
                notes.append(
                    f"{said}: it stands where this scene draws it; to go on from there it needs the geometry that it had, or "
                    "its name in start.continues"
                )
        for other in there:
            same = name not in there and other not in here and here[name] == there[other]
            if same and (moved := _displacement_text(data, other)):
                notes.append(
                    f"start: wall {name!r} stands where this scene draws it; {other!r}, which has the same geometry in "
                    f"{data['path']} and is gone, had been {moved}"
                )
    return notes


def wall_numbers(scene: Scene, data: dict[str, Any]) -> tuple[np.ndarray, list[str]]:
    """Number in ``scene`` of each wall of the checkpoint, -1 for none, and the names of those with springs and without."""
    here = {wall.name: (k, _shape_key(wall.model_dump(mode="json"))) for k, wall in enumerate(scene.walls)}
    numbers, dropped = [], []
    for k, wall in enumerate(data["scene"]["walls"]):
        number, kind = here.get(wall["name"], (-1, None))
        numbers.append(number if kind == _shape_key(wall) else -1)
        if numbers[-1] < 0 and (data["wall_contact_wall"] == k).any():
            dropped.append(f"wall {wall['name']}")
    return np.array(numbers, dtype=np.int64), dropped


def _shape_key(wall: dict[str, Any]) -> str:
    """Kind of geometry of a wall's table."""
    return next(key for key in ("mesh", *SHAPES) if wall.get(key) is not None)


def in_new_axes(scene: Scene, data: dict[str, Any], redrawn: set[str], wall: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Points [m], shape (n, 3), in the body axes of their walls of the checkpoint, in those of the same walls of ``scene``."""
    number = {one.name: k for k, one in enumerate(scene.walls)}
    for k, old in enumerate(data["scene"]["walls"]):
        mine = wall == k
        if old["name"] in redrawn and mine.any():
            pose = pose_matrix(data["places"]["walls"][old["name"]])
            framed = point[mine] @ pose[:3, :3].T + pose[:3, 3]
            point = point.copy()
            point[mine] = in_body_axes(scene, number[old["name"]], framed)
    return point


def pose_matrix(rows: list[list[float]]) -> np.ndarray:
    """A pose of the checkpoint, its upper three rows, as a matrix, shape (4, 4)."""
    return np.vstack([np.array(rows), [0.0, 0.0, 0.0, 1.0]])
