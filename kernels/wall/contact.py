"""One grain-wall contact: the law of the scene at one contact point.

The wall's displacement over the step is that of a material point along its exact path, the one halfway between the last
contact point and this one: order 2 for a grain that rolls over a turning wall (the point under the contact now: order 1),
and the slip of a grain that rests in a turning body is exactly zero. The torque arm is the distance to the contact point; the
slip takes that of mid-step.

``contact`` is straight-line code for one contact; a CPU does it in lanes (``sweep``), a GPU thread contact by contact
(``evaluate``).
"""

import functools

import warp as wp
from warpdem.kernels import KernelSet, clump, grain
from warpdem.kernels.contact.dissipation import PARTS_AT, with_losses
from warpdem.kernels.contact.films import RELEASED
from warpdem.kernels.measure.budget import WALL_ENTRY_AT, wall_entry
from warpdem.kernels.step.schedule import (
    Placement,
    Row,
    last_drift_rotation,
    last_drift_shift,
    placed,
    rotated,
    slip_time,
    surface_circulation,
    surface_vector,
    surface_velocity,
    wall_spin,
    wall_velocity,
)
from warpdem.kernels.wall import record
from warpdem.kernels.wall.contact_points import Hit, direction_of, point_of
from warpdem.kernels.wall.mobility import Mobility
from warpdem.kernels.wall.mobility import inverse_mass as inverse_mass_of_wall

vec6 = wp.types.vector(6, wp.float64)


