"""What a scene's ``measures`` put into history.csv: names and units of the columns, and the numbers of one instant."""

from warpdem.kernels.measure.budget import MOMENTA
from warpdem.measure import bulk
from warpdem.measure.budget import VECTORS
from warpdem.measure.contact_network import read_network
from warpdem.measure.mixing import kinds, lacey_index
from warpdem.scene.motion_chain import frame_chain

ENERGY = (
    "elastic_normal", "elastic_tangential", "elastic_rolling", "dissipated_normal_damping", "dissipated_tangential_damping",
    "dissipated_sliding", "dissipated_rolling", "dissipated_rescaling", "work_walls", "work_fields", "carried_in",
    "integration_error",
)  # fmt: skip


def columns(scene) -> list[str]:
    """Header of the measures, in the order of ``values``."""
    asked = scene.measures
    names = []
    if asked.energy:
        frame = ["jacobi"] if frame_chain(scene).moves else []
        names += [f"{name} [J]" for name in (*ENERGY, *frame, *(f"{wall.name} work" for wall in scene.walls))]
    if asked.momentum:
        terms = ("", *MOMENTA, "error")
        names += [f"{vector} {term}".strip() + _unit(vector) for term in terms for vector in VECTORS]
    names += [f"flow {plane.name} {what}" for plane in asked.flow for what in ("mass [kg]", "count [-]")]
    names += [f"region {name}" for region in asked.regions for name in bulk.columns(region)]
    return names + [f"mixing {one.name} [-]" for one in asked.mixing]


def values(sim) -> list[float]:
    """What stands below ``columns`` at the present time of ``sim``."""
    asked, out = sim.scene.measures, []
    if asked.energy:
        out += sim.budget.energy().values()
    if asked.momentum:
        out += sim.budget.momentum().values()
    if asked.flow:
        out += sim.budget.flow()
    if asked.regions:
        network = read_network(sim)
        out += [number for region in asked.regions for number in bulk.bulk(region, sim.particles, network, sim.domain.period)]
    for one in asked.mixing:
        first, known = kinds(one.by, sim)
        out.append(lacey_index(first[known], sim.particles.position[known], one.cell))
    return [float(number) for number in out]


def measured(sim) -> dict[str, float]:
    """All measures of the scene at the present time, by the names of their columns."""
    return dict(zip(columns(sim.scene), values(sim), strict=True))


def _unit(vector: str) -> str:
    return " [N m s]" if vector.startswith("angular") else " [N s]"
