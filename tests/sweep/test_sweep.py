"""A sweep: order, ends of every kind, going on, the table; with a stand-in for the runs, and with runs that are killed."""

import csv
import json
import os
import random
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from scene_text import TWO_FALLING
from warpdem import SceneError, WarpdemError
from warpdem.app import cli
from warpdem.app.sweep import rows_of
from warpdem.core.run_lock import locked
from warpdem.sweep import worker
from warpdem.sweep.executors import LIBRARIES, executor, require
from warpdem.sweep.quantities import Quantity
from warpdem.sweep.sweep import RowsFailed, Sweep, run_sweep
from warpdem.sweep.worker import Task, run_row

STAND_IN = Path(__file__).resolve().parents[1] / "helpers" / "stand_in.py"


@pytest.fixture
def scene(tmp_path):
    (tmp_path / "s.toml").write_text(TWO_FALLING)
    return tmp_path / "s.toml"


@pytest.fixture
def stand_in(monkeypatch):
    monkeypatch.setattr(worker, "COMMAND", (sys.executable, str(STAND_IN)))
    monkeypatch.setattr(worker, "WAIT", 0.05)


def made(scene, *titles, results=("kinetic:last",)):
    rows = [{"title": title, "note": f"n{k}"} for k, title in enumerate(titles)]
    return Sweep(scene, scene.parent / "sw", rows, [Quantity(text) for text in results])


