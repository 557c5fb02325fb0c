"""A run of a scene with phases: each in a folder of its own, started from the last checkpoint of the one before.

run.json lists the phases and how far each of them is. 1-fill/, 2-turn/ ... hold the results of each phase in its own time;
its last checkpoint is what the next one starts from. result.pvd gives the frames of all phases in one time; picture.png is the
last of them.
"""

import json
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from rich.console import Console

from warpdem.app.final_picture import draw_picture, wants_picture
from warpdem.app.run import run_scene
from warpdem.app.run_folder import CHECKPOINT, check_request, refuse_results
from warpdem.core.atomic_file import replaced
from warpdem.core.run_lock import locked
from warpdem.errors import WarpdemError
from warpdem.model import needs
from warpdem.model.digests import file_digests, scene_hash
from warpdem.output.write_tables import write_run_record
from warpdem.scene.model import Scene
from warpdem.simulation import Simulation
from warpdem.state import checkpoint_file, same_scene
from warpdem.state.restart import started_from

INDICES = ("result.pvd", "contacts.pvd", "clumps.pvd")
"""Time indices that are joined over the phases."""


def run(
    scene: Scene,
    folder: Path | str,
    *,
    until: float | None = None,
    resume: bool = False,
    overwrite: bool = False,
    quiet: bool = False,
    picture: bool | None = None,
    console: Console | None = None,
    device: str | None = None,
    threads: int | None = None,
) -> Simulation:
    """Run ``scene`` and write its results into ``folder``, phase after phase if it has phases.

    Args:
        scene: validated scene.
        folder: where the results go.
        until: end of the whole run [s] instead of the scene's.
        resume: go on from the checkpoints in the folder; phases that are done are not run again.
        overwrite: allow a folder that holds the results of a run.
        quiet: print errors only.
        picture: draw picture.png at the end of the last phase, or not; None as the scene says.
        console: where to print.
        device: as ``run_scene``.
        threads: as ``run_scene``.

    Returns:
        The last simulation.

    Raises:
        WarpdemError: as ``run_scene``.
        KeyboardInterrupt: as ``run_scene``.
    """
    common: dict[str, Any] = {"quiet": quiet, "console": console or Console(), "reported": set()}
    common |= {"device": device, "threads": threads}
    if not scene.phases:
        return run_scene(scene, folder, until=until, resume=resume, overwrite=overwrite, picture=picture, **common)
    folder = Path(folder)
    check_request(folder, until, overwrite or resume)
    for k in range(len(scene.phases)):
        needs.check_grid(scene.phase(k))
    with locked(folder):
        refuse_results(folder, overwrite or resume)  # of a run that has ended meanwhile
        return _run(scene, folder, until, resume, picture, common)


def _run(
    scene: Scene, folder: Path, until: float | None, resume: bool, picture: bool | None, common: dict[str, Any]
) -> Simulation:
    """``run`` of phases in a folder that no other run writes into; ``common`` are the other arguments of ``run_scene``."""
    folders = [folder / f"{k + 1}-{phase.name}" for k, phase in enumerate(scene.phases)]
    begins = [sum(scene.phase(j).time.end for j in range(k)) for k in range(len(folders))]
    requested = len(folders) if until is None else sum(begin < until for begin in begins)
    sim: Simulation | None = None
    for stale in [there / name for there in folders for name in ("run.json", CHECKPOINT, *INDICES) if not resume]:
        stale.unlink(missing_ok=True)
    _write_record(scene, folder, folders, begins, "running")
    status = "failed"
    try:
        for k, (there, begin) in enumerate(zip(folders[:requested], begins[:requested], strict=True)):
            one = scene.phase(k)
            if k:
                one = started_from(one, folders[k - 1] / CHECKPOINT, scene.continues(k))
            end = one.time.end if until is None else min(one.time.end, until - begin)
            if resume and _is_done(there, end) and k + 1 < requested:
                files = file_digests(one)
                with checkpoint_file.opened(there / CHECKPOINT) as saved:
                    same_scene.refuse_other(saved, one, files, scene_hash(one, files))
                continue
            resumes = resume and (k == 0 or (there / CHECKPOINT).exists())
            sim = run_scene(one, there, until=end, resume=resumes, overwrite=True, picture=False, **common)
        status = "done"
    except WarpdemError:
        status = _status(folders[k])
        raise
    except KeyboardInterrupt:
        status = "interrupted"
        raise
    finally:
        if status in ("failed", "interrupted") and not any((there / "run.json").exists() for there in folders):
            (folder / "run.json").unlink(missing_ok=True)  # refused before anything was computed
        else:
            _write_record(scene, folder, folders, begins, status)
        for name in INDICES:
            _join(folder, name, folders, begins)
    if wants_picture(one, picture):
        joined = all("vtk" in scene.phase(k).output.formats for k in range(requested))
        draw_picture(folder if joined else there, folder)
    assert sim is not None  # check_request refuses an end at which no phase has begun
    return sim


def _record(folder: Path) -> dict[str, Any]:
    """run.json of a phase; empty if there is none."""
    try:
        record: dict[str, Any] = json.loads((folder / "run.json").read_text(encoding="utf-8"))
        return record
    except (OSError, ValueError, RecursionError):
        return {}


def _status(folder: Path) -> str:
    return str(_record(folder).get("status", "failed"))


def _is_done(folder: Path, end: float) -> bool:
    """Whether the phase in ``folder`` was run to ``end`` [s]."""
    record = _record(folder)
    return record.get("status") == "done" and record["time"] > end * (1.0 - 1e-9) and (folder / CHECKPOINT).exists()


def _write_record(scene: Scene, folder: Path, folders: list[Path], begins: list[float], status: str) -> None:
    """run.json of the whole."""
    phases = [
        {"name": phase.name, "folder": there.name, "begin": begin, "status": _record(there).get("status", "not begun"),
         "time": _record(there).get("time")}
        for phase, there, begin in zip(scene.phases, folders, begins, strict=True)
    ]  # fmt: skip
    record = {"status": status, "scene": scene.source, "title": scene.title, "scene_hash": scene_hash(scene), "phases": phases}
    write_run_record(folder / "run.json", record)


def _join(folder: Path, name: str, folders: list[Path], begins: list[float]) -> None:
    """One time index over those of the phases; where one phase ends and the next begins, the frame of the end stays."""
    lines = []
    for k, (there, begin) in enumerate(zip(folders, begins, strict=True)):
        if not (there / name).exists():
            break
        for entry in ElementTree.parse(there / name).iter("DataSet"):
            time = float(entry.attrib["timestep"])
            if k == 0 or time > 0.0:
                entry.attrib |= {"timestep": repr(begin + time), "file": f"{there.name}/{entry.attrib['file']}"}
                lines.append(ElementTree.tostring(entry, encoding="unicode").strip())
    if lines:
        text = "\n".join(['<VTKFile type="Collection" version="0.1">', "<Collection>", *lines, "</Collection>"])
        with replaced(folder / name) as part:
            part.write_text(f'<?xml version="1.0"?>\n{text}\n</VTKFile>\n', encoding="utf-8")
