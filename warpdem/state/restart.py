"""What a scene takes over from the checkpoint that it starts from: grains, contact history, frame, positions of walls.

Everything goes on in the laboratory as it was: positions and absolute motions of the grains, the axes of the frame, and walls
that both scenes name with the same geometry. Motions of the new scene begin from there. A wall whose geometry is another now
stands where the new scene draws it, as a new one does: whoever has drawn it anew has drawn it where it is to be. The springs of
a contact stay if its law does; those at a wall, if both scenes name it and it has one kind of geometry.
"""

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from warpdem.core.rigid_motion import Pose
from warpdem.errors import SceneError
from warpdem.filling.initial_grains import InitialGrains
from warpdem.kernels import grain
from warpdem.model.past import Past
from warpdem.scene.checks import class_problems
from warpdem.scene.messages import line, report
from warpdem.scene.model import Scene
from warpdem.scene.motion_chain import frame_chain
from warpdem.scene.start import Start
from warpdem.state import checkpoint_file, contact_history
from warpdem.state.clumps import from_checkpoint
from warpdem.state.liquid_account import starting_films
from warpdem.state.particles import State
from warpdem.state.restart_contacts import kept_history
from warpdem.state.restart_motion import continued_inlets, continued_scene
from warpdem.state.restart_walls import notes_on_walls, redrawn_walls, wall_numbers
from warpdem.state.streams import Streams

if TYPE_CHECKING:
    from warpdem.engine.neighbor_list import NeighborLists


def started_from(scene: Scene, path: str | Path, continues: tuple[str, ...] = ()) -> Scene:
    """The scene without its grains, to start from the checkpoint at ``path``."""
    path = Path(path).resolve()
    folders = scene.access.folders
    access = scene.access if folders is None else dataclasses.replace(scene.access, folders=(*folders, path.parent))
    start = Start(checkpoint=str(path), continues=list(continues))
    return scene.model_copy(update={"start": start, "grains": [], "access": access})


def read(scene: Scene) -> Past:
    """What ``scene`` starts from.

    Raises:
        SceneError: the checkpoint cannot be read, its grains are of a material that the scene lacks or that has no
            coefficients, or something is to go on that is another here.
    """
    start, key = scene.start, f"{scene.source}: start.checkpoint"
    assert start is not None
    try:
        data = checkpoint_file.read(scene.resolve(start.checkpoint))
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
    redrawn = redrawn_walls(scene, data)
    said = notes_on_walls(scene, data, redrawn, start.continues)
    scene = continued_scene(scene, start, data, redrawn)
    if unknown := [line(*one) for one in class_problems(scene.measures, scene.groups, list(scene.materials))]:
        raise SceneError(report(scene.source, unknown))
    grains = _grains(scene, data, [list(scene.materials).index(name) if name in scene.materials else -1 for name in names])
    history, notes = kept_history(scene, data, redrawn)
    if "orientation" in data:
        history["orientation"] = data["orientation"]
    inlets = continued_inlets(data) if "streams" in start.continues else {}
    known = tuple(name for name in data["places"]["walls"] if name not in redrawn)
    film = None
    if scene.contact.liquid != "none":
        kept = scene.contact.liquid == data["scene"]["contact"].get("liquid")
        at_walls = wall_numbers(scene, data)[0][data["wall_contact_wall"]] >= 0 if "wall_contact_wall" in data else np.zeros(0)
        film = starting_films(data, kept, kept & (at_walls > 0))
    return Past(scene, grains, history, known, data["next_id"], inlets, (*said, *notes), film)


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
