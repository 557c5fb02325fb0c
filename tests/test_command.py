"""The command as a process: signals at any moment, an output that cannot be written; words and exit codes, no traceback."""

import functools
import json
import os
import shutil
import signal
import subprocess
import sys
import time

import pytest

from scene_text import GLASS
from warpdem.core import interrupts
from warpdem.core.command import UNNAMED, run_command
from warpdem.errors import OutputError, SceneError

SCENE = f"""{GLASS}
[[grains]]
material = "glass"
positions = [[0, 0, 0], [0, 0, 0.003]]
velocities = [[0, 0, 1], [0, 0, 0]]
radius = "1 mm"
[time]
end = "4 ms"
step = "10 us"
max_speed = 1
[output]
formats = ["vtk"]
picture = false
"""
COMMAND = [sys.executable, "-m", "warpdem"]
RUN = ["run", "two.toml", "--out", "out", "--device", "cpu"]
CHECK = ["check", "two.toml", "--no-probe", "--device", "cpu"]
FULL = "/dev/full"

needs_full = pytest.mark.skipif(not os.path.exists(FULL), reason="the system has no device that is always full")


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "two.toml").write_text(SCENE)
    return tmp_path


def ended(folder, arguments, **keys) -> subprocess.CompletedProcess:
    found = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | keys
    done = subprocess.run([*COMMAND, *arguments], cwd=folder, text=True, timeout=120, **found)
    assert "Traceback" not in (done.stderr or "") and "Exception" not in (done.stderr or "")
    return done


@needs_full
@pytest.mark.parametrize(
    "arguments",
    [CHECK, [*CHECK, "--json"], ["demo"], ["--help"], ["--version"], ["convert", "two.toml", "two.usda"], RUN],
    ids=lambda arguments: " ".join(arguments[:1] + arguments[3:4]),
)
def test_a_full_standard_output_ends_with_3_and_files_are_whole(folder, arguments):
    with open(FULL, "w") as full:
        done = ended(folder, arguments, stdout=full)
    assert done.returncode == 3
    assert done.stderr.splitlines()[-1].startswith("error: standard output cannot be written (No space left on device)")
    assert arguments[0] != "convert" or (folder / "two.usda").exists()
    assert arguments != RUN or json.loads((folder / "out" / "run.json").read_text())["status"] == "done"


@pytest.mark.parametrize("arguments", [["demo"], RUN], ids=["demo", "run"])
def test_a_reader_that_has_gone_ends_as_other_tools_do(folder, arguments):
    read, write = os.pipe()
    os.close(read)
    done = ended(folder, arguments, stdout=write)
    os.close(write)
    assert done.returncode == 141
    assert "error" not in done.stderr
    assert arguments != RUN or json.loads((folder / "out" / "run.json").read_text())["status"] == "done"


@pytest.mark.parametrize("arguments", [["--version"], RUN], ids=["version", "run"])
def test_a_closed_standard_output_is_told(folder, arguments):
    done = ended(folder, arguments, stdout=None, preexec_fn=lambda: os.close(1))
    assert done.returncode == 3
    assert "error: standard output cannot be written (Bad file descriptor)" in done.stderr
    assert arguments != RUN or json.loads((folder / "out" / "run.json").read_text())["status"] == "done"


def closed() -> None:
    """Close what a process begins with."""
    for descriptor in (0, 1, 2):
        os.close(descriptor)


def test_no_file_becomes_the_standard_output_of_a_library(folder):
    """The system gives the lowest free number to the next file."""
    opens = "os.write(os.open('number', os.O_CREAT | os.O_RDWR), str(os.open('other', os.O_CREAT)).encode())"
    code = f"import os; from warpdem.core.command import run_command; run_command(lambda: lambda: {opens})"
    subprocess.run([sys.executable, "-c", code], cwd=folder, preexec_fn=closed, check=True, timeout=60)
    assert int((folder / "number").read_text()) > 2


def test_what_prints_nothing_needs_no_output(folder):
    done = ended(folder, [*RUN, "--quiet"], stdin=None, stdout=None, stderr=None, preexec_fn=closed)
    assert done.returncode == 0
    assert json.loads((folder / "out" / "run.json").read_text())["status"] == "done"


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_a_signal_before_the_first_step_is_answered_in_a_line(folder, name):
    """While libraries load, the run is set up, or kernels compile: no traceback, and no folder is left."""
    waits = "lambda *_, **__: (print('set up', flush=True), time.sleep(60))"
    code = f"import sys, time, warpdem.simulation; warpdem.simulation.Simulation.__init__ = {waits}; "
    code += f"sys.argv = ['warpdem', *{RUN!r}]; from warpdem.__main__ import main; main()"
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    process = subprocess.Popen([sys.executable, "-c", code], cwd=folder, **pipes)
    assert process.stdout.readline() == "set up\n"
    assert (folder / "out").exists()
    process.send_signal(getattr(signal, name))
    _, said = process.communicate(timeout=60)
    assert process.returncode == 130
    assert said.splitlines()[-1] == "interrupted" and "Traceback" not in said
    assert not (folder / "out").exists()


