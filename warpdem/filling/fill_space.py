"""Which space a filling of a scene means, and the walls that it keeps clear of."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from warpdem.errors import SceneError
from warpdem.filling.fill_region import FillRegion, closed_region, is_cup, open_region, sample_points, with_free_volume
from warpdem.filling.placed_walls import PlacedWall, assign_sides, is_closed, straddle_notes
from warpdem.mesh.shells import cavities, corners_in_file
from warpdem.mesh.solid import MeshSolid, facets, shape_of
from warpdem.mesh.triangle_mesh import TriangleMesh, signed_distance
from warpdem.scene.grains import Fill
from warpdem.scene.model import Scene
from warpdem.scene.regions import VOLUMES

SIDES = 4000
"""Points of a region that show which closed meshes hold it."""


@dataclass(frozen=True, eq=False)
class FillSpace:
    """Where a filling goes."""

    region: FillRegion
    """Its region."""
    walls: list[PlacedWall]
    """Walls to keep clear of."""
    vessels: tuple[str, ...]
    """Closed meshes inside of which it is."""
    notes: tuple[str, ...]
    """What is to be known of the choice, for people."""


def choose_fill_space(
    scene: Scene, meshes: dict[str, TriangleMesh], walls: Sequence[PlacedWall], asked: Fill, up: np.ndarray, key: str,
    least: float,
) -> FillSpace:  # fmt: skip
    """The space that a filling asks for.

    A closed mesh is filled inside; but of a body with a cavity, as a tank drawn with the thickness of its wall, the cavity is
    filled, and of a cup of solid walls the space that it holds. An open mesh is filled where it holds grains. ``fill.point``
    says otherwise.

    Args:
        scene: Validated scene.
        meshes: Mesh walls by name.
        walls: All walls where they stand.
        asked: The filling.
        up: Direction against gravity in frame axes, any length.
        key: Scene key of the filling, for messages.
        least: Radius of the smallest grain [m]: gaps that it does not pass through are closed.

    Raises:
        SceneError: Nothing is left, the grains would run out, or it is not clear which of several spaces is meant.
    """
    if asked.wall is None:
        box = None if asked.box is None else (asked.box.min, asked.box.max)
        space = closed_region(_facets(scene, asked, key), box, key, asked.height, up)
        shape_key = next(name for name in VOLUMES if getattr(asked, name) is not None)
        near, far = ([w for w in walls if w.is_near(space.bounds, 0.0) == is_near] for is_near in (True, False))
        points = sample_points(space, SIDES)
        sided, vessels = assign_sides(near, points, is_body=body_test(scene, up))
        notes = straddle_notes(sided, points, f"{key.split(': ')[-1]}.{shape_key}")
        return FillSpace(with_free_volume(space, sided, key), [*sided, *far], tuple(vessels), tuple(notes))
    mesh = meshes[asked.wall]
    box = None if asked.region is None else (asked.region.min, asked.region.max)
    others, vessels = assign_sides([w for w in walls if w.name != asked.wall], mesh.vertices, mesh)
    own = [w for w in walls if w.name == asked.wall]
    inner, note = _bound(scene, mesh, asked, up, key)
    if inner is not None:
        space = closed_region(inner, box, key, asked.height, up)
        around = others if inner is mesh else [*own, *others]
        held = (asked.wall,) if inner is mesh else ()
        return FillSpace(with_free_volume(space, around, key), around, (*held, *vessels), note)
    point = None if asked.point is None else np.asarray(asked.point, float)
    space = open_region(mesh, [*own, *others], box, least, key, asked.height, up, point)
    return FillSpace(space, [*own, *others], tuple(vessels), note)


def _facets(scene: Scene, asked: Fill, key: str) -> TriangleMesh | None:
    """Surface of the region to fill: of a mesh its own, of a cylinder or sphere triangles with their corners on it; no box."""
    if asked.mesh is not None:
        solid = shape_of(scene, asked.mesh, f"{key.split(': ')[-1]}.mesh")
        assert isinstance(solid, MeshSolid)
        return solid.mesh
    shape = asked.cylinder or asked.sphere
    return None if shape is None else facets(shape)


def _bound(
    scene: Scene, mesh: TriangleMesh, asked: Fill, up: np.ndarray, key: str
) -> tuple[TriangleMesh | None, tuple[str, ...]]:
    """The closed surface around the space, or None if it has none; and what is to be noted of that."""
    if not is_closed(mesh):
        return None, ()
    number = next(k for k, wall in enumerate(scene.walls) if wall.name == asked.wall)
    hollows = _hollows(scene, number, mesh)
    if asked.point is not None:
        point = np.asarray(asked.point, float)[None]
        if signed_distance(mesh, point)[0][0] < 0.0:
            return mesh, ()
        return next((hollow for hollow in hollows if signed_distance(hollow, point)[0][0] < 0.0), None), ()
    if len(hollows) > 1:
        points = "; ".join(f"point = {_point_inside(hollow)} ({abs(hollow.volume):.4g} m3)" for hollow in hollows)
        raise SceneError(f"{key}: {mesh.name} has {len(hollows)} cavities: say by a point in it which one is filled: {points}")
    if hollows:
        return hollows[0], (
            f"{key.split(': ')[-1]}: {mesh.name} is a body with a cavity of {abs(hollows[0].volume):.4g} m3, which is filled; "
            f"point = {_point_inside(mesh)} fills between its skins ({abs(mesh.volume):.4g} m3)",
        )
    if is_cup(mesh, up):
        return None, (
            f"{key.split(': ')[-1]}: {mesh.name} is a body that holds more between its walls than it has inside, as a cup, "
            f"which is filled; point = {_point_inside(mesh)} fills its inside ({abs(mesh.volume):.4g} m3)",
        )
    return mesh, ()


def body_test(scene: Scene, up: np.ndarray) -> Callable[[PlacedWall], bool]:
    """What tells whether a closed mesh wall is a body that holds more than it has inside: a tank or cup of solid walls.

    Args:
        scene: Validated scene.
        up: Direction against gravity in frame axes, any length.
    """

    def is_body(wall: PlacedWall) -> bool:
        mesh, number = wall.mesh, [one.name for one in scene.walls].index(wall.name)
        held = sum(abs(hollow.volume) for hollow in _hollows(scene, number, mesh))
        return bool(held > abs(mesh.volume)) or is_cup(mesh, up @ wall.axes)

    return is_body


def _hollows(scene: Scene, number: int, mesh: TriangleMesh) -> list[TriangleMesh]:
    """Cavities of a closed mesh wall."""
    if not cavities(mesh):
        return []
    wall, key = scene.walls[number], f"{scene.source}: walls[{number}].mesh"
    assert wall.mesh is not None
    file, folders = scene.resolve(wall.mesh), scene.access.folders
    given = file, wall.scale, wall.rotate, wall.translate, wall.prim, key, folders, wall.part, wall.tolerance
    return cavities(mesh, corners_in_file(*given))


def _point_inside(mesh: TriangleMesh) -> list[float]:
    """A point well inside a closed mesh [m], in few digits."""
    low, high = mesh.bounds
    space = FillRegion(low, high, np.eye(3), mesh, abs(mesh.volume))
    points = sample_points(space, SIDES)
    deepest = points[np.argmin(signed_distance(mesh, points)[0])]
    return [float(f"{x:.4g}") for x in deepest]
