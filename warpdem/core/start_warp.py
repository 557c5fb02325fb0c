"""Warp's start, with an answer in words where it cannot keep its compiled kernels.

And without its line on a missing NVIDIA driver: a run on a CPU need not be told, and one with --quiet is silent.
"""

import functools
import os
import tempfile
from contextlib import suppress
from pathlib import Path

import warp as wp

from warpdem.errors import WarpdemError

NO_DRIVER = b"Warp CUDA warning: Could not find or load the NVIDIA CUDA driver."
"""How the line begins. Warp's native library writes it to file descriptor 2, whatever the log level."""


@functools.cache
def start_warp() -> None:
    """Start Warp; all else that is written to standard error meanwhile, by whichever thread, comes out right after.

    Raises:
        WarpdemError: the folder of its compiled kernels cannot be made, or is empty and cannot be written.
    """
    given = wp.config.kernel_cache_dir
    try:
        _without_line(wp.init)
        _try_cache(Path(wp.config.kernel_cache_dir))
    except OSError as error:
        folder = wp.config.kernel_cache_dir or error.filename
        wp.config.kernel_cache_dir = given  # the next try looks anew
        named = given is None and "WARP_CACHE_PATH" in os.environ
        raise WarpdemError(
            f"{'WARP_CACHE_PATH: ' if named else ''}compiled kernels cannot be kept in {folder} ({error.strerror or error}); "
            "set the environment variable WARP_CACHE_PATH to a folder that can be written"
        ) from error


def _try_cache(folder: Path) -> None:
    """Write to the folder of compiled kernels, unless it holds some: another user may have compiled them for this one.

    Raises:
        OSError: the system refuses.
    """
    try:
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        if not any(folder.glob("wp_*/*")):
            raise


def _without_line(start) -> None:
    """Call ``start`` with `NO_DRIVER` held back."""
    try:
        kept = os.dup(2)
    except OSError:  # closed: nothing can be seen
        start()
        return
    try:
        held = tempfile.TemporaryFile()
    except OSError:  # no folder for it, or no room: the line is seen
        os.close(kept)
        start()
        return
    with held:
        os.dup2(held.fileno(), 2)
        try:
            start()
        finally:
            os.dup2(kept, 2)
            os.close(kept)
            held.seek(0)
            for line in held:
                if not line.startswith(NO_DRIVER):
                    with suppress(OSError):  # nobody reads it, or no room
                        os.write(2, line)
