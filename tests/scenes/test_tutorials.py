"""The pages for people who begin: their scenes are read, their programs run, the keys, models and commands they name exist."""

import dataclasses
import inspect
import re
from pathlib import Path

import pytest

from warpdem import Scene, Simulation, load_scene
from warpdem.app import cli
from warpdem.app.cli_options import AccuracyOptions
from warpdem.calibration.experiments import Experiments, How
from warpdem.calibration.file import load_calibration
from warpdem.scene.models import model_names

ROOT = Path(__file__).resolve().parents[2]
TUTORIAL, COMING_FROM = (ROOT / "scenes" / name for name in ("TUTORIAL.md", "COMING_FROM.md"))


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


@pytest.mark.parametrize("page", [TUTORIAL, COMING_FROM], ids=lambda page: page.stem)
def test_commands_and_options_that_a_page_names_exist(page):
    text = page.read_text(encoding="utf-8")
    commands = cli.COMMANDS
    named = re.findall(r"(?:^ {4}|`)warpdem (\w+)([^`\n]*)", text, re.MULTILINE)
    assert len(named) > 3
    for command, rest in named:
        there = {name.strip("_").replace("_", "-") for name in inspect.signature(commands[command]).parameters}
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
