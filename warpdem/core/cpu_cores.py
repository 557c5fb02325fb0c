"""Number of CPU cores that this process may use: by its affinity and by the quota of its control groups."""

import os
from pathlib import Path


def available_cores(root: Path = Path("/")) -> int:
    """Cores that this process may use, at least 1.

    The minimum of: the cores it may run on (affinity, as ``taskset`` and batch systems set it); the whole cores of its quota
    of processor time (containers and batch systems: cpu.max of cgroup v2, cpu.cfs_quota_us of v1, of the group and its
    parents); ``OMP_NUM_THREADS``, by which batch systems limit threaded programs.

    Args:
        root: Folder that stands for the root of the file system: /proc and the paths in it are looked up there.
    """
    bound = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    counts = [bound, *(int(quota) for quota in _quotas(root)), *_omp_threads()]
    return max(1, min(counts))


def _omp_threads() -> list[int]:
    """Threads by OMP_NUM_THREADS (one number, or one per level of nesting); empty if it holds no such number."""
    first = os.environ.get("OMP_NUM_THREADS", "").split(",")[0].strip()
    return [int(first)] if first.isdecimal() and int(first) > 0 else []


def _quotas(root: Path) -> list[float]:
    """Processor time that the control groups of this process allow [cores]."""
    try:
        groups = (root / "proc/self/cgroup").read_text().splitlines()
        mounts = (root / "proc/self/mountinfo").read_text().splitlines()
    except OSError:  # not Linux
        return []
    found: list[float] = []
    for line in groups:
        _, controllers, path = line.split(":", 2)
        version = 2 if controllers == "" else 1
        if version == 1 and "cpu" not in controllers.split(","):
            continue
        for mount in mounts:
            own, _, system = mount.partition(" - ")
            file_system, _, options = system.split(" ", 2)
            if file_system != ("cgroup2" if version == 2 else "cgroup") or (version == 1 and "cpu" not in options.split(",")):
                continue
            top, mount_point = own.split(" ")[3:5]
            # in a container the mount may begin at its own group, or the path may be that of the host
            below = path.removeprefix(top) if top != "/" else path
            folder = root / mount_point.lstrip("/")
            here = folder / below.lstrip("/")
            while True:
                found += _quota(here, version)
                if here == folder or folder not in here.parents:
                    break
                here = here.parent
    return found


def _quota(group: Path, version: int) -> list[float]:
    """Processor time that one control group allows [cores]; empty if it sets no limit."""
    try:
        if version == 2:
            quota, period = (group / "cpu.max").read_text().split()
        else:
            quota, period = ((group / f"cpu.cfs_{name}_us").read_text() for name in ("quota", "period"))
        return [int(quota) / int(period)] if int(quota) > 0 else []
    except (OSError, ValueError):  # no such file, or "max"
        return []
