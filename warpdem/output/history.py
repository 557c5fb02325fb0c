"""history.csv: its columns, each declared once with name, unit and how it is read, and the numbers of a row.

A new column is an entry of ``GENERAL``, or of ``WALL`` for one per wall. What a scene's ``measures`` and ``observers`` ask for
follows: ``warpdem.measure.measures`` and ``warpdem.measure.observation`` declare those columns, and
``warpdem.measure.dynamic_walls`` those of walls that move by the load on them. What outlets have removed comes last.
"""

from collections.abc import Callable, Sequence

from warpdem.core.snapshot import WallLoad
from warpdem.measure import dynamic_walls, measures, observation
from warpdem.measure.column import Column, Readings
from warpdem.scene.model import Scene

GENERAL = (
    Column("time", "s", lambda r: r.view.clock.time),
    Column("frame_angle", "rad", lambda r: r.totals.pose.angle),
    Column("grains", "-", lambda r: r.totals.count),
    Column("kinetic", "J", lambda r: r.energy["kinetic"]),
    Column("rotational", "J", lambda r: r.energy["rotational"]),
    Column("elastic", "J", lambda r: r.energy["elastic"]),
    Column("potential", "J", lambda r: r.energy["potential"]),
    Column("fields", "J", lambda r: r.energy.get("fields", 0.0)),
    Column("centre_x", "m", lambda r: r.center_of_mass[0]),
    Column("centre_y", "m", lambda r: r.center_of_mass[1]),
    Column("centre_z", "m", lambda r: r.center_of_mass[2]),
    Column("largest_overlap", "-", lambda r: max(r.extremes["pair_overlap_share"], r.extremes["wall_overlap_share"])),
    Column(
        "largest_approach_speed",
        "m/s",
        lambda r: max(r.extremes["pair_approach_speed"], r.extremes["wall_approach_speed"]),
    ),
)
"""Columns of every scene; the first one orders the rows."""
WALL: tuple[tuple[str, str, Callable[[WallLoad], float]], ...] = (
    ("force x", "N", lambda load: load.force[0]),
    ("force y", "N", lambda load: load.force[1]),
    ("force z", "N", lambda load: load.force[2]),
    ("torque x", "N m", lambda load: load.torque[0]),
    ("torque y", "N m", lambda load: load.torque[1]),
    ("torque z", "N m", lambda load: load.torque[2]),
    ("power", "W", lambda load: load.power),
)
"""Name, unit and reading of the columns of each wall; vectors in laboratory axes."""


def history_columns(scene: Scene) -> list[Column]:
    """All columns of a scene: those of every scene, of its walls, measures, observers and outlets."""
    walls = [column for wall in scene.walls for column in _wall_columns(wall.name)]
    walls += [column for wall in scene.walls for column in dynamic_walls.columns(wall)]
    outlets = [column for outlet in scene.outlets for column in _outlet_columns(outlet.name)]
    return [*GENERAL, *walls, *measures.columns(scene), *observation.columns(scene), *outlets]


def reads_grains(columns: Sequence[Column]) -> bool:
    """Whether columns read more of a run than sums over its grains, contacts and walls, and what outlets took."""
    return any(column.whole for column in columns)


def history_row(columns: Sequence[Column], readings: Readings) -> list[float]:
    """One row: the number of each column at the time of the readings."""
    return [column.read(readings) for column in columns]


def _wall_columns(wall: str) -> list[Column]:
    def of_load(read: Callable[[WallLoad], float]) -> Callable[[Readings], float]:
        return lambda readings: read(readings.wall_loads[wall])

    return [Column(f"{wall} {name}", unit, of_load(read)) for name, unit, read in WALL]


def _outlet_columns(outlet: str) -> list[Column]:
    """What the outlet of this name has removed so far."""
    return [
        Column(f"outlet {outlet} mass", "kg", lambda r: float(r.view.left[outlet][1])),
        Column(f"outlet {outlet} count", "-", lambda r: float(r.view.left[outlet][0])),
    ]
