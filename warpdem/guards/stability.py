"""The time step against the present contacts: the largest step at which the stiffest of them are integrated stably.

    K u = w^2 M u,     w^2 dt^2/4 + dt u.C(dt) u / u.M u < 1

u holds translations and rotations. Each contact gives K its slope along the normal and its tangential stiffness, C the
damping of both at the present overlap, as it acts at the step dt (``kernels.contact.normal_law``); where friction is left
out, the normal part alone. w is the largest rate of the grains that the sum

    (1/m_i) sum_c (1 + min(1, m_i/m_j)) (k_n + 7/2 k_t)      (walls: 1 for the bracket)

over their contacts ranks as the stiffest; it is found by power iteration, which underestimates it, so that no stable step is
reported as too long. All walls are as if nothing could push them; what that leaves out of free ones: ``guards.free_walls``. The
condition is that of the predicted velocity of exact_drift for a damped oscillator; the other schemes are there for comparison,
also beyond their limits, and are not watched.
"""

from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np

from warpdem.guards import free_walls
from warpdem.guards.springs import Springs
from warpdem.guards.verdict import Verdict, at_time, grain_at
from warpdem.kernels import grain
from warpdem.kernels.contact.normal_law import ROLLING_MASS
from warpdem.measure.contact_columns import ContactColumns
from warpdem.measure.elastic import LEAST_OVERLAP, normal_secant, normal_slope
from warpdem.measure.observers import Contacts, Particles, coefficients_of, read_contacts
from warpdem.measure.part import Part
from warpdem.measure.totals import Totals
from warpdem.model.impact import damping_coefficient, dashpot_slope
from warpdem.scene.messages import rounded_down
from warpdem.scene.servo import Servo
from warpdem.state.contact_history import positions
from warpdem.state.view import RunView

ROUNDING = 1.0e-9  # of sums over the contacts of a grain, in any order
STIFFEST = 200  # grains that are looked at in full
ROUNDS = 60  # of the power iteration
DANGER = 1.25
"""Time step over the limit [-] above which a run is in danger: beds at rest are sound at 1.1, gain energy at 1.3, and
fail at 1.4 to 2 (restitution 0.1 and 0.3)."""
WALL_DANGER = 1.02
"""The same for a free wall with the grains that it touches: 36 grains under a plate of three or ten are at rest at 0.96 and
chatter from 1.02 on, for good; a ball of two on six grains, which rocks by its friction, is at rest at 0.96, and grows at 1.06.
A bed shares out what grows in its stiffest contacts; here all contacts belong to one motion."""
CONFIRM = 20
"""Steps after which a look that found the time step in danger is confirmed: what three times the limit makes of a bed
takes longer, the deepest moment of an impact is shorter."""


def springs(view: RunView, contacts: Contacts) -> Springs:
    """The touching contacts of a run at their present overlaps, rows being grains in order of id."""
    p = Particles(view)
    n, ids = len(p.id), p.id
    i, j = positions(ids, contacts.i), np.where(contacts.j < 0, n, positions(ids, contacts.j))
    return _springs(view, contacts, coefficients_of(view, contacts), i, j, p.radius, p.mass)


