"""Frame, walls and streams of a scene that starts from a checkpoint: each goes on from where it stands there."""

from typing import Any

import numpy as np

from warpdem.errors import SceneError
from warpdem.scene.model import Scene
from warpdem.scene.motion import FixedPlacement, Motions
from warpdem.scene.start import Start
from warpdem.state.restart_walls import pose_matrix
from warpdem.usd.motion import quaternion_of


def continued_scene(scene: Scene, start: Start, data: dict[str, Any], redrawn: set[str]) -> Scene:
    """The scene whose frame and walls, but those ``redrawn``, go on from where those of the checkpoint stand.

    Raises:
        SceneError: ``start.continues`` names what is not in both scenes, or is another in each.
    """
    there, end = data["scene"], _end(data)
    _check_continues(scene, start.continues, data)
    frame = pose_matrix(data["places"]["frame"])
    motions = _continued(scene.frame, data["motions"]["frame"], there["frame"], end)
    if "frame" not in start.continues:
        motions = _starting_at(scene.frame, frame)
    walls = []
    for wall in scene.walls:
        if wall.name not in data["places"]["walls"] or (wall.name in redrawn and wall.name not in start.continues):
            walls.append(wall)
            continue
        if wall.name in start.continues:
            given = next(entry["motion"] for entry in there["walls"] if entry["name"] == wall.name)
            motion = _continued(wall.motion, data["motions"]["walls"][wall.name], given, end)
            if wall.name in data.get("dynamic", {}):  # its own displacement counts from there
                motion = _starting_at(motion, pose_matrix(data["dynamic"][wall.name]["own"]))
            if wall.dynamic is not None:
                key, before = "free" if wall.servo is None else "servo", data["motions"].get("loads", {}).get(wall.name, 0.0)
                wall = wall.model_copy(update={key: wall.dynamic.ahead_by(before + end)})
            if wall.surface_velocity is not None:
                before = data["motions"].get("surfaces", {}).get(wall.name, 0.0)
                surface = wall.surface_velocity.model_copy(update={"elapsed": before + end})
                wall = wall.model_copy(update={"surface_velocity": surface})
        else:
            pose = pose_matrix(data["places"]["walls"][wall.name])
            motion = _starting_at(wall.motion, frame @ pose if wall.fixed_to == "laboratory" else pose)
        if wall.free is not None and wall.name in data.get("dynamic", {}):
            wall = wall.model_copy(update={"free": wall.free.from_there(data["dynamic"][wall.name])})
        walls.append(wall.model_copy(update={"motion": motion}))
    streams = scene.later(end).streams if "streams" in start.continues else scene.streams
    counted = data.get("liquid") and (data["liquid"]["quantum"], data["liquid"]["quantum"] * data["liquid"]["most_from_film"])
    start = start.model_copy(update={"groups": data["groups"], "liquid": counted})
    return scene.model_copy(update={"frame": motions, "walls": walls, "streams": streams, "start": start})


def continued_inlets(data: dict[str, Any]) -> dict[int, Any]:
    """State of each stream that outlasts the checkpoint, by its number among them."""
    end = _end(data)
    streams = data["scene"].get("streams", [])
    numbers = [k for k, stream in enumerate(streams) if stream["until"] is None or stream["until"] > end]
    return {here: data["streams"][there] for here, there in enumerate(numbers)}


def _end(data: dict[str, Any]) -> float:
    """Time of a checkpoint [s]."""
    time: float = data["step"] * data["dt"]
    return time


def _check_continues(scene: Scene, continues: list[str], data: dict[str, Any]) -> None:
    """Refuse names in ``start.continues`` of what is not there, or is another there."""
    there = data["scene"]
    here = scene.model_dump(mode="json", include={"frame", "streams", "walls"})
    then = {entry["name"]: entry for entry in there["walls"]}
    now = {entry["name"]: entry for entry in here["walls"]}
    for name in continues:
        if name in ("frame", "streams"):
            pair: tuple[Any, ...] = here[name], there[name]
        elif name in now and name in then:
            pair = tuple(
                (entry["motion"], entry["fixed_to"], entry.get("surface_velocity"), entry.get("servo"), entry.get("free"))
                for entry in (now[name], then[name])
            )
        else:
            known = ", ".join(["frame", "streams", *(wall for wall in now if wall in then)])
            raise SceneError(f'{scene.source}: start.continues: "{name}" is not in both scenes; allowed: {known}')
        if name in data.get("driven", {}):
            raise SceneError(
                f'{scene.source}: start.continues: "{name}" moves in {data["path"]} as set_motion said, not as its scene does; '
                "give its motion in this scene"
            )
        if pair[0] != pair[1]:
            raise SceneError(
                f'{scene.source}: start.continues: "{name}" is not what it was in {data["path"]}; only what has not changed '
                "can go on in its own time"
            )


def _continued(
    motions: Motions | None, resolved: list[dict[str, Any]] | None, given: list[dict[str, Any]] | None, time: float
) -> Motions | None:
    """Motions ``time`` [s] later than those of the checkpoint, which stand there as they were resolved and as given."""
    if resolved is None:
        return motions
    here, there = tuple(motions or ()), tuple(given or ())
    elapsed = [entry.get("elapsed", 0.0) for entry in resolved]
    timed = (
        motion if isinstance(motion, FixedPlacement) else motion.model_copy(update={"elapsed": before + time})
        for motion, before in zip(here, elapsed, strict=False)
    )
    return (*timed, *(FixedPlacement(**entry) for entry in resolved[len(there) :]))


def _starting_at(motions: Motions | None, pose: np.ndarray) -> Motions | None:
    """Motions that begin from ``pose``, shape (4, 4)."""
    if np.array_equal(pose, np.eye(4)):
        return motions
    quaternion = quaternion_of(pose[:3, :3]).astype(float)
    return (*(motions or ()), FixedPlacement(quaternion=quaternion.tolist(), shift=pose[:3, 3].tolist()))
