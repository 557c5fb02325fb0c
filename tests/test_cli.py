"""The command: exit codes, messages in one screen, nothing computed from a wrong scene, interrupt and resume."""

import json
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
from unittest.mock import Mock

import numpy as np
import pytest
import trimesh

from warpdem.app import cli

pytestmark = pytest.mark.filterwarnings("ignore:Cyclopts application invoked without tokens")

SCREEN = 25
"""Lines that a message may take."""

SCENE = """
gravity = [0, 0, -60]

[materials.glass]
density = 2500
young_modulus = "10 MPa"
poisson_ratio = 0.3

[contact]
rolling = "constant"

[[pairs]]
materials = ["glass", "glass"]
restitution = 0.6
friction = 0.5
rolling_friction = 0.1

[[grains]]
material = "glass"
positions = [[0, 0, 0.0011], [0.00205, 0, 0.0011], [0.0005, 0.0003, 0.0032], [0.0025, 0.0002, 0.0032]]
velocities = [[0.01, 0.02, 0], [0.02, 0, 0], [0, 0.01, 0], [0, 0, -0.01]]
radius = "1 mm"

[[walls]]
name = "glass"
material = "glass"
mesh = "box.stl"

[time]
end = "4 ms"
step = "10 us"
max_speed = 1

[output]
interval = "1 ms"
formats = []
picture = false
"""


@pytest.fixture
def folder(tmp_path):
    """A scene of four grains in a box whose floor is z = 0."""
    box = trimesh.creation.box((0.05, 0.05, 0.02))
    box.apply_translation([0, 0, 0.01])
    box.export(tmp_path / "box.stl")
    (tmp_path / "bed.toml").write_text(SCENE)
    return tmp_path


@pytest.fixture
def warpdem(folder, monkeypatch, capfd):
    """Run the command in this process; returns exit code, stdout, stderr."""
    monkeypatch.chdir(folder)
    monkeypatch.setenv("COLUMNS", "100")
    before = signal.getsignal(signal.SIGTERM)

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["warpdem", *map(str, arguments)])
        capfd.readouterr()
        code = 0
        try:
            cli.main()
        except SystemExit as stop:
            code = stop.code or 0
        return code, *capfd.readouterr()

    yield call
    signal.signal(signal.SIGTERM, before)


RUN = ("run", "bed.toml", "--out", "out", "--device", "cpu", "--threads", "1")


def results(folder) -> list[str]:
    """Files below the result folder."""
    return sorted(p.name for p in (folder / "out").rglob("*") if p.is_file())


def record(folder) -> dict:
    return json.loads((folder / "out" / "run.json").read_text())


def test_run_writes_its_results_and_ends_with_0(warpdem, folder):
    code, out, _ = warpdem(*RUN)
    assert code == 0
    assert "summary" in out
    assert {"run.json", "history.csv", "checkpoint.h5"} <= set(results(folder))
    assert record(folder)["status"] == "done"
    assert record(folder)["steps"] == 400
    assert record(folder)["state_hash"] in out.replace("\n", "")


def test_quiet_run_prints_nothing(warpdem):
    assert warpdem(*RUN, "--quiet") == (0, "", "")


def test_quiet_run_prints_nothing_from_the_first_start_of_warp(folder):
    """In a process of its own, where Warp starts and loads its modules."""
    process = start(folder, "--quiet")
    assert process.communicate(timeout=60.0) == ("", "")
    assert process.returncode == 0


def test_second_run_into_the_same_folder_is_refused(warpdem, folder):
    assert warpdem(*RUN, "--quiet")[0] == 0
    before = {name: (folder / "out" / name).read_bytes() for name in results(folder)}
    code, _, error = warpdem(*RUN)
    assert code == 2
    assert "holds the results of a run" in error
    assert "--overwrite" in error
    assert {name: (folder / "out" / name).read_bytes() for name in results(folder)} == before
    assert warpdem(*RUN, "--quiet", "--overwrite")[0] == 0


