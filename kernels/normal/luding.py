r"""Linear springs that yield, harden and stick: Luding's hysteretic law, with or without adhesion.

    k2(h) = k1 + (k_p - k1) min(h/d_p, 1),      d0(h) = (1 - k1/k2) min(h, d_p),     h the largest overlap of the contact
    F     = max(k2 (d - d0), -k_c d) - C v_n

    d_p   = k_p/(k_p - k1) phi 2 R*             overlap up to which the contact yields                        [m]
    k1    stiffness of first loading (there h = d, and F = k1 d up to d_p)                                     [N/m]
    k_p   stiffness of unloading where the contact yields no further                                          [N/m]
    k_c   stiffness of the adhesion branch                                                                    [N/m]
    phi   plasticity depth                                                                                    [-]
    C     2 |beta| sqrt(m* k1), beta from the restitution: of the dashpot alone, 1 for none                   [N s/m]

On the branch -k_c d the largest overlap is forgotten as far as the contact opens, h follows from k2 (d - d0) = -k_c d:

    h = d/2 + sqrt(d^2/4 + (k1 + k_c) d d_p/(k_p - k1))

so that pressing again starts from there, and force and h end at d = 0: no jump, nothing acts beyond contact. The energy of a
contact is k2 (d - d0)^2/2; the rest of the work is lost, to plasticity while it yields, to adhesion on the branch:

    plasticity up to h      (k1/2)(1 - k1/k2) min(h, d_p)^2
    adhesion from h on      (k_c/2)(1 + k_c/k2) d_c^2,     d_c = (k2 - k1) min(h, d_p)/(k2 + k_c) where the branch begins

Without k_c an impact of speed v that stays below d_p gives back sqrt(k1/k2). Friction goes by F + k_c d, the pressure without
the pull, and k_t is a fixed fraction of k1, at any overlap. Source: Luding 2008, 10.1007/s10035-008-0099-x.
"""

import functools

import numpy as np
import warp as wp
from warpdem.kernels.contact import columns
from warpdem.kernels.contact.columns import PairKey
from warpdem.kernels.normal import hooke

SUMMARY = "linear, plastic and adhesive"
PASSIVE = True
STIFFNESS_KEY = hooke.STIFFNESS_KEY
# k_p/k1 - 1 at least: an elastic contact yields at no overlap, and no quotient is by zero, in float32 either (6e-8)
LEAST_HARDENING = 1.0e-6
PAIR = {
    **hooke.PAIR,
    "unloading_stiffness": PairKey(
        "N/m", None, 'Stiffness of unloading, at most [N/m], > 0, >= stiffness; only with normal = "luding".', positive=True
    ),
    "plasticity_depth": PairKey(
        "-", 0.05, 'Depth at which a contact yields no further over 2 R* [-], > 0, default 0.05; only with normal = "luding".',
        positive=True,
    ),
    "adhesion_stiffness": PairKey(
        "N/m", 0.0, 'Stiffness of the adhesion branch [N/m], >= 0, default 0; only with normal = "luding".'
    ),
}  # fmt: skip
COEFFICIENTS = {"limit": "N/m", "adhesion": "N/m", "yield_depth": "m"}  # of materials: the last over R* [-]
HISTORY = {"deepest": "m"}
LOSSES = ("adhesion", "plasticity")
damped_time = hooke.damped_time
at = columns.scalars(COEFFICIENTS)


def problems(pair) -> dict[str, str]:
    """What is wrong with the coefficients of a pair, by key."""
    if pair.stiffness is None or pair.unloading_stiffness is None or pair.unloading_stiffness >= pair.stiffness:
        return {}
    return {"unloading_stiffness": f"must be at least the stiffness of loading, pairs[].stiffness = {pair.stiffness:g} N/m"}


def coefficients(a, b, pair) -> tuple[float, ...]:
    """Those of ``hooke`` with k1; k_p, k_c [N/m] and d_p/R* [-]."""
    limit = max(pair.unloading_stiffness, pair.stiffness * (1.0 + LEAST_HARDENING))
    depth = limit / (limit - pair.stiffness) * pair.plasticity_depth * 2.0
    return *hooke.coefficients(a, b, pair), limit, pair.adhesion_stiffness, depth


def own_constants(radius, limit, adhesion, yield_depth):
    """k_p, k_c [N/m] and d_p [m] of contacts: what ``constants`` computes, for readers."""
    return {"limit": limit, "adhesion": adhesion, "yield_depth": yield_depth * radius}


