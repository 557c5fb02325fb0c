"""Cores that this process may use: affinity, quotas of control groups as files tell them, OMP_NUM_THREADS."""

import os

import pytest

from warpdem.core.cpu_cores import available_cores

MANY = 64


@pytest.fixture(autouse=True)
def many_cores(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(MANY)), raising=False)
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)


def machine(root, groups: str, mounts: str, files: dict[str, str]):
    """Files below ``root`` as a Linux with these control groups has them."""
    for name, text in {"proc/self/cgroup": groups, "proc/self/mountinfo": mounts, **files}.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    return root


V2 = "31 23 0:28 / /sys/fs/cgroup rw,relatime shared:4 - cgroup2 cgroup2 rw\n"
V1 = (
    "30 23 0:27 / /sys/fs/cgroup ro - tmpfs tmpfs rw\n"
    "32 30 0:29 {top} /sys/fs/cgroup/cpu,cpuacct rw,relatime - cgroup cgroup rw,cpu,cpuacct\n"
    "33 30 0:30 / /sys/fs/cgroup/cpuset rw,relatime - cgroup cgroup rw,cpuset\n"
)
JOB = "sys/fs/cgroup/slurm/job_1/step_0"


@pytest.mark.parametrize(
    ("limits", "cores"),
    [
        ({}, MANY),
        ({JOB: "max 100000"}, MANY),
        ({JOB: "400000 100000"}, 4),
        ({JOB: "350000 100000"}, 3),
        ({JOB: "50000 100000"}, 1),
        ({JOB: "800000 100000", "sys/fs/cgroup/slurm/job_1": "200000 100000"}, 2),
        ({JOB: "max 100000", "sys/fs/cgroup": "600000 100000"}, 6),
        ({JOB: "nonsense"}, MANY),
        ({"sys/fs/cgroup/elsewhere": "100000 100000"}, MANY),
    ],
)
def test_quota_of_version_2_is_the_least_of_all_groups_above(tmp_path, limits, cores):
    files = {f"{group}/cpu.max": text + "\n" for group, text in limits.items()}
    assert available_cores(machine(tmp_path, "0::/slurm/job_1/step_0\n", V2, files)) == cores


@pytest.mark.parametrize(
    ("top", "path", "place"),
    [
        ("/", "/docker/abc", "sys/fs/cgroup/cpu,cpuacct/docker/abc"),
        ("/", "/docker/abc", "sys/fs/cgroup/cpu,cpuacct/docker"),
        ("/docker/abc", "/docker/abc", "sys/fs/cgroup/cpu,cpuacct"),
        ("/docker/abc", "/", "sys/fs/cgroup/cpu,cpuacct"),
    ],
    ids=["own", "above", "container with the host's path", "container"],
)
@pytest.mark.parametrize(("quota", "cores"), [("250000", 2), ("-1", MANY)])
def test_quota_of_version_1(tmp_path, top, path, place, quota, cores):
    files = {f"{place}/cpu.cfs_quota_us": f"{quota}\n", f"{place}/cpu.cfs_period_us": "100000\n"}
    files |= {"sys/fs/cgroup/cpuset/docker/abc/cpu.cfs_quota_us": "100000\n"}
    groups = f"9:cpuset:{path}\n4:cpu,cpuacct:{path}\n0::/\n"
    assert available_cores(machine(tmp_path, groups, V1.format(top=top), files)) == cores


@pytest.mark.parametrize(("asked", "cores"), [("3", 3), ("5,2", 5), ("0", MANY), ("many", MANY), ("", MANY), ("999", MANY)])
def test_omp_num_threads_is_heeded(tmp_path, monkeypatch, asked, cores):
    monkeypatch.setenv("OMP_NUM_THREADS", asked)
    assert available_cores(tmp_path) == cores


def test_without_linux_the_cores_count(tmp_path, monkeypatch):
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: 5)
    assert available_cores(tmp_path) == 5
