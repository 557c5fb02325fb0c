r"""What is not elastic in a contact: the parts of its force and torque that take energy from the grains, and spring losses.

    normal damping       -gamma_n v_n n, as it acts at the step (``normal_law``)
    tangential damping   F_t + k_t s while the contact sticks
    sliding              F_t + k_t s while |k_t s + gamma_t v_t| > mu L (L the Coulomb load), and the slip c that the spring is
                         cut by
    losses               what the normal law itself loses, by its LOSSES: adhesion, plasticity, liquid
    drag                 the force of a viscous bridge, along the normal and across: its power is lost to liquid
    rolling              M - M_spring, and the angle that the rolling spring is cut by; with a twisting law also its torque
                         without its spring's, and the twist that is cut
    rescaling            what springs lose (or gain) as their stiffness changes with the overlap, while they slip

    cut        (1/2) k_t (s' + s) . c,           s' spring carried to now, before the slip of the step; s after the cut [J]
    rescaling  (1/2) k_t(d') s0^2 - (1/2) k_t(d) s'^2 + (1/2) (k_t(d') s0 - k_t(d) s') . slip,     s0, d' of the step before;
               the same for the rolling and the twisting spring  [J]

Both are exact where the force changes evenly over the step: that is how the work of a force is added up, too (trapezoid over
its path: (1/2) (k_t(d') s0 + k_t(d) s) . slip). The slip works against springs that give way within the step: without its part
of the rescaling the budget would close by first order in the step only. A contact that ends gives up what is left in its
springs as rescaling.

A rolling model is taken to be linear in its angle and to be elastic at rest: M_spring is its torque there. The stiffness of
``mindlin_displacement`` and of the rolling spring grows with the overlap at no cost: their rescaling may be negative.
"""

import functools

import warp as wp
from warpdem.kernels import KernelSet, rotation, tiny
from warpdem.kernels.contact import columns, history, normal_law
from warpdem.kernels.contact.columns import Columns, scalars

PARTS_AT = Columns(
    (
        ("damping", 1),  # dashpot force along the normal [N]
        ("tangential", 3),  # tangential force without the spring's [N]
        ("slides", 1),  # 1 while sliding
        ("rolling", 3),  # rolling torque without the spring's [N m]
        ("cut_spring", 1),  # lost by cutting the tangential spring [J]
        ("cut_angle", 1),  # and the rolling spring [J]
        ("springs_before", 1),  # in both springs at the step before [J]
        ("springs_now", 1),  # and now, carried: before the slip of the step, less what rescaling takes of its work [J]
    )
)
"""What is not elastic in a contact; the LOSSES of its normal law follow [J] (``with_losses``)."""
LOSSES = ("normal_damping", "tangential_damping", "sliding", "rolling", "rescaling")
"""What contacts lose under any law [J]; the LOSSES of the normal law are lost too."""
WORK_AT = scalars(("normal_damping", "sticking", "sliding", "rolling", "drag"))
"""What the ``impulses`` of a contact take from its grains [J]."""
UNLIMITED = 1.0e30  # [N m]: a Coulomb limit that no rolling spring reaches, and no overflow in single precision


def with_losses(at: Columns, losses: tuple[str, ...]) -> Columns:
    """The columns ``at``, followed by one for each of the LOSSES of a normal law [J]; where liquid is one, by its drag [N]."""
    return at.and_(scalars(f"lost_{name}" for name in losses)).and_(Columns((("drag", 3),) if "liquid" in losses else ()))


def impulses(normal, tangential, rolling, twisting=None) -> Columns:
    """What a contact of grains keeps from one force call to the next while energies are added up, beside its history.

    Its nonelastic force and torque times the kick of the call, for the work that they do is known when the kick has been made
    (``work``): impulses [N s] and angular impulse [N m s]; ``sliding``: 1 while it slides, or 0.
    """
    at = Columns((("damping", 1),))
    if tangential is not None:
        at = at.and_(Columns((("tangential", 3), ("sliding", 1))))
    if rolling is not None or twisting is not None:
        at = at.and_(Columns((("rolling", 3),)))
    return at.and_(Columns((("drag", 3),))) if "liquid" in columns.losses(normal) else at


