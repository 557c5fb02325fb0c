"""Loads on walls against contacts, geometry and energy; the same numbers after a resume, from any threads, in every file."""

import csv
import io

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose, assert_array_equal
from rich.console import Console

from warpdem import Scene, Simulation
from warpdem.app.run import run_scene
from warpdem.core.pose import FramePose, Placement
from warpdem.core.snapshot import Snapshot, WallLoad, WallMesh
from warpdem.measure.wall_loads import read_loads, torque_point
from warpdem.model.schedule import Schedule
from warpdem.output.write_usd import UsdWriter
from warpdem.output.write_vtk import VtkWriter

RADIUS = 1e-3
NAMES = ("force", "torque", "about", "power", "triangle_force", "pressure")


@pytest.fixture(scope="module")
def box(tmp_path_factory):
    path = tmp_path_factory.mktemp("loads") / "box.stl"
    trimesh.creation.box((10e-3, 10e-3, 12e-3)).export(path)
    return path


def scene(box, **changes) -> Scene:
    """A heap of 27 grains in a box that turns in a turning frame, on a plane above the box's bottom."""
    rng = np.random.default_rng(4)
    cell = np.stack(np.meshgrid(*[np.arange(3)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    data = {
        "gravity": [-60, 0, -60],
        "materials": {"glass": {"density": 2500, "young_modulus": 4e6, "poisson_ratio": 0.3}},
        "contact": {"rolling": "constant"},
        "pairs": [{"materials": ["glass", "glass"], "restitution": 0.6, "friction": 0.5, "rolling_friction": 0.2}],
        "grains": [
            {
                "material": "glass",
                "positions": (cell - 1) * 2.4e-3 - [1.55e-3, 0, 1.4e-3],
                "radius": RADIUS,
                "velocities": rng.normal(0.0, 0.2, (27, 3)),
                "ids": rng.permutation(27) + 100,
            }
        ],
        "walls": [
            {"name": "box", "material": "glass", "mesh": str(box), "motion": {"axis": [0, 0, 1], "rate": 30.0}},
            {"name": "floor", "material": "glass", "plane": {"point": [0, 0, -5e-3], "normal": [0, 0, 1]}},
        ],
        "frame": {"axis": [0, 1, 0], "origin": [0, 0, 0.02], "rate": 8.0},
        "time": {"end": 0.004, "step": 2e-5, "max_speed": 1e-3},
        "output": {"interval": 2e-3, "picture": False},
        "engine": {"max_overlap": 0.3},
    }
    return Scene.model_validate(data | changes)


@pytest.fixture(scope="module")
def sim(box):
    """A run in its middle, with contacts at both walls."""
    sim = Simulation(scene(box), device="cpu", threads=1)
    sim.step(601)
    assert {-1, -2} <= set(sim.contacts().j.tolist())
    return sim


def assert_equal_loads(found, expected):
    assert found.keys() == expected.keys()
    for wall, load in expected.items():
        for name in NAMES:
            assert_array_equal(getattr(found[wall], name), getattr(load, name), err_msg=f"{wall} {name}")


def test_force_is_that_of_the_contacts_turned_round(sim):
    contacts, loads = sim.contacts(), sim.wall_loads()
    for number, name in enumerate(("box", "floor")):
        force = -contacts.force[contacts.j == -1 - number].sum(axis=0)
        assert_allclose(loads[name].force, force, rtol=1e-12)


def test_triangles_carry_the_contacts_that_lie_on_them(sim):
    """Each contact point lies in one of the triangles that report a force; areas and forces add up to the whole."""
    load, mesh, contacts = sim.wall_loads()["box"], sim.meshes["box"], sim.contacts()
    assert load.triangle_force.shape == (12, 3)
    assert_allclose(load.triangle_force.sum(axis=0), load.force, rtol=1e-12)
    place = sim.schedule.wall_placements(sim.scene, sim.time)["box"]
    here = contacts.j == -1
    points = (contacts.point[here] - place.translation) @ place.rotation
    each = [np.repeat(corner[None], len(points), axis=0) for corner in mesh.corners]
    away = np.linalg.norm([trimesh.triangles.closest_point(corners, points) - points for corners in each], axis=2)
    assert_allclose(away.min(axis=0), 0.0, rtol=0, atol=1e-12)
    holder = away.argmin(axis=0)
    push = np.einsum("ij,ij->i", contacts.force[here], contacts.normal[here])
    expected_force, expected_push = np.zeros((12, 3)), np.zeros(12)
    np.add.at(expected_force, holder, -contacts.force[here])
    np.add.at(expected_push, holder, push)
    assert len(set(holder.tolist())) > 1
    assert_allclose(load.triangle_force, expected_force, rtol=0, atol=1e-15)
    assert_allclose(load.pressure, expected_push / trimesh.triangles.area(mesh.corners), rtol=1e-9)
    assert sim.wall_loads()["floor"].pressure.shape == (0,)


def test_laboratory_form_is_the_same_load_turned(sim):
    pose = sim.schedule.pose(sim.time)
    for name, load in sim.wall_loads(lab=True).items():
        other = sim.wall_loads()[name]
        assert_allclose(pose.rotation @ other.torque, load.torque, rtol=1e-12, atol=1e-20)
        assert_allclose(pose.rotation @ other.force, load.force, rtol=1e-12, atol=1e-16)
        assert_allclose(pose.to_laboratory(other.about), load.about)
        assert load.power == other.power
        assert_allclose(load.pressure, other.pressure)
    assert abs(pose.rotation[0, 2]) > 0.05


def test_power_is_that_of_the_walls_laboratory_velocity(sim):
    """P = -(F . u + T . w) with the velocity of a wall's point by differences of its laboratory position."""
    h = 1e-6
    for name, load in sim.wall_loads(lab=True).items():
        body = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
        places = []
        for time in (sim.time - h, sim.time + h):
            numbers = sim.schedule.bodies(time)[["box", "floor"].index(name)]
            inner = body @ numbers[:9].reshape(3, 3).T + numbers[9:12]
            places.append(sim.schedule.pose(time).to_laboratory(inner))
        velocity, middle = (places[1] - places[0]) / (2 * h), (places[1] + places[0]) / 2
        axes = (middle[1:] - middle[0]).T
        rate = (velocity[1:] - velocity[0]).T @ axes.T
        spin = np.array([rate[2, 1], rate[0, 2], rate[1, 0]])
        at_point = velocity[0] + np.cross(spin, load.about - middle[0])
        assert load.power == pytest.approx(-(load.force @ at_point + load.torque @ spin), rel=1e-6)
        assert abs(load.power) > 1e-6


@pytest.mark.parametrize("relative", [False, True])
def test_wall_bodies_have_absolute_velocities_whatever_the_scheme_holds(box, relative):
    schedule = Schedule(scene(box), relative=relative)
    box_body, floor_body = schedule.bodies(0.01)
    pose = schedule.pose(0.01)
    assert_allclose(floor_body[12:15], pose.spin)
    assert_allclose(box_body[12:15], pose.spin + np.array([0, 0, 30.0]))
    assert_allclose(floor_body[15:18], pose.velocity, rtol=0, atol=1e-15)


def test_work_of_a_piston_is_the_energy_that_a_grain_takes_up(box):
    """A box moves against a grain without damping: the sum of P dt is the change of kinetic energy."""
    pair = {"materials": ["glass", "glass"], "restitution": 1.0, "friction": 0.5, "rolling_friction": 0.2}
    grains = {"material": "glass", "positions": [[3.9e-3, 0, 0]], "radius": RADIUS, "velocities": [[0.1, 0, 0]],
              "velocities_in": "laboratory"}  # fmt: skip
    walls = [wall.model_dump() for wall in scene(box).walls]
    walls[0] |= {"fixed_to": "laboratory", "motion": {"velocity": [-0.3, 0, 0]}}
    lossless = scene(box, pairs=[pair], grains=[grains], walls=walls, gravity=[0, 0, 0],
                     time={"end": 1, "step": 2e-6, "max_speed": 1e-3})  # fmt: skip
    sim = Simulation(lossless, device="cpu", threads=1)
    before, work = sim.energy()["kinetic"], 0.0
    for step in range(400):
        work += sim.wall_loads()["box"].power * sim.dt * (1.0 if step else 0.5)
        sim.step(1)
    assert len(sim.contacts().i) == 0
    gain = sim.energy()["kinetic"] - before
    mass = sim.particles.mass[0]
    assert gain == pytest.approx(0.5 * mass * (0.7**2 - 0.1**2), rel=2e-3)
    assert work == pytest.approx(gain, rel=2e-3)


def test_torque_refers_to_the_point_that_the_scene_gives_or_to_an_axis(box):
    turning = {"axis": [0, 0, 1], "origin": [1e-3, 2e-3, 0], "rate": 30.0}
    shift = {"velocity": [0.1, 0, 0]}
    wall = {"material": "glass", "plane": {"point": [0, 0, -6e-3], "normal": [0, 0, 1]}}
    walls = [
        {**wall, "name": "given", "torque_about": [4e-3, 0, 0], "motion": turning},
        {**wall, "name": "own axis", "motion": [turning, shift]},
        {**wall, "name": "frame's axis", "motion": shift},
        {**wall, "name": "laboratory", "fixed_to": "laboratory"},
    ]
    names = [w.pop("name") for w in walls]
    of = scene(box, walls=[{**w, "name": f"w{k}"} for k, w in enumerate(walls)])
    points = [[4e-3, 0, 0], [1e-3, 2e-3, 0], [0, 0, 0.02], [0, 0, 0]]
    for k, (name, expected) in enumerate(zip(names, points, strict=True)):
        assert_array_equal(torque_point(of, k), expected, err_msg=name)


def test_torque_moves_with_its_point(box, sim):
    """The same run with another point: T' = T + (p - p') x F, and the point has turned with the box."""
    walls = [wall.model_dump() for wall in sim.scene.walls]
    walls[0]["torque_about"] = [3e-3, 0, 1e-3]
    other = Simulation(scene(box, walls=walls), device="cpu", threads=1)
    other.step(601)
    first, second = sim.wall_loads()["box"], other.wall_loads()["box"]
    assert_array_equal(second.force, first.force)
    angle = 30.0 * sim.time
    assert_allclose(second.about, [3e-3 * np.cos(angle), 3e-3 * np.sin(angle), 1e-3], rtol=1e-12)
    assert_allclose(second.torque, first.torque + np.cross(first.about - second.about, first.force), rtol=1e-11)


def test_a_resumed_run_reports_the_same_bits(sim, tmp_path):
    sim.save_checkpoint(tmp_path / "saved.h5")
    again = Simulation.from_checkpoint(tmp_path / "saved.h5", device="cpu", threads=1)
    assert_equal_loads(again.wall_loads(), sim.wall_loads())


def test_loads_do_not_depend_on_threads_or_lists(box, sim):
    other = Simulation(scene(box, engine={"max_overlap": 0.3, "skin": 3e-4}), device="cpu", threads=2)
    other.step(601)
    assert other.lists.rebuilds != sim.lists.rebuilds
    assert_equal_loads(other.wall_loads(), sim.wall_loads())


def test_no_walls_no_loads(box):
    assert read_loads(Simulation(scene(box, walls=[]), device="cpu", threads=1).view) == {}


@pytest.fixture(scope="module")
def written(box, tmp_path_factory):
    """A run with all its files, loads and no loads in the frames: (folder, simulation) of each."""
    out = {}
    for loads in (True, False):
        folder = tmp_path_factory.mktemp(f"written_{loads}")
        walls = [wall.model_dump() | {"motion": None} for wall in scene(box).walls]
        walls[1]["fixed_to"] = "laboratory"
        of = scene(box, walls=walls, output={"interval": 2e-3, "picture": False, "wall_loads": loads})
        out[loads] = folder, run_scene(of, folder, device="cpu", threads=1, console=Console(file=io.StringIO()))
    return out


@pytest.mark.parametrize("loads", [True, False])
def test_history_has_force_torque_and_power_of_each_wall_in_the_laboratory(written, loads):
    folder, sim = written[loads]
    with (folder / "history.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    last = {name: float(value) for name, value in rows[-1].items()}
    for name, load in sim.wall_loads(lab=True).items():
        for k, axis in enumerate("xyz"):
            assert last[f"{name} force {axis} [N]"] == load.force[k]
            assert last[f"{name} torque {axis} [N m]"] == load.torque[k]
        assert last[f"{name} power [W]"] == load.power
    assert np.any(sim.wall_loads()["box"].force)
    assert min(float(row["floor force z [N]"]) for row in rows) < 0


def test_wall_files_hold_the_loads_of_their_time(written):
    import pyvista

    folder, sim = written[True]
    assert sorted(p.name for p in folder.glob("wall_box_*.vtp")) == [f"wall_box_{k:06d}.vtp" for k in range(3)]
    load, wall = sim.wall_loads()["box"], pyvista.read(folder / "wall_box_000002.vtp")
    assert_array_equal(wall.cell_data["force"], load.triangle_force)
    assert_array_equal(wall.cell_data["pressure"], load.pressure)
    for name, value in (("force", load.force), ("torque", load.torque), ("torque_about", load.about)):
        assert_array_equal(wall.field_data[name], [value])
    assert_array_equal(np.ravel(wall.field_data["power"]), [load.power])
    assert load.pressure.max() > 0


def test_without_loads_a_wall_at_rest_is_written_once(written):
    import pyvista

    folder, _ = written[False]
    files = list(folder.glob("wall_box_*.vtp"))
    assert len(files) == 1
    assert "pressure" not in pyvista.read(files[0]).cell_data


def test_usd_walls_play_the_loads(written):
    from pxr import Usd, UsdGeom

    folder, sim = written[True]
    stage = Usd.Stage.Open(str(folder / "result.usda"))
    wall, code = UsdGeom.Mesh.Get(stage, "/World/Frame/Walls/box"), 4.0
    load = sim.wall_loads()["box"]
    pressure = UsdGeom.PrimvarsAPI(wall).GetPrimvar("pressure")
    assert pressure.GetInterpolation() == UsdGeom.Tokens.uniform
    assert pressure.GetTimeSamples() == [0.0, 2.0, 4.0]
    assert_allclose(pressure.Get(code), load.pressure, rtol=1e-6)
    assert not np.any(pressure.Get(0.0))
    prim = wall.GetPrim()
    for name, value in (("force", load.force), ("torque", load.torque), ("torqueAbout", load.about)):
        assert_array_equal(prim.GetAttribute(name).Get(code), value)
    assert prim.GetAttribute("power").Get(code) == load.power
    assert len(wall.GetPointsAttr().Get(code)) == 8
    bare = Usd.Stage.Open(str(written[False][0] / "result.usda"))
    assert not bare.GetPrimAtPath("/World/Frame/Walls/box").HasAttribute("primvars:pressure")


def test_wall_that_is_not_made_of_triangles_is_drawn_without_pressure(tmp_path):
    """A cylinder, say: one feature for the contacts, drawn as many triangles."""
    import pyvista
    from pxr import Usd

    drawn = WallMesh("drum", np.eye(4, 3), np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32))
    load = WallLoad(np.ones(3), np.ones(3), np.zeros(3), 2.0, np.zeros((0, 3)), np.zeros(0))
    none = {name: np.zeros((0, 3)) for name in ("position", "velocity", "spin", "force")}
    none |= {name: np.zeros(0) for name in ("radius", "mass")} | {name: np.zeros(0, int) for name in ("id", "type", "group")}
    rest = FramePose.rotated(np.array([0.0, 0.0, 1.0]), np.zeros(3), 0.0, 0.0)
    place = Placement(np.eye(3), np.zeros(3))
    snapshot = Snapshot(step=0, time=0.0, frame=rest, walls={"drum": place}, loads={"drum": load}, **none)
    for writer in (VtkWriter(tmp_path, [drawn]), UsdWriter(tmp_path, [drawn])):
        writer.write(snapshot)
        writer.close()
    wall = pyvista.read(tmp_path / "wall_drum_000000.vtp")
    assert (wall.n_cells, list(wall.cell_data), wall.field_data["power"].item()) == (2, [], 2.0)
    stage = Usd.Stage.Open(str(tmp_path / "result.usda"))
    prim = stage.GetPrimAtPath("/World/Frame/Walls/drum")
    assert prim.GetAttribute("power").Get(0.0) == 2.0
    assert prim.GetAttribute("primvars:pressure").Get(0.0) is None
