"""Warp's start without its line on a missing NVIDIA driver: a run on a CPU need not be told, and one with --quiet is silent."""

import functools
import os
import tempfile

import warp as wp

NO_DRIVER = b"Warp CUDA warning: Could not find or load the NVIDIA CUDA driver."
"""How the line begins. Warp's native library writes it to file descriptor 2, whatever the log level."""


@functools.cache
def start_warp() -> None:
    """Start Warp; all else that is written to standard error meanwhile, by whichever thread, comes out right after."""
    try:
        kept = os.dup(2)
    except OSError:  # closed: nothing can be seen
        wp.init()
        return
    with tempfile.TemporaryFile() as held:
        os.dup2(held.fileno(), 2)
        try:
            wp.init()
        finally:
            os.dup2(kept, 2)
            os.close(kept)
            held.seek(0)
            for line in held:
                if not line.startswith(NO_DRIVER):
                    os.write(2, line)
