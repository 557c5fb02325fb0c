"""An executor for sweeps that runs nothing: the history of a row comes from a function of the values that its row sets."""

import csv
import json
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import contextmanager
from pathlib import Path

from warpdem.sweep.row import FINAL, status_of, write_result


class StubExecutor:
    """Handed over as ``on``.

    Args:
        respond: makes the last row of a history by column from the values of a row by key.
        stop_after: rows after which it is interrupted, as by Ctrl-C; None for never.
        crashes: number of the row that is killed.
    """

    def __init__(
        self,
        respond: Callable[[dict[str, str]], dict[str, float]],
        stop_after: int | None = None,
        crashes: int | None = None,
    ) -> None:
        self.respond, self.left, self.crashes, self.ran = respond, stop_after, crashes, 0

    @contextmanager
    def __call__(self, workers, threads, folder, gpus):
        yield self.submit

    def submit(self, task):
        """Run a row at once."""
        future = Future()
        folder = Path(task.folder)
        if status_of(folder) in FINAL:
            future.set_result(0)
            return future
        if self.left is not None and self.ran >= self.left:
            raise KeyboardInterrupt
        self.ran += 1
        if self.ran == self.crashes:
            write_result(folder, -9, "killed by signal 9.")
            future.set_result(-9)
            return future
        words = task.arguments[task.arguments.index("--set") + 1 :]
        values = self.respond(dict(word.split("=", 1) for word in words))
        folder.mkdir(parents=True, exist_ok=True)
        with (folder / "history.csv").open("w", newline="") as file:
            csv.writer(file).writerows([["time [s]", *values], [0, *[0] * len(values)], [1, *values.values()]])
        record = {"status": "done", "seconds": {"total": 0.1, "steps": 0.08}, "state_hash": "h"}
        (folder / "run.json").write_text(json.dumps(record))
        write_result(folder, 0, "")
        future.set_result(0)
        return future