@functools.cache
def build(real, normal, tangential, rolling, torsion: bool, predicted: bool = True, twisting=None):
    """Return ``parts`` and ``stored`` of the contact law of the chosen model modules; arguments as in ``law.build``."""
    vec3 = wp.types.vector(3, real)
    of_normal = normal_law.build(real, normal, predicted)
    past = history.build(real, columns.history(normal, tangential, rolling, twisting), columns.own_history(normal))
    Coefficients, Constants, History = of_normal.Coefficients, of_normal.Constants, past.History
    at = of_normal.at
    losses = len(of_normal.losses)
    at_parts = with_losses(PARTS_AT, of_normal.losses)
    Common, Parts = PARTS_AT.vector(real), at_parts.vector(real)
    at_drag = at_parts.drag if "drag" in at_parts else 0
    transported = rotation.build(real)
    retained = tangential.build(real) if tangential else None
    rolling_torque = rolling.build(real) if rolling else None
    twisting_torque = twisting.build(real) if twisting else None
    viscous = getattr(normal, "VISCOUS", False)
    rolls_with_history = bool(rolling) and bool(rolling.HISTORY)
    small = tiny(real)

    @wp.func
    def across(vector: vec3, normal: vec3) -> vec3:
        return vector - normal * wp.dot(vector, normal)

    @wp.func
    def spring_torque(angle: vec3, k_n: real, radius: real, inertia: real, c: Coefficients, dt: real) -> vec3:
        """Torque of the rolling spring alone [N m]."""
        torque = vec3()
        if wp.static(rolls_with_history):
            arm = c[wp.static(at.rolling_friction)] * radius
            torque, _ = rolling_torque(
                vec3(), vec3(), angle, real(wp.static(UNLIMITED)), k_n * arm * arm, c[wp.static(at.rolling_damping)], inertia,
                dt,
            )  # fmt: skip
        return torque

    @wp.func
    def twist_spring(twist: real, depth: real, k_n: real, radius: real, c: Coefficients) -> real:
        """Torque of the twisting spring alone [N m]."""
        torque = real(0.0)
        if wp.static(twisting is not None):
            area = radius * depth
            torque, _ = twisting_torque(
                twist, real(0.0), wp.sqrt(area if area > real(0.0) else real(0.0)), c[wp.static(at.shear)] * k_n, real(0.0),
                real(wp.static(UNLIMITED)),
            )  # fmt: skip
        return torque

    @wp.func
    def stored(
        overlap: real, k: Constants, radius: real, inertia: real, c: Coefficients, before: History, dt: real
    ) -> real:
        """Energy in the tangential, the rolling and the twisting spring [J]."""
        k_n, depth = of_normal.elastic(overlap, k, past.own(before))
        spring = past.spring(before)
        angle = past.angle(before)
        bent = wp.dot(spring_torque(angle, k_n, radius, inertia, c, dt), angle)
        if wp.static(twisting is not None):
            twist = past.twist(before)
            bent += twist * twist_spring(twist, depth, k_n, radius, c)
        return real(0.5) * (c[wp.static(at.shear)] * k_n * wp.dot(spring, spring) - bent)

    @wp.func
    def parts(
        # as the law got them
        n: vec3, n_before: vec3, overlap: real, overlap_before: real, velocity: vec3, slip: vec3, mean_rotation: vec3,
        spin: vec3, dt: real, k: Constants, radius: real, inertia: real, c: Coefficients, before: History,
        # as the law returned them
        force: vec3, moment: vec3, now: History,
    ) -> Parts:  # fmt: skip
        """What is not elastic in a contact: the numbers of PARTS_AT, then the law's LOSSES."""
        speed = wp.dot(velocity, n)
        f_n, load, dashpot, k_n, gamma_t, depth, depth_before, _own, squeezed, c_t = of_normal.force(
            overlap, overlap_before, speed, k, c, past.own(before), dt
        )
        limited_spring = past.spring(now)
        rest = vec3()
        slides = real(0.0)
        nonelastic = vec3()
        cut_spring = real(0.0)
        cut_angle = real(0.0)
        in_springs = real(0.0)
        k_n_before, depth_then = of_normal.elastic(overlap_before, k, past.own(before))
        if wp.static(tangential is not None):
            both = n + n_before
            mid = wp.dot(slip, both) / (real(2.0) + real(2.0) * wp.dot(n, n_before))
            step = across(slip - both * mid, n)
            spring_before = transported(past.spring(before), n, n_before, mean_rotation)
            brought = spring_before * retained(depth, depth_before)
            k_t = c[wp.static(at.shear)] * k_n
            cut_spring = real(0.5) * k_t * wp.dot(brought + limited_spring, brought + step - limited_spring)
            trial = limited_spring * (-k_t) - (velocity - n * speed) * gamma_t
            limit = c[wp.static(at.friction)] * load
            slides = real(1.0) if wp.dot(trial, trial) > limit * limit + real(wp.static(small)) else real(0.0)
            rest = force - n * f_n + limited_spring * k_t
            if wp.static(viscous):
                rest = rest + (velocity - n * speed) * c_t
            in_springs += real(0.5) * k_t * wp.dot(brought, brought)
            relaxed = spring_before * (c[wp.static(at.shear)] * k_n_before) - brought * k_t
            in_springs -= real(0.5) * wp.dot(relaxed, step)
        if wp.static(rolling is not None):
            nonelastic = moment
            if wp.static(rolls_with_history):
                roll = spin
                if wp.static(not torsion):
                    roll = across(spin, n)
                angle = past.angle(now)
                transported_angle = transported(past.angle(before), n, n_before, mean_rotation)
                torque_before = spring_torque(transported_angle, k_n, radius, inertia, c, dt)
                torque_after = spring_torque(angle, k_n, radius, inertia, c, dt)
                nonelastic = moment - torque_after
                cut_angle = -real(0.5) * wp.dot(torque_before + torque_after, transported_angle + roll * dt - angle)
                in_springs -= real(0.5) * wp.dot(torque_before, transported_angle)
                torque_then = spring_torque(transported_angle, k_n_before, radius, inertia, c, dt)
                in_springs -= real(0.5) * dt * wp.dot(torque_before - torque_then, roll)
        if wp.static(twisting is not None):
            if wp.static(rolling is None):
                nonelastic = moment
            twist = past.twist(now)
            kept = retained(depth, depth_before)
            brought_twist = past.twist(before) * (kept * kept * kept)
            about_before = twist_spring(brought_twist, depth, k_n, radius, c)
            about_after = twist_spring(twist, depth, k_n, radius, c)
            nonelastic = nonelastic - n * about_after
            cut = brought_twist + wp.dot(spin, n) * dt - twist
            cut_angle -= real(0.5) * (about_before + about_after) * cut
            in_springs -= real(0.5) * about_before * brought_twist
            about_then = twist_spring(past.twist(before), depth_then, k_n_before, radius, c)
            in_springs -= real(0.5) * dt * (about_before - about_then) * wp.dot(spin, n)
        old = stored(overlap_before, k, radius, inertia, c, before, dt)
        common = Common(
            dashpot, rest[0], rest[1], rest[2], slides, nonelastic[0], nonelastic[1], nonelastic[2], cut_spring,
            cut_angle, old, in_springs,
        )  # fmt: skip
        out = Parts()
        for f in range(wp.static(PARTS_AT.width)):
            out[f] = common[f]
        if wp.static(losses > 0):
            lost = of_normal.lost(overlap, overlap_before, k, past.own(before), past.own(now))
            for f in range(wp.static(losses)):
                out[wp.static(PARTS_AT.width) + f] = lost[f]
        if wp.static(viscous):
            drag = n * squeezed - (velocity - n * speed) * c_t
            for f in range(3):
                out[wp.static(at_drag) + f] = drag[f]
        return out

    return parts, stored


