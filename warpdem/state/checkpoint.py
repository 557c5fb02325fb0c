"""Save and resume: a resumed run equals the uninterrupted one bit for bit.

HDF5, float64, written beside its place and moved over it. It holds the moving state, and of every contact the memory and
the forces of the present instant, keyed by grain ids and walls; lists are made anew, which changes no bit of the result.
What is no array stands as JSON in the attributes ``scene`` and ``about``; ``digest`` tells damage anywhere in the file.
"""

import hashlib
import json
import os
from collections.abc import Sequence
from pathlib import Path

import h5py
import numpy as np

from warpdem.core.access import Access, access_of_file
from warpdem.core.atomic_file import replaced
from warpdem.errors import SceneError
from warpdem.kernels import grain
from warpdem.state import contact_history

FORMAT = "warpdem checkpoint 4"
MAY_CHANGE = {
    "output.checkpoint_interval", "output.checkpoint_wall_time", "output.picture", "engine.skin", "engine.guards",
    "engine.max_overlap", "start.checkpoint",
}  # fmt: skip
"""Keys of a scene that change no bit of a state or a frame: a run may go on with others. A start's contents count, not its
place."""


def save(sim, path: Path) -> None:
    """Write the present state of ``sim`` to ``path``.

    Raises:
        OutputError: if the file cannot be written; an older one is as it was.
    """
    arrays = _arrays(sim)  # first: it evaluates the forces, where grains may leave
    image = _image(sim.model.given.json, json.dumps(_about(sim)), arrays)
    # the file is made in memory: HDF5 cannot close a file on a full disk
    with replaced(Path(path)) as part, open(part, "wb") as file:
        file.write(image)
        file.flush()
        os.fsync(file.fileno())


def _about(sim) -> dict:
    """What a checkpoint holds beside arrays."""
    scene = sim.scene
    return {
        "base": str(scene.base.resolve()),
        "source": scene.source,
        "scene_hash": sim.model.given.hash,
        "files": sim.model.given.files,
        "groups": scene.groups,
        "motions": {
            "frame": scene.model_dump(mode="json", include={"frame"})["frame"],
            "walls": {wall.name: wall.model_dump(mode="json", include={"motion"})["motion"] for wall in scene.walls},
        },
        "places": _places(sim),
        "step": sim.step_number,
        "dt": sim.dt,
        "left": sim.left,
        "feeders": [inlet.state() for inlet in sim.inlets],
        "next_id": sim._next_id,
        "budget": sim.budget.state() if sim.budget is not None else None,
        "guards": sim.guards.state(),
    }


def _arrays(sim) -> dict[str, np.ndarray]:
    """The arrays of a checkpoint, those of grains in order of id.

    Beside the state, velocity [m/s] and spin [rad/s] of this instant, absolute, in frame axes: another scene starts from them.
    """
    _, _, velocity, spin = sim.readings()
    pose = sim.schedule.pose(sim.time)
    if sim.plan.backend.scheme.RELATIVE:
        velocity = velocity + pose.velocity_at(sim.state.by_id(grain.POSITION))
    if sim.plan.backend.scheme.RELATIVE or not sim.plan.contact.spins:  # what nothing turns rests in the frame
        spin = spin + pose.spin
    readings = {"velocity": velocity, "spin": spin, "extreme": sim.engine.extreme}
    return {**sim.state.by_rank(), **readings, **contact_history.read(sim.lists), **sim.guards.arrays()}


def _places(sim) -> dict:
    """Where frame and walls stand, matrices of shape (3, 4): the frame in the laboratory, walls in the frame."""
    pose = sim.schedule.frame.pose(np.array([sim.time]))
    bodies = sim.schedule.bodies(sim.time)
    walls = [np.hstack([body[:9].reshape(3, 3), body[9:12, None]]).tolist() for body in bodies]
    return {
        "frame": np.hstack([pose.axes[0], pose.origin[0][:, None]]).astype(float).tolist(),
        "walls": dict(zip((wall.name for wall in sim.scene.walls), walls, strict=True)),
    }


def _image(scene: str, about: str, arrays: dict[str, np.ndarray]) -> bytes:
    """Bytes of the file."""
    with h5py.File("checkpoint", "w", driver="core", backing_store=False) as file:
        file.attrs["format"], file.attrs["scene"], file.attrs["about"] = FORMAT, scene, about
        file.attrs["digest"] = _digest(scene + about, arrays)
        for name, values in arrays.items():
            file[name] = values
        file.flush()
        return file.id.get_file_image()


def _digest(text: str, arrays: dict[str, np.ndarray]) -> str:
    """SHA-256 of all that a checkpoint holds."""
    digest = hashlib.sha256(text.encode())
    for name in sorted(arrays):
        values = np.ascontiguousarray(arrays[name])
        digest.update(f"{name} {values.dtype.str} {values.shape}".encode())
        digest.update(values.tobytes())
    return digest.hexdigest()


