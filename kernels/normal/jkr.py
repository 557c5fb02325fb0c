r"""Adhesive contact of Johnson, Kendall and Roberts (1971): grains that touch stick, and parting them costs energy.

With D = d/d_c and s = sqrt(a/a_m), a the radius of the contact and a_m that at which it tears:

    D = (s^4 - 4 s)/3,    F = F_c (s^6 - 6 s^3)/9,    U = F_c d_c (4/27)(s^10/10 - s^7 + (3/2) s^4 - 3/5)
    F_n = F - C d_e^(1/4) v_n,    d_e = a^2/R* = d_c s^4/3,    k_n = (4/3) E* a = K sqrt(d_e),    K, C, k_t as in ``hertz``

    w      work of adhesion, the energy that parting takes per area: 2 gamma for equal materials        [J/m2]
    F_c    pull-off force (3/2) pi w R* = sqrt(3) K d_c^(3/2)                                           [N]
    d_c    pull-off distance (3/4)(pi^2 w^2 R*/E*^2)^(1/3)                                              [m]
    U      energy, F = dU/dd, 0 where the contact tears                                                 [J]

A contact begins when d > 0, with a pull of (8/9) F_c at once, and ends when d < -d_c, where it is (5/9) F_c: the surfaces hold
on beyond the place where they met, which is remembered (d_e, 0 without contact). A touch gives up U(0) = -0.9355 F_c d_c
without work on the grains: **that energy is lost to adhesion** per touch and parting (Thornton and Ning 1998:
7.09 (w^5 R*^4/E*^2)^(1/3)). So grains stick that meet below v_s = sqrt(2 x 0.9355 F_c d_c/m*), and others rebound at
e = sqrt(1 - (v_s/v)^2) if nothing damps. Both jumps are weighed by the part of the step that they act in (``contact.jumps``).

Friction goes by F + 2 F_c, which is at least F_c (Thornton 1991; LAMMPS the same), so contacts that are pulled have friction.
Softer grains keep F_c, which is free of E, while d_c and the loss grow as E^(-2/3): with w' = w (E'/E)^(2/5) they keep the
sticking speed instead. LAMMPS ends the contact at the largest pull: ``jkr_fixed_load``.

The quartic for s: with q = sqrt(D + 1) and s = 1 + q z it is z^2 (6 + 4 q z + q^2 z^2) = 3, whose root z falls from 1/sqrt(2)
at q = 0 to (3/q^2)^(1/4) for large q and is smooth in sqrt(q + 1.5), at infinity too. A quotient of two polynomials
is within 1.1e-6 of it, and one step of Halley's method gives all digits, from D = -1 to 1e9, with two divisions and two square
roots; cube roots would leave the SIMD lanes. Of R* a cube root is needed once per contact.

For soft, large grains: a Tabor number (R* w^2/(E*^2 z^3))^(1/3), z some 0.3 nm, above some 5. No surface energy at all leaves
d_c at 1e-10 R*, far below anything that can be seen.
"""

import functools
import math

import numpy as np
import warp as wp
from warpdem.kernels.contact import columns, jumps
from warpdem.kernels.contact.columns import PairKey
from warpdem.kernels.normal import hertz

SUMMARY = "adhesion: contacts stick and part at the pull-off distance"
PASSIVE = True
JUMPS = True
TANGENT = hertz.TANGENT
PAIR = {
    "surface_energy": PairKey(
        "J/m2", None, "Work of adhesion w [J/m2], >= 0: energy per area that parting two surfaces takes, 2 gamma of equal ones."
    ),
}
COEFFICIENTS = {"pull_off": "m"}  # d_c; of two materials d_c/R*^(1/3) [m^(2/3)]
HISTORY = {"depth": "m"}  # d_e, 0 without contact
LOSSES = ("adhesion",)
FLOOR = 1.0e-10
"""Least d_c over R* [-]."""
REACH = 3.0
"""How far the law looks beyond contact, over d_c [-]: a contact that ends in one step between here and d_c ends in the right
part of that step; one that flies further in a step is too fast for it to matter."""
TEARS = -1.0
"""D at which a contact ends [-]."""
BEGIN = 1.5
"""z is given over w = sqrt(q + BEGIN) - sqrt(BEGIN) [-], from 0 on."""
GUESS = (0.70710752, 1.4400187, 0.71464802), (1.0, 2.6138882, 2.1719059, 0.54301423)
"""Polynomials in w, lowest power first, whose quotient is z within 1.1e-6 of it (least largest error, by Lawson's weights)."""
damped_time, stiffness = hertz.damped_time, hertz.stiffness
at = columns.scalars(COEFFICIENTS)


