"""The command as a process: its standard streams, the messages of its errors, and its exit code.

Nothing heavy is imported here: the libraries of the command load within `run_command`, where Ctrl-C is handled already.
"""

import errno
import functools
import io
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, TextIO, cast

from warpdem.core import interrupts
from warpdem.errors import WarpdemError

INTERRUPTED = 130
"""Exit code after Ctrl-C, SIGTERM and SIGHUP."""
NOT_WRITTEN = 3
"""Exit code when requested output could not be written."""
CLOSED_PIPE = 141
"""Exit code when the reader of standard output has closed it, as of a program ended by SIGPIPE."""

UNNAMED = "a file of results, of compiled kernels (WARP_CACHE_PATH) or a temporary one (TMPDIR)"
"""Possible files of a system error that names none."""


class Stream:
    """Standard output or standard error that raises no errors: text that cannot be written is dropped, so that the run goes on.

    Causes are a closed terminal, a pipe without a reader, a full disk. The first error is kept for the end of the command.
    """

    def __init__(self, stream: TextIO | None) -> None:
        self._stream = stream
        self.error: OSError | None = None

    def write(self, text: str) -> int:
        """Write ``text``, or record the error; returns the number of characters."""
        if not text:
            return 0
        if self._stream is None:
            self.error = self.error or OSError(errno.EBADF, os.strerror(errno.EBADF))
        elif self.error is None:
            self._try(functools.partial(self._stream.write, text))
        return len(text)

    def flush(self) -> None:
        """Write buffered text, or record the error."""
        if self._stream is not None and self.error is None:
            self._try(self._stream.flush)

    def isatty(self) -> bool:
        """Whether it is an open terminal."""
        return self._stream is not None and self.error is None and self._stream.isatty()

    @property
    def encoding(self) -> str:
        """Encoding of the text."""
        return getattr(self._stream, "encoding", None) or "utf-8"

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def _try(self, operation: Callable[[], object]) -> None:
        try:
            operation()
        except OSError as error:
            self.error = error
            if self._stream is None:
                return
            with suppress(OSError, ValueError):  # buffered text is dropped when Python ends
                null = os.open(os.devnull, os.O_WRONLY)
                os.dup2(null, self._stream.fileno())
                os.close(null)


def run_command(load: Callable[[], Callable[[], object]]) -> None:
    """Run the command that ``load`` imports, and end the process with its exit code if that is not 0.

    0: success; 2: wrong scene or option; 3: the run became unstable, or output cannot be written; 130: interrupted; 141: the
    reader of standard output has closed it. Messages go to standard error; only a fault of the program itself shows a
    traceback.
    """
    with _streams() as (out, errors):
        code, message = _exit_code_and_message(load)
        out.flush()
        if out.error is not None and not code:
            closed = out.error.errno == errno.EPIPE
            code = CLOSED_PIPE if closed else NOT_WRITTEN
            message = f"error: standard output cannot be written ({_reason(out.error)}); output files are not affected"
            message = "" if closed else message
        errors.write(f"{message}\n" if message else "")
        errors.flush()
    if code:
        sys.exit(code)


def _exit_code_and_message(load: Callable[[], Callable[[], object]]) -> tuple[int | str | None, str]:
    """Run the command; returns its exit code and its error message."""
    try:
        with interrupts.raised() as received, _without_interrupt_messages(received):
            try:
                load()()
            except SystemExit as stop:
                return stop.code, ""
            except WarpdemError as error:
                return error.exit_code, f"error: {error}"
            except MemoryError as error:
                reason = error or "no more is available"
                return NOT_WRITTEN, f"error: out of memory ({reason}): use fewer grains, a coarser grid or less output"
            except OSError as error:
                if received:
                    raise KeyboardInterrupt from None
                named = UNNAMED if error.filename is None else error.filename
                return NOT_WRITTEN, f"error: {named}: cannot be read or written ({_reason(error)})"
            except Exception:
                if received:  # a library turned the interrupt into another error
                    raise KeyboardInterrupt from None
                raise
    except KeyboardInterrupt as stop:  # before a run has started there is nothing to resume
        return INTERRUPTED, f"interrupted {'; '.join(map(str, stop.args))}".rstrip()
    return 0, ""


@contextmanager
def _streams() -> Iterator[tuple[Stream, Stream]]:
    """Replace the standard streams by streams that raise no errors."""
    # a file opened later must not become the standard output of a library
    with suppress(OSError):
        while (descriptor := os.open(os.devnull, os.O_RDWR)) <= 2:
            os.set_inheritable(descriptor, True)
        os.close(descriptor)
    before = sys.stdout, sys.stderr
    for stream in before:
        with suppress(AttributeError, ValueError):
            # a character that the terminal cannot show, or an undecodable file name, must not stop the command
            cast(io.TextIOWrapper, stream).reconfigure(errors="backslashreplace")
    streams = Stream(before[0]), Stream(before[1])
    sys.stdout, sys.stderr = cast(tuple[TextIO, TextIO], streams)
    try:
        yield streams
    finally:
        sys.stdout, sys.stderr = before


@contextmanager
def _without_interrupt_messages(received: list[int]) -> Iterator[None]:
    """Suppress Python's message about an interrupt that it cannot raise, as in a callback of a library."""
    before = sys.unraisablehook
    sys.unraisablehook = lambda what: None if received and what.exc_type is KeyboardInterrupt else before(what)
    try:
        yield
    finally:
        sys.unraisablehook = before


def _reason(error: OSError) -> str:
    return error.strerror or str(error)
