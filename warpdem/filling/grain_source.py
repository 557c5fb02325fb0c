"""Where the grains of a scene come from (arrays, state files, fillings), and whether they can start there."""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from warpdem.errors import SceneError
from warpdem.filling.barriers import Barrier, barriers, places_at_start
from warpdem.filling.packing import HEIGHT_FRACTION, Filling, Packing, filling, pack, worst_overlaps
from warpdem.filling.spaces import Space, space_of
from warpdem.filling.state_file import read_state
from warpdem.mesh.triangle_mesh import TriangleMesh, signed_distance
from warpdem.scene.motion_chain import Chain, frame_chain, wall_chain
from warpdem.scene.size_distribution import size_law
from warpdem.scene.wall_shapes import SHAPES, Cylinder, Sphere


@dataclass(frozen=True)
class Grains0:
    """The grains at time 0: vectors in frame axes, motion relative to the frame."""

    id: np.ndarray
    """Grain ids, all different, shape (n,), int64."""
    type: np.ndarray
    """Material index in the order of the scene, shape (n,), int32."""
    group: np.ndarray
    """Number of the group, of those of ``Scene.groups``, shape (n,), int32."""
    radius: np.ndarray
    """Radius [m], shape (n,)."""
    position: np.ndarray
    """Position [m], shape (n, 3)."""
    velocity: np.ndarray
    """Velocity relative to the frame [m/s], shape (n, 3)."""
    spin: np.ndarray
    """Angular velocity relative to the frame [rad/s], shape (n, 3)."""
    packings: tuple[Packing, ...] = ()
    """What packing the fillings took."""
    vessels: tuple[str, ...] = ()
    """Closed mesh walls inside of which fillings are."""
    notes: tuple[str, ...] = ()
    """What is to be known of the fillings, for people."""

    def __len__(self) -> int:
        return len(self.id)


def joined(first: Grains0, second: Grains0) -> Grains0:
    """The grains of both."""
    both = zip(vars(first).values(), vars(second).values(), strict=True)
    return Grains0(*(np.concatenate([a, b]) if isinstance(a, np.ndarray) else a + b for a, b in both))


def load_grains(scene, meshes: dict[str, TriangleMesh]) -> Grains0:
    """All grains of a scene, group after group in the scene's order.

    Grains without ids get the least numbers that no other grain has, running on from group to group. Fillings
    keep clear of all other grains and of all walls, where these stand at time 0.

    Args:
        scene: Validated scene.
        meshes: Mesh walls by name, placed where they stand at time 0.

    Raises:
        SceneError: A state file is missing, unreadable or holds no grains; a filling does not fit; an id comes twice.
    """
    names = list(scene.materials)
    if not scene.grains:
        none = np.zeros(0, np.int32)
        return Grains0(none.astype(np.int64), none, none, np.zeros(0), *(np.zeros((0, 3)) for _ in range(3)))
    groups, filled = _placed(scene, meshes)
    for number, (group, grains) in enumerate(zip(scene.grains, groups, strict=True)):
        if group.velocities_in == "laboratory":
            grains = groups[number] = _relative_to_frame(grains, frame_chain(scene))
        grains["type"] = np.full(len(grains["radius"]), names.index(group.material), np.int32)
        grains["group"] = np.full(len(grains["radius"]), scene.groups.index(scene.group_names[number]), np.int32)
    fields = {
        key: np.concatenate([g[key] for g in groups])
        for key in ("type", "group", "radius", "position", "velocity", "spin")
    }
    return Grains0(id=_unique_ids(groups, scene.source), **fields, **filled)


def check_start(grains: Grains0, meshes: dict[str, TriangleMesh], scene, known: Collection[str] = ()) -> None:
    """Refuse a start that the engine would answer with an explosion.

    A closed mesh with more than half of the grains inside, or one whose inside is filled, is a container: all other
    grains must be inside it or another container. Any other closed mesh is an obstacle: no grain may be inside. Open
    meshes have no inside. ``known`` walls, which were there before the start, are not checked.

    Raises:
        SceneError: Two grains coincide or overlap by more than `engine.max_overlap` of the smaller radius, or a grain's
            centre is on the wrong side of a wall, or nearer to it than the radius by more than that share.
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
            _check_shape(grains, seen, distance[wall.name], wall, f"{scene.source}: walls[{number}]")
        else:
            distance[wall.name] = signed_distance(meshes[wall.name], seen)[0]
    _check_closed_meshes(grains, distance, meshes, scene)
    _check_wall_overlaps(grains, distance, scene)


def in_body_axes(scene, number: int, position: np.ndarray) -> np.ndarray:
    """Positions (n, 3) [m] at time 0 in the axes of a wall's body; the same ones unless something has been moving before."""
    wall, begin = scene.walls[number], np.zeros(1)
    frame, own = frame_chain(scene).pose(begin), wall_chain(scene, number).pose(begin)
    if wall.fixed_to == "laboratory":
        position = position @ frame.axes[0].T.astype(float) + frame.origin[0].astype(float)
    return (position - own.origin[0].astype(float)) @ own.axes[0].astype(float)


