"""Do all the set-up, then run the main job or the tests. Needs Python >= 3.11 and nothing else.

    python3 tools/start.py run      install into .venv, run scenes/hourglass.toml, draw picture and film
    python3 tools/start.py test     install into .venv, pass the tests (more arguments go to pytest)

The environment is made once; delete .venv to start afresh. Warp keeps compiled kernels in its cache between runs.
"""

import os
import subprocess
import sys
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
VENV = ROOT / ".venv"
BIN = VENV / ("Scripts" if os.name == "nt" else "bin")
STAMP = VENV / "installed-from"


def call(*command: str | Path) -> None:
    """Run a command in the project's folder; end with its exit code if it fails."""
    done = subprocess.run([str(c) for c in command], cwd=ROOT, check=False)
    if done.returncode:
        sys.exit(done.returncode)


def install(tests: bool) -> None:
    """Make .venv with warpdem, and with what its tests need if asked, unless it is there and up to date.

    Nothing is compiled to bytecode beforehand: Python does that for the few files that are used, when they are.
    """
    plain = (ROOT / "pyproject.toml").read_text()
    complete = plain + "# with the tests\n"
    if STAMP.exists() and STAMP.read_text() in ((complete,) if tests else (plain, complete)):
        return
    if not (BIN / "python").exists():
        venv.create(VENV, with_pip=True)
    pip = [BIN / "python", "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-compile"]
    call(*pip, "--editable", ".[test]" if tests else ".")
    STAMP.write_text(complete if tests else plain)


def main() -> None:
    """Entry point."""
    if sys.version_info < (3, 11):  # noqa: UP036  (run by whatever python3 there is, before anything is installed)
        sys.exit(f"warpdem needs Python >= 3.11, this is {sys.version.split()[0]}")
    if len(sys.argv) < 2 or sys.argv[1] not in ("run", "test"):
        sys.exit(__doc__)
    install(tests=sys.argv[1] == "test")
    more = sys.argv[2:]
    if sys.argv[1] == "run":
        call(BIN / "warpdem", "run", "scenes/hourglass.toml", "--out", "out/hourglass", "--overwrite", *more)
        call(BIN / "warpdem", "render", "out/hourglass", "--out", "out/hourglass/film.mp4")
    else:
        call(BIN / "ruff", "check", ".")
        # beside the tests: alone it would leave all cores but one idle for a minute
        types = subprocess.Popen([BIN / "mypy"], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        # a worker per core; a file stays with one of them, and so do its kernels; tests/conftest.py has the order of files
        tests = [BIN / "python", "-m", "pytest", "-n", "auto", "--dist", "loadfile", "--no-loadscope-reorder", *more]
        failed = subprocess.run(tests, cwd=ROOT, check=False).returncode
        print(f"mypy: {types.communicate()[0]}", end="")
        sys.exit(failed or types.returncode)


if __name__ == "__main__":
    main()
