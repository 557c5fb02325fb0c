"""What a scene takes over from the checkpoint that it starts from: grains, springs of contacts, frame, places of walls.

Everything goes on in the laboratory as it was: positions and absolute motions of the grains, the axes of the frame, and walls
that both scenes name with the same geometry. Motions of the new scene begin from there. A wall whose geometry is another now
stands where the new scene draws it, as a new one does: whoever has drawn it anew has drawn it where it is to be. The springs of
a contact stay if its law does; those at a wall, if both scenes name it and it has one kind of geometry.
"""

import dataclasses
import hashlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from warpdem.core.rigid_motion import Pose
from warpdem.errors import SceneError
from warpdem.filling.initial_grains import InitialGrains
from warpdem.filling.placed_walls import in_body_axes
from warpdem.kernels import grain
from warpdem.kernels.contact.columns import TWIST, VECTORS, Columns, own_history
from warpdem.kernels.contact.liquid import COUNT
from warpdem.model.past import Past
from warpdem.scene.checks import class_problems
from warpdem.scene.messages import line, report
from warpdem.scene.model import Scene
from warpdem.scene.models import model
from warpdem.scene.motion import FixedPlacement, Motions
from warpdem.scene.motion_chain import frame_chain
from warpdem.scene.start import Start
from warpdem.scene.wall_shapes import SHAPES
from warpdem.state import checkpoint_file, contact_history
from warpdem.state.clumps import from_checkpoint
from warpdem.state.liquid_account import starting_films
from warpdem.state.particles import State
from warpdem.state.streams import Streams
from warpdem.usd.motion import quaternion_of

if TYPE_CHECKING:
    from warpdem.engine.neighbor_list import NeighborLists


def started_from(scene: Scene, path: str | Path, continues: tuple[str, ...] = ()) -> Scene:
    """The scene without its grains, to start from the checkpoint at ``path``."""
    path = Path(path).resolve()
    folders = scene.access.folders
    access = scene.access if folders is None else dataclasses.replace(scene.access, folders=(*folders, path.parent))
    start = Start(checkpoint=str(path), continues=list(continues))
    return scene.model_copy(update={"start": start, "grains": [], "access": access})


def _start(scene: Scene) -> Start:
    """What the scene says of its start: it has one."""
    assert scene.start is not None
    return scene.start


def read(scene: Scene) -> Past:
    """What ``scene`` starts from.

    Raises:
        SceneError: the checkpoint cannot be read, its grains are of a material that the scene lacks or that has no
            coefficients, or something is to go on that is another here.
    """
    key = f"{scene.source}: start.checkpoint"
    try:
        data = checkpoint_file.read(scene.resolve(_start(scene).checkpoint))
    except SceneError as error:
        raise SceneError(f"{key}: {error}") from None
    names = list(data["scene"]["materials"])
    present = [names[kind] for kind in np.unique(data["material"])]
    missing = [name for name in present if name not in scene.materials]
    if missing:
        raise SceneError(
            f"{key} = {str(data['path'])!r}: its grains are of {', '.join(missing)}; the scene has no such material, but "
            f"{', '.join(scene.materials)}"
        )
    _check_pairs(scene, present, key)
    _check_clumps(scene, data, key)
    redrawn = _redrawn(scene, data)
    said = _notes_on_walls(scene, data, redrawn)
    scene = _going_on(scene, data, redrawn)
    if unknown := [line(*one) for one in class_problems(scene.measures, scene.groups, list(scene.materials))]:
        raise SceneError(report(scene.source, unknown))
    grains = _grains(scene, data, [list(scene.materials).index(name) if name in scene.materials else -1 for name in names])
    memory, notes = _memory(scene, data, redrawn)
    if "orientation" in data:
        memory["orientation"] = data["orientation"]
    going = "streams" in _start(scene).continues
    numbers = [k for k, s in enumerate(data["scene"].get("streams", [])) if s["until"] is None or s["until"] > _end(data)]
    inlets = {here: data["streams"][there] for here, there in enumerate(numbers)} if going else {}
    known = tuple(name for name in data["places"]["walls"] if name not in redrawn)
    film = None
    if scene.contact.liquid != "none":
        kept = scene.contact.liquid == data["scene"]["contact"].get("liquid")
        at_walls = _wall_numbers(scene, data)[0][data["wall_contact_wall"]] >= 0 if "wall_contact_wall" in data else np.zeros(0)
        film = starting_films(data, kept, kept & (at_walls > 0))
    return Past(scene, grains, memory, known, data["next_id"], inlets, (*said, *notes), film)


def _end(data: dict[str, Any]) -> float:
    """Time of a checkpoint [s]."""
    return data["step"] * data["dt"]


