"""A sweep through the pool, mpi4py.futures, Dask and submitit (without SLURM in its own processes) gives one table."""

import csv
import importlib.util
import subprocess
import sys

import pytest

from scene_text import TWO_FALLING
from warpdem.errors import SceneError
from warpdem.ranks import launcher
from warpdem.sweep.executors import LIBRARIES

WORKERS = 2


def missing(kind):
    """Why an executor cannot be tried here; None if it can."""
    module, package = LIBRARIES[kind]
    if importlib.util.find_spec(module.split(".")[0]) is None:
        return f"{package} is not installed"
    if kind == "mpi":
        try:
            launcher.command(1)
        except SceneError as error:
            return str(error)
    return None


def table(kind, scene, folder):
    """Table of a sweep of three rows, but the times."""
    words = ["sweep", str(scene), "--grid", "pairs.0.restitution=0.3,0.5,0.7", "--out", str(folder), "--threads", "1",
             "--device", "cpu", "--quiet", "--on", kind, "--workers", str(WORKERS)]  # fmt: skip
    start, environment = launcher.command(WORKERS + 1) if kind == "mpi" else ([], None)
    modules = ["-m", "mpi4py.futures", "-m", "warpdem"] if kind == "mpi" else ["-m", "warpdem"]
    command = [*start, sys.executable, "-P", *modules, *words]
    done = subprocess.run(command, cwd=folder.parent, env=environment, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stdout + done.stderr
    with (folder / "sweep.csv").open(newline="") as file:
        return [{name: value for name, value in row.items() if name != "wall_time [s]"} for row in csv.DictReader(file)]


@pytest.fixture(scope="module")
def of_pool(tmp_path_factory):
    """The scene, and the table of the sweep through processes of this machine."""
    folder = tmp_path_factory.mktemp("executors")
    scene = folder / "s.toml"
    scene.write_text(TWO_FALLING)
    return scene, table("local", scene, folder / "local")


@pytest.mark.parametrize("kind", LIBRARIES)
def test_every_executor_gives_the_table_of_the_pool(kind, of_pool):
    if reason := missing(kind):
        pytest.skip(reason)
    scene, expected = of_pool
    found = table(kind, scene, scene.parent / kind)
    assert found == expected and {row["status"] for row in found} == {"done"}
    assert len({row["state_hash"] for row in found}) == len(found) == 3