def _springs(
    view: RunView, contacts: Contacts | ContactColumns, table: np.ndarray, i: np.ndarray, j: np.ndarray,
    radius: np.ndarray, mass: np.ndarray,
) -> Springs:  # fmt: skip
    """The same with rows ``i`` and ``j`` of grains of these radii [m] and masses [kg]; ``table``: coefficients, by contact."""
    n, plan = len(mass), view.model.features
    radius, mass = np.append(radius, np.inf), np.append(mass, np.inf)
    overlap = np.maximum(contacts.overlap, LEAST_OVERLAP)
    normal = plan.contact.normal
    slope, k = normal_slope(normal, overlap, contacts), normal_secant(normal, overlap, contacts)
    at = plan.contact.coefficients
    reduced = 1.0 / (1.0 / mass[i] + 1.0 / mass[j] + free_walls.yielding(view, contacts))
    damping = damping_coefficient(normal, k, contacts.stiffness, table[:, at.damping], reduced)
    friction = (table[:, at.friction] > 0.0) * 1.0 if plan.contact.tangential else np.zeros(len(k))
    arm = np.stack([radius[i], np.where(j < n, radius[j], 0.0)]) - np.where(j < n, 0.5, 1.0) * overlap
    shear = friction * table[:, at.shear] * k
    out = Springs(i, j, contacts.normal, np.stack([slope, shear]), np.stack([dashpot_slope(normal, slope, k), shear]),
                  np.stack([damping, friction * table[:, at.shear_damping] * damping]),
                  np.stack([reduced, ROLLING_MASS * reduced]), arm)  # fmt: skip
    touching = contacts.overlap > 0.0
    return out if touching.all() else out.subset(np.flatnonzero(touching))


def rate_estimates(s: Springs, mass: np.ndarray) -> np.ndarray:
    """Square of the rate that ranks the grains, by the sum over the contacts of each [1/s2], shape (n,)."""
    n, heavy = len(mass), np.append(mass, np.inf)
    k = s.stiffness[0] + 3.5 * s.stiffness[1]
    total = np.bincount(s.i, k * (1.0 + np.where(s.j < n, np.minimum(1.0, heavy[s.i] / heavy[s.j]), 0.0)), n + 1)
    total += np.bincount(s.j, k * (1.0 + np.minimum(1.0, heavy[s.j] / heavy[s.i])) * (s.j < n), n + 1)
    return total[:n] / mass


