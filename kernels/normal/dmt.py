r"""Hertz contact under a pull that does not change with the overlap (Derjaguin, Muller and Toporov 1975), and its tail.

    F_n = K d^(3/2) - C d^(1/4) v_n - F_c             for d > 0,     F_c = 2 pi w R*
    F_n = -F_c / (1 + S/z)^2                          for a gap S = -d > 0 up to 30.6 z, where it is 1e-3 of F_c

    w      work of adhesion, the energy that parting takes per area: 2 gamma for equal materials    [J/m2]
    z      length of the tail; 0: the pull begins and ends at d = 0                                 [m]
    others as in ``hertz``

For hard and small grains: the Tabor number (R* w^2/(E*^2 z^3))^(1/3) is below some 0.1 (z some 0.3 nm for real surfaces). With
A = 12 pi w z^2 the tail is the van der Waals force A R*/(6 (S + z)^2).

**The law is conservative: without damping it gives all of an impact back, and no grain ever sticks to another by it.** What
sticks does so by its dashpot. Take ``jkr`` for adhesion that costs energy.

Without a tail the force jumps where the contact begins and ends. In the step of the jump it is given for the part of the step
that it acts in (``contact.jumps``, both cases in one):

    F_c (1/2 + d/|d - d'|),     d' the overlap of the step before, of the other sign

For the last one the law reaches sqrt(R* 2 pi w/((4/3) E*)) beyond contact, more than a grain travels in a step unless it is far
too fast to be held.

Friction goes by the pressure between the surfaces, F_n + F_c = K d^(3/2) - C d^(1/4) v_n (LAMMPS: the same).
"""

import functools
import math

import numpy as np
import warp as wp
from warpdem.kernels import tiny
from warpdem.kernels.contact import columns
from warpdem.kernels.contact.columns import PairKey
from warpdem.kernels.normal import hertz, jkr

SUMMARY = "Hertz with a constant pull in contact, for hard small grains"
PASSIVE = True
JUMPS = True
TANGENT = hertz.TANGENT
PAIR = {
    "surface_energy": jkr.PAIR["surface_energy"],
    "tail_length": PairKey(
        "m", 0.0, 'Length over which the pull of normal = "dmt" fades outside of contact [m], >= 0, default 0: none outside.'
    ),
}
COEFFICIENTS = {"pull": "N", "tail": "m", "reach": "m"}  # of materials: F_c/R* [N/m], z, and (reach without a tail)^2/R* [m]
FADED = 1.0e-3  # of F_c: the tail ends there
TAIL_REACH = 1.0 / math.sqrt(FADED) - 1.0  # over z
damped_time, stiffness = hertz.damped_time, hertz.stiffness
at = columns.scalars(COEFFICIENTS)


def coefficients(a, b, pair) -> tuple[float, ...]:
    """Those of ``hertz``; 2 pi w [N/m], z [m] and 2 pi w/((4/3) E*) [m]."""
    of_hertz = hertz.coefficients(a, b, pair)
    pull = 2.0 * math.pi * pair.surface_energy
    return *of_hertz, pull, pair.tail_length, pull / of_hertz[0]


def gap(a, b, pair, radius) -> float:
    """How far beyond contact the law acts [m], at the largest R* [m]."""
    _, tail, reach = coefficients(a, b, pair)[4:]
    return TAIL_REACH * tail if tail > 0.0 else math.sqrt(reach * radius)


def own_constants(radius, pull, tail, reach):
    """F_c [N], z [m] and reach [m] of contacts: what ``constants`` computes, for readers."""
    return {"pull": pull * radius, "tail": tail, "reach": np.where(tail > 0.0, TAIL_REACH * tail, (reach * radius) ** 0.5)}


@functools.cache
def build(real):
    """Return (contact constants, force) for ``real`` (wp.float32 or wp.float64)."""
    Own = at.vector(real)
    Nothing = columns.scalars({}).vector(real)
    constants_of_hertz, force_of_hertz = hertz.build(real)
    small = tiny(real)

    @wp.func
    def constants(base: real, damping: real, own: Own, radius: real, mass: real):
        """K [N/m^1.5], C [N s/m^1.25], F_c [N], z and reach [m] of one contact."""
        stiffness, dashpot = constants_of_hertz(base, damping, radius, mass)
        tail = own[wp.static(at.tail)]
        reach = wp.sqrt(own[wp.static(at.reach)] * radius)
        reach = real(wp.static(TAIL_REACH)) * tail if tail > real(0.0) else reach
        return stiffness, dashpot, Own(own[wp.static(at.pull)] * radius, tail, reach)

    @wp.func
    def force(
        overlap: real, overlap_before: real, speed: real, stiffness: real, damping: real, own: Own, nothing: Nothing
    ):
        """F_n and Coulomb load [N], k_n [N/m], gamma_n [N s/m], depth now and before [m], no history."""
        pressed, spring, dashpot = force_of_hertz(overlap, speed, stiffness, damping)
        tail = own[wp.static(at.tail)]
        inside = real(1.0) if overlap > real(0.0) else real(0.0)
        was_inside = real(1.0) if overlap_before > real(0.0) else real(0.0)
        apart = real(0.0) if overlap > real(0.0) else -overlap
        above = tail if tail > real(0.0) else overlap
        below = tail + apart if tail > real(0.0) else wp.abs(overlap - overlap_before)
        share = above / (below + real(wp.static(small)))
        jumping = real(0.5) + share if inside != was_inside else inside
        acting = share * share if tail > real(0.0) else jumping
        acting = acting if apart < own[wp.static(at.reach)] else real(0.0)
        load = pressed if pressed > real(0.0) else real(0.0)
        f_n = pressed - own[wp.static(at.pull)] * acting
        return f_n, load, spring, dashpot, overlap, overlap_before, nothing

    return constants, force


def secant(overlap, stiffness, pull, tail, reach):
    """K sqrt(d) [N/m]."""
    return stiffness * np.maximum(overlap, 0.0) ** 0.5


def adhesion(stiffness, radius, pull, tail, reach):
    """Pull-off force F_c [N], energy that a touch costs, none [J], and (R* w^2/E*^2)^(1/3) [m] of contacts."""
    work, young = pull / (2.0 * math.pi * radius), 0.75 * stiffness / radius**0.5
    return pull, 0.0, (radius * (work / young) ** 2) ** (1.0 / 3.0)


def slope(overlap, stiffness, pull, tail, reach):
    """(3/2) K sqrt(d) [N/m]."""
    return TANGENT * secant(overlap, stiffness, pull, tail, reach)


def energy(overlap, stiffness, pull, tail, reach):
    """(2/5) K d^(5/2) - F_c d in contact, and that of the tail, 0 at its end [J]."""
    depth, apart = np.maximum(overlap, 0.0), np.maximum(-overlap, 0.0)
    scale = np.where(tail > 0.0, tail, 1.0)
    outside = tail * (scale / (scale + np.minimum(apart, reach)) - scale / (scale + reach))
    return hertz.energy(depth, stiffness) - pull * (depth + outside)
