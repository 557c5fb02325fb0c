"""The grains of a scene at its start: from arrays, grain files and fillings."""

from dataclasses import dataclass

import numpy as np

from warpdem.errors import SceneError
from warpdem.filling.fill_request import HEIGHT_FRACTION, Filling, filling
from warpdem.filling.fill_space import FillSpace, choose_fill_space
from warpdem.filling.grain_file import read_grain_file
from warpdem.filling.packing import pack
from warpdem.filling.packing_run import Packing
from warpdem.filling.placed_walls import PlacedWall, in_body_axes, place_walls, wall_poses_at_start
from warpdem.mesh.triangle_mesh import TriangleMesh
from warpdem.scene.motion_chain import Chain, frame_chain
from warpdem.scene.size_distribution import size_law


@dataclass(frozen=True)
class InitialGrains:
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


def concatenated(first: InitialGrains, second: InitialGrains) -> InitialGrains:
    """The grains of both."""
    both = zip(vars(first).values(), vars(second).values(), strict=True)
    return InitialGrains(*(np.concatenate([a, b]) if isinstance(a, np.ndarray) else a + b for a, b in both))


def load_grains(scene, meshes: dict[str, TriangleMesh]) -> InitialGrains:
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
        return InitialGrains(none.astype(np.int64), none, none, np.zeros(0), *(np.zeros((0, 3)) for _ in range(3)))
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
    return InitialGrains(id=_unique_ids(groups, scene.source), **fields, **filled)


def _placed(scene, meshes: dict[str, TriangleMesh]) -> tuple[list[dict[str, np.ndarray | None]], dict[str, tuple]]:
    """Fields of all groups by name, without type, fillings among the grains of all others; and what else fillings tell."""
    keys = [f"{scene.source}: grains[{number}]" for number in range(len(scene.grains))]
    walls = (
        place_walls(scene, meshes, wall_poses_at_start(scene)) if any(g.fill is not None for g in scene.grains) else []
    )
    spaces = {
        k: _space(scene, meshes, walls, g, f"{keys[k]}.fill") for k, g in enumerate(scene.grains) if g.fill is not None
    }
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


def _space(scene, meshes: dict[str, TriangleMesh], walls: list[PlacedWall], group, key: str) -> FillSpace:
    """Where a filling goes."""
    asked = group.fill
    if asked.wall is not None:
        number = [wall.name for wall in scene.walls].index(asked.wall)
        if not np.array_equal(in_body_axes(scene, number, corner := meshes[asked.wall].bounds), corner):
            raise SceneError(
                f"{key}.wall: {asked.wall!r} has been moving before time 0; only a wall in place can be filled"
            )
    axes = frame_chain(scene).pose(np.zeros(1)).axes[0].astype(float)
    return choose_fill_space(scene, meshes, walls, asked, -(np.asarray(scene.gravity, float) @ axes), key)


def _filling(scene, space: FillSpace, group, key: str) -> Filling:
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
    return read_grain_file(scene.resolve(group.file), f"{key}.file")


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
