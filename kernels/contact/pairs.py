"""Grain-grain contacts: a contact batch of ``lanes`` contacts side by side.

A contact is too long a chain of dependent operations for one core to overlap two of them, so a plain loop waits for
latencies. Here the same scalar law is written out for ``lanes`` contacts and the results are stored next to each other:
the compiler's SLP vectoriser then makes one SIMD operation of each four (measured: 225 -> 75 ns per grain and step on an
AVX2 core for the full law; no intrinsics). A GPU thread takes one lane (``thread_contact``). IEEE operations give the
same bits in any lane, so a contact's result does not depend on its place.

A block of batches is computed into a scratch array that stays in the first-level cache. Then the pair force of each contact
is copied to the force slots of its two grains, where the summation reads them one after the other (with one slot per
contact the summation waited for memory: 60 against 30 ns per grain and step). A pair force is the force (3) [N] and, with
spins, the torque (3) [N m] on one grain. i is the grain of the lower id. Torque arms R - overlap/2 add up to the distance of
the centres, so angular momentum is conserved to round-off.
"""

import functools

import warp as wp
from warpdem.kernels import Built, grain
from warpdem.kernels.contact.columns import Columns
from warpdem.kernels.contact.dissipation import ENTRY_AT, PARTS_AT

BLOCK = 16  # contact batches computed before their forces are copied to the force slots

PREFETCH = """
#if !defined(__CUDA_ARCH__)
    for (wp::int32 k = 0; k < wp::int32(sizeof(partner.data[p].c) / sizeof(partner.data[p].c[0])); ++k) {
        const char* record = reinterpret_cast<const char*>(grains.data + partner.data[p].c[k]);
        __builtin_prefetch(record);
        __builtin_prefetch(record + 64);
        __builtin_prefetch(row.data + slot_i.data[p].c[k], 1);
        __builtin_prefetch(row.data + slot_j.data[p].c[k], 1);
    }
#endif
"""


def pair_force_width(spins: bool) -> int:
    """Numbers of a pair force on one grain: the force, or force and torque."""
    return 6 if spins else 3


RESULT_AT = Columns((("force", 3), ("torque_i", 3), ("torque_j", 3)))
"""What a contact gives its two grains: force on i [N], the opposite on j, and the torques on both [N m]."""


def result_width(spins: bool) -> int:
    """Numbers computed per contact: force, and both torques."""
    return RESULT_AT.width if spins else 3


