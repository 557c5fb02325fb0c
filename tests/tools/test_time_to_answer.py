"""Time to the answer: each case is one for all codes, the readings are right, and equal answers are told from others."""

import dataclasses
import json
import math

import numpy as np
import pytest

import warpdem
from bench import time_to_answer as tool
from bench.answer import cases, compare, own, peer
from bench.liggghts import PeerError
from bench.states import MATERIAL
from dev import meshes


@pytest.fixture(params=["hourglass", "bed", "drum"])
def case(request):
    return cases.cases(5000, short=False)[request.param]


# --- one definition for all codes ------------------------------------------------------------------------------------


def test_walls_are_closed_and_hold_what_they_are_filled_with(case):
    volume = case.width**2 * case.fill["max"][2] if case.shell is None else meshes.check(case.shell)
    grains = case.mass / MATERIAL.density
    assert 0.15 < grains / volume < 0.3  # a bulb of two, a loose cloud, 40 % of a drum


def test_hourglass_is_that_of_the_gallery_with_grains_of_the_paper():
    shell = cases.hourglass_case(5000).shell
    gallery = meshes.hourglass(**meshes.SMALL) * 0.45e-3
    np.testing.assert_allclose(np.ptp(shell, axis=(0, 1)), np.ptp(gallery, axis=(0, 1)), rtol=0.01)


def test_step_of_the_peer_is_that_of_the_paper_and_a_share_of_the_rayleigh_time():
    assert peer.STEPS["paper"] == 1e-6
    assert peer.STEPS["rayleigh"] == pytest.approx(8.97e-7, rel=1e-3)  # 15 % of 5.98e-6 s, by hand
    short = cases.bed_case(100, cases.LARGER)
    assert tool.peer_step(short, "rayleigh") == pytest.approx(0.15 * cases.rayleigh_step(cases.LARGER))


def test_deck_and_scene_say_the_same(case, tmp_path):
    shell = None if case.shell is None else tmp_path / "shell.stl"
    text = peer.deck(case, tmp_path / "a.data", shell, tmp_path / "rows.txt", 1e-6, ranks=2)
    scene = cases.scene_tables(case, None if shell is None else str(shell), {"file": "a.npz"}, "auto")
    assert f"gravity {-scene['gravity'][2]:.17g} vector 0 0 -1" in text
    for value in (*scene["materials"]["grain"].values(), *scene["pairs"][0].values()):
        assert isinstance(value, list) or f"{value:.17g}" in text or value == MATERIAL.density  # that is in the data file
    assert text.count("primitive") == sum("plane" in wall for wall in scene["walls"])
    assert ("mesh/surface" in text) == any("mesh" in wall for wall in scene["walls"])
    runs = [int(line.split()[1]) for line in text.splitlines() if line.startswith("run ")]
    assert sum(runs) == round(scene["time"]["end"] / 1e-6)
    assert "processors 1 2 1" in text
    if case.rate:
        turn, rest = scene["frame"]["schedule"]
        assert f"period {2.0 * math.pi / turn['rate']:.17g}" in text
        assert runs[1] == round(turn["until"] / 1e-6) and rest == {"rate": 0.0}
        assert turn["rate"] * turn["until"] == pytest.approx(math.pi)
    else:
        assert "frame" not in scene and "move/mesh" not in text


def test_domain_holds_a_turned_shell(case):
    low, high = peer.domain(case, {"x": np.array([[0.0, 0.0, 0.01]])})
    if case.shell is None:
        np.testing.assert_allclose([low[:2], high[:2]], [[0.0, 0.0], [case.width] * 2])
        return
    corners = case.shell.reshape(-1, 3)
    for angle in np.linspace(0.0, np.pi, 7):
        c, s = np.cos(angle), np.sin(angle)
        turned = corners @ np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])
        assert (turned > low).all() and (turned < high).all()


# --- readings --------------------------------------------------------------------------------------------------------


def test_cloud_falls_as_a_body_does_until_it_meets_the_floor():
    case = cases.bed_case(12, cases.LARGER)
    grains = {"positions": [[0.5 * case.width, 0.5 * case.width, 0.02]], "radius": 2e-3}
    times = np.array([0.0, 0.01, 0.02])
    job = {"scene": cases.scene_tables(case, None, grains, "auto"), "fraction": 1.0, "threads": 1, "times": times.tolist()}
    found = own.work(job | {"only_compile": False})
    time, _, x, z = found["rows"]
    np.testing.assert_allclose(time, times, rtol=0, atol=found["step"])
    np.testing.assert_allclose(z, 0.02 - 0.5 * cases.GRAVITY * np.array(time) ** 2, rtol=1e-9)
    np.testing.assert_allclose(x, 0.5 * case.width)
    quarter = own.work(job | {"only_compile": False, "fraction": 0.25})
    assert quarter["step"] == pytest.approx(0.25 * found["step"])