def coefficients(a, b, pair) -> tuple[float, ...]:
    """Those of ``hertz``, and d_c/R*^(1/3) [m^(2/3)]."""
    of_hertz = hertz.coefficients(a, b, pair)
    young = 0.75 * of_hertz[0]
    return *of_hertz, 0.75 * (math.pi * pair.surface_energy / young) ** (2.0 / 3.0)


def gap(a, b, pair, radius) -> float:
    """How far beyond contact the law acts [m], at the largest R* [m]."""
    return REACH * float(own_constants(radius, coefficients(a, b, pair)[-1])["pull_off"])


def own_constants(radius, pull_off):
    """The d_c [m] of contacts: what ``constants`` computes, for readers."""
    return {"pull_off": np.maximum(pull_off * np.cbrt(radius), FLOOR * radius)}


def root(ratio):
    """The s [-] of overlaps over d_c, from -1 on."""
    ratio = np.maximum(ratio, -1.0)
    t = np.cbrt(1.0 + np.sqrt(1.0 + ratio**3))
    y = 4.0 / (t * t + ratio + (ratio / t) ** 2)
    r = np.sqrt(y)
    return 0.5 * (r + np.sqrt(np.maximum(8.0 / r - y, 0.0)))


def binding(s):
    """The energy U over F_c d_c [-]."""
    return 4.0 / 27.0 * (s**10 / 10.0 - s**7 + 1.5 * s**4 - 0.6)


def touched(end: float) -> float:
    """Energy that a touch gives up, over F_c d_c [-], if the contact ends at D = ``end``."""
    return float(binding(root(end)) - binding(root(0.0)))


@functools.cache
def build(real):
    """Return (contact constants, force, losses) for ``real`` (wp.float32 or wp.float64)."""
    return built(real, TEARS)


@functools.cache
def built(real, end: float):
    """``build`` of a law whose contacts end at D = ``end``."""
    Own, Loss = at.vector(real), columns.scalars(LOSSES).vector(real)
    History = columns.scalars(HISTORY).vector(real)
    constants_of_hertz, _ = hertz.build(real)
    share_of_step = jumps.build(real)
    touch = touched(end)

    @wp.func
    def cube_root(x: real) -> real:
        """Cube root of a length [m] from 1e-9 to 10 m, by + - * / and square roots."""
        fourth = wp.sqrt(wp.sqrt(x))
        guess = real(0.8) * fourth * wp.sqrt(wp.sqrt(fourth))  # within a third of it
        for _ in range(3):
            cube = guess * guess * guess
            guess = guess * (cube + real(2.0) * x) / (real(2.0) * cube + x)
        return guess

    @wp.func
    def constants(base: real, damping: real, own: Own, radius: real, mass: real):
        """K [N/m^1.5], C (d_c/3)^(1/4) [N s/m], so that s times it is the dashpot's, and d_c [m] of one contact."""
        stiffness, dashpot = constants_of_hertz(base, damping, radius, mass)
        pull_off = own[0] * cube_root(radius)
        least = real(wp.static(FLOOR)) * radius
        pull_off = pull_off if pull_off > least else least
        return stiffness, dashpot * wp.sqrt(wp.sqrt(pull_off * real(wp.static(1.0 / 3.0)))), Own(pull_off)

    @wp.func
    def contact_radius(above: real) -> real:
        """The s [-] of D + 1 = ``above`` >= 0."""
        q = wp.sqrt(above)
        w = wp.sqrt(q + real(wp.static(BEGIN))) - real(wp.static(math.sqrt(BEGIN)))
        over = real(wp.static(GUESS[0][0])) + w * (real(wp.static(GUESS[0][1])) + w * real(wp.static(GUESS[0][2])))
        under = real(wp.static(GUESS[1][1])) + w * (real(wp.static(GUESS[1][2])) + w * real(wp.static(GUESS[1][3])))
        z = over / (real(wp.static(GUESS[1][0])) + w * under)
        e = q * z
        value = z * z * (real(6.0) + e * (real(4.0) + e)) - real(3.0)
        rise = z * (real(3.0) + e * (real(3.0) + e))  # a quarter of the first derivative, and a sixth of the second
        bend = real(2.0) * (real(1.0) + e) * (real(1.0) + e)
        z = z - value * rise / (real(4.0) * rise * rise - real(0.75) * value * bend)
        return real(1.0) + q * z

    @wp.func
    def force(
        overlap: real, overlap_before: real, speed: real, stiffness: real, damping: real, own: Own, history: History
    ):
        """F_n and Coulomb load [N], k_n [N/m], gamma_n [N s/m], d_e now and before [m], d_e to remember [m]."""
        pull_off = own[0]
        before = history[0]
        ends_at = real(wp.static(end)) * pull_off
        held = before > real(0.0)
        there = overlap > real(0.0) or (held and overlap >= ends_at)
        begins = there and not held and overlap_before <= real(0.0)
        ends = held and not there and overlap > real(wp.static(-REACH)) * pull_off
        acts = real(1.0) if there or ends else real(0.0)
        jumping = share_of_step(overlap, overlap_before, ends_at if ends else real(0.0))
        share = jumping if begins or ends else acts
        pressing = share if there else real(0.0)
        bounded = overlap if overlap > ends_at else ends_at
        s = contact_radius((bounded + pull_off) / pull_off)
        s2 = s * s
        s3 = s2 * s
        unit = wp.sqrt(pull_off * real(wp.static(1.0 / 3.0)))  # sqrt(d_e) is s^2 times that
        pull = real(3.0) * stiffness * pull_off * unit
        elastic = pull * s3 * (s3 - real(6.0)) * real(wp.static(1.0 / 9.0))
        # what jumps is weighed: at the touch F(0), not what it has grown to since
        jump = real(wp.static(-8.0 / 9.0)) * pull if there else elastic
        dashpot = damping * s * share
        depth = pull_off * s2 * s2 * real(wp.static(1.0 / 3.0))
        load = (elastic + real(2.0) * pull) * pressing
        now = depth if there else real(0.0)
        return (
            elastic + jump * (share - real(1.0)) - dashpot * speed, load, stiffness * s2 * unit * acts, dashpot, depth,
            before if held else depth, History(now),
        )  # fmt: skip

    @wp.func
    def lost(
        overlap: real, overlap_before: real, stiffness: real, damping: real, own: Own, before: History, history: History
    ):
        """Lost to adhesion [J]: all that a touch gives up."""
        pull_off = own[0]
        whole = real(wp.static(touch * math.sqrt(3.0))) * stiffness * pull_off * pull_off * wp.sqrt(pull_off)
        begins = history[0] > real(0.0) and before[0] <= real(0.0) and overlap_before <= real(0.0)
        return Loss(whole if begins else real(0.0))

    return constants, force, lost


