"""The command as a process: what ends it, what it says then, and its exit code.

Nothing heavy is imported here: the libraries of the command load within, where Ctrl-C is answered in words already.
"""

import errno
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from warpdem.core import interrupts
from warpdem.errors import WarpdemError

INTERRUPTED = 130
"""Exit code after Ctrl-C, SIGTERM and SIGHUP."""
NOT_WRITTEN = 3
"""Exit code when something that was asked for could not be written."""
CLOSED_PIPE = 141
"""Exit code when the reader of standard output has gone, as of a program that SIGPIPE ends."""

UNNAMED = "a file of results, of compiled kernels (WARP_CACHE_PATH) or a temporary one (TMPDIR)"
"""What the system may mean by an error that names no file."""


class Stream:
    """Standard output or standard error; what cannot be written there is dropped, and ends no run.

    A terminal that was closed, a pipe without a reader, a full disk: the first error is kept for the end.
    """

    def __init__(self, stream) -> None:
        self._stream = stream
        self.error: OSError | None = None

    def write(self, text: str) -> int:
        """Write ``text``, or note the error; returns the number of characters."""
        if not text:
            return 0
        if self._stream is None:
            self.error = self.error or OSError(errno.EBADF, os.strerror(errno.EBADF))
        elif self.error is None:
            self._try(lambda: self._stream.write(text))
        return len(text)

    def flush(self) -> None:
        """Write what is still in memory, or note the error."""
        if self._stream is not None and self.error is None:
            self._try(self._stream.flush)

    def isatty(self) -> bool:
        """Whether somebody looks at it."""
        return self._stream is not None and self.error is None and self._stream.isatty()

    @property
    def encoding(self) -> str:
        """Encoding of the text."""
        return getattr(self._stream, "encoding", None) or "utf-8"

    def __getattr__(self, name: str):
        return getattr(self._stream, name)

    def _try(self, work: Callable[[], object]) -> None:
        try:
            work()
        except OSError as error:
            self.error = error
            with suppress(OSError, ValueError):  # what is left in memory goes nowhere when Python ends
                nowhere = os.open(os.devnull, os.O_WRONLY)
                os.dup2(nowhere, self._stream.fileno())
                os.close(nowhere)


def run_command(load: Callable[[], Callable[[], object]]) -> None:
    """Run the command that ``load`` imports and leave the process with its exit code, if that is not 0.

    0: done; 2: wrong scene or option; 3: the run stopped itself, or something cannot be written; 130: interrupted; 141: the
    reader of standard output has gone. Messages go to standard error, never as a traceback unless it is a fault of the
    program.
    """
    with _streams() as (out, errors):
        code, said = _ended(load)
        out.flush()
        if out.error is not None and not code:
            gone = out.error.errno == errno.EPIPE
            code = CLOSED_PIPE if gone else NOT_WRITTEN
            said = f"error: standard output cannot be written ({_reason(out.error)}); what goes to files is not affected"
            said = "" if gone else said
        errors.write(f"{said}\n" if said else "")
        errors.flush()
    if code:
        sys.exit(code)


def _ended(load: Callable[[], Callable[[], object]]) -> tuple[int | str | None, str]:
    """Run the command; returns its exit code and what is to be said."""
    try:
        with interrupts.raised() as came, _silent(came):
            try:
                load()()
            except SystemExit as stop:
                return stop.code, ""
            except WarpdemError as error:
                return error.exit_code, f"error: {error}"
            except MemoryError as error:
                why = error or "no more is to be had"
                return NOT_WRITTEN, f"error: out of memory ({why}): take fewer grains, a coarser grid or less output"
            except OSError as error:
                if came:
                    raise KeyboardInterrupt from None
                named = UNNAMED if error.filename is None else error.filename
                return NOT_WRITTEN, f"error: {named}: cannot be read or written ({_reason(error)})"
            except Exception:
                if came:  # a library made another error of the interrupt
                    raise KeyboardInterrupt from None
                raise
    except KeyboardInterrupt as stop:  # before a run has begun there is nothing to go on with
        return INTERRUPTED, f"interrupted {'; '.join(map(str, stop.args))}".rstrip()
    return 0, ""


@contextmanager
def _streams() -> Iterator[tuple[Stream, Stream]]:
    """Put streams in place of the standard ones that no error comes out of."""
    # a file opened later must not become the standard output of some library
    with suppress(OSError):
        while (descriptor := os.open(os.devnull, os.O_RDWR)) <= 2:
            os.set_inheritable(descriptor, True)
        os.close(descriptor)
    before = sys.stdout, sys.stderr
    for stream in before:
        with suppress(AttributeError, ValueError):
            # a character that a terminal does not know, or a name of a file that is no text, is no reason to stop
            stream.reconfigure(errors="backslashreplace")
    sys.stdout, sys.stderr = streams = Stream(before[0]), Stream(before[1])
    try:
        yield streams
    finally:
        sys.stdout, sys.stderr = before


@contextmanager
def _silent(came: list[int]) -> Iterator[None]:
    """Have Python say nothing of an interrupt that it cannot raise where it came, as in a callback of a library."""
    before = sys.unraisablehook
    sys.unraisablehook = lambda what: None if came and what.exc_type is KeyboardInterrupt else before(what)
    try:
        yield
    finally:
        sys.unraisablehook = before


def _reason(error: OSError) -> str:
    return error.strerror or str(error)
