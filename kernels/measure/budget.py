r"""Energy and momentum budget: what acts on each grain, added up step by step.

A kick changes the energy of motion by exactly the force times the velocity V_k that the integrator has at that time:

    (1/2) m (V_k+1/2^2 - V_k-1/2^2) = dt F_k . V_k,     V_k = (V_k-1/2 + V_k+1/2) / 2

and the same for spins. So the work of any part of a contact's force is known to round-off, whatever the order of the scheme:

    P = F_part . (V_i - V_j - (W_i arm_i + W_j arm_j) x n) + M_part . (W_i - W_j)

V_k is known when the forces of all contacts have been summed. A contact of grains therefore keeps the parts of its force that
are not elastic (``dissipation``) until the next force call, where the velocities of its grains say what they were at the kick
(of members of clumps to (W dt)^2/6), and adds what it has lost to sums of the whole run, which do not depend on the order
(``window_sum``). What a grain gets at walls it takes the power of itself: there the power of the wall's own motion,
F . v_wall + M . w_wall, is taken off and kept apart. Impulses are those of the same forces, about the laboratory's origin, in
axes that turn with the frame.

What does not close when all is added up is the error of the time integration.
"""

import functools

import warp as wp
from warpdem.kernels import KernelSet, grain
from warpdem.kernels.contact.columns import Columns
from warpdem.kernels.contact.dissipation import LOSSES, with_losses
from warpdem.kernels.field import Numbers
from warpdem.kernels.step.motion import joined
from warpdem.kernels.step.schedule import (
    FrameRow,
    Row,
    drift_rotation,
    frame_axes,
    frame_origin,
    frame_velocity,
    gravity,
)

ENERGIES = (*LOSSES, "fields", "carried")
"""What is added up per grain [J]: the first five are taken from it at walls, the others given to it. The LOSSES of the normal
law follow, which are taken from it at walls too; "liquid" also by the power of viscous bridges."""
MOMENTA = ("walls", "gravity", "fields", "carried")
"""Impulse [N s] and angular impulse about the laboratory's origin [N m s] given to a grain, six numbers each."""

MOMENTA_AT = Columns(tuple((name, 6) for name in MOMENTA))
WALL_ENTRY_AT = Columns(
    (
        ("damping", 3),  # dashpot force [N]
        ("sticking", 3),  # the rest of the tangential force while sticking [N]
        ("sticking_torque", 3),  # and its torque [N m]
        ("sliding", 3),  # the same while sliding
        ("sliding_torque", 3),
        ("rolling", 3),  # rolling torque without the spring's [N m]
        ("damping_power", 1),  # power of these four that is due to the walls' own motion [W]
        ("sticking_power", 1),
        ("sliding_power", 1),
        ("rolling_power", 1),
        ("cut_spring", 1),  # lost by cutting the tangential spring [J]
        ("cut_angle", 1),  # and the rolling spring [J]
        ("rescaled", 1),  # and by rescaling [J]
    )
)
"""Sums over the wall contact points of a grain; the LOSSES of the normal law follow [J] (``wall_entry``)."""

Momenta = wp.types.vector(MOMENTA_AT.width, wp.float64)


def energies_type(losses: tuple[str, ...]):
    """Vector of ENERGIES and the LOSSES of the normal law."""
    return wp.types.vector(len(ENERGIES) + len(losses), wp.float64)


def wall_entry(losses: tuple[str, ...]) -> Columns:
    """WALL_ENTRY_AT and the LOSSES of the normal law; the torque of a drag [N m] and its power due to the walls' motion [W]."""
    at = with_losses(WALL_ENTRY_AT, losses)
    return at.and_(Columns((("drag_torque", 3), ("drag_power", 1)) if "drag" in at else ()))


