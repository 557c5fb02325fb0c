"""Ctrl-C, SIGTERM and SIGHUP (a terminal that is closed): what asks a command or a run to end.

All three are answered alike. A command that was started with SIGHUP ignored, as nohup does, goes on when its terminal closes.
"""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
_command: list[int] | None = None
"""Signals that came since the command began; None where a program of the user's runs."""


@contextmanager
def raised() -> Iterator[list[int]]:
    """Raise KeyboardInterrupt in the block when a signal comes; gives the list of those that came.

    Only Ctrl-C does so again: a terminal that closes sends SIGHUP twice, and the first one's answer is being written then.
    """
    global _command
    came: list[int] = []

    def answer(number: int, _) -> None:
        came.append(number)
        if len(came) == 1 or number == signal.SIGINT:
            raise KeyboardInterrupt

    before = _command
    with _handled(answer):
        _command = came
        try:
            yield came
        finally:
            _command = before


@contextmanager
def held_back() -> Iterator[Callable[[], bool]]:
    """Hold the signals back in the block; the function given tells whether one came.

    In a command also one that came before: a library may have swallowed its KeyboardInterrupt.
    """
    came = [] if _command is None else _command
    with _handled(lambda number, _: came.append(number)):
        yield lambda: bool(came)


def ignore() -> None:
    """Ignore the signals from now on: what the process was asked for is done."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)


@contextmanager
def _handled(answer: Callable) -> Iterator[None]:
    """Have ``answer`` called for each signal in the block; Python takes them in the main thread only."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {}
    try:
        for number in SIGNALS:
            handler = signal.getsignal(number)
            if number == signal.SIGINT or handler != signal.SIG_IGN:
                signal.signal(number, answer)
                before[number] = handler
        yield
    finally:
        for number, handler in before.items():
            # None: of a library that is not Python's, which cannot be put back
            signal.signal(number, signal.SIG_DFL if handler is None else handler)
