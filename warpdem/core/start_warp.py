"""Start of Warp, with a clear error if it cannot store its compiled kernels.

Warp's warning about a missing NVIDIA driver is suppressed: it is of no use to a run on a CPU, and --quiet must stay silent.
"""

import functools
import os
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import warp as wp

from warpdem.errors import WarpdemError

NO_DRIVER = b"Warp CUDA warning: Could not find or load the NVIDIA CUDA driver."
"""Beginning of the warning, which Warp's native library writes to file descriptor 2 at any log level."""


@functools.cache
def start_warp() -> None:
    """Start Warp; other text that any thread writes to standard error meanwhile appears right after.

    Raises:
        WarpdemError: The folder of its compiled kernels cannot be created, or is empty and cannot be written.
    """
    given = wp.config.kernel_cache_dir
    try:
        _without_driver_warning(wp.init)
        _check_cache(Path(str(wp.config.kernel_cache_dir)))
    except OSError as error:
        folder = wp.config.kernel_cache_dir or error.filename
        wp.config.kernel_cache_dir = given  # so that the next attempt checks again
        named = given is None and "WARP_CACHE_PATH" in os.environ
        raise WarpdemError(
            f"{'WARP_CACHE_PATH: ' if named else ''}compiled kernels cannot be stored in {folder} ({error.strerror or error}); "
            "set the environment variable WARP_CACHE_PATH to a writable folder"
        ) from error


def _check_cache(folder: Path) -> None:
    """Check that the folder of compiled kernels is writable, or holds kernels that another user has compiled.

    Raises:
        OSError: The folder cannot be written.
    """
    try:
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        if not any(folder.glob("wp_*/*")):
            raise


def _without_driver_warning(start: Callable[[], None]) -> None:
    """Call ``start`` without the warning `NO_DRIVER` on standard error."""
    try:
        stderr = os.dup(2)
    except OSError:  # closed: nothing is visible
        start()
        return
    try:
        buffer = tempfile.TemporaryFile()
    except OSError:  # no folder for it, or no space: the warning is visible
        os.close(stderr)
        start()
        return
    with buffer:
        os.dup2(buffer.fileno(), 2)
        try:
            start()
        finally:
            os.dup2(stderr, 2)
            os.close(stderr)
            buffer.seek(0)
            for line in buffer:
                if not line.startswith(NO_DRIVER):
                    with suppress(OSError):  # nobody reads it, or no space
                        os.write(2, line)
