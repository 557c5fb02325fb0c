"""Which charts the columns of a history give: each column at most once, those that are always zero not at all."""

import numpy as np

from warpdem.reports.charts import charts_of
from warpdem.runs import History

NAMES = [
    "time [s]", "frame_angle [rad]", "grains [-]", "kinetic [J]", "rotational [J]", "elastic [J]", "potential [J]",
    "fields [J]",
    "centre_x [m]", "centre_y [m]", "centre_z [m]", "largest_overlap [-]", "largest_approach_speed [m/s]",
    *(f"lid force {axis} [N]" for axis in "xyz"), *(f"lid torque {axis} [N m]" for axis in "xyz"), "lid power [W]",
    "elastic_normal [J]", "dissipated_sliding [J]", "work_walls [J]", "lid work [J]", "integration_error [J]",
    "flow hole mass [kg]", "flow hole count [-]", "region low stress_xx [Pa]", "region low stress_yy [Pa]", "mixing a [-]",
]  # fmt: skip
ZERO = ("fields [J]", "lid force x [N]")


def history():
    return History("h", {name: np.zeros(3) if name in ZERO else np.arange(3.0) + 1 for name in NAMES})


def drawn(section):
    return {chart.title: (chart.unit, list(chart.curves)) for chart in charts_of(history(), ["lid"])[section]}


def test_energies_of_the_run_and_of_its_budget():
    assert drawn("energy") == {
        "Energy in the laboratory": ("J", ["kinetic", "rotational", "elastic", "potential"]),
        "Dissipated and elastic energy by its kind": ("J", ["elastic normal", "dissipated sliding"]),
        "Work and energy carried in": ("J", ["work walls"]),
        "Energy that the time integration lost or made": ("J", ["integration error"]),
    }


def test_loads_of_each_wall():
    assert drawn("walls") == {
        "lid: force of the grains on it": ("N", ["y", "z"]),
        "lid: torque of the grains on it": ("N m", ["x", "y", "z"]),
        "lid: power of its motion on the grains": ("W", ["power"]),
    }


def test_grains_and_whatever_the_scene_measures():
    assert [*drawn("grains")] == ["Centre of mass", "Grains in the domain", "Largest overlap so far, over the radius",
                                  "Largest approach speed so far"]  # fmt: skip
    assert drawn("measures") == {
        "flow hole mass": ("kg", ["flow hole mass"]),
        "flow hole count": ("-", ["flow hole count"]),
        "region low": ("Pa", ["region low stress xx", "region low stress yy"]),
        "mixing a": ("-", ["mixing a"]),
    }


def test_a_wall_whose_name_begins_another_takes_its_own_columns():
    names = ["time [s]", "lid force x [N]", "lid top force x [N]"]
    found = charts_of(History("h", {name: np.arange(3.0) + 1 for name in names}), ["lid", "lid top"])["walls"]
    assert [(chart.title, len(chart.curves)) for chart in found] == [
        ("lid: force of the grains on it", 1), ("lid top: force of the grains on it", 1)
    ]  # fmt: skip


def test_many_curves_of_a_kind_are_divided():
    names = ["time [s]", *(f"mixing {k} [-]" for k in range(19))]
    found = charts_of(History("h", {name: np.arange(3.0) + 1 for name in names}), [])["measures"]
    assert [len(chart.curves) for chart in found] == [8, 8, 3]
    assert [chart.title for chart in found] == ["mixing (1)", "mixing (2)", "mixing (3)"]
