"""Runs killed with -9 at any moment: each goes on from its checkpoint, and in the end nothing tells it from a whole run."""

import functools
import json
import mmap
import os
import random
import signal
import subprocess
import sys
import time
import traceback
from pathlib import Path

import h5py
import numpy as np
import pytest

INTERVAL = 40  # steps between checkpoints
STEPS = 600


def scene():
    """Twelve grains that fall on a floor and roll, with a mesh beside them that turns."""
    import trimesh

    from warpdem import Scene

    mesh = Path("box.stl")
    if not mesh.exists():
        trimesh.creation.box((0.05, 0.05, 0.05)).export(mesh)
    rng = np.random.default_rng(12)
    cell = np.stack(np.meshgrid(np.arange(2), np.arange(2), np.arange(3), indexing="ij"), axis=-1).reshape(-1, 3)
    return Scene.model_validate(
        {
            "gravity": [0, 0, -60],
            "materials": {"glass": {"density": 2500, "young_modulus": 1e7, "poisson_ratio": 0.3}},
            "contact": {"rolling": "constant"},
            "pairs": [{"materials": ["glass", "glass"], "restitution": 0.6, "friction": 0.5, "rolling_friction": 0.1}],
            "grains": [
                {"material": "glass", "positions": cell * 2.05e-3 - [0, 0, 0.0238], "radius": 1e-3,
                 "velocities": rng.normal(0, 0.05, (12, 3))}
            ],
            "walls": [{"name": "box", "material": "glass", "mesh": str(mesh), "motion": {"axis": [0, 0, 1], "rate": 20}}],
            "time": {"end": STEPS * 1e-5, "step": 1e-5, "max_speed": 1},
            "output": {"interval": 6e-4, "picture": False, "checkpoint_interval": INTERVAL * 1e-5,
                       "formats": ["vtk", "usd", "vtkhdf"]},
            "engine": {"max_overlap": 0.3},
        }
    )  # fmt: skip


class Runs:
    """Runs in processes of their own, which share this one's compiled kernels, and the step that each has reached."""

    def __init__(self) -> None:
        self.reached = mmap.mmap(-1, 8)
        # what all of them import, and compile
        import pxr.UsdGeom
        import pxr.UsdPhysics  # noqa: F401
        import vtkmodules.util.numpy_support
        import vtkmodules.vtkIOXML  # noqa: F401

        from warpdem import Simulation

        sim = Simulation(scene(), device="cpu", threads=1)
        sim.step()
        sim.snapshot()

    def start(self, folder: str, trap=lambda: None) -> int:
        """Process that runs the scene in ``folder``, or goes on with it; ``trap`` prepares its end."""
        self.reached[:] = bytes(8)
        pid = os.fork()
        if pid:
            return pid
        from warpdem import simulation
        from warpdem.app import run

        step = simulation.Simulation.step

        def told(sim, count=1):
            step(sim, count)
            self.reached[:] = sim.step_number.to_bytes(8, "little")

        simulation.Simulation.step = told
        try:
            trap()
            out = Path(folder)
            out.mkdir(exist_ok=True)
            resume = (out / run.CHECKPOINT).exists()
            run.run_scene(scene(), out, device="cpu", threads=1, quiet=True, resume=resume, overwrite=not resume)
        except BaseException:
            traceback.print_exc()
            os._exit(1)
        os._exit(0)

    def ended(self, pid: int) -> bool:
        """Wait for the process; whether it was killed."""
        code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
        if code not in (0, -signal.SIGKILL):
            sys.exit(f"a run ended with {code}")
        return code != 0

    def steps_lost(self, folder: str) -> int:
        """Steps since the checkpoint that a killed run left."""
        reached = int.from_bytes(self.reached[:], "little")
        with h5py.File(Path(folder) / "checkpoint.h5") as file:
            return reached - json.loads(file.attrs["about"])["step"] if reached else 0


def die() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def before_replace(number: int):
    """Die when the ``number``-th file has been written beside its place."""

    def trap():
        real, count = os.replace, [0]

        def replace(*paths):
            count[0] += 1
            if count[0] == number:
                die()
            real(*paths)

        os.replace = replace

    return trap


