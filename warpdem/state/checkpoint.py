"""Save and resume: a resumed run equals the uninterrupted one bit for bit.

HDF5, float64, written beside its place and moved over it. It holds the moving state, and of every contact the memory and
the forces of the present instant, keyed by grain ids and walls; lists are rebuilt, which changes no bit of the result.
What is no array stands as JSON in the attributes ``scene`` and ``about``; ``digest`` tells damage anywhere in the file.
Arrays are brought in order and written block by block (``blocks``): saving takes little memory beside that of the run.
"""

import hashlib
import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import h5py
import numpy as np

from warpdem.core.access import Access, access_of_file
from warpdem.core.atomic_file import replaced
from warpdem.errors import SceneError
from warpdem.kernels import grain
from warpdem.scene.model import Scene
from warpdem.state import contact_history
from warpdem.state.blocks import FileSink, Rows, each_block
from warpdem.state.view import RunView

if TYPE_CHECKING:
    from warpdem.engine.neighbor_list import NeighborLists

FORMAT = "warpdem checkpoint 4"
MAY_CHANGE = {
    "output.checkpoint_interval", "output.checkpoint_wall_time", "output.picture", "engine.skin", "engine.guards",
    "engine.max_overlap", "start.checkpoint",
}  # fmt: skip
"""Keys of a scene that change no bit of a state or a frame: a run may go on with others. A start's contents count, not its
place."""


class Part(Protocol):
    """A part of a run that a checkpoint holds."""

    def state(self) -> Any:
        """What a checkpoint holds of it, as JSON."""

    def restore(self, state: Any) -> None:
        """Take over what ``state`` gave."""


class GuardsPart(Protocol):
    """What guards keep between looks."""

    def state(self) -> dict[str, Any]:
        """What a checkpoint holds of them, as JSON."""

    def arrays(self) -> dict[str, np.ndarray]:
        """What they keep of each grain."""

    def restore(self, data: dict[str, Any]) -> None:
        """Take over both from a checkpoint."""


class EnginePart(Protocol):
    """What runs the steps."""

    def restore(self, extreme: np.ndarray) -> None:
        """Take over the largest overlaps and approach speeds so far, shape (4,); schedule and structs are made again."""


class Run(Protocol):
    """A run as checkpoints are saved of it and restored to it."""

    @property
    def view(self) -> RunView:
        """The run as readers see it, the forces of the present time evaluated."""

    @property
    def live(self) -> RunView:
        """The same, whether its forces are evaluated or not."""

    @property
    def streams(self) -> Part:
        """Streams, which insert grains."""

    @property
    def guards(self) -> GuardsPart:
        """Guards."""

    @property
    def engine(self) -> EnginePart:
        """What runs the steps."""

    @property
    def lists(self) -> "NeighborLists":
        """Neighbor lists."""

    @property
    def left(self) -> dict[str, list[float]]:
        """Number and mass [kg] of the grains that each border or outlet took, by its name."""


def save(run: Run, path: str | Path) -> None:
    """Write the present state of ``run`` to ``path``.

    Raises:
        OutputError: if the file cannot be written; an older one is as it was.
    """
    view = run.view  # first: grains may leave while forces are evaluated
    arrays = {**_arrays(view), **run.guards.arrays()}
    about = {
        **_about(view),
        "left": run.left,
        "feeders": run.streams.state(),
        "next_id": view.state.next_id,
        "budget": view.totals.state() if view.totals is not None else None,
        "guards": run.guards.state(),
    }
    with replaced(Path(path)) as part, open(part, "w+b", buffering=0) as file:
        sink = FileSink(file)
        _write(sink, view.model.given.json, json.dumps(about), arrays)
        sink.raise_failure()
        os.fsync(file.fileno())


def _about(view: RunView) -> dict[str, Any]:
    """What a checkpoint holds of model and clock."""
    scene, given = view.model.scene, view.model.given
    return {
        "base": str(scene.base.resolve()),
        "source": scene.source,
        "scene_hash": given.hash,
        "files": given.files,
        "groups": scene.groups,
        "driven": {name: one.state() for name, one in view.model.schedule.driven.items() if one.is_changed},
        "dynamic": {one.wall.name: one.saved() for one in view.model.schedule.dynamic},
        "motions": {
            "frame": scene.model_dump(mode="json", include={"frame"})["frame"],
            "walls": {wall.name: wall.model_dump(mode="json", include={"motion"})["motion"] for wall in scene.walls},
            "servos": {wall.name: wall.servo.elapsed for wall in scene.walls if wall.servo is not None},
            "surfaces": {w.name: w.surface_velocity.elapsed for w in scene.walls if w.surface_velocity is not None},
        },
        "places": _places(view),
        "step": view.clock.step_number,
        "dt": view.clock.dt,
    }