def test_set_changes_the_scene(warpdem, folder):
    assert warpdem(*RUN, "--quiet", "--set", "time.end=0.001", "pairs.0.friction=0.1")[0] == 0
    assert record(folder)["steps"] == 100
    assert record(folder)["scene_data"]["pairs"][0]["friction"] == 0.1


def test_until_and_threads_reach_the_run(warpdem, folder):
    assert warpdem(*RUN[:-1], "2", "--until", "0.001", "--quiet")[0] == 0
    assert (record(folder)["threads"], record(folder)["steps"]) == (2, 100)


def mesh_of(triangles, path) -> None:
    trimesh.Trimesh(**trimesh.triangles.to_kwargs(np.asarray(triangles, float))).export(path)


def edit(old: str, new: str):
    def change(folder):
        text = (folder / "bed.toml").read_text()
        assert old in text
        (folder / "bed.toml").write_text(text.replace(old, new, 1))

    return change


def missing_mesh(folder):
    (folder / "box.stl").unlink()


def open_mesh(folder):
    mesh_of(trimesh.load(folder / "box.stl").triangles[1:], folder / "box.stl")


def empty_mesh(folder):
    (folder / "box.stl").write_text("solid nothing\nendsolid nothing\n")


def millimetres(folder):
    mesh = trimesh.load(folder / "box.stl")
    mesh.apply_scale(1000.0)
    mesh.apply_translation([0, 0, -0.5])
    mesh.export(folder / "box.stl")


BAD = {
    "wrong key": (edit("restitution = 0.6", "resitution = 0.6"), ["bed.toml", "pairs[0]", "resitution", "restitution"]),
    "wrong table": (edit("[time]", "[timing]"), ["bed.toml", "timing", "time"]),
    "wrong type": (edit("density = 2500", 'density = "heavy"'), ["bed.toml", "materials.glass.density", "heavy", "kg/m"]),
    "wrong unit": (edit('"10 us"', '"10 mm"'), ["bed.toml", "time.step", "10 mm"]),
    "out of range": (edit("restitution = 0.6", "restitution = 1.6"), ["bed.toml", "pairs[0].restitution", "1.6", "1"]),
    "no TOML": (edit("[time]", "[time"), ["bed.toml", "line"]),
    "missing mesh": (missing_mesh, ["bed.toml", "walls[0].mesh", "box.stl", "no such"]),
    "open mesh": (open_mesh, ["bed.toml", "walls[0].mesh", "box.stl", "closed", "3 open edges"]),
    "empty mesh": (empty_mesh, ["bed.toml", "walls[0].mesh", "box.stl", "empty"]),
    "millimetres": (millimetres, ["bed.toml", "walls[0].mesh", "box.stl", "millimetres", "0.001"]),
    "overlapping start": (edit("[0.00205, 0,", "[0.00105, 0,"), ["bed.toml", "grains", "grain 0", "grain 1", "overlap", "0.1"]),
    "step over the limit": (edit('"10 us"', '"1 ms"'), ["bed.toml", "time.step", "0.001 s", "stability limit", "auto"]),
    "grain outside": (edit("[0.0005, 0.0003, 0.0032]", "[0.0605, 0.0003, 0.0032]"),
                      ["bed.toml", "grains[0].positions[2]", "outside", "walls[0].mesh"]),
    "wrong flag": (edit('mesh = "box.stl"', 'mesh = "box.stl"\nopen = 3'), ["bed.toml", "walls[0].open", "3"]),
}  # fmt: skip


