"""What a scene needs of the machine: memory for its grains, frames and grids, and numbers that a float64 can compute with.

All of it is looked at before it is taken or computed, so that a number typed in another unit ends in words.
"""

import math

import numpy as np
import warp as wp

from warpdem.core import memory
from warpdem.errors import SceneError
from warpdem.filling.initial_grains import InitialGrains
from warpdem.filling.stream_grains import expected_count
from warpdem.model.time_step import Limits
from warpdem.scene.measures import Grid
from warpdem.scene.model import Scene

FRAME_BYTES = 220
"""Memory per grain of a frame while it is written [B]; measured with 373 000 grains."""
GRID_BYTES = 400
"""Memory that the fields on a grid take at least per point [B]: sums, stresses and what is written."""
WIDEST_KERNEL = 50.0
"""Largest radius of the averaging kernel of a grid, in cells [-]: each grain adds to as many points as lie within."""
MOST_STEPS = 2**53
"""Steps of a run: beyond, a float64 does not tell one step number from the next."""
FINEST = 1e-4
"""Largest distance between two neighbouring float64 at a grain's place, in its radii [-]: contacts are some 1e-3 deep."""
FARTHEST = 2.0**31
"""Largest distance from the origin in radii of the smallest grain [-]: the cells of the lists have 32-bit numbers."""
SINGLE = np.finfo(np.float32)
"""Results are in single precision."""


def check_grid(scene: Scene) -> None:
    """Refuse a grid that the memory cannot hold.

    Raises:
        SceneError: there are too many points, or the averaging kernel spans too many of them.
    """
    grid = scene.measures.grid
    if grid is None:
        return
    key, cell = f"{scene.source}: measures.grid", grid.cell
    if grid.width is not None and grid.width > WIDEST_KERNEL * cell:
        raise SceneError(
            f"{key}.width = {grid.width:g} m: is {grid.width / cell:.3g} cells; at most {WIDEST_KERNEL:g} are computed, with "
            f"cell = {cell:g} m up to {WIDEST_KERNEL * cell:g} m: take a larger cell"
        )
    memory.require(grid_bytes(scene), f"{key}.cell = {cell:g} m", f"a grid of {_points(grid):.3g} points", "take a larger cell")


def _points(grid: Grid) -> int:
    """Points of a grid."""
    return math.prod(math.ceil((high - low) / grid.cell) + 1 for low, high in zip(grid.box.min, grid.box.max, strict=True))


def grid_bytes(scene: Scene) -> int:
    """Memory that the fields on the scene's grid take while they are written [B]; 0 without a grid."""
    return 0 if scene.measures.grid is None else GRID_BYTES * _points(scene.measures.grid)


def grains_to_come(scene: Scene) -> list[int]:
    """How many grains each stream of a scene brings at most up to ``time.end``, none of them taken out again."""
    return [expected_count(scene, stream, scene.time.end) for stream in scene.streams]


def memory_bytes(scene: Scene, bytes_per_grain: int, grains: int) -> int:
    """Memory that a run needs in all [B]: so many grains, a frame of them, and the grid."""
    return (bytes_per_grain + FRAME_BYTES) * grains + grid_bytes(scene)


def free_bytes(device: wp.Device) -> int:
    """Memory that is free for the grains on a Warp device [B]."""
    return memory.available() if device.is_cpu else int(device.free_memory)


def check_memory(scene: Scene, bytes_per_grain: int, grains: int, free: int) -> None:
    """Refuse more grains than the device holds.

    Args:
        scene: validated scene.
        bytes_per_grain: memory of a grain, its contacts and places [B].
        grains: how many there are at the start.
        free: memory that was free before any of them [B].

    Raises:
        SceneError: they need more.
    """
    needed = bytes_per_grain * grains
    if needed > free:
        raise SceneError(
            f"{scene.source}: grains: {grains} grains need {memory.size_text(needed)} of memory, {bytes_per_grain} B each, and "
            f"{memory.size_text(free)} are available: take fewer or larger grains"
        )


def check_places(scene: Scene, grains: InitialGrains) -> None:
    """Refuse grains so small, or so far away, that a float64 cannot tell how deep they touch.

    Raises:
        SceneError: names the grain, its place and its radius.
    """
    if not len(grains.radius):
        return
    far = np.abs(grains.position).max(axis=1)
    ratio = np.maximum(np.spacing(far) / (FINEST * grains.radius), far / (FARTHEST * grains.radius.min()))
    i = int(np.argmax(ratio))
    if ratio[i] > 1.0:
        most = min(FARTHEST * grains.radius.min(), FINEST * grains.radius[i] / np.finfo(float).eps)
        raise SceneError(
            f"{scene.source}: {entry_of(scene, grains, i)} of radius {grains.radius[i]:g} m is {far[i]:.6g} m from the origin, "
            f"where numbers are too coarse for its contacts; allowed is up to {most:.3g} m: put the origin near the grains, or "
            "check the units"
        )


def check_masses(scene: Scene, grains: InitialGrains) -> None:
    """Refuse grains whose mass or moment of inertia cannot be computed with or written.

    Raises:
        SceneError: names the grain and the keys that make its mass.
    """
    density = np.array([material.density for material in scene.materials.values()])[grains.type]
    with np.errstate(all="ignore"):
        mass = density * (4.0 / 3.0) * np.pi * grains.radius**3
        inertia = 0.4 * mass * grains.radius**2
        good = (mass >= SINGLE.tiny) & (mass <= SINGLE.max) & (inertia >= 1e-150) & (inertia <= 1e150)
    if not good.all():
        i = int(np.argmin(good))
        raise SceneError(
            f"{scene.source}: {entry_of(scene, grains, i)}: a radius of {grains.radius[i]:g} m and materials."
            f"{list(scene.materials)[grains.type[i]]}.density = {density[i]:g} kg/m3 make a mass of {mass[i]:.3g} kg; it "
            f"must be from {SINGLE.tiny:.3g} to {SINGLE.max:.3g} kg, which results can hold: check the units of both"
        )


def check_step(scene: Scene, found: Limits, step: float) -> None:
    """Refuse a time step that is no number to compute with, and a run of more steps than can be counted.

    Raises:
        SceneError: says which limit, or how many steps.
    """
    times = {name: value for name, value in found.candidates.items() if not value > 1e-150}
    if times:
        name, value = next(iter(times.items()))
        raise SceneError(
            f"{scene.source}: time.step: {name} is {value:g} s, which is no time to compute with: check the units of the "
            "materials, of the grains' sizes and of time.max_speed"
        )
    if not found.max_speed <= 1e75:
        raise SceneError(
            f"{scene.source}: time.max_speed: grains and walls are expected to reach {found.max_speed:g} m/s, whose square is "
            "no number to compute with: check the units of velocities, of gravity and of the rates of frame and walls"
        )
    if scene.time.end / step > MOST_STEPS:
        raise SceneError(
            f"{scene.source}: time.end = {scene.time.end:g} s is {scene.time.end / step:.3g} steps of {step:.3g} s; at most "
            f"{MOST_STEPS:.3g} can be counted: take an earlier end, or check the units"
        )


def entry_of(scene: Scene, grains: InitialGrains, i: int) -> str:
    """The entry of the scene that brings grain ``i``, with its id if it has one."""
    if grains.id[i] < 0:
        return "streams"
    name = scene.groups[grains.group[i]]
    number = next((k for k, group in enumerate(scene.group_names[: len(scene.grains)]) if group == name), None)
    return f"grain {grains.id[i]}" if number is None else f"grains[{number}]: grain {grains.id[i]}"
