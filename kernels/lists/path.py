"""Path of a grain in flight (``flight``): a parabola, near which the lists know it to be."""

import warp as wp

FAR = 1.0e30  # time or distance without bound [s, m]
Flight = wp.types.vector(12, wp.float64)  # place, velocity, acceleration, allowance [m], first and last step; last < 0: none


@wp.func
def in_flight(flight: wp.array(dtype=Flight), i: int) -> bool:
    """Whether the lists count on the path of grain ``i``; of no grain with an array of size 0."""
    flying = bool(False)
    if flight.shape[0] > 0:
        path = flight[i]
        flying = path[11] >= wp.float64(0.0)
    return flying


@wp.func
def position_at(path: Flight, t: wp.float64) -> wp.vec3d:
    """Place on a path [m] ``t`` [s] after its first step."""
    half = wp.float64(0.5) * t * t
    return wp.vec3d(
        path[0] + path[3] * t + path[6] * half, path[1] + path[4] * t + path[7] * half, path[2] + path[5] * t + path[8] * half
    )


@wp.func
def velocity_at(path: Flight, t: wp.float64) -> wp.vec3d:
    """Velocity on a path [m/s]."""
    return wp.vec3d(path[3] + path[6] * t, path[4] + path[7] * t, path[5] + path[8] * t)


@wp.func
def bend(path: Flight) -> wp.vec3d:
    """Acceleration on a path [m/s2]."""
    return wp.vec3d(path[6], path[7], path[8])
