"""Atomic replacement of files: a file is written completely or not at all."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from warpdem.errors import OutputError


@contextmanager
def replaced(path: Path) -> Iterator[Path]:
    """Give a temporary path beside ``path``, and move it over ``path`` when the block ends without an error.

    Readers see the old file or the new one, never an incomplete one, even if the run is killed in between. The temporary path
    keeps the suffix, since the VTK and USD libraries choose the format by it.

    Raises:
        OutputError: The system refuses to write; the old file is unchanged.
    """
    part = path.with_name(f".{path.stem}.part{path.suffix}")
    try:
        yield part
        os.replace(part, path)
    except OSError as error:
        raise not_written(path, error) from error
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)


def not_written(path: Path, error: OSError | None = None) -> OutputError:
    """Error for a file that cannot be written, with the system's reason if there is one."""
    reason = (error.strerror or str(error)) if error else "disk full, or no write permission?"
    return OutputError(f"{path}: cannot be written ({reason})")