def _check_pairs(scene: Scene, present: list[str], key: str) -> None:
    """Refuse grains that meet something for which the scene has no coefficients."""
    given = {tuple(sorted(pair.materials)) for pair in scene.pairs}
    others = [*present, *(wall.material for wall in scene.walls)]
    lacking = sorted({pair for a in present for b in others if (pair := tuple(sorted((a, b)))) not in given})
    if lacking:
        listed = "; ".join(f'materials = ["{a}", "{b}"]' for a, b in lacking)
        raise SceneError(f"{key}: its grains meet materials without coefficients: add [[pairs]] with {listed}")


def _check_clumps(scene: Scene, data: dict[str, Any], key: str) -> None:
    """Refuse clumps that the scene lacks, or that are others there, or of another density."""
    if "clump_template" not in data:
        return
    there, here = data["scene"]["clumps"], scene.model_dump(mode="json", include={"clumps"})["clumps"]
    names = list(there)
    for number in np.unique(data["clump_template"]).tolist():
        name = names[number]
        if name not in here:
            where = f"{key} = {str(data['path'])!r}"
            raise SceneError(f"{where}: its grains are clumps of {name!r}: add [clumps.{name}] as it is there")
        if here[name] != there[name]:
            raise SceneError(f"{scene.source}: clumps.{name}: is not what it was in {data['path']}, where the clumps come from")
    if list(here)[: len(names)] != names:
        raise SceneError(f"{scene.source}: clumps: those of {data['path']} come first, in its order: {', '.join(names)}")
    members = np.unique(data["material"][data["clump_of_grain"] >= 0])
    for name in (list(data["scene"]["materials"])[kind] for kind in members):
        before, now = data["scene"]["materials"][name]["density"], scene.materials[name].density
        if before != now:
            raise SceneError(
                f"{scene.source}: materials.{name}.density = {now:g} kg/m3: clumps of this material come from {data['path']}, "
                f"where it is {before:g} kg/m3"
            )


# --- frame, walls, streams ---------------------------------------------------------------------------------------------


def _going_on(scene: Scene, data: dict[str, Any], redrawn: set[str]) -> Scene:
    """The scene whose frame and walls, but those ``redrawn``, go on from where those of the checkpoint stand."""
    start, there = _start(scene), data["scene"]
    _check_continues(scene, data)
    ahead = scene.later(_end(data))
    frame = _matrix(data["places"]["frame"])
    motions = _continued(scene.frame, data["motions"]["frame"], there["frame"], _end(data))
    if "frame" not in start.continues:
        motions = _from(scene.frame, frame)
    walls = []
    for wall in scene.walls:
        if wall.name not in data["places"]["walls"] or (wall.name in redrawn and wall.name not in start.continues):
            walls.append(wall)
            continue
        if wall.name in start.continues:
            given = next(entry["motion"] for entry in there["walls"] if entry["name"] == wall.name)
            motion = _continued(wall.motion, data["motions"]["walls"][wall.name], given, _end(data))
            if wall.name in data.get("dynamic", {}):  # its own displacement counts from there
                motion = _from(motion, _matrix(data["dynamic"][wall.name]["own"]))
            if wall.dynamic is not None:
                key, before = "free" if wall.servo is None else "servo", data["motions"].get("loads", {}).get(wall.name, 0.0)
                wall = wall.model_copy(update={key: wall.dynamic.ahead_by(before + _end(data))})
            if wall.surface_velocity is not None:
                before = data["motions"].get("surfaces", {}).get(wall.name, 0.0)
                surface = wall.surface_velocity.model_copy(update={"elapsed": before + _end(data)})
                wall = wall.model_copy(update={"surface_velocity": surface})
        else:
            place = _matrix(data["places"]["walls"][wall.name])
            motion = _from(wall.motion, frame @ place if wall.fixed_to == "laboratory" else place)
        if wall.free is not None and wall.name in data.get("dynamic", {}):
            wall = wall.model_copy(update={"free": wall.free.from_there(data["dynamic"][wall.name])})
        walls.append(wall.model_copy(update={"motion": motion}))
    streams = ahead.streams if "streams" in start.continues else scene.streams
    counted = data.get("liquid") and (data["liquid"]["quantum"], data["liquid"]["quantum"] * data["liquid"]["most_from_film"])
    start = start.model_copy(update={"groups": data["groups"], "liquid": counted})
    return scene.model_copy(update={"frame": motions, "walls": walls, "streams": streams, "start": start})


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


def _redrawn(scene: Scene, data: dict[str, Any]) -> set[str]:
    """Names of walls of both whose geometry is not the same."""
    here, there = _geometries(scene, data)
    return {name for name in here if name in there and here[name] != there[name]}


