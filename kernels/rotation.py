"""How a vector of the contact plane is carried from one step to the next.

The rotation that takes the old normal n' to the new one n along the shortest way,

    s <- s - (n . s) / (1 + n . n') (n + n'),      s across n',

followed by a rotation about n by the angle phi = dt (w_i + w_j)/2 . (n + n')/2: a spring stretched between two bodies that
rotate together about their common normal rotates with them. Projection on the tangent plane alone, as most codes do, makes
friction depend on the frame of reference. sin and cos of phi are taken to phi^4 (phi stays below 0.02 by the time step).
"""

import functools

import warp as wp


@functools.cache
def build(real):
    """Return the carrying function for ``real``."""
    vec3 = wp.types.vector(3, real)

    @wp.func
    def carried(vector: vec3, normal: vec3, normal_before: vec3, rotation: vec3) -> vec3:
        """``vector`` in the new tangent plane; ``rotation`` is the mean rotation of the two bodies over the step [rad]."""
        both = normal + normal_before
        swung = vector - both * (wp.dot(normal, vector) / (real(1.0) + wp.dot(normal, normal_before)))
        angle = real(0.5) * wp.dot(rotation, both)
        square = angle * angle
        sine = angle * (real(1.0) - square * real(0.16666666666666666))
        cosine = real(1.0) - square * (real(0.5) - square * real(0.041666666666666664))
        return swung * cosine + wp.cross(normal, swung) * sine

    return carried