@pytest.mark.parametrize("kind", BAD)
@pytest.mark.parametrize("command", ["run", "check"])
def test_wrong_scene_is_answered_in_one_screen_before_anything_is_computed(warpdem, folder, kind, command):
    change, words = BAD[kind]
    change(folder)
    arguments = RUN if command == "run" else ("check", "bed.toml", "--device", "cpu")
    code, out, error = warpdem(*arguments)
    assert code == 2
    assert out == ""
    assert 1 <= len(error.strip().splitlines()) <= SCREEN
    assert "Traceback" not in error
    text = " ".join(error.split())
    for word in words:
        assert word in text, text
    assert results(folder) == []


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("run", "no.toml"), ["no.toml"]),
        (("run", "bed.toml", "--out", "out", "--device", "cuda:9"), ["cuda:9", "cpu"]),
        ((*RUN[:-1], "0"), ["threads = 0"]),
        ((*RUN, "--set", "time.ned=1"), ["time.ned", "end"]),
        ((*RUN, "--set", "nonsense"), ["nonsense"]),
        ((*RUN, "--resume"), ["checkpoint.h5", "no checkpoint"]),
        ((*RUN, "--until", "0"), ["--until 0", "above 0"]),
        ((*RUN, "--until", "-1"), ["--until -1", "above 0"]),
        ((*RUN, "--until", "nan"), ["--until nan", "above 0"]),
    ],
)
def test_wrong_argument_is_answered_with_2(warpdem, folder, arguments, words):
    code, _, error = warpdem(*arguments)
    assert code == 2
    assert 1 <= len(error.strip().splitlines()) <= SCREEN
    assert "Traceback" not in error
    for word in words:
        assert word in " ".join(error.split())
    assert not (folder / "out").exists()


def test_render_of_nothing_says_so(warpdem):
    code, _, error = warpdem("render", "nowhere")
    assert code == 2
    assert "nowhere" in error
    assert "Traceback" not in error


@pytest.mark.parametrize("index", ["result.pvd", "result.vtkhdf"])
def test_render_of_the_folder_above_names_that_of_the_results(warpdem, folder, index):
    (folder / "mine" / "results").mkdir(parents=True)
    (folder / "mine" / "results" / index).touch()
    code, _, error = warpdem("render", "mine")
    assert code == 2
    assert "the results are in mine/results" in " ".join(error.split())


def test_unknown_option_is_refused(warpdem, folder):
    code, out, error = warpdem(*RUN, "--treads", "2")
    assert code != 0
    assert "--treads" in out + error
    assert results(folder) == []


def test_run_that_stops_itself_ends_with_3(warpdem, folder):
    """The largest speed was lied about: a grain shot at the floor at 15 m/s."""
    edit("[0, 0, -0.01]]", "[0, 0, -15]]")(folder)
    code, out, error = warpdem(*RUN)
    assert code == 3
    assert "summary" not in out
    text = " ".join(error.split())
    assert len(error.strip().splitlines()) <= SCREEN
    for word in ("stopped at t =", "grain 3", "overlap", "engine.max_overlap", "time.step"):
        assert word in text, text
    assert record(folder)["status"] == "stopped itself"


def test_check_prints_plan_step_and_memory_and_writes_nothing(warpdem, folder):
    code, out, _ = warpdem("check", "bed.toml", "--device", "cpu", "--threads", "1", "--set", "time.step=auto")
    assert code == 0
    for what in ("4 grains", "normal: hertz", "left out", "turning of the axes", "auto keeps below", "Rayleigh",
                 "stability limit",
                 "MB", "run time about"):  # fmt: skip
        assert what in out, what
    assert results(folder) == []
    assert not (folder / "out").exists()


def test_check_json_is_json_and_nothing_else(warpdem):
    code, out, _ = warpdem("check", "bed.toml", "--json", "--no-probe", "--device", "cpu", "--threads", "1")
    assert code == 0
    data = json.loads(out)
    assert (data["grains"], data["steps"], data["time_step"]) == (4, 400, 1e-5)
    assert data["time_step_from"] == "time.step"
    assert "estimated_seconds" not in data
    assert data["bytes_per_grain"] * 4 == data["memory_bytes"]


@pytest.mark.parametrize("library", ["numpy", "warp", "pydantic"])
def test_ctrl_c_while_the_libraries_load_is_answered_in_a_word(folder, library):
    """In a process of its own, interrupted where it imports one."""
    code = f"""
import sys
class Stop:
    def find_spec(self, name, *rest):
        if name == "{library}":
            raise KeyboardInterrupt
sys.meta_path.insert(0, Stop())
sys.argv = ["warpdem", "run", "bed.toml"]
from warpdem.app.cli import main
main()
"""
    done = subprocess.run([sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, timeout=60.0)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "interrupted\n")


