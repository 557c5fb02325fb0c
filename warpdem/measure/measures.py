"""The columns of history.csv that a scene's ``measures`` ask for."""

from collections.abc import Callable

import numpy as np

from warpdem.kernels.contact import columns as laws
from warpdem.kernels.measure.budget import MOMENTA
from warpdem.measure.budget import VECTORS
from warpdem.measure.bulk import Bulk, has_share
from warpdem.measure.column import Column, Readings
from warpdem.measure.mixing import kinds, lacey_index
from warpdem.measure.residence import residence_times
from warpdem.measure.selection import selected
from warpdem.scene.measures import FlowPlane, Mixing, Region, Residence
from warpdem.scene.model import Scene
from warpdem.scene.models import model
from warpdem.scene.motion_chain import frame_chain
from warpdem.state.view import RunView

ENERGY = (
    "elastic_normal", "elastic_tangential", "elastic_rolling", "dissipated_normal_damping", "dissipated_tangential_damping",
    "dissipated_sliding", "dissipated_rolling", "dissipated_rescaling", "work_walls", "work_fields", "carried_in",
    "integration_error",
)  # fmt: skip
"""Terms of ``Budget.energy`` that every scene has; the LOSSES of the normal law follow."""

REGION: tuple[tuple[str, str, Callable[[Bulk], float]], ...] = (
    ("grains", "-", lambda b: b.grains),
    ("mass", "kg", lambda b: b.mass),
    ("velocity_x", "m/s", lambda b: b.velocity[0]),
    ("velocity_y", "m/s", lambda b: b.velocity[1]),
    ("velocity_z", "m/s", lambda b: b.velocity[2]),
    ("granular_temperature", "m2/s2", lambda b: b.granular_temperature),
    ("coordination", "-", lambda b: b.coordination),
)
"""Name, unit and reading of what every region has."""
SHARED: tuple[tuple[str, str, Callable[[Bulk], float]], ...] = (
    ("solid_fraction", "-", lambda b: b.solid_fraction),
    ("stress_xx", "Pa", lambda b: b.stress[0, 0]),
    ("stress_yy", "Pa", lambda b: b.stress[1, 1]),
    ("stress_zz", "Pa", lambda b: b.stress[2, 2]),
    ("stress_xy", "Pa", lambda b: b.stress[0, 1]),
    ("stress_yz", "Pa", lambda b: b.stress[1, 2]),
    ("stress_zx", "Pa", lambda b: b.stress[2, 0]),
)
"""Name, unit and reading of what a box, a sphere and a cylinder with ends have beside these."""
PLACE: tuple[tuple[str, str, Callable[[Bulk], float]], ...] = (
    ("centre_x", "m", lambda b: b.centre[0]),
    ("centre_y", "m", lambda b: b.centre[1]),
    ("centre_z", "m", lambda b: b.centre[2]),
    ("speed", "m/s", lambda b: b.speed),
)
"""The same of every region, after the others."""
FABRIC: tuple[tuple[str, str, Callable[[Bulk], float]], ...] = (
    ("fabric_xx", "-", lambda b: b.fabric[0, 0]),
    ("fabric_yy", "-", lambda b: b.fabric[1, 1]),
    ("fabric_zz", "-", lambda b: b.fabric[2, 2]),
    ("fabric_xy", "-", lambda b: b.fabric[0, 1]),
    ("fabric_yz", "-", lambda b: b.fabric[1, 2]),
    ("fabric_zx", "-", lambda b: b.fabric[2, 0]),
)
"""What a region with ``fabric`` has beside these."""
SOLID = 1
"""Of ``SHARED``, what a selection has too: a stress is that of all grains."""


def columns(scene: Scene) -> list[Column]:
    """The columns of all measures of a scene, in the order of history.csv."""
    asked = scene.measures
    found = _energy(scene) if asked.energy else []
    found += _momentum() if asked.momentum else []
    found += [column for number, plane in enumerate(asked.flow) for column in _flow(plane, number)]
    found += [column for region in asked.all_regions for column in region_columns(region)]
    found += [column for one in asked.residence for column in _residence(one)]
    found += _wear(scene)
    found += _liquid() if scene.contact.liquid != "none" else []
    return found + [_mixing(one) for one in asked.mixing]


def measured(view: RunView) -> dict[str, float]:
    """All measures of the scene at the time of the view, by the headers of their columns."""
    readings = Readings(view)
    return {column.header: column.read(readings) for column in columns(view.model.scene)}


