"""Warnings about walls: openings that grains fall out of, vessels that hold none, walls too light for their load."""

import math
from collections.abc import Iterator

import numpy as np

from warpdem.engine.open_below import walls_open_below
from warpdem.filling.placed_walls import in_body_axes
from warpdem.guards.light_walls import light_walls
from warpdem.scene.messages import rounded_down
from warpdem.scene.model import Scene
from warpdem.scene.motion_chain import frame_chain
from warpdem.simulation import Simulation


def light(sim: Simulation) -> Iterator[str]:
    """Free walls that are too light for the grains that may lie on them, at this time step."""
    for number, grains, ratio, step in light_walls(sim.scene, sim.schedule.dynamic, sim.expected, sim.meshes, sim.dt):
        yield (
            f"walls[{number}].free: the wall has {ratio:.2g} of the mass (of a hinge: of the moment of inertia) of the "
            f"{grains} grains that may lie on it; with all of them at once under its load it chatters at time.step = "
            f"{sim.dt:.3g} s: take at most {rounded_down(step)} s, or a heavier wall"
        )


def pulling_servos(scene: Scene) -> Iterator[str]:
    """Servos that pull their wall away from the grains."""
    for number, wall in enumerate(scene.walls):
        course = wall.servo.pressure if wall.servo is not None else None
        least = min((value for _, value in course), default=0.0) if isinstance(course, list) else course or 0.0
        if least < 0.0:
            yield (
                f"walls[{number}].servo.pressure = {least:g} Pa: the wall pulls against its axis, away from grains that lie "
                "along it; give a pressure above 0 and an axis that points from the wall to the grains"
            )


def outside(sim: Simulation) -> Iterator[str]:
    """Grains all beside the closed meshes that are the only walls: one of these is likely to be meant as their vessel.

    Not where a grain is amid the corners of a mesh, as in a cup of solid walls, or falls or flies towards one.
    """
    scene, start = sim.scene, sim.expected
    if sim.model.given.scene.start or not len(start) or not scene.walls or scene.borders:
        return
    if any(wall.mesh is None or wall.open for wall in scene.walls):
        return
    gravity = np.asarray(scene.gravity, float) @ frame_chain(scene).pose(np.zeros(1)).axes[0].astype(float)
    for number, wall in enumerate(scene.walls):
        at = in_body_axes(scene, number, start.position)
        for direction in (gravity, start.velocity):
            ahead = in_body_axes(scene, number, start.position + direction) - at
            if _meets(sim.meshes[wall.name].bounds, at, ahead).any():
                return
    bodies = " and ".join(f"{wall.name!r} (from {_extent(sim.meshes[wall.name].bounds)})" for wall in scene.walls)
    yield (
        f"all {len(start)} grains, from {_extent(start.position)}, are outside the closed mesh {bodies}; they do not fall on "
        "it, and no other wall is there: if it is their vessel, check its scale, rotate and translate, and the positions of "
        "the grains"
    )


def _extent(points: np.ndarray) -> str:
    """Text of the least and the greatest corner of points (n, 3) [m]."""
    corners = points.min(axis=0), points.max(axis=0)
    return " to ".join(f"({', '.join(f'{x:.4g}' for x in corner)})" for corner in corners) + " m"


def _meets(box: np.ndarray, point: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Whether a box (2, 3) [m] holds each point (n, 3) [m] or lies ahead of it along ``direction`` (n, 3), shape (n,)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        sides = (box[:, None] - point) / direction
    entered, left = np.maximum(sides.min(axis=0).max(axis=1), 0.0), sides.max(axis=0).min(axis=1)
    found: np.ndarray = (entered <= left) & (entered < np.inf)
    return found


def open_meshes(sim: Simulation) -> Iterator[str]:
    """Meshes with a border that is wide enough for a grain."""
    radius = sim.expected.radius
    for number, wall in enumerate(sim.scene.walls):
        mesh = sim.meshes.get(wall.name)
        if mesh is None or not mesh.open_edges or not len(radius):
            continue
        edges = np.sort(mesh.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        kinds, count = np.unique(edges, axis=0, return_counts=True)
        start, stop = mesh.vertices[kinds[count == 1].T]
        border = float(np.linalg.norm(stop - start, axis=1).sum())
        smallest = 2.0 * float(radius.min())
        if smallest < border / math.pi and not (sim.scene.borders or sim.scene.outlets):
            yield (
                f"walls[{number}].mesh = {wall.mesh!r} is open along {border:.3g} m ({mesh.open_edges} edges), wide enough for "
                f"a grain of {smallest:.3g} m: grains that leave fall without end; close the mesh, or add "
                "[borders] or [[outlets]]"
            )


def openings_below(sim: Simulation) -> Iterator[str]:
    """Openings below the grains that walls leave together."""
    radius, scene = sim.expected.radius, sim.scene
    if not len(radius) or scene.borders or scene.outlets:
        return
    smallest = 2.0 * float(radius.min())
    if names := walls_open_below(scene, smallest):
        yield (
            f"walls {', '.join(repr(name) for name in names)} leave an opening below for a grain of {smallest:.3g} m: "
            "grains that leave fall without end; close it with a floor, or add [borders] or [[outlets]]"
        )
