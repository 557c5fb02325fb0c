"""One form for all normal laws, whatever their files declare (``columns``).

A law that declares neither COEFFICIENTS nor HISTORY is a function of the overlap alone:

    constants(base, damping, radius, mass) -> stiffness, damping
    force(overlap, speed, stiffness, damping) -> F_n, k_n, gamma_n

Its Coulomb load is max(F_n, 0). Any other gets and gives its own numbers too:

    constants(base, damping, own, radius, mass) -> stiffness, damping, own
    force(overlap, overlap_before, speed, stiffness, damping, own, history)
        -> F_n, load, k_n, gamma_n, depth, depth_before, history

A law that says ``CLOSENESS = True`` gets one more argument in ``constants``, the last:

closeness     1/(R_i + R_j), 0 at a wall: what R* does not tell of two radii                    [1/m]

load          normal force that friction and rolling resistance go by, >= 0                     [N]
depth         overlap that the tangential spring is rescaled by, now and one step before        [m]

A law with LOSSES has a third function, called only where energies are added up, which gives them in their order:

    lost(overlap, overlap_before, stiffness, damping, own, history_before, history) -> losses of the step [J]

It tells what the energy of the law (its ``energy``) falls by without work on the grains: as a contact begins with energy in
it, yields, or ends. A force that jumps acts for a part of its first or last step only: see ``jumps``.

**Dashpots.** The default scheme knows the velocity only as predicted by the last acceleration, v* = v - (dt^2/2) a'. For an
oscillator of stiffness k that is v (1 + k dt^2/(2 m)), so a plain dashpot takes too much. The damping coefficients are
therefore

    along the normal   gamma_n / max(1 + r k_n dt^2/(2 m*), gamma_n dt/(0.3 m*))
    across it          gamma_t / max(1 + k_t dt^2/(2 m_t),  gamma_t dt/(0.25 m_t)),       m_t = (2/7) m*, of rolling spheres

with r k_n the slope of the normal force. The first of the two takes the error of order dt^2 away: where it acts alone, the
restitution is right in the mean at any step. The second keeps damping from deciding about stability. From e = 0.3 on it hardly
acts at 12 and more steps per contact along the normal, nor at 15 across it. Below, the mean is off by it: little with
``hertz`` (0.1023 for 0.1 at 12 steps), far with the strong dashpot of ``hertz_clamped`` (its docstring has numbers). Both only
reduce a dashpot, so that friction still creates no energy. Schemes that do not predict (``predicted`` false) have the plain
coefficients.

A law states the ratio r of the slope of its elastic force to k_n as ``TANGENT``, its power of the overlap; without it, 1. It is
asked for k_n and gamma_n at rest, then for the force at the speed that makes its dashpot the above: whatever its form. k_n
and gamma_n must not depend on the speed.

A law whose contacts never attract says ``CLAMPED = True``: its dashpot then acts only as far as the force stays >= 0.
"""

import functools
from types import ModuleType

import warp as wp
from warpdem.kernels import KernelSet
from warpdem.kernels.contact import columns, liquid

NORMAL_CAP, TANGENTIAL_CAP = 0.3, 0.25  # damping coefficient times the time step over m* and over m_t [-]
ROLLING_MASS = 2.0 / 7.0  # mass that moves across a contact of spheres that are free to rotate, over m* [-]


