r"""Forces that jump: the part of a step for which a force acts that begins or ends within it.

A force F that begins at an overlap a, between two force calls, acts from there on; a kick knows it for a whole step or not at
all. That costs an order of accuracy: impacts of a law that jumps have an error of first order in the step. The fraction of the
step it has acted for is known from the overlap d now and d' one step before, so the kicks are given

    first force   F (1/2 + tau),    tau = (d - a)/(d - d')     it has acted for tau steps, and acts for half a step more
    last force    F (1/2 - tau),    tau = (a - d)/(d' - d)     it ended tau steps ago, and was given for half a step more

and the error is of order 3/2. Both are F (1/2 + (d - a)/|d - d'|). F is the force at a in both: what it has grown to since it
began is given in full (weighed too, it adds F' (d - d')^2/12 to the energy of each touch, in the mean over tau). The last force
is given after its end: a law must reach further than a.

The fractions are those of one kick per step. ``rk4`` and ``modified_verlet`` call forces several times, at positions where
another would be due, and keep errors of first order in single impacts: they say ``WEIGHS_JUMPS = False``, and ``check`` warns.
Restitution of a ``jkr`` impact of 0.9963, worst of 16 phases of its beginning, at 50 and at 400 steps per contact: 1.4e-3 and
1.7e-4 with ``rk4``, 1.5e-3 and 1.5e-4 with ``modified_verlet``; 6.8e-4 and 2.1e-5 with ``rk2``; 4.9e-4 and 2.1e-5 with
``exact_drift``, ``velocity_verlet``, ``scovel`` and ``lobatto``. The mean is right to 2e-4 in all.
"""

import functools

import warp as wp


@functools.cache
def build(real):
    """Return ``fraction``, that of a force in the step in which it begins or ends, for ``real``."""
    least = 1.0e-30  # [m]: two grains that do not move at the start are no division by zero

    @wp.func
    def fraction(overlap: real, overlap_before: real, at: real) -> real:
        """Share [-] of a force that begins as the overlap grows over ``at`` [m], or ends as it falls below."""
        way = wp.abs(overlap - overlap_before)
        return (overlap - at) / (way if way > real(wp.static(least)) else real(wp.static(least))) + real(0.5)

    return fraction
