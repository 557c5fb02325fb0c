"""Closest point of any feature of the walls: a triangle of a mesh or one of the analytic shapes.

A triangle takes the plane of its whole flat piece where the foot on that plane lies on it, so a flat floor of 2 or 20 000
triangles gives one height.
"""

import functools

import warp as wp
from warpdem.kernels.wall import shapes as analytic
from warpdem.kernels.wall.plane import foot
from warpdem.kernels.wall.surface import Surface
from warpdem.kernels.wall.triangle import FACE, closest_point

FLAT = 1.0e-6  # lateral distance to the plane's foot, in radii, below which a hit counts as a hit of the plane


@functools.cache
def build(*, meshes: bool, shapes: tuple[str, ...]):
    """Return the function of a feature's closest point, for walls with ``meshes`` and with these of ``shapes.SHAPES``."""
    closest_on_shape = analytic.build(shapes)

    @wp.func
    def closest_on_feature(surface: Surface, f: int, q: wp.vec3d, radius: wp.float64, cutoff: wp.float64):
        """Closest point of feature ``f`` to body point ``q`` [m], unit direction to q, distance [m], corner mask, weight [-].

        A distance of ``cutoff`` or more is only known to be so. The weight is 1 for a full contact, see ``shapes``.
        """
        point = wp.vec3d()
        direction = wp.vec3d()
        distance = cutoff
        mask = int(wp.static(FACE))
        weight = wp.float64(1.0)
        k = f - surface.triangles  # number among the analytic shapes
        if wp.static(meshes):
            if k < 0:
                nearby, normal, height = foot(q, surface.plane[f])
                point = nearby
                direction = normal
                distance = wp.abs(height)
                if height < wp.float64(0.0):
                    direction = -normal
                if distance < cutoff:  # where its plane is beyond the cutoff, the triangle is too
                    nearest, corners = closest_point(q, surface.corner[f])
                    if corners != wp.static(FACE):
                        away = q - nearest
                        square = wp.dot(away, away)
                        tolerance = wp.float64(wp.static(FLAT)) * radius
                        if square - height * height > tolerance * tolerance:
                            mask = corners
                            point = nearest
                            distance = wp.sqrt(square)
                            direction = away / distance
        if wp.static(len(shapes) > 0):
            if k >= 0:
                there, towards, apart, part = closest_on_shape(surface.shape[k], q, radius, surface.numbers[k])
                point = there
                direction = towards
                distance = apart
                weight = part
        return point, direction, distance, mask, weight

    return closest_on_feature
