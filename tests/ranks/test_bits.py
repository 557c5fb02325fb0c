"""A run over several ranks gives the files of one process, byte by byte."""

import json
import subprocess
import sys
from pathlib import Path

import h5py
import pytest

pytest.importorskip("mpi4py")

from warpdem.kernels.step.motion import BEYOND, LEFT

from rank_scenes import SCENES
from warpdem.app.phases import run
from warpdem.engine.graph_of_steps import STEPS as GRAPH
from warpdem.ranks import launcher

PROGRAM = Path(__file__).parents[1] / "helpers" / "rank_program.py"
TASKS = [("stirred", "4"), ("sizes", "3"), ("few", "3"), ("poured", "2+3"), ("drained", "3"), ("milled", "2"),
         ("pressed", "4"), ("held", "3"), ("phased", "3"), ("clumped", "3"), ("soaked", "3"),
         ("few", "1+4"), ("few", "4+1")]
OTHERS = [(name, size) for name in SCENES for size in ("2", "3", "4") if (name, size) not in TASKS]
OTHERS += [("clumped", "2+4"), ("soaked", "4+2")]
OTHERS += [("drained", f"{first}+{second}") for first in (1, 2, 3, 4) for second in (1, 2, 3, 4)]
BY_CHANCE = ("few", "2")
"""Three grains on two ranks, of which the draw of the cuts may move none."""
GRAPHS = [("stirred", "2"), ("poured", "2")]
OTHER_GRAPHS = [(name, size) for name in SCENES for size in ("2", "3") if (name, size) not in (*GRAPHS, BY_CHANCE)]
STEPS = [("poured", "2"), ("held", "3")]
"""Streams, an outlet and a border beside each other; walls that move by their load, and ranks without grains."""
OTHER_STEPS = [(name, size) for name in SCENES for size in ("2", "3") if (name, size) not in (*STEPS, BY_CHANCE)]
FEW = {"few": 4, "held": 2}
"""Least number of grains that go to another rank where there are few."""


def results(folder: Path, tasks: list[tuple[str, str]], *how: str) -> Path:
    """Results of scenes in one process, NAME-1, and over ranks, NAME-SIZE; 2+3: the first half over 2, resumed over 3.

    ``how``: as of ``rank_program``.
    """
    for name in {name for name, _ in tasks}:
        run(SCENES[name](), folder / f"{name}-1", quiet=True, picture=False, threads=1)
    begin, environment = launcher.command(max(int(one) for _, size in tasks for one in size.split("+")))
    command = [*begin, sys.executable, PROGRAM, folder, ",".join(f"{name}-{size}" for name, size in tasks), *how]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=1800)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return results(tmp_path_factory.mktemp("ranks"), TASKS)


@pytest.fixture(scope="module")
def folder_of_others(tmp_path_factory):
    return results(tmp_path_factory.mktemp("ranks"), OTHERS)


@pytest.fixture(scope="module")
def folder_of_graphs(tmp_path_factory):
    return results(tmp_path_factory.mktemp("ranks"), GRAPHS, "resident")


@pytest.fixture(scope="module")
def folder_of_steps(tmp_path_factory):
    return results(tmp_path_factory.mktemp("ranks"), STEPS, "device")


@pytest.fixture(scope="module")
def folder_of_other_steps(tmp_path_factory):
    return results(tmp_path_factory.mktemp("ranks"), OTHER_STEPS, "device")


@pytest.fixture(scope="module")
def folder_of_other_graphs(tmp_path_factory):
    return results(tmp_path_factory.mktemp("ranks"), OTHER_GRAPHS, "resident")