def test_share_that_has_passed_is_seen_in_the_axes_of_the_glass(tmp_path):
    """Half of the mass above the neck; seen in the laboratory it would change as the glass turns."""
    case = cases.hourglass_case(300, cases.LARGER, rpm=60.0, segments=12)
    from bench.states import write_ascii_stl

    shell = tmp_path / "shell.stl"
    write_ascii_stl(shell, case.shell)
    grains = {"positions": [[0.0, 0.0, 0.02], [0.0, 0.0, -0.02]], "radius": 2e-3, "velocities_in": "laboratory"}
    scene = cases.scene_tables(case, str(shell), grains, "auto") | {"gravity": [0.0, 0.0, 0.0]}
    job = {"scene": scene, "fraction": 1.0, "threads": 1, "times": [0.0, 0.01], "only_compile": False}
    _, passed, x, z = own.work(job)["rows"]
    assert passed == [0.5, 0.5]
    np.testing.assert_allclose([x, z], 0.0, rtol=0, atol=1e-12)


def test_rows_of_the_peer_are_read(tmp_path):
    case = dataclasses.replace(cases.bed_case(10), end=0.002, sample=0.001)
    rows = tmp_path / "rows.txt"
    rows.write_text("rows\n0 0.5 1e-3 3e-3\n0.001 0.5 1e-3 2e-3\n0.001 0.5 1e-3 2e-3\n0.002 0.25 1e-3 1e-3\n")
    text = "Loop time of 1.5 on 1 procs for 1000 steps with 10 atoms\nLoop time of 2.5 on 1 procs for 1000 steps with 9 atoms\n"
    found = peer.read(text, rows, case, 1e-6)
    assert (found.loop, found.steps, found.lost) == (4.0, 2000, 1)
    np.testing.assert_allclose(found.rows.time, [0.0, 0.001, 0.002])
    np.testing.assert_allclose(found.rows.passed, [0.5, 0.5, 0.25])
    np.testing.assert_allclose(case.curve(found.rows), [3.0, 2.0, 1.0])  # [mm]
    rows.write_text(rows.read_text().replace("0.25", "nan"))
    with pytest.raises(PeerError, match="not finite"):
        peer.read(text, rows, case, 1e-6)


# --- answers ---------------------------------------------------------------------------------------------------------


def test_time_of_a_share_is_interpolated():
    time, curve = np.array([0.0, 1.0, 2.0]), np.array([0.0, 0.2, 0.6])
    assert cases.first_time(0.3, time, curve) == pytest.approx(1.25)
    assert math.isnan(cases.first_time(0.7, time, curve))


def test_answers_of_known_curves():
    time = np.linspace(0.0, 1.0, 101)
    still = np.zeros(101)
    glass = cases.hourglass_case(5000)
    found = glass.answers(glass, cases.Rows(time, time**2, still, still))
    np.testing.assert_allclose(list(found.values()), [0.5, 0.5**0.5, 0.75**0.5], rtol=1e-3)
    drum = dataclasses.replace(cases.drum_case(5000), end=1.0)
    found = drum.answers(drum, cases.Rows(time, still, np.full(101, -2e-3), np.full(101, -4e-3)))
    assert found["angle [deg]"] == pytest.approx(math.degrees(math.atan(0.5)))
    assert found["torque [uN m]"] == pytest.approx(1e6 * drum.mass * 9.81 * 2e-3)
    bed = cases.bed_case(5000)
    found = bed.answers(bed, cases.Rows(time, still, still, np.maximum(0.003, 0.013 - 0.02 * time)))
    np.testing.assert_allclose(list(found.values()), [0.25, 0.45, 3.0], rtol=1e-6)


def finished(setting, threads=1, twin=0, late=0.0, wall=10.0, case="hourglass"):
    """A run whose grains pass steadily from ``late`` on."""
    time = np.linspace(0.0, 2.0, 201)
    passed = np.clip(time - 0.5 - late, 0.0, 1.0)
    record = {"rows": [time.tolist(), passed.tolist(), time.tolist(), time.tolist()], "step": 1e-6, "steps": 7, "wall": wall,
              "processor": wall, "loop": wall, "load": 0.0, "lost": 0}  # fmt: skip
    return compare.Done(case, setting, threads, twin, record)


