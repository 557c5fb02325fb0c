r"""Edinburgh elasto-plastic adhesion (EEPA) with the exponent 3/2: contacts that yield, and pull by their history.

    loading             F = f0 + K d^(3/2)
    un- and reloading   F = f0 + k2 (d^(3/2) - d_p^(3/2)),     d_p^(3/2) = (1 - K/k2) h^(3/2),     h the largest overlap
    adhesion branch     F >= f0 - k_a d^X,     through the least force f0 - P of the unloading line

    K     as in ``hertz``, from the moduli                                                    [N/m^1.5]
    k2    K/(1 - l), l = 1 - K/k2 the contact plasticity ratio                                [N/m^1.5]
    f0    constant pull-off force, <= 0; the scene gives its size                             [N]
    P     (3/2) pi w a, a = sqrt(2 R* d_p) the radius of the plastic patch, at most k2 d_p^(3/2)/2, so that the line meets
          the branch in contact                                                               [N]
    X     tensile exponent, 1 to 5 in halves                                                  [-]
    C     dashpot of ``hertz``, by the restitution; 1 for none

In EDEM: Constant Pull-off Force f0, Surface Energy w, Contact Plasticity Ratio l, Tensile Exponent X, Tangential Stiffness
Multiplier k_t/k_n, Slope Exponent 1.5: with another the moduli give no stiffness of loading, and other values are refused (for
1 take ``luding``).

A contact remembers h^(3/2), which on the branch is forgotten as far as the contact opens, so that pressing again starts from
there, and the overlap g at which it yielded last, by which d_p, P and k_a = P/d_min^X go. f0 begins and ends at d = 0 and is
given for the part of the step that it acts in (``contact.jumps``); it loses nothing. Lost are the work of yielding (plasticity)
and that on the branch (adhesion), beside what the unloading line stores. Friction goes by F - f0 + k_a d^X, the last at most P
(EDEM lets it grow on, to any multiple of the force itself).

Sources: Morrissey 2013; Thakur, Morrissey, Sun, Chen and Ooi 2014, 10.1007/s10035-014-0506-4.
"""

import functools
import math

import numpy as np
import warp as wp
from warpdem.kernels import tiny
from warpdem.kernels.contact import columns, jumps
from warpdem.kernels.contact.columns import PairKey
from warpdem.kernels.normal import hertz, hooke, jkr

SUMMARY = "EEPA: Hertz, plastic and adhesive"
PASSIVE = True
JUMPS = True
TANGENT = hertz.TANGENT
PAIR = {
    "surface_energy": jkr.PAIR["surface_energy"],
    "pull_off_force": PairKey(
        "N", 0.0, 'Constant pull in contact [N], >= 0 (EDEM: its negative), default 0; only with normal = "edinburgh".'
    ),
    "plasticity_ratio": PairKey(
        "-", 0.5, 'Contact plasticity ratio 1 - k1/k2 [-], >= 0 and < 1, default 0.5; only with normal = "edinburgh".'
    ),
    "tensile_exponent": PairKey(
        "-", 1.5, 'Power of the adhesion branch [-], > 0: 1 to 5 in halves, default 1.5; only with normal = "edinburgh".',
        positive=True,
    ),
    "slope_exponent": PairKey(
        "-", 1.5, 'Power of loading and unloading [-], > 0: 1.5, default 1.5; only with normal = "edinburgh".', positive=True
    ),
    "tangential_stiffness_ratio": hooke.PAIR["tangential_stiffness_ratio"],
}  # fmt: skip
COEFFICIENTS = {"plastic": "-", "pull_off": "N", "patch": "N/m^0.5", "exponent": "-", "reach": "m", "plastic_depth": "-"}
HISTORY = {"yielded": "m^1.5", "turned": "m"}
LOSSES = ("adhesion", "plasticity")
LEAST_RATIO = 1.0e-9  # of plasticity: an elastic contact has none, and no quotient is by zero
REACH = 0.02  # of R*, beyond contact, where there is a constant pull: more than a step's travel
NEWTON = 12  # rounds that find where the adhesion branch begins, for the losses
damped_time, stiffness = hertz.damped_time, hertz.stiffness
at, memory = columns.scalars(COEFFICIENTS), columns.scalars(HISTORY)


def problems(pair) -> dict[str, str]:
    """What is wrong with the coefficients of a pair, by key."""
    found = {}
    if pair.slope_exponent != 1.5:
        found["slope_exponent"] = 'must be 1.5, the power whose stiffness the moduli give; for 1 take contact.normal = "luding"'
    if pair.plasticity_ratio >= 1.0:
        found["plasticity_ratio"] = "must be below 1, where a contact would be rigid when it opens"
    if pair.tensile_exponent not in [1.0 + 0.5 * k for k in range(9)]:
        found["tensile_exponent"] = "must be one of 1, 1.5, 2, ... 5"
    return found