@functools.cache
def build(real, normal: ModuleType, predicted: bool = True):
    """Return the types of a normal law's numbers, ``constants``, ``force``, ``elastic`` and ``lost``, the same for all laws.

    Args:
        real: precision.
        normal: module of the law.
        predicted: the velocities that dashpots see are predicted by the last acceleration.
    """
    viscous = getattr(normal, "VISCOUS", False)
    dry, wet = getattr(normal, "DRY", normal), hasattr(normal, "LIQUID")
    bridges = liquid.build(real, normal.LIQUID, normal.VISCOUS) if wet else None
    at, own, dry_own = columns.coefficients(normal), columns.own_coefficients(normal), columns.own_coefficients(dry)
    of = columns.constants(normal)
    Coefficients, Constants, Own = at.vector(real), of.vector(real), dry_own.vector(real)
    History, DryHistory = (columns.own_history(law).vector(real) for law in (normal, dry))
    constants_of_law, force_of_law, *lost_of_law = dry.build(real)
    losses = columns.scalars(columns.losses(normal))
    Losses = losses.vector(real)
    first = len(columns.OF_CONTACT)
    wet_first, dry_kept = first + dry_own.width, columns.own_history(dry).width
    half_tangent = 0.5 * getattr(normal, "TANGENT", 1.0)
    clamped, needs_closeness = getattr(normal, "CLAMPED", False), getattr(normal, "CLOSENESS", False)

    Wet = WetOwn = wet_part = wet_own = with_bridge = None

    if not wet:

        @wp.func
        def dry_part(history: History) -> DryHistory:
            return history

    else:
        Wet, WetOwn = bridges.History, bridges.Own

        @wp.func
        def dry_part(history: History) -> DryHistory:
            """What the normal law itself remembers."""
            out = DryHistory()
            for f in range(wp.static(dry_kept)):
                out[f] = history[f]
            return out

        @wp.func
        def wet_part(history: History) -> Wet:
            """What is remembered of the bridge."""
            out = Wet()
            for f in range(wp.static(len(Wet()))):
                out[f] = history[wp.static(dry_kept) + f]
            return out

        @wp.func
        def wet_own(k: Constants) -> WetOwn:
            """Own numbers of the bridge."""
            out = WetOwn()
            for f in range(wp.static(len(WetOwn()))):
                out[f] = k[wp.static(wet_first) + f]
            return out

        @wp.func
        def with_bridge(of_law: DryHistory, of_bridge: Wet) -> History:
            out = History()
            for f in range(wp.static(dry_kept)):
                out[f] = of_law[f]
            for f in range(wp.static(len(Wet()))):
                out[wp.static(dry_kept) + f] = of_bridge[f]
            return out

    if not columns.declares_own(dry):

        @wp.func
        def made_of(c: Coefficients, radius: real, mass: real, closeness: real):
            """Stiffness and damping of a contact from R* [m] and m* [kg]."""
            stiffness, damping = constants_of_law(
                c[wp.static(at.stiffness)], c[wp.static(at.damping)], radius, mass
            )  # fmt: skip
            return stiffness, damping, Own()

        @wp.func
        def of_speed(overlap: real, overlap_before: real, speed: real, k: Constants, history: DryHistory):
            """F_n, load [N], k_n [N/m], gamma_n [N s/m], depth now and before [m], history."""
            f_n, k_n, gamma_n = force_of_law(overlap, speed, k[wp.static(of.stiffness)], k[wp.static(of.damping)])
            load = f_n if f_n > real(0.0) else real(0.0)
            return f_n, load, k_n, gamma_n, overlap, overlap_before, history

    else:
        if needs_closeness:
            made_by_law = constants_of_law
        else:

            @wp.func
            def made_by_law(base: real, damping: real, given: Own, radius: real, mass: real, closeness: real):
                stiffness, dashpot, made = constants_of_law(base, damping, given, radius, mass)
                return stiffness, dashpot, made

        @wp.func
        def made_of(c: Coefficients, radius: real, mass: real, closeness: real):
            """Stiffness, damping and the law's own constants of a contact from R* [m], m* [kg] and 1/(R_i + R_j) [1/m]."""
            given = Own()
            for f in range(wp.static(dry_own.width)):
                given[f] = c[wp.static(at.width - own.width) + f]
            stiffness, damping, made = made_by_law(
                c[wp.static(at.stiffness)], c[wp.static(at.damping)], given, radius, mass, closeness
            )  # fmt: skip
            return stiffness, damping, made

        @wp.func
        def of_speed(overlap: real, overlap_before: real, speed: real, k: Constants, history: DryHistory):
            """F_n, load [N], k_n [N/m], gamma_n [N s/m], depth now and before [m], history."""
            own_constants = Own()
            for f in range(wp.static(dry_own.width)):
                own_constants[f] = k[wp.static(first) + f]
            f_n, load, k_n, gamma_n, depth, depth_before, now = force_of_law(
                overlap, overlap_before, speed, k[wp.static(of.stiffness)], k[wp.static(of.damping)], own_constants, history
            )  # fmt: skip
            return f_n, load, k_n, gamma_n, depth, depth_before, now

    @wp.func
    def constants(c: Coefficients, radius: real, mass: real, closeness: real) -> Constants:
        """Constants of a contact from R* [m], m* [kg], 1/(R_i + R_j) [1/m]: of every law, the law's own, the bridge's."""
        stiffness, damping, made = made_of(c, radius, mass, closeness)
        k = Constants()
        k[wp.static(of.stiffness)] = stiffness
        k[wp.static(of.damping)] = damping
        k[wp.static(of.inverse_mass)] = real(1.0) / mass
        for f in range(wp.static(dry_own.width)):
            k[wp.static(first) + f] = made[f]
        if wp.static(wet):
            given = WetOwn()
            for f in range(wp.static(own.width - dry_own.width)):
                given[f] = c[wp.static(at.width - own.width + dry_own.width) + f]
            of_bridge = bridges.constants(given, radius)
            for f in range(wp.static(own.width - dry_own.width)):
                k[wp.static(wet_first) + f] = of_bridge[f]
        return k

    @wp.func
    def force(
        overlap: real, overlap_before: real, speed: real, k: Constants, c: Coefficients, history: History, dt: real
    ):
        """F_n, load, the dashpot's part of F_n [N], k_n [N/m], gamma_t [N s/m], depth now and before [m], history, drag, c_t.

        The last two are of a viscous bridge: its part of F_n [N], and its dashpot across, not limited by friction [N s/m].
        """
        before = dry_part(history)
        c_n = real(0.0)
        c_t = real(0.0)
        if wp.static(wet):
            c_n, c_t = bridges.drag(overlap, wet_own(k), wet_part(history))
        share_n = real(1.0)
        share_t = real(1.0)
        if wp.static(predicted):
            _f, _l, k_n, gamma_n, _d, _b, _h = of_speed(overlap, overlap_before, real(0.0), k, before)
            lag = dt * k[wp.static(of.inverse_mass)]
            swing = k_n * dt * lag
            pull = gamma_n * lag
            along = real(wp.static(half_tangent)) * swing + real(1.0)
            across = real(wp.static(0.5 / ROLLING_MASS)) * c[wp.static(at.shear)] * swing + real(1.0)
            cap_n = real(wp.static(1.0 / NORMAL_CAP)) * pull
            cap_t = real(wp.static(1.0 / (TANGENTIAL_CAP * ROLLING_MASS))) * c[wp.static(at.shear_damping)] * pull
            if wp.static(viscous):
                cap_n = cap_n + real(wp.static(1.0 / NORMAL_CAP)) * c_n * lag
                cap_t = cap_t + real(wp.static(1.0 / (TANGENTIAL_CAP * ROLLING_MASS))) * c_t * lag
            along = along if along > cap_n else cap_n
            across = across if across > cap_t else cap_t
            both = real(1.0) / (along * across)
            share_n = across * both
            share_t = along * both
        f_n, load, k_n, gamma_n, depth, depth_before, now = of_speed(
            overlap, overlap_before, speed * share_n, k, before
        )
        gamma_t = c[wp.static(at.shear_damping)] * gamma_n * share_t
        dashpot = -(gamma_n * share_n) * speed
        if wp.static(clamped):
            pushing = f_n if f_n > real(0.0) else real(0.0)
            dashpot = dashpot + (pushing - f_n)
            f_n = pushing
        kept = History()
        if wp.static(not wet):
            kept = now
        else:
            pull_of_bridge, of_bridge = bridges.force(overlap, overlap_before, wet_own(k), wet_part(history))
            f_n = f_n - pull_of_bridge
            kept = with_bridge(now, of_bridge)
        squeezed = real(0.0)
        if wp.static(viscous):
            squeezed = -(c_n * share_n) * speed
            f_n = f_n + squeezed
            c_t = c_t * share_t
        return f_n, load, dashpot, k_n, gamma_t, depth, depth_before, kept, squeezed, c_t

    if not losses.width:

        @wp.func
        def lost(overlap: real, overlap_before: real, k: Constants, before: History, now: History) -> Losses:
            """A law without LOSSES loses nothing beside its dashpot."""
            return Losses()

    else:
        of_dry = columns.losses(dry)
        lost_of_law = lost_of_law[0] if of_dry else None
        at_liquid = losses.liquid if "liquid" in losses else 0

        @wp.func
        def lost(overlap: real, overlap_before: real, k: Constants, before: History, now: History) -> Losses:
            """LOSSES of the step [J]."""
            out = Losses()
            if wp.static(lost_of_law is not None):
                own_constants = Own()
                for f in range(wp.static(dry_own.width)):
                    own_constants[f] = k[wp.static(first) + f]
                of_law = lost_of_law(
                    overlap, overlap_before, k[wp.static(of.stiffness)], k[wp.static(of.damping)], own_constants,
                    dry_part(before), dry_part(now),
                )  # fmt: skip
                for f in range(wp.static(len(of_dry))):
                    out[f] = of_law[f]  # its losses come first
            if wp.static(wet):
                out[wp.static(at_liquid)] = out[wp.static(at_liquid)] + bridges.lost(overlap, wet_own(k), wet_part(before))
            return out

    @wp.func
    def elastic(overlap: real, k: Constants, history: History):
        """k_n [N/m] and depth [m]."""
        _f, _l, k_n, _g, depth, _b, _h = of_speed(overlap, overlap, real(0.0), k, dry_part(history))
        return k_n, depth

    return KernelSet(
        Coefficients=Coefficients, Constants=Constants, Own=Own, History=History, at=at, constants=constants, force=force,
        elastic=elastic, lost=lost, losses=losses.names,
    )  # fmt: skip
