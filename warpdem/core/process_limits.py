"""Limits that a reader program sets for itself, so that a damaged file ends that process and not the run."""

import contextlib
from pathlib import Path

MEMORY_SLACK = 512 << 20
"""Memory that reading may need in addition to `MEMORY_PER_BYTE` times the file [bytes]."""
MEMORY_PER_BYTE = 10
"""Memory that reading may need per byte of the files it opens [-]."""
SECONDS = 30.0
"""Processor time that reading may take [s], plus one second for each `BYTES_PER_SECOND`."""
BYTES_PER_SECOND = 1e6


def limit_memory(size: int) -> None:
    """Limit the additional memory of this process for files of ``size`` bytes, on systems that can do so."""
    try:
        import resource

        status = Path("/proc/self/status").read_text()
        used = int(status.split("VmData:")[1].split()[0]) * 1024
        resource.setrlimit(resource.RLIMIT_DATA, (used + MEMORY_SLACK + MEMORY_PER_BYTE * size, resource.RLIM_INFINITY))
    except (ImportError, OSError, ValueError, IndexError):
        return  # not Linux, or the limit is lower already: the time limit remains


def limit_time(size: int) -> None:
    """Limit the processor time of this process for a file of ``size`` bytes, on systems that can do so."""
    with contextlib.suppress(ImportError, OSError, ValueError):
        import resource

        seconds = int(SECONDS + size / BYTES_PER_SECOND)
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, resource.getrlimit(resource.RLIMIT_CPU)[1]))
