import numpy as np
import pytest
import warp as wp
from scipy.spatial.transform import Rotation
from warpdem.kernels import rotation

EPS = {wp.float32: 1.2e-7, wp.float64: 2.3e-16}
LARGEST = 0.02  # [rad] per step, the bound that the time step sets


def carried(real, *vectors):
    vec3 = wp.types.vector(3, real)
    return np.array([float(x) for x in rotation.build(real)(*(vec3(*(float(x) for x in v)) for v in vectors))])


def unit(v):
    return v / np.linalg.norm(v)


@pytest.mark.parametrize("seed", range(8))
def test_length_is_kept_and_the_result_lies_in_the_new_plane(real, seed):
    rng = np.random.default_rng(seed)
    before = unit(rng.normal(size=3))
    now = unit(before + 0.1 * rng.normal(size=3))
    spring = np.cross(before, rng.normal(size=3))
    mean_turn = rng.normal(size=3)
    mean_turn *= LARGEST / np.linalg.norm(mean_turn)
    new = carried(real, spring, now, before, mean_turn)
    # truncated series: the length errs by phi^6 / 144; the rest is a dozen roundings
    assert abs(np.linalg.norm(new) / np.linalg.norm(spring) - 1) < LARGEST**6 / 144 + 20 * EPS[real]
    assert abs(new @ now) < 20 * EPS[real] * np.linalg.norm(spring)


@pytest.mark.parametrize("angle", [0.0, 1e-6, -1e-3, LARGEST])
def test_two_bodies_turning_about_their_normal_turn_the_spring_by_the_same_angle(real, angle):
    normal = unit(np.array([1.0, 2.0, -2.0]))
    spring = unit(np.cross(normal, [0.0, 0.0, 1.0]))
    new = carried(real, spring, normal, normal, angle * normal)
    exact = Rotation.from_rotvec(angle * normal).apply(spring)
    np.testing.assert_allclose(new, exact, rtol=0, atol=abs(angle) ** 5 / 120 + 6 * EPS[real])


def test_a_swung_normal_takes_the_spring_along_the_shortest_way(real):
    before, now = np.array([0.0, 0.0, 1.0]), np.array([np.sin(0.3), 0.0, np.cos(0.3)])
    for spring in ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]):
        exact = Rotation.from_rotvec([0.0, 0.3, 0.0]).apply(spring)
        np.testing.assert_allclose(carried(real, spring, now, before, (0, 0, 0)), exact, rtol=0, atol=6 * EPS[real])


@pytest.mark.parametrize("seed", range(4))
def test_a_rigid_rotation_of_the_pair_rotates_the_spring(seed):
    """Whole pair turned by a small rotation vector u: swing of the normal and turn about it make that rotation."""
    rng = np.random.default_rng(seed)
    before = unit(rng.normal(size=3))
    spring = unit(np.cross(before, rng.normal(size=3)))
    u = rng.normal(size=3)
    u *= 1e-3 / np.linalg.norm(u)
    rotation = Rotation.from_rotvec(u)
    new = carried(wp.float64, spring, rotation.apply(before), before, u)
    # u . (n + n')/2 is the turn about the mid normal up to |u|^3 / 12 (swing and turn do not commute)
    np.testing.assert_allclose(new, rotation.apply(spring), rtol=0, atol=1e-9)
