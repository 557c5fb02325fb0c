"""The contact history of one contact in one vector (``columns``): springs, load, twist, the normal law's own scalars."""

import functools

import warp as wp
from warpdem.kernels import KernelSet
from warpdem.kernels.contact.columns import LOAD, TWIST, Columns


@functools.cache
def build(real, at: Columns, own: Columns):
    """Return the types and the functions that read and make a history; what it does not hold reads as zero.

    Args:
        real: precision.
        at: columns of the history.
        own: those of them that are the normal law's own, the last.
    """
    vec3 = wp.types.vector(3, real)
    Rotation = wp.types.matrix((3, 3), real)
    History = at.vector(real)
    Own = own.vector(real)
    has_spring, has_angle, has_load = "spring" in at, "angle" in at, LOAD in at
    spring_at, angle_at = at.spring if has_spring else 0, at.angle if has_angle else 0
    load_at = at.load if has_load else 0
    has_twist = TWIST in at
    twist_at = at.twist if has_twist else 0
    own_at = at.width - own.width

    @wp.func
    def spring(h: History) -> vec3:
        """Tangential spring [m]."""
        out = vec3()
        if wp.static(has_spring):
            out = vec3(h[wp.static(spring_at)], h[wp.static(spring_at + 1)], h[wp.static(spring_at + 2)])
        return out

    @wp.func
    def angle(h: History) -> vec3:
        """Rolling spring [rad]."""
        out = vec3()
        if wp.static(has_angle):
            out = vec3(h[wp.static(angle_at)], h[wp.static(angle_at + 1)], h[wp.static(angle_at + 2)])
        return out

    @wp.func
    def load(h: History) -> real:
        """Coulomb load of the force call [N]."""
        out = real(0.0)
        if wp.static(has_load):
            out = h[wp.static(load_at)]
        return out

    @wp.func
    def twist(h: History) -> real:
        """Twisting spring [rad]."""
        out = real(0.0)
        if wp.static(has_twist):
            out = h[wp.static(twist_at)]
        return out

    @wp.func
    def own_of(h: History) -> Own:
        """The normal law's own scalars."""
        out = Own()
        for f in range(wp.static(own.width)):
            out[f] = h[wp.static(own_at) + f]
        return out

    @wp.func
    def joined(spring: vec3, angle: vec3, coulomb_load: real, twisted: real, own_scalars: Own) -> History:
        """A history of its parts."""
        h = History()
        if wp.static(has_spring):
            for f in range(3):
                h[wp.static(spring_at) + f] = spring[f]
        if wp.static(has_angle):
            for f in range(3):
                h[wp.static(angle_at) + f] = angle[f]
        if wp.static(has_load):
            h[wp.static(load_at)] = coulomb_load
        if wp.static(has_twist):
            h[wp.static(twist_at)] = twisted
        for f in range(wp.static(own.width)):
            h[wp.static(own_at) + f] = own_scalars[f]
        return h

    @wp.func
    def rotated(h: History, rate: Rotation) -> History:
        """The same history in axes that rotated by I + ``rate``: vectors rotate, scalars do not."""
        s = spring(h)
        a = angle(h)
        return joined(s + rate * s, a + rate * a, load(h), twist(h), own_of(h))

    return KernelSet(
        History=History, Own=Own, Rotation=Rotation, at=at, spring=spring, angle=angle, twist=twist, own=own_of, joined=joined,
        rotated=rotated,
    )  # fmt: skip
