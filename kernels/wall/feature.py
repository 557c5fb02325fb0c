"""Closest point of any feature of the walls: a triangle of a mesh or one of the analytic shapes.

A triangle takes the plane of its whole flat piece where the foot on that plane lies on it, so a flat floor of 2 or 20 000
triangles gives one height.
"""

import functools

import warp as wp
from warpdem.kernels.wall import plane, revolved, sphere
from warpdem.kernels.wall.surface import Surface
from warpdem.kernels.wall.triangle import FACE, closest_point

FLAT = 1.0e-6  # lateral distance to the plane's foot, in radii, below which a hit counts as a hit of the plane


@functools.cache
def build(meshes: bool, planes: bool, revolutions: bool, spheres: bool):
    """Return the function of a feature's closest point for walls that are made of these kinds of shapes."""

    @wp.func
    def closest_on_feature(surface: Surface, f: int, q: wp.vec3d, radius: wp.float64, cutoff: wp.float64):
        """Closest point of feature ``f`` to body point ``q`` [m], unit direction to q, distance [m], corner mask, weight [-].

        A distance of ``cutoff`` or more is only known to be so. The weight is 1 for a full contact, see ``revolved``.
        """
        point = wp.vec3d()
        direction = wp.vec3d()
        distance = cutoff
        mask = int(wp.static(FACE))
        weight = wp.float64(1.0)
        k = f - surface.triangles  # number among the analytic shapes
        if wp.static(meshes or planes):
            if k < surface.planes:
                foot, normal, height = plane.closest(q, surface.plane[f])
                point = foot
                direction = normal
                distance = height
                if wp.static(meshes):
                    if k < 0:
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
        if wp.static(revolutions):
            r = k - surface.planes
            if r >= 0 and r < surface.revolutions:
                nearest, towards, apart, part = revolved.closest(q, radius, surface.revolved[r])
                point = nearest
                direction = towards
                distance = apart
                weight = part
        if wp.static(spheres):
            b = k - surface.planes - surface.revolutions
            if b >= 0:
                nearest, towards, apart = sphere.closest(q, surface.ball[b])
                point = nearest
                direction = towards
                distance = apart
        return point, direction, distance, mask, weight

    return closest_on_feature
