"""The benchmark of clumps on a tiny bed made here."""

import numpy as np
import pytest

from bench import clumps


@pytest.mark.slow
def test_free_spheres_lie_where_the_clumps_have_them_and_keep_their_contacts(tmp_path):
    report = clumps.bench(30, warm=2, steps=2, repeats=1, launches=2, settle=15_000, work=tmp_path)
    bodies, free = report["beds"]
    assert bodies["spheres"] == free["spheres"] == 90 and free["over_spheres"] == 1.0
    assert free["contacts_per_sphere"][1] > 0.3
    assert bodies["contacts_per_sphere"][0] == pytest.approx(free["contacts_per_sphere"][0], abs=0.05)
    assert set(free["phases_us"]) == {"pairs", "walls", "motion"} and min(free["phases_us"].values()) > 0.0


def test_the_spheres_of_a_clump_are_no_neighbors():
    corners = clumps.template()
    apart = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1) - 2.0 * clumps.RADIUS
    np.testing.assert_allclose(apart, clumps.GAP)
    assert clumps.SKIN < clumps.GAP
    assert clumps.deck(10, 1, 1).count("particles_in_region 10") == 1
