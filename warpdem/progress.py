"""How far a run is: a bar in a terminal, and the same bar in a notebook; a word before what takes long."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeRemainingColumn

LONG = 1.0
"""Seconds of wall time after which a word is due."""


@contextmanager
def told_if_long(text: str, console: Console, quiet: bool) -> Iterator[None]:
    """Print ``text`` if the block runs longer than `LONG`; nothing if ``quiet``."""
    word = threading.Timer(LONG, lambda: console.print(text, markup=False))
    word.daemon = True
    if not quiet:
        word.start()
    try:
        yield
    finally:
        word.cancel()


@contextmanager
def progress_bar(console: Console, quiet: bool, total: int) -> Iterator[Callable[[int, str], None]]:
    """Show a bar while the block runs; it is given a function that tells how many steps of ``total`` are done, and the state.

    Nothing is shown if ``quiet``, or if the console is neither a terminal nor a notebook.
    """
    columns = (
        SpinnerColumn(), TextColumn("[bold]{task.description}"), BarColumn(), TextColumn("{task.fields[state]}"),
        TextColumn("ETA"), TimeRemainingColumn(),
    )  # fmt: skip
    in_notebook = console.is_jupyter and not quiet
    live = console.is_terminal and not quiet and not in_notebook
    bar = Progress(*columns, console=console, disable=not (live or in_notebook), transient=True)
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
