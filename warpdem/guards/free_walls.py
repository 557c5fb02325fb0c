r"""The time step against free walls: the largest step at which a wall is integrated stably between the grains it now touches.

A wall much heavier than what it touches stands as still as one that does not move at all; on many grains that are as heavy
together as it is itself, or heavier, it shakes between them faster than any of them alone. The rate of that is the largest of

    w^2 = u.K u / u.M u,     u.K u = sum_c k_c (n_c . d_c)^2 + k_t,c |d_c - (n_c . d_c) n_c|^2
    d_c = u_i + W_i x r_i - u_j - W_j x r_j,     of the wall  V + Omega x (x_c - x),  a q  or  a x (x_c - o) q

over the motions of the wall (six degrees of freedom, one along its axis a, or one about it through o) and of the grains that
touch it, with all their contacts, what else they touch being held; k_c, k_t,c are the slopes of the normal force and the
tangential springs. Power iteration comes to it from below, and holding the others lowers it, so that no stable step is reported
as too long. Damping as in ``guards.stability``: with A_c = k_c dt^2/4 + C_c(dt) dt in the place of k_c, and so across, the
quotient is 1 at the limit.

A servo needs none of this: its M is the mass that it touches. Nor does a wall that rests on the end of its range, or is held:
it does not move.
"""

from typing import NamedTuple

import numpy as np

from warpdem.guards.springs import Springs
from warpdem.kernels.step.free_bodies import BODY
from warpdem.kernels.wall.mobility import MOBILITY
from warpdem.measure.contact_columns import ContactColumns
from warpdem.measure.observers import Contacts
from warpdem.model.dynamic_walls import DynamicWall
from warpdem.model.free_bodies import matrix_of
from warpdem.scene.free import FreeBody
from warpdem.scene.servo import Servo
from warpdem.state.view import RunView

ROUNDS = 40  # of the power iteration
HALVINGS = 30  # of the step


class Coupling(NamedTuple):
    """A free wall and the grains that it touches."""

    springs: Springs
    """All contacts of these grains; rows of others than them are those of the walls."""
    levers: np.ndarray
    """What each degree of freedom of the wall moves the point of each contact by, shape (c, 3, d); 0 where it is another's."""
    mass: np.ndarray
    """Of the grains and, last, M of the wall [kg or kg m2], shape (grains + 1,)."""
    inertia: np.ndarray
    """Of the grains [kg m2], shape (grains,)."""
    wall: np.ndarray
    """Masses or moments of inertia of the wall's degrees of freedom [kg or kg m2], shape (d,)."""


def yielding(view: RunView, contacts: Contacts | ContactColumns) -> np.ndarray:
    """One over the mass of a free wall that each contact meets [1/kg], shape (c,); 0 where there is none."""
    free = [one for one in view.model.schedule.dynamic if not isinstance(one.given, Servo)]
    out = np.zeros(len(contacts.overlap))
    if not free:
        return out
    bodies = view.model.schedule.bodies(view.clock.time)
    for one in free:
        held = np.flatnonzero(contacts.j == -1 - one.number)
        turn, shift = bodies[one.number][:9].reshape(3, 3), bodies[one.number][9:12]
        out[held] = inverse_mass(one.mobility, contacts.normal[held] @ turn, (contacts.point[held] - shift) @ turn)
    return out


def inverse_mass(mobility: np.ndarray, normal: np.ndarray, point: np.ndarray) -> np.ndarray:
    """``kernels.wall.mobility.inverse_mass`` [1/kg] of normals and points [m] in the axes of the wall, shape (c, 3)."""
    push, turn = (_matrix(mobility[MOBILITY.of(name)]) for name in ("inverse_mass", "inverse_inertia"))
    arm = np.cross(point - mobility[MOBILITY.of("center")], normal)
    return np.asarray(
        mobility[MOBILITY.yields] * (np.einsum("ci,ij,cj->c", normal, push, normal) + np.einsum("ci,ij,cj->c", arm, turn, arm))
    )


def _matrix(m: np.ndarray) -> np.ndarray:
    """Symmetric matrix of its six numbers."""
    return m[[[0, 3, 4], [3, 1, 5], [4, 5, 2]]]


