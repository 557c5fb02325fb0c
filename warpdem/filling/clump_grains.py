"""Clumps at the start of a run: how they lie and move, and their members as grains."""

from dataclasses import dataclass, replace

import numpy as np

from warpdem.core.rigid_motion import quaternion_rotation_increment
from warpdem.filling.clump_template import ClumpTemplate
from warpdem.usd.motion import multiply_quaternions

NONE = -1
"""Clump of a grain of its own, as in ``kernels.clump``."""


@dataclass(frozen=True)
class InitialClumps:
    """Clumps, and of each grain to which it belongs; vectors in frame axes, motion as that of the grains."""

    first: np.ndarray
    """Index of the first member among the grains; members follow each other, shape (c,)."""
    count: np.ndarray
    """Members, shape (c,)."""
    template: np.ndarray
    """Number of the clump in the order of ``Scene.clumps``, shape (c,)."""
    position: np.ndarray
    """Centres of mass [m], shape (c, 3)."""
    velocity: np.ndarray
    """Of the centres [m/s], shape (c, 3)."""
    spin: np.ndarray
    """Angular velocities [rad/s], shape (c, 3)."""
    turn: np.ndarray
    """Quaternions (w, x, y, z) from the principal axes to the frame axes, shape (c, 4)."""
    mass: np.ndarray
    """Masses [kg], shape (c,)."""
    moments: np.ndarray
    """Principal moments of inertia [kg m2], shape (c, 3)."""
    axes: np.ndarray
    """Quaternions (w, x, y, z) from the principal axes to the axes of the clump in the scene, shape (c, 4)."""
    radius: np.ndarray
    """Radii of spheres of equal volume [m], shape (c,)."""
    of_grain: np.ndarray
    """Clump of each grain, or ``NONE``, shape (n,)."""
    arm: np.ndarray
    """Place of each member in the principal axes, from the centre [m]; 0 for other grains, shape (n, 3)."""

    def __len__(self) -> int:
        return len(self.first)

    @property
    def matrices(self) -> np.ndarray:
        """Rotation from the principal axes to the frame axes, shape (c, 3, 3)."""
        return np.asarray(np.eye(3) + quaternion_rotation_increment(self.turn))

    def arms(self) -> np.ndarray:
        """Place of each member from the centre of its clump in frame axes [m], shape (members, 3), in order of the grains."""
        member = self.of_grain != NONE
        return np.asarray(np.einsum("nij,nj->ni", self.matrices[self.of_grain[member]], self.arm[member]))

    def centres(self, position: np.ndarray) -> np.ndarray:
        """Positions (n, 3) [m] of grains, with that of its clump for each member."""
        if not len(self):
            return position
        return np.where((self.of_grain == NONE)[:, None], position, self.position[np.maximum(self.of_grain, 0)])

    def reach(self, radius: np.ndarray) -> float:
        """Largest distance from the centre of a clump to its surface [m]; ``radius`` of the grains, shape (n,)."""
        member = self.of_grain != NONE
        return float((np.linalg.norm(self.arm[member], axis=1) + radius[member]).max(initial=0.0))

    def angular_momentum(self) -> np.ndarray:
        """Angular momenta about the centres [N m s], shape (c, 3), of absolute spins."""
        axes = self.matrices
        return np.asarray(np.einsum("nij,nj,nkj,nk->ni", axes, self.moments, axes, self.spin))

    def member_mass(self, radius: np.ndarray) -> np.ndarray:
        """The mass of each clump divided among its members by their volumes [kg], shape (members,)."""
        of, volume = self.of_grain[self.of_grain != NONE], radius[self.of_grain != NONE] ** 3
        return np.asarray(self.mass[of] * volume / np.bincount(of, weights=volume, minlength=len(self))[of])

    def least_mass(self, radius: np.ndarray) -> np.ndarray:
        """Least mass that a force on a member meets [kg], its share of the mass at most, shape (members,)."""
        member = self.of_grain != NONE
        of, r = self.of_grain[member], self.arm[member]
        across = np.cross(r[:, None], np.eye(3)[None])  # r x e_k
        response = np.einsum("nki,ni,nli->nkl", across, 1.0 / self.moments[of], across)
        most = 1.0 / self.mass[of] + np.linalg.eigvalsh(response)[:, 2]
        return np.asarray(np.minimum(1.0 / most, self.member_mass(radius)))


