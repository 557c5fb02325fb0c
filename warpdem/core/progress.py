"""Progress of a run: a bar in a terminal or notebook, otherwise lines; a message when an operation takes long."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeRemainingColumn
from rich.status import Status

LONG = 1.0
"""Wall time after which an operation is reported [s]."""
LINE_EVERY = 10.0
"""Wall time between two lines where no bar can be drawn [s]."""
REFRESH = 0.2
"""Wall time between two updates of a terminal [s]."""


def duration_text(seconds: float) -> str:
    """Text of a duration, with hours and minutes where it is that long."""
    hours, minutes = int(seconds // 3600), int(seconds % 3600 // 60)
    return f"{hours} h {minutes} min" if hours else f"{minutes} min {seconds % 60:.0f} s" if minutes else f"{seconds:.1f} s"


def progress_console(console: Console) -> Console:
    """Console for progress: the given one if it is a terminal or notebook, else (a pipe, a file) standard error."""
    return console if console.is_terminal or console.is_jupyter else Console(stderr=True, highlight=False)


@contextmanager
def report_if_long(text: str, console: Console, quiet: bool) -> Iterator[None]:
    """Print ``text`` if the block runs longer than `LONG`, then the states of `report_state`; nothing if ``quiet``."""
    global _reporter
    timer = threading.Timer(LONG, lambda: progress_console(console).print(text, markup=False))
    timer.daemon = True
    if not quiet:
        timer.start()
    before, _reporter = _reporter, None if quiet else _StateReporter(progress_console(console))
    try:
        yield
    finally:
        timer.cancel()
        if _reporter is not None:
            _reporter.close()
        _reporter = before


def report_state(state: str) -> None:
    """Report the state of a long operation: in a terminal, else as a line every `LINE_EVERY`; only within `report_if_long`."""
    if _reporter is not None:
        _reporter.report(state)


class _StateReporter:
    """Shows the state of a long operation."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._begin = self._reported = time.perf_counter()
        self._status: Status | None = None

    def report(self, state: str) -> None:
        """Show a state if the last one was shown long enough ago."""
        now = time.perf_counter()
        if not self._console.is_terminal:
            if now - self._reported >= LINE_EVERY:
                self._console.print(f"{state}, {duration_text(now - self._begin)}", markup=False, soft_wrap=True)
                self._reported = now
        elif now - self._begin >= LONG and now - self._reported >= REFRESH:
            if self._status is None:
                self._status = self._console.status("")
                self._status.start()
            self._status.update(f"{escape(state)}, {duration_text(now - self._begin)}")
            self._reported = now

    def close(self) -> None:
        """Remove the state from the terminal."""
        if self._status is not None:
            self._status.stop()


_reporter: _StateReporter | None = None


@contextmanager
def progress_bar(console: Console, quiet: bool, total: int) -> Iterator[Callable[[int, str], None]]:
    """Show a bar while the block runs; the block gets a function of the steps done, of ``total``, and a text of the state.

    Without a terminal or notebook a line is printed every `LINE_EVERY` instead. Nothing is shown if ``quiet``.
    """
    columns = (
        SpinnerColumn(), TextColumn("[bold]{task.description}"), BarColumn(20), TextColumn("{task.fields[state]}"),
        TextColumn("ETA"), TimeRemainingColumn(),
    )  # fmt: skip
    console = progress_console(console)
    in_notebook = console.is_jupyter and not quiet
    if not (quiet or in_notebook or console.is_terminal):
        yield _lines(console, total)
        return
    bar = Progress(*columns, console=console, disable=quiet, transient=True)
    task = bar.add_task("run", total=total, state="")
    if in_notebook:
        # rich's own live display in notebooks needs ipywidgets; an updated display does not
        from IPython.display import display

        shown = display(bar, display_id=True)

        def report(done: int, state: str) -> None:
            bar.update(task, completed=done, state=state)
            shown.update(bar)

        yield report
        return
    with bar:
        yield lambda done, state: bar.update(task, completed=done, state=state)


def _lines(console: Console, total: int) -> Callable[[int, str], None]:
    """Function that prints lines: fraction done, state, and the time left at the mean speed since the first call."""
    begin = reported = time.perf_counter()
    first: int | None = None

    def report(done: int, state: str) -> None:
        nonlocal begin, reported, first
        now = time.perf_counter()
        if first is None:  # the earlier steps of a resumed run took no time
            begin, first = now, done
        if now - reported >= LINE_EVERY and done > first:
            left = (total - done) * (now - begin) / (done - first)
            console.print(f"{done / total:4.0%}  {state}  about {duration_text(left)} left", markup=False, soft_wrap=True)
            reported = now

    return report