def content(path: Path) -> bytes | tuple[dict, dict]:
    """What is in a file; of a checkpoint of a phase that was started from another: all but where that lies."""
    if path.suffix != ".h5":
        return path.read_bytes()
    with h5py.File(path, "r") as file:
        scene = json.loads(file.attrs["scene"])
        if scene["start"] is None:
            return path.read_bytes()
        del scene["start"]["checkpoint"]
        arrays = {name: (values.dtype.str, values.shape, values[()].tobytes()) for name, values in file.items()}
        return {"scene": scene, "about": file.attrs["about"]}, arrays


def compare(folder: Path, name: str, size: str) -> None:
    one, many = folder / f"{name}-1", folder / f"{name}-{size}"
    names = {p.relative_to(one) for p in one.rglob("*") if p.is_file()}
    assert names == {p.relative_to(many) for p in many.rglob("*") if p.is_file()}
    other = {name for name in names if content(one / name) != content(many / name)}
    assert {name.name for name in other} == {"run.json"}
    for record in sorted(other):
        alone, shared = (json.loads((where / record).read_text()) for where in (one, many))
        for key in ("state_hash", "grains", "left", "extremes", "warnings"):
            assert alone[key] == shared[key], key
    ranks = shared["ranks"]
    if size[-1] == "1":
        assert not ranks
        return
    assert len(ranks) == int(size[-1])
    assert sum(rank["grains"] for rank in ranks) == shared["grains"]
    if (name, size) != BY_CHANCE:
        assert sum(rank["migrated"] for rank in ranks) >= (FEW.get(name, 50) if "+" not in size else 1)
    assert sum(rank["bytes"] for rank in ranks) > 0


@pytest.mark.parametrize(("name", "size"), TASKS)
def test_all_files_are_those_of_one_process(folder, name, size):
    compare(folder, name, size)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "size"), OTHERS)
def test_all_files_are_those_of_one_process_for_other_numbers_of_ranks(folder_of_others, name, size):
    compare(folder_of_others, name, size)


@pytest.mark.parametrize(("name", "size"), GRAPHS)
def test_graphs_of_a_gpu_give_the_files_of_one_process(folder_of_graphs, name, size):
    """Each rank steps by the launches of a GPU, replayed on a CPU, and exchanges through memory of the host."""
    compare(folder_of_graphs, name, size)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "size"), OTHER_GRAPHS)
def test_graphs_of_a_gpu_give_the_files_of_one_process_in_other_scenes(folder_of_other_graphs, name, size):
    compare(folder_of_other_graphs, name, size)


@pytest.mark.parametrize(("name", "size"), STEPS)
def test_messages_between_devices_give_the_files_of_one_process(folder_of_steps, name, size):
    """Graphs of several steps hold the messages, replayed on a CPU with MPI in place of NCCL."""
    compare(folder_of_steps, name, size)
    ranks = json.loads((folder_of_steps / f"{name}-{size}" / "run.json").read_text())["ranks"]
    assert all(rank["way"].endswith(f"from device to device, in graphs of {GRAPH} steps") for rank in ranks)


@pytest.mark.parametrize(("name", "size"), STEPS)
def test_steps_end_within_graphs(folder_of_steps, name, size):
    """Lists are built after a step in the middle of a graph, and batches end there."""
    ends = json.loads((folder_of_steps / "ends.json").read_text())[f"{name}-{size}"]
    assert any(found & (BEYOND | LEFT) and done % GRAPH and done < count for count, done, found in ends)
    assert any(not found and done % GRAPH and done == count for count, done, found in ends)
    assert all(found or done == count for count, done, found in ends)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "size"), OTHER_STEPS)
def test_messages_between_devices_give_the_files_of_one_process_in_other_scenes(folder_of_other_steps, name, size):
    compare(folder_of_other_steps, name, size)


@pytest.mark.slow
def test_steps_go_on_over_several_graphs(folder_of_other_steps):
    """And lists are built after a step of the second or a later one."""
    every = json.loads((folder_of_other_steps / "ends.json").read_text()).values()
    assert any(found and done > GRAPH and done % GRAPH for ends in every for _, done, found in ends)
