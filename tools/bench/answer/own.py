"""A case run with warpdem, in a process of its own as the peer is: `python own.py JOB.json`."""

import json
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # tools/

import numpy as np
import warp as wp

import warpdem
from bench.answer.cases import Case, Rows, Run, scene_tables


def settled(case: Case, shell: Path | None) -> dict[str, np.ndarray]:
    """The grains that a case starts from: placed at random in its box, and at rest where it says so."""
    low, high = case.diameter
    fill: dict[str, Any] = {"count": case.count, "diameter": {"uniform": [low, high]}, "seed": 1}
    fill |= {"box": case.fill} if shell is None else {"wall": "shell", "region": case.fill}
    tables = scene_tables(case, None if shell is None else str(shell), {"fill": fill}, "auto")
    tables.pop("frame", None)
    sim = warpdem.Simulation(warpdem.Scene.model_validate(tables), device="cpu")
    if case.settle:
        sim.run(until=case.settle)
    p = sim.particles
    return {"x": p.position, "r": p.radius, "v": p.velocity, "w": p.spin}


def work(job: dict[str, Any]) -> dict[str, Any]:
    """What one run reads; all kernels are loaded before, so that no run compiles what another finds ready."""
    scene = warpdem.Scene.model_validate(job["scene"])
    if job["fraction"] != 1.0:
        step = warpdem.Simulation(scene, device="cpu", threads=1).dt * job["fraction"]
        scene = warpdem.Scene.model_validate(job["scene"] | {"time": {"end": scene.time.end, "step": step}})
    sim = warpdem.Simulation(scene, device="cpu", threads=job["threads"])
    sim.load_kernels()
    if job["only_compile"]:
        for thing in vars(sim.kernels.paths).values():
            if isinstance(thing, wp.Kernel):
                wp.load_module(thing.module, device=sim.device)
        sim.step(1)
        _ = sim.particles
        return {}
    begin, rows = time.perf_counter(), []
    for until in job["times"]:
        sim.run(until=until)
        p = sim.particles
        share = p.mass / p.mass.sum()
        x, _, z = share @ p.position_lab
        rows.append((sim.time, float(share[p.position[:, 2] > 0.0].sum()), x, z))
    loop = time.perf_counter() - begin
    overlap = max(sim.extremes["pair_overlap_share"], sim.extremes["wall_overlap_share"])
    return {
        "rows": np.array(rows).T.tolist(),
        "step": sim.dt,
        "steps": sim.step_number,
        "loop": loop,
        "overlap": overlap,
    }


def run(case: Case, grains: Path, shell: Path | None, folder: Path, fraction: float, threads: int,
        only_compile: bool = False) -> Run | None:  # fmt: skip
    """Run a case in a process of its own; None where it only compiles.

    Args:
        case: What is run.
        grains: File of the grains at the start.
        shell: Mesh of the walls; None for planes.
        folder: For files.
        fraction: Time step over that of ``step = "auto"`` [-].
        threads: CPU threads.
        only_compile: Compile its kernels and stop.

    Raises:
        RuntimeError: The run failed; with the end of its output.
    """
    source = {"file": str(grains), "velocities_in": "laboratory"}
    times = np.minimum(case.sample * np.arange(round(case.end / case.sample) + 1), case.end)
    job = {
        "scene": scene_tables(case, None if shell is None else str(shell), source, "auto"),
        "fraction": fraction, "threads": threads, "times": times.tolist(), "only_compile": only_compile,
    }  # fmt: skip
    file = folder / "job.json"
    file.write_text(json.dumps(job))
    done = subprocess.run([sys.executable, __file__, str(file)], check=False, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"warpdem, {case.name}:\n{(done.stdout + done.stderr)[-1500:]}")
    if only_compile:
        return None
    found = json.loads(done.stdout.splitlines()[-1])
    return Run(Rows(*np.array(found["rows"])), found["step"], found["steps"], found["loop"])


if __name__ == "__main__":
    print(json.dumps(work(json.loads(Path(sys.argv[1]).read_text()))))
