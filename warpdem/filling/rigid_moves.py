"""Clumps in a packing: the pushes on their members turned into moves of rigid bodies."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from warpdem.core.rigid_motion import quaternion_rotation_increment
from warpdem.usd.motion import multiply_quaternions

LEAST_ARM = 1e-3
"""Part of a member's radius that counts as its least distance from an axis [-]: rods have no inertia about themselves."""


@dataclass(frozen=True, eq=False)
class ClumpsToPlace:
    """Clumps that a filling asks for; members of each follow each other."""

    of: np.ndarray
    """Clump of each member, ascending, shape (n,)."""
    arm: np.ndarray
    """Places of the members in the principal axes, from the centre [m], shape (n, 3)."""
    turn: np.ndarray
    """Quaternions (w, x, y, z) from the principal axes to the frame axes at first, shape (c, 4)."""
    size: np.ndarray
    """Factors on the lengths of the clump of the scene [-], shape (c,)."""
    reach: np.ndarray
    """Radius of the sphere about the centre that holds the clump [m], shape (c,)."""
    volume: float
    """Volume of all clumps [m3]."""


class PlacedClumps(NamedTuple):
    """Clumps that have found their places."""

    centre: np.ndarray
    """Centres of mass [m], shape (c, 3)."""
    turn: np.ndarray
    """Quaternions (w, x, y, z) from the principal axes to the frame axes, shape (c, 4)."""
    size: np.ndarray
    """Factors on the lengths of the clump of the scene [-], shape (c,)."""


class RigidMoves:
    """How the members of clumps move together.

    Args:
        clumps: the clumps, in any order.
        radius: radii of the members [m], shape (n,).
        centre: centres of mass [m], shape (c, 3).
    """

    def __init__(self, clumps: ClumpsToPlace, radius: np.ndarray, centre: np.ndarray) -> None:
        self.of, self.arm, self.turn, self.centre = clumps.of, clumps.arm, clumps.turn.copy(), centre.copy()
        self.size = clumps.size
        self._first = np.flatnonzero(np.diff(self.of, prepend=-1))
        self._count = np.bincount(self.of)[:, None]
        self._least = np.add.reduceat((LEAST_ARM * radius) ** 2, self._first)

    def arms(self) -> np.ndarray:
        """Places of the members from their centres in frame axes [m], shape (n, 3)."""
        axes = np.eye(3) + quaternion_rotation_increment(self.turn)
        return np.asarray(np.einsum("nij,nj->ni", axes[self.of], self.arm))

    def positions(self) -> np.ndarray:
        """Positions of the members [m], shape (n, 3)."""
        return np.asarray(self.centre[self.of] + self.arms())

    def _motion(self, move: np.ndarray, r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Shift [m] and rotation vector [rad] of each clump nearest to the moves of its members."""
        shift = np.add.reduceat(move, self._first) / self._count
        middle = np.add.reduceat(r, self._first) / self._count
        arm = r - middle[self.of]
        inertia = np.einsum("ni,ni->n", arm, arm)[:, None, None] * np.eye(3) - arm[:, :, None] * arm[:, None, :]
        of_clump = np.add.reduceat(inertia, self._first) + self._least[:, None, None] * np.eye(3)
        moment = np.add.reduceat(np.cross(arm, move), self._first)
        rotation = np.linalg.solve(of_clump, moment[..., None])[..., 0]
        return shift - np.cross(rotation, middle), rotation

    def pushed(self, push: np.ndarray) -> np.ndarray:
        """Rigid moves of the members [m] that do what the pushes on single ones ask for, shapes (n, 3).

        The nearest rigid move does only a part where few members of a clump are pushed: it is taken so many times that it does
        the whole, by its mean along the pushes, and at most as often as a clump has members.
        """
        r = self.arms()
        shift, rotation = self._motion(push, r)
        move = shift[self.of] + np.cross(rotation[self.of], r)
        wanted = np.add.reduceat(np.einsum("ni,ni->n", push, push), self._first)
        done = np.add.reduceat(np.einsum("ni,ni->n", push, move), self._first)
        times = np.clip(wanted / np.maximum(done, 1e-300), 1.0, self._count[:, 0])
        return np.asarray(move * times[self.of, None])

    def advance(self, move: np.ndarray) -> None:
        """Move the clumps as the rigid moves of their members say."""
        shift, rotation = self._motion(move, self.arms())
        self.centre += shift
        half = 0.5 * np.linalg.norm(rotation, axis=1)
        step = np.column_stack([np.cos(half), 0.5 * rotation * np.sinc(half / np.pi)[:, None]])
        self.turn = multiply_quaternions(step, self.turn)
        self.turn /= np.linalg.norm(self.turn, axis=1)[:, None]

    def keep_in(self, off: np.ndarray, along_axes: bool) -> np.ndarray:
        """Shift clumps by the largest of the moves ``off`` [m] that single members ask for; returns that of each member.

        Args:
            off: moves off a wall, shape (n, 3).
            along_axes: the largest along each axis by itself, as a box asks for; else the longest.
        """
        if along_axes:
            low, high = np.minimum.reduceat(off, self._first), np.maximum.reduceat(off, self._first)
            shift = np.where(-low > high, low, high)
        else:
            length = np.einsum("ni,ni->n", off, off)
            order = np.lexsort((length, self.of))
            last = np.append(self._first[1:], len(self.of)) - 1
            shift = off[order[last]]
        self.centre += shift
        return np.asarray(shift[self.of])

    def restore(self, members: np.ndarray, centre: np.ndarray, turn: np.ndarray) -> None:
        """Put the clumps of which ``members`` (n,) are some back to an earlier place."""
        back = np.unique(self.of[members])
        self.centre[back], self.turn[back] = centre[back], turn[back]

    def shortened(self, move: np.ndarray, allowed: np.ndarray) -> None:
        """Shorten moves (n, 3) [m], in place, to those ``allowed`` of single members, the same of all of a clump."""
        length, there = np.linalg.norm(move, axis=1), np.linalg.norm(allowed, axis=1)
        fraction = np.where(length > 0.0, there / np.maximum(length, 1e-300), 1.0)
        move *= np.minimum.reduceat(fraction, self._first)[self.of, None]
