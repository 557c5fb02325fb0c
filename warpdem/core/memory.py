"""How much memory there is, and the refusal of what needs more: the one place that knows, for all that takes much.

Whoever is about to take memory in proportion to a number of the input (rows that a file claims, grains, cells) asks here
first, so that such a number ends in words, not in a process that the system kills.
"""

import math
from pathlib import Path

import psutil

from warpdem.errors import SceneError

WARNING_SHARE = 0.8
"""Of the memory available: what needs more is warned of [-]."""
CGROUPS = Path("/sys/fs/cgroup")
"""Where Linux tells the limits of containers and batch jobs."""


def available() -> int:
    """Memory that this process may still take [B]: what the system has, within the limits of its container or batch job."""
    free = psutil.virtual_memory().available
    return max(0, min([free, *_group_rooms(), *_process_rooms()]))


def refusal(needed: float, what: str, remedy: str) -> str | None:
    """Why ``needed`` bytes are not to be taken, in words with both numbers; None if they are there.

    Args:
        needed: Memory [B].
        what: What takes it, such as "1e9 grains".
        remedy: What the user can do about it.
    """
    room = available()
    if needed <= room:
        return None
    return f"{what} needs {size_text(needed)} of memory, and {size_text(room)} are available: {remedy}"


def require(needed: float, key: str, what: str, remedy: str) -> None:
    """Refuse what needs more memory than there is, before it is taken.

    Args:
        needed: Memory [B].
        key: Source and key of the scene, for messages.
        what: What takes it.
        remedy: What the user can do about it.

    Raises:
        SceneError: ``needed`` is more than is available.
    """
    if reason := refusal(needed, what, remedy):
        raise SceneError(f"{key}: {reason}")


def size_text(count: float) -> str:
    """Bytes in words, such as "7.28 GB"."""
    if not math.isfinite(count):
        return "more than can be counted"
    for unit, factor in (("GB", 1e9), ("MB", 1e6)):
        if count >= factor:
            return f"{count / factor:.3g} {unit}"
    return f"{count / 1e3:.3g} kB"


def _group_rooms() -> list[int]:
    """What each control group around this process leaves it [B], of either version of Linux's control groups."""
    found = []
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
            if folder.is_relative_to(base) and (room := _room_of(folder, *names)) is not None:
                found.append(room)
    return found


def _room_of(folder: Path, limit: str, used: str, cache: str) -> int | None:
    """Limit of a control group less what it uses [B]; files it has cached count as free. None without a limit."""
    try:
        most, taken = int((folder / limit).read_text()), int((folder / used).read_text())
        statistics = dict(line.split() for line in (folder / "memory.stat").read_text().splitlines())
        return most - taken + int(statistics.get(cache, 0))
    except (OSError, ValueError):
        return None


def _process_rooms() -> list[int]:
    """What ``ulimit -v`` and ``ulimit -d`` leave this process [B]."""
    try:
        import resource

        status = Path("/proc/self/status").read_text()
    except (ImportError, OSError):
        return []  # another system than Linux
    found = []
    for name, held in (("RLIMIT_AS", "VmSize:"), ("RLIMIT_DATA", "VmData:")):
        soft, _ = resource.getrlimit(getattr(resource, name))
        if soft != resource.RLIM_INFINITY and held in status:
            found.append(soft - 1024 * int(status.split(held)[1].split()[0]))
    return found
