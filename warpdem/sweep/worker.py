"""Runs one row in a process of its own: what crashes there takes nothing else with it. Runs on whatever machine a worker is."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from warpdem.core.run_lock import is_locked
from warpdem.ranks.launcher import without_launcher
from warpdem.sweep.row import FINAL, RESULT, status_of, write_result

WAIT = 0.5
"""Time between two looks at a folder that another process writes into [s]."""
COMMAND = (sys.executable, "-P", "-m", "warpdem", "run")
"""Runs a scene; without -P the present folder would come first, and a checkout there hides what is installed."""
SAID = 2000
"""Characters of what a failed run said that are kept."""


@dataclass(frozen=True)
class Task:
    """What a worker needs to know of a row."""

    number: int
    """Number of the row, from 1."""
    folder: str
    """Its folder."""
    arguments: tuple[str, ...]
    """Arguments of ``warpdem run`` but the device."""
    device: str | None
    """Device, or None for the default."""


def run_row(task: Task, started: Callable[[subprocess.Popen[str]], None] | None = None) -> int:
    """Run a row, or go on with it; one that is done, or would end as before, is left as it is.

    A folder that another process still writes into, as after the sweep was killed and not its rows, is waited for.

    Args:
        task: the row.
        started: called with the process.

    Returns:
        The exit code of its run, below 0 if it was killed; 0 if there was nothing to do.
    """
    folder = Path(task.folder)
    while is_locked(folder):
        time.sleep(WAIT)
    if status_of(folder) in FINAL:
        return 0
    (folder / RESULT).unlink(missing_ok=True)
    command = [*COMMAND, *task.arguments]
    command += ["--device", task.device] if task.device else []
    command += ["--resume" if (folder / "checkpoint.h5").exists() else "--overwrite"]
    process = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, stdin=subprocess.DEVNULL, text=True,
        env=without_launcher(os.environ),  # workers of mpi4py.futures are ranks, and rows are none
    )  # fmt: skip
    if started is not None:
        started(process)
    said = process.communicate()[1].strip()
    code = process.returncode
    if code != 130:  # an interrupted run has not ended
        reason = said if code >= 0 else f"killed by signal {-code}. {said}"
        write_result(folder, code, reason[-SAID:].strip())
    return code
