"""Clumps: rigid bodies whose members are grains; the arrays that hold them and what a contact needs to know of them.

The members of a clump are grains like any other for contacts, walls and lists: a record each, one after the other in memory,
in the order of their template. ``step.clumps`` moves the clump and writes them. A contact between two of them is left out of
the lists.

A clump's record has the numbers of a grain's (``grain``), with another meaning of the last six:

    position of the centre of mass, radius of the sphere of equal volume, velocity V, acceleration a,
    angular momentum L [N m s] and torque M of the last force call [N m], in frame axes

Where there are clumps, ``inverse`` of every grain holds after 1/m and 1/I the symmetric matrix B of six numbers that gives the
acceleration of its centre by a force on it,

    B = 1/m_c + [r]^T J [r],    1/m_eff = n . B n,    J = I_c^-1 in frame axes, [r] n = r x n

with m_c, I_c of the clump and r from its centre to that of the member; 1/m for a grain of its own. A force through a contact
with normal n acts as on a mass m_eff: what the restitution of the contact point goes by.
"""

import functools

import warp as wp
from warpdem.kernels import KernelSet, grain

WIDTH = {False: 2, True: 8}  # numbers of ``inverse``, by whether there are clumps
NONE = -1  # clump of a grain of its own
vec6 = wp.types.vector(6, wp.float64)
Reading = wp.types.vector(9, wp.float64)  # velocity [m/s], spin [rad/s], angular momentum [N m s]


def inverse_type(clumps: bool):
    """Type of ``inverse`` of a grain."""
    return wp.types.vector(WIDTH[clumps], wp.float64)


@wp.func
def place_of(arm: wp.vec4d) -> wp.vec3d:
    """Place of a member in the principal axes [m]."""
    return wp.vec3d(arm[0], arm[1], arm[2])


@wp.func
def clumps_before(first: wp.array(dtype=wp.int32), slot: int) -> int:
    """Number of clumps whose first member lies before ``slot``; ``first`` ascends."""
    low = int(0)
    high = int(first.shape[0])
    while low < high:
        middle = (low + high) // 2
        if first[middle] < slot:
            low = middle + 1
        else:
            high = middle
    return low


@functools.cache
def build(clumps: bool):
    """Return ``Clumps``, the struct of their arrays, and ``inverse_mass``; without clumps nothing reads either."""
    g = grain.build(True)
    Inverse = inverse_type(clumps)

    @wp.struct
    class Clumps:
        """Clumps in memory order, and of each grain to which it belongs."""

        record: wp.array(dtype=g.Record)  # (c,)
        turn: wp.array(dtype=wp.vec4d)  # (c,) quaternion from the principal axes to the frame axes
        rate: wp.array(dtype=wp.vec4d)  # (c,) 1/m [1/kg], 1/I_1, 1/I_2, 1/I_3 [1/(kg m2)]
        first: wp.array(dtype=wp.int32)  # (c,) slot of the first member
        count: wp.array(dtype=wp.int32)  # (c,) members
        drive: wp.array(dtype=vec6)  # (c,) acceleration of the centre [m/s2] and torque [N m] of the step
        rotation: wp.array(dtype=wp.vec4d)  # (c,) over the step, unit quaternion less 1, of ``step.free_rotation``
        reading: wp.array(dtype=Reading)  # (c,) motion at the time of the last reading
        of_grain: wp.array(dtype=wp.int32)  # (n,) clump that a grain belongs to, or NONE
        shape: wp.array(dtype=wp.int32)  # (c,) row of its first member in ``arm``
        arm: wp.array(dtype=wp.vec4d)  # (a,) place of a member in the principal axes, and its radius [m]; once for clumps alike
        spheres: wp.int32  # grains of their own

    @wp.func
    def arm_of(c: int, m: int, all: Clumps) -> wp.vec4d:
        """Row of ``arm`` of member ``m`` of clump ``c``."""
        return all.arm[all.shape[c] + m - all.first[c]]

    if clumps:

        @wp.func
        def inverse_mass(inv: Inverse, n: wp.vec3d) -> wp.float64:
            """1/m_eff of a grain along the unit vector ``n`` [1/kg]."""
            return (
                n[0] * (inv[2] * n[0] + wp.float64(2.0) * (inv[3] * n[1] + inv[4] * n[2]))
                + n[1] * (inv[5] * n[1] + wp.float64(2.0) * inv[6] * n[2])
                + inv[7] * n[2] * n[2]
            )

    else:

        @wp.func
        def inverse_mass(inv: Inverse, n: wp.vec3d) -> wp.float64:
            """1/m of a grain [1/kg]."""
            return inv[0]

    @wp.func
    def same_clump(of_grain: wp.array(dtype=wp.int32), i: int, j: int) -> bool:
        """Whether grains ``i`` and ``j`` are members of one clump."""
        return of_grain[i] != wp.static(NONE) and of_grain[i] == of_grain[j]

    return KernelSet(
        Clumps=Clumps, Inverse=Inverse, inverse_mass=inverse_mass, arm_of=arm_of, same_clump=same_clump, there=clumps
    )
