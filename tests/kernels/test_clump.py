"""The mass that a force on a member of a clump meets, against its formula."""

import numpy as np
import warp as wp
from warpdem.kernels import MODULE_OPTIONS, clump
from warpdem.kernels.step.clumps import inverse_inertia, member_inverse

of_clumps = clump.build(True)


@wp.kernel(enable_backward=False, module="unique", module_options=MODULE_OPTIONS)
def met(
    axes: wp.mat33d, rate: wp.vec4d, r: wp.vec3d, n: wp.array(dtype=wp.vec3d), out: wp.array(dtype=wp.float64)
):
    i = wp.tid()
    inv = member_inverse(of_clumps.Inverse(), inverse_inertia(axes, rate), r, rate)
    out[i] = of_clumps.inverse_mass(inv, n[i])


def test_the_mass_along_any_normal():
    """1/m_eff = 1/m + (r x n) . I^-1 (r x n)."""
    rng = np.random.default_rng(3)
    axes, r, rate = np.linalg.qr(rng.normal(size=(3, 3)))[0], rng.normal(size=3), rng.uniform(0.5, 2.0, 4)
    n = rng.normal(size=(20, 3))
    n /= np.linalg.norm(n, axis=1)[:, None]
    out = wp.zeros(20, dtype=wp.float64, device="cpu")
    inputs = [wp.mat33d(*axes.ravel()), wp.vec4d(*rate), wp.vec3d(*r), wp.array(n, dtype=wp.vec3d, device="cpu"), out]
    wp.launch(met, 20, inputs, device="cpu")
    lever = np.cross(r, n) @ axes
    np.testing.assert_allclose(out.numpy(), rate[0] + (lever**2) @ rate[1:], rtol=1e-13)
