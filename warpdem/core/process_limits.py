"""Limits that a reader program sets itself, so that a damaged file ends that process and not the run."""

import contextlib
from pathlib import Path

MEMORY_SLACK = 512 << 20
"""Memory that reading may take beyond `MEMORY_SHARE` times the file [bytes]."""
MEMORY_SHARE = 10
"""Memory that reading may take per byte of the files it opens [-]."""
SECONDS = 30.0
"""Processor time that reading may take [s], with another second for each `BYTES_PER_SECOND`."""
BYTES_PER_SECOND = 1e6


def limit_memory(size: int) -> None:
    """Let this process take at most so much more memory for files of ``size`` bytes, where the system can hold it to that."""
    try:
        import resource

        status = Path("/proc/self/status").read_text()
        used = int(status.split("VmData:")[1].split()[0]) * 1024
        resource.setrlimit(resource.RLIMIT_DATA, (used + MEMORY_SLACK + MEMORY_SHARE * size, resource.RLIM_INFINITY))
    except (ImportError, OSError, ValueError, IndexError):
        return  # another system than Linux, or one that allows less already: the time limit remains


def limit_time(size: int) -> None:
    """Let this process take so much processor time for a file of ``size`` bytes, where the system can hold it to that."""
    with contextlib.suppress(ImportError, OSError, ValueError):
        import resource

        seconds = int(SECONDS + size / BYTES_PER_SECOND)
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, resource.getrlimit(resource.RLIMIT_CPU)[1]))