def is_held(overlap, depth):
    """Whether contacts hold; ``depth`` of 0: of one that is pressed for the first time."""
    return (depth > 0.0) | (overlap > 0.0)


def contact_depth(overlap, stiffness, pull_off, depth):
    """d_e [m], by which the radius of contacts goes."""
    return depth


def secant(overlap, stiffness, pull_off, depth):
    """K sqrt(d_e) [N/m]: by the d_e that contacts remember, by the overlap of those that are pressed for the first time."""
    pressed = (overlap > 0.0) * pull_off * root(overlap / pull_off) ** 4 / 3.0
    return stiffness * np.where(depth > 0.0, depth, pressed) ** 0.5


def slope(overlap, stiffness, pull_off, depth):
    """dF/dd [N/m]; 0 where it falls, as the contact tears."""
    s = np.maximum(root(overlap / pull_off), 3.0 ** (1.0 / 3.0))
    unit = 3.0**0.5 * stiffness * pull_off**0.5
    return is_held(overlap, depth) * unit * (s**5 - 3.0 * s**2) / (2.0 * (s**3 - 1.0))


def energy(overlap, stiffness, pull_off, depth):
    """The U [J] of contacts that hold, 0 where they tear; at a touch it is not 0."""
    return energy_to(TEARS, overlap, stiffness, pull_off)


def stored(overlap, stiffness, pull_off, depth):
    """The U [J] of contacts as they are."""
    return is_held(overlap, depth) * energy_to(TEARS, overlap, stiffness, pull_off)


def adhesion(stiffness, radius, pull_off):
    """Pull-off force [N], energy that a touch costs [J] and (R* w^2/E*^2)^(1/3) [m] of contacts."""
    return adhesion_to(TEARS, stiffness, pull_off)


def energy_to(end: float, overlap, stiffness, pull_off):
    """``energy`` of a law whose contacts end at D = ``end``."""
    whole = 3.0**0.5 * stiffness * pull_off**2.5
    return whole * (binding(root(overlap / pull_off)) - float(binding(root(end))))


def adhesion_to(end: float, stiffness, pull_off):
    """``adhesion`` of a law whose contacts end at D = ``end``."""
    pull = 3.0**0.5 * stiffness * pull_off**1.5
    return pull, touched(end) * pull * pull_off, pull_off / (0.75 * math.pi ** (2.0 / 3.0))
