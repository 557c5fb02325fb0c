import pytest
from warpdem.kernels.tangential import mindlin_displacement


@pytest.mark.parametrize(("overlap", "before"), [(4e-5, 1e-5), (1e-5, 4e-5), (0.0, 1e-5), (1e-5, -1e-5)])
def test_the_whole_displacement_is_kept_whatever_the_overlap_does(real, overlap, before):
    assert float(mindlin_displacement.build(real)(real(overlap), real(before))) == 1.0