@functools.cache
def build(real):
    """Return (contact constants, force, losses) for ``real`` (wp.float32 or wp.float64)."""
    Own = at.vector(real)
    History = columns.scalars(HISTORY).vector(real)
    Losses = columns.scalars(LOSSES).vector(real)
    constants_of_hooke, _ = hooke.build(real)

    @wp.func
    def constants(base: real, damping: real, own: Own, radius: real, mass: real):
        """k1 [N/m], C [N s/m], k_p, k_c [N/m] and d_p [m] of one contact."""
        stiffness, dashpot = constants_of_hooke(base, damping, radius, mass)
        return stiffness, dashpot, Own(own[0], own[1], own[wp.static(at.yield_depth)] * radius)

    @wp.func
    def hardened(deepest: real, stiffness: real, own: Own):
        """min(h, d_p) [m] and k2 - k1 [N/m]."""
        end = own[wp.static(at.yield_depth)]
        yielded = deepest if deepest < end else end
        return yielded, (own[wp.static(at.limit)] - stiffness) * (yielded / end)

    @wp.func
    def force(
        overlap: real, overlap_before: real, speed: real, stiffness: real, damping: real, own: Own, history: History
    ):
        """F_n and Coulomb load [N], k_n [N/m], gamma_n [N s/m], depth now and before [m], largest overlap."""
        touching = real(1.0) if overlap > real(0.0) else real(0.0)
        depth = overlap if overlap > real(0.0) else real(0.0)
        deepest = history[0] if history[0] > depth else depth
        yielded, harder = hardened(deepest, stiffness, own)
        line = (stiffness + harder) * depth - harder * yielded
        pull = own[wp.static(at.adhesion)] * depth
        half = real(0.5) * depth
        softness = own[wp.static(at.yield_depth)] / (own[wp.static(at.limit)] - stiffness)
        forgotten = half + wp.sqrt(half * half + (stiffness * depth + pull) * softness)
        elastic = line if line > -pull else -pull
        deepest = deepest if line > -pull else forgotten  # all of it, 0, beyond contact
        gamma = touching * damping
        f_n = elastic - gamma * speed
        load = f_n + pull
        load = load if load > real(0.0) else real(0.0)
        return f_n, load, touching * stiffness, gamma, overlap, overlap_before, History(deepest)

    @wp.func
    def lost(
        overlap: real, overlap_before: real, stiffness: real, damping: real, own: Own, before: History, now: History
    ) -> Losses:
        """Lost to adhesion and to plasticity in the step [J]: states of the branches left and reached."""
        cohesion = own[wp.static(at.adhesion)]
        was, harder_before = hardened(before[0], stiffness, own)
        yielded, harder = hardened(now[0], stiffness, own)
        begun_before = harder_before * was / (stiffness + harder_before + cohesion)
        begun = harder * yielded / (stiffness + harder + cohesion)
        half = real(0.5)
        sticking_before = half * cohesion * begun_before * begun_before * (
            real(1.0) + cohesion / (stiffness + harder_before)
        )
        sticking = half * cohesion * begun * begun * (real(1.0) + cohesion / (stiffness + harder))
        work_before = half * stiffness * was * was * harder_before / (stiffness + harder_before)
        work = half * stiffness * yielded * yielded * harder / (stiffness + harder)
        to_adhesion = sticking_before - sticking if now[0] < before[0] else real(0.0)
        to_plasticity = work - work_before if now[0] > before[0] else real(0.0)
        return Losses(to_adhesion, to_plasticity)

    return constants, force, lost


def _hardened(deepest, stiffness, limit, yield_depth):
    """min(h, d_p) [m] and k2 - k1 [N/m]."""
    yielded = np.minimum(deepest, yield_depth)
    return yielded, (limit - stiffness) * yielded / yield_depth


def secant(overlap, stiffness, limit, adhesion, yield_depth, deepest):
    """k1 [N/m]."""
    return stiffness + 0.0 * overlap


def slope(overlap, stiffness, limit, adhesion, yield_depth, deepest):
    """k2 [N/m], of contacts that have been as deep as this."""
    return stiffness + _hardened(np.maximum(deepest, overlap), stiffness, limit, yield_depth)[1]


def pull_after(load, stiffness, radius, limit, adhesion, yield_depth):
    """Largest pull k_c d_c [N] of contacts that were pressed by ``load`` [N]."""
    yielded, harder = _hardened(load / stiffness, stiffness, limit, yield_depth)
    return adhesion * harder * yielded / (stiffness + harder + adhesion)


def energy(overlap, stiffness, limit, adhesion, yield_depth, deepest):
    """Work of first loading, (1/2) k1 d^2 up to d_p, then at k_p [J]: for estimates of impacts."""
    yielding, beyond = np.minimum(overlap, yield_depth), np.maximum(overlap - yield_depth, 0.0)
    return 0.5 * stiffness * yielding**2 + beyond * (stiffness * yielding + 0.5 * limit * beyond)


def stored(overlap, stiffness, limit, adhesion, yield_depth, deepest):
    """(1/2) k2 (d - d0)^2 [J]; 0 beyond contact."""
    yielded, harder = _hardened(deepest, stiffness, limit, yield_depth)
    k2 = stiffness + harder
    return np.where(overlap > 0.0, 0.5 * k2 * (overlap - harder * yielded / k2) ** 2, 0.0)