@functools.cache
def build(
    real, law, parts, border, lanes: int, *, spins: bool, stored: Columns, turning_frame: bool, table: bool, gap: float
):
    """Return ``evaluate_batch`` and ``scatter_forces`` (copy to the force slots); ``contact`` evaluates one lane.

    Args:
        real: precision of the law, its results and the contact history; geometry and motion are always float64.
        law: namespace of ``law.build`` for pairs of grains.
        parts: function of ``dissipation.build`` when energies are added up, else None.
        border: periodic images, of ``border.build``.
        lanes: contacts side by side.
        spins: grains spin (there is a tangential or rolling model).
        stored: columns of the constants that are kept of each contact.
        turning_frame: the axes turn, and the contact history with them.
        table: coefficients differ between contacts.
        gap: how far beyond contact the law acts [m].
    """
    g = grain.build(spins)
    past = law.history
    remembers, width = past.at.width, result_width(spins)
    Lane = wp.types.vector(lanes, real)
    LaneInt = wp.types.vector(lanes, wp.int32)
    vec3 = wp.types.vector(3, real)
    vec3d = wp.vec3d
    Coefficients = law.at.vector(wp.float64)
    Numbers, Constants, History, Turn = law.Coefficients, law.Constants, law.History, past.Rotation
    Result = RESULT_AT.vector(real)
    HistoryBatch = wp.types.matrix((max(remembers, 1), lanes), real)
    ResultBatch = wp.types.matrix((width, lanes), real)
    PairForce = wp.types.vector(pair_force_width(spins), real)
    Parts = PARTS_AT.vector(real)
    Entry = ENTRY_AT.vector(real)
    ConstantsBatch = wp.types.matrix((stored.width, lanes), real)
    law_constants_width, with_radius = Constants._length_, "radius" in stored
    radius_at, inertia_at = (stored.radius, stored.inertia) if with_radius else (0, 0)

    @wp.func
    def cast_vector(v: vec3d) -> vec3:
        return vec3(real(v[0]), real(v[1]), real(v[2]))

    @wp.func
    def cast_rotation(m: wp.mat33d) -> Turn:
        """The same matrix in the precision of the law."""
        return Turn(
            real(m[0, 0]), real(m[0, 1]), real(m[0, 2]), real(m[1, 0]), real(m[1, 1]), real(m[1, 2]),
            real(m[2, 0]), real(m[2, 1]), real(m[2, 2]),
        )  # fmt: skip

    @wp.func
    def entry(n: vec3, sign: real, arm: real, p: Parts) -> Entry:
        """The ENTRY of the grain on side ``sign``."""
        half = real(0.5)
        return Entry(
            sign * n[0], sign * n[1], sign * n[2], p[0], arm, sign * p[1], sign * p[2], sign * p[3], p[4],
            sign * p[5], sign * p[6], sign * p[7], half * p[8], half * p[9], half * (p[10] - p[11]),
        )  # fmt: skip

    @wp.func
    def cast_coefficients(coefficients_64: Coefficients) -> Numbers:
        """The same coefficients in the precision of the law."""
        c = Numbers()
        for f in range(wp.static(law.at.width)):
            c[f] = real(coefficients_64[f])
        return c

    @wp.func
    def contact(
        gi: g.Record,
        gj: g.Record,
        k: Constants,
        radius: real,
        inertia: real,
        c: Numbers,
        history: History,
        slip_time: wp.float64,
        dt: wp.float64,
    ):
        """Result, contact history, overlap over the smaller radius, approach speed and energy entries of one contact.

        The entries of the two grains are zero unless energies are added up.
        """
        across = border.nearest(g.position(gi) - g.position(gj))
        moved = (g.velocity(gi) - g.velocity(gj)) * slip_time
        before = across - moved
        distance = wp.sqrt(wp.dot(across, across))
        distance_before = wp.sqrt(wp.dot(before, before))
        n = across * (wp.float64(1.0) / distance)
        n_before = before * (wp.float64(1.0) / distance_before)
        radii = gi[3] + gj[3]
        overlap = radii - distance
        velocity = g.velocity(gi) - g.velocity(gj) + (g.acceleration(gi) - g.acceleration(gj)) * (wp.float64(0.5) * dt)
        slip = moved
        turning = vec3d()
        spin = vec3d()
        spin_predicted = vec3d()
        arm_i = gi[3] - wp.float64(0.5) * overlap
        arm_j = gj[3] - wp.float64(0.5) * overlap
        if wp.static(spins):
            wi = g.spin(gi)
            wj = g.spin(gj)
            half = wp.float64(0.5) * dt
            wi_predicted = wi + g.angular_acceleration(gi) * half
            wj_predicted = wj + g.angular_acceleration(gj) * half
            surface = wp.cross(wi_predicted * arm_i + wj_predicted * arm_j, n)
            velocity = velocity - surface
            # arms of mid-step, as the spins are: with those of the end a pair that revolves while it deforms would slip
            quarter = wp.float64(0.25) * (radii - distance_before - overlap)
            mid_surface = wp.cross(wi * (arm_i - quarter) + wj * (arm_j - quarter), n + n_before)
            slip = moved - mid_surface * (wp.float64(0.5) * slip_time)
            turning = (wi + wj) * (wp.float64(0.5) * slip_time)
            spin = wi - wj
            spin_predicted = wi_predicted - wj_predicted
        force, moment, now = law.force(
            cast_vector(n), cast_vector(n_before), real(overlap), real(radii - distance_before), cast_vector(velocity),
            cast_vector(slip), cast_vector(turning), cast_vector(spin), cast_vector(spin_predicted),
            real(dt), k, radius, inertia, c, history,
        )  # fmt: skip
        smaller = gi[3] if gi[3] < gj[3] else gj[3]
        ratio = real(overlap / smaller)
        approach = real(-wp.dot(velocity, n)) if overlap > wp.float64(0.0) else real(0.0)
        lever = wp.cross(cast_vector(n), force)
        ti = moment - lever * real(arm_i)
        tj = -moment - lever * real(arm_j)
        result = Result(force[0], force[1], force[2], ti[0], ti[1], ti[2], tj[0], tj[1], tj[2])
        for_i = Entry()
        for_j = Entry()
        if wp.static(parts is not None):
            p = parts(
                cast_vector(n), cast_vector(n_before), real(overlap), real(radii - distance_before),
                cast_vector(velocity),
                cast_vector(slip), cast_vector(turning), cast_vector(spin), real(dt),
                k, radius, inertia, c, history, force, moment, now,
            )  # fmt: skip
            for_i = entry(cast_vector(n), real(1.0), real(arm_i), p)
            for_j = entry(cast_vector(n), real(-1.0), real(arm_j), p)
        return result, now, ratio, approach, for_i, for_j

    @wp.func
    def evaluate_batch(
        p: int,
        # state, read
        grains: wp.array(dtype=g.Record),
        owner: wp.array(dtype=LaneInt),
        partner: wp.array(dtype=LaneInt),
        constants: wp.array2d(dtype=Lane),
        # coefficients
        kind: wp.array(dtype=LaneInt),
        coefficients: wp.array(dtype=Coefficients),
        turn_rate: Turn,
        slip_time: wp.float64,
        dt: wp.float64,
        history_in: wp.array2d(dtype=Lane),  # of the step before
        # written
        history_out: wp.array2d(dtype=Lane),  # may be the same array
        scratch_out: wp.array2d(dtype=Lane),
        at: int,
        slot_i: wp.array(dtype=LaneInt),
        slot_j: wp.array(dtype=LaneInt),
        entry_out: wp.array(dtype=Entry),
    ):
        """Evaluate contact batch ``p`` into row ``at`` of the scratch; return largest overlap ratio [-] and approach speed."""
        i = owner[p]
        j = partner[p]
        # largest cutoff^2 - distance^2 of the lanes; 0 where energies are added up, since the energy that a contact loses
        # when it opens is found in the step after its last one
        squared_margin = wp.float64(wp.static(0.0 if parts else -1.0))
        for k in range(wp.static(lanes)):
            gi = grains[i[k]]
            gj = grains[j[k]]
            across = border.nearest(g.position(gi) - g.position(gj))
            cutoff = gi[3] + gj[3] + wp.float64(wp.static(gap))
            squared_margin = wp.max(squared_margin, cutoff * cutoff * wp.float64(1.000001) - wp.dot(across, across))
        if squared_margin < wp.float64(0.0):  # all pairs are beyond the cutoff by more than round-off: the law gives zero
            for f in range(wp.static(width)):
                scratch_out[at, f] = Lane()
            for f in range(wp.static(remembers)):
                history_out[p, f] = Lane()
            return wp.float64(0.0), wp.float64(0.0)
        histories = HistoryBatch()
        for f in range(wp.static(remembers)):
            histories[f] = history_in[p, f]
        kept = ConstantsBatch()
        for f in range(wp.static(stored.width)):
            kept[f] = constants[p, f]
        coefficients_64 = coefficients[0]
        results = ResultBatch()
        ratios = Lane()
        approach = Lane()
        for k in range(wp.static(lanes)):
            gi = grains[i[k]]
            gj = grains[j[k]]
            if wp.static(table):
                coefficients_64 = coefficients[kind[p][k]]
            numbers = Constants()
            for f in range(wp.static(law_constants_width)):
                numbers[f] = kept[f, k]
            # every law is given R*; the compiler removes it where no law uses it
            radius = real(gi[3] * gj[3] / (gi[3] + gj[3]))
            inertia = real(0.0)
            if wp.static(with_radius):
                radius = kept[wp.static(radius_at), k]
                inertia = kept[wp.static(inertia_at), k]
            history = History()
            for f in range(wp.static(remembers)):
                history[f] = histories[f, k]
            if wp.static(turning_frame):
                history = past.rotated(history, turn_rate)
            result, now, ratio, speed, for_i, for_j = contact(
                gi, gj, numbers, radius, inertia, cast_coefficients(coefficients_64), history, slip_time, dt
            )
            if wp.static(parts is not None):
                entry_out[slot_i[p][k]] = for_i
                entry_out[slot_j[p][k]] = for_j
            for f in range(wp.static(width)):
                results[f, k] = result[f]
            for f in range(wp.static(remembers)):
                histories[f, k] = now[f]
            ratios[k] = ratio
            approach[k] = speed
        for f in range(wp.static(width)):
            scratch_out[at, f] = results[f]
        for f in range(wp.static(remembers)):
            history_out[p, f] = histories[f]
        return wp.float64(wp.max(ratios)), wp.float64(wp.max(approach))

    @wp.func
    def scatter_forces(
        p: int,
        scratch: wp.array2d(dtype=Lane),
        at: int,
        slot_i: wp.array(dtype=LaneInt),
        slot_j: wp.array(dtype=LaneInt),
        row_out: wp.array(dtype=PairForce),
    ):
        """Copy the results of contact batch ``p`` from row ``at`` of the scratch to the force slots of its grains."""
        i = slot_i[p]
        j = slot_j[p]
        fx = scratch[at, 0]
        fy = scratch[at, 1]
        fz = scratch[at, 2]
        if wp.static(spins):
            ix = scratch[at, 3]
            iy = scratch[at, 4]
            iz = scratch[at, 5]
            jx = scratch[at, 6]
            jy = scratch[at, 7]
            jz = scratch[at, 8]
            for k in range(wp.static(lanes)):
                row_out[i[k]] = PairForce(fx[k], fy[k], fz[k], ix[k], iy[k], iz[k])
                row_out[j[k]] = PairForce(-fx[k], -fy[k], -fz[k], jx[k], jy[k], jz[k])
        else:
            for k in range(wp.static(lanes)):
                row_out[i[k]] = PairForce(fx[k], fy[k], fz[k])
                row_out[j[k]] = PairForce(-fx[k], -fy[k], -fz[k])

    @wp.func_native(PREFETCH)
    def prefetch(
        p: int,
        grains: wp.array(dtype=g.Record),
        partner: wp.array(dtype=LaneInt),
        slot_i: wp.array(dtype=LaneInt),
        slot_j: wp.array(dtype=LaneInt),
        row: wp.array(dtype=PairForce),
    ):
        """Prefetch the data of contact batch ``p``: its partners are too scattered for the hardware prefetcher."""
        ...

    return Built(
        evaluate_batch=evaluate_batch, scatter_forces=scatter_forces, prefetch=prefetch, contact=contact,
        cast_rotation=cast_rotation, cast_coefficients=cast_coefficients, PairForce=PairForce, Entry=Entry,
        Lane=Lane, LaneInt=LaneInt, Coefficients=Coefficients, Numbers=Numbers, Turn=Turn,
    )  # fmt: skip