def coefficients(a, b, pair) -> tuple[float, ...]:
    """Those of ``hertz`` with the k_t/k_n given; l, -f0 [N], P/sqrt(R* d_p) [N/m], 2 (X - 1), reach over R* and d_p/h."""
    base, damping, _, _ = hertz.coefficients(a, b, pair)
    ratio = pair.tangential_stiffness_ratio
    patch = 1.5 * math.pi * pair.surface_energy * math.sqrt(2.0)
    plastic, reach = max(pair.plasticity_ratio, LEAST_RATIO), REACH if pair.pull_off_force > 0.0 else 0.0
    own = plastic, pair.pull_off_force, patch, 2.0 * (pair.tensile_exponent - 1.0), reach, plastic ** (2.0 / 3.0)
    return base, damping, ratio, math.sqrt(ratio / TANGENT), *own


def gap(a, b, pair, radius) -> float:
    """How far beyond contact the law acts [m], at the largest R* [m]."""
    return REACH * radius if pair.pull_off_force > 0.0 else 0.0


def own_constants(radius, plastic, pull_off, patch, exponent, reach, plastic_depth):
    """Constants of contacts: what ``constants`` computes, for readers."""
    return {
        "plastic": plastic, "pull_off": pull_off, "patch": patch * radius**0.5, "exponent": exponent, "reach": reach * radius,
        "plastic_depth": plastic_depth,
    }  # fmt: skip


@functools.cache
def build(real):
    """Return (contact constants, force, losses) for ``real`` (wp.float32 or wp.float64)."""
    Own, History = at.vector(real), memory.vector(real)
    Losses = columns.scalars(LOSSES).vector(real)
    constants_of_hertz, force_of_hertz = hertz.build(real)
    share_of_step = jumps.build(real)
    small = tiny(real)

    @wp.func
    def constants(base: real, damping: real, own: Own, radius: real, mass: real):
        """K [N/m^1.5], C [N s/m^1.25] and the law's own constants of one contact."""
        stiffness, dashpot = constants_of_hertz(base, damping, radius, mass)
        made = Own(
            own[wp.static(at.plastic)], own[wp.static(at.pull_off)], own[wp.static(at.patch)] * wp.sqrt(radius),
            own[wp.static(at.exponent)], own[wp.static(at.reach)] * radius, own[wp.static(at.plastic_depth)],
        )  # fmt: skip
        return stiffness, dashpot, made

    @wp.func
    def two_thirds(x: real) -> real:
        """x^(2/3) for x from 1/2 to 1, to round-off: Halley's rounds for the root of y^3 = x^2."""
        square = x * x
        y = real(0.26) + real(0.74) * x
        for _k in range(2):
            cube = y * y * y
            y = y * (cube + square + square) / (cube + cube + square)
        return y

    @wp.func
    def power(root: real, exponent: real) -> real:
        """root^exponent for a whole exponent from 0 to 8."""
        two = root * root
        four = two * two
        out = four * four if exponent > real(7.5) else real(1.0)
        rest = exponent - real(8.0) if exponent > real(7.5) else exponent
        out = out * four if rest > real(3.5) else out
        rest = rest - real(4.0) if rest > real(3.5) else rest
        out = out * two if rest > real(1.5) else out
        rest = rest - real(2.0) if rest > real(1.5) else rest
        return out * root if rest > real(0.5) else out

    @wp.func
    def branch(turned: real, stiffness: real, own: Own):
        """P [N] and overlap d_min [m] where the unloading line meets the branch, of a contact that yielded at ``turned``."""
        plastic = own[wp.static(at.plastic)]
        line = stiffness / (real(1.0) - plastic) * plastic * turned * wp.sqrt(turned)  # k2 d_p^(3/2)
        plastic_depth = own[wp.static(at.plastic_depth)] * turned
        most = real(0.5) * line
        pull = own[wp.static(at.patch)] * wp.sqrt(plastic_depth)
        pull = pull if pull < most else most
        return pull, plastic_depth * two_thirds(real(1.0) - pull / (line + real(wp.static(small))))

    @wp.func
    def branch_share(depth: real, end: real, own: Own) -> real:
        """(d/d_min)^X, at most 1 [-]."""
        share = depth / (end + real(wp.static(small)))
        share = share if share < real(1.0) else real(1.0)
        return share * power(wp.sqrt(share), own[wp.static(at.exponent)])

    @wp.func
    def force(
        overlap: real, overlap_before: real, speed: real, stiffness: real, damping: real, own: Own, history: History
    ):
        """F_n and Coulomb load [N], k_n [N/m], gamma_n [N s/m], depth now and before [m], h^(3/2) and g."""
        _pressed, spring, dashpot = force_of_hertz(overlap, speed, stiffness, damping)
        depth = overlap if overlap > real(0.0) else real(0.0)
        inside = real(1.0) if overlap > real(0.0) else real(0.0)
        root = wp.sqrt(depth)
        plastic = own[wp.static(at.plastic)]
        unloading = stiffness / (real(1.0) - plastic)
        deep = depth * root
        turned = depth if deep > history[0] else history[1]
        yielded = deep if deep > history[0] else history[0]
        line = unloading * (deep - plastic * yielded)
        most, end = branch(turned, stiffness, own)
        pull = most * branch_share(depth, end, own)
        elastic = line if line > -pull else -pull
        yielded = yielded if line > -pull else (deep + pull / unloading) / plastic
        share = share_of_step(overlap, overlap_before, real(0.0))
        begins = share if overlap_before < real(0.0) else real(1.0)
        ends = share if overlap_before > real(0.0) and overlap > -own[wp.static(at.reach)] else real(0.0)
        acting = begins if overlap > real(0.0) else ends
        pressure = elastic + pull - dashpot * speed
        load = pressure if pressure > real(0.0) else real(0.0)
        f_n = elastic - own[wp.static(at.pull_off)] * acting - dashpot * speed
        return f_n, load, spring, dashpot, overlap, overlap_before, History(inside * yielded, inside * turned)

    @wp.func
    def unloaded(depth: real, yielded: real, stiffness: real, own: Own) -> real:
        """Energy of the unloading line at an overlap [J]."""
        plastic = own[wp.static(at.plastic)]
        rest = wp.pow(plastic * yielded, real(wp.static(2.0 / 3.0)))
        fifth = depth * depth * wp.sqrt(depth) - rest * plastic * yielded
        return stiffness / (real(1.0) - plastic) * (real(0.4) * fifth - plastic * yielded * (depth - rest))

    @wp.func
    def lost(
        overlap: real, overlap_before: real, stiffness: real, damping: real, own: Own, before: History, now: History
    ) -> Losses:
        """Lost to adhesion and to plasticity in the step [J]."""
        plastic = own[wp.static(at.plastic)]
        unloading = stiffness / (real(1.0) - plastic)
        depth = overlap if overlap > real(0.0) else real(0.0)
        # where the branch begins: Newton's rounds from the right, on a convex function
        most, end = branch(before[1], stiffness, own)
        exponent = real(1.0) + real(0.5) * own[wp.static(at.exponent)]
        begun = end
        for _k in range(wp.static(NEWTON)):
            root = wp.sqrt(begun)
            share = branch_share(begun, end, own)
            value = unloading * (begun * root - plastic * before[0]) + most * share
            rise = unloading * real(1.5) * root + exponent * most * share / (begun + real(wp.static(small)))
            begun = begun - value / (rise + real(wp.static(small)))
            begun = begun if begun > real(0.0) else real(0.0)
        raised = begun * branch_share(begun, end, own) - depth * branch_share(depth, end, own)
        left = unloaded(begun, before[0], stiffness, own) - unloaded(depth, now[0], stiffness, own)
        on_branch = most * raised / (exponent + real(1.0)) + left
        yielding = wp.pow(now[0], real(wp.static(5.0 / 3.0))) - wp.pow(before[0], real(wp.static(5.0 / 3.0)))
        of_work = real(0.4) * stiffness - unloaded(real(1.0), real(1.0), stiffness, own)
        to_adhesion = on_branch if now[0] < before[0] else real(0.0)
        to_plasticity = of_work * yielding if now[0] > before[0] else real(0.0)
        return Losses(to_adhesion, to_plasticity)

    return constants, force, lost


