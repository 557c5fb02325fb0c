"""Flow, bulk properties, mixing and grid fields against what they must be, and their columns and files in a run."""

import csv
import itertools
from dataclasses import replace

import numpy as np
import pytest

from warpdem import Scene, SceneError, Simulation
from warpdem.app.run import run_scene
from warpdem.measure.coarse_grain import Lattice, coarse_grained
from warpdem.measure.column import Readings
from warpdem.measure.contact_network import read_network
from warpdem.measure.measures import region_columns
from warpdem.measure.mixing import kinds, lacey_index
from warpdem.scene.file import scene_from_dict
from warpdem.scene.measures import Region

GRAIN = {"density": 2500.0, "young_modulus": 5e6, "poisson_ratio": 0.25}
MASS = 2500.0 * 4 / 3 * np.pi * 1e-9  # of a grain of 1 mm radius


def scene(positions, velocities=None, measures=None, **more):
    """Smooth grains of 1 mm radius without gravity."""
    grains = {"material": "g", "radius": 1e-3, "positions": positions}
    return Scene.model_validate(
        {
            "gravity": [0, 0, 0],
            "materials": {"g": GRAIN},
            "contact": {"tangential": "none"},
            "pairs": [{"materials": ["g", "g"], "restitution": 0.5}],
            "grains": [{**grains, **({} if velocities is None else {"velocities": velocities})}],
            "time": {"end": 0.05, "step": 1e-5, "max_speed": 1e-3},
            "output": {"formats": ["vtk"], "picture": False, "interval": 0.025},
            "measures": measures or {},
            **more,
        }
    )


def properties(sim, box):
    """Bulk properties in a box."""
    readings = Readings(sim.view)
    return [column.read(readings) for column in region_columns(Region(name="r", box=box))]


# --- flow ------------------------------------------------------------------------------------------------------------


def test_flow_counts_what_crosses_once_and_takes_back_what_returns():
    planes = [
        {"name": "all", "point": [0, 0, 0], "normal": [1, 0, 0]},
        {"name": "back", "point": [0, 0, 0], "normal": [-2, 0, 0]},
        {"name": "near", "point": [0, 0, 0], "normal": [1, 0, 0], "radius": 5e-3},
        {"name": "later", "point": [0.04, 0, 0], "normal": [1, 0, 0]},
    ]
    # two go forward (one beside the disk), one backward, one stops short of the plane
    places = [[-0.01, 0, 0], [-0.01, 0.01, 0], [0.01, 0.02, 0], [-0.05, 0.03, 0]]
    ways = [[1, 0, 0], [1, 0, 0], [-1, 0, 0], [0.5, 0, 0]]
    sim = Simulation(scene(places, ways, {"flow": planes}), device="cpu", threads=1)
    assert sim.budget.flow() == [0.0] * 8
    sim.run(until=0.03)
    found = np.array(sim.budget.flow()).reshape(-1, 2)
    assert found[:, 1].tolist() == [1, -1, 1, 0]
    np.testing.assert_allclose(found[:, 0], MASS * found[:, 1], rtol=1e-12)
    sim.run(until=0.06)
    assert np.array(sim.budget.flow())[1::2].tolist() == [1, -1, 1, 2]


@pytest.mark.parametrize(("fixed_to", "count"), [("laboratory", 0), ("frame", 3)])
def test_a_plane_stays_with_the_axes_that_it_is_fixed_to(fixed_to, count):
    # a grain that rests in the laboratory meets a disk of the turning frame once a turn
    plane = {"name": "p", "point": [0.01, 0, 0], "normal": [0, -1, 0], "radius": 4e-3, "fixed_to": fixed_to}
    turn = {"axis": [0, 0, 1], "rate": 100.0}
    made = scene([[0, 0.01, 0]], [[100.0 * 0.01, 0, 0]], {"flow": [plane]}, frame=turn)  # at rest in the laboratory
    sim = Simulation(made, device="cpu", threads=1)
    assert np.abs(sim.particles.velocity_lab).max() < 1e-12
    sim.run(until=0.19)
    assert abs(sim.budget.flow()[1]) == count


