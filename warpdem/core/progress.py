"""How far a run is: a bar in a terminal or notebook, lines where there is neither; a word before what takes long."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeRemainingColumn

LONG = 1.0
"""Seconds of wall time after which a word is due."""
LINE_EVERY = 10.0
"""Seconds of wall time between two lines where no bar can be drawn."""
REFRESH = 0.2
"""Seconds of wall time between two states that a terminal shows."""


def duration_text(seconds: float) -> str:
    """Seconds in hours and minutes, if there are as many."""
    hours, minutes = int(seconds // 3600), int(seconds % 3600 // 60)
    return f"{hours} h {minutes} min" if hours else f"{minutes} min {seconds % 60:.0f} s" if minutes else f"{seconds:.1f} s"


def beside(console: Console) -> Console:
    """Where to tell of the way: the console if somebody looks at it, else (a pipe, a file) standard error."""
    return console if console.is_terminal or console.is_jupyter else Console(stderr=True, highlight=False)


@contextmanager
def told_if_long(text: str, console: Console, quiet: bool) -> Iterator[None]:
    """Print ``text`` if the block runs longer than `LONG`, and then what it says by ``tell``; nothing if ``quiet``."""
    global _teller
    word = threading.Timer(LONG, lambda: beside(console).print(text, markup=False))
    word.daemon = True
    if not quiet:
        word.start()
    before, _teller = _teller, None if quiet else _States(beside(console))
    try:
        yield
    finally:
        word.cancel()
        if _teller is not None:
            _teller.end()
        _teller = before


def tell(state: str) -> None:
    """Say how far what takes long is: shown in a terminal, else as a line every `LINE_EVERY`; within ``told_if_long`` only."""
    if _teller is not None:
        _teller.tell(state)


class _States:
    """Shows the state of a block that takes long."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._begin = self._told = time.perf_counter()
        self._status = None

    def tell(self, state: str) -> None:
        """Show a state if it is time to."""
        now = time.perf_counter()
        if not self._console.is_terminal:
            if now - self._told >= LINE_EVERY:
                self._console.print(f"{state}, {duration_text(now - self._begin)}", markup=False, soft_wrap=True)
                self._told = now
        elif now - self._begin >= LONG and now - self._told >= REFRESH:
            if self._status is None:
                self._status = self._console.status("")
                self._status.start()
            self._status.update(f"{escape(state)}, {duration_text(now - self._begin)}")
            self._told = now

    def end(self) -> None:
        """Take away what is shown."""
        if self._status is not None:
            self._status.stop()


_teller: _States | None = None


@contextmanager
def progress_bar(console: Console, quiet: bool, total: int) -> Iterator[Callable[[int, str], None]]:
    """Show a bar while the block runs; it is given a function that tells how many steps of ``total`` are done, and the state.

    Where neither the console nor standard error is a terminal or a notebook, there is a line every `LINE_EVERY` instead.
    Nothing is shown if ``quiet``.
    """
    columns = (
        SpinnerColumn(), TextColumn("[bold]{task.description}"), BarColumn(20), TextColumn("{task.fields[state]}"),
        TextColumn("ETA"), TimeRemainingColumn(),
    )  # fmt: skip
    console = beside(console)
    in_notebook = console.is_jupyter and not quiet
    if not (quiet or in_notebook or console.is_terminal):
        yield _lines(console, total)
        return
    bar = Progress(*columns, console=console, disable=quiet, transient=True)
    task = bar.add_task("run", total=total, state="")
    if in_notebook:
        # rich's own live display in notebooks needs ipywidgets; a display that is updated does not
        from IPython.display import display

        shown = display(bar, display_id=True)

        def tell(done: int, state: str) -> None:
            bar.update(task, completed=done, state=state)
            shown.update(bar)

        yield tell
        return
    with bar:
        yield lambda done, state: bar.update(task, completed=done, state=state)


def _lines(console: Console, total: int) -> Callable[[int, str], None]:
    """What tells by lines: share done, state, and the time left at the mean speed since the first call."""
    begin = told = time.perf_counter()
    first: int | None = None

    def tell(done: int, state: str) -> None:
        nonlocal begin, told, first
        now = time.perf_counter()
        if first is None:  # a resumed run has steps behind it that took no time
            begin, first = now, done
        if now - told >= LINE_EVERY and done > first:
            left = (total - done) * (now - begin) / (done - first)
            console.print(f"{done / total:4.0%}  {state}  about {duration_text(left)} left", markup=False, soft_wrap=True)
            told = now

    return tell