def _placed(scene, meshes: dict[str, TriangleMesh]) -> tuple[list[dict[str, np.ndarray | None]], dict[str, tuple]]:
    """Fields of all groups by name, without type, fillings among the grains of all others; and what else fillings tell."""
    keys = [f"{scene.source}: grains[{number}]" for number in range(len(scene.grains))]
    walls = barriers(scene, meshes, places_at_start(scene)) if any(g.fill is not None for g in scene.grains) else []
    spaces = {k: _space(scene, meshes, walls, g, f"{keys[k]}.fill") for k, g in enumerate(scene.grains) if g.fill is not None}
    fillings = {k: _filling(scene, spaces[k], scene.grains[k], f"{keys[k]}.fill") for k in spaces}
    groups = {k: _given(scene, g, keys[k]) for k, g in enumerate(scene.grains) if g.fill is None}
    held = [np.concatenate([g[name] for g in groups.values()]) for name in ("position", "radius")] if groups else None
    places, packings = pack(list(fillings.values()), held)
    for (k, asked), position in zip(fillings.items(), places, strict=True):
        rest = np.zeros_like(position)
        groups[k] = {"position": position, "radius": asked.radius, "velocity": rest, "spin": rest, "id": None}
    vessels = tuple(dict.fromkeys(name for space in spaces.values() for name in space.vessels))
    notes = tuple(note for space in spaces.values() for note in space.notes)
    told = {"packings": tuple(packings), "vessels": vessels, "notes": notes}
    return [groups[k] for k in range(len(scene.grains))], told


def _space(scene, meshes: dict[str, TriangleMesh], walls: list[Barrier], group, key: str) -> Space:
    """Where a filling goes."""
    asked = group.fill
    if asked.wall is not None:
        number = [wall.name for wall in scene.walls].index(asked.wall)
        if not np.array_equal(in_body_axes(scene, number, corner := meshes[asked.wall].bounds), corner):
            raise SceneError(f"{key}.wall: {asked.wall!r} has been moving before time 0; only a wall in place can be filled")
    axes = frame_chain(scene).pose(np.zeros(1)).axes[0].astype(float)
    return space_of(scene, meshes, walls, asked, -(np.asarray(scene.gravity, float) @ axes), key)


def _filling(scene, space: Space, group, key: str) -> Filling:
    """Sizes that a filling asks for, in its space."""
    asked = group.fill
    volume = None if asked.mass is None else asked.mass / scene.materials[group.material].density
    fraction = HEIGHT_FRACTION if (asked.count, volume, asked.solid_fraction) == (None,) * 3 else asked.solid_fraction
    return filling(space.region, size_law(asked.diameter), asked.seed, asked.count, fraction, volume, key, space.walls)


def _given(scene, group, key: str) -> dict[str, np.ndarray | None]:
    """Fields of a group given by positions or a file, by name, without type; id None when the source has none."""
    if group.positions is not None:
        return {
            "position": np.array(group.positions, float),
            "radius": np.array(group.explicit_radii, float),
            "velocity": np.array(group.explicit_velocities, float),
            "spin": np.array(group.explicit_spins, float),
            "id": None if group.ids is None else np.array(group.ids, np.int64),
        }
    return read_state(scene.resolve(group.file), f"{key}.file")


def _relative_to_frame(grains: dict[str, np.ndarray], frame: Chain) -> dict[str, np.ndarray]:
    """Velocities and spins relative to the frame at time 0 from those in the laboratory: v - u - w x q and spin - w."""
    pose = frame.pose(np.zeros(1))
    spin, velocity = pose.spin[0].astype(float), pose.velocity[0].astype(float)
    return {
        **grains,
        "velocity": grains["velocity"] - velocity - np.cross(spin, grains["position"]),
        "spin": grains["spin"] - spin,
    }


def _unique_ids(groups: list[dict[str, np.ndarray]], source: str) -> np.ndarray:
    """Ids of all grains: given ones as they are, the others the least free numbers in turn."""
    owner = {}
    for number, group in enumerate(groups):
        for name in [] if group["id"] is None else group["id"].tolist():
            if owner.setdefault(name, number) != number:
                raise SceneError(
                    f"{source}: grains[{number}]: grains[{owner[name]}] has the id {name} too: ids must be unique"
                )
    wanted = sum(len(group["radius"]) for group in groups if group["id"] is None)
    free = np.setdiff1d(np.arange(wanted + len(owner)), np.fromiter(owner, np.int64, len(owner)))[:wanted]
    parts = []
    for group in groups:
        if group["id"] is not None:
            parts.append(group["id"])
            continue
        count = len(group["radius"])
        parts.append(free[:count])
        free = free[count:]
    return np.concatenate(parts).astype(np.int64)


def _place(grains: Grains0, i: int) -> str:
    """Grain i by id and position, for messages."""
    return f"grain {grains.id[i]} at ({', '.join(f'{v:.6g}' for v in grains.position[i])}) m"


