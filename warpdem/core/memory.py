"""Available memory, and the refusal of requests that need more.

Code that allocates memory in proportion to a number of the input (rows that a file declares, grains, cells) checks here first,
so that an excessive number ends in an error message, not in a process killed by the system.
"""

import math
from pathlib import Path

import psutil

from warpdem.errors import SceneError

WARNING_SHARE = 0.8
"""Fraction of the available memory above which a warning is given [-]."""
CGROUPS = Path("/sys/fs/cgroup")
"""Where Linux shows the limits of containers and batch jobs."""


def available() -> int:
    """Memory that this process may still allocate [B]: that of the system, within the limits of its container or batch job."""
    free = int(psutil.virtual_memory().available)
    return max(0, min([free, *_group_capacities(), *_process_capacities()]))


def refusal(needed: float, what: str, remedy: str) -> str | None:
    """Reason why ``needed`` bytes cannot be allocated, with both numbers; None if they are available.

    Args:
        needed: Memory [B].
        what: What needs it, such as "1e9 grains".
        remedy: What the user can do about it.
    """
    capacity = available()
    if needed <= capacity:
        return None
    return f"{what} needs {size_text(needed)} of memory, and {size_text(capacity)} are available: {remedy}"


def require(needed: float, key: str, what: str, remedy: str) -> None:
    """Refuse a request for more memory than is available, before any is allocated.

    Args:
        needed: Memory [B].
        key: Source and key of the scene, for messages.
        what: What needs it.
        remedy: What the user can do about it.

    Raises:
        SceneError: ``needed`` is more than is available.
    """
    if reason := refusal(needed, what, remedy):
        raise SceneError(f"{key}: {reason}")


def size_text(count: float) -> str:
    """Text of a number of bytes, such as "7.28 GB"."""
    if not math.isfinite(count):
        return "more than can be counted"
    for unit, factor in (("GB", 1e9), ("MB", 1e6)):
        if count >= factor:
            return f"{count / factor:.3g} {unit}"
    return f"{count / 1e3:.3g} kB"


def _group_capacities() -> list[int]:
    """Memory that each control group of this process leaves [B], for both versions of Linux's control groups."""
    found: list[int] = []
    try:
        lines = Path("/proc/self/cgroup").read_text().splitlines()
    except OSError:
        return found
    for line in lines:
        number, controllers, path = line.split(":", 2)
        if number == "0":
            base, names = CGROUPS, ("memory.max", "memory.current", "inactive_file")
        elif "memory" in controllers.split(","):
            base = CGROUPS / "memory"
            names = ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file")
        else:
            continue
        # within a container the path may be that of the host: the limits are at the top then
        here = base / path.lstrip("/")
        for folder in dict.fromkeys([here, *here.parents, base]):
            if folder.is_relative_to(base) and (capacity := _group_capacity(folder, *names)) is not None:
                found.append(capacity)
    return found


def _group_capacity(folder: Path, limit: str, used: str, cache: str) -> int | None:
    """Limit of a control group minus its use [B]; cached files count as free. None without a limit."""
    try:
        limit_bytes, used_bytes = int((folder / limit).read_text()), int((folder / used).read_text())
        statistics = dict(line.split() for line in (folder / "memory.stat").read_text().splitlines())
        return limit_bytes - used_bytes + int(statistics.get(cache, 0))
    except (OSError, ValueError):
        return None


def _process_capacities() -> list[int]:
    """Memory that ``ulimit -v`` and ``ulimit -d`` leave this process [B]."""
    try:
        import resource

        status = Path("/proc/self/status").read_text()
    except (ImportError, OSError):
        return []  # another system than Linux
    found = []
    for name, field in (("RLIMIT_AS", "VmSize:"), ("RLIMIT_DATA", "VmData:")):
        soft, _ = resource.getrlimit(getattr(resource, name))
        if soft != resource.RLIM_INFINITY and field in status:
            found.append(soft - 1024 * int(status.split(field)[1].split()[0]))
    return found
