"""The contact law of a scene: normal, tangential and rolling model joined, the same for pairs of grains and for walls.

Signs: a pair quantity is *i minus j*; the normal points *from j to i* (from the wall to the grain), so a positive normal
force pushes i along it. Force and torque returned act on i.

    F = F_n n + F_t,     F_t = -k_t s - gamma_t v_t,     |F_t| <= mu L

The damping coefficients are those that act at the step (``normal_law``). L [N] is the Coulomb load: max(F_n, 0), or what the
normal law says. The spring s [m] follows the slip of the mid-step
velocity, taken across the mid-step normal: taken across the end normal, the mean normal velocity leaks into it and holds
small grains between large ones (Vyas et al. 2025). It is first cut so that the spring alone stays within the Coulomb limit,
then spring and dashpot together are projected on that limit. Both are projections on a ball that contains the spring force,
so friction never creates energy: (F_t - F_spring) . v_t <= 0.
"""

import functools

import warp as wp
from warpdem.kernels import KernelSet, rotation, tiny
from warpdem.kernels.contact import columns, history, liquid, normal_law


@functools.cache
def build(real, normal, tangential, rolling, torsion: bool, wall: bool = False, predicted: bool = True, twisting=None):
    """Return ``force``, ``constants`` and the types of the chosen model modules.

    ``tangential``, ``rolling`` and ``twisting`` may be None, the last without the first; ``wall``: j is one; ``predicted``: as
    of ``normal_law.build``. ``force`` has the same arguments and results whichever models are left out, so the loops over
    contacts need no special cases.

    Arguments stand one by one, not in structs: in lanes each of them is a register, and what translates to lanes
    (``simd.translate``) takes numbers, vectors and matrices. The same holds for ``dissipation.parts``.
    """
    vec3 = wp.types.vector(3, real)
    of_normal = normal_law.build(real, normal, predicted)
    past = history.build(real, columns.history(normal, tangential, rolling, twisting), columns.own_history(normal))
    Coefficients, Constants, History = of_normal.Coefficients, of_normal.Constants, past.History
    at = of_normal.at
    transported = rotation.build(real)
    retained = tangential.build(real) if tangential else None
    rolling_torque = rolling.build(real) if rolling else None
    twisting_torque = twisting.build(real) if twisting else None
    small = tiny(real)
    viscous = getattr(normal, "VISCOUS", False)
    rolls_with_history = bool(rolling) and bool(rolling.HISTORY)

    @wp.func
    def friction(
        spring: vec3, velocity: vec3, stiffness: real, damping: real, limit: real
    ):
        """Tangential force [N] within the Coulomb limit, and the spring [m] cut to it."""
        least = real(wp.static(small))
        ratio = limit / (stiffness * wp.sqrt(wp.dot(spring, spring) + least) + least)
        limited_spring = spring * (ratio if ratio < real(1.0) else real(1.0))
        trial = limited_spring * (-stiffness) - velocity * damping
        cap = limit / wp.sqrt(wp.dot(trial, trial) + least)
        return trial * (cap if cap < real(1.0) else real(1.0)), limited_spring

    @wp.func
    def across(vector: vec3, normal: vec3) -> vec3:
        return vector - normal * wp.dot(vector, normal)

    @wp.func
    def force(
        # geometry now and one step before
        n: vec3,
        n_before: vec3,
        overlap: real,
        overlap_before: real,
        # motion of i relative to j at the contact
        velocity: vec3,  # at the time of the force (predicted) [m/s]
        slip: vec3,  # displacement over the last step [m]
        mean_rotation: vec3,  # mean rotation of the two bodies over the last step [rad]
        spin: vec3,  # relative spin, mid-step [rad/s]
        spin_predicted: vec3,
        dt: real,
        # constants of this contact
        k: Constants,
        radius: real,  # R* [m]
        inertia: real,  # of the rolling model [kg m2]; 0 without one
        c: Coefficients,
        # contact history of the step before
        before: History,
    ):
        """Force on i [N], rolling torque on i [N m] and the contact history after this step."""
        speed = wp.dot(velocity, n)
        f_n, load, _dashpot, k_n, gamma_t, depth, depth_before, own, _squeezed, c_t = of_normal.force(
            overlap, overlap_before, speed, k, c, past.own(before), dt
        )
        total = n * f_n
        dragged = vec3()
        if wp.static(viscous):
            dragged = (velocity - n * speed) * c_t  # by the liquid
            total = total - dragged
        spring = vec3()
        torque = vec3()
        angle = vec3()
        if wp.static(tangential is not None):
            both = n + n_before
            mid = wp.dot(slip, both) / (real(2.0) + real(2.0) * wp.dot(n, n_before))
            step = across(slip - both * mid, n)
            trial_spring = transported(past.spring(before), n, n_before, mean_rotation) * retained(depth, depth_before) + step
            f_t, limited_spring = friction(
                trial_spring, velocity - n * speed, c[wp.static(at.shear)] * k_n, gamma_t, c[wp.static(at.friction)] * load
            )
            spring = limited_spring
            total = n * f_n + f_t
            if wp.static(viscous):
                total = total - dragged
        if wp.static(rolling is not None):
            roll = spin
            roll_predicted = spin_predicted
            if wp.static(not torsion):
                roll = across(spin, n)
                roll_predicted = across(spin_predicted, n)
            if wp.static(wall and not rolls_with_history):
                # rolling resistance stops the spin that the grain has after the friction of this step; if it stopped the spin
                # before, the grain would creep
                roll = roll - wp.cross(n, total) * ((radius - overlap) * dt / inertia)
            rolled = past.angle(before)
            if wp.static(rolls_with_history):
                rolled = transported(past.angle(before), n, n_before, mean_rotation) + roll * dt
            arm = c[wp.static(at.rolling_friction)] * radius
            if wp.static(rolls_with_history and predicted):  # as for the other dashpots (``normal_law``)
                swing = real(wp.static(0.5 * getattr(rolling, "STIFFNESS", 0.0))) * k_n * arm * arm * dt * dt / inertia
                roll_predicted = roll_predicted * (real(1.0) / (real(1.0) + swing))
            moment, limited_angle = rolling_torque(
                roll, roll_predicted, rolled, arm * load, k_n * arm * arm, c[wp.static(at.rolling_damping)], inertia, dt
            )
            torque = moment
            angle = limited_angle
        twist = real(0.0)
        if wp.static(twisting is not None):
            kept = retained(depth, depth_before)
            twisted = past.twist(before) * (kept * kept * kept) + wp.dot(spin, n) * dt
            area = radius * depth
            about, limited_twist = twisting_torque(
                twisted, wp.dot(spin_predicted, n), wp.sqrt(area if area > real(0.0) else real(0.0)),
                c[wp.static(at.shear)] * k_n, gamma_t, c[wp.static(at.friction)] * load,
            )  # fmt: skip
            torque = torque + n * about
            twist = limited_twist
        return total, torque, past.joined(spring, angle, load, twist, own)

    return KernelSet(
        force=force, constants=of_normal.constants, Coefficients=Coefficients, Constants=Constants, History=History,
        history=past, at=at, normal=of_normal, losses=of_normal.losses,
        bridge_at=past.at.of(liquid.COUNT) if hasattr(normal, "LIQUID") else None,
    )  # fmt: skip
