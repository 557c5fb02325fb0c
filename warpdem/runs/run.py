"""A run as it stands in its folder: what was run, its history by column, its frames."""

from __future__ import annotations

import json
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from warpdem.core.run_lock import is_abandoned
from warpdem.errors import WarpdemError
from warpdem.runs.history import History, joined, read_history

if TYPE_CHECKING:
    from warpdem.output.read_frames import AnyResults

RECORD, HISTORY = "run.json", "history.csv"
ENDED = "ended without a record"


class Run:
    """The results of a run in a folder; each part is read when it is first asked for.

    Args:
        folder: where they are.
        record: what run.json holds.
        phases: the runs of its phases in their order; none for a run without phases.
    """

    def __init__(self, folder: Path, record: dict[str, Any], phases: tuple[Run, ...] = ()) -> None:
        self.folder, self.record, self.phases = folder, record, phases

    @cached_property
    def history(self) -> History:
        """history.csv by column; of a run with phases, those of all phases in one time.

        Raises:
            WarpdemError: there is none, or it cannot be read.
        """
        if not self.phases:
            return read_history(self.folder / HISTORY)
        begins = [phase["begin"] for phase in self.record["phases"]]
        parts = [(begin, one.history) for begin, one in zip(begins, self.phases, strict=False)]
        return joined(str(self.folder), parts)

    @cached_property
    def frames(self) -> AnyResults:
        """The frames: ``times`` [s], and ``frame(k)``, ``walls(k)`` and ``fields(k)`` of each.

        Raises:
            WarpdemError: there are none in VTK or VTKHDF, or they cannot be read.
        """
        from warpdem.output.read_frames import frames_of

        return frames_of(self.folder)

    @property
    def status(self) -> str:
        """Status in run.json: running, done, interrupted, stopped itself, failed, output cannot be written.

        ``ENDED`` of a run that was killed, or that a rank has ended: run.json says "running", but nobody writes there.
        """
        status = str(self.record.get("status", "unknown"))
        if status != "running" or not is_abandoned(self.folder):
            return status
        now = str(read(self.folder).record.get("status", "unknown"))  # it may have ended since the record was read
        return ENDED if now == "running" else now

    @property
    def last(self) -> dict[str, Any]:
        """What run.json holds of the run, or of its last phase that has begun."""
        return self.phases[-1].record if self.phases else self.record

    def __repr__(self) -> str:
        time, grains = self.last.get("time"), self.last.get("grains")
        reach = f" at t = {time:.6g} s, {grains} grains" if time is not None else ""
        phases = f", {len(self.phases)} phases" if self.phases else ""
        return f"<Run in {self.folder} of {self.record.get('scene')}: {self.status}{reach}{phases}>"


def read(folder: Path | str) -> Run:
    """The run whose results are in a folder; it may be unfinished.

    Args:
        folder: Folder of the results, such as ``out/hourglass``.

    Raises:
        WarpdemError: There is no run in it, or its run.json cannot be read.
    """
    folder = Path(folder)
    path = folder / RECORD
    if not path.exists():
        below = folder / "results"  # where a demo has them
        if (below / RECORD).exists():
            raise WarpdemError(f"{folder}: the results are in {below}; give that folder")
        missing = "no such folder" if not folder.is_dir() else f"holds no {RECORD}"
        raise WarpdemError(f"{folder}: {missing}; give the folder of a run, such as out/NAME")
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
        names = [str(phase["folder"]) for phase in record.get("phases", ()) if phase["status"] != "not begun"]
    except (OSError, ValueError, RecursionError, TypeError, KeyError, AttributeError) as error:
        raise WarpdemError(f"{path}: cannot be read as the record of a run ({error!r})") from error
    if wrong := [name for name in names if Path(name).name != name]:
        raise WarpdemError(f"{path}: {wrong[0]!r} is no folder of a phase")
    return Run(folder, record, tuple(read(folder / name) for name in names))
