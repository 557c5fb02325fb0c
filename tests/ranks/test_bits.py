"""A run over several ranks gives the files of one process, byte by byte."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("mpi4py")

from rank_scenes import SCENES
from warpdem.ranks import launcher
from warpdem.runner import run_scene

PROGRAM = Path(__file__).parents[1] / "helpers" / "rank_program.py"
SIZES = (2, 3, 4)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Results of all scenes on 1 to 4 ranks: NAME-SIZE."""
    folder = tmp_path_factory.mktemp("ranks")
    for name, scene in SCENES.items():
        run_scene(scene(), folder / f"{name}-1", quiet=True, picture=False, threads=1)
    begin, environment = launcher.command(max(SIZES))
    command = [*begin, sys.executable, PROGRAM, folder, ",".join(map(str, SIZES)), ",".join(SCENES)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("name", SCENES)
def test_all_files_are_those_of_one_process(folder, name, size):
    one, many = folder / f"{name}-1", folder / f"{name}-{size}"
    names = {p.relative_to(one) for p in one.rglob("*") if p.is_file()}
    assert names == {p.relative_to(many) for p in many.rglob("*") if p.is_file()}
    other = [name for name in names if (one / name).read_bytes() != (many / name).read_bytes()]
    assert [str(name) for name in other] == ["run.json"]
    assert json.loads((one / "run.json").read_text())["state_hash"] == json.loads((many / "run.json").read_text())["state_hash"]


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("name", SCENES)
def test_grains_change_hands(folder, name, size):
    ranks = json.loads((folder / f"{name}-{size}" / "run.json").read_text())["ranks"]
    assert len(ranks) == size
    assert sum(rank["migrated"] for rank in ranks) > 50
    assert sum(rank["bytes"] for rank in ranks) > 0
