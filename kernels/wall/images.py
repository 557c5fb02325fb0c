"""Walls at their periodic images: which of them a grain meets, and where it stands beside it.

A wall stays where it is; a grain sees it from all its own images. A candidate is the pair of a feature and an image of the
grain, numbered image * features + feature, so that image 0, the grain where it is, comes first; each wall says for which
images it counts (``Surface.images``, a bit for each). Contact points stay those of the wall: their history goes on
when the grain comes round a border.

Grains are wrapped between two makings of the lists. So a candidate is listed if the grain may reach it from where it is, or
from the position that it is wrapped to.
"""

import functools

import warp as wp
from warpdem.kernels import KernelSet
from warpdem.kernels.step.schedule import Placement, local
from warpdem.kernels.wall.surface import Surface


@functools.cache
def build(closest_on_feature, border, *, repeated: bool):
    """Return the functions of candidates; where no wall is ``repeated``, these are the features themselves.

    Args:
        closest_on_feature: of ``feature.build``.
        border: periodic images, of ``border.build``.
        repeated: walls are seen from the images of a grain.
    """
    images = border.images if repeated else 1

    @wp.func
    def features(surface: Surface) -> int:
        return surface.triangles + surface.analytic

    @wp.func
    def feature_of(surface: Surface, candidate: int) -> int:
        """Number of the feature of a candidate."""
        f = candidate
        if wp.static(images > 1):
            f = candidate % features(surface)
        return f

    @wp.func
    def image_of(surface: Surface, candidate: int) -> int:
        """Number of the image of the grain."""
        k = int(0)
        if wp.static(images > 1):
            k = candidate / features(surface)
        return k

    @wp.func
    def candidate_of(surface: Surface, f: int, image: int) -> int:
        """Number of the candidate."""
        c = f
        if wp.static(images > 1):
            c = image * features(surface) + f
        return c

    @wp.func
    def counts(surface: Surface, wall: int, image: int) -> bool:
        """Whether a wall is seen from an image of the grain."""
        if wp.static(images > 1):
            return (surface.images[wall] >> image) & 1 == 1
        return True

    @wp.func
    def seen(q: wp.vec3d, image: int) -> wp.vec3d:
        """The grain's image [m]."""
        s = q
        if wp.static(images > 1):
            s = border.image(q, image)
        return s

    @wp.func
    def nearest_displacement(displacement: wp.vec3d) -> wp.vec3d:
        """Displacement of a wall over a step [m], without the period that it may have been brought back by in it."""
        w = displacement
        if wp.static(images > 1):
            w = border.nearest(displacement)
        return w

    @wp.func
    def reached(
        surface: Surface, placement: Placement, candidate: int, q: wp.vec3d, radius: wp.float64, cutoff: wp.float64,
        travel: wp.float64,
    ) -> int:  # fmt: skip
        """Number of the first position, of where a grain is and may come round to, that reaches a candidate; else -1."""
        f = feature_of(surface, candidate)
        position = seen(q, image_of(surface, candidate))
        for around in range(wp.static(images)):
            near = bool(True)
            if wp.static(images > 1):
                near = border.may_cross(q, around, travel)
            if near:
                point, direction, distance, mask, weight = closest_on_feature(
                    surface, f, local(placement, seen(position, around)), radius, cutoff
                )
                if distance < cutoff:
                    return around
        return -1

    return KernelSet(
        features=features, feature_of=feature_of, image_of=image_of, candidate_of=candidate_of, counts=counts, seen=seen,
        nearest_displacement=nearest_displacement, reached=reached, images=images,
    )  # fmt: skip