def test_a_disk_counts_by_where_the_way_of_the_step_meets_it():
    """Steps of 1 mm along x and y through a disk of 0.1 mm: one grain through its middle, the other 0.2 mm beside it."""
    disk = {"name": "disk", "point": [0, 0, 0], "normal": [1, 0, 0], "radius": 1e-4}
    disks = {"flow": [disk, {**disk, "name": "other", "point": [0, 0, 0.01]}]}
    made = scene([[-3.3e-3, -3.3e-3, 0], [-3.3e-3, -3.1e-3, 0.01]], [[100, 100, 0]] * 2, disks)
    sim = Simulation(made, device="cpu", threads=1)
    sim.step(6)
    assert sim.budget.flow()[1::2] == [1, 0]


def test_a_grain_at_rest_beside_a_plane_of_the_laboratory_does_not_cross_it_in_a_turning_frame():
    """5 um beside it; the frame carries places by 10 um a step."""
    plane = {"normal": [1, 0, 0], "fixed_to": "laboratory"}
    planes = [{**plane, "name": f"p{k}", "point": [x, 0, 0]} for k, x in enumerate((-5e-6, 5e-6))]
    turn = {"axis": [0, 0, 1], "rate": 100.0}
    sim = Simulation(scene([[0, 0.01, 0]], [[1.0, 0, 0]], {"flow": planes}, frame=turn), device="cpu", threads=1)
    sim.step(50)
    assert sim.budget.flow() == [0.0] * 4


# --- bulk ------------------------------------------------------------------------------------------------------------


