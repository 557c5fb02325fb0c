"""Run scenes with checkpoints at different times of the clock, other threads and lists, a resume, and on a busy machine.

    python tools/stress/determinism.py                              every demo, six runs each; over an hour on two cores
    python tools/stress/determinism.py hourglass drum --set time.end=0.1

Exit code, number of steps and state hash must not depend on any of it, nor must history.csv, but for the row at which a run
that is resumed was cut. Exit code 1 if one does.
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
from dataclasses import dataclass
from pathlib import Path

SCENES = Path(__file__).resolve().parents[2] / "scenes"
LONG = {"hourglass_paper"}
NEVER = 1e9


@dataclass(frozen=True)
class Variant:
    """One of the runs of a scene."""

    checkpoint_wall_time: float
    """Wall time between checkpoints [s]."""
    threads: int
    busy: bool = False
    """Whether other processes keep all cores busy."""
    skin: float = 1.0
    """Skin of the lists over that of the first run [-]."""
    cut: float = 1.0
    """Fraction of the run after which it is ended and resumed."""


VARIANTS = (
    Variant(NEVER, 1),
    Variant(1.0, 2),
    Variant(7.0, 1, busy=True),
    Variant(60.0, 2, busy=True),
    Variant(NEVER, 1, skin=0.6),
    Variant(NEVER, 2, cut=0.37),
)


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


def run(scene: Path, folder: Path, variant: Variant, changes: list[str], first: dict) -> tuple[int, dict, str]:
    """Exit code, run.json and history.csv of a run; ``first`` is the run.json of the first one."""
    settings = [f"output.checkpoint_wall_time={variant.checkpoint_wall_time}"]
    settings += [f"engine.skin={variant.skin * first['lists']['skin']}"] if variant.skin != 1.0 else []
    command = [sys.executable, "-m", "warpdem", "run", str(scene), "--out", str(folder), "--threads", str(variant.threads),
               "--no-picture", "--quiet", *[word for setting in settings for word in ("--set", setting)], *changes]  # fmt: skip
    parts = [["--until", str(variant.cut * first["time"])], ["--resume"]] if variant.cut < 1.0 else [[]]
    for part in parts:
        done = subprocess.run([*command, *part], check=False, capture_output=True, text=True)
        if done.returncode:
            print(done.stderr.strip())
    record = json.loads((folder / "run.json").read_text()) if (folder / "run.json").exists() else {}
    return done.returncode, record, (folder / "history.csv").read_text() if (folder / "history.csv").exists() else ""


def common_rows(history: str, first: str) -> str:
    """Digest of the rows of a history at times of the first one."""
    times = {row.partition(",")[0] for row in first.splitlines()}
    rows = [row for row in history.splitlines() if row.partition(",")[0] in times]
    return hashlib.sha256("\n".join(rows).encode()).hexdigest()[:16]


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
        found, first, rows = [], {}, ""
        for variant in VARIANTS:
            with tempfile.TemporaryDirectory() as folder, busy(variant.busy):
                code, record, history = run(SCENES / f"{name}.toml", Path(folder) / "out", variant, changes, first)
            first, rows = first or record, rows or history
            found.append((code, record.get("steps"), record.get("state_hash", "")[:16], common_rows(history, rows)))
        same = len(set(found)) == 1
        failed |= not same
        code, steps, state, digest = found[0]
        print(f"{name:20} {'same' if same else 'DIFFERENT'}: exit code {code}, {steps} steps, state {state}, "
              f"history {digest}{'' if same else f'; all: {found}'}", flush=True)  # fmt: skip
    sys.exit(failed)


if __name__ == "__main__":
    main()
