"""Sums over all grains, contacts and walls: what NumPy makes of the readings; rows of history whose bytes depend on nothing."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from warpdem import Scene, Simulation
from warpdem.measure import sums
from warpdem.measure.column import Readings
from warpdem.measure.totals import Totals
from warpdem.output.history import history_columns, history_row

R = 2e-3


def scene(order=slice(None), **engine) -> Scene:
    """Grains of two materials on a moving floor in a tube, in a frame that turns and moves; all measures."""
    cell = np.stack(np.meshgrid(*[np.arange(5)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    rng = np.random.default_rng(2)
    n = len(cell)
    position, radii = (cell - [2, 2, 0]) * 2.02 * R + [0, 0, R], rng.uniform(0.9, 1.0, n) * R
    velocities, spins = rng.normal(0.0, 0.1, (n, 3)), rng.normal(0.0, 10.0, (n, 3))
    ids, second = rng.permutation(n) * 2 + 3, rng.random(n) < 0.5
    chosen = np.arange(n)[order]
    groups = [
        {"material": name, "positions": position[which], "radii": radii[which], "velocities": velocities[which],
         "spins": spins[which], "ids": ids[which]}
        for name, which in (("a", chosen[~second[chosen]]), ("b", chosen[second[chosen]]))
    ]  # fmt: skip
    keys = {"restitution": 0.5, "rolling_friction": 0.1}
    return Scene.model_validate(
        {
            "gravity": [0, 0, -60],
            "materials": {k: {"density": d, "young_modulus": 5e6, "poisson_ratio": 0.25} for k, d in (("a", 2500), ("b", 900))},
            "contact": {"rolling": "spring"},
            "pairs": [
                {"materials": pair, "friction": friction, **keys}
                for pair, friction in ((["a", "a"], 0.5), (["a", "b"], 0.3), (["b", "b"], 0.1))
            ],
            "grains": groups,
            "walls": [
                {"name": "floor", "material": "a", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]},
                 "motion": {"axis": [0, 0, 1], "rate": 5.0}},
                {"name": "tube", "material": "b", "cylinder": {"point": [0, 0, 0], "axis": [0, 0, 1], "radius": 6.5 * R}},
            ],
            "fields": [{"model": "harmonic", "parameters": {"stiffness": 1e-2, "centre": [4e-3, 0, 0.01]}}],
            "frame": {"axis": [0, 1, 3], "origin": [0.01, 0, 0], "rate": 3.0},
            "measures": {
                "energy": True,
                "momentum": True,
                "flow": [{"name": "low", "point": [0, 0, 9e-3], "normal": [0, 0, -1]}],
                "mixing": [{"name": "sizes", "by": "size", "cell": 8e-3}],
                "regions": [{"name": "low", "box": {"min": [-1, -1, -1], "max": [1, 1, 0.01]}}],
            },
            "time": {"end": 1.0, "step": 2e-5, "max_speed": 0.3},
            "engine": {"max_overlap": 0.3, **engine},
        }
    )  # fmt: skip


def run(threads: int = 1, **keys) -> Simulation:
    sim = Simulation(scene(**keys), device="cpu", threads=threads)
    sim.step(1000)
    return sim


@pytest.fixture(scope="module")
def sim():
    return run()


def row_of(sim) -> bytes:
    return np.array(history_row(history_columns(sim.scene), Readings(sim.view))).tobytes()


def test_sums_over_grains_are_those_of_their_readings(sim):
    now, p = Totals(sim.view), sim.particles
    v, w, x = p.velocity_lab, p.spin_lab, p.position_lab
    close = {"rtol": 1e-12}
    assert_allclose(now.mass, p.mass.sum(), **close)
    assert_allclose(now.energy["kinetic"], 0.5 * p.mass @ (v**2).sum(axis=1), **close)
    assert_allclose(now.energy["rotational"], 0.5 * p.inertia @ (w**2).sum(axis=1), **close)
    assert_allclose(now.energy["potential"], -p.mass @ x @ np.array(sim.scene.gravity), **close)
    assert_allclose(now.energy["fields"], 0.5e-2 * ((x - [4e-3, 0, 0.01]) ** 2).sum(), **close)
    assert_allclose(now.center_of_mass, p.mass @ x / p.mass.sum(), **close)
    angular = p.mass @ np.cross(x, v) + p.inertia @ w
    size = np.abs(p.mass[:, None] * np.cross(x, v)).sum()
    assert_allclose(now.momentum, [*(p.mass @ v), *angular], rtol=1e-12, atol=1e-13 * size)
    pose = sim.schedule.pose(sim.time)
    carried = pose.velocity_at(p.position) @ pose.rotation.T
    along = p.mass @ (v * carried).sum(axis=1) + p.inertia @ (w @ (pose.rotation @ pose.spin))
    assert_allclose(now.along_frame, along, rtol=1e-11)


def test_sums_are_those_of_absolute_velocities_where_the_integrator_holds_relative_ones():
    """Off the axis of a frame that turns, `velocity_verlet` holds velocities relative to it."""
    grains = {"material": "g", "radius": R, "positions": [[0.1, 0.2, 0.3], [-0.2, 0.1, 0.0]]}
    sim = Simulation(
        Scene.model_validate(
            {
                "materials": {"g": {"density": 2500, "young_modulus": 5e6, "poisson_ratio": 0.25}},
                "pairs": [{"materials": ["g", "g"], "restitution": 0.5}],
                "grains": [grains | {"velocities": [[1.0, -2.0, 0.5], [0.3, 0.2, 2.0]], "velocities_in": "laboratory"}],
                "frame": {"axis": [0, 1, 3], "origin": [0.01, 0, 0], "rate": 3.0},
                "gravity": [0, 0, 0],
                "time": {"end": 1.0, "step": 2e-5},
                "engine": {"integrator": "velocity_verlet"},
            }
        ),
        device="cpu",
        threads=1,
    )
    now, p = Totals(sim.view), sim.particles
    flying = np.array([[1.0, -2.0, 0.5], [0.3, 0.2, 2.0]])
    assert_allclose(p.velocity_lab, flying, rtol=1e-13)
    assert_allclose(now.momentum, [*(p.mass @ flying), *(p.mass @ np.cross(p.position_lab, flying))], rtol=1e-12)
    assert_allclose(now.energy["kinetic"], 0.5 * p.mass @ (flying**2).sum(axis=1), rtol=1e-12)


def test_loads_on_walls_are_those_of_their_contacts(sim):
    contacts, loads, now = sim.contacts(), sim.wall_loads(), Totals(sim.view)
    assert now.energy["kinetic"] > 0.0  # with all sums at once, or alone
    np.testing.assert_array_equal(now.walls, Totals(sim.view).walls)
    assert (contacts.j == -1).sum() > 5 and (contacts.j == -2).sum() > 2
    for number, name in enumerate(("floor", "tube")):
        here = contacts.j == -1 - number
        force = -contacts.force[here]
        size = np.abs(force).sum()
        assert_allclose(loads[name].force, force.sum(axis=0), rtol=0, atol=1e-13 * size)
        lever = np.cross(contacts.point[here] - loads[name].about, force).sum(axis=0)
        # the rolling torque is beside it: below mu_r R N
        assert_allclose(loads[name].torque, lever, rtol=0, atol=0.1 * R * size)


def test_elastic_energy_is_that_of_its_contacts(sim):
    contacts = sim.contacts()
    assert_allclose(Totals(sim.view).elastic["normal"], (0.4 * contacts.stiffness * contacts.overlap**2.5).sum(), rtol=1e-12)
    assert all(value > 0.0 for value in Totals(sim.view).elastic.values())


@pytest.mark.parametrize("threads", [2, 3])
def test_no_byte_of_a_row_depends_on_threads(sim, threads, monkeypatch):
    monkeypatch.setattr(sums, "LEAST", 1)  # so that these few grains are split
    other = run(threads)
    assert other.state_hash() == sim.state_hash()
    assert row_of(other) == row_of(sim)


def test_no_byte_of_a_row_depends_on_the_order_in_memory_or_on_lists(sim):
    for other in (run(order=slice(None, None, -1)), run(skin=0.15 * R)):
        assert other.state_hash() == sim.state_hash()
        assert (other.state.id.numpy() != sim.state.id.numpy()).any() or other.lists.rebuilds != sim.lists.rebuilds
        assert row_of(other) == row_of(sim)


def test_a_row_made_before_the_run_goes_on_is_that_of_its_time():
    sim, columns = run(), history_columns(scene())
    row, made = history_row(columns, Readings(sim.view)), Totals(sim.view).made()
    names = [column.header for column in columns]
    sim.step(50)
    later = history_row(columns, Readings(sim.view, totals=made))
    general = [k for k, name in enumerate(names) if name.split(" ")[0] in {"kinetic", "elastic", "centre_x", "floor", "jacobi"}]
    assert len(general) > 10
    assert [later[k] for k in general] == [row[k] for k in general]


def test_launches_with_other_arrays_are_recorded_anew():
    """Lists are built anew between two rows: what was recorded for the old arrays is not used."""
    sim, rebuilds = run(), set()
    for _ in range(4):
        sim.step(300)
        rebuilds.add(sim.lists.rebuilds)
        fresh = Totals(sim.view)
        sim.view.kept.clear()
        assert Totals(sim.view).energy == fresh.energy
        assert np.array_equal(Totals(sim.view).walls, fresh.walls)
    assert len(rebuilds) > 1
