"""The contact law of a scene: normal, tangential and rolling model joined, the same for pairs of grains and for walls.

Signs: a pair quantity is *i minus j*; the normal points *from j to i* (from the wall to the grain), so a positive normal
force pushes i along it. Force and torque returned act on i.

    F = F_n n + F_t,     F_t = -k_t s - gamma_t v_t,     |F_t| <= mu max(F_n, 0)

The spring s [m] follows the slip of the mid-step velocity, taken across the mid-step normal: taken across the end normal,
the mean normal velocity leaks into it and holds small grains between large ones (Vyas et al. 2025). It is first cut so
that the spring alone stays within the Coulomb limit, then spring and dashpot together are projected on that limit. Both
are projections on a ball that contains the spring force, so friction never creates energy: (F_t - F_spring) . v_t <= 0.
"""

import functools

import warp as wp
from warpdem.kernels import rotation, tiny

# columns of the table of coefficients per pair of materials
COEFFICIENTS = (
    "stiffness",  # base of the normal law
    "damping",  # base of the normal law
    "shear",  # k_t/k_n [-]
    "shear_damping",  # gamma_t/gamma_n [-]
    "friction",  # mu [-]
    "rolling_friction",  # mu_r [-]
    "rolling_damping",  # eta [-]
)


@functools.cache
def build(real, normal, tangential, rolling, torsion: bool, wall: bool = False):
    """Return (constants, law) of the chosen model modules; ``tangential`` and ``rolling`` may be None; ``wall``: j is one.

    The law's arguments and results are the same whatever is left out, so that loops need not know.
    """
    vec3 = wp.types.vector(3, real)
    Coefficients = wp.types.vector(len(COEFFICIENTS), real)
    constants, normal_force = normal.build(real)
    carried = rotation.build(real)
    kept = tangential.build(real) if tangential else None
    rolling_torque = rolling.build(real) if rolling else None
    small = tiny(real)
    rolls_with_history = bool(rolling) and rolling.HISTORY

    @wp.func
    def friction(
        spring: vec3, velocity: vec3, stiffness: real, damping: real, limit: real
    ):
        """Tangential force [N] within the Coulomb limit, and the spring [m] cut to it."""
        least = real(wp.static(small))
        share = limit / (stiffness * wp.sqrt(wp.dot(spring, spring) + least) + least)
        held = spring * (share if share < real(1.0) else real(1.0))
        trial = held * (-stiffness) - velocity * damping
        cap = limit / wp.sqrt(wp.dot(trial, trial) + least)
        return trial * (cap if cap < real(1.0) else real(1.0)), held

    @wp.func
    def across(vector: vec3, normal: vec3) -> vec3:
        return vector - normal * wp.dot(vector, normal)

    @wp.func
    def law(
        # geometry now and one step before
        n: vec3,
        n_before: vec3,
        overlap: real,
        overlap_before: real,
        # motion of i relative to j at the contact
        velocity: vec3,  # at the instant of the force (predicted) [m/s]
        slip: vec3,  # displacement over the last step [m]
        turning: vec3,  # mean rotation of the two bodies over the last step [rad]
        spin: vec3,  # relative spin, mid-step [rad/s]
        spin_predicted: vec3,
        dt: real,
        # constants of this contact
        stiffness: real,
        damping: real,
        radius: real,  # R* [m]
        inertia: real,  # of the rolling model [kg m2]
        c: Coefficients,
        # memory
        spring: vec3,
        angle: vec3,
    ):
        """Force on i [N], rolling torque on i [N m], tangential spring [m], rolling spring [rad]."""
        speed = wp.dot(velocity, n)
        f_n, k_n, gamma_n = normal_force(overlap, speed, stiffness, damping)
        push = f_n if f_n > real(0.0) else real(0.0)
        force = n * f_n
        held = vec3()
        moment = vec3()
        bent = vec3()
        if wp.static(tangential is not None):
            both = n + n_before
            mid_share = wp.dot(slip, both) / (real(2.0) + real(2.0) * wp.dot(n, n_before))
            step = across(slip - both * mid_share, n)
            stretched = carried(spring, n, n_before, turning) * kept(overlap, overlap_before) + step
            f_t, cut = friction(stretched, velocity - n * speed, c[2] * k_n, c[3] * gamma_n, c[4] * push)
            held = cut
            force = n * f_n + f_t
        if wp.static(rolling is not None):
            roll = spin
            roll_predicted = spin_predicted
            if wp.static(not torsion):
                roll = across(spin, n)
                roll_predicted = across(spin_predicted, n)
            if wp.static(wall and not rolls_with_history):
                # the spin that friction at this contact is about to give: stopped after it, the grain would creep
                roll = roll - wp.cross(n, force) * ((radius - overlap) * dt / inertia)
            rolled = angle
            if wp.static(rolls_with_history):
                rolled = carried(angle, n, n_before, turning) + roll * dt
            arm = c[5] * radius
            torque, kept_angle = rolling_torque(
                roll, roll_predicted, rolled, arm * push, k_n * arm * arm, c[6], inertia, dt
            )
            moment = torque
            bent = kept_angle
        return force, moment, held, bent

    return constants, law
