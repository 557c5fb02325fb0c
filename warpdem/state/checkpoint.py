"""Save and resume: a resumed run equals the uninterrupted one bit for bit.

A checkpoint holds the moving state, and of every contact the history and the forces of the present time, keyed by grain ids
and walls; lists are rebuilt, which changes no bit of the result. How it lies in its file: ``checkpoint_file``; which scene may
go on with it: ``same_scene``.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from warpdem.errors import SceneError
from warpdem.kernels import grain
from warpdem.state import checkpoint_file, contact_history, liquid_account
from warpdem.state.blocks import Rows
from warpdem.state.same_scene import refuse_other
from warpdem.state.view import RunView


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

    def restore(self, data: Mapping[str, Any]) -> None:
        """Take over both from a checkpoint."""


class EnginePart(Protocol):
    """What runs the steps."""

    def restore(self, extreme: np.ndarray, digits: Mapping[str, np.ndarray]) -> None:
        """Take over the largest overlaps and approach speeds so far, shape (4,), and of the digits those of its sums.

        Schedule and structs are made again.
        """


class LoopPart(Protocol):
    """What brings a run forward."""

    def restore_contacts(self, data: Mapping[str, Any]) -> None:
        """Take over contact history and forces of a checkpoint, whose grains were taken over."""


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
    def loop(self) -> LoopPart:
        """What brings the run forward."""

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
        "streams": run.streams.state(),
        "next_id": view.state.next_id,
        "budget": view.totals.state() if view.totals is not None else None,
        "guards": run.guards.state(),
        "liquid": liquid_account.saved(view),
    }
    checkpoint_file.write(Path(path), view.model.given.json, json.dumps(about), arrays)


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
            "loads": {wall.name: wall.dynamic.elapsed for wall in scene.walls if wall.dynamic is not None},
            "surfaces": {w.name: w.surface_velocity.elapsed for w in scene.walls if w.surface_velocity is not None},
        },
        "places": _places(view),
        "step": view.clock.step_number,
        "dt": view.clock.dt,
    }


def _arrays(view: RunView) -> dict[str, Rows | np.ndarray]:
    """The arrays of a checkpoint, those of grains in order of id.

    Beside the state, velocity [m/s] and spin [rad/s] of this time, absolute, in frame axes: another scene starts from them.
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
    if state.film is not None:
        out["film"] = liquid_account.films(view)
    if state.clumps is not None:
        out |= state.clumps.arrays(rank)
    if view.departures is not None:
        readings |= view.departures.arrays()
    return out | readings | view.reader.digits | contact_history.read(view)


def _places(view: RunView) -> dict[str, Any]:
    """Where frame and walls stand, matrices of shape (3, 4): the frame in the laboratory, walls in the frame."""
    schedule, time = view.model.schedule, view.clock.time
    pose = schedule.frame.pose(np.array([time]))
    walls = [np.hstack([body[:9].reshape(3, 3), body[9:12, None]]).tolist() for body in schedule.bodies(time)]
    return {
        "frame": np.hstack([pose.axes[0], pose.origin[0][:, None]]).astype(float).tolist(),
        "walls": dict(zip((wall.name for wall in view.model.scene.walls), walls, strict=True)),
    }


def _check(view: RunView, data: Mapping[str, Any]) -> None:
    """Refuse what another scene was run to, or at another time step."""
    given, dt = view.model.given, view.clock.dt
    refuse_other(data, given.scene, given.files, given.hash)
    if missing := sorted(view.reader.digits.keys() - data.keys()):
        raise SceneError(
            f"{data['path']}: a checkpoint of another version: it holds no {', '.join(missing)}; go on with the version that "
            "saved it, or start anew"
        )
    if data["dt"] != dt:
        raise SceneError(
            f"{data['path']}: belongs to another time step, {data['dt']!r} s, than this run, {dt!r} s; nothing was changed"
        )


def restore(run: Run, data: Mapping[str, Any]) -> None:
    """Bring ``run`` to the state that ``data``, as ``checkpoint_file`` gives it, holds.

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
    run.engine.restore(data["extreme"], data)
    run.left.update(data["left"])
    liquid_account.restore(view, data)
    run.streams.restore(data["streams"])
    if view.departures is not None:
        view.departures.restore(data)
    if view.totals is not None:
        view.totals.restore(data["budget"])
    run.loop.restore_contacts(data)
    run.guards.restore(data)
