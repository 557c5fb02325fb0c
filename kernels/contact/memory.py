"""What a contact of two grains keeps from one force call to the next: its history, and impulses whose work is not known yet.

The energy budget takes the work of a force from the velocities that its kick leaves in the mean (``measure.budget``). They are
known at the next force call: those of then are the velocities of now without half of the acceleration that was kicked with.
"""

import functools

import warp as wp
from warpdem.kernels import KernelSet, grain
from warpdem.kernels.contact.columns import Columns, scalars
from warpdem.kernels.contact.dissipation import LOSSES, PARTS_AT, WORK_AT, build_impulses, with_losses


@functools.cache
def build(real, law, border, impulses: Columns, *, spins: bool, energy: bool):
    """Return ``Memory``, the type of all that is kept, and what reads it, makes it, and says what a contact has lost.

    Args:
        real: precision of the law and the contact history.
        law: namespace of ``law.build``.
        border: periodic images, of ``border.build``.
        impulses: of ``dissipation.impulses`` where energies are added up; else none.
        spins: grains spin.
        energy: energies are added up.
    """
    g = grain.build(spins)
    vec3d = wp.vec3d
    History, AxesRotation, remembers = law.History, law.history.Rotation, law.history.at.width
    Memory, Impulses = wp.types.vector(max(remembers + impulses.width, 1), real), impulses.vector(real)
    losses = len(law.losses)
    Losses, Common = scalars((*LOSSES, *law.losses)).vector(wp.float64), scalars(LOSSES).vector(wp.float64)
    Parts = with_losses(PARTS_AT, law.losses).vector(real)

    @wp.func
    def history_of(memory: Memory) -> History:
        """Contact history of the law."""
        out = History()
        for f in range(wp.static(remembers)):
            out[f] = memory[f]
        return out

    @wp.func
    def impulses_of(memory: Memory) -> Impulses:
        """Impulses whose work is not known yet."""
        out = Impulses()
        for f in range(wp.static(impulses.width)):
            out[f] = memory[wp.static(remembers) + f]
        return out

    @wp.func
    def joined(history: History, kept: Impulses) -> Memory:
        out = Memory()
        for f in range(wp.static(remembers)):
            out[f] = history[f]
        for f in range(wp.static(impulses.width)):
            out[wp.static(remembers) + f] = kept[f]
        return out

    shared = {
        "Memory": Memory, "History": History, "Impulses": Impulses, "Losses": Losses, "history_of": history_of,
        "impulses_of": impulses_of, "joined": joined, "width": remembers + impulses.width, "impulses_at": remembers,
    }  # fmt: skip
    if not energy:
        return KernelSet(**shared, rotated=law.history.rotated)
    of_impulses = build_impulses(real, impulses, law.losses)

    @wp.func
    def rotated(memory: Memory, rate: AxesRotation) -> Memory:
        """The same in axes that turned by I + ``rate``."""
        return joined(
            law.history.rotated(history_of(memory), rate), of_impulses.rotated(impulses_of(memory), rate)
        )

    @wp.func
    def past_work(gi: g.Record, gj: g.Record, kept: Impulses, slip_time: wp.float64, dt: wp.float64) -> of_impulses.Work:
        """Work of the impulses of the force call ``slip_time`` ago [J], as of ``dissipation``.

        The velocities of then are those of now without half of the acceleration that was kicked with.
        """
        half = wp.float64(0.5) * dt
        velocity = g.velocity(gi) - g.velocity(gj)
        before = border.nearest(g.position(gi) - g.position(gj)) - velocity * slip_time
        distance = wp.sqrt(wp.dot(before, before))
        n = before * (wp.float64(1.0) / distance)
        depth = wp.float64(0.5) * (gi[3] + gj[3] - distance)
        velocity = velocity - (g.acceleration(gi) - g.acceleration(gj)) * half
        swept = vec3d()
        spin = vec3d()
        if wp.static(spins):
            wi = g.spin(gi) - g.angular_acceleration(gi) * half
            wj = g.spin(gj) - g.angular_acceleration(gj) * half
            swept = wi * (gi[3] - depth) + wj * (gj[3] - depth)
            spin = wi - wj
        return of_impulses.work(kept, n, velocity, swept, spin)

    at_liquid = len(LOSSES) + law.losses.index("liquid") if "liquid" in law.losses else 0

    @wp.func
    def of_impulses_only(spent: of_impulses.Work) -> Losses:
        """What is lost by impulses [J]."""
        out = Losses()
        for f in range(4):
            out[f] = spent[f]
        if wp.static(at_liquid > 0):
            out[wp.static(at_liquid)] = spent[wp.static(WORK_AT.drag)]
        return out

    @wp.func
    def losses_of(spent: of_impulses.Work, p: Parts) -> Losses:
        """What the contact loses [J]: ``spent`` by the impulses of the call before, and what this call says."""
        out = of_impulses_only(spent)
        at_once = Common(
            wp.float64(0.0), wp.float64(0.0), wp.float64(p[wp.static(PARTS_AT.cut_spring)]),
            wp.float64(p[wp.static(PARTS_AT.cut_angle)]),
            wp.float64(p[wp.static(PARTS_AT.springs_before)] - p[wp.static(PARTS_AT.springs_now)]),
        )  # fmt: skip
        for f in range(wp.static(len(LOSSES))):
            out[f] = out[f] + at_once[f]
        for f in range(wp.static(losses)):
            out[wp.static(len(LOSSES)) + f] = out[wp.static(len(LOSSES)) + f] + wp.float64(p[wp.static(PARTS_AT.width) + f])
        return out

    return KernelSet(
        **shared, rotated=rotated, past_work=past_work, losses_of=losses_of, of_impulses_only=of_impulses_only,
        impulses_after=of_impulses.kept, work=of_impulses.work,
    )
