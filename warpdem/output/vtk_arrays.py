"""The arrays of VTK results by the names that users of LIGGGHTS and LAMMPS know, and the snapshot that they make.

Of each grain: id, type (number of its material), group (number of its group), radius [m], mass [kg], v [m/s], omega [rad/s],
f [N] and, if kept, orientation (w, x, y, z). Of each contact: i and j (ids; j = -1 for a wall), wall (number; -1 for a grain),
force, normal_force, friction_force [N], overlap [m], sliding (1 or 0). Field data of a frame: time [s], step, gravity in
laboratory axes [m/s2], and the place and motion of the frame of reference.
"""

from dataclasses import fields
from pathlib import Path

import numpy as np

from warpdem.core.pose import FramePose, Part, RotationPart, SampledPart, TranslationPart
from warpdem.core.snapshot import ContactNetwork, Snapshot
from warpdem.errors import WarpdemError

# name in the file, field of the snapshot
_GRAIN_ARRAYS = {
    "id": "id",
    "type": "type",
    "group": "group",
    "radius": "radius",
    "mass": "mass",
    "v": "velocity",
    "omega": "spin",
    "f": "force",
}
_CONTACT_ARRAYS = ("i", "j", "wall", "force", "normal_force", "friction_force", "overlap", "sliding")
_PARTS = (RotationPart, TranslationPart, SampledPart)


def grain_arrays(snapshot: Snapshot) -> dict[str, np.ndarray]:
    """Arrays of the grains by name, shapes (n,) or (n, components)."""
    arrays = {name: getattr(snapshot, key) for name, key in _GRAIN_ARRAYS.items()}
    return arrays if snapshot.orientation is None else {**arrays, "orientation": snapshot.orientation}


def contact_arrays(network: ContactNetwork) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Ends of the lines one after the other [m], shape (2 c, 3), and the arrays of the contacts by name."""
    ends = np.stack([network.start, network.end], axis=1).reshape(-1, 3)
    return ends, {name: getattr(network, name) for name in _CONTACT_ARRAYS}


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

    rotation, *vectors = (array(frame, f"frame_{name}")[0] for name in ("rotation", "translation", "spin", "velocity"))
    parts = tuple(_part(row) for row in frame.get("frame_parts", ()))  # an inertial frame has none
    return Snapshot(
        step=int(array(frame, "step")[0]),
        time=float(array(frame, "time")[0]),
        frame=FramePose(rotation.reshape(3, 3), *vectors, parts),
        position=position,
        **{key: array(grains, name) for name, key in _GRAIN_ARRAYS.items()},
        orientation=grains.get("orientation"),
        gravity=frame["gravity"][0] if "gravity" in frame else None,  # older results do not tell it
    )


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
