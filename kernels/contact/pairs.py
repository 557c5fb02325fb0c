"""Grain-grain contacts: a pack of ``lanes`` contacts side by side.

A contact is too long a chain of dependent operations for one core to overlap two of them, so a plain loop waits for
latencies. Here the same scalar law is written out for ``lanes`` contacts and the results are stored next to each other:
the compiler's SLP vectoriser then makes one SIMD operation of each four (measured: 225 -> 75 ns per grain and step on an
AVX2 core for the full law; no intrinsics). A GPU thread takes one lane (``thread_contact``). IEEE operations give the
same bits in any lane, so a contact's result does not depend on its place.

A block of packs is computed into a scratch that stays in the first cache, then each contact's share is copied to the rows
of its two grains, where the summation finds them one after the other (stored per contact, the summation waited for memory:
60 against 30 ns per grain and step). A share is force (3) [N] and, with spins, torque (3) [N m]. i is the grain of the
lower id. Torque arms R - overlap/2 add up to the distance of the centres, so angular momentum is conserved to round-off.
"""

import functools

import warp as wp
from warpdem.kernels import Built, grain
from warpdem.kernels.contact.dissipation import ENTRY, PARTS

BLOCK = 16  # packs computed before their shares are copied

ANNOUNCE = """
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


def share_width(spins: bool) -> int:
    """Numbers that a grain gets from a contact: force only, or force and torque."""
    return 6 if spins else 3


def result_width(spins: bool) -> int:
    """Numbers computed per contact: force, and both torques."""
    return 9 if spins else 3


@functools.cache
def build(
    real, law, parts, border, lanes: int, *, spins: bool, rolling: bool, history: int, turning_frame: bool, table: bool,
    gap: float,
):  # fmt: skip
    """Return ``pack`` (evaluate) and ``share`` (copy to the grains' rows); ``contact`` is one lane of it.

    Args:
        real: precision of the law, its results and its memory; geometry and motion are always float64.
        law: law function of ``law.build``.
        parts: function of ``dissipation.build`` when energies are added up, else None.
        border: periodic images, of ``border.build``.
        lanes: contacts side by side.
        spins: grains spin (there is a tangential or rolling model).
        rolling: a rolling model acts (two more constants per contact).
        history: numbers remembered per contact, 0, 3 (tangential spring) or 6 (and rolling spring).
        turning_frame: the axes turn, and the memory with them.
        table: coefficients differ between contacts.
        gap: how far beyond contact the law acts [m].
    """
    g = grain.build(spins)
    Lane = wp.types.vector(lanes, real)
    LaneInt = wp.types.vector(lanes, wp.int32)
    vec3 = wp.types.vector(3, real)
    vec3d = wp.vec3d
    Coefficients = wp.types.vector(7, wp.float64)
    Numbers = wp.types.vector(7, real)
    Turn = wp.types.matrix((3, 3), real)
    Result = wp.types.vector(17, real)
    Share = wp.types.vector(share_width(spins), real)
    Parts = wp.types.vector(PARTS, real)
    Entry = wp.types.vector(ENTRY, real)

    @wp.func
    def narrow(v: vec3d) -> vec3:
        return vec3(real(v[0]), real(v[1]), real(v[2]))

    @wp.func
    def narrow_turn(m: wp.mat33d) -> Turn:
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
    def contact(
        gi: g.Record,
        gj: g.Record,
        stiffness: real,
        damping: real,
        radius: real,
        inertia: real,
        c: Numbers,
        spring: vec3,
        angle: vec3,
        slip_time: wp.float64,
        dt: wp.float64,
    ):
        """Force, torques and memory of one contact, with overlap share and approach speed for the guards.

        When energies are added up, what each grain gets of the contact for them.
        """
        across = border.nearest(g.position(gi) - g.position(gj))
        moved = (g.velocity(gi) - g.velocity(gj)) * slip_time
        before = across - moved
        distance = wp.sqrt(wp.dot(across, across))
        distance_before = wp.sqrt(wp.dot(before, before))
        n = across * (wp.float64(1.0) / distance)
        n_before = before * (wp.float64(1.0) / distance_before)
        reach = gi[3] + gj[3]
        overlap = reach - distance
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
            quarter = wp.float64(0.25) * (reach - distance_before - overlap)
            mid_surface = wp.cross(wi * (arm_i - quarter) + wj * (arm_j - quarter), n + n_before)
            slip = moved - mid_surface * (wp.float64(0.5) * slip_time)
            turning = (wi + wj) * (wp.float64(0.5) * slip_time)
            spin = wi - wj
            spin_predicted = wi_predicted - wj_predicted
        force, moment, held, bent = law(
            narrow(n), narrow(n_before), real(overlap), real(reach - distance_before), narrow(velocity), narrow(slip),
            narrow(turning), narrow(spin), narrow(spin_predicted), real(dt), stiffness, damping, radius, inertia, c, spring,
            angle,
        )  # fmt: skip
        smaller = gi[3] if gi[3] < gj[3] else gj[3]
        share = real(overlap / smaller)
        approach = real(-wp.dot(velocity, n)) if overlap > wp.float64(0.0) else real(0.0)
        lever = wp.cross(narrow(n), force)
        ti = moment - lever * real(arm_i)
        tj = -moment - lever * real(arm_j)
        result = Result(
            force[0], force[1], force[2], ti[0], ti[1], ti[2], tj[0], tj[1], tj[2],
            held[0], held[1], held[2], bent[0], bent[1], bent[2], share, approach,
        )  # fmt: skip
        for_i = Entry()
        for_j = Entry()
        if wp.static(parts is not None):
            p = parts(
                narrow(n), narrow(n_before), real(overlap), real(reach - distance_before), narrow(velocity), narrow(slip),
                narrow(turning), narrow(spin), real(dt), stiffness, damping, radius, inertia, c, spring, angle, force,
                moment, held, bent,
            )  # fmt: skip
            for_i = entry(narrow(n), real(1.0), real(arm_i), p)
            for_j = entry(narrow(n), real(-1.0), real(arm_j), p)
        return result, for_i, for_j

    @wp.func
    def pack(
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
        memory: wp.array2d(dtype=Lane),  # of the step before
        # written
        memory_out: wp.array2d(dtype=Lane),  # may be the same array
        scratch_out: wp.array2d(dtype=Lane),
        at: int,
        slot_i: wp.array(dtype=LaneInt),
        slot_j: wp.array(dtype=LaneInt),
        entry_out: wp.array(dtype=Entry),
    ):
        """Evaluate pack ``p`` into row ``at`` of the scratch; returns its largest overlap share [-] and approach speed."""
        i = owner[p]
        j = partner[p]
        deepest = wp.float64(wp.static(0.0 if parts else -1.0))  # the energy of a contact that just opened is still to be told
        for k in range(wp.static(lanes)):
            gi = grains[i[k]]
            gj = grains[j[k]]
            across = border.nearest(g.position(gi) - g.position(gj))
            reach = gi[3] + gj[3] + wp.float64(wp.static(gap))
            deepest = wp.max(deepest, reach * reach * wp.float64(1.000001) - wp.dot(across, across))
        if deepest < wp.float64(0.0):  # nobody is in reach, by more than round-off: what the full law would make zero
            for f in range(wp.static(result_width(spins))):
                scratch_out[at, f] = Lane()
            for f in range(wp.static(history)):
                memory_out[p, f] = Lane()
            return wp.float64(0.0), wp.float64(0.0)
        stiffness = constants[p, 0]
        damping = constants[p, 1]
        radius = Lane()
        inertia = Lane()
        if wp.static(rolling):
            radius = constants[p, 2]
            inertia = constants[p, 3]
        sx = Lane()
        sy = Lane()
        sz = Lane()
        ax = Lane()
        ay = Lane()
        az = Lane()
        if wp.static(history >= 3):
            sx = memory[p, 0]
            sy = memory[p, 1]
            sz = memory[p, 2]
        if wp.static(history == 6):
            ax = memory[p, 3]
            ay = memory[p, 4]
            az = memory[p, 5]
        wide = coefficients[0]
        fx = Lane()
        fy = Lane()
        fz = Lane()
        ix = Lane()
        iy = Lane()
        iz = Lane()
        jx = Lane()
        jy = Lane()
        jz = Lane()
        share = Lane()
        approach = Lane()
        for k in range(wp.static(lanes)):
            if wp.static(table):
                wide = coefficients[kind[p][k]]
            c = Numbers()
            for f in range(7):
                c[f] = real(wide[f])
            spring = vec3(sx[k], sy[k], sz[k])
            angle = vec3(ax[k], ay[k], az[k])
            if wp.static(turning_frame):
                if wp.static(history >= 3):
                    spring = spring + turn_rate * spring
                if wp.static(history == 6):
                    angle = angle + turn_rate * angle
            o, for_i, for_j = contact(
                grains[i[k]], grains[j[k]], stiffness[k], damping[k], radius[k], inertia[k], c, spring, angle,
                slip_time, dt,
            )  # fmt: skip
            if wp.static(parts is not None):
                entry_out[slot_i[p][k]] = for_i
                entry_out[slot_j[p][k]] = for_j
            fx[k] = o[0]
            fy[k] = o[1]
            fz[k] = o[2]
            ix[k] = o[3]
            iy[k] = o[4]
            iz[k] = o[5]
            jx[k] = o[6]
            jy[k] = o[7]
            jz[k] = o[8]
            sx[k] = o[9]
            sy[k] = o[10]
            sz[k] = o[11]
            ax[k] = o[12]
            ay[k] = o[13]
            az[k] = o[14]
            share[k] = o[15]
            approach[k] = o[16]
        scratch_out[at, 0] = fx
        scratch_out[at, 1] = fy
        scratch_out[at, 2] = fz
        if wp.static(spins):
            scratch_out[at, 3] = ix
            scratch_out[at, 4] = iy
            scratch_out[at, 5] = iz
            scratch_out[at, 6] = jx
            scratch_out[at, 7] = jy
            scratch_out[at, 8] = jz
        if wp.static(history >= 3):
            memory_out[p, 0] = sx
            memory_out[p, 1] = sy
            memory_out[p, 2] = sz
        if wp.static(history == 6):
            memory_out[p, 3] = ax
            memory_out[p, 4] = ay
            memory_out[p, 5] = az
        return wp.float64(wp.max(share)), wp.float64(wp.max(approach))

    @wp.func
    def share(
        p: int,
        scratch: wp.array2d(dtype=Lane),
        at: int,
        slot_i: wp.array(dtype=LaneInt),
        slot_j: wp.array(dtype=LaneInt),
        row_out: wp.array(dtype=Share),
    ):
        """Copy the results of pack ``p`` from row ``at`` of the scratch to the rows of its grains."""
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
                row_out[i[k]] = Share(fx[k], fy[k], fz[k], ix[k], iy[k], iz[k])
                row_out[j[k]] = Share(-fx[k], -fy[k], -fz[k], jx[k], jy[k], jz[k])
        else:
            for k in range(wp.static(lanes)):
                row_out[i[k]] = Share(fx[k], fy[k], fz[k])
                row_out[j[k]] = Share(-fx[k], -fy[k], -fz[k])

    @wp.func_native(ANNOUNCE)
    def announce(
        p: int,
        grains: wp.array(dtype=g.Record),
        partner: wp.array(dtype=LaneInt),
        slot_i: wp.array(dtype=LaneInt),
        slot_j: wp.array(dtype=LaneInt),
        row: wp.array(dtype=Share),
    ):
        """Ask for the memory that pack ``p`` will need: partners lie too scattered for a core to foresee."""
        ...

    return Built(
        pack=pack, share=share, announce=announce, contact=contact, narrow_turn=narrow_turn, Share=Share, Entry=Entry,
        Lane=Lane, LaneInt=LaneInt, Coefficients=Coefficients, Numbers=Numbers, Turn=Turn,
    )  # fmt: skip