def in_part(number: int):
    """Die when the ``number``-th file is half there, beside its place."""

    def trap():
        real, count = os.replace, [0]

        def replace(part, path):
            count[0] += 1
            if count[0] == number:
                os.truncate(part, os.path.getsize(part) // 2)
                die()
            real(part, path)

        os.replace = replace

    return trap


def in_row(number: int):
    """Die within the ``number``-th row of the history, inside a number."""

    def trap():
        from warpdem.output.write_tables import HistoryWriter

        real, count = HistoryWriter.write, [0]

        def write(self, values):
            count[0] += 1
            real(self, values)
            if count[0] == number:
                os.truncate(self._path, self._path.stat().st_size - 8)
                die()

        HistoryWriter.write = write

    return trap


# files in the order of a run: run.json, history.csv; the first frame, 3 to 14; checkpoints 15 and 16; the second frame:
# grains 17, box, result.pvd 19, chunk 20, state, result.usda 22, journals 23 and 24; checkpoint 25; and, with a row and a
# checkpoint at the same step, the third frame: 26 to 33
TRAPS = {
    **{
        f"before file {k}": before_replace(k)
        for k in (16, 28, 31, 2, 5, 8, 11, 12, 13, 14, 15, 17, 19, 20, 21, 22, 23, 24, 34)
    },
    **{f"in file {k}": in_part(k) for k in (16, 15, 5, 11, 13, 14, 19, 20, 22, 23, 34)},
    **{f"in row {k}": in_row(k) for k in (9, 1, 2, 4)},
}
FEW = ("before file 16", "before file 28", "before file 31", "in file 16", "in row 9")


def main(mode: str, seed: str = "0") -> None:
    """Kill runs in the present folder as ``mode`` says, and print what came of it as JSON."""
    runs, told = Runs(), {"lost": [], "killed": 0}
    begin = time.perf_counter()
    runs.ended(runs.start("whole"))
    whole = time.perf_counter() - begin
    if mode in ("few traps", "all traps"):
        for name in FEW if mode == "few traps" else TRAPS:
            killed = runs.ended(runs.start(name, TRAPS[name]))
            told["killed"] += killed
            told["lost"].append(runs.steps_lost(name) if (Path(name) / "checkpoint.h5").exists() else 0)
            runs.ended(runs.start(name))
    else:
        rng = random.Random(int(seed))
        number = 0
        while told["killed"] < int(mode):
            number += 1
            folder = f"random {number}"
            while True:
                pid = runs.start(folder)
                time.sleep(rng.uniform(0.0, 0.8) * whole)
                if told["killed"] < int(mode):
                    os.kill(pid, signal.SIGKILL)
                killed = runs.ended(pid)
                told["killed"] += killed
                if (Path(folder) / "checkpoint.h5").exists():
                    told["lost"].append(runs.steps_lost(folder) if killed else 0)
                if not killed:
                    break
    sys.stdout.write(json.dumps(told))


def killed_runs(folder: Path, *arguments: str) -> dict:
    command = [sys.executable, str(Path(__file__).resolve()), *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=folder, timeout=600)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


@functools.cache
def stage_values(folder: Path) -> dict:
    """All values of a USD result by attribute and time code."""
    from pxr import Usd

    stage = Usd.Stage.Open(str(folder / "result.usda"))
    prims = [prim for prim in stage.Traverse() if prim.GetTypeName() in ("Points", "Mesh", "Xform")]
    out = {}
    codes = np.round(np.arange(STEPS // 60 + 1) * 0.6, 6)
    for prim in prims:
        for attribute in prim.GetAttributes():
            if attribute.GetName().startswith(("points", "velocities", "ids", "widths", "force", "primvars:", "xformOp")):
                out[str(attribute.GetPath())] = [str(attribute.Get(code)) for code in codes]
    return out


@functools.cache
def temporal_values(folder: Path) -> dict:
    """All that a VTKHDF result gives, by frame and name."""
    from warpdem.output.read_vtkhdf import read_vtkhdf

    results = read_vtkhdf(folder)
    values = {"times": results.times}
    for k in range(len(results.times)):
        values |= {(k, name): value for name, value in results.fields(k).items()}
        values |= {(k, name, "of the box"): value for name, value in results.fields(k, "box").items()}
        values[k, "corners"] = results.walls(k)[0].vertices
        values[k, "position"] = results.frame(k).position
    return values


def assert_same_results(whole: Path, other: Path) -> None:
    """Two result folders hold the same, byte for byte where the format allows."""
    hashes = [json.loads((f / "run.json").read_text())["state_hash"] for f in (whole, other)]
    assert hashes[0] == hashes[1], other.name
    assert (whole / "history.csv").read_text() == (other / "history.csv").read_text(), other.name
    other_bytes = {"run.json", "checkpoint.h5", "result_usd", "result.usda"}
    names = {path.name for path in whole.iterdir() if path.suffix != ".vtkhdf"} - other_bytes
    assert {path.name for path in other.iterdir() if not path.name.startswith(".")} >= names
    for name in names:
        assert (whole / name).read_bytes() == (other / name).read_bytes(), (other.name, name)
    assert stage_values(whole) == stage_values(other), other.name
    first, second = temporal_values(whole), temporal_values(other)
    assert len(first) > 100
    assert first.keys() == second.keys()
    for name, values in first.items():
        np.testing.assert_array_equal(second[name], values, err_msg=f"{other.name}: {name}")


def check(folder: Path, told: dict) -> None:
    assert max(told["lost"]) <= INTERVAL
    results = [path for path in folder.iterdir() if path.is_dir() and path.name != "whole"]
    assert results
    for path in results:
        assert json.loads((path / "run.json").read_text())["status"] == "done", path.name
        assert_same_results(folder / "whole", path)


needs_fork = pytest.mark.skipif(not hasattr(os, "fork"), reason="the system does not fork processes")


@needs_fork
def test_killed_at_the_worst_moments(tmp_path):
    """Inside a file, between a file and its index, between frame, row and checkpoint."""
    told = killed_runs(tmp_path, "few traps")
    assert told["killed"] == len(FEW)
    check(tmp_path, told)


@needs_fork
@pytest.mark.slow
def test_killed_at_every_moment_between_two_files(tmp_path):
    told = killed_runs(tmp_path, "all traps")
    assert told["killed"] == len(TRAPS)
    check(tmp_path, told)


@needs_fork
@pytest.mark.slow
def test_killed_at_random_moments(tmp_path):
    told = killed_runs(tmp_path, "30", "2")
    assert told["killed"] == 30
    check(tmp_path, told)


if __name__ == "__main__":
    main(*sys.argv[1:])
