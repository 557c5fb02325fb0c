"""history.csv: the header of a scene with everything on, word for word, and rows whose numbers belong to their columns."""

import math

import numpy as np
import pytest

from warpdem import Scene, Simulation
from warpdem.core.snapshot import WallLoad
from warpdem.measure import column, observation
from warpdem.measure.column import Readings
from warpdem.measure.sums import Reader
from warpdem.output.history import GENERAL, WALL, history_columns, history_row

WALL_HEADER = (
    "{0} force x [N],{0} force y [N],{0} force z [N],"
    "{0} torque x [N m],{0} torque y [N m],{0} torque z [N m],{0} power [W]"
)
HEADER = [
    "time [s],frame_angle [rad],grains [-],kinetic [J],rotational [J],elastic [J],potential [J],fields [J]",
    "centre_x [m],centre_y [m],centre_z [m],largest_overlap [-],largest_approach_speed [m/s]",
    WALL_HEADER.format("floor"),
    WALL_HEADER.format("tube"),
    "elastic_normal [J],elastic_tangential [J],elastic_rolling [J]",
    "dissipated_normal_damping [J],dissipated_tangential_damping [J],dissipated_sliding [J],dissipated_rolling [J]",
    "dissipated_rescaling [J],work_walls [J],work_fields [J],carried_in [J],integration_error [J],jacobi [J]",
    "floor work [J],tube work [J]",
    *(
        f"momentum_x{term} [N s],momentum_y{term} [N s],momentum_z{term} [N s],"
        f"angular_momentum_x{term} [N m s],angular_momentum_y{term} [N m s],angular_momentum_z{term} [N m s]"
        for term in ("", " walls", " gravity", " fields", " carried", " error")
    ),
    "flow low mass [kg],flow low count [-]",
    "region low grains [-],region low mass [kg],region low velocity_x [m/s],region low velocity_y [m/s]",
    "region low velocity_z [m/s],region low granular_temperature [m2/s2],region low coordination [-]",
    "region low solid_fraction [-],region low stress_xx [Pa],region low stress_yy [Pa],region low stress_zz [Pa]",
    "region low stress_xy [Pa],region low stress_yz [Pa],region low stress_zx [Pa]",
    "region low centre_x [m],region low centre_y [m],region low centre_z [m],region low speed [m/s]",
    "region whole grains [-],region whole mass [kg],region whole velocity_x [m/s],region whole velocity_y [m/s]",
    "region whole velocity_z [m/s],region whole granular_temperature [m2/s2],region whole coordination [-]",
    "region whole centre_x [m],region whole centre_y [m],region whole centre_z [m],region whole speed [m/s]",
    "region whole fabric_xx [-],region whole fabric_yy [-],region whole fabric_zz [-]",
    "region whole fabric_xy [-],region whole fabric_yz [-],region whole fabric_zx [-]",
    "mixing sizes [-]",
    "fast sum [m/s],fast mean [m/s],fast min [m/s],fast max [m/s]",
]


@pytest.fixture(scope="module")
def scene() -> Scene:
    """All that adds columns: two walls, a field, a frame that turns, every measure and every reduction of an observer."""
    sizes = {"radii": [1e-3, 2e-3, 1.5e-3], "positions": [[2e-3, 2e-3, 2e-3], [8e-3, 2e-3, 3e-3], [2e-3, 9e-3, 0.03]]}
    return Scene.model_validate(
        {
            "materials": {"g": {"density": 2500.0, "young_modulus": 5e6, "poisson_ratio": 0.25}},
            "contact": {"tangential": "none"},
            "pairs": [{"materials": ["g", "g"], "restitution": 0.5}],
            "grains": [{"material": "g", **sizes, "velocities": [[0, 0, 0.1], [0.2, 0, 0], [0, 0.3, 0]]}],
            "walls": [
                {"name": "floor", "material": "g", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}},
                {"name": "tube", "material": "g", "cylinder": {"point": [0, 0, 0], "axis": [0, 0, 1], "radius": 15e-3}},
            ],
            "fields": [{"model": "drag", "parameters": {"coefficient": 1e-4}}],
            "frame": {"axis": [0, 0, 1], "origin": [0.01, 0, 0], "rate": 3.0},
            "observers": [{"name": "fast", "model": "speed", "reduce": ["sum", "mean", "min", "max"]}],
            "measures": {
                "energy": True,
                "momentum": True,
                "flow": [{"name": "low", "point": [0, 0, 4.5e-3], "normal": [0, 0, -1]}],
                "mixing": [{"name": "sizes", "by": "size", "cell": 0.1}],
                "regions": [
                    {"name": "low", "box": {"min": [-1, -1, -1], "max": [1, 1, 0.01]}}, {"name": "whole", "fabric": True}
                ],
            },
            "time": {"end": 0.01, "step": 4e-5, "max_speed": 0.05},
        }
    )


