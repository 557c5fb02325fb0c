"""The mass that a force on a member of a clump meets, and what contacts make of it, against their formulas."""

import numpy as np
import warp as wp
from warpdem.kernels import MODULE_OPTIONS, clump
from warpdem.kernels.contact import law, pairs
from warpdem.kernels.normal import hertz
from warpdem.kernels.step import border
from warpdem.kernels.step.clumps import BODY, Body, inverse_inertia, member_response

of_clumps = clump.build(True)


@wp.kernel(enable_backward=False, module="unique", module_options=MODULE_OPTIONS)
def met(
    axes: wp.mat33d, rate: wp.vec4d, r: wp.vec3d, n: wp.array(dtype=wp.vec3d), out: wp.array(dtype=wp.float64)
):
    i = wp.tid()
    body = Body()
    body[wp.static(BODY.inverse_mass)] = rate[0]
    j = inverse_inertia(axes, rate)
    for k in range(6):
        body[wp.static(BODY.response) + k] = wp.vector(j[0, 0], j[0, 1], j[0, 2], j[1, 1], j[1, 2], j[2, 2])[k]
    response = member_response(body, r)
    inv = of_clumps.Inverse()
    for k in range(6):
        inv[2 + k] = response[k]
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


def test_a_contact_of_clumps_has_the_constants_of_its_mass_along_the_normal():
    """K = base sqrt(R*), C = damping sqrt(m_eff K) and 1/m_eff = n . (B_i + B_j) n."""
    of = law.build(wp.float64, hertz, None, None, False)
    made = pairs.build(wp.float64, of, None, border.build((0.0,) * 3, (0.0,) * 3), spins=True, gap=0.0, clumps=True)

    @wp.kernel(enable_backward=False, module="unique", module_options=MODULE_OPTIONS)
    def constants(
        gi: made.grain.Record, gj: made.grain.Record, inverse: made.clumps.Inverse, c: made.Coefficients,
        out: wp.array(dtype=of.Constants),
    ):  # fmt: skip
        radius = made.reduced_radius(gi, gj)
        out[0] = made.constants_of_clumps(gi, gj, inverse, radius, made.cast_coefficients(c))

    rng = np.random.default_rng(4)
    gi, gj, b = rng.normal(size=16), rng.normal(size=16), rng.normal(size=(3, 3))
    gi[3], gj[3] = 0.2, 0.3
    b = b @ b.T
    inverse = [7.0, 8.0, b[0, 0], b[0, 1], b[0, 2], b[1, 1], b[1, 2], b[2, 2]]
    c = made.Coefficients()
    c[of.at.stiffness], c[of.at.damping] = 5.0, 0.7
    out = wp.zeros(1, dtype=of.Constants, device="cpu")
    given = made.grain.Record(*gi), made.grain.Record(*gj), made.clumps.Inverse(*inverse)
    wp.launch(constants, 1, [*given, c, out], device="cpu")
    n = (gi[:3] - gj[:3]) / np.linalg.norm(gi[:3] - gj[:3])
    along, stiffness = n @ b @ n, 5.0 * np.sqrt(0.12)
    np.testing.assert_allclose(out.numpy()[0], [stiffness, 0.7 * np.sqrt(stiffness / along), along], rtol=1e-14)