def _arrays(view: RunView) -> dict[str, Rows | np.ndarray]:
    """The arrays of a checkpoint, those of grains in order of id.

    Beside the state, velocity [m/s] and spin [rad/s] of this instant, absolute, in frame axes: another scene starts from them.
    """
    features, state = view.model.features, view.state
    _, velocity, spin = (array.numpy() for array in view.reader.read())
    record, rank = state.record.numpy(), state.rank
    pose = view.model.schedule.pose(view.clock.time)

    def absolute_velocity(part: slice) -> np.ndarray:
        found = velocity[rank[part]]
        if features.backend.scheme.RELATIVE:
            found = found + pose.velocity_at(record[rank[part], grain.POSITION])
        return found

    def absolute_spin(part: slice) -> np.ndarray:
        found = spin[rank[part]]
        if features.backend.scheme.RELATIVE or not features.contact.spins:  # what nothing rotates rests in the frame
            found = found + pose.spin
        return found

    shape = (len(rank), 3)
    readings: dict[str, Rows | np.ndarray] = {
        "velocity": Rows(shape, velocity.dtype, absolute_velocity),
        "spin": Rows(shape, spin.dtype, absolute_spin),
        "extreme": view.reader.extreme,
    }
    out: dict[str, Rows | np.ndarray] = {}
    out |= {name: Rows.picked(values, rank) for name, values in state.arrays().items()}
    return out | readings | contact_history.read(view)


def _places(view: RunView) -> dict[str, Any]:
    """Where frame and walls stand, matrices of shape (3, 4): the frame in the laboratory, walls in the frame."""
    schedule, time = view.model.schedule, view.clock.time
    pose = schedule.frame.pose(np.array([time]))
    walls = [np.hstack([body[:9].reshape(3, 3), body[9:12, None]]).tolist() for body in schedule.bodies(time)]
    return {
        "frame": np.hstack([pose.axes[0], pose.origin[0][:, None]]).astype(float).tolist(),
        "walls": dict(zip((wall.name for wall in view.model.scene.walls), walls, strict=True)),
    }


def _write(sink: FileSink, scene: str, about: str, arrays: dict[str, Rows | np.ndarray]) -> None:
    """Write the file."""
    digest = hashlib.sha256((scene + about).encode())
    with h5py.File(sink, "w") as file:
        file.attrs["format"], file.attrs["scene"], file.attrs["about"] = FORMAT, scene, about
        for name in sorted(arrays):
            values = arrays[name]
            digest.update(_head(name, values))
            data = file.create_dataset(name, shape=values.shape, dtype=values.dtype)
            for part, block in each_block(values):
                digest.update(_bytes(block))
                data[part] = block
        file.attrs["digest"] = digest.hexdigest()


def _digest(text: str, arrays: dict[str, np.ndarray]) -> str:
    """SHA-256 of all that a checkpoint holds."""
    digest = hashlib.sha256(text.encode())
    for name in sorted(arrays):
        digest.update(_head(name, arrays[name]))
        digest.update(_bytes(arrays[name]))
    return digest.hexdigest()


def _head(name: str, values: Rows | np.ndarray) -> bytes:
    """What the digest takes of an array before its numbers."""
    return f"{name} {values.dtype.str} {tuple(values.shape)}".encode()


def _bytes(values: np.ndarray) -> memoryview:
    """The numbers of an array as the digest takes them, without a copy where they lie side by side."""
    return np.ascontiguousarray(values).reshape(-1).data


def read(path: str | Path) -> dict[str, Any]:
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


def scene_of(data: dict[str, Any], plugins: Sequence[str | Path] = ()) -> Scene:
    """The scene that a checkpoint belongs to; it loads code from no other files than ``plugins``."""
    from warpdem.scene.file import scene_from_dict

    access = Access(plugins=access_of_file(Path(), plugins=plugins).plugins)
    return scene_from_dict(data["scene"], data["base"], data["source"], access)


def refuse_other(data: dict[str, Any], scene: Scene, files: dict[str, str], scene_hash: str) -> None:
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


def _check(view: RunView, data: dict[str, Any]) -> None:
    """Refuse what another scene was run to, or at another time step."""
    given, dt = view.model.given, view.clock.dt
    refuse_other(data, given.scene, given.files, given.hash)
    if data["dt"] != dt:
        raise SceneError(
            f"{data['path']}: belongs to another time step, {data['dt']!r} s, than this run, {dt!r} s; nothing was changed"
        )


def _changed(there: dict[str, Any], here: dict[str, Any]) -> list[str]:
    """Keys whose values differ, those of tables that both have one by one: output.interval."""
    out = []
    for key in {**here, **there}:
        old, new = there.get(key), here.get(key)
        if old != new:
            if isinstance(old, dict) and isinstance(new, dict):
                out += [f"{key}.{inner}" for inner in _changed(old, new)]
            else:
                out.append(key)
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


def restore(run: Run, data: dict[str, Any]) -> None:
    """Bring ``run`` to the state that ``data``, as ``read`` gives it, holds.

    Raises:
        SceneError: if it belongs to another scene or time step; ``run`` is unchanged then.
    """
    view = run.live
    _check(view, data)
    view.state.restore(data)
    view.clock.step_number = data["step"]
    for name, state in data.get("driven", {}).items():
        view.model.schedule.driven[name].restore(state)
    for one in view.model.schedule.dynamic:
        one.restore(data["dynamic"][one.wall.name])
    run.engine.restore(data["extreme"])
    run.left.update(data["left"])
    run.streams.restore(data["feeders"])
    if view.totals is not None:
        view.totals.restore(data["budget"])
    contact_history.restore(run.lists, data)
    run.guards.restore(data)
    view.clock.forces_evaluated = True