def _way(data: dict[str, Any], name: str) -> str:
    """How far a wall of the checkpoint had moved from where its scene drew it, in words; "" if it had not."""
    place, frame = _matrix(data["places"]["walls"][name]), _matrix(data["places"]["frame"])
    if next(wall["fixed_to"] for wall in data["scene"]["walls"] if wall["name"] == name) == "laboratory":
        place = frame @ place
    turn = np.linalg.norm(place[:3, :3] - np.eye(3)) / np.sqrt(2.0)  # 2 sin(angle/2)
    shift = place[:3, 3]
    if turn < 1e-9 and np.abs(shift).max() < 1e-12:
        return ""
    words = [f"shifted by ({', '.join(f'{x:.6g}' for x in shift)}) m"] if np.abs(shift).max() >= 1e-12 else []
    words += [f"turned by {np.degrees(2.0 * np.arcsin(min(0.5 * turn, 1.0))):.6g} degrees"] if turn >= 1e-9 else []
    return " and ".join(words)


def _notes_on_walls(scene: Scene, data: dict[str, Any], redrawn: set[str]) -> list[str]:
    """Which walls do not stand where the run before left one of their name or of their geometry."""
    notes, (here, there) = [], _geometries(scene, data)
    for name in here:
        way = _way(data, name) if name in there else ""
        if name in redrawn and way:
            said = f"start: wall {name!r} has another geometry than in {data['path']}, where it had been {way}"
            if name in _start(scene).continues:
                notes.append(f"{said}: it goes on from there, since start.continues names it")
            else:
                notes.append(
                    f"{said}: it stands where this scene draws it; to go on from there it needs the geometry that it had, or "
                    "its name in start.continues"
                )
        for other in there:
            if name not in there and other not in here and here[name] == there[other] and (way := _way(data, other)):
                notes.append(
                    f"start: wall {name!r} stands where this scene draws it; {other!r}, which has the same geometry in "
                    f"{data['path']} and is gone, had been {way}"
                )
    return notes


def _check_continues(scene: Scene, data: dict[str, Any]) -> None:
    """Refuse names in ``start.continues`` of what is not there, or is another there."""
    there = data["scene"]
    here = scene.model_dump(mode="json", include={"frame", "streams", "walls"})
    then = {entry["name"]: entry for entry in there["walls"]}
    now = {entry["name"]: entry for entry in here["walls"]}
    for name in _start(scene).continues:
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


def _from(motions: Motions | None, place: np.ndarray) -> Motions | None:
    """Motions that begin from ``place``, shape (4, 4)."""
    if np.array_equal(place, np.eye(4)):
        return motions
    quaternion = quaternion_of(place[:3, :3]).astype(float)
    return (*(motions or ()), FixedPlacement(quaternion=quaternion.tolist(), shift=place[:3, 3].tolist()))


def _matrix(rows: list[list[float]]) -> np.ndarray:
    """A place as a matrix, shape (4, 4)."""
    return np.vstack([np.array(rows), [0.0, 0.0, 0.0, 1.0]])


# --- grains ------------------------------------------------------------------------------------------------------------


def _grains(scene: Scene, data: dict[str, Any], material: list[int]) -> InitialGrains:
    """The grains, their motion relative to the frame as it moves at time 0 of ``scene``."""
    pose: Pose = frame_chain(scene).pose(np.zeros(1))
    spin, velocity = pose.spin[0].astype(float), pose.velocity[0].astype(float)
    position = data["record"][:, grain.POSITION]
    clumps = from_checkpoint(data, spin, velocity) if "clump_of_grain" in data else None
    return InitialGrains(
        id=data["id"],
        type=np.array(material, dtype=np.int32)[data["material"]],
        group=np.array([scene.groups.index(name) for name in data["groups"]], dtype=np.int32)[data["group"]],
        radius=data["record"][:, grain.RADIUS],
        position=position,
        velocity=data["velocity"] - velocity - np.cross(spin, position),
        spin=data["spin"] - spin,
        clumps=clumps,
    )


# --- springs of contacts -----------------------------------------------------------------------------------------------


