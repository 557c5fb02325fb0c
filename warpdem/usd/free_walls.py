"""Free walls from UsdPhysics: bodies that move by forces, their masses, and the joint and drive that hold them.

    body without a joint          joint "none": mass, center, moments about their axes, velocity and spin
    PhysicsRevoluteJoint          "hinge": axis, a point on it, moment of inertia about it, rate, limits
    PhysicsPrismaticJoint         "slider": axis, mass, velocity, limits
    PhysicsDriveAPI               stiffness k, damping c, target position x and velocity v: load = k (x - q) + c (v - q'):
                                  a spring at rest at x, a damper and the constant load c v; with a largest load F and no k
                                  the motor curve through (v - F/c, F) and (v + F/c, -F)

The coordinate q of a joint is that of body1 relative to body0; a free wall begins at 0, so that limits and rest count from
where the frames of the joint are at time 0. Of a body0 that is free the axis points the other way. Masses that are not stated
are those of the closed mesh; an analytic sphere is taken as solid.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from warpdem.core import rigid_motion
from warpdem.core.rigid_motion import WIDE
from warpdem.errors import SceneError
from warpdem.usd.motion import quaternion_of
from warpdem.usd.stage_units import StageUnits

ALIGNED = 1.0e-4
"""Tolerance between the two frames of a joint at time 0 [-]: of single precision through a chain of transforms."""
AGREES = 1.0e-6
"""Relative tolerance between a number and what single precision and transforms have left of it [-]."""
NO_STOP = 1.0e9
"""Limit in place of an infinite one, where a joint has one limit only [m or rad]."""


def free_table(
    file: Path, body: dict[str, Any], masses: dict[str, Any], wall: dict[str, Any], units: StageUnits, density: float | None
) -> dict[str, Any]:
    """The table ``walls[].free`` of a body, without what it leaves to defaults.

    Args:
        file: The stage, for messages.
        body: The body and its joint as `warpdem.usd.reader.bodies.free_bodies` gives them.
        masses: What is stated of its masses, as of ``stated_masses``.
        wall: Table of the wall, with its geometry.
        units: Of the stage.
        density: Of its material [kg/m3], None if there is none.

    Raises:
        SceneError: A free wall cannot be what they say.
    """
    stated = dict(_masses(file, masses, units))
    if "sphere" in wall:
        stated = _solid_sphere(wall["sphere"], density) | stated
    parent = units.rotation(body["parent"])
    moves = any([*body["velocity"], *body["spin"]])
    if parent is None and moves:
        raise SceneError(f"{file}: {body['path']}: its parent's transform has unequal scales: its velocities have no direction")
    axes = np.eye(3) if parent is None else parent
    # velocities are in the space of the parent, whose scale counts as that of a length
    scale = np.cbrt(abs(np.linalg.det(np.array(body["parent"])[:3, :3])))
    velocity = axes @ np.array(body["velocity"]) * units.metres * scale
    spin = axes @ np.radians(body["spin"])
    if body["joint"] is None:
        table: dict[str, Any] = {"joint": "none", **{k: v for k, v in stated.items() if k in ("mass", "centre")}}
        table |= _moments(stated)
        table |= {"velocity": velocity.tolist()} if velocity.any() else {}
        return table | ({"spin": spin.tolist()} if spin.any() else {})
    return _held(file, body, stated, units, velocity, spin)


def _masses(file: Path, masses: dict[str, Any], units: StageUnits) -> Iterator[tuple[str, Any]]:
    """Mass, center, and principal moments with their axes (3, 3), as far as stated, in SI and in the scene's axes."""
    if "mass" in masses:
        yield "mass", units.convert(masses["mass"], mass=1)
    if "centre" in masses:
        yield "centre", units.place(masses["matrix"], masses["centre"]).tolist()
    if "moments" in masses:
        rotation = units.rotation(masses["matrix"])
        if rotation is None:
            raise SceneError(
                f"{file}: {masses['path']}.physics:diagonalInertia: the prim has unequal scales, so that its principal axes "
                "have no direction; apply the scale to the points"
            )
        yield "moments", [units.convert(moment, length=2, mass=1) for moment in masses["moments"]]
        yield "axes", rotation @ rotation_of(masses.get("axes", (1.0, 0.0, 0.0, 0.0)))