def _energy(scene: Scene) -> list[Column]:
    """The energy budget; the integral of Jacobi where the frame moves, and the work of each wall."""
    losses = [f"dissipated_{name}" for name in laws.losses(model("normal", scene.normal_law))]
    names = [*ENERGY, *losses, *(["jacobi"] if frame_chain(scene).moves else [])]
    return [Column(name, "J", _energy_term(name)) for name in (*names, *(f"{wall.name} work" for wall in scene.walls))]


def _energy_term(name: str) -> Callable[[Readings], float]:
    """Reads a term of the energy budget [J]."""
    return lambda readings: float(readings.energy_budget[name])


def _momentum() -> list[Column]:
    """The budgets of momentum and angular momentum, all six components of one term after the other."""
    names = [f"{vector} {term}".strip() for term in ("", *MOMENTA, "error") for vector in VECTORS]
    return [Column(name, "N m s" if name.startswith("angular") else "N s", _momentum_term(name)) for name in names]


def _momentum_term(name: str) -> Callable[[Readings], float]:
    """Reads a term of the budgets of momentum [N s] and angular momentum [N m s]."""
    return lambda readings: float(readings.momentum_budget[name])


def _flow(plane: FlowPlane, number: int) -> list[Column]:
    """What went through the plane of that number so far."""
    return [
        Column(f"flow {plane.name} mass", "kg", lambda r: float(r.flow[2 * number])),
        Column(f"flow {plane.name} count", "-", lambda r: float(r.flow[2 * number + 1])),
    ]


def region_columns(region: Region) -> list[Column]:
    """Bulk properties of a region."""
    shared = () if not has_share(region) else SHARED if region.of is None else SHARED[:SOLID]
    return [
        Column(f"region {region.name} {name}", unit, _in_region(region, read), whole=True)
        for name, unit, read in (*REGION, *shared, *PLACE, *(FABRIC if region.fabric else ()))
    ]


def _in_region(region: Region, read: Callable[[Bulk], float]) -> Callable[[Readings], float]:
    """Reads a bulk property of a region."""
    return lambda readings: float(read(readings.bulk(region)))


def _residence(asked: Residence) -> list[Column]:
    """Number, mean and standard deviation of the residence times so far; nan without any."""

    def times(readings: Readings) -> np.ndarray:
        return residence_times(asked, readings.view.model, readings.departed)

    def reduced(reduce: Callable[[np.ndarray], np.floating]) -> Callable[[Readings], float]:
        return lambda readings: float(reduce(found)) if len(found := times(readings)) else float("nan")

    return [
        Column(f"residence {asked.name} grains", "-", lambda readings: float(len(times(readings)))),
        Column(f"residence {asked.name} mean", "s", reduced(np.mean)),
        Column(f"residence {asked.name} deviation", "s", reduced(np.std)),
    ]


def _wear(scene: Scene) -> list[Column]:
    """Totals of what wears each wall."""
    asked = scene.measures.wear
    if asked is None:
        return []
    names = [("normal_impulse", "N s"), ("shear_work", "J"), ("impact_work", "J")]
    names += [("archard_volume", "m3")] if asked.archard else []
    names += [("finnie_volume", "m3")] if asked.finnie else []
    return [Column(f"{wall.name} {name}", unit, _worn(wall.name, name)) for wall in scene.walls for name, unit in names]


def _worn(wall: str, name: str) -> Callable[[Readings], float]:
    """Reads the total of a wall."""
    return lambda readings: float(np.sum(getattr(readings.wear[wall], name)))


def _liquid() -> list[Column]:
    """Where the liquid is."""

    def volume(name: str) -> Callable[[Readings], float]:
        return lambda readings: readings.totals.liquid.volume(name)

    names = {"films": "films", "bridges": "bridges", "from walls": "from_walls", "left": "left", "brought": "brought"}
    found = [Column(f"liquid {said}", "m3", volume(name)) for said, name in names.items()]
    return [*found, Column("liquid bridge_count", "-", lambda readings: float(readings.totals.liquid.bridge_count))]


def _mixing(asked: Mixing) -> Column:
    """Lacey's index of two kinds of grains."""

    def index(readings: Readings) -> float:
        if asked.by is None:
            first = selected(asked.first, readings.view.model.scene, readings.particles)
            return float(lacey_index(first, readings.particles.position, asked.cell))
        first, known = kinds(asked.by, readings.particles, readings.view.model.expected)
        return float(lacey_index(first[known], readings.particles.position[known], asked.cell))

    return Column(f"mixing {asked.name}", "-", index, whole=True)
