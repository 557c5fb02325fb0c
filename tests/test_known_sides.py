"""Sides that are known without a search: those that a search finds, for few searches."""

import numpy as np
import pytest
import trimesh

from warpdem.guards.known_sides import KnownSides
from warpdem.mesh.triangle_mesh import load_mesh, signed_distance


@pytest.fixture(scope="module")
def mesh(tmp_path_factory):
    path = tmp_path_factory.mktemp("sides") / "ball.stl"
    trimesh.creation.icosphere(3, 1.0).export(path)
    return load_mesh(path)


@pytest.mark.parametrize("cell", [0.02, 0.1, 0.9])
def test_signs_are_those_of_a_search_and_distances_within_reach_too(mesh, cell):
    asked = []

    def search(points):
        asked.append(len(points))
        return signed_distance(mesh, points)[0]

    rng, bounds = np.random.default_rng(1), np.stack([mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)])
    points = rng.uniform(-1.3, 1.3, (4000, 3))
    points[:500] *= (1.0 + rng.normal(0.0, 0.01, 500) / np.linalg.norm(points[:500], axis=1))[:, None]
    exactly = rng.uniform(0.0, 0.05, len(points))
    sides, true = KnownSides(bounds, cell, search), search(points)
    for _ in range(2):
        asked.clear()
        found = sides.distances(points, exactly)
        assert ((found < 0.0) == (true < 0.0)).all() and (found < 0.0).any() and (found > 0.0).any()
        here = (np.abs(true) <= exactly) & (np.abs(points) <= 1.0).all(axis=1)
        assert here.sum() > 10
        np.testing.assert_array_equal(found[here], true[here])
        inside = np.isfinite(found)
        assert (np.abs(found[inside]) <= np.abs(true[inside]) * (1.0 + 1e-12)).all()
    if cell == 0.1:  # the second time the cells are known: only what is beside the surface is searched for
        assert 0 < sum(asked) < 0.35 * len(points), asked


def test_a_mesh_many_cells_wide_has_larger_cells(mesh):
    bounds = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1e4]])
    sides = KnownSides(bounds, 1e-6, lambda points: np.full(len(points), -1.0))
    assert len(sides._of_centre) < 4e6
    assert (sides.distances(np.array([[0.5, 0.5, 5.0], [0.5, 0.5, 9999.0]]), np.zeros(2)) < 0.0).all()
