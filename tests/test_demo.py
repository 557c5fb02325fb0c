"""The gallery as it is installed: listed, copied with its files, and run by one command."""

import io
import json
import re
import shlex
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from rich.console import Console

from warpdem import Simulation, load_demo, load_scene
from warpdem.app import cli, demo, scene_warnings
from warpdem.errors import OutputError, SceneError
from warpdem.output.history import history_columns
from warpdem.sweep.quantities import Quantity

pytestmark = pytest.mark.filterwarnings("ignore:Cyclopts application invoked without tokens")

SCENES = Path(__file__).resolve().parent.parent / "scenes"


@pytest.fixture
def warpdem(tmp_path, monkeypatch, capfd):
    """Run the command in a new folder, in this process; returns exit code, stdout, stderr."""
    monkeypatch.chdir(tmp_path)

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["warpdem", *arguments])
        capfd.readouterr()
        code = 0
        try:
            cli.main()
        except SystemExit as stop:
            code = stop.code or 0
        return code, *capfd.readouterr()

    return call


def test_gallery_holds_every_scene_with_all_it_must_say():
    found = demo.gallery()
    assert list(found) == sorted(path.stem for path in SCENES.glob("*.toml"))
    for scene in found.values():
        assert all((scene.about, scene.shown, scene.outcome, scene.seen, scene.takes)), scene.name
        loaded, measure = load_scene(scene.file), Quantity(scene.measure)
        measure.check([column.header for column in history_columns(loaded)])
        assert all(float(start) < loaded.time.end for start in re.findall(r"@([\d.]+):", scene.measure)), scene.name


def test_parts_of_a_header_end_where_the_next_begins(tmp_path):
    file = tmp_path / "one.toml"
    file.write_text(
        "# A ball\n# falls.\n#\n# Shown: gravity, at 1 m:\n# a fall.\n# Must come out, with e = 1: a bounce.\n"
        "# Seen in: history.csv:\n#   centre_z.\n"
        "# Measure: centre_z:mean@1:\n# Takes: 1 s.\n#\n# More.\ntitle = 'x'\n# Shown: not this\n"
    )
    assert demo.described(file) == demo.Demo(
        "one", file, "A ball falls.", "gravity, at 1 m: a fall.", "a bounce.", "history.csv: centre_z.", "centre_z:mean@1:",
        "1 s",
    )


def test_header_without_a_part_is_refused(tmp_path):
    file = tmp_path / "one.toml"
    file.write_text("# A ball.\n#\n# Shown: gravity.\n# Must come out: a bounce.\n"
                    "# Seen in: it.\n# Measure: x:last\ntitle = 'x'\n")
    with pytest.raises(SceneError, match=r'one\.toml: its first comment has no part "Takes: \.\.\."'):
        demo.described(file)


def test_list_names_each_scene_with_a_sentence_and_its_time():
    console = Console(width=90, record=True, file=io.StringIO())
    demo.print_gallery(console)
    text = console.export_text()
    words = " ".join(text.split())
    for scene in demo.gallery().values():
        assert f"\n{scene.name} " in f"\n{text}" and f"{scene.about} ({scene.takes})" in words
        assert scene.outcome not in words
    assert max(map(len, text.splitlines())) <= 90
    assert "…" not in text


def test_a_scene_tells_of_itself_and_is_not_copied(warpdem, tmp_path):
    code, out, error = warpdem("demo", "pile", "--about")
    assert code == 0, error
    for words in ("pile: Grains are poured on a floor and pile up.", "Must come out: a cone that stands", "Takes: 40 s."):
        assert words in out
    assert not list(tmp_path.iterdir())
    assert "did you mean" in warpdem("demo", "piel", "--about")[2]


def test_scene_of_the_gallery_is_loaded_by_its_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert load_demo("hopper", ["time.end=0.25"]).time.end == 0.25
    assert load_demo("hopper").walls[0].mesh == "meshes/hopper.stl"
    with pytest.raises(SceneError, match=r'demo "hoper": there is no such scene; did you mean "hopper"\?'):
        load_demo("hoper")


