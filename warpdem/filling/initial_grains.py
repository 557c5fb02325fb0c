"""The grains of a scene at its start: from arrays, grain files and fillings."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from warpdem.errors import SceneError
from warpdem.filling.clump_file import ClumpRows, read_clump_file
from warpdem.filling.clump_grains import InitialClumps, of_groups, placed
from warpdem.filling.clump_template import ClumpTemplate, clump_templates
from warpdem.filling.fill_request import HEIGHT_FRACTION, Filling, clump_filling, filling
from warpdem.filling.fill_space import FillSpace, choose_fill_space
from warpdem.filling.grain_file import read_grain_file
from warpdem.filling.packing import pack
from warpdem.filling.packing_run import Packing
from warpdem.filling.placed_walls import PlacedWall, in_body_axes, place_walls, wall_poses_at_start
from warpdem.filling.rigid_moves import PlacedClumps
from warpdem.filling.tile import tiled
from warpdem.mesh.triangle_mesh import TriangleMesh
from warpdem.scene.grains import Fill, Grains
from warpdem.scene.model import Scene
from warpdem.scene.motion_chain import Chain, frame_chain
from warpdem.scene.size_distribution import factor_law, size_law
from warpdem.usd.motion import conjugate, multiply_quaternions


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
    """Notes to the user about the fillings and clumps."""
    clumps: InitialClumps | None = None
    """Clumps that grains are members of; None without any."""

    def __len__(self) -> int:
        return len(self.id)


@dataclass(frozen=True)
class GroupFields:
    """The grains of one group of a scene; vectors in frame axes."""

    position: np.ndarray
    """Positions [m], shape (n, 3)."""
    radius: np.ndarray
    """Radii [m], shape (n,)."""
    velocity: np.ndarray
    """Velocities [m/s], shape (n, 3)."""
    spin: np.ndarray
    """Angular velocities [rad/s], shape (n, 3)."""
    id: np.ndarray | None = None
    """Ids, shape (n,), int64; None where they are not given."""
    clumps: InitialClumps | None = None
    """Clumps, if the grains are members of some."""


def concatenated(first: InitialGrains, second: InitialGrains) -> InitialGrains:
    """The grains of both."""
    clumps = None
    if first.clumps is not None or second.clumps is not None:
        clumps = of_groups([first.clumps, second.clumps], [len(first), len(second)])
    both: dict[str, Any] = {key: (getattr(first, key), getattr(second, key)) for key in vars(first) if key != "clumps"}
    joined: dict[str, Any] = {
        key: np.concatenate([a, b]) if isinstance(a, np.ndarray) else a + b for key, (a, b) in both.items()
    }
    return InitialGrains(**joined, clumps=clumps)


def load_grains(scene: Scene, meshes: dict[str, TriangleMesh]) -> InitialGrains:
    """All grains of a scene, group after group in the scene's order.

    Grains without ids get the least numbers that no other grain has, running on from group to group. Fillings keep clear of all
    other grains and of all walls, at their positions at time 0, but for those that their material passes through.

    Args:
        scene: Validated scene.
        meshes: Mesh walls by name, placed where they are at time 0.

    Raises:
        SceneError: A grain file is missing, unreadable or holds no grains; a filling does not fit; an id occurs twice.
    """
    if not scene.grains:
        none = np.zeros(0, np.int32)
        rows = np.zeros((0, 3))
        return InitialGrains(none.astype(np.int64), none, none, np.zeros(0), rows, rows, rows)
    keys = [f"{scene.source}: grains[{number}]" for number in range(len(scene.grains))]
    fills = {k: group.fill for k, group in enumerate(scene.grains) if group.fill is not None and group.fill.tile is None}
    walls = place_walls(scene, meshes, wall_poses_at_start(scene)) if fills else []
    templates = clump_templates(scene)
    spaces = {
        k: _fill_space(scene, meshes, _met(scene, walls, scene.grains[k]), scene.grains[k], templates, f"{keys[k]}.fill")
        for k in fills
    }
    groups = {k: _given(scene, group, keys[k], templates) for k, group in enumerate(scene.grains) if k not in fills}
    packings: list[Packing] = []
    for together in _groups_that_meet(scene) if fills else []:
        given = [groups[k] for k in together if k in groups]
        fixed = (np.concatenate([g.position for g in given]), np.concatenate([g.radius for g in given])) if given else None
        filled = [k for k in together if k in fills]
        requests = {k: _request(scene, spaces[k], scene.grains[k], templates, f"{keys[k]}.fill") for k in filled}
        positions, took = pack(list(requests.values()), fixed)
        packings += took
        for (k, request), position in zip(requests.items(), positions, strict=True):
            if isinstance(position, np.ndarray):
                groups[k] = GroupFields(position, request.radius, np.zeros_like(position), np.zeros_like(position))
            else:
                groups[k] = _filled_with_clumps(scene, scene.grains[k], templates, position)
    for k, group in enumerate(scene.grains):
        if group.velocities_in == "laboratory":
            groups[k] = _relative_to_frame(groups[k], frame_chain(scene))
    ordered, names = [groups[k] for k in range(len(scene.grains))], list(scene.materials)
    counts = [len(group.radius) for group in ordered]
    material = [names.index(group.material) for group in scene.grains]
    number = [scene.groups.index(name) for name in scene.group_names[: len(ordered)]]
    return InitialGrains(
        id=_unique_ids(ordered, scene.source),
        type=np.repeat(np.array(material, np.int32), counts),
        group=np.repeat(np.array(number, np.int32), counts),
        radius=np.concatenate([group.radius for group in ordered]),
        position=np.concatenate([group.position for group in ordered]),
        velocity=np.concatenate([group.velocity for group in ordered]),
        spin=np.concatenate([group.spin for group in ordered]),
        packings=tuple(packings),
        vessels=tuple(dict.fromkeys(name for space in spaces.values() for name in space.vessels)),
        notes=(*(note for space in spaces.values() for note in space.notes), *_clump_notes(scene, templates)),
        clumps=of_groups([group.clumps for group in ordered], counts),
    )


def _met(scene: Scene, walls: list[PlacedWall], group: Grains) -> list[PlacedWall]:
    """The walls that a group does not pass through, and the one that it fills."""
    names, material = list(scene.materials), {wall.name: wall.material for wall in scene.walls}
    row = scene.apart[names.index(group.material)]
    filled = None if group.fill is None else group.fill.wall
    return [wall for wall in walls if wall.name == filled or not row[names.index(material[wall.name])]]


def _groups_that_meet(scene: Scene) -> list[list[int]]:
    """Numbers of the groups of grains, those together that touch each other, or both a third; in ascending order."""
    names = list(scene.materials)
    material, left = [names.index(group.material) for group in scene.grains], list(range(len(scene.grains)))
    found: list[list[int]] = []
    while left:
        together = [left.pop(0)]
        for k in together:  # grows while it is read
            near = [other for other in left if not scene.apart[material[k], material[other]]]
            together += near
            left = [other for other in left if other not in near]
        found.append(sorted(together))
    return found


def _fill_space(
    scene: Scene, meshes: dict[str, TriangleMesh], walls: list[PlacedWall], group: Grains,
    templates: dict[str, ClumpTemplate], key: str,
) -> FillSpace:  # fmt: skip
    """The space that a filling means."""
    fill = group.fill
    assert fill is not None
    if group.clump is not None:
        least = float(templates[group.clump].radius.min()) * factor_law(fill.size).extremes[0]
    else:
        assert fill.diameter is not None
        least = 0.5 * size_law(fill.diameter).extremes[0]
    if fill.wall is not None:
        number = [wall.name for wall in scene.walls].index(fill.wall)
        if not np.array_equal(in_body_axes(scene, number, corner := meshes[fill.wall].bounds), corner):
            raise SceneError(
                f"{key}.wall: {fill.wall!r} has been moving before time 0; only a wall in place can be filled"
            )
    axes = frame_chain(scene).pose(np.zeros(1)).axes[0].astype(float)
    return choose_fill_space(scene, meshes, walls, fill, -(np.asarray(scene.gravity, float) @ axes), key, least)


def _request(
    scene: Scene, space: FillSpace, group: Grains, templates: dict[str, ClumpTemplate], key: str
) -> Filling:  # fmt: skip
    """The grains that a filling asks for, in its space."""
    fill, density = group.fill, scene.materials[group.material].density
    assert fill is not None
    fraction = HEIGHT_FRACTION if (fill.count, fill.mass, fill.solid_fraction) == (None,) * 3 else fill.solid_fraction
    if group.clump is not None:
        return clump_filling(
            space.region, templates[group.clump], factor_law(fill.size), fill.seed, orientation=_orientation(fill),
            count=fill.count, solid_fraction=fraction, mass=fill.mass, density=density, key=key, walls=space.walls,
        )  # fmt: skip
    assert fill.diameter is not None
    volume = None if fill.mass is None else fill.mass / density
    return filling(space.region, size_law(fill.diameter), fill.seed, fill.count, fraction, volume, key, space.walls)


def _orientation(fill: Fill) -> tuple[float, ...] | None:
    """Quaternion of all clumps of a filling; None where each has its own by chance."""
    if isinstance(fill.orientation, tuple):
        return fill.orientation
    return (1.0, 0.0, 0.0, 0.0) if fill.orientation == "aligned" else None


def _filled_with_clumps(
    scene: Scene, group: Grains, templates: dict[str, ClumpTemplate], there: PlacedClumps
) -> GroupFields:
    """Clumps of a filling, at rest."""
    assert group.clump is not None
    template, rest = templates[group.clump], np.zeros_like(there.centre)
    clumps, members = placed(
        template, list(templates).index(group.clump), scene.materials[group.material].density, there.centre, rest, rest,
        multiply_quaternions(there.turn, conjugate(template.axes[None]).astype(float)), there.size,
    )  # fmt: skip
    return GroupFields(*members, clumps=clumps)


def _clump_notes(scene: Scene, templates: dict[str, ClumpTemplate]) -> list[str]:
    """What is odd in the clumps."""
    apart = [template for template in templates.values() if template.parts > 1]
    return [
        f"clumps.{one.name}: its spheres are {one.parts} groups that do not touch each other; they move as one rigid body"
        for one in apart
    ]


def _given(scene: Scene, group: Grains, key: str, templates: dict[str, ClumpTemplate]) -> GroupFields:
    """Grains of a group that has positions, a file, or copies of a tile."""
    if group.fill is not None and group.fill.tile is not None:
        copied, sizes = tiled(group.fill, scene.resolve(group.fill.tile), f"{key}.fill")
        return GroupFields(copied, sizes, np.zeros_like(copied), np.zeros_like(copied))
    if group.clump is not None:
        template, number = templates[group.clump], list(templates).index(group.clump)
        if group.file is not None:
            rows = read_clump_file(scene.resolve(group.file), template, number, f"{key}.file")
        else:
            centres = np.array(group.positions, float)
            rows = ClumpRows(centres, group.explicit_velocities, group.explicit_spins, group.orientations, group.sizes)
        clumps, members = placed(
            template, number, scene.materials[group.material].density, rows.position, rows.velocity, rows.spin,
            rows.orientation, rows.size,
        )  # fmt: skip
        return GroupFields(*members, clumps=clumps)
    if group.positions is not None:
        return GroupFields(
            position=np.array(group.positions, float),
            radius=np.array(group.explicit_radii, float),
            velocity=np.array(group.explicit_velocities, float),
            spin=np.array(group.explicit_spins, float),
            id=None if group.ids is None else np.array(group.ids, np.int64),
        )
    assert group.file is not None
    fields = read_grain_file(scene.resolve(group.file), f"{key}.file")
    position, radius, velocity, spin = (fields[name] for name in ("position", "radius", "velocity", "spin"))
    assert position is not None and radius is not None and velocity is not None and spin is not None
    return GroupFields(position, radius, velocity, spin, fields["id"])


def _relative_to_frame(grains: GroupFields, frame: Chain) -> GroupFields:
    """Velocities and spins relative to the frame at time 0 from those in the laboratory: v - u - w x q and spin - w."""
    pose = frame.pose(np.zeros(1))
    spin, velocity = pose.spin[0].astype(float), pose.velocity[0].astype(float)
    moved = replace(
        grains, velocity=grains.velocity - velocity - np.cross(spin, grains.position), spin=grains.spin - spin
    )
    if (clumps := grains.clumps) is None:
        return moved
    there = clumps.velocity - velocity - np.cross(spin, clumps.position)
    return replace(moved, clumps=replace(clumps, velocity=there, spin=clumps.spin - spin))


def _unique_ids(groups: list[GroupFields], source: str) -> np.ndarray:
    """Ids of all grains: given ones as they are, the others the least free numbers in turn."""
    owner: dict[int, int] = {}
    for number, group in enumerate(groups):
        for id_ in [] if group.id is None else group.id.tolist():
            if owner.setdefault(id_, number) != number:
                raise SceneError(
                    f"{source}: grains[{number}]: grains[{owner[id_]}] has the id {id_} too: ids must be unique"
                )
    wanted = sum(len(group.radius) for group in groups if group.id is None)
    given = np.fromiter(owner, np.int64, len(owner))
    if any(group.clumps is not None for group in groups):  # the members of a clump have consecutive ids
        free = given.max(initial=-1) + 1 + np.arange(wanted)
    else:
        free = np.setdiff1d(np.arange(wanted + len(owner)), given)[:wanted]
    parts = []
    for group in groups:
        if group.id is not None:
            parts.append(group.id)
            continue
        count = len(group.radius)
        parts.append(free[:count])
        free = free[count:]
    return np.concatenate(parts).astype(np.int64)
