"""The contact network: what its lines carry is what the grains feel, and VTK shows it."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from warpdem import Scene, SceneError, Simulation
from warpdem.core.snapshot import in_laboratory
from warpdem.measure.contact_network import read_network
from warpdem.output.write_vtk import VtkWriter
from warpdem.scene.file import scene_from_dict

R, MU = 1e-3, 0.4


def simulated(positions, **keys) -> Simulation:
    grains = {"material": "g", "positions": positions, "radius": R, **keys.pop("grains", {})}
    scene = {
        "gravity": [0, 0, -50],
        "materials": {"g": {"density": 2500.0, "young_modulus": 5e6, "poisson_ratio": 0.3}},
        "contact": {"rolling": "none"},
        "pairs": [{"materials": ["g", "g"], "restitution": 0.5, "friction": MU}],
        "grains": [grains],
        "walls": [
            {"name": "side", "material": "g", "plane": {"point": [-R, 0, 0], "normal": [1, 0, 0]}},
            {"name": "floor", "material": "g", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}},
        ],
        "time": {"end": 1.0, "step": 2e-5, "max_speed": 0.3},
        "output": {"contacts": True, "formats": ["vtk"]},
        **keys,
    }
    return Simulation(Scene.model_validate(scene), device="cpu", threads=1)


def heap(**keys) -> Simulation:
    """Grains pressed on the floor and against the side."""
    cell = np.stack(np.meshgrid(np.arange(3), np.arange(3), np.arange(2), indexing="ij"), axis=-1).reshape(-1, 3)
    velocities = np.random.default_rng(3).normal(0, 0.02, (18, 3)) - [0.05, 0.0, 0.0]
    ids = np.random.default_rng(1).permutation(18) + 7
    sim = simulated(cell * 1.999e-3 + [0, 0, 0.9999e-3], grains={"velocities": velocities, "ids": ids}, **keys)
    sim.step(60)
    return sim


@pytest.fixture(scope="module")
def settled():
    return heap()


def test_forces_of_the_lines_are_the_loads_of_the_grains(settled):
    network, p = read_network(settled.view), settled.particles
    total = np.zeros((len(p.id), 3))
    np.add.at(total, np.searchsorted(p.id, network.i), network.force)
    pairs = network.j >= 0
    np.add.at(total, np.searchsorted(p.id, network.j[pairs]), -network.force[pairs])
    assert pairs.sum() > 10
    assert set(network.wall[~pairs]) == {0, 1}
    assert_allclose(total, p.force, rtol=0, atol=1e-12 * np.abs(p.force).max())


def test_lines_join_centres_and_end_on_walls(settled):
    network, p = read_network(settled.view), settled.particles
    pairs, floor = network.j >= 0, network.wall == 1
    assert_array_equal(network.start, p.position[np.searchsorted(p.id, network.i)])
    assert_allclose(network.end[pairs], p.position[np.searchsorted(p.id, network.j[pairs])], rtol=0, atol=1e-18)
    assert_allclose(network.end[floor][:, 2], 0.0, rtol=0, atol=1e-18)
    length = np.linalg.norm(network.end - network.start, axis=1)
    assert_allclose(length, np.where(pairs, 2 * R, R) - network.overlap, rtol=1e-12)
    assert (network.i < np.where(pairs, network.j, np.inf)).all()


def test_force_is_split_along_and_across_the_line(settled):
    network = read_network(settled.view)
    normal = network.start - network.end
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    size = np.abs(network.force).max()
    assert_allclose(network.normal_force[:, None] * normal + network.friction_force, network.force, rtol=0, atol=1e-12 * size)
    assert_allclose(np.einsum("ij,ij->i", network.friction_force, normal), 0.0, rtol=0, atol=1e-12 * size)
    limit = MU * np.maximum(network.normal_force, 0.0)
    friction = np.linalg.norm(network.friction_force, axis=1)
    slides = network.sliding == 1
    assert 0 < slides.sum() < len(slides)
    assert_allclose(friction[slides], limit[slides], rtol=1e-9)
    assert (friction[~slides] <= limit[~slides] + 1e-12 * size).all()


def test_damping_forces_take_what_the_energy_budget_counts_as_damping():
    """Dashpot forces against those that the kernels leave for the budget, of pairs; elastic and damping forces add up."""
    sim = heap(measures={"energy": True})
    network, listed = read_network(sim.view), sim.view.contacts
    lanes = listed.real_lanes()
    history, width, at = listed.history.numpy(), listed.history.shape[2], sim.plan.impulses
    kept = history[lanes // width, sim.plan.contact.history.width :, lanes % width] / sim.dt  # impulses over a step
    ids = [sim.state.id.numpy()[side.numpy().ravel()[lanes]] for side in (listed.owner, listed.partner)]
    of_pair = dict(zip(zip(*ids, strict=True), kept, strict=True))  # with those that are near only
    pairs = network.j >= 0
    found = np.array([of_pair[key] for key in zip(network.i[pairs], network.j[pairs], strict=True)])
    place, of = sim.particles.position, sim.particles.id
    normal = np.subtract(*(place[np.searchsorted(of, side[pairs])] for side in (network.i, network.j)))
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    wanted = normal * found[:, at.damping, None] + found[:, at.of("tangential")]
    size = np.abs(network.force).max()
    assert np.abs(wanted).max() > 0.01 * size
    assert_allclose(network.damping_force[pairs], wanted, rtol=0, atol=1e-8 * size)


def test_springs_at_rest_have_no_damping_force():
    sim = simulated([[0.01, 0, R - 2e-6]], gravity=[0, 0, 0])
    network = read_network(sim.view)
    assert network.normal_force[0] > 0
    assert_allclose(network.damping_force, 0.0, rtol=0, atol=1e-8 * network.normal_force[0])


@pytest.mark.parametrize(("speed", "sliding"), [(0.2, 1), (0.0, 0)])
def test_a_grain_pushed_over_the_floor_slides(speed, sliding):
    overlap = 2e-6
    sim = simulated([[0.01, 0, R - overlap]], grains={"velocities": [[0, speed, 0]]})
    sim.step(3)
    network = read_network(sim.view)
    assert (network.i, network.j, network.wall, network.sliding) == ([0], [-1], [1], [sliding])
    assert_allclose(network.friction_force[0], [0, -MU * network.normal_force[0] * sliding, 0], rtol=0, atol=1e-15)


PLASTIC = '''
import functools, numpy as np, warp as wp
PAIR = {"stiffness": ("N/m", None, "stiffness")}
COEFFICIENTS = {"pull": "N"}

def coefficients(a, b, pair):
    return pair.stiffness, 0.0, 1.0, 0.0, 0.02

def energy(overlap, stiffness, pull):
    return 0.5 * stiffness * overlap**2 - pull * overlap

@functools.cache
def build(real):
    Own = wp.types.vector(1, real)

    @wp.func
    def constants(base: real, damping: real, own: Own, radius: real, mass: real):
        return base, damping, own

    @wp.func
    def force(overlap: real, before: real, speed: real, stiffness: real, damping: real, own: Own, history: Own):
        touching = real(1.0) if overlap > real(0.0) else real(0.0)
        load = touching * stiffness * overlap
        return load - touching * own[0], load, touching * stiffness, real(0.0), overlap, before, history

    return constants, force
'''
"""A law that pulls with 0.02 N while grains touch; friction goes by the spring alone."""


@pytest.mark.parametrize(("slip", "sliding"), [(0.5, 0), (0.9, 0), (2.0, 1)], ids=["stick", "nearly", "slide"])
@pytest.mark.parametrize("partner", ["wall", "grain"])
def test_what_slides_follows_the_coulomb_load_that_the_law_declares(tmp_path, slip, sliding, partner):
    """Pressed by 0.05 N less the pull of 0.02 N: |F_t| of 0.5 and of 0.9 mu L is over or near mu F_n, and does not slide."""
    (tmp_path / "pulls.py").write_text(PLASTIC)
    stiffness, dt, steps = 1000.0, 2e-6, 4
    overlap = 0.05 / stiffness
    reach = MU * 0.05 / stiffness  # the slip at which the spring reaches the limit [m]
    speed = slip * reach / (dt * steps)
    there = [[0.01, 0, R - overlap]] if partner == "wall" else [[0.01, 0, 0.1], [0.01, 0, 0.1 + 2 * R - overlap]]
    moving = [[0, speed, 0]] if partner == "wall" else [[0, -0.5 * speed, 0], [0, 0.5 * speed, 0]]
    data = {
        "gravity": [0, 0, 0],
        "materials": {"g": {"density": 2.5e9, "young_modulus": 5e6, "poisson_ratio": 0.3}},  # so heavy that nothing else moves
        "contact": {"normal": "pulls.py", "rolling": "none"},
        "pairs": [{"materials": ["g", "g"], "restitution": 1.0, "friction": MU, "stiffness": stiffness}],
        "grains": [{"material": "g", "positions": there, "radius": R, "velocities": moving}],
        "walls": [{"name": "floor", "material": "g", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}],
        "time": {"end": 1.0, "step": dt, "max_speed": 0.3},
    }
    sim = Simulation(scene_from_dict(data, tmp_path), device="cpu", threads=1)
    sim.step(steps)
    network, contacts = read_network(sim.view), sim.contacts()
    assert_allclose(contacts.load, [0.05], rtol=0.02)
    assert_allclose(network.normal_force, [0.03], rtol=0.04)
    assert_allclose(np.linalg.norm(network.friction_force), MU * 0.05 * min(slip, 1.0), rtol=0.02)
    assert network.sliding.tolist() == [sliding]
    sim.save_checkpoint(tmp_path / "saved.h5")
    again = Simulation.from_checkpoint(tmp_path / "saved.h5", device="cpu", threads=1, plugins=[tmp_path / "pulls.py"])
    assert read_network(again.view).sliding.tolist() == [sliding]
    assert again.contacts().load == contacts.load


def test_a_contact_across_a_periodic_border_is_a_short_line():
    side = {"min": 0.0, "max": 0.02, "kind": "periodic"}
    sim = simulated([[0.0005, 0.01, 0.01], [0.01851, 0.01, 0.01]], walls=[], borders={"x": side}, gravity=[0, 0, 0])
    network = read_network(sim.view)
    assert_allclose(network.end - network.start, [[-0.00199, 0, 0]], rtol=0, atol=1e-15)


def test_the_network_does_not_depend_on_the_order_in_memory(settled):
    other = heap(engine={"skin": 3e-5})
    assert other.lists.rebuilds != settled.lists.rebuilds
    first, second = read_network(settled.view), read_network(other.view)
    for name, values in vars(first).items():
        assert_array_equal(getattr(second, name), values)


def test_vtk_reads_the_lines_of_each_frame_with_their_times(tmp_path, settled):
    import pyvista

    writer = VtkWriter(tmp_path, [], contacts=True)
    shots = []
    for _ in range(2):
        shots.append(settled.snapshot())
        writer.write(shots[-1])
        settled.step(20)
    reader = pyvista.PVDReader(tmp_path / "contacts.pvd")
    assert reader.time_values == [shot.time for shot in shots]
    for k, shot in enumerate(shots):
        reader.set_active_time_point(k)
        [lines], wanted = reader.read(), shot.contacts
        assert lines.n_lines == len(wanted.i) > 10
        ends = lines.points[lines.lines.reshape(-1, 3)[:, 1:]]
        assert_array_equal(ends, np.stack([wanted.start, wanted.end], axis=1))
        for name in ("i", "j", "wall", "force", "normal_force", "friction_force", "overlap", "sliding", "damping_force"):
            assert_array_equal(lines.cell_data[name], getattr(wanted, name))


def test_nothing_is_made_when_nobody_asks(settled, tmp_path):
    sim = simulated([[0.01, 0, R]], output={"formats": ["vtk"]})
    assert sim.snapshot().contacts is None
    VtkWriter(tmp_path, []).write(sim.snapshot())
    assert not list(tmp_path.glob("contacts*"))


def test_contacts_without_a_format_that_holds_them_are_refused():
    with pytest.raises(SceneError, match='only the formats "vtk" and "vtkhdf" hold contacts'):
        simulated([[0, 0, R]], output={"contacts": True, "formats": ["usd"]})


def test_in_laboratory_axes_all_vectors_of_a_contact_are_rotated():
    sim = heap(frame={"axis": [0, 0, 1], "rate": 300.0})
    sim.step(20)
    here = sim.snapshot()
    there, turn = in_laboratory(here).contacts, here.frame.rotation.T
    assert np.abs(here.contacts.damping_force).max() > 0.0 and abs(turn[0, 1]) > 0.1
    for name in ("force", "friction_force", "damping_force"):
        assert_array_equal(getattr(there, name), getattr(here.contacts, name) @ turn)
    assert_allclose(there.end - there.start, (here.contacts.end - here.contacts.start) @ turn, rtol=0, atol=1e-15)
