r"""``jkr`` whose contacts end at the largest pull F_c, as those of surfaces under a fixed load do; LAMMPS ends them there.

The contact ends at d = -0.4807 d_c, where the force has its minimum -F_c, instead of at -d_c. The pull-off force is the
same; a touch and a parting lose 0.4620 F_c d_c, 49 % of the theory's 0.9355, and grains stick below 0.703 of its speed. For
results to be compared with those of LAMMPS (``pair_style granular``, normal model ``jkr``, whose surface energy is w/2). Grains
are not pulled by a fixed load: take ``jkr`` otherwise.
"""

from warpdem.kernels.normal import jkr

SUMMARY = "jkr that ends at the largest pull, as in LAMMPS"
PASSIVE, JUMPS, TANGENT, PAIR, COEFFICIENTS, HISTORY, LOSSES = (
    jkr.PASSIVE, jkr.JUMPS, jkr.TANGENT, jkr.PAIR, jkr.COEFFICIENTS, jkr.HISTORY, jkr.LOSSES,
)  # fmt: skip
TEARS = (3.0 ** (4.0 / 3.0) - 4.0 * 3.0 ** (1.0 / 3.0)) / 3.0
"""D of the largest pull [-], where s^3 = 3."""
coefficients, gap, own_constants = jkr.coefficients, jkr.gap, jkr.own_constants
damped_time, stiffness, secant, slope = jkr.damped_time, jkr.stiffness, jkr.secant, jkr.slope
contact_depth = jkr.contact_depth


def energy(overlap, stiffness, pull_off, depth):
    """As of ``jkr``, 0 where these contacts end."""
    return jkr.energy_to(TEARS, overlap, stiffness, pull_off)


def stored(overlap, stiffness, pull_off, depth):
    """As of ``jkr``, 0 where these contacts end."""
    return jkr.is_held(overlap, depth) * jkr.energy_to(TEARS, overlap, stiffness, pull_off)


def adhesion(stiffness, radius, pull_off):
    """As of ``jkr``; a touch costs less."""
    return jkr.adhesion_to(TEARS, stiffness, pull_off)


def build(real):
    """Return (contact constants, force, losses) for ``real`` (wp.float32 or wp.float64)."""
    return jkr.built(real, TEARS)