def coupling(
    one: DynamicWall, body: np.ndarray, contacts: Contacts, s: Springs, mass: np.ndarray, inertia: np.ndarray
) -> Coupling | None:
    """What a free wall is coupled to; None if it touches nothing, or does not move.

    Args:
        one: the wall.
        body: its present placement, shape (24,).
        contacts: those that touch, as of ``s``.
        s: the same as springs between rows of grains.
        mass: of the grains [kg], shape (n,).
        inertia: of the grains [kg m2], shape (n,).
    """
    held = contacts.j == -1 - one.number
    if not held.any() or (not isinstance(one.given, FreeBody) and one.value("rate") == one.value("predicted") == 0.0):
        return None
    grains = np.unique(s.i[held])  # walls stand second
    rows = np.full(len(mass) + 1, len(grains))
    rows[grains] = np.arange(len(grains))
    near = np.flatnonzero((rows[s.i] < len(grains)) | (rows[s.j] < len(grains)))
    found = s.subset(near)
    lever, wall = levers(one, body, contacts.point[near])
    largest = one.mass if isinstance(one.given, FreeBody) else one.inertia
    return Coupling(
        found.between(rows[found.i], rows[found.j]), lever * held[near, None, None], np.append(mass[grains], largest),
        inertia[grains], wall,
    )  # fmt: skip


def levers(one: DynamicWall, body: np.ndarray, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """``levers`` at points [m], shape (c, 3), and ``wall`` of a coupling, of a wall at the placement ``body``, shape (24,)."""
    turn, shift = body[:9].reshape(3, 3), body[9:12]
    if isinstance(one.given, FreeBody):
        axes = turn @ matrix_of(one.body[BODY.of("orientation")])
        out = point - (turn @ one.center + shift)
        turning = np.stack([np.cross(axis, out) for axis in axes.T], axis=2)
        levers = np.concatenate([np.tile(np.eye(3), (len(point), 1, 1)), turning], axis=2)
        return levers, np.concatenate([np.full(3, one.mass), 1.0 / one.body[BODY.of("rates")]])
    axis = turn @ np.array(one.given.axis)
    along = np.tile(axis, (len(point), 1))
    if one.given.rotates:
        along = np.cross(axis, point - (turn @ np.array(one.given.origin) + shift))
    return along[:, :, None], np.array([one.inertia])


def quotient(c: Coupling, stiffness: np.ndarray) -> float:
    """Rayleigh's quotient u.K u / u.M u of a motion near the stiffest.

    Args:
        c: the wall and its grains.
        stiffness: along the normals and across [N/m], shape (2, c).
    """
    s, n = c.springs, len(c.inertia)
    # motion scaled by sqrt(M), so that K is symmetric; row n stands for what is held
    scale = np.zeros((n + 1, 6))
    scale[:n, :3], scale[:n, 3:] = 1.0 / np.sqrt(c.mass[:n])[:, None], 1.0 / np.sqrt(c.inertia)[:, None]
    lever = c.levers / np.sqrt(c.wall)
    grains, wall = np.zeros((n + 1, 6)), np.random.default_rng(0).normal(size=len(c.wall))
    found = 0.0
    for _ in range(ROUNDS):
        size = np.sqrt((grains**2).sum() + (wall**2).sum())
        if size == 0.0:
            return 0.0
        grains, wall = grains / size, wall / size
        u = grains * scale
        turning = u[s.i, 3:] * s.arm[0][:, None] + u[s.j, 3:] * s.arm[1][:, None]
        moved = u[s.i, :3] - u[s.j, :3] - np.cross(turning, s.normal) - lever @ wall
        along = np.einsum("ij,ij->i", moved, s.normal)
        force = stiffness[1][:, None] * moved + ((stiffness[0] - stiffness[1]) * along)[:, None] * s.normal
        found = float(np.sum(force * moved))
        twist = np.cross(force, s.normal)
        sides = ((s.i, np.hstack([force, s.arm[0][:, None] * twist])), (s.j, np.hstack([-force, s.arm[1][:, None] * twist])))
        grains = scale * sum(np.stack([np.bincount(at, p[:, k], n + 1) for k in range(6)], axis=1) for at, p in sides)
        wall = -np.einsum("ijk,ij->k", lever, force)
    return found


def stable_step(c: Coupling, dt: float) -> float:
    """Largest step [s] at which the wall may be stable with its grains, infinite if it is more than four times ``dt`` [s]."""
    low, high = 0.0, 4.0 * dt

    def grows(step: float) -> bool:
        return quotient(c, c.springs.stiffness * step**2 / 4.0 + c.springs.acting(step) * step) > 1.0

    if not grows(high):
        return np.inf
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if grows(middle) else (middle, high)
    return high