def stiffest_mode(s: Springs, mass: np.ndarray, inertia: np.ndarray) -> tuple[float, np.ndarray, int]:
    """The mode of the largest rate of the grains that ``s`` joins: w^2 [1/s2], its motion, and the grain that moves most.

    The motion is the square of the relative displacement at each contact along the normal and across, over u.M u [1/kg], shape
    (2, c).
    """
    rows = np.unique(np.concatenate([s.i, s.j]))
    rows = rows[rows < len(mass)]
    n, place = len(rows), np.full(len(mass) + 1, len(rows))
    place[rows] = np.arange(n)
    i, j = place[s.i], place[s.j]
    # motion scaled by sqrt(M), so that K is symmetric; the last row stands for the walls, which do not move
    scale = np.zeros((n + 1, 6))
    scale[:n, :3], scale[:n, 3:] = 1.0 / np.sqrt(mass[rows])[:, None], 1.0 / np.sqrt(inertia[rows])[:, None]

    def stretch(motion: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Relative displacement at each contact along the normal, shape (c,), and across, shape (c, 3)."""
        u = motion * scale
        turning = u[i, 3:] * s.arm[0][:, None] + u[j, 3:] * s.arm[1][:, None]
        displacement = u[i, :3] - u[j, :3] - np.cross(turning, s.normal)
        along = np.einsum("ij,ij->i", displacement, s.normal)
        return along, displacement - along[:, None] * s.normal

    def pull(force: np.ndarray) -> np.ndarray:
        """What contact forces, shape (c, 3), do to each motion."""
        twist = np.cross(force, s.normal)
        sides = ((i, np.hstack([force, s.arm[0][:, None] * twist])), (j, np.hstack([-force, s.arm[1][:, None] * twist])))
        total = sum(np.stack([np.bincount(at, part[:, c], n + 1) for c in range(6)], axis=1) for at, part in sides)
        return total * scale

    motion = np.random.default_rng(0).normal(size=(n + 1, 6))
    square = 0.0
    for _ in range(ROUNDS):
        motion /= np.linalg.norm(motion)
        along, across = stretch(motion)
        moved = pull((s.stiffness[0] * along)[:, None] * s.normal + s.stiffness[1][:, None] * across)
        square, before = float(np.sum(motion * moved)), motion
        motion = moved
    along, across = stretch(before)
    share = np.stack([along**2, np.einsum("ij,ij->i", across, across)])
    return square, share, int(rows[np.argmax(np.einsum("ij,ij->i", before[:n], before[:n]))])


def worst_of(s: Springs, estimates: np.ndarray, dt: float) -> tuple[float, float]:
    """Largest damping ratio of a contact at ``dt`` [-], and largest of the estimates: what ``least_limit`` goes by."""
    acting = s.acting(dt)
    ratio = acting / (2.0 * np.sqrt(np.maximum(s.stiffness, 1.0e-300) * s.mass))
    return float(ratio.max()), float(estimates.max())


def least_limit(z: float, estimate: float) -> float:
    """A time step [s] that no limit is below if the step of ``worst_of`` is not over it."""
    return float(2.0 / np.sqrt(estimate) * (np.sqrt(1.0 + 4.0 * z * z) - 2.0 * z))


def stable_step(s: Springs, mass: np.ndarray, inertia: np.ndarray) -> tuple[float, int]:
    """Largest stable step [s] for the stiffest grains that ``s`` joins, and the one that sets it."""
    stiffest = np.append(np.isin(np.arange(len(mass)), np.argsort(rate_estimates(s, mass))[-STIFFEST:]), False)
    s = s.subset(np.flatnonzero(stiffest[s.i] | stiffest[s.j]))
    square, motion, worst = stiffest_mode(s, mass, inertia)
    low, high = 0.0, 2.0 / np.sqrt(max(square, 1.0e-300))  # without damping
    for _ in range(40):
        dt = 0.5 * (low + high)
        grows = square * dt**2 / 4.0 + dt * np.sum(s.acting(dt) * motion) > 1.0
        low, high = (low, dt) if grows else (dt, high)
    return high, worst


@dataclass(frozen=True)
class Seen:
    """What looks have found so far."""

    share: float = 0.0
    """Time step over the limit, at the last look [-]; 0 where it was far below."""
    largest: float = 0.0
    """The most at any look [-]."""
    step: int = 0
    """When that was."""
    at: int = 0
    """Step of the last look."""
    danger: bool = False
    """Whether the run was in danger then."""


class StabilityGuard:
    """Watches the time step of a run."""

    NAME = "stability"

    def __init__(self) -> None:
        self._seen = self._next = Seen()

    @property
    def seen(self) -> Seen:
        """What looks have found so far."""
        return self._seen

    @property
    def excess(self) -> str:
        """By how much the time step exceeded the stability limit at most, as text; empty if it never did."""
        seen = self._seen
        if seen.largest <= 1.0:
            return ""
        return (
            f"up to {seen.largest:.3g} times the stability limit of the contacts (checked at step {seen.step}); "
            f"above {DANGER:g} times, {WALL_DANGER:g} times that of a free wall with its grains, a run is in danger"
        )

    @property
    def in_danger(self) -> bool:
        """Whether the time step was over ``DANGER`` of the limit at the last look, or ``WALL_DANGER`` by a free wall."""
        return self._seen.danger

    def look(self, view: RunView, now: Totals) -> Verdict | None:
        """What is wrong with the time step: None unless it is in danger now and was at the look before."""
        clock = view.clock
        found = max(_step_ratio(view, now), _wall_ratio(view, now), key=lambda one: one.ratio / one.allowed)
        ratio, danger = found.ratio, found.ratio > found.allowed
        seen = self._seen
        largest, step = max((seen.largest, seen.step), (ratio, clock.step_number), key=lambda peak: peak[0])
        self._next = Seen(ratio, largest, step, clock.step_number, danger)
        confirmed = self.in_danger and clock.step_number >= seen.at + CONFIRM
        if not danger or not confirmed:
            return None
        return Verdict(
            self.NAME,
            f"{at_time(clock)}: the time step {clock.dt:.3g} s is {ratio:.3g} times the stability limit {found.limit:.3g} s of "
            f"the present contacts, at two looks in a row; up to {found.allowed:g} times a run stays stable. The stiffest "
            f"contacts: {found.worst}.",
        )

    def remember(self) -> None:
        """Keep what the last look has found."""
        self._seen = self._next

    def state(self) -> dict[str, Any]:
        """What is kept between looks."""
        return asdict(self._seen)

    def restore(self, state: dict[str, Any]) -> None:
        """Take over what ``state`` gave."""
        self._seen = self._next = Seen(**state)


class Ratio(NamedTuple):
    """What a look finds."""

    ratio: float
    """Time step over the limit of the present contacts [-]; 0 where it is far below."""
    limit: float
    """The limit [s]."""
    worst: str
    """What sets it, and what to change."""
    allowed: float = DANGER
    """Ratio above which the run is in danger [-]."""


def _step_ratio(view: RunView, now: Totals) -> Ratio:
    """Of the grains, every wall being as if it could not be pushed."""
    dt, none = view.clock.dt, Ratio(0.0, np.inf, "")
    if view.model.features.backend.integrator != "exact_drift" or _far_below(now):
        return none
    view.gather()
    found, p = springs(view, read_contacts(view)), Particles(view)
    if not len(found.i) or dt / least_limit(*worst_of(found, rate_estimates(found, p.mass), dt)) <= 1.0:
        return none
    limit, worst = stable_step(found, p.mass, p.inertia)
    remedy = "Take a smaller time.step, or a larger time.max_speed for step = 'auto'"
    return Ratio(float(dt / limit), float(limit), f"{grain_at(view.state, worst)}. {remedy}")


def _wall_ratio(view: RunView, now: Totals) -> Ratio:
    """Of the free walls, each with the grains that it touches."""
    dt, worst = view.clock.dt, Ratio(0.0, np.inf, "", WALL_DANGER)
    free = [one for one in view.model.schedule.dynamic if not isinstance(one.given, Servo)]
    if not free or view.model.features.backend.integrator != "exact_drift":
        return worst
    view.gather()
    contacts, p = read_contacts(view), Particles(view)
    if not len(contacts.i):
        return worst
    found = springs(view, contacts)
    touching = contacts.only(contacts.overlap > 0.0)
    for one in free:
        coupling = free_walls.coupling(one, now.bodies[one.number], touching, found, p.mass, p.inertia)
        if coupling is None or (limit := free_walls.stable_step(coupling, dt)) >= worst.limit:
            continue
        kind, unit = ("moment of inertia", "kg m2") if one.given.rotates == 1 else ("mass", "kg")
        worst = Ratio(
            dt / limit, limit,
            f"free wall {one.wall.name!r}, its {kind} {coupling.mass[-1]:.3g} {unit}, with the {len(coupling.mass) - 1} grains "
            f"that it touches. Take a time.step below {rounded_down(limit)} s, or a heavier wall",
            WALL_DANGER,
        )  # fmt: skip
    return worst


def _far_below(now: Totals) -> bool:
    """Whether the estimate is below the limit whatever the order of its sums: then nothing is sorted by ids."""
    found = [one for one in now.each(own_worst) if one is not None]
    # of NumPy: what is no number on some rank must not get lost
    return not found or bool(now.view.clock.dt / least_limit(*np.max(found, axis=0).tolist()) < 1.0 - ROUNDING)


def own_worst(part: Part) -> tuple[float, float] | None:
    """``worst_of`` the grains of a process, with all their contacts; None where nothing touches."""
    view, contacts = part.view, part.contacts
    i, j = contacts.slots()
    radius, mass = view.state.record.numpy()[:, grain.RADIUS], 1.0 / view.state.inverse.numpy()[:, 0]
    found = _springs(view, contacts, contacts.coefficients, i, j, radius, mass)
    # grains of other processes too, of which not all contacts are here: their estimates are no larger than they are there
    return worst_of(found, rate_estimates(found, mass), view.clock.dt) if len(found.i) else None
