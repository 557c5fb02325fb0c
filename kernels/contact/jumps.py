r"""Forces that jump: the part of a step for which a force acts that begins or ends within it.

A force F that begins at an overlap a, between two force calls, acts from there on; a kick knows it for a whole step or not at
all. That costs an order of accuracy: impacts of a law that jumps have an error of first order in the step. The share of the
step it has acted for is known from the overlap d now and d' one step before, so the kicks are given

    first force   F (tau + 1/2),    tau = (d - a)/(d - d')     it has acted for tau steps, and acts for half a step more
    last force    F (1/2 - tau),    tau = (a - d)/(d' - d)     it ended tau steps ago, and was given for half a step more

and the error is of order 3/2. The last force, that at a, is given after its end: a law must reach further than a.
"""

import functools

import warp as wp


@functools.cache
def build(real):
    """Return ``first`` and ``last``, the shares of a force that begins and ends, for ``real``."""
    least = 1.0e-30  # [m]: two grains that do not move at the start are no division by zero

    @wp.func
    def first(overlap: real, overlap_before: real, at: real) -> real:
        """Share tau + 1/2 [-] of a force that begins as the overlap grows over ``at`` [m]."""
        way = overlap - overlap_before
        return (overlap - at) / (way if way > real(wp.static(least)) else real(wp.static(least))) + real(0.5)

    @wp.func
    def last(overlap: real, overlap_before: real, at: real) -> real:
        """Share 1/2 - tau [-] of a force that ends as the overlap falls below ``at`` [m]."""
        way = overlap_before - overlap
        return real(0.5) - (at - overlap) / (way if way > real(wp.static(least)) else real(wp.static(least)))

    return first, last
