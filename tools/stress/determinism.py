"""Run scenes with checkpoints at different times of the clock, on different numbers of threads and on a busy machine.

    python tools/stress/determinism.py                              every demo, four ways each; an hour on two cores
    python tools/stress/determinism.py hourglass drum --set time.end=0.1

Exit code, number of steps, state hash and history.csv must not depend on any of it. Exit code 1 if one does.
"""

import argparse
import hashlib
import json
import multiprocessing
import os
import subprocess
import sys
import tempfile
from contextlib import contextmanager
from pathlib import Path

SCENES = Path(__file__).resolve().parents[2] / "scenes"
LONG = {"hourglass_paper"}
NEVER = 1e9
WAYS = ((NEVER, 1, False), (1.0, 2, False), (7.0, 1, True), (60.0, 2, True))
"""Wall time between checkpoints [s], threads, whether other processes keep all cores busy."""


def spin() -> None:
    """Keep a core busy."""
    while True:
        pass


@contextmanager
def busy(on: bool):
    """A process per core that does nothing but keep it busy."""
    others = [multiprocessing.Process(target=spin, daemon=True) for _ in range(os.cpu_count() if on else 0)]
    for one in others:
        one.start()
    try:
        yield
    finally:
        for one in others:
            one.kill()


def outcome(scene: Path, changes: list[str], wall_time: float, threads: int, folder: Path) -> tuple:
    """Exit code, steps, state hash and digest of the history of a run."""
    command = [sys.executable, "-m", "warpdem", "run", str(scene), "--out", str(folder), "--threads", str(threads),
               "--no-picture", "--quiet", "--set", f"output.checkpoint_wall_time={wall_time}", *changes]  # fmt: skip
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    record = json.loads((folder / "run.json").read_text()) if (folder / "run.json").exists() else {}
    history = (folder / "history.csv").read_bytes() if (folder / "history.csv").exists() else b""
    if done.returncode:
        print(done.stderr.strip())
    return done.returncode, record.get("steps"), record.get("state_hash", "")[:16], hashlib.sha256(history).hexdigest()[:16]


def main() -> None:
    """Entry point."""
    parser = argparse.ArgumentParser(description="Whether the outcome of runs depends on the clock, threads or load.")
    demos = sorted(path.stem for path in SCENES.glob("*.toml") if path.stem not in LONG)
    parser.add_argument("scenes", nargs="*", default=demos)
    parser.add_argument("--set", action="append", default=[], help="as of warpdem run")
    options = parser.parse_args()
    changes = [word for change in options.set for word in ("--set", change)]
    failed = False
    for name in options.scenes:
        found = []
        for number, (wall_time, threads, loaded) in enumerate(WAYS):
            with tempfile.TemporaryDirectory() as folder, busy(loaded):
                found.append(outcome(SCENES / f"{name}.toml", changes, wall_time, threads, Path(folder) / str(number)))
        same = len(set(found)) == 1
        failed |= not same
        code, steps, state, history = found[0]
        print(f"{name:20} {'same' if same else 'DIFFERENT'}: exit code {code}, {steps} steps, state {state}, "
              f"history {history}{'' if same else f'; all: {found}'}", flush=True)  # fmt: skip
    sys.exit(failed)


if __name__ == "__main__":
    main()