def test_ctrl_c_at_the_very_start_is_answered(folder):
    """Before the first library of the command is imported, where Python's own answer is a traceback."""
    code = "import os, signal, warpdem.__main__; os.kill(os.getpid(), signal.SIGINT)"
    heard = functools.partial(signal.signal, signal.SIGINT, signal.SIG_DFL)  # a shell ignores it for jobs in the background
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=60, preexec_fn=heard)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "interrupted\n")


def test_a_terminal_that_closes_leaves_a_run_to_go_on_with(folder):
    """The terminal is gone, so nothing can be printed; SIGHUP comes twice, from the shell and from the system."""
    pty = pytest.importorskip("pty")
    long = [*RUN, "--set", "time.end=2", "output.formats=[]", "output.interval=0.01"]
    pid, terminal = pty.fork()
    if pid == 0:
        os.chdir(folder)
        os.execv(sys.executable, [*COMMAND, *long])
    history, deadline = folder / "out" / "history.csv", time.monotonic() + 60
    while not (history.exists() and history.read_text().count("\n") > 4):
        assert time.monotonic() < deadline
        time.sleep(0.02)
    os.kill(pid, signal.SIGHUP)
    os.close(terminal)
    assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == 130
    record = json.loads((folder / "out" / "run.json").read_text())
    assert record["status"] == "interrupted" and 0 < record["steps"] < 200_000
    assert (folder / "out" / "checkpoint.h5").exists() and not (folder / "out" / ".running").exists()


@pytest.mark.skipif(shutil.which("nohup") is None, reason="no nohup on this system")
def test_nohup_keeps_a_run_going(folder):
    process = subprocess.Popen(["nohup", *COMMAND, *RUN, "--quiet", "--set", "time.end=0.1"], cwd=folder,
                               stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)  # fmt: skip
    while not (folder / "out" / "run.json").exists() and process.poll() is None:
        process.send_signal(signal.SIGHUP) if (folder / "out").exists() else None
        time.sleep(0.02)
    process.send_signal(signal.SIGHUP)
    process.communicate(timeout=60)
    assert process.returncode == 0
    assert json.loads((folder / "out" / "run.json").read_text())["status"] == "done"


def test_two_runs_at_the_same_moment_have_a_folder_each(folder):
    runs = [subprocess.Popen([*COMMAND, "run", "two.toml", "--quiet"], cwd=folder) for _ in range(3)]
    assert [run.wait(timeout=120) for run in runs] == [0, 0, 0]
    assert sorted(os.listdir(folder / "out")) == ["two", "two-2", "two-3"]
    hashes = {json.loads((folder / "out" / name / "run.json").read_text())["state_hash"] for name in os.listdir(folder / "out")}
    assert len(hashes) == 1


def code_of(work) -> int:
    """Exit code of a command in this process."""
    try:
        run_command(lambda: work)
    except SystemExit as stop:
        return stop.code
    return 0


def fails(error):
    def work():
        raise error

    return work


@pytest.mark.parametrize(
    ("error", "code", "said"),
    [
        (SceneError("key"), 2, "error: key\n"),
        (OutputError("disk"), 3, "error: disk\n"),
        (KeyboardInterrupt("at t = 1 s", "go on"), 130, "interrupted at t = 1 s; go on\n"),
        (PermissionError(13, "Permission denied", "file"), 3, "error: file: cannot be read or written (Permission denied)\n"),
        (OSError(28, "No space left"), 3, f"error: {UNNAMED}: cannot be read or written (No space left)\n"),
        (SystemExit(7), 7, ""),
    ],
)  # fmt: skip
def test_each_error_has_its_code_and_words(capfd, error, code, said):
    assert code_of(fails(error)) == code
    assert capfd.readouterr().err == said


def test_a_fault_of_the_program_is_told_as_python_does():
    with pytest.raises(ZeroDivisionError):
        run_command(lambda: lambda: 1 // 0)


def test_an_interrupt_that_a_library_turns_into_an_error_is_an_interrupt(capfd):
    def work():
        try:
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(10)
        except KeyboardInterrupt:
            raise ImportError("something could not be imported") from None

    assert code_of(work) == 130
    assert capfd.readouterr().err == "interrupted\n"


def test_an_interrupt_that_a_library_swallows_ends_the_run_later():
    def work():
        try:
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(10)
        except KeyboardInterrupt:
            pass
        with interrupts.held_back() as interrupted:
            assert interrupted()

    assert code_of(work) == 0


@pytest.mark.parametrize(("number", "again"), [(signal.SIGINT, True), (signal.SIGTERM, False), (signal.SIGHUP, False)])
def test_only_ctrl_c_interrupts_again(number, again):
    came = []

    def work():
        for _ in range(2):
            try:
                os.kill(os.getpid(), number)
                time.sleep(0.05)
            except KeyboardInterrupt:
                came.append(number)

    assert code_of(work) == 0
    assert len(came) == 1 + again


def test_signals_are_as_before_afterwards():
    before = [signal.getsignal(number) for number in interrupts.SIGNALS]
    with interrupts.held_back() as interrupted:
        os.kill(os.getpid(), signal.SIGHUP)
        time.sleep(0.01)
        assert interrupted()
    code_of(lambda: None)
    assert [signal.getsignal(number) for number in interrupts.SIGNALS] == before
    with interrupts.held_back() as interrupted:
        assert not interrupted(), "an interrupt of a run before is no interrupt of this one"
