"""The folder of a row: where its run is, how far it is, and why it failed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from warpdem.core.atomic_file import replaced
from warpdem.runs.run import RECORD

RESULT = "result.json"
"""File that a worker leaves in the folder of a row when its run has ended: exit code, and what was said on standard error."""
OPEN = ("waiting", "running", "interrupted")
"""Statuses of a row that has not ended."""
FINAL = ("done", "wrong", "stopped itself")
"""Statuses that another attempt would not change: the same scene gives the same bits."""


def folder_of(sweep: Path, number: int) -> Path:
    """Folder of row ``number``, counted from 1."""
    return sweep / f"{number:04d}"


def record_of(folder: Path) -> dict[str, Any]:
    """run.json of a row; empty if there is none that can be read."""
    return _read(folder / RECORD)


def status_of(folder: Path) -> str:
    """Status of a row: those of run.json, "wrong" where its scene was refused, "crashed", or "waiting"."""
    result, record = _read(folder / RESULT), record_of(folder)
    code = result.get("exit_code")
    if code == 2:
        return "wrong"
    status = str(record.get("status", "waiting"))
    if code not in (None, 0, 130) and status in ("running", "waiting"):
        return "crashed"  # it was killed, or ended by a fault of the program
    return status


def why(folder: Path) -> str:
    """What a row that failed said; empty for one that did not."""
    result = _read(folder / RESULT)
    return str(result.get("why", "")) if result.get("exit_code") else ""


def write_result(folder: Path, exit_code: int, said: str) -> None:
    """Note how the run of a row ended."""
    folder.mkdir(parents=True, exist_ok=True)
    with replaced(folder / RESULT) as part:
        part.write_text(json.dumps({"exit_code": exit_code, "why": said}) + "\n", encoding="utf-8")


def _read(path: Path) -> dict[str, Any]:
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return data if isinstance(data, dict) else {}
