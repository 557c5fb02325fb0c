r"""Constant directional torque against rolling (Table 1 of the paper; type A of Ai et al. 2011).

    M_i = -min(mu_r R* max(F_n, 0) / |w|, I*/dt) w,      M_j = -M_i

    w     part of w_i - w_j across the normal (all of it with torsion)   [rad/s]
    mu_r  rolling friction coefficient                                   [-]
    R*    reduced radius; the grain's at a wall                          [m]
    I*    reduced moment of inertia, 1/(1/I_i + 1/I_j)                   [kg m2]

The second bound is the torque that stops the relative spin within one step dt: without it the torque overshoots and the
spin flips sign for ever. w is the mid-step spin, not the predicted one: with the predicted one that bound would leave an
undamped oscillation. At a wall it holds also what the friction of that contact adds to it in the step, -(dt/I) R n x F_t, so
that a grain on an incline is held by the torque and does not creep; what the other contacts add is not known to a law without
memory, and a grain held against them creeps. The paper prints the torque without its minus sign.
"""

import functools

import warp as wp
from warpdem.kernels import tiny

SUMMARY = "directional torque"
HISTORY = False


@functools.cache
def build(real):
    """Return the rolling torque for ``real``."""
    vec3 = wp.types.vector(3, real)
    small = tiny(real)

    @wp.func
    def torque(
        spin: vec3,  # relative mid-step spin, without what the law leaves alone, at a wall with friction's share [rad/s]
        spin_predicted: vec3,
        angle: vec3,  # rolling spring [rad]
        limit: real,  # mu_r R* max(F_n, 0) [N m]
        spring: real,  # k_n (mu_r R*)^2 [N m]
        damping: real,
        inertia: real,  # I* [kg m2]
        dt: real,
    ):
        """Torque on i [N m] and the rolling spring [rad] (unused here)."""
        speed = wp.sqrt(wp.dot(spin, spin) + real(wp.static(small)))
        sliding = limit / speed
        stopping = inertia / dt
        return spin * (-(sliding if sliding < stopping else stopping)), angle

    return torque
