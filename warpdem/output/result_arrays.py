"""The arrays of the results, each declared once, by the names that users of LIGGGHTS and LAMMPS know.

A new array of the grains is a field of ``Snapshot`` and an entry of ``GRAIN_ARRAYS``: the VTK and VTKHDF writers, the reader
and the titles of pictures follow. Of each contact, j is -1 for a wall and ``wall`` -1 for a grain. Field data of a frame:
time [s], step, gravity in laboratory axes [m/s2], and position and motion of the frame of reference.
"""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from warpdem.core.pose import FramePose, Part, RotationPart, SampledPart, TranslationPart
from warpdem.core.snapshot import ClumpShots, ContactNetwork, Snapshot, WallLoad
from warpdem.errors import WarpdemError


@dataclass(frozen=True)
class ResultArray:
    """An array of the results: its name in the files, what it is, its unit and where it is read."""

    name: str
    """Name in the files."""
    meaning: str
    """What it is, for titles."""
    unit: str
    """Unit, empty for numbers without one."""
    field: str
    """Attribute of the snapshot, the contact network or the load of a wall that holds it."""


GRAIN_ARRAYS = (
    ResultArray("id", "grain id", "", "id"),
    ResultArray("type", "material", "", "type"),
    ResultArray("group", "group", "", "group"),
    ResultArray("radius", "radius", "m", "radius"),
    ResultArray("mass", "mass", "kg", "mass"),
    ResultArray("v", "velocity", "m/s", "velocity"),
    ResultArray("omega", "spin", "rad/s", "spin"),
    ResultArray("f", "contact force", "N", "force"),
)
"""Arrays of the grains; ``v`` and ``omega`` are relative to the frame."""
ORIENTATION = ResultArray("orientation", "orientation", "", "orientation")
"""Quaternions (w, x, y, z) of the grains, if the scene asks for them."""
CLUMP = ResultArray("clump", "clump", "", "clump")
"""Id of the clump of each grain, -1 for a grain of its own, in runs with clumps."""
LIQUID = ResultArray("liquid", "liquid on the grain", "m3", "liquid")
"""Volume of the film of each grain, in runs with liquid."""
BRIDGE = ResultArray("bridge", "liquid in the bridge", "m3", "bridge")
"""Volume of the liquid in each contact, in runs with liquid."""
CLUMP_ARRAYS = (
    ResultArray("id", "clump id", "", "id"),
    ResultArray("type", "clump in the order of the scene", "", "type"),
    ResultArray("members", "members", "", "members"),
    ResultArray("mass", "mass", "kg", "mass"),
    ResultArray("radius", "radius of the sphere of equal volume", "m", "radius"),
    ResultArray("orientation", "orientation", "", "orientation"),
    ResultArray("v", "velocity", "m/s", "velocity"),
    ResultArray("omega", "spin", "rad/s", "spin"),
    ResultArray("angular_momentum", "angular momentum", "N m s", "angular_momentum"),
)
"""Arrays of the clumps; ``v`` and ``omega`` are relative to the frame, ``angular_momentum`` is absolute, in frame axes."""
CONTACT_ARRAYS = (
    ResultArray("i", "id of the grain", "", "i"),
    ResultArray("j", "id of the other grain", "", "j"),
    ResultArray("wall", "wall", "", "wall"),
    ResultArray("force", "force", "N", "force"),
    ResultArray("normal_force", "normal force", "N", "normal_force"),
    ResultArray("friction_force", "friction force", "N", "friction_force"),
    ResultArray("overlap", "overlap", "m", "overlap"),
    ResultArray("sliding", "sliding", "", "sliding"),
    ResultArray("damping_force", "damping force", "N", "damping_force"),
)
"""Arrays of the contact network; its elastic force is the force without the damping force."""
TRIANGLE_ARRAYS = (
    ResultArray("force", "force", "N", "triangle_force"),
    ResultArray("pressure", "pressure", "Pa", "pressure"),
)
"""Arrays of the triangles of a wall with its load."""
WEAR_ARRAYS = (
    ResultArray("mean_pressure", "mean pressure", "Pa", "mean_pressure"),
    ResultArray("shear_work", "shear work", "J/m2", "shear_work"),
    ResultArray("impact_work", "impact work", "J/m2", "impact_work"),
    ResultArray("archard_depth", "depth by Archard", "m", "archard_depth"),
    ResultArray("finnie_depth", "depth by Finnie", "m", "finnie_depth"),
)
"""Arrays of the triangles of a wall with its wear; those that the scene does not ask for are None."""
WALL_ARRAYS = (
    ResultArray("force", "force", "N", "force"),
    ResultArray("torque", "torque", "N m", "torque"),
    ResultArray("torque_about", "point of the torque", "m", "about"),
    ResultArray("power", "power", "W", "power"),
)
"""Field data of a whole wall with its load."""
_PARTS = (RotationPart, TranslationPart, SampledPart)


