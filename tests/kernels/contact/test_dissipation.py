"""What springs lose in a step is just the work of their force, by the trapezoid of its path, that they do not store."""

import functools

import numpy as np
import pytest
import warp as wp
from warpdem.kernels.contact import columns, dissipation, law
from warpdem.kernels.normal import hertz, hooke
from warpdem.kernels.rolling import spring
from warpdem.kernels.tangential import mindlin, mindlin_displacement
from warpdem.kernels.twisting import marshall

DT, RADIUS, INERTIA = 1e-5, 5e-4, 1e-11
N = 4000
STIFFNESS = {hertz: 1e7, hooke: 1e3}


@functools.cache
def kernel(normal, tangential, rolling, twisting):
    """Kernel that takes one contact per thread through two steps; work of the springs' force, and losses, of the second."""
    real, vec3 = wp.float64, wp.vec3d
    joined = law.build(real, normal, tangential, rolling, False, twisting=twisting)
    parts, stored = dissipation.build(real, normal, tangential, rolling, False, twisting=twisting)
    Coefficients, Constants, History, at = joined.Coefficients, joined.Constants, joined.History, dissipation.PARTS_AT

    @wp.kernel(module="unique", enable_backward=False)
    def run(
        overlap: wp.array2d(dtype=real),  # before, at the first and at the second step [m]
        slip: wp.array2d(dtype=vec3),  # of the two steps [m]
        roll: wp.array2d(dtype=vec3),  # and angles [rad]
        c: Coefficients,
        k: Constants,
        out: wp.array2d(dtype=real),
    ):
        p = wp.tid()
        n = vec3(real(0.0), real(0.0), real(1.0))
        dt = real(wp.static(DT))
        radius = real(wp.static(RADIUS))
        inertia = real(wp.static(INERTIA))
        history = History()
        held = real(0.0)
        kept = vec3()
        turning = vec3()
        for s in range(2):
            step = slip[p, s] - n * (overlap[p, s + 1] - overlap[p, s])
            velocity = step / dt
            spin = roll[p, s] / dt
            force, moment, after = joined.force(
                n, n, overlap[p, s + 1], overlap[p, s], velocity, step, vec3(), spin, spin, dt, k, radius, inertia, c, history,
            )  # fmt: skip
            x = parts(
                n, n, overlap[p, s + 1], overlap[p, s], velocity, step, vec3(), spin, dt, k, radius, inertia, c, history,
                force, moment, after,
            )  # fmt: skip
            elastic = force - n * wp.dot(force, n)
            elastic_moment = moment
            for f in range(3):
                elastic[f] = elastic[f] - x[wp.static(at.tangential) + f]
                elastic_moment[f] = elastic_moment[f] - x[wp.static(at.rolling) + f]
            now = stored(overlap[p, s + 1], k, radius, inertia, c, after, dt)
            out[p, 0] = -real(0.5) * (wp.dot(kept + elastic, slip[p, s]) + wp.dot(turning + elastic_moment, roll[p, s]))
            out[p, 1] = now - held
            out[p, 2] = x[wp.static(at.cut_spring)] + x[wp.static(at.cut_angle)]
            out[p, 3] = x[wp.static(at.springs_before)] - x[wp.static(at.springs_now)]
            held = now
            kept = elastic
            turning = elastic_moment
            history = after

    return run


MODELS = {
    "hertz": (hertz, mindlin, None, None), "hooke": (hooke, mindlin, None, None),
    "displacement": (hertz, mindlin_displacement, None, None), "rolling": (hertz, mindlin, spring, None),
    "twisting": (hertz, mindlin, None, marshall),
}  # fmt: skip


@pytest.mark.parametrize("friction", [0.1, 1e4], ids=["slips", "sticks"])
@pytest.mark.parametrize("models", MODELS)
def test_springs_lose_the_work_that_they_do_not_store(models, friction):
    """To round-off, whatever overlap and slip do: contacts that grow, shrink and end, springs that are cut."""
    normal, tangential, rolling, twisting = MODELS[models]
    rng = np.random.default_rng(1)
    overlap = rng.uniform(0.0, 2e-5, (N, 3))
    overlap[: N // 8, 2] = -1e-7  # these end
    slip = rng.normal(0.0, 1e-6, (N, 2, 3)) * [1.0, 1.0, 0.0]
    roll = rng.normal(0.0, 1e-3, (N, 2, 3)) * (rolling is not None or twisting is not None)
    at = columns.coefficients(normal)
    given = {"shear": 0.8, "friction": friction, "rolling_friction": 0.2, "shear_damping": 1.0, "rolling_damping": 0.3}
    made = kernel(normal, tangential, rolling, twisting)
    c = at.vector(wp.float64)(*(given.get(name, 0.0) for name in at.names))
    k = columns.constants(normal).vector(wp.float64)(STIFFNESS[normal], 0.01, 1e6)
    out = wp.zeros((N, 4), dtype=wp.float64, device="cpu")
    arrays = [wp.array(x, dtype=t, device="cpu") for x, t in ((overlap, wp.float64), (slip, wp.vec3d), (roll, wp.vec3d))]
    wp.launch(made, dim=N, inputs=[*arrays, c, k, out], device="cpu")
    work, gained, cut, rescaled = out.numpy().T
    scale = np.abs(work) + np.abs(gained) + np.abs(cut) + np.abs(rescaled)
    assert (np.abs(cut) > 1e-3 * scale).mean() > 0.1 or friction > 1.0, "springs must be cut"
    assert np.abs(rescaled).mean() > 1e-2 * scale.mean()
    np.testing.assert_allclose(work - gained, cut + rescaled, rtol=0, atol=1e-12 * scale.max())