def _field_power(before, number: int, force, in_laboratory: bool, conservative: bool):
    """Function that adds the power of field ``number`` that no potential stands for to those before it."""
    alone = joined(None, number, force, in_laboratory)

    @wp.func
    def power(
        f: FrameRow, q: wp.vec3d, predicted: wp.vec3d, v: wp.vec3d, mass: wp.float64, radius: wp.float64,
        numbers: wp.array(dtype=Numbers),
    ) -> wp.float64:  # fmt: skip
        total = wp.float64(0.0)
        if wp.static(before is not None):
            total = before(f, q, predicted, v, mass, radius, numbers)
        moving = v
        if wp.static(conservative):
            moving = frame_velocity(f, q)  # the potential moves with the frame, which does work
        if wp.static(not (conservative and in_laboratory)):
            total = total + wp.dot(alone(f, q, predicted, mass, radius, numbers), moving)
        return total

    return power


@functools.cache
def build(
    structs, WallContacts, Control, fields: tuple, conservative: tuple[bool, ...], *, spins: bool, walls: bool, energy: bool,
    momentum: bool, rotating_frame: bool, moving_frame: bool, periodic: bool, losses: tuple[str, ...] = (),
):  # fmt: skip
    """Return ``energies``, ``momenta``, ``rotated`` and ``wall_powers`` of one grain at one time.

    Args:
        structs: namespace of ``step.structs.build``.
        WallContacts: of ``wall.evaluate.build``.
        Control: of ``step.structs``.
        fields: external fields as in ``motion.build_acceleration``.
        conservative: whether each of them has a potential.
        spins: grains spin.
        walls: there are walls.
        energy: energies are added up.
        momentum: momenta are added up.
        rotating_frame: the axes turn, and momenta with them.
        moving_frame: the frame's origin is not the laboratory's.
        periodic: there are periodic borders.
        losses: LOSSES of the normal law.
    """
    g = grain.build(spins)
    Model, Grains = structs.Model, structs.Grains
    at_wall = wall_entry(losses)
    Energies, WallEntry = energies_type(losses), at_wall.vector(wp.float64)
    drags = "drag" in at_wall
    of_wall_drag = (at_wall.drag, at_wall.drag_torque, at_wall.drag_power) if drags else (0, 0, 0)
    wall_drag, wall_drag_torque, wall_drag_power = of_wall_drag
    at_liquid = len(ENERGIES) + losses.index("liquid") if drags else 0
    Common = energies_type(())
    more = len(losses)
    vec6 = wp.types.vector(6, wp.float64)
    external = None
    field_power = None
    for number, ((force, in_laboratory), has_energy) in enumerate(zip(fields, conservative, strict=True)):
        external = joined(external, number, force, in_laboratory)
        field_power = _field_power(field_power, number, force, in_laboratory, has_energy)

    @wp.func
    def of_wall(y: WallEntry, first: int) -> wp.vec3d:
        return wp.vec3d(y[first], y[first + 1], y[first + 2])

    @wp.func
    def contact_energies(i: int, v: wp.vec3d, w: wp.vec3d, weight: wp.float64, wall_contacts: WallContacts) -> Energies:
        """Energies by contacts with walls, powers times ``weight`` [s]."""
        out = Energies()
        if wp.static(walls):
            if wall_contacts.candidates[i] > 0:
                y = wall_contacts.entry[i]
                damping = y[wp.static(at_wall.damping_power)] - wp.dot(of_wall(y, wp.static(at_wall.damping)), v)
                sticking = (
                    y[wp.static(at_wall.sticking_power)]
                    - wp.dot(of_wall(y, wp.static(at_wall.sticking)), v)
                    - wp.dot(of_wall(y, wp.static(at_wall.sticking_torque)), w)
                )
                sliding = (
                    y[wp.static(at_wall.sliding_power)]
                    - wp.dot(of_wall(y, wp.static(at_wall.sliding)), v)
                    - wp.dot(of_wall(y, wp.static(at_wall.sliding_torque)), w)
                )
                rolling = y[wp.static(at_wall.rolling_power)] - wp.dot(of_wall(y, wp.static(at_wall.rolling)), w)
                common = Common(
                    damping * weight, sticking * weight, sliding * weight + y[wp.static(at_wall.cut_spring)],
                    rolling * weight + y[wp.static(at_wall.cut_angle)], y[wp.static(at_wall.rescaled)],
                    wp.float64(0.0), wp.float64(0.0),
                )  # fmt: skip
                for f in range(wp.static(len(ENERGIES))):
                    out[f] = common[f]
                for f in range(wp.static(more)):
                    out[wp.static(len(ENERGIES)) + f] = y[wp.static(WALL_ENTRY_AT.width) + f]
                if wp.static(drags):
                    drag = (
                        y[wp.static(wall_drag_power)]
                        - wp.dot(of_wall(y, wp.static(wall_drag)), v)
                        - wp.dot(of_wall(y, wp.static(wall_drag_torque)), w)
                    )
                    out[wp.static(at_liquid)] += drag * weight
        return out

    @wp.func
    def acts(i: int, wall_contacts: WallContacts) -> bool:
        """Whether anything but its contacts with grains may change the energy of grain ``i``."""
        there = bool(wp.static(field_power is not None))
        if wp.static(walls and field_power is None):
            there = wall_contacts.candidates[i] > 0
        return there

    @wp.func
    def field_energies(
        state: g.Record, v: wp.vec3d, mass: wp.float64, weight: wp.float64, at: int, model: Model, control: Control,
        before: Energies,
    ) -> Energies:  # fmt: skip
        """``before``, which holds none yet, with those by the external fields at the call in row ``at``."""
        out = before
        if wp.static(field_power is not None):
            predicted = g.velocity(state) + g.acceleration(state) * (wp.float64(0.5) * model.dt)
            given = field_power(control.frame[at], g.position(state), predicted, v, mass, state[3], control.field)
            out[wp.static(ENERGIES.index("fields"))] = given * weight
        return out

    @wp.func
    def energies(
        i: int, state: g.Record, v: wp.vec3d, w: wp.vec3d, weight: wp.float64, at: int, model: Model, grains: Grains,
        wall_contacts: WallContacts, control: Control,
    ) -> Energies:  # fmt: skip
        """Energies at the call in row ``at``, powers times ``weight`` [s]."""
        found = contact_energies(i, v, w, weight, wall_contacts)
        return field_energies(state, v, wp.float64(1.0) / grains.inverse[i][0], weight, at, model, control, found)

    @wp.func
    def with_moments(arm: wp.vec3d, force: wp.vec3d) -> vec6:
        moment = wp.cross(arm, force)
        return vec6(force[0], force[1], force[2], moment[0], moment[1], moment[2])

    @wp.func
    def from_laboratory(q: wp.vec3d, frames: wp.array(dtype=FrameRow), at: int) -> wp.vec3d:
        """Position relative to the laboratory's origin, in frame axes [m]."""
        seen = q
        if wp.static(moving_frame):
            seen = q + wp.transpose(frame_axes(frames[at])) * frame_origin(frames[at])
        return seen

    @wp.func
    def contact_momenta(
        i: int, state: g.Record, total: vec6, weight: wp.float64, at: int, wall_contacts: WallContacts, control: Control
    ) -> Momenta:  # fmt: skip
        """Impulses by contacts, forces times ``weight`` [s], in frame axes; ``total``: load of all contacts."""
        arm = from_laboratory(g.position(state), control.frame, at)
        out = Momenta()
        by_pairs = total
        if wp.static(walls):
            if wall_contacts.candidates[i] > 0:
                load = wall_contacts.load[i]
                by_pairs = total - load
                moment = wp.cross(arm, wp.vec3d(load[0], load[1], load[2])) + wp.vec3d(load[3], load[4], load[5])
                for k in range(3):
                    out[wp.static(MOMENTA_AT.walls) + k] = load[k] * weight
                    out[wp.static(MOMENTA_AT.walls + 3) + k] = moment[k] * weight
        if wp.static(periodic):  # the two sides of a contact across a border meet in different places
            carried = wp.cross(arm, wp.vec3d(by_pairs[0], by_pairs[1], by_pairs[2])) + wp.vec3d(
                by_pairs[3], by_pairs[4], by_pairs[5]
            )
            for k in range(3):
                out[wp.static(MOMENTA_AT.carried + 3) + k] = carried[k] * weight
        return out

    @wp.func
    def field_momenta(
        state: g.Record, mass: wp.float64, weight: wp.float64, at: int, model: Model, control: Control, before: Momenta
    ) -> Momenta:  # fmt: skip
        """``before``, which holds none yet, with those by gravity and fields."""
        out = before
        arm = from_laboratory(g.position(state), control.frame, at)
        heavy = with_moments(arm, gravity(control.row[at]) * mass)
        for k in range(6):
            out[wp.static(MOMENTA_AT.gravity) + k] = heavy[k] * weight
        if wp.static(external is not None):
            predicted = g.velocity(state) + g.acceleration(state) * (wp.float64(0.5) * model.dt)
            pulled = with_moments(
                arm, external(control.frame[at], g.position(state), predicted, mass, state[3], control.field)
            )
            for k in range(6):
                out[wp.static(MOMENTA_AT.fields) + k] = pulled[k] * weight
        return out

    @wp.func
    def momenta(
        i: int, state: g.Record, total: vec6, weight: wp.float64, at: int, model: Model, grains: Grains,
        wall_contacts: WallContacts, control: Control,
    ) -> Momenta:  # fmt: skip
        """Impulses at the call in row ``at``, forces times ``weight`` [s], in frame axes; ``total``: load of all contacts."""
        found = contact_momenta(i, state, total, weight, at, wall_contacts, control)
        return field_momenta(state, wp.float64(1.0) / grains.inverse[i][0], weight, at, model, control, found)

    @wp.func
    def rotated(all: Momenta, row: Row) -> Momenta:
        """The same vectors in the axes of the next force call."""
        out = all
        if wp.static(rotating_frame):
            for part in range(wp.static(2 * len(MOMENTA))):
                v = wp.vec3d(all[3 * part], all[3 * part + 1], all[3 * part + 2])
                v = v + drift_rotation(row) * v
                out[3 * part] = v[0]
                out[3 * part + 1] = v[1]
                out[3 * part + 2] = v[2]
        return out

    @wp.func
    def lifted(shift: wp.vec3d, weight: wp.vec3d) -> Energies:
        """Potential energy given by a shift ``shift`` [m] against a ``weight`` [N]."""
        out = Energies()
        out[wp.static(ENERGIES.index("carried"))] = -wp.dot(weight, shift)
        return out

    @wp.func
    def shifted(shift: wp.vec3d, momentum: wp.vec3d) -> Momenta:
        """Angular momentum given by a shift ``shift`` [m]."""
        moment = wp.cross(shift, momentum)
        out = Momenta()
        for k in range(3):
            out[wp.static(MOMENTA_AT.carried + 3) + k] = moment[k]
        return out

    @wp.func
    def wall_works(i: int, weight: wp.float64, wall_contacts: WallContacts, work_out: wp.array2d(dtype=wp.float64)):
        """Add the work of each wall on grain ``i``."""
        if wall_contacts.candidates[i] > 0:
            for wall in range(wall_contacts.power.shape[1]):
                work_out[i, wall] = work_out[i, wall] + wall_contacts.power[i, wall] * weight

    return KernelSet(
        acts=acts, contact_energies=contact_energies, field_energies=field_energies, energies=energies,
        contact_momenta=contact_momenta, field_momenta=field_momenta, momenta=momenta, rotated=rotated, lifted=lifted,
        shifted=shifted, wall_works=wall_works,
        energy=energy, momentum=momentum,
    )  # fmt: skip