def table(sweep):
    with (sweep.folder / "sweep.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def calls(sweep, number):
    path = sweep.folder / f"{number:04d}" / "calls"
    return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []


def test_rows_are_run_and_their_results_are_in_the_table(scene, stand_in):
    sweep = made(scene, "ok", "ok", "ok")
    outcomes = run_sweep(sweep, workers=2, threads=3, precision="mixed")
    assert [one.status for one in outcomes] == ["done"] * 3
    rows = table(sweep)
    assert [row["kinetic:last"] for row in rows] == ["1.0", "2.0", "3.0"]
    assert [row["note"] for row in rows] == ["n0", "n1", "n2"]
    assert rows[0]["state_hash"] == "hash 0001" and rows[0]["wall_time [s]"] == "1.500" and rows[0]["status"] == "done"
    [[_, _, words]] = calls(sweep, 1)
    assert words[0] == str(scene) and {"--quiet", "--no-picture", "--overwrite"} <= set(words)
    assert words[words.index("--threads") + 1] == "3" and words[words.index("--precision") + 1] == "mixed"
    assert words[words.index("--set") + 1 :][:1] == ["title=ok"]


def test_the_first_row_compiles_alone_and_then_as_many_run_as_there_are_workers(scene, stand_in):
    sweep = made(scene, *["slow"] * 5)
    run_sweep(sweep, workers=2)
    times = [calls(sweep, number)[0][:2] for number in range(1, 6)]
    assert times[1][0] >= times[0][0] + 0.2  # its kernels are there
    assert times[1][0] < times[0][1]  # it still runs
    for now, _ in times:
        assert sum(begin <= now < end for begin, end in times) <= 2
    assert max(end for _, end in times) - times[0][0] < 5 * 0.7


def test_what_fails_takes_nothing_with_it_and_the_same_call_goes_on(scene, stand_in):
    sweep = made(scene, "ok", "crash", "stop", "wrong", "ok")
    outcomes = run_sweep(sweep, workers=2)
    assert [one.status for one in outcomes] == ["done", "crashed", "stopped itself", "wrong", "done"]
    assert [one.why for one in outcomes] == ["", "killed by signal 9.", "error: stopped", "error: grains overlap", ""]
    assert table(sweep)[1]["kinetic:last"] == ""
    outcomes = run_sweep(sweep, workers=2)
    assert [one.status for one in outcomes] == ["done", "done", "stopped itself", "wrong", "done"]
    assert [len(calls(sweep, number)) for number in range(1, 6)] == [1, 2, 1, 1, 1]
    assert "--resume" in calls(sweep, 2)[1][2] and "--overwrite" not in calls(sweep, 2)[1][2]


def test_wrong_rows_are_told_before_anything_is_run(scene, stand_in):
    sweep = made(scene, "ok", "ok")
    sweep.rows[1]["pairs.0.restitution"] = "2"
    told = r"(?s)1 of 2 rows are wrong, and nothing was run.*--skip-wrong:\nrow 2: .*restitution"
    with pytest.raises(SceneError, match=told):
        run_sweep(sweep)
    assert not sweep.folder.exists()
    outcomes = run_sweep(sweep, skip_wrong=True)
    assert [one.status for one in outcomes] == ["done", "wrong"] and "restitution" in outcomes[1].why
    assert table(sweep)[1]["status"] == "wrong" and not calls(sweep, 2)
    sweep.rows[0]["pairs.0.restitution"] = "2"
    with pytest.raises(SceneError, match="2 of 2 rows are wrong"):
        run_sweep(sweep, skip_wrong=True)


def test_a_result_that_is_no_column_is_told_before_anything_is_run(scene, stand_in):
    with pytest.raises(SceneError, match='did you mean "kinetic"'):
        run_sweep(made(scene, "ok", results=["kinetik:last"]))


def test_a_folder_of_another_sweep_is_refused_and_rows_may_be_added(scene, stand_in):
    run_sweep(made(scene, "ok"))
    with pytest.raises(SceneError, match="holds another sweep, of .* with 1 rows; take another one"):
        run_sweep(made(scene, "slow"))
    more = made(scene, "ok", "ok", results=["kinetic:first"])
    run_sweep(more)
    assert [row["kinetic:first"] for row in table(more)] == ["1.0", "1.0"] and len(calls(more, 1)) == 1
    with pytest.raises(SceneError, match="holds another sweep"):
        run_sweep(made(scene, "ok"))
    (more.folder / "sweep.json").write_text("{}")
    with pytest.raises(SceneError, match=r"sweep\.json: cannot be read as that of a sweep"):
        run_sweep(more)


def test_two_sweeps_do_not_run_in_one_folder(scene, stand_in):
    sweep = made(scene, "ok")
    with locked(sweep.folder), pytest.raises(SceneError, match="another run"):
        run_sweep(sweep)


def test_a_row_that_another_process_writes_is_waited_for(scene, stand_in, tmp_path):
    folder = tmp_path / "0001"
    task = Task(1, str(folder), (str(scene), "--out", str(folder), "--set", "title=ok"), None)
    done = []
    with locked(folder):
        thread = threading.Thread(target=lambda: done.append(run_row(task)))
        thread.start()
        time.sleep(0.4)
        assert not (folder / "calls").exists()
    thread.join(20)
    assert done == [0] and (folder / "calls").exists()


def test_an_interrupt_ends_the_rows_that_run(scene, stand_in):
    sweep = made(scene, "slow", "slow", "slow")

    def interrupt(outcomes):
        if any(one.status == "done" for one in outcomes):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_sweep(sweep, workers=2, watch=interrupt)
    assert [len(calls(sweep, number)) for number in (1, 2, 3)] in ([1, 1, 0], [1, 1, 1])
    assert calls(sweep, 2)[0][1] == 0.0  # it was ended
    assert [one.status for one in run_sweep(sweep, workers=2)] == ["done"] * 3


def test_workers_share_gpus(scene, stand_in, monkeypatch):
    monkeypatch.setattr("warpdem.sweep.sweep._gpus", lambda: 2)
    sweep = made(scene, "slow", "slow", "slow", "slow")
    run_sweep(sweep, workers=4, device="cuda")
    words = [calls(sweep, number)[0][2] for number in range(1, 5)]
    assert sorted(w[w.index("--device") + 1] for w in words) == ["cuda:0", "cuda:0", "cuda:1", "cuda:1"]


@pytest.mark.parametrize("kind", LIBRARIES)
def test_a_library_that_is_missing_is_told(kind, monkeypatch):
    for name in [LIBRARIES[kind][0], *[m for m in sys.modules if m.split(".")[0] == LIBRARIES[kind][0].split(".")[0]]]:
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(SceneError, match=f"--on {kind}: needs the package {LIBRARIES[kind][1]}: pip install"):
        require(kind)
    with pytest.raises(SceneError, match="--on cloud: is unknown; allowed are local, mpi, dask, slurm"):
        require("cloud")


def test_workers_that_mpich_would_have_to_start_are_refused(tmp_path):
    """MPICH starts them only where mpiexec has started the sweep; what all executors give: ``test_executors``."""
    mpi = pytest.importorskip("mpi4py.MPI", reason="mpi4py is not installed")
    if "MPICH" not in mpi.Get_library_version():
        pytest.skip("another MPI, which starts workers itself")
    with pytest.raises(SceneError, match="MPICH starts workers only"), executor("mpi", 1, 1, tmp_path, 0):
        pass


def test_rows_come_from_one_place():
    with pytest.raises(SceneError, match="give exactly one of TABLE, --grid and --sample, not none"):
        rows_of(None, [], [], None, 0)
    with pytest.raises(SceneError, match="not --grid and --sample"):
        rows_of(None, ["time.end=1"], ["time.end=1:2"], 3, 0)
    with pytest.raises(SceneError, match="give --count"):
        rows_of(None, [], ["time.end=1:2"], None, 0)
    with pytest.raises(SceneError, match="--count: belongs to --sample"):
        rows_of(None, ["time.end=1"], [], 3, 0)
    assert len(rows_of(None, [], ["time.end=1:2"], 3, 0)) == 3


def test_the_command_tells_of_rows_that_failed_and_writes_a_page(scene, stand_in, capsys):
    folder = scene.parent / "sw"
    arguments = ["sweep", str(scene), "--grid", "title=ok,stop,ok", "--results", "kinetic:last", "--out", str(folder)]
    with pytest.raises(RowsFailed, match="(?s)1 of 3 rows are not done.*row 2: stopped itself: error: stopped") as error:
        cli.app([*arguments, "--workers", "2"], result_action="return_value")
    assert isinstance(error.value, WarpdemError) and error.value.exit_code == 3
    page = (folder / "sweep.html").read_text()
    assert "2 of 3 rows are done." in page and 'href="0001/"' in page
    assert "3 rows of" in capsys.readouterr().out


def killed_until_done(command, folder, kills, rows):
    """Run a command; kill its process group, each time with the rows that run, somewhere in an equal share of the rows."""
    draw = random.Random(rows)
    for kill in range(kills):
        process = subprocess.Popen(command, start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        begun = rows * (kill + draw.random()) / kills
        while len(list(folder.glob("*/run.json"))) < begun:  # whatever the load of the machine
            assert process.poll() is None, "it has ended before it was killed"
            time.sleep(0.05)
        time.sleep(draw.uniform(0.0, 1.0))
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    return subprocess.run(command, capture_output=True, text=True, timeout=3600, check=False)


@pytest.mark.parametrize(("rows", "kills"), [(3, 2), pytest.param(24, 3, marks=pytest.mark.slow)])
def test_a_sweep_that_was_killed_gives_the_table_of_one_that_was_not(scene, tmp_path, rows, kills):
    values = ",".join(f"{0.05 + 0.03 * k:.2f}" for k in range(rows))
    tables = []
    for name, times in (("whole", 0), ("killed", kills)):
        folder = tmp_path / name
        command = [sys.executable, "-P", "-m", "warpdem", "sweep", str(scene), "--grid", f"pairs.0.friction={values}", "--out",
                   str(folder), "--workers", "2", "--threads", "1", "--device", "cpu", "--quiet"]  # fmt: skip
        done = killed_until_done(command, folder, times, rows)
        assert done.returncode == 0, done.stderr
        with (folder / "sweep.csv").open(newline="") as file:
            tables.append([{k: v for k, v in row.items() if k != "wall_time [s]"} for row in csv.DictReader(file)])
    assert tables[0] == tables[1] and len(tables[0]) == rows
    assert len({row["state_hash"] for row in tables[0]}) == rows and {row["status"] for row in tables[0]} == {"done"}
