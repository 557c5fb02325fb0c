import numpy as np
import pytest
import warp as wp
from warpdem.kernels.liquid import bridge_rabinovich as law

from bridges import YOUNG_LAPLACE

PRINTED = {
    (0.001, 0): ((1.0, 0.63155), 0.1),
    (0.001, 30): ((0.86603, 0.54694, 0.09286, 0.02632), 0.126180),
    (0.01, 0): ((1.0, 0.87564, 0.46899, 0.21833, 0.07118), 0.215443),
    (0.01, 30): ((0.86603, 0.40616, 0.18908, 0.06165), 0.271846),
    (0.05, 0): ((1.0, 0.73015, 0.51107, 0.25377), 0.368403),
}
"""Forces over 2 pi R g and rupture distance over R, computed by another program."""


@pytest.mark.parametrize(("volume", "angle", "gaps", "exact", "rupture"), YOUNG_LAPLACE)
def test_force_rupture_and_work_in_closed_form(volume, angle, gaps, exact, rupture):
    cosine, of = np.cos(np.radians(angle)), law.build(wp.float64)
    force = law.force(np.array(gaps), volume, 0.5, 1.0, cosine) / (2.0 * np.pi)
    np.testing.assert_allclose(force, PRINTED[volume, angle][0], rtol=0, atol=6e-6)
    np.testing.assert_allclose(force, exact, rtol=0.45)
    assert law.rupture(volume, 0.5, cosine) == pytest.approx(PRINTED[volume, angle][1], abs=6e-7)
    assert law.rupture(volume, 0.5, cosine) == pytest.approx(rupture, rel=0.04)
    pull = wp.float64(2.0 * np.pi * cosine)
    formed = of.formed(wp.float64(volume), wp.float64(0.5), wp.float64(1.0), wp.float64(cosine))
    np.testing.assert_allclose(
        [float(of.force(wp.float64(gap), pull, formed)) for gap in gaps], force * 2.0 * np.pi, rtol=1e-14
    )
    far, square = (float(x) for x in formed)
    assert far == pytest.approx(law.rupture(volume, 0.5, cosine), rel=1e-14)
    gap = np.linspace(0.0, far, 40_001)
    whole = np.trapezoid(law.force(gap, volume, 0.5, 1.0, cosine), gap)
    assert float(of.work(pull, formed)) == pytest.approx(whole, rel=1e-7)
    assert law.energy(0.0, float(pull), square, far) == pytest.approx(-whole, rel=1e-7)
    assert law.energy(far, float(pull), square, far) == 0.0