def _memory(scene: Scene, data: dict[str, Any], redrawn: set[str]) -> tuple[dict[str, np.ndarray], list[str]]:
    """Memory of contacts for ``Lists.remember``, numbered as the walls of ``scene``, and what was dropped in words."""
    was, now, notes = data["scene"]["contact"], scene.contact, []
    springs, given = Columns(tuple((name, 3) for name in VECTORS)), data["pair_history"].shape[1]
    held = {
        "spring": now.tangential == was["tangential"],
        "angle": (now.rolling, now.torsion) == (was["rolling"], was["torsion"]),
    }
    held = {name: same and springs.of(name).stop <= given for name, same in held.items()}
    pairs = np.zeros((len(data["pair"]), springs.width))
    for name in springs.names:
        if held[name]:
            pairs[:, springs.of(name)] = data["pair_history"][:, springs.of(name)]
    law_stays = {"normal": now.normal == was["normal"], "liquid": now.liquid == was.get("liquid", "none")}
    own = {
        name: law_stays["liquid" if name.startswith(COUNT) else "normal"] and f"pair_own_{name}" in data
        for name in own_history(model("normal", scene.normal_law)).names
    }
    own[TWIST] = now.twisting == was.get("twisting") and f"pair_own_{TWIST}" in data
    roles = ("tangential", "rolling", "twisting")
    lost = [f"contact.{role}" for role in roles if getattr(now, role) != was.get(role, "none") != "none"]
    if lost:
        notes.append(f"start: springs of contacts begin at zero, since {' and '.join(lost)} differs from {data['path']}")
    out = {"id": data["id"], "pair": data["pair"], "pair_history": pairs}
    out |= {f"pair_own_{k}": data[f"pair_own_{k}"] if same else np.zeros(len(pairs)) for k, same in own.items()}
    if COUNT in own:  # what had asked for liquid asks again
        out[f"pair_own_{COUNT}"] = np.maximum(out[f"pair_own_{COUNT}"], 0.0)
    if "wall_contact_wall" not in data:
        return out, notes
    number, dropped = _wall_numbers(scene, data)
    keep = number[data["wall_contact_wall"]] >= 0
    if dropped:
        notes.append(f"start: springs at {', '.join(dropped)} begin at zero: not in this scene, or of another geometry")
    for name in ("grain", "wall", "overlap", "weight", "point", "normal"):
        out[f"wall_contact_{name}"] = data[f"wall_contact_{name}"][keep]
    out["wall_contact_point"] = _in_new_axes(scene, data, redrawn, out["wall_contact_wall"], out["wall_contact_point"])
    out["wall_contact_wall"] = number[out["wall_contact_wall"]]
    for name in springs.names:
        out[f"wall_contact_{name}"] = data[f"wall_contact_{name}"][keep] if held[name] else np.zeros((keep.sum(), 3))
    for name, same in own.items():
        out[f"wall_contact_{name}"] = data[f"wall_contact_{name}"][keep] if same else np.zeros(keep.sum())
    if COUNT in own:
        out[f"wall_contact_{COUNT}"] = np.maximum(out[f"wall_contact_{COUNT}"], 0.0)
    return out, notes


def _in_new_axes(
    scene: Scene, data: dict[str, Any], redrawn: set[str], wall: np.ndarray, point: np.ndarray
) -> np.ndarray:
    """Points [m], shape (n, 3), in the body axes of their walls of the checkpoint, in those of the same walls of ``scene``."""
    number = {one.name: k for k, one in enumerate(scene.walls)}
    for k, old in enumerate(data["scene"]["walls"]):
        mine = wall == k
        if old["name"] in redrawn and mine.any():
            place = _matrix(data["places"]["walls"][old["name"]])
            framed = point[mine] @ place[:3, :3].T + place[:3, 3]
            point = point.copy()
            point[mine] = in_body_axes(scene, number[old["name"]], framed)
    return point


def _wall_numbers(scene: Scene, data: dict[str, Any]) -> tuple[np.ndarray, list[str]]:
    """Number in ``scene`` of each wall of the checkpoint, -1 for none, and the names of those with springs and without."""
    here = {wall.name: (k, _kind(wall.model_dump(mode="json"))) for k, wall in enumerate(scene.walls)}
    numbers, dropped = [], []
    for k, wall in enumerate(data["scene"]["walls"]):
        number, kind = here.get(wall["name"], (-1, None))
        numbers.append(number if kind == _kind(wall) else -1)
        if numbers[-1] < 0 and (data["wall_contact_wall"] == k).any():
            dropped.append(f"wall {wall['name']}")
    return np.array(numbers, dtype=np.int64), dropped


def _kind(wall: dict[str, Any]) -> str:
    """Kind of geometry of a wall's table."""
    return next(key for key in ("mesh", *SHAPES) if wall.get(key) is not None)


def take_over(past: Past, state: State, lists: "NeighborLists", streams: Streams) -> None:
    """Give a run at its start the ids, contact history, orientation and random numbers of the run that it starts from.

    Args:
        past: what it starts from.
        state: its grains.
        lists: its neighbor lists.
        streams: its streams.
    """
    state.next_id = max(state.next_id, past.next_id)
    if len(state):
        contact_history.remember(lists, past.data)
    if state.film is not None and past.film is not None and len(state):
        state.film.assign(past.film[np.argsort(np.argsort(state.id.numpy()))])
    if state.orientation is not None and "orientation" in past.data:
        state.orientation.assign(past.data["orientation"])
    streams.take_over(past.inlets)
