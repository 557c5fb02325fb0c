r"""Mindlin's tangential spring kept as a force and rescaled on unloading: it never creates energy.

    on loading   F_t <- F_t - k_t(d) ds                     (what was stored stays, new slip meets the new stiffness)
    on unloading F_t <- F_t k_t(d)/k_t(d') - k_t(d) ds      (a shrinking contact gives up part of it)

With F_t = -k_t(d) s and k_t proportional to sqrt(d), as with Hertz, both are one rule for the stored spring s [m]:

    s <- s min(1, sqrt(d'/d)) + ds,      d' the overlap of the step before (the depth that the normal law says)

That rule is taken under every normal law. With ``hooke`` and ``luding`` k_t does not change with the overlap: as the contact
grows the stored force is not kept but falls by sqrt(d'/d), and (1/2) k_t s^2 by d'/d; as it shrinks nothing is given up. That
is a loss (``dissipated_rescaling`` of the budget), never a gain. Without it: `mindlin_displacement`, which under a constant k_t
returns just what was put in.

Source: Walton and Braun 1986 for the idea; the rescaling as in LAMMPS `mindlin_rescale/force` (Thornton and Randall 1988).
Keeping the displacement alone (`mindlin_displacement`) returns up to 1.41 of the energy put in when the overlap doubles
under shear.
"""

import functools

import warp as wp

SUMMARY = "force history"
PASSIVE = True


@functools.cache
def build(real):
    """Return the fraction of the stored spring that is kept over one step, for ``real``."""

    @wp.func
    def kept(overlap: real, overlap_before: real) -> real:
        """Factor in [0, 1] on the spring [-]."""
        before = overlap_before if overlap_before > real(0.0) else real(0.0)
        now = overlap if overlap > real(1.0e-30) else real(1.0e-30)
        ratio = wp.sqrt(before / now)
        return ratio if ratio < real(1.0) else real(1.0)

    return kept