def _solid_sphere(sphere: dict[str, Any], density: float | None) -> dict[str, Any]:
    """Masses of a sphere filled with its material; nothing if it has none."""
    if density is None:
        return {}
    mass = density * 4.0 / 3.0 * np.pi * sphere["radius"] ** 3
    moment = 0.4 * mass * sphere["radius"] ** 2
    return {"mass": mass, "centre": sphere["centre"], "moments": [moment] * 3, "axes": np.eye(3)}


def _moments(stated: dict[str, Any]) -> dict[str, Any]:
    """Moments of inertia about x, y and z, or about ``axes`` where the principal axes are others."""
    if "moments" not in stated:
        return {}
    axes, moments = stated["axes"], stated["moments"]
    along = np.abs(axes).argmax(axis=0)  # the direction x, y or z of each principal axis
    if sorted(along) == [0, 1, 2] and np.abs(np.abs(axes[along, range(3)]) - 1.0).max() < AGREES:
        return {"inertia": [moments[int(np.flatnonzero(along == k)[0])] for k in range(3)]}
    return {"inertia": moments, "axes": quaternion_of(axes).astype(float).tolist()}


def _held(
    file: Path, body: dict[str, Any], stated: dict[str, Any], units: StageUnits, velocity: np.ndarray, spin: np.ndarray
) -> dict[str, Any]:
    """The table of a hinge or slider."""
    joint, hinge = body["joint"], body["joint"]["joint"] == "hinge"
    where = f"{file}: {joint['path']}"
    axis, origin, begins = _frames(where, joint, units)
    table: dict[str, Any] = {"joint": joint["joint"], "axis": (axis + 0.0).tolist()}
    table |= {key: stated[key] for key in (("mass", "centre") if hinge else ("mass",)) if key in stated}
    if hinge:
        table["origin"] = origin.tolist()
        if "moments" in stated:
            table["inertia"] = _about(where, body["path"], stated, axis, origin)
    own, other = (spin, velocity) if hinge else (velocity, spin)
    rate = float(own @ axis)
    if np.linalg.norm(own - rate * axis) > ALIGNED * np.linalg.norm(own) or (other.any() and not (hinge and rate)):
        allowed = "only physics:angularVelocity about" if hinge else "only physics:velocity along"
        raise SceneError(f"{file}: {body['path']}: its joint {joint['path']} allows {allowed} its axis at the start")
    if rate:
        table["rate" if hinge else "velocity"] = rate
    low, high = joint["range"]
    if low > high:
        raise SceneError(f"{where}: physics:lowerLimit = {low:g} is above physics:upperLimit = {high:g}: it cannot move")
    if np.isfinite([low, high]).any():
        table["range"] = [_coordinate(end, hinge, units) - begins if np.isfinite(end) else float(np.sign(end)) * NO_STOP
                          for end in (low, high)]  # fmt: skip
    return table | _drive(where, joint["drive"], begins, hinge, units)


def _frames(where: str, joint: dict[str, Any], units: StageUnits) -> tuple[np.ndarray, np.ndarray, float]:
    """Axis of a joint, a point on it [m], and its coordinate at time 0 [m or rad]."""
    places, axes = [], []
    for frame in joint["frames"]:
        rotation = units.rotation(frame["matrix"])
        if rotation is None:
            raise SceneError(f"{where}: {frame['target']} has unequal scales: the joint's axis has no direction in it")
        places.append(units.place(frame["matrix"], frame["place"]))
        axes.append(rotation @ rotation_of(frame["turn"]))
    number = "XYZ".index(joint["axis"])
    axis = axes[0][:, number]
    rotation, apart = axes[0].T @ axes[1], places[1] - places[0]
    along = float(apart @ axis)
    size = float(np.abs([*places, *(units.place(frame["matrix"], (0, 0, 0)) for frame in joint["frames"])]).max())
    aside = float(np.linalg.norm(apart - along * axis))
    hinge = joint["joint"] == "hinge"
    skew = float(np.abs(rotation - np.eye(3)).max() if not hinge else 1.0 - rotation[number, number])
    if skew > ALIGNED or aside > ALIGNED * size or (hinge and abs(along) > ALIGNED * size):
        raise SceneError(
            f"{where}: its two frames are apart at time 0, by {np.linalg.norm(apart):.3g} m and {skew:.3g} in direction: the "
            "body would jump; set physics:localPos and physics:localRot of both ends so that they agree"
        )
    a, b = ((number + 1) % 3, (number + 2) % 3)
    begins = float(np.arctan2(rotation[b, a] - rotation[a, b], rotation[a, a] + rotation[b, b])) if hinge else along
    return axis if joint["moved"] else -axis, places[joint["moved"]], begins if abs(begins) > ALIGNED * 1e-3 else 0.0


