r"""What is not elastic in a contact: the parts of its force and torque that take energy from the grains, and spring losses.

    normal damping       -gamma_n v_n n
    tangential damping   F_t + k_t s while the contact sticks
    sliding              F_t + k_t s while |k_t s + gamma_t v_t| > mu max(F_n, 0), and the slip c that the spring is cut by
    rolling              M - M_spring, and the angle that the rolling spring is cut by
    rescaling            what springs lose (or gain) as their stiffness changes with the overlap, at no slip

    cut        (1/2) k_t (s' + s) . c,           s' carried spring before the slip of the step, s after the cut     [J]
    rescaling  (1/2) k_t(d') s0^2 - (1/2) k_t(d) s'^2,  s0, d' of the step before; the same for the rolling spring  [J]

Both are exact where the force changes evenly over the step: that is how the work of a force is added up, too (trapezoid over
its path). A contact that ends gives up what is left in its springs as rescaling.

A rolling model is taken to be linear in its angle and to be elastic at rest: M_spring is its torque there. The stiffness of
``mindlin_displacement`` and of the rolling spring grows with the overlap at no cost: their rescaling may be negative.
"""

import functools

import warp as wp
from warpdem.kernels import rotation, tiny

PARTS = 12
"""Dashpot force along the normal (0) [N], tangential force without the spring's (1..3) [N], 1 while sliding (4), rolling torque
without the spring's (5..7) [N m]; lost by cutting the tangential (8) and the rolling spring (9) [J]; in both springs at the
step before (10) and now, before the slip of the step (11) [J]."""
ENTRY = 15
"""What each grain gets of a contact of grains: normal towards it (0..2), dashpot force (3), torque arm (4), tangential rest
(5..7), 1 while sliding (8), rolling torque (9..11), half of what is lost by cutting and rescaling springs (12..14)."""
UNLIMITED = 1.0e30  # [N m]: a Coulomb limit that no rolling spring reaches, and no overflow in single precision


@functools.cache
def build(real, normal, tangential, rolling, torsion: bool):
    """Return ``parts`` and ``stored`` of the contact law of the chosen model modules; arguments as in ``law.build``."""
    vec3 = wp.types.vector(3, real)
    Coefficients = wp.types.vector(7, real)
    Parts = wp.types.vector(PARTS, real)
    _, normal_force = normal.build(real)
    carried = rotation.build(real)
    kept = tangential.build(real) if tangential else None
    rolling_torque = rolling.build(real) if rolling else None
    rolls_with_history = bool(rolling) and rolling.HISTORY
    small = tiny(real)

    @wp.func
    def across(vector: vec3, normal: vec3) -> vec3:
        return vector - normal * wp.dot(vector, normal)

    @wp.func
    def spring_torque(angle: vec3, k_n: real, radius: real, inertia: real, c: Coefficients, dt: real) -> vec3:
        """Torque of the rolling spring alone [N m]."""
        torque = vec3()
        if wp.static(rolls_with_history):
            arm = c[5] * radius
            torque, _ = rolling_torque(
                vec3(), vec3(), angle, real(wp.static(UNLIMITED)), k_n * arm * arm, c[6], inertia, dt
            )
        return torque

    @wp.func
    def stored(
        overlap: real, stiffness: real, damping: real, radius: real, inertia: real, c: Coefficients, spring: vec3,
        angle: vec3, dt: real,
    ) -> real:  # fmt: skip
        """Energy in the tangential and the rolling spring [J]."""
        _, k_n, _ = normal_force(overlap, real(0.0), stiffness, damping)
        bent = wp.dot(spring_torque(angle, k_n, radius, inertia, c, dt), angle)
        return real(0.5) * (c[2] * k_n * wp.dot(spring, spring) - bent)

    @wp.func
    def parts(
        # as the law got them
        n: vec3, n_before: vec3, overlap: real, overlap_before: real, velocity: vec3, slip: vec3, turning: vec3,
        spin: vec3, dt: real, stiffness: real, damping: real, radius: real, inertia: real, c: Coefficients,
        spring: vec3, angle: vec3,
        # as the law returned them
        force: vec3, moment: vec3, held: vec3, bent: vec3,
    ) -> Parts:  # fmt: skip
        """What is not elastic in a contact: the numbers of PARTS."""
        speed = wp.dot(velocity, n)
        f_n, k_n, gamma_n = normal_force(overlap, speed, stiffness, damping)
        push = f_n if f_n > real(0.0) else real(0.0)
        rest = vec3()
        slides = real(0.0)
        rough = vec3()
        cut_spring = real(0.0)
        cut_bend = real(0.0)
        now = real(0.0)
        if wp.static(tangential is not None):
            both = n + n_before
            mid_share = wp.dot(slip, both) / (real(2.0) + real(2.0) * wp.dot(n, n_before))
            step = across(slip - both * mid_share, n)
            brought = carried(spring, n, n_before, turning) * kept(overlap, overlap_before)
            k_t = c[2] * k_n
            cut_spring = real(0.5) * k_t * wp.dot(brought + held, brought + step - held)
            trial = held * (-k_t) - (velocity - n * speed) * (c[3] * gamma_n)
            limit = c[4] * push
            slides = real(1.0) if wp.dot(trial, trial) > limit * limit + real(wp.static(small)) else real(0.0)
            rest = force - n * f_n + held * k_t
            now += real(0.5) * k_t * wp.dot(brought, brought)
        if wp.static(rolling is not None):
            rough = moment
            if wp.static(rolls_with_history):
                roll = spin
                if wp.static(not torsion):
                    roll = across(spin, n)
                swung = carried(angle, n, n_before, turning)
                before = spring_torque(swung, k_n, radius, inertia, c, dt)
                after = spring_torque(bent, k_n, radius, inertia, c, dt)
                rough = moment - after
                cut_bend = -real(0.5) * wp.dot(before + after, swung + roll * dt - bent)
                now -= real(0.5) * wp.dot(before, swung)
        old = stored(overlap_before, stiffness, damping, radius, inertia, c, spring, angle, dt)
        return Parts(
            -gamma_n * speed, rest[0], rest[1], rest[2], slides, rough[0], rough[1], rough[2], cut_spring, cut_bend, old, now
        )

    return parts, stored
