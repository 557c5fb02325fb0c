"""How a run over ranks ends: errors, signals and a killed rank."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytest.importorskip("mpi4py")

from warpdem.ranks import launcher
from warpdem.state import checkpoint_file

FAILURES = Path(__file__).parents[1] / "helpers" / "rank_failures.py"
SCENE = """
gravity = [9, 0, -9]
[materials.a]
density = 2500
young_modulus = "5 MPa"
poisson_ratio = 0.3
[[pairs]]
materials = ["a", "a"]
restitution = 0.5
friction = 0.3
[[grains]]
material = "a"
radius = 0.001
positions = [[0, 0, 0], [0.003, 0, 0], [0.006, 0, 0], [0.009, 0, 0]]
[borders]
x = { max = END, kind = "stop" }
[time]
end = 2
max_speed = 1
[output]
interval = 2
checkpoint_wall_time = 0.1
"""


def command(folder: Path, ranks: int, *options: str) -> list[str]:
    begin = launcher.command(ranks)[0] if ranks > 1 else []
    warpdem = [sys.executable, "-m", "warpdem", "run", str(folder / "scene.toml"), "--out", str(folder / "out")]
    return [*begin, *warpdem, "--quiet", "--no-picture", "--threads=1", *options]


def environment() -> dict[str, str]:
    return launcher.command(2)[1]


def test_an_error_is_told_once_and_ends_all(tmp_path):
    """A grain of the last rank is beyond a border that stops the run."""
    (tmp_path / "scene.toml").write_text(SCENE.replace("END", "0.0095"))
    said = []
    for ranks in (1, 2):
        run = [*command(tmp_path, ranks), "--overwrite"]
        done = subprocess.run(run, env=environment(), capture_output=True, text=True, timeout=200)
        assert done.returncode == 3
        said.append(next(line for line in done.stderr.splitlines() if line.startswith("error:")))
        assert done.stderr.count("error:") == 1
        assert json.loads((tmp_path / "out" / "run.json").read_text())["status"] == "stopped itself"
    assert said[0] == said[1]


def test_a_rank_that_cannot_write_its_piece_ends_all(tmp_path):
    """With the one message of a run whose output cannot be written, which names the file."""
    (tmp_path / "scene.toml").write_text(SCENE.replace("END", "100"))
    hindered = tmp_path / "out" / "result_vtk" / "grains_000000_1.vtp"
    hindered.mkdir(parents=True)
    run = [*command(tmp_path, 2), "--set", 'output.pieces="ranks"']
    done = subprocess.run(run, env=environment(), capture_output=True, text=True, timeout=200)
    assert done.returncode == 3
    assert done.stderr.count("error:") == 1
    assert f"{hindered}: cannot be written" in done.stderr
    assert json.loads((tmp_path / "out" / "run.json").read_text())["status"] == "output cannot be written"


@pytest.mark.parametrize(
    ("how", "rank", "code", "said"),
    [
        ("disk", 0, 3, "File too large"),
        ("bug", 1, 1, "ZeroDivisionError: a bug on one rank"),
        ("list", 0, 3, "error: rank 0: too long a list on one rank"),
        ("list", 1, 3, "error: rank 1: too long a list on one rank"),
        pytest.param("bug", 0, 1, "ZeroDivisionError('a bug on one rank')", marks=pytest.mark.slow),
        pytest.param("memory", 1, 3, "out of memory (no more on one rank)", marks=pytest.mark.slow),
    ],
)
def test_a_rank_that_fails_ends_all(tmp_path, how, rank, code, said):
    """Within seconds, with one message, and the last good checkpoint is whole."""
    (tmp_path / "scene.toml").write_text(SCENE.replace("END", "100").replace("end = 2\n", "end = 0.2\n"))
    given = command(tmp_path, 2)
    at = given.index("run")
    failing = [*given[: at - 2], str(FAILURES), how, str(rank), *given[at:]]
    done = subprocess.run(failing, env=environment(), capture_output=True, text=True, timeout=300)
    assert done.returncode == code
    assert said in done.stderr
    assert done.stderr.count("error:") == 1
    assert checkpoint_file.read(tmp_path / "out" / "checkpoint.h5")["step"] >= 0


def last_rank(folder: Path, launched: int) -> int:
    """Process of a rank that runs the scene in ``folder``, which the process ``launched`` has started."""
    pattern = f"python.*-m warpdem run {folder}"
    found = subprocess.run(["pgrep", "-f", pattern], capture_output=True, text=True).stdout.split()
    return max(int(number) for number in found if int(number) != launched)


@pytest.mark.parametrize("how", [pytest.param("Ctrl-C", marks=pytest.mark.slow), "killed rank"])
def test_what_ends_before_its_end_can_go_on(tmp_path, how):
    """To a little after the last checkpoint, with the bits of a run that nobody has cut."""
    (tmp_path / "scene.toml").write_text(SCENE.replace("END", "100"))
    process = subprocess.Popen(command(tmp_path, 2), env=environment(), stderr=subprocess.PIPE, text=True)
    saved = tmp_path / "out" / "checkpoint.h5"
    begin = time.monotonic()
    while not saved.exists() or not checkpoint_file.read(saved)["step"]:
        assert process.poll() is None and time.monotonic() - begin < 120
        time.sleep(0.2)
    if how == "Ctrl-C":
        process.send_signal(signal.SIGINT)
    else:
        os.kill(last_rank(tmp_path, process.pid), signal.SIGKILL)
    code = process.wait(30)
    assert code == 130 if how == "Ctrl-C" else code != 0
    state = checkpoint_file.read(saved)
    hashes = []
    for how_to_go_on in ("--resume", "--overwrite"):
        again = command(tmp_path, 1, how_to_go_on, f"--until={(state['step'] + 50) * state['dt']!r}")
        assert subprocess.run(again, env=environment(), timeout=300).returncode == 0
        hashes.append(json.loads((tmp_path / "out" / "run.json").read_text())["state_hash"])
    assert hashes[0] == hashes[1]