def start(folder, *arguments) -> subprocess.Popen:
    command = [sys.executable, "-m", "warpdem", *RUN, *arguments]
    return subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


@pytest.mark.parametrize("signal_number", [signal.SIGINT, signal.SIGTERM])
def test_interrupted_run_resumes_to_the_same_bits(warpdem, folder, signal_number):
    """Interrupted somewhere in the middle, it ends with 130 and goes on from its checkpoint."""
    long = ("--set", "time.end=0.1", "output.interval=0.01")
    process = start(folder, *long)
    history = folder / "out" / "history.csv"
    deadline = time.monotonic() + 60.0
    while time.monotonic() < deadline and process.poll() is None:
        if history.exists() and history.read_text().count("\n") > 8:
            break
        time.sleep(0.01)
    process.send_signal(signal_number)
    _, error = process.communicate(timeout=60.0)
    assert process.returncode == 130, error
    assert record(folder)["status"] == "interrupted"
    assert 0 < record(folder)["steps"] < 10_000
    reached = f"at t = {record(folder)['time']:.6g} s"
    said, command = error.strip().splitlines()[-1].split("; go on with: warpdem ")
    assert said == f"interrupted {reached} of 0.1 s"
    code, out, _ = warpdem(*shlex.split(command))
    assert code == 0
    assert f"goes on {reached}, 4 grains, {10_000 - round(float(reached[7:-2]) / 1e-5)} steps" in " ".join(out.split())
    assert record(folder)["status"] == "done"
    resumed = record(folder)["state_hash"]
    assert warpdem(*RUN, "--quiet", "--overwrite", *long)[0] == 0
    assert record(folder)["state_hash"] == resumed


def test_the_command_that_goes_on_names_the_options_given(warpdem, folder, monkeypatch):
    (folder / "my law.py").touch()
    monkeypatch.setattr("warpdem.app.phases.run", Mock(side_effect=KeyboardInterrupt("at t = 1 s of 2 s")))
    options = ["--threads=1", "--precision=mixed", "--until=2.0", "--plugin", "my law.py", "--allow-path", ".", "--no-picture"]
    changes = ["--set", "time.end=3", 'engine.skin="0.1 mm"']
    code, _, error = warpdem("run", "bed.toml", *options, *changes, "--quiet", "--overwrite")
    assert code == 130
    said, command = error.rstrip("\n").split("; go on with: ")
    assert said == "interrupted at t = 1 s of 2 s"
    assert shlex.split(command) == ["warpdem", "run", "bed.toml", "--out", "out/bed", "--resume", *options, *changes]


@pytest.mark.parametrize("option", ["--picture", "--no-picture"])
def test_whether_a_picture_is_drawn_is_an_option(warpdem, folder, monkeypatch, option):
    drawn = Mock()
    monkeypatch.setattr("warpdem.drawing.rendering.render", drawn)
    settings = ("--set", 'output.formats=["vtk"]', f"output.picture={str(option == '--no-picture').lower()}")
    assert warpdem(*RUN, "--quiet", option, *settings)[0] == 0
    assert drawn.called is (option == "--picture")
    assert warpdem(*RUN, "--quiet", "--resume", *settings)[0] == 0, "the option is no other scene"


def test_help_offers_what_does_something(warpdem):
    code, out, _ = warpdem("run", "--help")
    assert code == 0
    assert "--no-picture" in out and "--empty" not in out


def test_interrupt_while_the_picture_is_drawn_loses_nothing(warpdem, folder, monkeypatch):
    drawn = Mock(side_effect=KeyboardInterrupt)
    monkeypatch.setattr("warpdem.drawing.rendering.render", drawn)
    code, _, error = warpdem(*RUN, "--quiet", "--picture", "--set", 'output.formats=["vtk"]')
    assert code == 130
    assert (record(folder)["status"], record(folder)["steps"]) == ("done", 400)
    said, command = error.rstrip("\n").split("; go on with: warpdem ")
    assert said == "interrupted while the picture was drawn, with all other results written"
    drawn.side_effect = None
    assert warpdem(*shlex.split(command), "--quiet")[0] == 0
    assert drawn.call_count == 2


