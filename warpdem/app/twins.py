"""Perturbed twins of a run: the same scene, with its grains moved by nothing that matters at the start.

Where grains are chaotic, twins show how far two equal answers lie apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.console import Console

from warpdem.app.run import run_scene
from warpdem.app.run_folder import CHECKPOINT
from warpdem.errors import SceneError
from warpdem.runs import Run, read
from warpdem.runs.run import RECORD
from warpdem.scene.grains import Grains
from warpdem.scene.model import Scene
from warpdem.simulation import Simulation
from warpdem.state import checkpoint_file
from warpdem.state.same_scene import scene_of

FOLDER = "twins"
"""Folder of the twins in that of the run."""
NUDGE = 1e-9
"""Standard deviation of the shift of a centre in each direction, over the radius [-]: a million times the rounding of positions
of a millimetre, and a thousandth of what a contact could feel."""


def make_twins(
    run: Run,
    count: int,
    console: Console,
    device: str | None = None,
    threads: int | None = None,
    plugins: Sequence[str | Path] = (),
) -> list[Path]:
    """Run twins of a run in its folder ``twins``; those that are there are not run again, one that was cut short goes on.

    Args:
        run: the run, with its checkpoint.
        count: how many twins there shall be.
        console: where to print.
        device: as ``Simulation``.
        threads: as ``Simulation``.
        plugins: .py files with models of your own that its scene names.

    Returns:
        Folder of each twin.

    Raises:
        SceneError: the run cannot be repeated: it has phases or clumps, or starts from another, or its checkpoint is
            missing.
        StabilityError: a twin stops itself.
    """
    if run.phases:
        raise SceneError(
            f"{run.folder}: twins of a run with phases are not made; run its scene with other seeds, and give --twin DIR"
        )
    if run.status != "done":
        raise SceneError(
            f"{run.folder}: its run is not finished ({run.status}); go on with it first: warpdem run SCENE --resume"
        )
    with checkpoint_file.opened(run.folder / CHECKPOINT) as saved:
        scene = scene_of(saved, plugins)
    if scene.start is not None:
        raise SceneError(
            f"{run.folder}: twins of a run that starts from another one are not made: they would lose the friction of its "
            "contacts; make twins of that one, start from each, and give --twin DIR"
        )
    if scene.clumps:
        raise SceneError(
            f"{run.folder}: twins of a run with clumps are not made, since their members would be grains of their own; run its "
            "scene with other seeds, and give --twin DIR"
        )
    step = float(run.record["time_step"]["used"])
    scene = scene.model_copy(update={"time": scene.time.model_copy(update={"step": step})})
    first = Simulation(scene, device=device, threads=threads)
    folders = [run.folder / FOLDER / str(k) for k in range(1, count + 1)]
    for k, folder in enumerate(folders, 1):
        there = _status(folder)
        if there == "done":
            continue  # whatever its time: it was run to that of the run
        console.print(f"twin {k} of {count}: {folder}", markup=False)
        run_scene(twin(scene, first, k), folder, device=device, threads=threads, until=float(run.record["time"]), quiet=True,
                  resume=(folder / CHECKPOINT).exists(), overwrite=True, picture=False)  # fmt: skip
    return folders


def twin(scene: Scene, first: Simulation, number: int) -> Scene:
    """The scene with the grains of its start given one by one, each centre moved by `NUDGE` of its radius.

    Streams draw other grains: where a scene has nothing but them, twins differ by these.

    Args:
        scene: of the run.
        first: its simulation before the first step.
        number: of the twin, which its shifts are drawn from.
    """
    p, materials, groups = first.particles, list(scene.materials), scene.groups
    away = NUDGE * p.radius[:, None] * np.random.default_rng(number).standard_normal((len(p.radius), 3))
    position, velocity, spin = p.position + away, p.velocity, p.spin
    entries = []
    for kind, group in sorted(set(zip(p.type.tolist(), p.group.tolist(), strict=True))):
        here = (p.type == kind) & (p.group == group)
        entries.append(Grains.model_validate({
            "name": groups[group], "material": materials[kind], "positions": position[here], "radii": p.radius[here],
            "velocities": velocity[here], "spins": spin[here], "ids": p.id[here], "velocities_in": "frame",
        }))  # fmt: skip
    streams = [stream.model_copy(update={"seed": stream.seed + number}) for stream in scene.streams]
    return scene.model_copy(update={"grains": entries, "streams": streams})


def _status(folder: Path) -> str:
    return read(folder).status if (folder / RECORD).exists() else ""
