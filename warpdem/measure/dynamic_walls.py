"""Columns of history.csv of walls that move by the load on them: where they are, how fast, and the load along their axis."""

from collections.abc import Callable

import numpy as np

from warpdem.kernels.measure.readings import WALL_SUMS
from warpdem.measure.column import Column, Readings
from warpdem.measure.totals import Totals
from warpdem.measure.wall_loads import cross
from warpdem.model import free_bodies
from warpdem.model.dynamic_walls import DynamicWall
from warpdem.scene.free import FreeBody
from warpdem.scene.servo import Servo
from warpdem.scene.walls import Wall


def columns(wall: Wall) -> list[Column]:
    """The columns of a wall; none of one that does not move by its load."""
    if wall.dynamic is None:
        return []
    if isinstance(wall.free, FreeBody):
        return _body_columns(wall.name)
    turns = wall.dynamic.rotates
    names = [("angle", "rad"), ("rate", "rad/s")] if turns else [("displacement", "m"), ("speed", "m/s")]
    of_state = [Column(f"{wall.name} {name}", unit, _state(wall.name, key)) for (name, unit), key in zip(
        names, ("position", "predicted"), strict=True
    )]  # fmt: skip
    load = Column(f"{wall.name} load", "N m" if turns else "N", lambda r: axial_load(r.totals, wall.name))
    if wall.free is not None:
        return [*of_state, load, *(Column(f"{wall.name} {name}", "J", _energy(wall.name, name)) for name in ENERGIES)]
    if wall.servo is None or wall.servo.pressure is None:
        return [*of_state, load]
    return [*of_state, load, Column(f"{wall.name} pressure", "Pa", lambda r: pressure(r.totals, wall.name))]


ENERGIES = ("kinetic", "spring", "gravity", "driven", "lost")
"""Energies of a free wall [J]: of its motion, spring and weight; given by force, torque and motor; lost in damper and stops."""


def energies(now: Totals, name: str) -> dict[str, float]:
    """``ENERGIES`` of a free wall, in the laboratory; that of its weight is 0 where its center is in the origin."""
    one, pose = dynamic_wall(now, name), now.pose
    given, state = one.given, one.value
    body = now.bodies[one.number]
    center = pose.to_laboratory((body[:9].reshape(3, 3) @ one.center + body[9:12])[None])[0]
    gravity = -one.mass * float(center @ np.array(now.view.model.scene.gravity))
    if isinstance(given, FreeBody):
        return {**free_bodies.energies(one), "gravity": gravity}
    assert not isinstance(given, Servo)
    return {
        "kinetic": 0.5 * one.inertia * state("predicted") ** 2,
        "spring": 0.5 * given.stiffness * (state("position") - given.rest) ** 2,
        "gravity": gravity,
        "driven": state("driven"),
        "lost": state("lost"),
    }


def _body_columns(name: str) -> list[Column]:
    """Center, its velocity and the spin of a body in the laboratory, and its energies."""
    units = {"center": "m", "velocity": "m/s", "spin": "rad/s"}
    found = [
        Column(f"{name} {what} {axis}", unit, _vector(name, what, k))
        for what, unit in units.items() for k, axis in enumerate("xyz")
    ]  # fmt: skip
    return [*found, *(Column(f"{name} {energy}", "J", _energy(name, energy)) for energy in ENERGIES)]


def body_motion(now: Totals, name: str) -> dict[str, np.ndarray]:
    """Center [m], its velocity [m/s] and the spin [rad/s] of a free wall in the laboratory, shapes (3,)."""
    one, pose = dynamic_wall(now, name), now.pose
    body = now.bodies[one.number]
    center = body[:9].reshape(3, 3) @ one.center + body[9:12]
    velocity = body[15:18] + cross(body[12:15], center)
    return {
        "center": pose.to_laboratory(center[None])[0], "velocity": pose.rotation @ velocity, "spin": pose.rotation @ body[12:15]
    }  # fmt: skip


def _vector(wall: str, what: str, axis: int) -> Callable[[Readings], float]:
    return lambda readings: float(body_motion(readings.totals, wall)[what][axis])


def dynamic_wall(now: Totals, name: str) -> DynamicWall:
    """The wall of that name."""
    return next(one for one in now.view.model.schedule.dynamic if one.wall.name == name)


def axial_load(now: Totals, name: str) -> float:
    """What a wall does to the grains along its axis, or about it [N or N m]."""
    one = dynamic_wall(now, name)
    body, sums = now.bodies[one.number], now.walls[one.number]
    axes = body[:9].reshape(3, 3)
    along = axes @ one.given.axis
    force, moment, rolling = (sums[WALL_SUMS.of(key)] for key in ("force", "moment", "torque"))
    if not one.given.rotates:
        return float(force @ along)
    about = axes @ one.given.origin + body[9:12]
    return float((moment - cross(about, force) + rolling) @ along)


def pressure(now: Totals, name: str) -> float:
    """Load along the axis over the area of the servo [Pa]."""
    return axial_load(now, name) / dynamic_wall(now, name).area


def _energy(wall: str, name: str) -> Callable[[Readings], float]:
    return lambda readings: energies(readings.totals, wall)[name]


def _state(wall: str, key: str) -> Callable[[Readings], float]:
    return lambda readings: dynamic_wall(readings.totals, wall).value(key)