def test_resume_with_other_settings_says_so(warpdem, folder):
    assert warpdem(*RUN, "--quiet", "--set", "time.end=0.001")[0] == 0
    code, _, error = warpdem(*RUN, "--resume")
    assert code == 2
    text = " ".join(error.split())
    assert "other values of time" in text and "repeat the same --set options" in text


def test_run_and_check_tell_the_same_warnings(warpdem, folder):
    stiff = ("--set", "materials.glass.young_modulus=1e6", "pairs.0.restitution=0.01")
    code, out, _ = warpdem(*RUN, "--until", "1e-4", *stiff)
    assert code == 0
    _, checked, _ = warpdem("check", "bed.toml", "--no-probe", *stiff)
    told = [re.findall(r"^warning .*(?:\n(?!warning |summary).+)*", text, re.MULTILINE) for text in (out, checked)]
    assert len(told[0]) == 2 and "pairs[0].restitution = 0.01" in " ".join(told[0])
    assert told[0] == told[1]


def test_check_says_on_standard_error_that_it_compiles(warpdem, monkeypatch):
    monkeypatch.setattr("warpdem.core.progress.LONG", 0.001)
    monkeypatch.setattr("warpdem.simulation.Simulation.load_kernels", lambda sim: time.sleep(0.1))
    for options in ((), ("--json",)):
        _, out, error = warpdem("check", "bed.toml", *options, "--device", "cpu", "--threads", "1")
        said = ["setting up", "compiling kernels"] if not options else []
        assert [line.split(":")[0].split(" (")[0] for line in error.splitlines()] == said
        assert "compiling" not in out


def test_resume_of_a_finished_run_changes_nothing(warpdem, folder):
    assert warpdem(*RUN, "--quiet")[0] == 0
    first = record(folder)["state_hash"]
    assert warpdem(*RUN, "--quiet", "--resume")[0] == 0
    assert record(folder)["state_hash"] == first
    longer = ("--set", "time.end=0.004")
    assert warpdem(*RUN, "--quiet", "--resume", *longer)[0] == 0


@pytest.mark.slow
def test_run_with_picture_and_film(warpdem, folder):
    assert warpdem(*RUN, "--quiet", "--set", 'output.formats=["vtk"]', "output.picture=true")[0] == 0
    assert (folder / "out" / "picture.png").stat().st_size > 5_000
    assert warpdem("render", "out", "--out", "film.mp4", "--view", "frame")[0] == 0
    assert (folder / "film.mp4").stat().st_size > 5_000


def test_a_film_tells_first_how_much_there_is_to_draw(warpdem, monkeypatch):
    monkeypatch.setattr("warpdem.drawing.rendering.render", lambda *_, watch, **__: [watch(k, 12) for k in range(13)])
    assert warpdem("render", "out", "--out", "film.mp4")[1] == "drawing 12 pictures of film.mp4\nwrote film.mp4\n"


def test_render_draws_the_results(warpdem, folder):
    assert warpdem(*RUN, "--quiet", "--set", 'output.formats=["vtk"]')[0] == 0
    code, out, _ = warpdem("render", "out", "--out", "some.png")
    assert code == 0
    assert "some.png" in out
    assert (folder / "some.png").stat().st_size > 5_000


@pytest.mark.skipif(not shutil.which("bash"), reason="bash is not installed: nothing completes a word here")
@pytest.mark.parametrize(("words", "found"), [("warpdem re", {"render", "report"}), ("warpdem run --rep", {"--report"})])
def test_a_shell_completes_commands_and_options(capsys, words, found):
    cli.app(["completion", "bash"], result_action="return_value")
    script = capsys.readouterr().out
    asked = f'COMP_WORDS=({words}); COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1)); _warpdem; echo "${{COMPREPLY[@]}}"'
    done = subprocess.run(["bash", "-c", f"{script}\n{asked}"], capture_output=True, text=True, check=True)
    assert set(done.stdout.split()) == found
