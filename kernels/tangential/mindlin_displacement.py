r"""Mindlin's tangential spring kept as a displacement: the paper's Table 1, and what LIGGGHTS does by default.

    F_t = -k_t(d) s,      s <- s + ds

    s    tangential spring, the slip since the contact began   [m]
    k_t  tangential stiffness at the present overlap d         [N/m]

For parity and speed comparisons. Since k_t grows with d, pressing a sheared contact harder creates energy: up to 1.41 of
what was put in when d doubles. `mindlin` does not.
"""

import functools

import warp as wp

SUMMARY = "displacement history"


@functools.cache
def build(real):
    """Return the fraction of the stored spring that is kept over one step (all of it), for ``real``."""

    @wp.func
    def kept(overlap: real, overlap_before: real) -> real:
        """One [-]."""
        return real(1.0)

    return kept
