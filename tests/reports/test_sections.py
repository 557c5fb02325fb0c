"""Sections of a report, against records and histories made up."""

import json

import numpy as np

from warpdem.reports import sections
from warpdem.runs import History


def words(nodes):
    return [" ".join("".join(node.itertext()).split()) for node in nodes]


def rows(node):
    return [["".join(cell.itertext()) for cell in line] for line in node.iter("tr")]


def test_what_was_warned_of_and_noticed_is_there_or_that_there_is_nothing():
    assert words(sections.warnings({})) == ["No warnings."]
    listed, title, notes = sections.warnings({"warnings": ["hot"], "noticed": {"overlap": "deep"}, "notes": ["odd"]})
    assert [item.text for item in listed] == ["hot", "overlap: deep"]
    assert title.text == "Notes" and [item.text for item in notes] == ["odd"]


def test_the_time_step_against_each_limit():
    limits = [
        {"key": "a", "name": "Rayleigh time", "seconds": 1e-5, "share": 0.2, "auto_share": None, "refused": False},
        {"key": "b", "name": "one impact", "seconds": 2e-6, "share": 1.0, "auto_share": 0.8, "refused": True},
        {"key": "c", "name": "fields", "seconds": None, "share": None, "auto_share": 0.1, "refused": False},
    ]
    line, table = sections.time_step({"time_step": {"used": 2e-6, "binding": "given"}, "limits": limits})
    assert words([line]) == ["Time step 2\u00b710\u207b\u2076 s, set by: given."]
    found = rows(table)[1:]
    assert [row[0] for row in found] == ["Rayleigh time", "one impact", "fields"]
    assert found[0][5] == "" and found[1][5] == "above what auto keeps (a longer step is refused)"
    assert found[2][4] == "nothing limits"
    bars = [svg.findall("rect")[1] for svg in table.iter("svg")]
    assert [float(bar.get("width")) for bar in bars] == [24.0, 120.0]
    assert [bar.get("class") for bar in bars] == ["used", "over"]
    assert "older version" in words(sections.time_step({"time_step": {"used": 1.0}}))[1]


def test_the_energy_budget_closes_but_for_its_error():
    names = ["kinetic", "rotational", "elastic", "potential", "fields", "work_walls", "dissipated_sliding", "integration_error"]
    first, last = [1, 1, 1, 1, 0, 0, 0, 0], [2, 1, 1, 3, 0, 5, 1.75, -0.25]
    columns = {f"{name} [J]": np.array([a, b], float) for name, a, b in zip(names, first, last, strict=True)}
    table, line = sections.energy_budget(History("h", columns))
    assert rows(table)[1:] == [["work walls", "5"], ["dissipated sliding", "1.75"], ["change of the stored energy", "3"],
                               ["error of the time integration", "\u22120.25"]]  # fmt: skip
    assert "but for \u22120.25 J (3.7 % of the sum" in words([line])[0]
    del columns["integration_error [J]"]
    assert "[measures] energy = true" in words(sections.energy_budget(History("h", columns)))[0]


def test_loads_of_walls_are_means_of_the_second_half():
    columns = {"time [s]": np.arange(5.0)}
    for name in (*(f"force {axis} [N]" for axis in "xyz"), *(f"torque {axis} [N m]" for axis in "xyz"), "power [W]"):
        columns[f"lid {name}"] = np.zeros(5)
    columns["lid force z [N]"] = np.array([0.0, -90.0, 3.0, 4.0, 5.0])
    table, _ = sections.wall_loads(History("h", columns), ["lid", "floor"])
    head, line = rows(table)
    assert line[0] == "lid" and line[head.index("force z [N]")] == "4 \u00b1 0.82" and line[-1] == "90"
    assert sections.wall_loads(History("h", columns), []) == []


def test_the_scene_is_in_tables_and_whole():
    given = {
        "materials": {"glass": {"density": 2500.0}},
        "walls": [{"name": "lid", "material": "glass", "mesh": "lid.stl", "prim": "", "open": False, "motion": None}],
        "gravity": [0, 0, -9.81],
    }
    found = sections.scene({"scene_data": given})
    assert rows(found[0])[1:] == [["glass", "2500"]]
    assert rows(found[1]) == [["name", "material", "mesh"], ["lid", "glass", "lid.stl"]]
    assert json.loads(found[-1].find("pre").text) == given
    assert "its hash is abc" in words(sections.scene({"scene_data": "left out", "scene_hash": "abc"}))[0]


def test_of_pairs_the_coefficients_that_the_laws_read_are_shown_with_units():
    pair = {"materials": ["glass", "steel"], "restitution": 0.5, "stiffness": 1e3, "tail_length": 0.0, "friction": 0.0}
    record = {"scene_data": {"pairs": [pair]}, "pair_keys": {"restitution": "-", "stiffness": "N/m"}}
    head, line = rows(sections.scene(record)[0])
    assert head == ["materials", "restitution [-]", "stiffness [N/m]"] and line == ["glass and steel", "0.5", "1000"]


def test_overview_leaves_out_what_is_not_known():
    seconds = {"steps": 6e-4, "lists": 3e-4, "refresh": 1e-4, "output": 1.0, "total": 3.0}
    [node] = sections.overview({"time": 2.0, "steps": 100, "grains": 10, "seconds": seconds})
    found = {item[0].text: item[1].text for item in node}
    assert found == {"simulated": "2 s", "grains at the end": "10", "time steps": "100", "wall time": "3 s",
                     "speed": "10 us per step"}  # fmt: skip
    [node] = sections.overview({"steps": 100, "grains": 1000, "seconds": seconds})
    assert node[-1][1].text == "10 ns per grain and step"
    assert not list(sections.overview({})[0])


def test_what_was_run_and_left_out():
    runs, left = sections.plan({"plan": ["runs      normal: hertz", "left out  rolling: mu_r is zero"]})
    assert [item.text for item in runs] == ["normal: hertz"]
    assert [item.text for item in left.iter("li")] == ["rolling: mu_r is zero"]


def test_flows_and_timings():
    inserted = [{"grains": 7, "mass": 0.7}, {"name": "feed", "grains": 1, "mass": 0.1}]
    record = {"left": {"hole": {"grains": 5, "mass": 0.5}}, "came": inserted,
              "seconds": {"steps": 2.0, "lists": 3.0, "picture": 1e-4, "total": 9.0}}  # fmt: skip
    left, came = sections.flows(record)
    assert rows(left)[1:] == [["hole", "5", "0.5"]]
    assert rows(came)[1:] == [["stream 0", "7", "0.7"], ["stream \u201cfeed\u201d", "1", "0.1"]]
    assert rows(sections.timings(record)[0])[1:] == [["lists", "3"], ["steps", "2"]]