def _about(where: str, path: str, stated: dict[str, Any], axis: np.ndarray, origin: np.ndarray) -> float:
    """Moment of inertia about the axis of a hinge [kg m2], by the parallel axis theorem."""
    missing = [name for key, name in (("mass", "physics:mass"), ("centre", "physics:centerOfMass")) if key not in stated]
    if missing:
        raise SceneError(
            f"{where}: the moment of inertia about the axis of {path} does not follow from physics:diagonalInertia alone: give "
            f"it {' and '.join(missing)} too"
        )
    along, arm = stated["axes"].T @ axis, np.cross(np.array(stated["centre"]) - origin, axis)
    return float(along**2 @ np.array(stated["moments"]) + stated["mass"] * arm @ arm)


def _coordinate(value: float, hinge: bool, units: StageUnits) -> float:
    return float(np.radians(value)) if hinge else units.convert(value, length=1)


def _drive(where: str, drive: dict[str, float] | None, begins: float, hinge: bool, units: StageUnits) -> dict[str, Any]:
    """Spring, damper and load or motor curve of a drive."""
    if drive is None:
        return {}
    degrees = 180.0 / np.pi if hinge else 1.0  # coefficients of an angular drive are per degree
    length = 2 if hinge else 0
    stiffness, damping = (units.convert(drive[key], length, 1) * degrees for key in ("stiffness", "damping"))
    most = drive["maxForce"]
    target = _coordinate(drive["targetVelocity"], hinge, units)
    table: dict[str, Any] = {}
    if np.isfinite(most):
        largest = units.convert(most, 2 if hinge else 1, 1)
        if stiffness:
            raise SceneError(
                f"{where}: a drive with both a stiffness and a maxForce is not supported: remove maxForce, or set the "
                "stiffness to 0, which makes it a motor"
            )
        if damping and largest:
            table["motor"] = [[target - largest / damping, largest], [target + largest / damping, -largest]]
        return table
    if stiffness:
        table |= {"stiffness": stiffness, "rest": _coordinate(drive["targetPosition"], hinge, units) - begins}
    if damping:
        table["damping"] = damping
    if damping and target:
        table["torque" if hinge else "force"] = damping * target
    return table


def rotation_of(quaternion: Any) -> np.ndarray:
    """Rotation matrix of a quaternion (w, x, y, z) of any length but zero, shape (3, 3)."""
    unit = np.array(quaternion, dtype=WIDE)
    unit /= np.sqrt((unit**2).sum())
    return np.asarray(np.eye(3) + rigid_motion.quaternion_rotation_increment(unit[None])[0], dtype=float)


def differences(given: dict[str, Any], found: dict[str, Any]) -> Iterator[str]:
    """Keys of ``given``, of the scene's own attributes, that UsdPhysics contradicts; numbers may be texts with units."""
    axis = np.array(found.get("axis", (0.0, 0.0, 0.0)))
    for key, value in found.items():
        if key not in given or (isinstance(given[key], str) and key != "joint"):
            continue
        own, stated = given[key], value
        if key == "joint":
            if own != stated:
                yield key
            continue
        try:
            first, second = np.array(own, dtype=float), np.array(stated, dtype=float)
        except (TypeError, ValueError):  # units within a list, or a table in place of a number
            continue
        if first.shape != second.shape:
            yield key
            continue
        if key == "axis":
            first = first / np.linalg.norm(first)
        if key == "origin":  # any point of the axis will do
            first, second = np.cross(first, axis), np.cross(second, axis)
        if key == "axes":
            first, second = rotation_of(first), rotation_of(second)
        if np.abs(first - second).max() > AGREES * max(float(np.abs(second).max()), 1e-30):
            yield key
