"""Save and resume: a resumed run equals the uninterrupted one bit for bit.

HDF5, float64, written beside its place and moved over it. It holds the moving state, the loads of the present instant and
the memory of every contact, keyed by grain ids and walls; lists are made anew, which changes no bit of the result.
"""

import json
from pathlib import Path

import h5py
import numpy as np
import warp as wp

from warpdem.errors import SceneError
from warpdem.summary import scene_hash
from warpdem.write_tables import replaced

FORMAT = "warpdem checkpoint 1"


def save(sim, path: Path) -> None:
    """Write the present state of ``sim`` to ``path``.

    Raises:
        SceneError: if the file cannot be written.
    """
    path = Path(path)
    sim._prepare()
    force, torque = sim.loads()
    try:
        with replaced(path) as part, h5py.File(part, "w") as file:
            file.attrs["format"] = FORMAT
            file.attrs["scene"] = sim.scene.model_dump_json()
            file.attrs["base"], file.attrs["source"] = str(sim.scene.base.resolve()), sim.scene.source
            file.attrs["scene_hash"] = scene_hash(sim.scene)
            file.attrs["step"], file.attrs["dt"] = sim.step_number, sim.dt
            rank = sim.state.rank
            for name in ("record", "inverse", "id", "kind"):
                file[name] = getattr(sim.state, name).numpy()[rank]
            file["load"] = np.concatenate([force, torque], axis=1)
            file["extreme"] = sim.stepper.extreme
            for name, values in {**_pairs(sim), **_places(sim)}.items():
                file[name] = values
    except OSError as error:
        raise SceneError(f"{path}: checkpoint cannot be written ({error})") from error


def _pairs(sim) -> dict[str, np.ndarray]:
    """Memory of the listed grain-grain contacts."""
    lists, count = sim.lists, sim.lists.contact_count
    if not count or not sim.plan.memory:
        return {"pair": np.zeros((0, 2), dtype=np.int64), "pair_memory": np.zeros((0, max(sim.plan.memory, 1)))}
    ids = sim.state.id.numpy()
    pair = np.stack([ids[a.numpy().ravel()[:count]] for a in (lists.owner, lists.partner)], axis=1)
    memory = lists.memory.numpy().transpose(0, 2, 1).reshape(-1, sim.plan.memory)[:count]
    kept = np.any(memory != 0.0, axis=1)  # no memory and a memory of zeros are the same
    return {"pair": pair[kept], "pair_memory": memory[kept]}


def _places(sim) -> dict[str, np.ndarray]:
    """Memory of the grain-wall contacts, in the order of their rows."""
    names = ["point", "normal", *(["spring"] if sim.plan.memory >= 3 else []), *(["angle"] if sim.plan.memory == 6 else [])]
    rows = sim.lists.rows
    if rows is None or not sim.lists.row_count:
        return {}
    parity = sim.step_number & 1
    g = rows.grain.numpy()
    count = rows.place_count.numpy()[parity, g]
    slot = np.repeat(rows.first.numpy()[g] - np.cumsum(count) + count, count) + np.arange(count.sum())
    out = {f"place_{n}": getattr(rows, f"place_{n}").numpy()[parity, slot] for n in names}
    out["place_grain"] = sim.state.id.numpy()[np.repeat(g, count)]
    out["place_wall"] = rows.place_wall.numpy()[parity, slot]
    out["place_overlap"] = rows.place_overlap.numpy()[parity, slot]
    return out


def read(path: Path) -> dict:
    """Contents of a checkpoint.

    Raises:
        SceneError: if it is missing, damaged, or not a checkpoint of this version.
    """
    path = Path(path)
    if not path.exists():
        raise SceneError(f"{path}: no checkpoint there")
    try:
        with h5py.File(path, "r") as file:
            if file.attrs.get("format") != FORMAT:
                raise SceneError(f"{path}: not a checkpoint of this version ({FORMAT!r})")
            return {**{k: file[k][()] for k in file}, **dict(file.attrs)}
    except (OSError, KeyError) as error:
        raise SceneError(f"{path}: damaged or not a checkpoint ({error})") from error


def scene_of(data: dict):
    """The scene that a checkpoint belongs to."""
    from warpdem.scene import Scene

    values = json.loads(data["scene"])
    return Scene.model_validate({**values, "base": data["base"], "source": data["source"]})


def restore(sim, path: Path) -> None:
    """Bring ``sim`` to the state of the checkpoint at ``path``.

    Raises:
        SceneError: if it cannot be read or belongs to another scene.
    """
    data = read(path)
    if data["scene_hash"] != scene_hash(sim.scene) or data["dt"] != sim.dt:
        raise SceneError(f"{path}: belongs to another scene or time step than {sim.scene.source}; nothing was changed")
    state = sim.state
    for name in ("record", "inverse", "id", "kind"):
        array = getattr(state, name)
        setattr(state, name, wp.array(data[name], dtype=array.dtype, device=sim.device))
    state.rank = np.arange(len(state))
    sim.step_number = int(data["step"])
    sim.stepper.restore(data["extreme"])
    sim.lists.restore(data)
    sim._forces_ready = True

