"""Save and resume: a resumed run equals the uninterrupted one bit for bit.

HDF5, float64, written beside its place and moved over it. It holds the moving state, and of every contact the memory and
the forces of the present instant, keyed by grain ids and walls; lists are made anew, which changes no bit of the result.
"""

import json
from pathlib import Path

import h5py
import numpy as np

from warpdem.errors import SceneError
from warpdem.kernels import grain
from warpdem.summary import scene_hash
from warpdem.write_tables import replaced

FORMAT = "warpdem checkpoint 3"


def save(sim, path: Path) -> None:
    """Write the present state of ``sim`` to ``path``.

    Raises:
        SceneError: if the file cannot be written.
    """
    path = Path(path)
    sim._prepare()
    try:
        with replaced(path) as part, h5py.File(part, "w") as file:
            file.attrs["format"] = FORMAT
            file.attrs["scene"] = sim.scene.model_dump_json()
            file.attrs["base"], file.attrs["source"] = str(sim.scene.base.resolve()), sim.scene.source
            file.attrs["scene_hash"] = scene_hash(sim.scene)
            file.attrs["step"], file.attrs["dt"] = sim.step_number, sim.dt
            for name in ("record", "inverse", "id", "kind"):
                file[name] = getattr(sim.state, name).numpy()[sim.state.rank]
            file["extreme"] = sim.stepper.extreme
            file.attrs["left"] = json.dumps(sim.left)
            file.attrs["feeders"] = json.dumps([feeder.state() for feeder in sim.feeders])
            file.attrs["next_id"] = sim._next_id
            for name, values in {**sim.lists.pair_contacts(), **sim.lists.wall_contacts()}.items():
                file[name] = values
    except OSError as error:
        raise SceneError(f"{path}: checkpoint cannot be written ({error})") from error


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


def _check(sim, data: dict, path: Path) -> None:
    """Refuse what does not fit ``sim``, before anything is changed."""
    if data.get("scene_hash") != scene_hash(sim.scene) or data.get("dt") != sim.dt:
        raise SceneError(f"{path}: belongs to another scene or time step than {sim.scene.source}; nothing was changed")
    n, plan = len(data.get("id", ())), sim.plan
    shapes = {"record": (n, grain.WIDTH[plan.spins]), "inverse": (n, 2), "id": (n,), "kind": (n,), "extreme": (4,)}
    pairs, places = len(data.get("pair", ())), len(data.get("place_grain", ()))
    shapes |= {"pair": (pairs, 2), "pair_memory": (pairs, max(plan.memory, 1)), "pair_share_i": None, "pair_share_j": None}
    if plan.walls:
        held = ["moment"] * bool(plan.rolling) + ["spring"] * (plan.memory >= 3) + ["angle"] * (plan.memory == 6)
        shapes |= {f"place_{k}": (places, 3) for k in ("point", "normal", "force", *held)}
        shapes |= {f"place_{k}": (places,) for k in ("grain", "wall", "overlap", "weight", "feature")}
        shapes |= {"wall_load": (n, 6)}
    for name, shape in shapes.items():
        if name not in data or (shape is not None and np.shape(data[name]) != shape):
            raise SceneError(f"{path}: damaged: {name} is missing or has the wrong shape; nothing was changed")
        if np.asarray(data[name]).dtype.kind == "f" and not np.isfinite(data[name]).all():
            raise SceneError(f"{path}: damaged: {name} holds values that are not finite; nothing was changed")


def restore(sim, path: Path) -> None:
    """Bring ``sim`` to the state of the checkpoint at ``path``.

    Raises:
        SceneError: if it cannot be read or belongs to another scene; ``sim`` is unchanged then.
    """
    data = read(path)
    _check(sim, data, Path(path))
    sim.state.restore(data)
    sim.step_number = int(data["step"])
    sim.stepper.restore(data["extreme"])
    sim.left, sim._next_id, sim._grown = json.loads(data["left"]), int(data["next_id"]), False
    for feeder, state in zip(sim.feeders, json.loads(data["feeders"]), strict=True):
        feeder.restore(state)
    sim.lists.restore(data)
    sim._forces_ready = True
