"""The benchmark on a tiny bed made here, and the reading of the peer's output."""

import json
from pathlib import Path

import numpy as np
import pytest

from bench import liggghts, size_picture, speed, states, window

# LIGGGHTS-PUBLIC 3.8.0, a run of the deck on 5000 grains: 5 warm-up steps, 30 timed ones, contacts counted; shortened
PEER_OUTPUT = """\
LIGGGHTS (Version LIGGGHTS-PUBLIC 3.8.0, compiled 2022-01-26-19:42:32 by buildd, git commit unknown)
    Step    Atoms         KinEng
       0     5000  1.1501373e-07
       5     5000  1.1543377e-07
Loop time of 0.00875376 on 1 procs for 5 steps with 5000 atoms, finish time Sun Nov 22 02:56:58 2026


Pair  time (%) = 0.00556304 (63.5502)
Neigh time (%) = 0 (0)
Other time (%) = 0.00316036 (36.1029)

Neighbor list builds = 0
Dangerous builds = 0
Setting up run at Sun Nov 22 02:56:58 2026

    Step    Atoms         KinEng
       5     5000  1.1543377e-07
      35     5000  1.1848877e-07
Loop time of 0.0441261 on 1 procs for 30 steps with 5000 atoms, finish time Sun Nov 22 02:56:58 2026


Pair  time (%) = 0.0238296 (54.0034)
Neigh time (%) = 0.0012 (2.719)
Comm  time (%) = 5.019e-06 (0.0113742)
Outpt time (%) = 6.2456e-05 (0.14154)
Other time (%) = 0.020229 (43.1257)

Total # of neighbors = 19337
Ave neighs/atom = 3.8674
Neighbor list builds = 2
Dangerous builds = 0
WARNING: New thermo_style command, previous thermo_modify settings will be lost (./src/output.cpp:725)
Setting up run at Sun Nov 22 02:56:58 2026

    Step    Atoms         KinEng       contacts
      35     5000  1.1848877e-07           5718
Loop time of 3.81e-07 on 1 procs for 0 steps with 5000 atoms, finish time Sun Nov 22 02:56:58 2026
"""


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    return speed.bench(
        grains=[200],
        models=["full", "frictionless"],
        threads=[1, 2],
        settings=states.Settings(warm=1, steps=4, repeats=2),
        work=tmp_path_factory.mktemp("work"),
        settle=20,
        console=speed.Console(quiet=True),
    )


@pytest.mark.slow
def test_bench_reports_every_case(report):
    assert json.loads(json.dumps(report)) == report
    assert {"machine", "versions", "commit", "time", "settings", "cases", "scaling", "models"} <= report.keys()
    cases = {(c["model"], c["threads"]): c for c in report["cases"]}
    assert sorted(cases) == [("frictionless", 1), ("frictionless", 2), ("full", 1), ("full", 2)]
    for case in cases.values():
        ns = case["ns_per_grain_step"]
        assert case["grains"] == 200
        assert len(ns["all"]) == 2 and 0 < ns["min"] <= ns["median"]
        assert 0 <= case["rebuild_share"] < 1
        assert "peer" not in case
    # all windows of a model end in the same state
    assert cases["full", 1]["contacts_per_grain"] == cases["full", 2]["contacts_per_grain"]
    assert cases["full", 1]["wall_contacts"] == cases["full", 2]["wall_contacts"] > 0


@pytest.mark.slow
def test_comparisons_are_ratios_of_the_medians(report):
    ns = {(c["model"], c["threads"]): c["ns_per_grain_step"]["median"] for c in report["cases"]}
    speed_up = {c["model"]: c["speed_up"] for c in report["scaling"]}
    np.testing.assert_allclose(speed_up["full"], ns["full", 1] / ns["full", 2])
    over = {c["threads"]: c["over_frictionless"] for c in report["models"]}
    np.testing.assert_allclose(over[1], ns["full", 1] / ns["frictionless", 1])


def test_time_is_per_grain_and_step_in_nanoseconds():
    found = window.spread([2e-3, 1e-3, 4e-3], grains=100, steps=10)
    np.testing.assert_allclose([found["median"], found["min"]], [2000.0, 1000.0])
    np.testing.assert_allclose(found["all"], [2000.0, 1000.0, 4000.0])