def secant(overlap, stiffness, plastic, pull_off, patch, exponent, reach, plastic_depth, yielded, turned):
    """K sqrt(d) [N/m]."""
    return stiffness * np.maximum(overlap, 0.0) ** 0.5


def slope(overlap, stiffness, plastic, pull_off, patch, exponent, reach, plastic_depth, yielded, turned):
    """(3/2) k2 sqrt(d) [N/m], that of the unloading line."""
    return TANGENT * stiffness / (1.0 - plastic) * np.maximum(overlap, 0.0) ** 0.5


def pull_after(load, stiffness, radius, plastic, pull_off, patch, exponent, reach, plastic_depth):
    """Largest pull P - f0 [N] of contacts that were pressed by ``load`` [N]."""
    deep = np.maximum(load + pull_off, 0.0) / stiffness  # h^(3/2)
    most = 0.5 * plastic * stiffness / (1.0 - plastic) * deep
    return np.minimum(patch * (plastic_depth * deep ** (2.0 / 3.0)) ** 0.5, most) + pull_off


def energy(overlap, stiffness, plastic, pull_off, patch, exponent, reach, plastic_depth, yielded, turned):
    """Work of first loading, (2/5) K d^(5/2) + f0 d [J]: for estimates of impacts."""
    depth = np.maximum(overlap, 0.0)
    return 0.4 * stiffness * depth**2.5 - pull_off * depth


def stored(overlap, stiffness, plastic, pull_off, patch, exponent, reach, plastic_depth, yielded, turned):
    """Energy of the unloading line and of the constant pull, f0 d [J]; 0 beyond contact."""
    depth, power = np.maximum(overlap, 0.0), plastic * yielded
    rest = power ** (2.0 / 3.0)
    line = stiffness / (1.0 - plastic) * (0.4 * (depth**2.5 - rest * power) - power * (depth - rest))
    return np.where(overlap > 0.0, line - pull_off * depth, 0.0)