def _entry(grains: Grains0, i: int, scene) -> str:
    """Grain i by its key and position where the scene lists positions, else by its id."""
    for number, group in enumerate(scene.grains):
        if group.positions is not None:
            row = np.flatnonzero((np.array(group.positions, float) == grains.position[i]).all(axis=1))
            if len(row):
                return f"grains[{number}].positions[{row[0]}] ({', '.join(f'{v:.6g}' for v in grains.position[i])}) m"
    return _place(grains, i)


def _check_overlaps(grains: Grains0, scene) -> None:
    share, partner = worst_overlaps(grains.position, grains.radius)
    i = int(np.argmax(share))
    allowed = scene.engine.max_overlap
    if share[i] <= allowed:
        return
    i, j = sorted((i, int(partner[i])), key=lambda k: grains.id[k])
    apart = np.linalg.norm(grains.position[i] - grains.position[j])
    both = f"{_place(grains, i)} and {_place(grains, j)}"
    count = int((share > allowed).sum())
    if apart == 0.0:
        raise SceneError(f"{scene.source}: grains: {both} coincide; each grain needs a place of its own")
    overlap = grains.radius[i] + grains.radius[j] - apart
    raise SceneError(
        f"{scene.source}: grains: {both} overlap by {overlap:.6g} m, {share.max():.3g} of the smaller radius; allowed "
        f"at the start is {allowed:g} ({count} grains overlap by more)"
    )


def _check_wall_overlaps(grains: Grains0, distance: dict[str, np.ndarray], scene) -> None:
    """Refuse grains that reach too far into a wall, given the distances (n,) [m] of their centres from each wall."""
    allowed = scene.engine.max_overlap
    for number, wall in enumerate(scene.walls):
        if wall.name not in distance:
            continue
        share = 1.0 - np.abs(distance[wall.name]) / grains.radius
        deep = share > allowed
        if deep.any():
            i = int(np.argmax(share))
            raise SceneError(
                f"{scene.source}: walls[{number}]: {_place(grains, i)} reaches {share[i] * grains.radius[i]:.6g} m into the "
                f"wall {wall.name!r}, {share[i]:.3g} of its radius; allowed at the start is {allowed:g} "
                f"({int(deep.sum())} of {len(grains)} grains reach in by more)"
            )


def _check_shape(grains: Grains0, position: np.ndarray, height: np.ndarray, wall, key: str) -> None:
    kind = next(name for name in SHAPES if getattr(wall, name) is not None)
    shape = wall.shape
    if isinstance(shape, (Cylinder, Sphere)):
        tight = shape.holds(position) & (grains.radius >= shape.radius)
        if tight.any():
            i = int(np.argmax(tight))
            raise SceneError(
                f"{key}.{kind}.radius = {shape.radius:.6g} m: {_place(grains, i)} has the radius {grains.radius[i]:.6g} m and "
                f"does not fit into {wall.name!r}; only smaller grains touch it at one place"
            )
    behind = height < 0.0
    if behind.any():
        i = int(np.argmin(height))
        asked = "whose normal must point to the grains"
        if kind != "plane":
            asked = f"whose grains are {'inside' if shape.inside else 'outside'} (inside = {str(shape.inside).lower()})"
        raise SceneError(
            f"{key}.{kind}: {_place(grains, i)} is {-height[i]:.6g} m behind the {kind} {wall.name!r}, {asked} "
            f"({int(behind.sum())} of {len(grains)} grains are behind it)"
        )


def _check_closed_meshes(
    grains: Grains0, distance: dict[str, np.ndarray], meshes: dict[str, TriangleMesh], scene
) -> None:
    keys = {wall.name: f"walls[{number}].mesh" for number, wall in enumerate(scene.walls)}
    depth = {
        name: -distance[name]
        for name, mesh in meshes.items()
        if name in distance and mesh.is_closed and mesh.mismatched_edges == 0
    }
    containers = {name for name, d in depth.items() if name in grains.vessels or 2 * int((d > 0.0).sum()) > len(grains)}
    contained = np.any([depth[name] > 0.0 for name in containers], axis=0) if containers else np.zeros(len(grains), bool)
    for name, d in depth.items():
        within = d > 0.0
        astray = ~contained & ~within
        wrong = astray if name in containers else within
        if not wrong.any():
            continue
        if 2 * int(within.sum()) == len(grains) and astray.any():
            wrong = astray  # of as many inside as outside, those that nothing holds are likelier to be misplaced
        i = int(np.argmax(np.where(wrong, np.abs(d), -1.0)))
        side, other = ("inside", "outside") if within[i] else ("outside", "inside")
        others = int((within != within[i]).sum())
        raise SceneError(
            f"{scene.source}: {_entry(grains, i, scene)} is {side} the closed mesh {name!r} ({keys[name]}), "
            f"{abs(d[i]):.6g} m from its surface, while {others} {'grain is' if others == 1 else 'grains are'} {other}"
        )
