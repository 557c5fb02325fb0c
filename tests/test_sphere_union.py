"""Mass properties of unions of spheres against closed forms, and against themselves turned and moved."""

import numpy as np
import pytest

from warpdem.mesh.sphere_union import union_of_spheres

BALL = 4.0 / 3.0 * np.pi


@pytest.mark.parametrize(
    ("distance", "volume", "across", "along"),
    [(1.0, 1.6875, 0.7375, 0.425), (1.5, 1.9140625, 1.001875, 0.41125), (2.0, 2.0, 1.4, 0.4)],
)
@pytest.mark.parametrize("axis", [(0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.36, 0.48, 0.8)])
def test_two_equal_spheres(distance, volume, across, along, axis):
    ends = 1e-3 * np.array([[0.1, 0.2, 0.3], np.array([0.1, 0.2, 0.3]) + distance * np.array(axis)])
    found = union_of_spheres(ends, np.full(2, 1e-3))
    assert found.volume == pytest.approx(volume * BALL * 1e-9, rel=1e-12)
    np.testing.assert_allclose(found.centre, ends.mean(axis=0), rtol=0, atol=1e-15)
    outer = np.outer(axis, axis)
    expected = across * (np.eye(3) - outer) + along * outer
    np.testing.assert_allclose(found.inertia / (found.volume * 1e-6), expected, rtol=0, atol=1e-12)


def test_two_unequal_spheres():
    found = union_of_spheres(np.array([[0, 0, 0], [0, 0, 1.1e-3]]), np.array([1e-3, 0.6e-3]))
    assert found.volume == pytest.approx(4.84069448035062e-9, rel=1e-12)
    assert found.centre[2] == pytest.approx(1.6524926686217e-4, rel=1e-12)
    assert found.inertia[0, 0] == pytest.approx(2.60158597349863e-15, rel=1e-12)
    assert found.inertia[2, 2] == pytest.approx(1.77975565894592e-15, rel=1e-12)


def test_spheres_within_others_and_equal_ones_count_once():
    one = union_of_spheres(np.zeros((1, 3)), np.ones(1))
    many = union_of_spheres(np.array([[0, 0, 0], [0, 0, 0], [0.2, 0.1, 0], [0, 0, 0.5]]), np.array([1.0, 1.0, 0.5, 0.5]))
    assert many.volume == pytest.approx(one.volume, rel=1e-13)
    np.testing.assert_allclose(many.inertia, one.inertia, rtol=0, atol=1e-12)
    np.testing.assert_allclose(one.inertia, 0.4 * BALL * np.eye(3), rtol=0, atol=1e-12)


def test_spheres_apart_add_up():
    centre, radius = np.array([[0.0, 0, 0], [3.0, 0, 0.5], [0, 4.0, 1.0]]), np.array([1.0, 0.5, 1.5])
    volume = BALL * radius**3
    middle = volume @ centre / volume.sum()
    arm = centre - middle
    inertia = sum(
        v * (0.4 * r**2 * np.eye(3) + (a @ a) * np.eye(3) - np.outer(a, a)) for v, r, a in zip(volume, radius, arm, strict=True)
    )
    found = union_of_spheres(centre, radius)
    assert found.volume == pytest.approx(volume.sum(), rel=1e-13)
    np.testing.assert_allclose(found.inertia, inertia, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("count", [3, 5, 12])
def test_the_slices_do_not_show(count):
    """Clusters with triple points: the same body turned and moved has the same mass properties."""
    rng = np.random.default_rng(count)
    centre, radius = rng.normal(size=(count, 3)) * 0.45, rng.uniform(0.5, 1.0, count)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    first = union_of_spheres(centre, radius)
    second = union_of_spheres(centre @ turn.T + [3.0, -2.0, 1.0], radius)
    assert second.volume == pytest.approx(first.volume, rel=1e-12)
    np.testing.assert_allclose(second.centre, turn @ first.centre + [3.0, -2.0, 1.0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(second.inertia, turn @ first.inertia @ turn.T, rtol=0, atol=1e-11)
    assert first.volume < (BALL * radius**3).sum() * 0.95, "they overlap"
    points = rng.uniform(-3.5, 3.5, (200_000, 3))
    hit = (np.linalg.norm(points[:, None] - centre, axis=2) < radius).any(axis=1).mean() * 343.0
    assert hit == pytest.approx(first.volume, rel=0.05)