def read(path: Path) -> dict:
    """Contents of a checkpoint: its arrays, and what ``about`` holds.

    Raises:
        SceneError: if it is missing, damaged, or not a checkpoint of this version.
    """
    path = Path(path)
    if not path.exists():
        raise SceneError(f"{path}: no checkpoint there")
    try:
        with h5py.File(path, "r") as file:
            found = file.attrs.get("format")
            if found != FORMAT:
                known = isinstance(found, str) and found.startswith("warpdem checkpoint")
                what = f"a checkpoint of another version ({found!r})" if known else "an HDF5 file, but not a checkpoint"
                raise SceneError(f"{path}: {what}; this version reads {FORMAT!r}")
            for name in file:
                _require_stored(file, name, path.stat().st_size)
            scene, about, digest = (file.attrs[name] for name in ("scene", "about", "digest"))
            arrays = {name: file[name][()] for name in file}
            if digest != _digest(scene + about, arrays):
                raise SceneError(f"{path}: damaged: its content is not what was written")
            return {**arrays, **json.loads(about), "scene": json.loads(scene), "path": path}
    except (OSError, KeyError, RuntimeError, ValueError, TypeError, AttributeError, MemoryError) as error:
        raise SceneError(f"{path}: damaged or not a checkpoint ({error})") from error


def _require_stored(file: h5py.File, name: str, size: int) -> None:
    """Refuse an array that claims more than its file of ``size`` bytes holds, or that lies in another file.

    Raises:
        ValueError: it does.
    """
    link, held = file.get(name, getlink=True), None
    if isinstance(link, h5py.HardLink):
        held = file[name]
    if not isinstance(held, h5py.Dataset) or held.is_virtual or held.external:
        raise ValueError(f"{name} is no array in this file")
    if held.nbytes > size:
        raise ValueError(f"{name} claims {held.nbytes} bytes in a file of {size}")


def scene_of(data: dict, plugins: Sequence[str | Path] = ()):
    """The scene that a checkpoint belongs to; it loads code from no other files than ``plugins``."""
    from warpdem.scene.file import scene_from_dict

    access = Access(plugins=access_of_file(Path(), plugins=plugins).plugins)
    return scene_from_dict(data["scene"], data["base"], data["source"], access)


def refuse_other(data: dict, scene, files: dict[str, str], scene_hash: str) -> None:
    """Refuse to go on with another scene than that of a checkpoint, or the same with other files.

    Args:
        data: the checkpoint, as ``read`` gives it.
        scene: validated scene.
        files: its ``model.digests.file_digests``.
        scene_hash: its ``model.digests.scene_hash``.

    Raises:
        SceneError: with the keys that differ, unless all are among `MAY_CHANGE`.
    """
    if data["scene_hash"] == scene_hash:
        return
    changed = _changed(data["scene"], scene.model_dump(mode="json"))
    keys = [key for key in changed if key not in MAY_CHANGE]
    named = [place for place in {**data["files"], **files} if data["files"].get(place) != files.get(place)]
    if keys or named or not changed:
        raise SceneError(f"{data['path']}: belongs to another scene than {scene.source}: {_told(keys, named)}")


def _check(sim, data: dict) -> None:
    """Refuse what another scene was run to, or at another time step."""
    refuse_other(data, sim.model.given.scene, sim.model.given.files, sim.model.given.hash)
    if data["dt"] != sim.dt:
        raise SceneError(
            f"{data['path']}: belongs to another time step, {data['dt']!r} s, than this run, {sim.dt!r} s; nothing was changed"
        )


def _changed(there: dict, here: dict) -> list[str]:
    """Keys whose values differ, those of tables that both have one by one: output.interval."""
    out = []
    for key in {**here, **there}:
        old, new = there.get(key), here.get(key)
        if old != new:
            both = isinstance(old, dict) and isinstance(new, dict)
            out += [f"{key}.{inner}" for inner in _changed(old, new)] if both else [key]
    return out


def _told(keys: list[str], files: list[str]) -> str:
    """What differs between the scene of a checkpoint and that of the run, and the remedy."""
    if not keys:
        return f"other contents of the file of {', '.join(files)}; nothing was changed"
    said = f"other values of {', '.join(keys)}; nothing was changed; repeat the same --set options, if any were given"
    if any(key.startswith("output.") for key in keys):
        said += "; what is written, and how often, is the same in all of a run: the part before is there already"
    if "time.end" in keys:
        said += "; to end at another time, keep time.end and say --until"
    return said


def restore(sim, data: dict) -> None:
    """Bring ``sim`` to the state that ``data``, as ``read`` gives it, holds.

    Raises:
        SceneError: if it belongs to another scene or time step; ``sim`` is unchanged then.
    """
    _check(sim, data)
    sim.state.restore(data)
    sim._clock.step_number = data["step"]
    sim.engine.restore(data["extreme"])
    sim.engine.leavers.left = data["left"]
    sim._next_id, sim._grown = data["next_id"], False
    for inlet, state in zip(sim.inlets, data["feeders"], strict=True):
        inlet.restore(state)
    if sim.budget is not None:
        sim.budget.restore(data["budget"])
    contact_history.restore(sim.lists, data)
    sim.guards.restore(data)
    sim._clock.forces_evaluated = True
