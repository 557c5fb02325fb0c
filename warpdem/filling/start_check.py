"""Whether the grains of a scene can start where they are: without large overlaps, on the right side of every wall."""

from collections.abc import Collection

import numpy as np

from warpdem.errors import SceneError
from warpdem.filling.initial_grains import InitialGrains
from warpdem.filling.packing_neighbors import worst_overlaps
from warpdem.filling.placed_walls import in_body_axes
from warpdem.mesh.triangle_mesh import TriangleMesh, signed_distance
from warpdem.scene.model import Scene
from warpdem.scene.walls import SHAPES, Wall


def check_start(grains: InitialGrains, meshes: dict[str, TriangleMesh], scene: Scene, known: Collection[str] = ()) -> None:
    """Refuse a start that the engine would answer with an explosion.

    A closed mesh with more than half of the grains inside, or one whose inside is filled, is a container: all other
    grains must be inside it or another container. Any other closed mesh is an obstacle: no grain may be inside. Open
    meshes have no inside. ``known`` walls, which were there before the start, are not checked. What does not touch
    (``contact = false``) may overlap.

    Raises:
        SceneError: Two grains coincide or overlap by more than `engine.max_overlap` of the smaller radius, or a grain's
            centre is on the wrong side of a wall, or nearer to it than the radius by more than that ratio.
    """
    if len(grains) == 0:
        return
    _check_overlaps(grains, scene)
    distance = {}
    for number, wall in enumerate(scene.walls):
        if wall.name in known:
            continue
        seen = in_body_axes(scene, number, grains.position)
        if wall.shape is not None:
            distance[wall.name] = wall.shape.nearest(seen)[1]
            touches, key = scene.touched(grains.type, number), f"{scene.source}: walls[{number}]"
            _check_shape(grains, seen, distance[wall.name], touches, wall, key)
        else:
            distance[wall.name] = signed_distance(meshes[wall.name], seen)[0]
    _check_closed_meshes(grains, distance, meshes, scene)
    _check_wall_overlaps(grains, distance, scene)


def _place(grains: InitialGrains, i: int) -> str:
    """Grain i by id and position, for messages."""
    return f"grain {grains.id[i]} at ({', '.join(f'{v:.6g}' for v in grains.position[i])}) m"


def _entry(grains: InitialGrains, i: int, scene: Scene) -> str:
    """Grain i by its key and position where the scene lists positions, else by its id."""
    for number, group in enumerate(scene.grains):
        if group.positions is not None:
            row = np.flatnonzero((np.array(group.positions, float) == grains.position[i]).all(axis=1))
            if len(row):
                return f"grains[{number}].positions[{row[0]}] ({', '.join(f'{v:.6g}' for v in grains.position[i])}) m"
    return _place(grains, i)


def _check_overlaps(grains: InitialGrains, scene: Scene) -> None:
    clump = None if grains.clumps is None else grains.clumps.of_grain
    through = (grains.type, scene.apart) if scene.apart.any() else None
    ratio, partner = worst_overlaps(grains.position, grains.radius, clump, through)
    i = int(np.argmax(ratio))
    allowed = scene.engine.max_overlap
    if ratio[i] <= allowed:
        return
    i, j = sorted((i, int(partner[i])), key=lambda k: grains.id[k])
    apart = np.linalg.norm(grains.position[i] - grains.position[j])
    both = f"{_place(grains, i)} and {_place(grains, j)}"
    count = int((ratio > allowed).sum())
    if apart == 0.0:
        raise SceneError(f"{scene.source}: grains: {both} coincide; each grain needs a place of its own")
    overlap = grains.radius[i] + grains.radius[j] - apart
    raise SceneError(
        f"{scene.source}: grains: {both} overlap by {overlap:.6g} m, {ratio.max():.3g} of the smaller radius; allowed "
        f"at the start is {allowed:g} ({count} grains overlap by more)"
    )


def _check_wall_overlaps(grains: InitialGrains, distance: dict[str, np.ndarray], scene: Scene) -> None:
    """Refuse grains that reach too far into a wall, given the distances (n,) [m] of their centres from each wall."""
    allowed = scene.engine.max_overlap
    for number, wall in enumerate(scene.walls):
        if wall.name not in distance:
            continue
        ratio = np.where(scene.touched(grains.type, number), 1.0 - np.abs(distance[wall.name]) / grains.radius, 0.0)
        deep = ratio > allowed
        if deep.any():
            i = int(np.argmax(ratio))
            raise SceneError(
                f"{scene.source}: walls[{number}]: {_place(grains, i)} reaches {ratio[i] * grains.radius[i]:.6g} m into the "
                f"wall {wall.name!r}, {ratio[i]:.3g} of its radius; allowed at the start is {allowed:g} "
                f"({int(deep.sum())} of {len(grains)} grains reach in by more)"
            )


def _check_shape(
    grains: InitialGrains, position: np.ndarray, height: np.ndarray, touches: np.ndarray, wall: Wall, key: str
) -> None:
    kind = next(name for name in SHAPES if getattr(wall, name) is not None)
    assert wall.shape is not None
    bore = wall.shape.bore(position)
    tight = touches & (grains.radius >= bore)
    if tight.any():
        i = int(np.argmax(tight))
        raise SceneError(
            f"{key}.{kind}: {_place(grains, i)} has the radius {grains.radius[i]:.6g} m and does not fit into {wall.name!r}, "
            f"whose radius there is {bore[i]:.6g} m; only smaller grains touch it at one point"
        )
    behind = touches & (height < 0.0)
    if behind.any():
        i = int(np.argmin(np.where(behind, height, 0.0)))
        raise SceneError(
            f"{key}.{kind}: {_place(grains, i)} is {-height[i]:.6g} m behind the {kind} {wall.name!r}, {wall.shape.side} "
            f"({int(behind.sum())} of {len(grains)} grains are behind it)"
        )


def _check_closed_meshes(
    grains: InitialGrains, distance: dict[str, np.ndarray], meshes: dict[str, TriangleMesh], scene: Scene
) -> None:
    keys = {wall.name: f"walls[{number}].mesh" for number, wall in enumerate(scene.walls)}
    depth = {
        name: -distance[name]
        for name, mesh in meshes.items()
        if name in distance and mesh.is_closed and mesh.mismatched_edges == 0
    }
    touches = {wall.name: scene.touched(grains.type, number) for number, wall in enumerate(scene.walls)}
    containers = {
        name for name, d in depth.items()
        if name in grains.vessels or 2 * int((touches[name] & (d > 0.0)).sum()) > touches[name].sum()
    }  # fmt: skip
    contained = (
        np.any([depth[name] > 0.0 for name in containers], axis=0) if containers else np.zeros(len(grains), bool)
    )
    for name, d in depth.items():
        within, met = touches[name] & (d > 0.0), touches[name]
        astray = ~contained & ~within & met
        wrong = astray if name in containers else within
        if not wrong.any():
            continue
        if 2 * int(within.sum()) == met.sum() and astray.any():
            wrong = astray  # of as many inside as outside, those that nothing holds are likelier to be misplaced
        i = int(np.argmax(np.where(wrong, np.abs(d), -1.0)))
        side, other = ("inside", "outside") if within[i] else ("outside", "inside")
        others = int((met & (within != within[i])).sum())
        raise SceneError(
            f"{scene.source}: {_entry(grains, i, scene)} is {side} the closed mesh {name!r} ({keys[name]}), "
            f"{abs(d[i]):.6g} m from its surface, while {others} {'grain is' if others == 1 else 'grains are'} {other}"
        )
