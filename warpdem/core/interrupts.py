"""Signals that end a command or a run: Ctrl-C, SIGTERM and SIGHUP (a terminal that is closed).

All three are handled in the same way. A command started with SIGHUP ignored, as by nohup, continues when its terminal closes.
"""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
_command: list[int] | None = None
"""Signals received since the command began; None within a program of the user."""


@contextmanager
def raised() -> Iterator[list[int]]:
    """Raise KeyboardInterrupt in the block when a signal is received; gives the list of the signals received.

    Only Ctrl-C raises it again: a terminal that closes sends SIGHUP twice, and the second one must not disturb the shutdown.
    """
    global _command
    received: list[int] = []

    def handler(number: int, _: object) -> None:
        received.append(number)
        if len(received) == 1 or number == signal.SIGINT:
            raise KeyboardInterrupt

    before = _command
    with _handled(handler):
        _command = received
        try:
            yield received
        finally:
            _command = before


@contextmanager
def held_back() -> Iterator[Callable[[], bool]]:
    """Defer the signals in the block; the function given returns whether one was received.

    In a command this includes earlier signals: a library may have swallowed the KeyboardInterrupt.
    """
    received = [] if _command is None else _command
    with _handled(lambda number, _: received.append(number)):
        yield lambda: bool(received)


def ignore() -> None:
    """Ignore the signals from now on: the work of the process is done."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)


@contextmanager
def _handled(handler: Callable[[int, FrameType | None], None]) -> Iterator[None]:
    """Have ``handler`` called for each signal in the block; Python handles signals in the main thread only."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {}
    try:
        for number in SIGNALS:
            current = signal.getsignal(number)
            if number == signal.SIGINT or current != signal.SIG_IGN:
                signal.signal(number, handler)
                before[number] = current
        yield
    finally:
        for number, previous in before.items():
            # None: a handler that was not installed by Python, which cannot be restored
            signal.signal(number, signal.SIG_DFL if previous is None else previous)
