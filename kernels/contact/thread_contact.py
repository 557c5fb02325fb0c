"""One lane of a contact batch by itself: what a GPU thread does, and a CPU with a law that has no lanes (``sweep``).

A GPU hides latencies by its many threads and needs no scratch: the results stay in registers until they are written. With
contact batches as wide as a warp the threads of a warp read and write neighbouring memory, and since a batch holds one class
(touching or near), a warp either computes or skips. The constants of a contact are computed again from the radii and masses
of its grains: a GPU computes faster than it reads. Bits are those of ``sweep``: the law gives zero beyond the cutoff.
"""

import functools

import warp as wp
from warpdem.kernels.contact.pairs import force_width
from warpdem.kernels.measure.window_sum import add_rounded


@functools.cache
def build(
    structs, pairs, constants, *, spins: bool, rolling: bool, rotating_frame: bool, table: bool, inertia_factor: float,
    ranks: bool = False,
):  # fmt: skip
    """Return ``evaluate``.

    Args:
        structs: namespace of ``step.structs.build``.
        pairs: namespace of ``pairs.build``.
        constants: of ``law.build`` in float64.
        spins: grains spin.
        rolling: there is a rolling model, which meets the inertia of the grains times ``inertia_factor``.
        rotating_frame: the axes turn, and the contact history with them.
        table: coefficients differ between contacts.
        ranks: some grains belong to other processes.
    """
    real, law, parts = pairs.real, pairs.law, pairs.has_parts
    remembers = pairs.memory.width
    Constants, Memory = law.Constants, pairs.memory.Memory
    PairForce = pairs.PairForce
    wish = force_width(spins)

    @wp.func
    def evaluate(
        p: int,
        k: int,
        axes_rotation: pairs.AxesRotation,  # over the last step
        slip_time: wp.float64,
        kick: wp.float64,
        model: structs.Model,
        # read and written: forces
        grains: structs.Grains,
        contacts: structs.ContactBatches,
        # written
        history_out: wp.array3d(dtype=real),  # may be that of ``contacts``
        losses: wp.array3d(dtype=wp.int64),  # of ``Report``, and the row of it to add to
        to: int,
    ):
        """Evaluate lane ``k`` of contact batch ``p``; return its overlap ratio [-] and approach speed [m/s]."""
        at_i = contacts.slot_i[p, k]
        at_j = contacts.slot_j[p, k]
        if at_i + 1 == grains.slot_force.shape[0]:  # an empty lane of its contact batch
            return wp.float64(0.0), wp.float64(0.0)
        i = contacts.owner[p, k]
        j = contacts.partner[p, k]
        gi = grains.record[i]
        gj = grains.record[j]
        # the energy that a contact loses when it opens is found in the step after its last one
        if wp.static(not parts):
            far = pairs.margin(gi, gj) < wp.float64(0.0)
            if wp.static(pairs.wet):  # a bridge acts beyond the reach of the law, and breaks there
                far = far and contacts.history[p, wp.static(pairs.bridge_at), k] == real(0.0)
            if far:
                grains.slot_force[at_i] = PairForce()
                grains.slot_force[at_j] = PairForce()
                for f in range(wp.static(remembers)):
                    history_out[p, f, k] = real(0.0)
                return wp.float64(0.0), wp.float64(0.0)
        coefficients_64 = model.coefficients[0]
        if wp.static(table):
            coefficients_64 = model.coefficients[contacts.kind[p, k]]
        inv_i = grains.inverse[i]
        inv_j = grains.inverse[j]
        radius = pairs.reduced_radius(gi, gj)
        inertia = wp.float64(0.0)
        if wp.static(rolling):
            inertia = wp.float64(wp.static(inertia_factor)) / (inv_i[1] + inv_j[1])
        memory = Memory()
        for f in range(wp.static(remembers)):
            memory[f] = contacts.history[p, f, k]
        if wp.static(rotating_frame and remembers > 0):
            memory = pairs.memory.rotated(memory, axes_rotation)
        c = pairs.cast_coefficients(coefficients_64)
        numbers = Constants()
        if wp.static(pairs.clumps.there):
            numbers = pairs.constants_of_clumps(gi, gj, inv_i + inv_j, real(radius), c)
        else:
            constants_64 = constants(
                coefficients_64, radius, wp.float64(1.0) / (inv_i[0] + inv_j[0]), wp.float64(1.0) / (gi[3] + gj[3])
            )  # fmt: skip
            for f in range(wp.static(Constants._length_)):
                numbers[f] = real(constants_64[f])
        result, now, ratio, speed, lost = pairs.contact(
            gi, gj, numbers, real(radius), real(inertia), c, memory, slip_time, kick, model.dt
        )
        if wp.static(pairs.wet):
            on_i = PairForce()
            on_j = PairForce()
            for f in range(3):
                on_i[f] = result[f]
                on_j[f] = -result[f]
            if wp.static(spins):
                for f in range(3):
                    on_i[3 + f] = result[3 + f]
                    on_j[3 + f] = result[6 + f]
            on_i[wp.static(wish)] = result[9]
            on_j[wp.static(wish)] = result[10]
            on_i[wp.static(wish + 1)] = result[11]
            on_j[wp.static(wish + 1)] = result[11]
            grains.slot_force[at_i] = on_i
            grains.slot_force[at_j] = on_j
        elif wp.static(spins):
            grains.slot_force[at_i] = PairForce(result[0], result[1], result[2], result[3], result[4], result[5])
            grains.slot_force[at_j] = PairForce(-result[0], -result[1], -result[2], result[6], result[7], result[8])
        else:
            grains.slot_force[at_i] = PairForce(result[0], result[1], result[2])
            grains.slot_force[at_j] = PairForce(-result[0], -result[1], -result[2])
        if wp.static(parts):
            counts = bool(True)
            if wp.static(ranks):  # a contact across the border of two ranks counts on that of its first grain
                counts = i < contacts.owned
            if counts:
                for f in range(wp.static(pairs.memory.Losses._length_)):
                    add_rounded(lost[f], to, f, losses)
        for f in range(wp.static(remembers)):
            history_out[p, f, k] = now[f]
        return wp.float64(ratio), wp.float64(speed)

    return evaluate
