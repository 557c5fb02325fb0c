"""What a picture says of each sphere: of a member of a clump what its clump does, so that a body has one colour."""

from dataclasses import dataclass

import numpy as np

from warpdem.core.rigid_motion import quaternion_rotation_increment
from warpdem.drawing.colours import CATEGORIES
from warpdem.errors import WarpdemError

OF_THE_BODY = ("v", "omega", "mass")
"""Arrays of which a member shows that of its clump."""
ALONE = len(CATEGORIES) - 1
"""Colour of grains that are no members, among those of clumps: the grey one."""
SCATTER = (0x85EBCA6B, 0xC2B2AE35)
"""Factors of the last step of MurmurHash3 (Appleby, 2011), after which equally spaced numbers are spread evenly."""
SPOT_DEPTH, SPOT_HEIGHT, SHADE = 0.1, 0.012, 0.4
"""Of a spot: how far its ball is moved out of the middle and how far it rises, in radii; and its colour over the grain's."""


@dataclass(frozen=True)
class Bodies:
    """The spheres of a frame as parts of bodies: clumps, and grains of their own."""

    fields: dict[str, np.ndarray]
    """Arrays by name, shapes (n,) or (n, components)."""
    centre: np.ndarray
    """Centre of the body of each sphere in frame axes [m], shape (n, 3)."""


def bodies_of(position: np.ndarray, grains: dict[str, np.ndarray], clumps: dict[str, np.ndarray]) -> Bodies:
    """The bodies that spheres belong to.

    Velocity, spin and mass of a member are those of its clump, its force is the sum over the members, its id that of the clump;
    ``clump`` is a number of a colour.

    Args:
        position: Centres of the spheres in frame axes [m], shape (n, 3).
        grains: Arrays of the spheres.
        clumps: Arrays of the clumps, with their centres as ``position``; empty if there are none.
    """
    if "clump" not in grains:
        return Bodies(grains, position)
    of = grains["clump"]
    member = of >= 0
    colour = np.where(member, _scattered(of) % ALONE, ALONE)
    fields = {**grains, "clump": colour, "id": np.where(member, of, grains["id"])}
    centre = position
    if len(clumps.get("id", ())) and "position" in clumps:
        row = np.searchsorted(clumps["id"], of[member])
        centre = position.copy()
        centre[member] = clumps["position"][row]
        for name in OF_THE_BODY:
            fields[name] = grains[name].copy()
            fields[name][member] = clumps[name][row]
    _, body = np.unique(of[member], return_inverse=True)
    if "f" in grains and member.any():
        fields["f"] = grains["f"].copy()
        fields["f"][member] = np.stack([np.bincount(body, weights=f) for f in grains["f"][member].T], axis=1)[body]
    return Bodies(fields, centre)


def _scattered(number: np.ndarray) -> np.ndarray:
    """Numbers as other ones below 2^32, shape (n,), without order: ids of clumps are a few steps apart."""
    mixed = number.astype(np.uint64)
    for factor in SCATTER:
        mixed = (mixed ^ (mixed >> np.uint64(16))) * np.uint64(factor) % np.uint64(2**32)
    return np.asarray(mixed ^ (mixed >> np.uint64(16))).astype(np.int64)


def spots(
    position: np.ndarray, radius: np.ndarray, colour: np.ndarray, axes: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Balls that show as dark round spots on others, six on each, at both ends of its body axes.

    A ball of radius (1 - d + h) r, moved by d r, rises by h r above the grain within an angle a of its axis,
    cos a = (d^2 + 1 - (1 - d + h)^2) / (2 d): 27 degrees.

    Args:
        position: Centres of the grains [m], shape (n, 3).
        radius: Their radii [m], shape (n,).
        colour: Their colours, shape (n, 3), uint8.
        axes: Their body axes as columns, in the axes of the positions, shape (n, 3, 3).

    Returns:
        Centres, radii and colours of the spots, shapes (6 n, 3), (6 n,), (6 n, 3).
    """
    ends = np.concatenate([axes, -axes], axis=2).transpose(0, 2, 1)
    centre = position[:, None] + SPOT_DEPTH * radius[:, None, None] * ends
    size = np.repeat((1.0 - SPOT_DEPTH + SPOT_HEIGHT) * radius, 6)
    return centre.reshape(-1, 3), size, np.repeat(np.round(SHADE * colour).astype(np.uint8), 6, axis=0)


def body_axes(fields: dict[str, np.ndarray], folder: object) -> np.ndarray:
    """Body axes of the grains as columns, in frame axes, shape (n, 3, 3).

    Raises:
        WarpdemError: The results do not hold them.
    """
    if "orientation" not in fields:
        raise WarpdemError(
            f"spots show the orientations of the grains, which {folder} does not hold: run the scene with "
            "output.orientation = true"
        )
    return np.asarray(np.eye(3) + quaternion_rotation_increment(fields["orientation"]))
