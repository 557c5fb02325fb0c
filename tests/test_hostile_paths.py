"""Paths that lead nowhere and options beyond all measure, on the command line: each ends in a message."""

import os
import sys
from pathlib import Path

import pytest

from hostile import GRAIN, HEAD, refused
from warpdem import Scene
from warpdem.app import cli

pytestmark = pytest.mark.filterwarnings("error", "ignore:Cyclopts application invoked without tokens")


@pytest.fixture
def said_by(monkeypatch, capfd):
    """A function of the arguments of the command that returns exit code and standard error."""

    def call(*arguments: str) -> tuple[int, str]:
        monkeypatch.setattr(sys, "argv", ["warpdem", *arguments])
        code = 0
        try:
            cli.main()
        except SystemExit as end:
            code = end.code or 0
        return code, capfd.readouterr().err

    return call


@pytest.fixture
def strange(tmp_path) -> dict[str, str]:
    """Paths that are no files to read, by kind."""
    os.mkfifo(tmp_path / "pipe.toml")
    (tmp_path / "circle.toml").symlink_to("circle.toml")
    (tmp_path / "folder.toml").mkdir()
    return {
        "pipe": str(tmp_path / "pipe.toml"), "device": "/dev/zero", "folder": str(tmp_path / "folder.toml"),
        "circle": str(tmp_path / "circle.toml"), "long": "x" * 5000, "deep": "a/" * 3000, "home": "~nobody-here/x.toml",
        "bytes": str(tmp_path / os.fsdecode(b"\xff.toml")), "missing": str(tmp_path / "missing.toml"),
        "control": str(tmp_path / "a\x1b[31m.toml"),
    }  # fmt: skip


KINDS = ("pipe", "device", "folder", "circle", "long", "deep", "home", "bytes", "missing", "control")


@pytest.mark.parametrize("kind", KINDS)
def test_paths_that_are_no_scene(strange, said_by, tmp_path, kind):
    for command in (("check",), ("run",), ("convert",)):
        more = (str(tmp_path / "out.usda"),) if command == ("convert",) else ()
        code, error = said_by(*command, strange[kind], *more)
        assert code == 2, error
        assert 1 <= len(error.strip().splitlines()) <= 3 and "Traceback" not in error and "\x1b" not in error
    wall = '[[walls]]\nname = "a"\nmaterial = "g"\nmesh = "{}"\n'
    name = strange[kind].replace(".toml", ".stl").encode("unicode_escape").decode()
    if kind in ("pipe", "circle", "folder"):
        Path(strange[kind]).rename(strange[kind].replace(".toml", ".stl"))
    if kind not in ("bytes", "device"):
        assert "walls[0].mesh" in refused(tmp_path, HEAD + GRAIN + wall.format(name.replace("\\x1b", "\\u001b")))


@pytest.mark.parametrize("kind", ("long", "deep"))
def test_paths_that_no_results_can_have(strange, said_by, tmp_path, kind):
    (tmp_path / "scene.toml").write_text(HEAD + GRAIN)
    for arguments in (("run", str(tmp_path / "scene.toml"), "--out"), ("render",), ("render", str(tmp_path), "--out"),
                      ("demo", "pile", "--out"), ("convert", str(tmp_path / "scene.toml"))):  # fmt: skip
        code, error = said_by(*arguments, strange[kind])
        assert code == 2 and "Traceback" not in error, error


@pytest.fixture(scope="module")
def results(tmp_path_factory) -> Path:
    """Results of two frames."""
    from warpdem.app.run import run_scene

    folder = tmp_path_factory.mktemp("results")
    data = {
        "materials": {"[/b]": {"density": 2500, "young_modulus": 1e7, "poisson_ratio": 0.3}},
        "title": "[/bold] [red] \x1b[31m",
        "pairs": [{"materials": ["[/b]", "[/b]"], "restitution": 0.5}],
        "streams": [{"material": "[/b]", "box": {"min": [0, 0, 0], "max": [1, 1, 1]}, "diameter": 0.1, "count_rate": 1e7}],
        "time": {"end": 1e-4, "step": 1e-6},
        "output": {"formats": ["vtk"], "interval": 1e-4},
    }
    run_scene(Scene.model_validate(data), folder, device="cpu", threads=1, picture=False)  # brackets are no markup
    return folder


OPTIONS = {
    "--size 100000 100000": "64 to 8192", "--zoom nan": "above 0", "--height inf": "above 0", "--opacity nan": "0 to 1",
    "--colour-range nan 1": "colour_range", "--time nan": "time nan", "--time 1e300": "go from",
    "--out a.mp4 --fps 1e300": "at most 1000", "--out a.mp4 --fps nan": "at most 1000",
    "--out a.mp4 --speed 1e-300": "pictures", "--out a.mp4 --speed nan": "above 0", "--out a.mp4 --start nan": "no frame",
}  # fmt: skip


@pytest.mark.parametrize("options", OPTIONS)
def test_options_of_pictures_beyond_all_measure(results, said_by, monkeypatch, tmp_path, options):
    monkeypatch.chdir(tmp_path)
    code, error = said_by("render", str(results), *options.split())
    assert code != 0 and "Traceback" not in error
    assert OPTIONS[options] in " ".join(error.split()), error


def test_no_machine_has_a_thousand_million_threads(said_by, tmp_path):
    (tmp_path / "scene.toml").write_text(HEAD + GRAIN)
    code, error = said_by("check", str(tmp_path / "scene.toml"), "--device", "cpu", "--threads", "1000000000")
    assert code == 2 and "threads = 1000000000" in error and "1024" in error
