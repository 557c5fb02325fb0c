"""The pages for people who begin: their scenes are read, their programs run, the keys, models and commands they name exist."""

import csv
import dataclasses
import inspect
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from warpdem import Scene, SceneError, Simulation, load_scene
from warpdem.app import cli
from warpdem.app.cli_options import AccuracyOptions
from warpdem.calibration.experiments import Experiments, How
from warpdem.calibration.file import load_calibration
from warpdem.scene.models import model_names

ROOT = Path(__file__).resolve().parents[2]
TUTORIAL, COMING_FROM, LAW, CLUSTER = (
    ROOT / "scenes" / name for name in ("TUTORIAL.md", "COMING_FROM.md", "CONTACT_LAW.md", "CLUSTER.md")
)


def blocks(page, language):
    return re.findall(rf"```{language}\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with the mesh that the tutorial makes."""
    monkeypatch.chdir(tmp_path)
    exec(blocks(TUTORIAL, "python")[0], {})
    return tmp_path


def test_the_tutorial_can_be_run(folder):
    text, wanted = blocks(TUTORIAL, "toml")
    (folder / "drum.toml").write_text(text)
    (folder / "glass.toml").write_text(wanted)
    Experiments(load_calibration(folder / "glass.toml"), folder / "glass.toml", folder / "out", How()).check()
    sim = Simulation(load_scene("drum.toml"), device="cpu", threads=1)
    assert len(sim.state) == 600
    sim.step(3)
    assert "drum torque z [N m]" in sim.history and "integration_error [J]" in sim.history


def commands(page):
    """The commands of a page as lists of words, those that go over two lines too."""
    text = page.read_text(encoding="utf-8").replace("\\\n", " ")
    return [shlex.split(line) for line in re.findall(r"^ {4}warpdem (.*)$", text, re.MULTILINE)]


def ran(words):
    """Run a command of warpdem to its end; what it printed."""
    done = subprocess.run([sys.executable, "-m", "warpdem", *words], capture_output=True, text=True, timeout=900, check=False)
    assert done.returncode == 0, (words, done.stdout, done.stderr)
    return done.stdout


def test_the_contact_law_of_the_page_keeps_its_energy_and_its_commands_run(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    law, program = blocks(LAW, "python")
    (tmp_path / "hardening.py").write_text(law)
    (tmp_path / "pair.toml").write_text(blocks(LAW, "toml")[0])
    exec(program, {})  # it holds the law to its formula
    assert capsys.readouterr().out.strip() in LAW.read_text(encoding="utf-8")
    check, run, sweep = commands(LAW)
    assert "hardening.py" in ran([*check, "--json", "--no-probe"])
    with pytest.raises(SceneError, match=r"hardening_depth = 0\n +must be > 0 \[m\]"):
        load_scene("pair.toml", ["pairs.0.hardening_depth=0"], plugins=["hardening.py"])
    ran(run)
    ran(sweep)
    soft, hard = (float(row["run.extremes.pair_overlap_share"]) for row in rows_of("depths/sweep.csv")[::-1])
    assert 1.1 * hard < soft


def rows_of(file):
    with Path(file).open(encoding="utf-8", newline="") as text:
        return list(csv.DictReader(text))


@pytest.mark.slow
def test_what_the_page_on_clusters_says_of_one_machine_is_so(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    demo, check, one, two, sweep, slurm, *rest = commands(CLUSTER)
    assert "--ranks" in two and "slurm" in slurm and not rest
    ran(demo)
    assert "ghosts" in ran(check)
    ran(one)
    ran(sweep)
    assert [row["status"] for row in rows_of("friction/sweep.csv")] == ["done", "done"]
    pytest.importorskip("mpi4py")
    if shutil.which("mpiexec") is None:
        pytest.skip("no mpiexec")
    ran(two)
    first, second = (json.loads(Path(name, "run.json").read_text())["state_hash"] for name in ("one", "two"))
    assert first == second and Path("one/history.csv").read_bytes() == Path("two/history.csv").read_bytes()


def test_the_job_script_is_one_and_goes_on_where_there_is_a_checkpoint(tmp_path):
    """With stand-ins for what only a cluster has."""
    [script] = blocks(CLUSTER, "bash")
    (tmp_path / "job.sh").write_text(script.replace("source ~/warpdem/.venv/bin/activate", "module() { :; }").replace(
        "module load", "true"))  # fmt: skip
    bin_ = tmp_path / "bin"
    bin_.mkdir()
    (bin_ / "srun").write_text('#!/bin/sh\necho "$@"\n')
    (bin_ / "srun").chmod(0o755)

    def job():
        path = {"PATH": f"{bin_}:{os.environ['PATH']}", "HOME": str(tmp_path)}
        done = subprocess.run(["bash", "job.sh"], cwd=tmp_path, env=path, capture_output=True, text=True, check=True)
        return done.stdout.split()

    first = job()
    assert first[:4] == ["warpdem", "run", "scene.toml", "--out"] and "--resume" not in first
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "checkpoint.h5").touch()
    assert job() == [*first, "--resume"]
    there = {name.strip("_").replace("_", "-") for name in inspect.signature(cli.COMMANDS["run"]).parameters}
    assert {word[2:] for word in job() if word.startswith("--")} <= there | {"no-picture"}


def test_the_scene_beside_the_script_is_that_of_the_script(folder):
    """Numbers of the script, read by words."""
    [text] = blocks(COMING_FROM, "toml")
    (folder / "drum.toml").write_text(text)
    scene = load_scene("drum.toml")
    [script] = re.findall(r"```\n(units.*?)```", COMING_FROM.read_text(encoding="utf-8"), re.DOTALL)

    def numbers(name):
        return [float(x) for x in re.search(rf"{name} peratomtype\w* (.*)", script)[1].split()]

    assert numbers("youngsModulus") == [m.young_modulus for m in scene.materials.values()]
    assert numbers("poissonsRatio") == [m.poisson_ratio for m in scene.materials.values()]
    for name, key in (("Restitution", "restitution"), ("Friction", "friction"), ("RollingFriction", "rolling_friction")):
        count, first, second, third, _ = numbers(f"coefficient{name}")
        assert count == 2 and second == third
        assert [first, second] == [getattr(pair, key) for pair in scene.pairs]
    period = float(re.search(r"period ([\d.]+)", script)[1])
    assert scene.walls[0].motion[0].rate * period == pytest.approx(2 * 3.141592653589793)


@pytest.mark.parametrize("page", [TUTORIAL, COMING_FROM, LAW, CLUSTER], ids=lambda page: page.stem)
def test_commands_and_options_that_a_page_names_exist(page):
    text = page.read_text(encoding="utf-8")
    commands = cli.COMMANDS
    named = re.findall(r"(?:^ {4}|`)warpdem (\w+)([^`\n]*)", text, re.MULTILINE)
    assert len(named) > 3
    for command, rest in named:
        there = {name.strip("_").replace("_", "-") for name in inspect.signature(commands[command]).parameters}
        there |= {f"no-{name}" for name in there & {"picture", "probe"}}
        if command in ("run", "check"):
            there |= {field.name for field in dataclasses.fields(AccuracyOptions)}
        assert {option for option in re.findall(r"--([a-z][a-z-]*)", rest)} <= there, (command, rest)


def test_models_and_tables_that_the_page_names_exist():
    text = COMING_FROM.read_text(encoding="utf-8")
    tables = text.split("## LIGGGHTS\n")[1]
    roles = ("normal", "tangential", "rolling", "twisting")
    known = {name for role in roles for name in model_names(role)} | {"none", "auto", "impact"}
    named = set(re.findall(r'"([a-z_]+)"', tables))
    assert {"hertz_clamped", "sjkr", "jkr", "dmt", "edinburgh", "spring", "marshall", "mindlin"} <= named <= known
    roots = {re.split(r"[.]", name)[0] for name in re.findall(r"`\[+([a-z.A-Z]+)\]+`", tables)}
    assert {"materials", "pairs", "streams", "outlets", "borders", "clumps", "measures", "walls"} <= roots
    assert roots <= set(Scene.model_fields)