def test_equal_answers_are_told_from_others_by_the_twins():
    case = cases.hourglass_case(5000)
    runs = [finished("paper", late=0.0), finished("paper", 2, late=0.01), finished("auto", late=0.005), finished("auto", 2),
            finished("longest", late=0.1), finished("longest", 2, late=0.11)]  # fmt: skip
    found = compare.compared(case, runs)
    assert found["reference"] == "paper"
    assert found["same"] == {"paper": True, "auto": True, "longest": False}
    half = found["answers"]["longest"]["50% passed [s]"]
    assert half["mean"] == pytest.approx(1.105)
    error = found["answers"]["paper"]["50% passed [s]"]["standard_error"]
    assert half["difference_in_standard_errors"] == pytest.approx(0.1 / error / 2**0.5)
    np.testing.assert_allclose([found["curves"]["longest"], found["twins"]], [0.1, 0.01], rtol=1e-6)


def test_nothing_is_called_the_same_without_twins_or_without_an_answer():
    case = cases.hourglass_case(5000)
    assert compare.compared(case, [finished("paper"), finished("auto")])["same"]["auto"] is None
    never = [finished(s, n, late=1.0 + 0.01 * n) for s in ("paper", "auto") for n in (1, 2)]
    assert compare.compared(case, never)["same"]["auto"] is None


def test_costs_are_the_least_and_over_those_of_the_own_step_on_as_many_threads():
    runs = [finished("auto", wall=9.0), finished("auto", twin=1, wall=8.0), finished("paper", wall=32.0),
            finished("paper", 2, wall=20.0)]  # fmt: skip
    found = {(row["setting"], row["threads"]): row for row in compare.costs(runs)}
    assert found["auto", 1]["wall"] == 8.0 and found["auto", 1]["runs"] == 2
    assert found["paper", 1]["over_own"] == pytest.approx(4.0)
    assert found["paper", 2]["over_own"] is None


# --- the tool --------------------------------------------------------------------------------------------------------


def test_finished_runs_are_kept_and_not_done_again(tmp_path):
    work = tool.Work(tmp_path, 5000, short=False)
    arguments = ["hourglass", "bed"], ["auto", "paper"], [1, 2], 1
    assert len(tool.plan(work, *arguments)) == 8
    work.keep("bed/auto/2/0", finished("auto").record)
    again = tool.Work(tmp_path, 5000, short=False)
    left = tool.plan(again, *arguments)
    assert len(left) == 7 and ("bed", "auto", 2, 0) not in [(job[0].name, *job[1:]) for job in left]
    assert [(run.case, run.setting, run.threads, run.twin) for run in again.done()] == [("bed", "auto", 2, 0)]
    with pytest.raises(SystemExit, match="holds runs of"):
        tool.Work(tmp_path, 300, short=True)


def test_twins_start_a_hair_apart():
    state = {"x": np.zeros((50, 3)), "r": np.full(50, 2e-4)}
    first, second = tool.nudged(state, 0, 1, 0)["x"], tool.nudged(state, 0, 2, 0)["x"]
    np.testing.assert_array_equal(first, tool.nudged(state, 0, 1, 0)["x"])
    assert 0.0 < np.abs(first - second).max() < 1e-8 * 2e-4


def test_without_the_peer_only_warpdem_is_run_and_the_tool_says_how_to_get_it(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(tool.liggghts, "version", lambda: None)
    work = tool.Work(tmp_path, 300, short=True)
    ran = []

    def measured(case, setting, threads, twin, work, console):
        ran.append(setting)
        return finished(setting).record | {"machine": {}}

    monkeypatch.setattr(tool, "measured", measured)
    found = tool.answer(
        names=["hourglass"], settings=["auto", "paper"], threads=[1, 2], twins=1, work=work,
        picture=tmp_path / "p.png", out=tmp_path / "p.json", console=tool.Console(width=150),
    )  # fmt: skip
    assert ran == ["auto", "auto"]
    assert "apt install liggghts" in capsys.readouterr().out
    assert json.loads((tmp_path / "p.json").read_text())["costs"] == found["costs"]
    assert (tmp_path / "p.png").stat().st_size > 5000


@pytest.mark.slow
def test_short_look_runs_in_processes_of_its_own(tmp_path):
    work = tool.Work(tmp_path, 60, short=True)
    work.cases = {name: dataclasses.replace(case, end=0.01, sample=0.001) for name, case in work.cases.items()}
    record = tool.measured(work.cases["bed"], "auto", 1, 0, work, tool.Console(quiet=True))
    assert record["wall"] >= record["loop"] > 0.0 and record["processor"] > 0.0
    assert record["code"] == f"warpdem {warpdem.__version__}"
    assert len(record["rows"]) == 4 and len(record["rows"][0]) == 11