def grain_arrays(snapshot: Snapshot) -> dict[str, np.ndarray]:
    """Arrays of the grains by name, shapes (n,) or (n, components)."""
    more = [entry for entry in (ORIENTATION, CLUMP, LIQUID) if getattr(snapshot, entry.field) is not None]
    return _read((*GRAIN_ARRAYS, *more), snapshot)


def clump_arrays(clumps: ClumpShots) -> dict[str, np.ndarray]:
    """Arrays of the clumps by name, shapes (c,) or (c, components)."""
    return _read(CLUMP_ARRAYS, clumps)


def contact_arrays(network: ContactNetwork) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Ends of the lines one after the other [m], shape (2 c, 3), and the arrays of the contacts by name."""
    ends = np.stack([network.start, network.end], axis=1).reshape(-1, 3)
    more = (BRIDGE,) if network.bridge is not None else ()
    return ends, _read((*CONTACT_ARRAYS, *more), network)


def triangle_arrays(load: WallLoad) -> dict[str, np.ndarray]:
    """Arrays of the triangles of a wall by name, shapes (t,) or (t, 3); without rows for a wall that is no mesh."""
    arrays = _read(TRIANGLE_ARRAYS, load)
    if load.wear is not None:
        arrays |= {name: values for name, values in _read(WEAR_ARRAYS, load.wear).items() if values is not None}
    return arrays


def wall_arrays(load: WallLoad) -> dict[str, np.ndarray]:
    """Field data of a whole wall by name, shapes (3,) or ()."""
    return {name: np.asarray(values) for name, values in _read(WALL_ARRAYS, load).items()}


def frame_arrays(snapshot: Snapshot) -> dict[str, np.ndarray]:
    """Field data of a frame by name, rows of numbers: x_lab = frame_rotation x + frame_translation."""
    frame = snapshot.frame
    arrays = {
        "time": np.array([float(snapshot.time)]),
        "step": np.array([int(snapshot.step)]),
        "frame_angle": np.array([float(frame.angle)]),
        "frame_rotation": frame.rotation.reshape(1, 9),
        "frame_translation": frame.translation[None],
        "frame_spin": frame.spin[None],
        "frame_velocity": frame.velocity[None],
    }
    if snapshot.gravity is not None:
        arrays["gravity"] = snapshot.gravity[None]
    return {**arrays, "frame_parts": np.array([_numbers(part) for part in frame.parts])} if frame.parts else arrays


def snapshot_of(
    path: Path, position: np.ndarray, grains: dict[str, np.ndarray], frame: dict[str, np.ndarray]
) -> Snapshot:
    """The snapshot that a grain file holds, without walls, loads and contacts.

    Args:
        path: The file, for messages.
        position: Positions [m], shape (n, 3).
        grains: Arrays of the grains by name.
        frame: Field data by name.

    Raises:
        WarpdemError: An array is missing.
    """

    def array(of: dict[str, np.ndarray], name: str) -> np.ndarray:
        if name not in of:
            raise WarpdemError(f"{path}: not a grain file of warpdem, array {name!r} is missing")
        return of[name]

    rotation, translation, spin, velocity = (
        array(frame, f"frame_{name}")[0] for name in ("rotation", "translation", "spin", "velocity")
    )
    fields_of_grains: dict[str, Any] = {entry.field: array(grains, entry.name) for entry in GRAIN_ARRAYS}
    parts = tuple(_part(row) for row in frame.get("frame_parts", ()))  # an inertial frame has none
    return Snapshot(
        step=int(array(frame, "step")[0]),
        time=float(array(frame, "time")[0]),
        frame=FramePose(rotation.reshape(3, 3), translation, spin, velocity, parts),
        position=position,
        **fields_of_grains,
        orientation=grains.get(ORIENTATION.name),
        clump=grains.get(CLUMP.name),
        liquid=grains.get(LIQUID.name),
        gravity=frame["gravity"][0] if "gravity" in frame else None,  # older results do not tell it
    )


def _read(entries: tuple[ResultArray, ...], owner: object) -> dict[str, np.ndarray]:
    return {entry.name: getattr(owner, entry.field) for entry in entries}


def _numbers(part: Part) -> np.ndarray:
    """A motion as a row of frame_parts: its kind, then its fields one after the other, filled up with zeros, shape (8,)."""
    row = np.zeros(8)
    values = np.hstack([_PARTS.index(type(part)), *(getattr(part, f.name) for f in fields(part))])
    row[: len(values)] = values
    return row


def _part(row: np.ndarray) -> Part:
    """The motion that a row of frame_parts holds."""
    kind, numbers = _PARTS[int(row[0])], row[1:]
    if kind is RotationPart:
        return RotationPart(numbers[:3], numbers[3:6], float(numbers[6]))
    return TranslationPart(numbers[:3]) if kind is TranslationPart else SampledPart(numbers[:4], numbers[4:7])