@pytest.mark.slow
@pytest.mark.parametrize("name", demo.gallery())
def test_scene_that_check_warns_of_says_why(name):
    """Each warning is of the time step or of overlaps; the first comment has a word on it."""
    file = demo.gallery()[name].file
    warned = scene_warnings.warnings(Simulation(load_scene(file), device="cpu"))
    comment = re.match(r"(?:#.*\n)*", file.read_text(encoding="utf-8"))[0]
    assert ("warpdem check warns" in comment) is bool(warned), warned


def test_copy_takes_the_scene_and_the_meshes_it_names(tmp_path):
    file = demo.copy("hopper", tmp_path / "here")
    assert file == tmp_path / "here" / "hopper.toml"
    held = {path.relative_to(tmp_path / "here").as_posix() for path in (tmp_path / "here").rglob("*") if path.is_file()}
    assert held == {"hopper.toml", "meshes/hopper.stl"}
    assert file.read_bytes() == (SCENES / "hopper.toml").read_bytes()


def test_copy_overwrites_nothing_and_knows_its_scenes(tmp_path):
    folder = tmp_path / "mine"
    folder.mkdir()
    with pytest.raises(SceneError, match=r"--out .*mine: is there already; take another folder$"):
        demo.copy("disk", folder)
    (folder / "disk.toml").write_text("mine")
    with pytest.raises(SceneError, match=r"or run what is there: warpdem run \S*mine/disk\.toml --out \S*mine/results$"):
        demo.copy("disk", folder)
    (folder / "results").mkdir()
    (folder / "results" / "checkpoint.h5").touch()
    with pytest.raises(SceneError, match=r"or go on with what is there: warpdem run \S* --out \S*mine/results --resume$"):
        demo.copy("disk", folder)
    assert (folder / "disk.toml").read_text() == "mine"
    with pytest.raises(SceneError, match=r'demo "hoper": there is no such scene; did you mean "hopper"\?'):
        demo.copy("hoper", tmp_path / "other")
    with pytest.raises(SceneError, match=r'demo "\.\./x": there is no such scene; there are ball_mill, belt, bouncing'):
        demo.copy("../x", tmp_path / "other")
    assert not (tmp_path / "other").exists()
    with pytest.raises(OutputError, match=r"--out .*: cannot be written \(Not a directory\)"):
        demo.copy("disk", folder / "disk.toml" / "below")


def test_of_two_copies_at_once_one_is_made(tmp_path):
    def copy(_) -> bool:
        try:
            return bool(demo.copy("disk", tmp_path / "mine"))
        except SceneError as error:
            assert "is there already" in str(error)
            return False

    with ThreadPoolExecutor(4) as pool:
        assert sorted(pool.map(copy, range(4))) == [False] * 3 + [True]


def test_command_copies_and_runs(warpdem, tmp_path):
    code, out, error = warpdem("demo", "two_spheres", "--until", "1e-4", "--no-picture")
    assert code == 0, error
    as_it_is = "of the scene as it is (this run was another: --set, --until or --precision)"
    assert f"must come out {as_it_is}: momentum and angular momentum kept" in " ".join(out.split())
    results = tmp_path / "two_spheres" / "results"
    assert json.loads((results / "run.json").read_text())["status"] == "done"
    assert not (results / "picture.png").exists()
    code, _, error = warpdem("demo", "two_spheres")
    assert code == 2
    command = error.split("go on with what is there: warpdem ")[1]
    assert warpdem(*shlex.split(command), "--until", "2e-4", "--no-picture")[0] == 0
    assert json.loads((results / "run.json").read_text())["time"] == pytest.approx(2e-4, rel=1e-2)


def test_what_must_come_out_is_said_of_the_scene_as_it_is():
    told = {}
    for changed in (False, True):
        console = Console(width=500, file=io.StringIO())
        demo.print_outcome(SCENES / "two_spheres.toml", changed, console)
        told[changed] = console.file.getvalue()
    assert told[False].startswith("must come out: momentum")
    assert f"\nwhat came out is seen in {SCENES / 'results'}: the last frame" in told[False]
    assert told[True].startswith("must come out of the scene as it is (this run was another: ")