def test_the_header_of_a_scene_with_everything_on(scene):
    assert ",".join(column.header for column in history_columns(scene)) == ",".join(HEADER)


def test_a_scene_that_asks_for_nothing_has_the_general_columns_alone(scene):
    plain = scene.model_copy(update={"walls": [], "measures": type(scene.measures)(), "observers": []})
    assert history_columns(plain) == list(GENERAL)


def test_each_number_stands_in_the_column_of_its_name(scene):
    """Against what the simulation itself says, after some steps."""
    sim = Simulation(scene, device="cpu", threads=1)
    sim.step(100)
    columns = history_columns(scene)
    row = history_row(columns, Readings(sim.view, observation.observed(sim.view)))
    found = dict(zip((column.header for column in columns), row, strict=True))
    assert found["time [s]"] == sim.time and found["frame_angle [rad]"] == pytest.approx(3.0 * sim.time)
    energy, p = sim.energy(), sim.particles
    assert {name: found[f"{name} [J]"] for name in energy} == energy
    np.testing.assert_allclose(
        [found[f"centre_{axis} [m]"] for axis in "xyz"], np.average(p.position_lab, axis=0, weights=p.mass)
    )
    for name, load in sim.wall_loads(lab=True).items():
        assert [found[f"{name} force {axis} [N]"] for axis in "xyz"] == load.force.tolist()
        assert [found[f"{name} torque {axis} [N m]"] for axis in "xyz"] == load.torque.tolist()
        assert found[f"{name} power [W]"] == load.power
    np.testing.assert_equal({header: found[header] for header in sim.measure()}, sim.measure())
    budget = sim.budget.energy()
    assert {name: found[f"{name} [J]"] for name in budget} == budget
    assert found["angular_momentum_z walls [N m s]"] == sim.budget.momentum()["angular_momentum_z walls"]
    assert [found["flow low mass [kg]"], found["flow low count [-]"]] == sim.budget.flow()
    low = p.position[:, 2] < 0.01
    assert found["region low grains [-]"] == low.sum() == 2 and found["region whole grains [-]"] == 3
    np.testing.assert_allclose(found["region low mass [kg]"], p.mass[low].sum())
    speeds = sim.observe("fast")
    assert found["fast sum [m/s]"] == speeds.sum() and found["fast max [m/s]"] == speeds.max()
    assert math.isfinite(found["mixing sizes [-]"])


def test_a_quantity_that_several_columns_share_is_computed_once(scene, monkeypatch):
    sim = Simulation(scene, device="cpu", threads=1)
    calls = []

    def counted(module, name):
        function = getattr(module, name)
        monkeypatch.setattr(module, name, lambda *args, **keys: (calls.append(name), function(*args, **keys))[1])

    counted(Reader, "rounded")
    counted(column, "total_loads")
    history_row([*GENERAL, *history_columns(scene)[len(GENERAL) : len(GENERAL) + 14]], Readings(sim.view))
    assert sorted(calls) == ["rounded", "total_loads"]


def test_without_grains_a_sum_is_zero_and_the_other_reductions_are_no_number(scene):
    read = Readings(None, {"fast": np.zeros(0)})
    total, *others = [column.read(read) for column in observation.columns(scene)]
    assert total == 0.0 and np.isnan(others).all()


def test_wall_columns_read_the_load_that_they_name():
    load = WallLoad(np.arange(3.0), np.arange(3.0, 6.0), np.zeros(3), 6.0, np.zeros((0, 3)), np.zeros(0))
    assert [read(load) for _, _, read in WALL] == [0, 1, 2, 3, 4, 5, 6]