def placed(
    template: ClumpTemplate, number: int, density: float, position: np.ndarray, velocity: np.ndarray, spin: np.ndarray,
    orientation: np.ndarray | None, size: np.ndarray | None,
) -> tuple[InitialClumps, tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:  # fmt: skip
    """Clumps of one template, and position, radius, velocity and spin of their members.

    Args:
        template: the clump.
        number: of the template in the scene.
        density: of the material [kg/m3].
        position: centres of mass [m], shape (c, 3).
        velocity: of the centres [m/s], shape (c, 3).
        spin: angular velocities [rad/s], shape (c, 3).
        orientation: quaternions (w, x, y, z), of any length, from the axes of the clump to the frame axes, shape (c, 4); None:
            all are (1, 0, 0, 0).
        size: factors on the lengths, shape (c,); None: 1.
    """
    c, k = len(position), len(template.radius)
    scale = np.ones(c) if size is None else np.asarray(size, float)
    turn = np.tile([1.0, 0.0, 0.0, 0.0], (c, 1)) if orientation is None else np.asarray(orientation, float)
    turn = multiply_quaternions(turn / np.linalg.norm(turn, axis=1)[:, None], template.axes[None])
    turn = turn / np.linalg.norm(turn, axis=1)[:, None]
    mass = template.mass_at(density) * scale**3
    clumps = InitialClumps(
        first=k * np.arange(c),
        count=np.full(c, k),
        template=np.full(c, number),
        position=np.asarray(position, float),
        velocity=np.asarray(velocity, float),
        spin=np.asarray(spin, float),
        turn=turn,
        mass=mass,
        moments=mass[:, None] * scale[:, None] ** 2 * template.moments,
        axes=np.tile(template.axes, (c, 1)),
        radius=scale * template.equal_radius,
        of_grain=np.repeat(np.arange(c), k),
        arm=(scale[:, None, None] * template.arm).reshape(-1, 3),
    )
    r = clumps.arms()
    members = (
        np.repeat(clumps.position, k, axis=0) + r,
        (scale[:, None] * template.radius).ravel(),
        np.repeat(clumps.velocity, k, axis=0) + np.cross(np.repeat(clumps.spin, k, axis=0), r),
        np.repeat(clumps.spin, k, axis=0),
    )
    return clumps, members


def no_clumps(count: int) -> InitialClumps:
    """None, of ``count`` grains that are their own."""
    whole, rows, turns = np.zeros(0, dtype=np.int64), np.zeros((0, 3)), np.zeros((0, 4))
    return InitialClumps(
        first=whole, count=whole, template=whole, position=rows, velocity=rows, spin=rows, turn=turns, mass=np.zeros(0),
        moments=rows, axes=turns, radius=np.zeros(0), of_grain=np.full(count, NONE), arm=np.zeros((count, 3)),
    )  # fmt: skip


def of_groups(groups: list[InitialClumps | None], counts: list[int]) -> InitialClumps | None:
    """The clumps of groups of grains that follow each other.

    Args:
        groups: of each group; None where its grains are their own.
        counts: grains of each group.
    """
    there = [group for group in groups if group is not None]
    if not there:
        return None
    starts = np.concatenate([[0], np.cumsum(counts)])
    before, moved = 0, []
    of_grain, arm = np.full(starts[-1], NONE), np.zeros((starts[-1], 3))
    for group, start, count in zip(groups, starts, counts, strict=False):
        if group is None:
            continue
        of_grain[start : start + count] = np.where(group.of_grain == NONE, NONE, group.of_grain + before)
        arm[start : start + count] = group.arm
        moved.append(replace(group, first=group.first + start))
        before += len(group)
    names = [name for name in vars(there[0]) if name not in ("of_grain", "arm")]
    both = {name: np.concatenate([getattr(group, name) for group in moved]) for name in names}
    return InitialClumps(**both, of_grain=of_grain, arm=arm)