@functools.cache
def build(
    law, dissipation, border, around, *, spins: bool, rolling: bool, rotating_frame: bool, moving_frame: bool,
    inertia_factor: float, moving: int, conveying: bool = False, wear: bool = False, clumps: bool = False,
    yielding: bool = False,
):  # fmt: skip
    """Return ``contact``, the types of what it is given and gives, and readers of what a contact point remembers.

    Args:
        law: of ``law.build`` for walls.
        dissipation: (parts, stored) of ``dissipation.build`` when energies are added up, else None.
        border: periodic images, of ``border.build``.
        around: of ``images.build``.
        spins: grains spin.
        rolling: there is a rolling model, which meets the inertia of the grain times ``inertia_factor``.
        rotating_frame: the axes turn, and the contact history with them.
        moving_frame: the frame moves at all.
        inertia_factor: of ``columns.inertia_factor`` [-].
        moving: number of wall motions relative to the frame.
        conveying: surfaces move along themselves.
        wear: what wears walls is added up, from results that hold the wall's velocity.
        clumps: there are clumps.
        yielding: some walls are free: dashpots go by what grain and wall weigh together.
    """
    g = grain.build(spins)
    of_clumps = clump.build(clumps)
    Inverse = of_clumps.Inverse
    Coefficients, History, past = law.Coefficients, law.History, law.history
    at, remembers = record.columns(past.at), past.at.width
    history_at = record.GEOMETRY.width
    WallHistory, Result = record.history_type(past.at), record.result_type(rolling, wear)
    Rest = wp.types.vector(max(record.result_width(rolling, wear) - record.FRICTION, 3), wp.float64)
    wet, bridge_at = law.bridge_at is not None, law.bridge_at or 0
    losses = len(law.losses)
    at_parts, at_entry = with_losses(PARTS_AT, law.losses), wall_entry(law.losses)
    Parts, WallEntry, Common = (c.vector(wp.float64) for c in (at_parts, at_entry, WALL_ENTRY_AT))
    drags = "drag" in at_parts
    drag_at = (at_parts.drag, at_entry.drag, at_entry.drag_torque, at_entry.drag_power) if drags else (0, 0, 0, 0)
    at_drag, drag_in, torque_in, power_in = drag_at
    parts, stored = dissipation or (None, None)

    @wp.func
    def history_of(wall_contact: WallHistory) -> History:
        """Contact history of the law."""
        out = History()
        for f in range(wp.static(remembers)):
            out[f] = wall_contact[wp.static(history_at) + f]
        return out

    @wp.func
    def point_in(wall_contact: WallHistory) -> wp.vec3d:
        """Contact point in body axes of the wall [m]."""
        return wp.vec3d(
            wall_contact[wp.static(at.point)],
            wall_contact[wp.static(at.point + 1)],
            wall_contact[wp.static(at.point + 2)],
        )

    @wp.func
    def normal_in(wall_contact: WallHistory) -> wp.vec3d:
        """Unit vector from the wall to the grain."""
        return wp.vec3d(
            wall_contact[wp.static(at.normal)],
            wall_contact[wp.static(at.normal + 1)],
            wall_contact[wp.static(at.normal + 2)],
        )

    @wp.func
    def force_in(result: Result) -> wp.vec3d:
        """Force on the grain [N]."""
        return wp.vec3d(
            result[wp.static(record.RESULT.force)],
            result[wp.static(record.RESULT.force + 1)],
            result[wp.static(record.RESULT.force + 2)],
        )

    @wp.func
    def inertia_of(inv: Inverse) -> wp.float64:
        """Inertia that the rolling model meets [kg m2]; 0 without one."""
        inertia = wp.float64(0.0)
        if wp.static(rolling):
            inertia = wp.float64(wp.static(inertia_factor)) / inv[1]
        return inertia

    @wp.func
    def entry_of(n: wp.vec3d, distance: wp.float64, u: wp.vec3d, w: wp.vec3d, p: Parts) -> WallEntry:
        """Energy entry of a full contact with a wall whose material moves at ``u`` [m/s] and turns at ``w`` [rad/s]."""
        normal_force = n * p[wp.static(PARTS_AT.damping)]
        tangential_force = wp.vec3d(
            p[wp.static(PARTS_AT.tangential)],
            p[wp.static(PARTS_AT.tangential + 1)],
            p[wp.static(PARTS_AT.tangential + 2)],
        )
        sliding_force = tangential_force * p[wp.static(PARTS_AT.slides)]
        sticking_force = tangential_force - sliding_force
        sliding_torque = wp.cross(sliding_force, n) * distance
        sticking_torque = wp.cross(sticking_force, n) * distance
        rolling_torque = wp.vec3d(
            p[wp.static(PARTS_AT.rolling)], p[wp.static(PARTS_AT.rolling + 1)], p[wp.static(PARTS_AT.rolling + 2)]
        )
        common = Common(
            normal_force[0], normal_force[1], normal_force[2], sticking_force[0], sticking_force[1],
            sticking_force[2], sticking_torque[0], sticking_torque[1],
            sticking_torque[2], sliding_force[0], sliding_force[1], sliding_force[2], sliding_torque[0],
            sliding_torque[1], sliding_torque[2], rolling_torque[0], rolling_torque[1],
            rolling_torque[2], wp.dot(normal_force, u), wp.dot(sticking_force, u), wp.dot(sliding_force, u),
            wp.dot(rolling_torque, w), p[wp.static(PARTS_AT.cut_spring)], p[wp.static(PARTS_AT.cut_angle)],
            -p[wp.static(PARTS_AT.springs_now)],
        )  # fmt: skip
        out = WallEntry()
        for f in range(wp.static(WALL_ENTRY_AT.width)):
            out[f] = common[f]
        for f in range(wp.static(losses)):
            out[wp.static(WALL_ENTRY_AT.width) + f] = p[wp.static(PARTS_AT.width) + f]
        if wp.static(drags):
            drag = wp.vec3d(p[wp.static(at_drag)], p[wp.static(at_drag + 1)], p[wp.static(at_drag + 2)])
            drag_torque = wp.cross(drag, n) * distance
            for d in range(3):
                out[wp.static(drag_in) + d] = drag[d]
                out[wp.static(torque_in) + d] = drag_torque[d]
            out[wp.static(power_in)] = wp.dot(drag, u)
        return out

    @wp.func
    def in_springs(before: WallHistory, radius: wp.float64, inv: Inverse, c: Coefficients, dt: wp.float64) -> wp.float64:
        """Energy in the springs of a contact point of the step before [J]; needs ``dissipation``."""
        numbers = law.constants(c, radius, wp.float64(1.0) / inv[0], wp.float64(0.0))
        energy = stored(before[wp.static(at.overlap)], numbers, radius, inertia_of(inv), c, history_of(before), dt)
        return energy * before[wp.static(at.weight)]

    @wp.func
    def contact(
        state: g.Record,
        inv: Inverse,  # 1/m, 1/I of the grain
        hit: Hit,  # the contact point
        wall: wp.float64,  # number of the wall
        known: wp.float64,  # 1 if there is a contact point of the step before, ``before``; else 0
        before: WallHistory,
        now: Placement,  # of the wall
        then: Placement,  # where springs slip from
        mobility: Mobility,  # of the wall, where some are ``yielding``
        c: Coefficients,
        row: Row,
        dt: wp.float64,
    ):
        """What is remembered of the contact point, and what it does to the grain.

        Returns:
            Its record, load on the grain (force [N], torque [N m]), what RESULT holds beside feature and force, overlap over
            the radius [-], approach speed [m/s], energy entry and power [W] of the wall's motion; the last two are zero unless
            energies are added up.
        """
        radius = state[3]
        slip_dt = slip_time(row)
        axes_rotation = last_drift_rotation(row)
        v = g.velocity(state)
        w = g.spin(state)
        half = wp.float64(0.5) * dt
        v_predicted = v + g.acceleration(state) * half
        w_predicted = w + g.angular_acceleration(state) * half
        distance = hit[0]
        body_point = point_of(hit)
        body_normal = direction_of(hit)
        n = body_normal
        point = body_point
        if wp.static(moving > 0):
            n = rotated(now, n)
            point = placed(now, body_point)
        overlap = radius - distance
        midway = body_point
        arm = distance
        n_before = n
        overlap_before = overlap
        history = History()
        if known > wp.float64(0.0):
            n_before = normal_in(before)
            overlap_before = before[wp.static(at.overlap)]
            midway = body_point + border.nearest(point_in(before) - body_point) * wp.float64(0.5)
            arm = radius - wp.float64(0.5) * (overlap + overlap_before)
            history = history_of(before)
            if wp.static(rotating_frame):
                n_before = n_before + axes_rotation * n_before
                history = past.rotated(history, axes_rotation)
        after_step = midway
        before_step = midway
        if wp.static(moving > 0):
            after_step = placed(now, midway)
            before_step = placed(then, midway)
        wall_displacement = around.nearest_displacement(after_step - before_step)
        if wp.static(rotating_frame):
            wall_displacement = wall_displacement - axes_rotation * before_step
        if wp.static(moving_frame):
            wall_displacement = wall_displacement - last_drift_shift(row)
        if wp.static(conveying):  # halfway between the force calls, as all of the slip
            vector_then = surface_vector(then)
            circulation_then = surface_circulation(then)
            if wp.static(rotating_frame):
                vector_then = vector_then + axes_rotation * vector_then
                circulation_then = circulation_then + axes_rotation * circulation_then
            vector = (vector_then + surface_vector(now)) * wp.float64(0.5)
            circulation = (circulation_then + surface_circulation(now)) * wp.float64(0.5)
            halfway = (n + n_before) * wp.float64(0.5)
            wall_displacement = wall_displacement + surface_velocity(vector, circulation, halfway) * slip_dt
        if slip_dt == wp.float64(0.0):
            wall_displacement = wp.vec3d()
        w_wall = wall_spin(now)
        slip = v * slip_dt - wp.cross(w, n + n_before) * (wp.float64(0.5) * arm * slip_dt) - wall_displacement
        if known == wp.float64(0.0):  # no contact before: the overlap follows from the displacement in the step
            overlap_before = overlap + wp.dot(slip, n)
        v_wall = wall_velocity(now, point)
        if wp.static(conveying):
            v_wall = v_wall + surface_velocity(surface_vector(now), surface_circulation(now), n)
        velocity = v_predicted - wp.cross(w_predicted, n) * distance - v_wall
        inverse_mass = of_clumps.inverse_mass(inv, n)
        if wp.static(yielding):
            inverse_mass = inverse_mass + inverse_mass_of_wall(mobility, body_normal, body_point)
        numbers = law.constants(c, radius, wp.float64(1.0) / inverse_mass, wp.float64(0.0))
        inertia = inertia_of(inv)
        mean_rotation = (w + w_wall) * (wp.float64(0.5) * slip_dt)
        full_force, full_moment, history_now = law.force(
            n, n_before, overlap, overlap_before, velocity, slip, mean_rotation, w - w_wall, w_predicted - w_wall, dt, numbers,
            radius, inertia, c, history,
        )  # fmt: skip
        weight = hit[1]
        entry = WallEntry()
        power = wp.float64(0.0)
        if wp.static(parts is not None):
            force_parts = parts(
                n, n_before, overlap, overlap_before, velocity, slip, mean_rotation, w - w_wall, dt, numbers, radius, inertia,
                c, history, full_force, full_moment, history_now,
            )  # fmt: skip
            entry = entry_of(n, distance, v_wall, w_wall, force_parts) * weight
            power = weight * (wp.dot(full_force, v_wall) + wp.dot(full_moment, w_wall))
        force = full_force * weight
        moment = full_moment * weight
        torque = moment - wp.cross(n, force) * distance
        memory = WallHistory()
        memory[wp.static(at.wall)] = wall
        memory[wp.static(at.overlap)] = overlap
        memory[wp.static(at.weight)] = weight
        for d in range(3):
            memory[wp.static(at.point) + d] = body_point[d]
            memory[wp.static(at.normal) + d] = n[d]
        for d in range(wp.static(remembers)):
            memory[wp.static(history_at) + d] = history_now[d]
        if wp.static(wet):  # what a bridge held that has broken is the grain's (``films``)
            had = history[wp.static(bridge_at)]
            has = history_now[wp.static(bridge_at)]
            broken = wp.float64(wp.static(RELEASED)) - had
            memory[wp.static(history_at + bridge_at)] = (
                broken if had > wp.float64(0.0) and has <= wp.float64(0.0) else has
            )
        load = vec6(force[0], force[1], force[2], torque[0], torque[1], torque[2])
        rest = Rest()
        for d in range(3):
            rest[d] = moment[d]
        if wp.static(wear):
            for d in range(3):
                rest[3 + d] = v_wall[d]
            begins = wp.float64(0.0)
            if overlap > wp.float64(0.0) and (known == wp.float64(0.0) or overlap_before <= wp.float64(0.0)):
                begins = wp.float64(1.0)
            rest[6] = begins
        return memory, load, rest, overlap / radius, -wp.dot(velocity, n), entry, power

    return KernelSet(
        contact=contact, in_springs=in_springs if stored and remembers else None, point_in=point_in,
        normal_in=normal_in, force_in=force_in, at=at,
        has_parts=parts is not None, spins=spins, rolling=rolling, moving=moving, WallHistory=WallHistory,
        looks_back=moving > 0 or conveying, yielding=yielding,
        Result=Result, Coefficients=Coefficients, Record=g.Record, Inverse=Inverse,
        WallEntry=WallEntry,
    )  # fmt: skip
