"""Kernels that call one model once, so that its functions run as they do in the engine."""

import functools

import warp as wp

RTOL = {wp.float32: 1e-6, wp.float64: 1e-14}
"""A few roundings of one product chain."""


@functools.cache
def _normal(model, real):
    constants, force = model.build(real)

    @wp.kernel(module="unique", enable_backward=False)
    def force_probe(overlap: real, speed: real, stiffness: real, damping: real, out: wp.array(dtype=real)):
        f_n, k_n, gamma_n = force(overlap, speed, stiffness, damping)
        out[0] = f_n
        out[1] = k_n
        out[2] = gamma_n

    @wp.kernel(module="unique", enable_backward=False)
    def constants_probe(base: real, damping: real, radius: real, mass: real, out: wp.array(dtype=real)):
        k, c = constants(base, damping, radius, mass)
        out[0] = k
        out[1] = c

    return force_probe, constants_probe


def _launch(kernel, real, inputs):
    out = wp.zeros(3, dtype=real, device="cpu")
    wp.launch(kernel, dim=1, inputs=[*inputs, out], device="cpu")
    return [float(x) for x in out.numpy()]


def normal_force(model, real, overlap, speed, stiffness, damping=0.0):
    """Normal force [N], k_n [N/m] and gamma_n [N s/m] of a normal model."""
    return _launch(_normal(model, real)[0], real, [overlap, speed, stiffness, damping])


def normal_constants(model, real, base, damping, radius, mass):
    """Stiffness and damping of a contact under a normal model."""
    return _launch(_normal(model, real)[1], real, [base, damping, radius, mass])[:2]


@functools.cache
def _rolling(model, real):
    vec3 = wp.types.vector(3, real)
    torque = model.build(real)

    @wp.kernel(module="unique", enable_backward=False)
    def kernel(
        spin: vec3, spin_predicted: vec3, angle: vec3, limit: real, spring: real, damping: real, inertia: real,
        dt: real, moment_out: wp.array(dtype=vec3), angle_out: wp.array(dtype=vec3),
    ):  # fmt: skip
        moment, held = torque(spin, spin_predicted, angle, limit, spring, damping, inertia, dt)
        moment_out[0] = moment
        angle_out[0] = held

    return kernel


def rolling(model, real, spin, spin_predicted, angle, *numbers):
    """Torque [N m] and rolling spring [rad] of a rolling model."""
    vec3 = wp.types.vector(3, real)
    out = [wp.zeros(1, dtype=vec3, device="cpu") for _ in range(2)]
    vectors = [vec3(*(float(x) for x in v)) for v in (spin, spin_predicted, angle)]
    wp.launch(_rolling(model, real), dim=1, inputs=[*vectors, *numbers, *out], device="cpu")
    return [x.numpy()[0].astype(float) for x in out]