@functools.cache
def build_impulses(real, at: Columns, losses: tuple[str, ...]):
    """Return the type of ``impulses`` and the functions that make them, turn them, and give the energy that they take.

    Args:
        real: precision.
        at: of ``impulses``.
        losses: LOSSES of the normal law.
    """
    vec3 = wp.types.vector(3, real)
    Impulses, at_parts = at.vector(real), with_losses(PARTS_AT, losses)
    Rotation, Parts, Work = wp.types.matrix((3, 3), real), at_parts.vector(real), WORK_AT.vector(wp.float64)
    has_tangential, slides, has_rolling, drags = "tangential" in at, "sliding" in at, "rolling" in at, "drag" in at
    drag_at, drag_of = (at.drag, at_parts.drag) if drags else (0, 0)
    tangential_at, sliding_at = at.tangential if has_tangential else 0, at.sliding if slides else 0
    rolling_at = at.rolling if has_rolling else 0

    @wp.func
    def kept(p: Parts, kick: real) -> Impulses:
        """Impulses of a contact whose parts are ``p``, which act for ``kick`` [s]."""
        out = Impulses()
        out[wp.static(at.damping)] = p[wp.static(PARTS_AT.damping)] * kick
        if wp.static(has_tangential):
            for f in range(3):
                out[wp.static(tangential_at) + f] = p[wp.static(PARTS_AT.tangential) + f] * kick
        if wp.static(slides):
            out[wp.static(sliding_at)] = p[wp.static(PARTS_AT.slides)]
        if wp.static(has_rolling):
            for f in range(3):
                out[wp.static(rolling_at) + f] = p[wp.static(PARTS_AT.rolling) + f] * kick
        if wp.static(drags):
            for f in range(3):
                out[wp.static(drag_at) + f] = p[wp.static(drag_of) + f] * kick
        return out

    @wp.func
    def tangential(x: Impulses) -> vec3:
        out = vec3()
        if wp.static(has_tangential):
            out = vec3(x[wp.static(tangential_at)], x[wp.static(tangential_at + 1)], x[wp.static(tangential_at + 2)])
        return out

    @wp.func
    def rolling(x: Impulses) -> vec3:
        out = vec3()
        if wp.static(has_rolling):
            out = vec3(x[wp.static(rolling_at)], x[wp.static(rolling_at + 1)], x[wp.static(rolling_at + 2)])
        return out

    @wp.func
    def drag(x: Impulses) -> vec3:
        out = vec3()
        if wp.static(drags):
            out = vec3(x[wp.static(drag_at)], x[wp.static(drag_at + 1)], x[wp.static(drag_at + 2)])
        return out

    @wp.func
    def rotated(x: Impulses, rate: Rotation) -> Impulses:
        """The same in axes that turned by I + ``rate``."""
        out = x
        if wp.static(has_tangential):
            t = tangential(x)
            t = t + rate * t
            for f in range(3):
                out[wp.static(tangential_at) + f] = t[f]
        if wp.static(has_rolling):
            m = rolling(x)
            m = m + rate * m
            for f in range(3):
                out[wp.static(rolling_at) + f] = m[f]
        if wp.static(drags):
            d = drag(x)
            d = d + rate * d
            for f in range(3):
                out[wp.static(drag_at) + f] = d[f]
        return out

    @wp.func
    def as_double(v: vec3) -> wp.vec3d:
        return wp.vec3d(wp.float64(v[0]), wp.float64(v[1]), wp.float64(v[2]))

    @wp.func
    def work(
        x: Impulses,
        n: wp.vec3d,  # normal of their force call
        velocity: wp.vec3d,  # of the centre of i relative to j, as the kick leaves it in the mean [m/s]
        swept: wp.vec3d,  # W_i arm_i + W_j arm_j: spins times torque arms [m/s]
        spin: wp.vec3d,  # W_i - W_j [rad/s]
    ) -> Work:
        """Energy that the impulses take from the two grains [J], the numbers of WORK_AT."""
        along = wp.float64(x[wp.static(at.damping)]) * wp.dot(n, velocity)
        across = wp.float64(0.0)
        share = wp.float64(0.0)
        rolled = wp.float64(0.0)
        dragged = wp.float64(0.0)
        if wp.static(has_tangential):
            across = wp.dot(as_double(tangential(x)), velocity - wp.cross(swept, n))
        if wp.static(slides):
            share = wp.float64(x[wp.static(sliding_at)])
        if wp.static(has_rolling):
            rolled = wp.dot(as_double(rolling(x)), spin)
        if wp.static(drags):
            dragged = wp.dot(as_double(drag(x)), velocity - wp.cross(swept, n))
        return Work(-along, -((wp.float64(1.0) - share) * across), -(share * across), -rolled, -dragged)

    return KernelSet(Impulses=Impulses, Work=Work, at=at, kept=kept, rotated=rotated, work=work)
