"""One form for all normal laws, whatever their files declare (``columns``).

A law that declares neither COEFFICIENTS nor HISTORY is a function of the overlap alone:

    constants(base, damping, radius, mass) -> stiffness, damping
    force(overlap, speed, stiffness, damping) -> F_n, k_n, gamma_n

Its Coulomb load is max(F_n, 0). Any other gets and gives its own numbers too:

    constants(base, damping, own, radius, mass) -> stiffness, damping, own
    force(overlap, overlap_before, speed, stiffness, damping, own, history)
        -> F_n, load, k_n, gamma_n, depth, depth_before, history

load          normal force that friction and rolling resistance go by, >= 0                     [N]
depth         overlap that the tangential spring is rescaled by, now and one step before        [m]
"""

import functools
from types import ModuleType

import warp as wp
from warpdem.kernels import Built
from warpdem.kernels.contact import columns


@functools.cache
def build(real, normal: ModuleType):
    """Return the types of a normal law's numbers, ``constants`` and ``force``, the same for all laws."""
    at, own = columns.coefficients(normal), columns.own_coefficients(normal)
    Coefficients, Constants, Own = at.vector(real), columns.constants(normal).vector(real), own.vector(real)
    History = columns.own_history(normal).vector(real)
    constants_of_law, force_of_law = normal.build(real)

    if not columns.declares_own(normal):

        @wp.func
        def constants(c: Coefficients, radius: real, mass: real) -> Constants:
            """Stiffness and damping of a contact from R* [m] and m* [kg]."""
            stiffness, damping = constants_of_law(
                c[wp.static(at.stiffness)], c[wp.static(at.damping)], radius, mass
            )  # fmt: skip
            return Constants(stiffness, damping)

        @wp.func
        def force(overlap: real, overlap_before: real, speed: real, k: Constants, history: History):
            """F_n, load [N], k_n [N/m], gamma_n [N s/m], depth now and before [m], history."""
            f_n, k_n, gamma_n = force_of_law(overlap, speed, k[0], k[1])
            load = f_n if f_n > real(0.0) else real(0.0)
            return f_n, load, k_n, gamma_n, overlap, overlap_before, history

    else:

        @wp.func
        def constants(c: Coefficients, radius: real, mass: real) -> Constants:
            """Stiffness, damping and the law's own constants of a contact from R* [m] and m* [kg]."""
            given = Own()
            for f in range(wp.static(own.width)):
                given[f] = c[wp.static(at.width - own.width) + f]
            stiffness, damping, made = constants_of_law(
                c[wp.static(at.stiffness)], c[wp.static(at.damping)], given, radius, mass
            )  # fmt: skip
            k = Constants()
            k[0] = stiffness
            k[1] = damping
            for f in range(wp.static(own.width)):
                k[2 + f] = made[f]
            return k

        @wp.func
        def force(overlap: real, overlap_before: real, speed: real, k: Constants, history: History):
            """F_n, load [N], k_n [N/m], gamma_n [N s/m], depth now and before [m], history."""
            own_constants = Own()
            for f in range(wp.static(own.width)):
                own_constants[f] = k[2 + f]
            f_n, load, k_n, gamma_n, depth, depth_before, now = force_of_law(
                overlap, overlap_before, speed, k[0], k[1], own_constants, history
            )  # fmt: skip
            return f_n, load, k_n, gamma_n, depth, depth_before, now

    return Built(
        Coefficients=Coefficients, Constants=Constants, Own=Own, History=History, at=at, constants=constants, force=force
    )
