"""How many cores this process may use: those it is bound to, within the share of time that its control groups allow."""

import os
from pathlib import Path


def available_cores(root: Path = Path("/")) -> int:
    """Cores that this process may use, at least 1.

    The least of: cores it may run on (affinity, as ``taskset`` and batch systems set it); the whole cores of its quota of
    processor time (containers and batch systems: cpu.max of cgroup v2, cpu.cfs_quota_us of v1, of the group and those above
    it); ``OMP_NUM_THREADS``, which is how batch systems tell threaded programs their share.

    Args:
        root: where /proc and what it names are looked up.
    """
    bound = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    counts = [bound, *(int(quota) for quota in _quotas(root)), *_asked()]
    return max(1, min(counts))


def _asked() -> list[int]:
    """What OMP_NUM_THREADS asks for: one number, or one per level of nesting; nothing if it is no such thing."""
    first = os.environ.get("OMP_NUM_THREADS", "").split(",")[0].strip()
    return [int(first)] if first.isdecimal() and int(first) > 0 else []


def _quotas(root: Path) -> list[float]:
    """Cores' worth of processor time that the control groups of this process allow."""
    try:
        groups = (root / "proc/self/cgroup").read_text().splitlines()
        mounts = (root / "proc/self/mountinfo").read_text().splitlines()
    except OSError:  # not Linux
        return []
    found = []
    for line in groups:
        _, controllers, path = line.split(":", 2)
        version = 2 if controllers == "" else 1
        if version == 1 and "cpu" not in controllers.split(","):
            continue
        for mount in mounts:
            own, _, system = mount.partition(" - ")
            kind, _, options = system.split(" ", 2)
            if kind != ("cgroup2" if version == 2 else "cgroup") or (version == 1 and "cpu" not in options.split(",")):
                continue
            top, place = own.split(" ")[3:5]
            # in a container the mount may begin at its own group, or the path be that of the host
            below = path.removeprefix(top) if top != "/" else path
            folder = root / place.lstrip("/")
            here = folder / below.lstrip("/")
            while True:
                found += _quota(here, version)
                if here == folder or folder not in here.parents:
                    break
                here = here.parent
    return found


def _quota(group: Path, version: int) -> list[float]:
    """Cores' worth of time of one control group; nothing if it sets no limit."""
    try:
        if version == 2:
            quota, period = (group / "cpu.max").read_text().split()
        else:
            quota, period = ((group / f"cpu.cfs_{name}_us").read_text() for name in ("quota", "period"))
        return [int(quota) / int(period)] if int(quota) > 0 else []
    except (OSError, ValueError):  # no such file, or "max"
        return []
