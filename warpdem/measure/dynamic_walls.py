"""Columns of history.csv of walls that move by the load on them: where they are, how fast, and the load along their axis."""

from collections.abc import Callable

from warpdem.kernels.measure.readings import WALL_SUMS
from warpdem.measure.column import Column, Readings
from warpdem.measure.totals import Totals
from warpdem.measure.wall_loads import cross
from warpdem.model.dynamic_walls import DynamicWall
from warpdem.scene.walls import Wall


def columns(wall: Wall) -> list[Column]:
    """The columns of a wall; none of one that does not move by its load."""
    if wall.servo is None:
        return []
    turns = wall.servo.turns
    names = [("angle", "rad"), ("rate", "rad/s")] if turns else [("displacement", "m"), ("speed", "m/s")]
    of_state = [Column(f"{wall.name} {name}", unit, _state(wall.name, key)) for (name, unit), key in zip(
        names, ("position", "predicted"), strict=True
    )]  # fmt: skip
    load = Column(f"{wall.name} load", "N m" if turns else "N", lambda r: axial_load(r.totals, wall.name))
    if wall.servo.pressure is None:
        return [*of_state, load]
    return [*of_state, load, Column(f"{wall.name} pressure", "Pa", lambda r: pressure(r.totals, wall.name))]


def dynamic_wall(now: Totals, name: str) -> DynamicWall:
    """The wall of that name."""
    return next(one for one in now.view.model.schedule.dynamic if one.wall.name == name)


def axial_load(now: Totals, name: str) -> float:
    """What a wall does to the grains along the axis of its servo, or about it [N or N m]."""
    one = dynamic_wall(now, name)
    body, sums = now.bodies[one.number], now.walls[one.number]
    turn = body[:9].reshape(3, 3)
    along = turn @ one.servo.axis
    force, moment, rolling = (sums[WALL_SUMS.of(key)] for key in ("force", "moment", "torque"))
    if not one.servo.turns:
        return float(force @ along)
    about = turn @ one.servo.origin + body[9:12]
    return float((moment - cross(about, force) + rolling) @ along)


def pressure(now: Totals, name: str) -> float:
    """Load along the axis over the area of the servo [Pa]."""
    return axial_load(now, name) / dynamic_wall(now, name).area


def _state(wall: str, key: str) -> Callable[[Readings], float]:
    return lambda readings: dynamic_wall(readings.totals, wall).value(key)
