"""Frames that several ranks write in pieces hold what one process writes, put together."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from pxr import Usd

pytest.importorskip("mpi4py")

from rank_scenes import SCENES, in_pieces
from warpdem import Simulation, load_scene
from warpdem.app.phases import run
from warpdem.output.read_vtk import read_frame, read_results
from warpdem.output.read_vtkhdf import read_vtkhdf
from warpdem.ranks import launcher

PROGRAM = Path(__file__).parents[1] / "helpers" / "rank_program.py"
TASKS = [("milled", "3"), ("clumped", "2+3"), ("clumped", "3+1"), ("few", "4"), ("soaked", "2"), ("stirred", "3"),
         ("worn", "2"), ("worn", "3"), ("worn", "4"), ("belted", "3"), ("poured", "2")]
SUMMED = [("few", "4"), ("stirred", "3"), ("worn", "2"), ("worn", "3"), ("worn", "4"), ("belted", "3"), ("poured", "2"),
          ("soaked", "2")]
"""Those whose rows are sums, and whose guards need no more."""
CHECKPOINTS = 1
"""That all grains are gathered for: the one at the end; at the start they are not dealt out yet."""
NOT_OF_GRAINS = {"extent", "primvars:displayColor", "dem:groups", "dem:clumps"}
GRAINS, CLUMPS = "/World/Frame/Grains", "/World/Frame/Clumps"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Results of one process in one piece, NAME-1, and over ranks in pieces, NAME-SIZE."""
    folder = tmp_path_factory.mktemp("pieces")
    for name in {name for name, _ in TASKS}:
        run(in_pieces(SCENES[name](), "one"), folder / f"{name}-1", quiet=True, picture=False, threads=1)
    begin, environment = launcher.command(4)
    tasks = ",".join(f"{name}-{size}" for name, size in TASKS)
    command = [*begin, sys.executable, PROGRAM, folder, tasks, "pieces"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=900)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


def both(folder: Path, name: str, size: str) -> tuple[Path, Path]:
    return folder / f"{name}-1", folder / f"{name}-{size}"


def assert_equal(one: dict[str, np.ndarray], many: dict[str, np.ndarray]) -> None:
    assert one.keys() == many.keys()
    for key, values in one.items():
        assert values.dtype == many[key].dtype
        assert_array_equal(many[key], values, err_msg=key)


@pytest.mark.parametrize("read", [read_results, read_vtkhdf])
@pytest.mark.parametrize(("name", "size"), TASKS)
def test_vtk_pieces_hold_the_frames_of_one_process(folder, name, size, read):
    """Array by array, in the order of one process, by the files of VTK and those of VTKHDF."""
    one, many = (read(path) for path in both(folder, name, size))
    assert_array_equal(many.times, one.times)
    for k in range(len(one.times)):
        alone, shared = one.frame(k), many.frame(k)
        assert alone.step == shared.step
        assert_array_equal(alone.frame.rotation, shared.frame.rotation)
        assert_equal(one.fields(k), many.fields(k))
        assert_array_equal(alone.position, shared.position)
        assert_array_equal(alone.velocity, shared.velocity)
        assert_equal(one.clumps(k), many.clumps(k))
        assert one.has_contacts == many.has_contacts
        if one.has_contacts:
            assert_equal(one.contacts(k), many.contacts(k))
        for wall, other in zip(one.walls(k), many.walls(k), strict=True):
            assert wall.name == other.name
            assert_array_equal(other.vertices, wall.vertices)
            assert_equal(one.fields(k, wall.name), many.fields(k, wall.name))


@pytest.mark.parametrize(("name", "size"), TASKS)
def test_all_else_is_as_without_pieces(folder, name, size):
    """History, grid and state."""
    for file in ("history.csv", "grid.pvd"):
        written = [path / file for path in both(folder, name, size) if (path / file).exists()]
        assert len({path.read_bytes() for path in written}) == bool(written)
    hashes = {json.loads((path / "run.json").read_text())["state_hash"] for path in both(folder, name, size)}
    assert len(hashes) == 1


@pytest.mark.parametrize(("name", "size"), SUMMED)
def test_nothing_is_gathered_between_checkpoints(folder, name, size):
    """Rows of the history, looks of guards and frames in pieces come from what each rank holds, whole columns do not."""
    record = json.loads((folder / f"{name}-{size}" / "run.json").read_text())
    rows = (folder / f"{name}-{size}" / "history.csv").read_text().splitlines()
    assert len(rows) > 4
    assert [rank["gathers"] for rank in record["ranks"]] == [CHECKPOINTS] * int(size)


def test_columns_of_single_grains_are_gathered_for(folder):
    """Those of regions and observers, so the count above is one of gathers."""
    record = json.loads((folder / "milled-3" / "run.json").read_text())
    assert record["ranks"][0]["gathers"] > CHECKPOINTS


def test_each_rank_writes_its_own_grains(folder):
    """The frames have pieces of several ranks, none of which is the whole, and a rank without grains writes none."""
    for name, size, first, last in (("milled", "3", 3, 3), ("clumped", "2+3", 2, 3), ("clumped", "3+1", 3, 1)):
        files = read_results(folder / f"{name}-{size}").grain_files
        assert [len(files[0]), len(files[-1])] == [first, last]
        assert all(len(read_frame(path).id) for of in files for path in of)
    for files in read_results(folder / "few-4").grain_files:  # three grains
        counts = {path.stem[-1]: len(read_frame(path).id) for path in files}
        assert sum(counts.values()) == 3
        assert all(count or part == "0" for part, count in counts.items())


def in_usd(folder: Path, kind: str, code: float) -> dict[str, np.ndarray]:
    """Arrays of all grains or clumps of a stage at a time code, in order of id."""
    stage = Usd.Stage.Open(str(folder / "result.usda"))
    prims = [prim for prim in stage.GetPrimAtPath("/World/Frame").GetChildren() if str(prim.GetPath()).startswith(kind)]
    pieces = []
    for prim in prims:
        held = {one.GetName(): np.array(one.Get(code)) for one in prim.GetAttributes() if one.GetTypeName().isArray}
        count = len(held["ids"])
        pieces += [{key: values for key, values in held.items() if values.shape[:1] == (count,)}] if count else []
    order = np.argsort(np.concatenate([[], *(piece["ids"] for piece in pieces)]), kind="stable")
    names = set.intersection(*(set(piece) for piece in pieces)) if pieces else set()
    return {key: np.concatenate([piece[key] for piece in pieces])[order] for key in names - NOT_OF_GRAINS}


@pytest.mark.parametrize(("name", "size"), TASKS)
def test_usd_pieces_hold_the_frames_of_one_process(folder, name, size):
    """At every frame, in one stage whose root refers to a layer of each rank."""
    one, many = both(folder, name, size)
    times = read_results(one).times
    kinds, seen = [GRAINS, *[CLUMPS] * (name == "clumped")], set()
    for code in np.round(1000.0 * times, 6):
        for kind in kinds:
            alone, shared = in_usd(one, kind, code), in_usd(many, kind, code)
            seen |= alone.keys()
            assert_equal(alone, shared)
    assert {"ids", "velocities", "primvars:dem:positions"} <= seen


def test_a_scene_starts_from_usd_pieces_as_from_a_whole_frame(folder):
    """Grains keep their ids."""
    hashes = set()
    for path in both(folder, "stirred", "3"):
        sim = Simulation(load_scene(path / "result.usda", at=1e-3), device="cpu", threads=1)
        sim.step(10)
        hashes.add(sim.state_hash())
    assert len(hashes) == 1