def test_bulk_of_a_cloud_without_contacts_is_that_of_a_gas():
    rng = np.random.default_rng(3)
    cells = np.stack(np.meshgrid(*[np.arange(8)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    velocity = rng.normal([0.3, -0.2, 0.1], 0.05, (512, 3))
    sim = Simulation(scene((cells + 0.5) * 3e-3, velocity), device="cpu", threads=1)
    found = properties(sim, {"min": [0, 0, 0], "max": [0.024] * 3})
    mean = velocity.mean(axis=0)
    agitation = ((velocity - mean) ** 2).sum() / 3 / 512
    np.testing.assert_allclose(found[:7], [512, 512 * MASS, *mean, agitation, 0.0], rtol=1e-12)
    solid = 512 * 4 / 3 * np.pi * 1e-9 / 0.024**3
    assert found[7] == pytest.approx(solid)
    assert sum(found[8:11]) / 3 == pytest.approx(2500.0 * solid * agitation)
    # half of the box holds half of them, elsewhere there is nothing
    half = properties(sim, {"min": [0, 0, 0], "max": [0.012, 0.024, 0.024]})
    assert half[0] == 256
    empty = properties(sim, {"min": [1, 1, 1], "max": [2, 2, 2]})
    assert empty[:2] == [0, 0]
    assert np.isnan(empty[2:7]).all()
    assert empty[7:14] == [0.0] * 7
    assert np.isnan(empty[14:]).all()


def test_bulk_of_a_pressed_lattice_has_its_coordination_and_pressure():
    # a simple cubic lattice between periodic borders: 6 contacts each, pressure F / d^2 along each axis
    gap = 1.999e-3
    length = 5 * gap
    cells = np.stack(np.meshgrid(*[np.arange(5)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    borders = {axis: {"min": 0.0, "max": length, "kind": "periodic"} for axis in "xyz"}
    made = scene((cells + 0.3) * gap, borders=borders)
    sim = Simulation(made, device="cpu", threads=1)
    network = read_network(sim.view)
    found = properties(sim, {"min": [0, 0, 0], "max": [length] * 3})
    force = network.normal_force[0]
    assert found[6] == 6.0
    assert force > 0
    np.testing.assert_allclose(found[8:11], force / gap**2, rtol=1e-9)
    np.testing.assert_allclose(found[11:14], 0.0, rtol=0, atol=1e-9 * force / gap**2)
    # coarse graining says the same everywhere, as the lattice has no borders
    snapshot = replace(sim.snapshot(), contacts=network)
    fields = coarse_grained(snapshot, Lattice.across([0] * 3, [length] * 3, length / 4), 1.9 * gap, (length,) * 3)
    np.testing.assert_allclose(fields["contact_stress"][:, [0, 4, 8]], force / gap**2, rtol=0.03)
    np.testing.assert_allclose(fields["density"], 2500 * 4 / 3 * np.pi * 1e-9 / gap**3, rtol=0.03)


def virial(network):
    """Sum of forces times branch vectors [N m]."""
    return np.einsum("ij,ik->jk", network.force, network.start - network.end)


def contact_stress(sim, box):
    """Tensor of what a region tells, of grains at rest."""
    xx, yy, zz, xy, yz, zx = properties(sim, box)[8:14]
    return np.array([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]])


def test_stress_of_a_column_is_the_same_wherever_the_faces_are():
    """Four grains between plates, all pressed alike: F over the area, between any two heights within the plates."""
    gap, side = 1.999e-3, 4e-3
    planes = {"floor": ([0, 0, 0], [0, 0, 1]), "lid": ([0, 0, 4 * gap], [0, 0, -1])}
    walls = [
        {"name": name, "material": "g", "plane": {"point": point, "normal": normal}} for name, (point, normal) in planes.items()
    ]
    sim = Simulation(scene([[0, 0, (k + 0.5) * gap] for k in range(4)], walls=walls), device="cpu", threads=1)
    network = read_network(sim.view)
    assert len(network.i) == 5
    # plates press as sqrt(2) (d/2)^(3/2) where pairs do as d^(3/2): the outer halves of the column bear half the load
    of_plates, of_pairs = network.normal_force[network.wall >= 0], network.normal_force[network.wall < 0]
    np.testing.assert_allclose(of_pairs / of_plates[0], 2.0, rtol=1e-9)
    rng = np.random.default_rng(11)
    for _ in range(20):
        low, high = np.sort(rng.uniform(0.5 * gap, 3.5 * gap, 2))
        found = contact_stress(sim, {"min": [-side / 2, -side / 2, low], "max": [side / 2, side / 2, high]})
        assert found[2, 2] == pytest.approx(of_pairs[0] / side**2, rel=1e-10)  # of the overlaps' round-off
        np.testing.assert_allclose(np.delete(found.ravel(), 8), 0.0, rtol=0, atol=1e-12 * found[2, 2])
    # of the whole, and beyond it: the plates' branches are half as long
    whole = contact_stress(sim, {"min": [-side] * 3, "max": [side, side, 4 * gap + side]})
    np.testing.assert_allclose(whole * (2 * side) ** 2 * (4 * gap + 2 * side), virial(network), rtol=1e-12, atol=1e-18)


def test_stress_times_volume_adds_up_and_ends_at_the_virial():
    """A disordered, periodic, pressed packing: boxes that fill the domain, and boxes over its borders."""
    rng = np.random.default_rng(12)
    gap, count = 1.96e-3, 5
    length = count * gap
    cells = np.stack(np.meshgrid(*[np.arange(count)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    borders = {axis: {"min": 0.0, "max": length, "kind": "periodic"} for axis in "xyz"}
    made = scene((cells + 0.5) * gap + rng.uniform(-1.5e-5, 1.5e-5, (125, 3)), borders=borders)
    sim = Simulation(made, device="cpu", threads=1)
    total = virial(read_network(sim.view))
    total = 0.5 * (total + total.T)
    tolerance = {"rtol": 0, "atol": 1e-12 * np.abs(total).max()}
    shift = rng.uniform(-length, length, 3)
    places = [np.r_[0.0, np.sort(rng.uniform(0, 1, 2)), 1.0] * length + shift[k] for k in range(3)]
    added, solid, grains = np.zeros((3, 3)), 0.0, 0
    for i, j, k in itertools.product(range(3), repeat=3):
        low, high = ([places[0][i + o], places[1][j + o], places[2][k + o]] for o in (0, 1))
        volume = np.prod(np.subtract(high, low))
        box = {"min": low, "max": high}
        found = properties(sim, box)
        added += volume * contact_stress(sim, box)
        solid, grains = solid + volume * found[7], grains + found[0]
    np.testing.assert_allclose(added, total, **tolerance)
    assert grains == 125
    assert solid == pytest.approx(125 * 4 / 3 * np.pi * 1e-9, rel=1e-12)
    for longer in (0.0, 1e-3, 3 * length):
        whole = {"min": shift.tolist(), "max": (shift + length + longer).tolist()}
        np.testing.assert_allclose(contact_stress(sim, whole) * length**3, total, **tolerance)
        assert properties(sim, whole)[0] == 125


@pytest.mark.parametrize("shift", [0.0, 0.5, -7.0])
def test_solid_fraction_counts_the_parts_of_balls(shift):
    """Two and a half cells of a simple cubic lattice each way: faces halve balls, edges and corners cut them in 4 and 8."""
    gap, length = 2.5e-3, 12.5e-3
    cells = np.stack(np.meshgrid(*[np.arange(5)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    borders = {axis: {"min": 0.0, "max": length, "kind": "periodic"} for axis in "xyz"}
    sim = Simulation(scene((cells + 0.5) * gap, borders=borders), device="cpu", threads=1)
    found = properties(sim, {"min": [shift * gap] * 3, "max": [(shift + 2.5) * gap] * 3})
    assert found[7] == pytest.approx(4 / 3 * np.pi * 1e-9 / gap**3, rel=1e-12)


# --- mixing ----------------------------------------------------------------------------------------------------------


def test_lacey_index_is_zero_apart_and_one_by_chance():
    rng = np.random.default_rng(5)
    position = rng.uniform(0, 1, (20000, 3))
    apart = position[:, 0] < 0.5
    assert lacey_index(apart, position, 0.1) == pytest.approx(0.0, abs=1e-12)
    indices = [lacey_index(rng.permutation(apart), position, 0.1) for _ in range(20)]
    assert np.mean(indices) == pytest.approx(1.0, abs=2e-3)
    # half mixed: a share s of the grains dealt out anew leaves (1 - s)^2 of the variance
    dealt = np.where(rng.uniform(size=20000) < 0.5, rng.permutation(apart), apart)
    assert lacey_index(dealt, position, 0.1) == pytest.approx(1 - 0.25, abs=0.02)
    assert np.isnan(lacey_index(np.ones(10, bool), position[:10], 0.1))


def test_mixing_tells_two_kinds_by_what_is_asked_for():
    asked = [{"name": by, "by": by, "cell": 0.5} for by in ("x", "y", "z", "group", "size")]
    places = [[-0.01, 0, 0], [-0.02, 0, 0.01], [0.01, 0, 0.02], [0.02, 0, 0.03]]
    made = scene(places, measures={"mixing": asked})
    sim = Simulation(made, device="cpu", threads=1)
    assert kinds("x", sim.particles, sim.expected)[0].tolist() == [True, True, False, False]
    assert kinds("z", sim.particles, sim.expected)[0].tolist() == [True, True, False, False]
    assert kinds("group", sim.particles, sim.expected)[0].tolist() == [True] * 4
    values = sim.measure()
    assert values["mixing x [-]"] == 0.0  # cells end at the origin
    assert np.isnan(values["mixing group [-]"])


# --- grid ------------------------------------------------------------------------------------------------------------


def test_coarse_graining_keeps_mass_and_momentum():
    rng = np.random.default_rng(7)
    cells = np.stack(np.meshgrid(*[np.arange(5)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    velocity = rng.normal([0.5, 0.2, -0.1], 0.1, (125, 3))
    grid = {"box": {"min": [-6e-3] * 3, "max": [18e-3] * 3}, "cell": 1e-3, "width": 4e-3}
    sim = Simulation(scene((cells + 0.5) * 2.5e-3, velocity, {"grid": grid}), device="cpu", threads=1)
    fields = coarse_grained(sim.snapshot(), Lattice.across([-6e-3] * 3, [18e-3] * 3, 1e-3), 4e-3)
    volume = 1e-9
    assert fields["density"].sum() * volume == pytest.approx(125 * MASS, rel=1e-3)
    flow = (fields["density"][:, None] * fields["velocity"]).sum(axis=0) * volume
    np.testing.assert_allclose(flow, MASS * velocity.sum(axis=0), rtol=2e-3)
    np.testing.assert_allclose(fields["density"], 2500 * fields["solid_fraction"], rtol=1e-12)
    # fluctuation energy and mean flow energy make up the whole
    trace = fields["kinetic_stress"][:, [0, 4, 8]].sum(axis=1)
    whole = (trace + fields["density"] * (fields["velocity"] ** 2).sum(axis=1)).sum() * volume
    assert whole == pytest.approx(MASS * (velocity**2).sum(), rel=2e-3)
    assert not fields["contact_stress"].any()
    inside = fields["density"] > 0
    np.testing.assert_allclose(
        fields["granular_temperature"][inside], (trace / 3 / np.where(inside, fields["density"], 1))[inside], rtol=1e-12
    )


def test_stress_on_the_grid_is_exact_where_the_kernel_is_narrower_than_a_contact():
    """Two grains pressed together: on the line of centres all over its length, and in sum."""
    gap, width = 1.99e-3, 4e-4
    sim = Simulation(scene([[0, 0, 0], [gap, 0, 0]]), device="cpu", threads=1)
    network = read_network(sim.view)
    snapshot = replace(sim.snapshot(), contacts=network)
    x = np.linspace(width, gap - width, 14)
    line = Lattice(np.array([x[0], 0.0, 0.0]), (14, 1, 1), x[1] - x[0])
    found = coarse_grained(snapshot, line, width)["contact_stress"]
    # int phi along a diameter is 105/(16 pi w^3) 2 w (1 - 2 + 2 - 3/5)
    np.testing.assert_allclose(found[:, 0], network.normal_force[0] * 105.0 * 0.8 / (16 * np.pi * width**2), rtol=1e-12)
    np.testing.assert_allclose(found[:, 1:], 0.0, rtol=0, atol=1e-12 * found[0, 0])
    cell = 1e-4
    fine = Lattice.across([-5e-4] * 3, [gap + 5e-4, 5e-4, 5e-4], cell)
    sums = coarse_grained(snapshot, fine, width)["contact_stress"].sum(axis=0) * cell**3
    np.testing.assert_allclose(sums[0], virial(network)[0, 0], rtol=2e-3)
    # nothing more than w beside the line
    beside = Lattice(np.array([x[0], 1.01 * width, 0.0]), (14, 1, 1), x[1] - x[0])
    assert not coarse_grained(snapshot, beside, width)["contact_stress"].any()


# --- a run -----------------------------------------------------------------------------------------------------------


def test_a_run_writes_columns_and_grids_and_resumes_them(tmp_path):
    from vtkmodules.vtkIOXML import vtkXMLImageDataReader

    asked = {
        "flow": [{"name": "middle", "point": [0, 0, 0], "normal": [1, 0, 0]}],
        "regions": [{"name": "all"}],
        "mixing": [{"name": "halves", "by": "x", "cell": 5e-3}],
        "grid": {"box": {"min": [-0.03] * 3, "max": [0.03] * 3}, "cell": 5e-3},
    }
    made = scene([[-0.01, 0, 0], [0.02, 0.01, 0]], [[1, 0, 0], [0, 0, 0]], asked)
    run_scene(made, tmp_path, device="cpu", threads=1, quiet=True, until=0.025)
    sim = run_scene(made, tmp_path, device="cpu", threads=1, quiet=True, resume=True)
    with open(tmp_path / "history.csv", encoding="utf-8") as file:
        header, *rows = list(csv.reader(file))
    last = dict(zip(header, rows[-1], strict=True))
    assert len(set(header)) == len(header)
    assert float(last["flow middle count [-]"]) == 1.0
    assert float(last["region all grains [-]"]) == 2.0
    assert float(last["fields [J]"]) == 0.0
    for name, value in sim.measure().items():
        assert float(last[name]) == pytest.approx(value, nan_ok=True)
    index = (tmp_path / "grid.pvd").read_text()
    assert index.count("<DataSet") == 3
    reader = vtkXMLImageDataReader()
    reader.SetFileName(str(tmp_path / "grid_000002.vti"))
    reader.Update()
    data = reader.GetOutput()
    names = {data.GetPointData().GetArrayName(k) for k in range(data.GetPointData().GetNumberOfArrays())}
    assert {"density", "solid_fraction", "velocity", "kinetic_stress", "contact_stress", "granular_temperature"} == names
    assert data.GetDimensions() == (13, 13, 13)
    assert data.GetPointData().GetArray("density").GetRange()[1] > 0


def test_names_of_measures_must_differ():
    twice = {"regions": [{"name": "a"}, {"name": "a"}]}
    data = scene([[0, 0, 0]]).model_dump(mode="json")
    with pytest.raises(SceneError, match=r"(?s)measures.regions\[1\].name.*regions\[0\] has this name too"):
        scene_from_dict({**data, "measures": twice}, source="bad.toml")


def test_flow_is_refused_with_integrators_of_several_stages():
    data = scene([[0, 0, 0]], measures={"flow": [{"name": "p", "point": [0, 0, 0], "normal": [0, 0, 1]}]})
    data = {**data.model_dump(mode="json"), "engine": {"integrator": "rk4"}}
    with pytest.raises(SceneError, match=r'(?s)measures.flow.*"rk4", whose steps have stages'):
        scene_from_dict(data, source="bad.toml")