def test_missing_state_is_named_with_what_is_there(tmp_path):
    (tmp_path / "bed_7.npz").touch()
    with pytest.raises(SystemExit, match=r"bed_8\.npz: no such file; there: bed_7\.npz"):
        states.given_bed(8, tmp_path)


def test_ascii_mesh_keeps_the_corners(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    corners = np.array([[[0, 0, 0], [1.2345678e-3, 0, 0], [0, 1 / 3, 0.7]]], dtype=np.float32)
    states.write_ascii_stl(tmp_path / "m.stl", corners)
    read = trimesh.load(tmp_path / "m.stl", force="mesh")
    np.testing.assert_array_equal(read.triangles.astype(np.float32), corners)


def test_output_of_the_peer_is_read():
    assert liggghts.parse(PEER_OUTPUT, 30) == liggghts.Window(
        seconds=0.0441261,
        grains=5000,
        contacts_per_grain=5718 / 5000,
        kinetic=1.1848877e-07,
        rebuilds=2,
        pair_share=pytest.approx(0.540034),
        neighbour_share=pytest.approx(0.02719),
    )


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [("for 30 steps", "for 31 steps", "loop time"), ("       5718", "        nan", "contacts"),
     ("builds = 2", "builds", "rebuilds")],
)  # fmt: skip
def test_incomplete_output_of_the_peer_is_refused(before, after, message):
    with pytest.raises(liggghts.PeerError, match=message):
        liggghts.parse(PEER_OUTPUT.replace(before, after).replace("builds = 0", "builds"), 30)


def test_deck_holds_law_walls_and_steps(tmp_path):
    keys = {"step": 1e-6, "skin": 1e-4, "warm": 5, "steps": 30}
    bed = liggghts.deck(tmp_path / "a.data", states.MATERIAL, "no_rolling", width=0.01, **keys)
    assert bed.count("wall/gran model hertz tangential history primitive") == 5
    assert "xplane 0.01" in bed and "cdt" not in bed
    assert bed.index("run 5\n") < bed.index("run 30\n") < bed.index("compute")
    glass = liggghts.deck(tmp_path / "a.data", states.MATERIAL, "full", mesh=Path("g.stl"), **keys)
    assert "mesh/surface file g.stl" in glass and "primitive" not in glass
    assert glass.count("rolling_friction cdt") == 2


def test_data_file_of_the_peer_holds_diameters_and_motion(tmp_path):
    state = {
        "x": np.array([[0.1, 0.2, 0.3]]),
        "r": np.array([0.05]),
        "v": np.array([[1.0, 2.0, 3.0]]),
        "w": np.array([[4.0, 5.0, 6.0]]),
    }
    liggghts.write_data(tmp_path / "a.data", state, 2500.0, liggghts.domain_of(state, 0.5, None))
    text = (tmp_path / "a.data").read_text()
    atoms, motion = text.split("Atoms")[1].split("Velocities")
    np.testing.assert_allclose(np.fromstring(atoms, sep=" "), [1, 1, 0.1, 2500, 0.1, 0.2, 0.3])
    np.testing.assert_allclose(np.fromstring(motion, sep=" "), [1, 1, 2, 3, 4, 5, 6])
    assert "0 0.5 xlo xhi" in text


def test_the_picture_has_a_curve_of_each_code_model_and_number_of_threads_by_size(tmp_path):
    def case(grains, time, model="full", peer=None, state="bed"):
        row = {"state": f"{state}_{grains}", "grains": grains, "model": model, "threads": 1}
        row["ns_per_grain_step"] = {"median": time}
        return row | ({"peer": {"ns_per_grain_step": {"median": peer}}} if peer else {})

    cases = [case(2000, 70.0, peer=170.0), case(100, 90.0), case(100, 60.0, "frictionless"), case(500, 1.0, state="hourglass")]
    found = size_picture.curves(cases)
    assert found == {
        ("warpdem", "full", 1): ([100, 2000], [90.0, 70.0]), ("peer", "full", 1): ([2000], [170.0]),
        ("warpdem", "frictionless", 1): ([100], [60.0]),
    }  # fmt: skip
    report = {"cases": cases, "versions": {"peer": "liggghts 3.8"}, "machine": {"processor": "some"}}
    size_picture.draw(report | {"settings": {"precision": "double"}}, tmp_path / "sizes.png")
    assert (tmp_path / "sizes.png").read_bytes().startswith(b"\x89PNG")
