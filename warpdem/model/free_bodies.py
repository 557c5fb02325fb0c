"""Free bodies with six degrees of freedom on the host: what ``kernels.step.free_bodies`` is given, and where they are."""

from typing import TYPE_CHECKING, Any

import numpy as np

from warpdem.core.rigid_motion import WIDE, Pose
from warpdem.kernels.step.free_bodies import BODY, MOTION, MOUNT, MOUNTS
from warpdem.mesh.solid_body import SolidBody
from warpdem.scene.free import FreeBody
from warpdem.usd.motion import quaternion_of

if TYPE_CHECKING:
    from warpdem.model.dynamic_walls import DynamicWall

ALIKE = 1.0e-9
"""Difference of two moments of inertia below which they are one [-]: the body is one of revolution."""


def complete(one: "DynamicWall", given: FreeBody, solid: SolidBody | None) -> None:
    """Give a body its numbers and where it begins: as given, else those of the closed mesh, scaled to a mass that is given."""
    if solid is None:
        assert given.mass is not None and given.centre is not None and given.inertia is not None
        solid = SolidBody(given.mass, np.array(given.centre), given_tensor(given))
    one.mass = given.mass or solid.mass
    one.center = np.array(given.centre) if given.centre is not None else solid.center
    tensor = given_tensor(given) if given.inertia is not None else solid.inertia * one.mass / solid.mass
    moments, axes = principal(tensor)
    rotation = quaternion_of(axes).astype(float)
    mounts = np.zeros((MOUNTS, MOUNT.width))
    for row, mount in zip(mounts, given.mounts, strict=False):
        row[:] = [*mount.point, *(mount.anchor or mount.point), mount.stiffness, mount.damping]
    values: dict[str, Any] = {
        "mass": one.mass, "center": one.center, "orientation": rotation, "rates": 1.0 / moments, "force": given.force,
        "torque": given.torque, "mounts": mounts.ravel(),
    }  # fmt: skip
    one.body = np.concatenate([np.atleast_1d(values[name]) for name in BODY.names])
    one.inertia = float(moments.min())
    if not one.motion[MOTION.of("orientation")].any():
        begins = {
            "place": one.center, "orientation": rotation, "velocity": given.velocity, "momentum": tensor @ np.array(given.spin),
            "seen_velocity": given.velocity, "seen_spin": given.spin,
        }  # fmt: skip
        for name, value in begins.items():
            one.motion[MOTION.of(name)] = value


def given_tensor(given: FreeBody) -> np.ndarray:
    """Inertia tensor that a scene gives [kg m2], shape (3, 3): its moments about its axes."""
    rotation = matrix_of(np.array(given.axes or (1.0, 0.0, 0.0, 0.0)))
    return np.asarray(rotation @ np.diag(given.inertia or ()) @ rotation.T)


def principal(tensor: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Principal moments of an inertia tensor [kg m2], shape (3,), two that are alike first, and their axes, shape (3, 3)."""
    moments, axes = np.linalg.eigh(tensor)
    if np.ptp(moments[1:]) <= ALIKE * moments[2]:
        moments, axes = moments[[1, 2, 0]], axes[:, [1, 2, 0]]
    if abs(moments[1] - moments[0]) <= ALIKE * moments[1]:
        moments[:2] = moments[:2].mean()
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    return moments, axes


def pose(one: "DynamicWall", count: int) -> Pose:
    """Present pose in the axes of the carrier, ``count`` times."""
    rotation = matrix_of(one.motion[MOTION.of("orientation")]) @ matrix_of(one.body[BODY.of("orientation")]).T
    place, velocity, spin = (one.motion[MOTION.of(name)] for name in ("place", "seen_velocity", "seen_spin"))
    arm = rotation @ one.center
    vectors = place - arm, rotation.T @ spin, rotation.T @ (velocity - np.cross(spin, arm))
    origin, body_spin, body_velocity = (np.tile(vector.astype(WIDE), (count, 1)) for vector in vectors)
    none = np.zeros((count, 3), dtype=WIDE)
    return Pose(np.tile(rotation.astype(WIDE), (count, 1, 1)), origin, body_spin, body_velocity, none, none)


def matrix_of(quaternion: np.ndarray) -> np.ndarray:
    """Rotation matrix of a unit quaternion (w, x, y, z)."""
    w, x, y, z = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def energies(one: "DynamicWall") -> dict[str, float]:
    """Energy of its motion and in its mounts, and what was given and lost [J]."""
    motion, body = one.motion, one.body
    rotation = matrix_of(motion[MOTION.of("orientation")])
    own = rotation @ matrix_of(body[BODY.of("orientation")]).T
    velocity, spin = motion[MOTION.of("seen_velocity")], rotation.T @ motion[MOTION.of("seen_spin")]
    mounts = body[BODY.of("mounts")].reshape(MOUNTS, MOUNT.width)
    points = motion[MOTION.of("place")] + (mounts[:, MOUNT.of("point")] - one.center) @ own.T
    stretch = ((points - mounts[:, MOUNT.of("anchor")]) ** 2).sum(axis=1)
    return {
        "kinetic": float(0.5 * one.mass * velocity @ velocity + 0.5 * (spin**2 / body[BODY.of("rates")]).sum()),
        "spring": float(0.5 * mounts[:, MOUNT.stiffness] @ stretch),
        "driven": float(motion[MOTION.driven]),
        "lost": float(motion[MOTION.lost]),
    }
