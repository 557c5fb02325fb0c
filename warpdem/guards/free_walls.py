r"""The time step against free walls: the largest step at which a wall is integrated stably between the grains it now touches.

A wall much heavier than what it touches stands as still as one that does not move at all; on many grains that are as heavy
together as it is itself, or heavier, it shakes between them faster than any of them alone,

    w^2 >= sum_c k_c b_c^2 / M + sum_i |sum_c k_c b_c n_c|^2 / m_i / sum_c k_c b_c^2

k_c is the slope of the normal force of contact c, n_c its normal, b_c = n_c . a the motion of its point along n_c when the
wall moves by one along its axis a, or ((x_c - o) x n_c) . a about it, M its mass or moment of inertia, m_i the mass of a
grain: Rayleigh's quotient of the motion that these forces begin. Power iteration raises it to that of wall and grains together
with all normal contacts of the latter, what else they touch being held. Without tangential springs, rotation and the motion of
the others it remains a bound from below, so that no stable step is reported as too long. Damping as in ``guards.stability``:
with A_c = k_c dt^2/4 + C_c(dt) dt in the place of k_c the quotient is 1 at the limit.

A wall with six degrees of freedom is taken along the direction that its contacts hold most. A servo needs none of this: its M
is the mass that it touches. Nor does a wall that rests on the end of its range, or is held: it does not move.
"""

from typing import NamedTuple

import numpy as np

from warpdem.guards.springs import Springs
from warpdem.measure.observers import Contacts
from warpdem.model.dynamic_walls import DynamicWall
from warpdem.scene.free import FreeBody

ROUNDS = 20  # of the power iteration
HALVINGS = 40  # of the step


class Coupling(NamedTuple):
    """A free wall and the grains that it touches."""

    springs: Springs
    """All contacts of these grains; rows of others than them are those of the walls."""
    along: np.ndarray
    """b of each: motion along its normal by one of the wall, away from the grain; 0 where another wall or grain is, (c,)."""
    mass: np.ndarray
    """Of the grains and, last, M of the wall [kg or kg m2], shape (grains + 1,)."""


def coupling(one: DynamicWall, body: np.ndarray, contacts: Contacts, s: Springs, mass: np.ndarray) -> Coupling | None:
    """What a free wall is coupled to; None if it touches nothing, or does not move.

    Args:
        one: the wall.
        body: its present placement, shape (24,).
        contacts: those that touch, as of ``s``.
        s: the same as springs between rows of grains.
        mass: of the grains [kg], shape (n,).
    """
    held = contacts.j == -1 - one.number
    if not held.any() or (not isinstance(one.given, FreeBody) and one.value("rate") == one.value("predicted") == 0.0):
        return None
    turn, normal, k = body[:9].reshape(3, 3), s.normal, s.stiffness[0]
    if isinstance(one.given, FreeBody):
        inertia, directions = one.mass, np.linalg.eigh((normal[held].T * k[held]) @ normal[held])[1]
        along = normal @ directions[:, -1]
    elif one.given.turns:
        inertia, arm = one.inertia, contacts.point - (turn @ np.array(one.given.origin) + body[9:12])
        along = np.cross(arm, normal) @ (turn @ np.array(one.given.axis))
    else:
        inertia, along = one.inertia, normal @ (turn @ np.array(one.given.axis))
    grains = np.unique(s.i[held])  # walls stand second
    rows = np.full(len(mass) + 1, len(grains))
    rows[grains] = np.arange(len(grains))
    near = np.flatnonzero((rows[s.i] < len(grains)) | (rows[s.j] < len(grains)))
    found = s.subset(near)
    moved = np.where(held, along, 0.0)[near]
    return Coupling(found.between(rows[found.i], rows[found.j]), moved, np.append(mass[grains], inertia))


def quotient(c: Coupling, stiffness: np.ndarray) -> float:
    """Rayleigh's quotient u.K u / u.M u of a motion near the stiffest, with normal ``stiffness`` [N/m], shape (c,)."""
    s, n = c.springs, len(c.mass) - 1
    extension = -c.along
    found = 0.0
    for _ in range(ROUNDS):
        force = stiffness * extension  # of the contacts on i; the wall takes the opposite
        pushed = force[:, None] * s.normal
        moved = np.stack([np.bincount(s.i, p, n + 1) - np.bincount(s.j, p, n + 1) for p in pushed.T], axis=1)[:n]
        wall = -float(force @ c.along)
        work = float(((moved**2).sum(axis=1) / c.mass[:n]).sum()) + wall**2 / c.mass[n]
        if work == 0.0:
            return 0.0
        u = np.vstack([moved / c.mass[:n, None], np.zeros(3)])
        extension = np.einsum("ij,ij->i", u[s.i] - u[s.j], s.normal) - c.along * (wall / c.mass[n])
        found = float(stiffness @ extension**2) / work
        extension /= np.abs(extension).max(initial=1.0e-300)
    return found


def stable_step(c: Coupling, dt: float) -> float:
    """Largest step [s] at which the wall may be stable with its grains, infinite if it is more than four times ``dt`` [s]."""
    low, high = 0.0, 4.0 * dt

    def grows(step: float) -> bool:
        return quotient(c, c.springs.stiffness[0] * step**2 / 4.0 + c.springs.acting(step)[0] * step) > 1.0

    if not grows(high):
        return np.inf
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if grows(middle) else (middle, high)
    return high
