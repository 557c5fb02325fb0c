"""Clumps of one template and size share the places of their members in memory; a checkpoint says them of each member."""

import numpy as np

from warpdem import Scene, Simulation
from warpdem.state.clumps import shapes

PAIR = [{"centre": [0, 0, 0], "radius": 1e-3}, {"centre": [1.5e-3, 0, 0], "radius": 0.7e-3}]
ROD = [{"centre": [0, 0, z], "radius": 1e-3} for z in (-1e-3, 0.0, 1e-3)]


def test_members_that_differ_in_one_bit_are_not_shared():
    arm = np.random.default_rng(1).normal(size=(7, 4))
    rows = np.concatenate([arm[:2], arm[2:5], arm[:2], arm[5:7], arm[2:5], arm[:2]])
    rows[-1, 0] = np.nextafter(rows[-1, 0], 1.0)
    count = np.array([2, 3, 2, 2, 3, 2])
    first = np.cumsum(count) - count
    table, begin = shapes(rows, first, count)
    assert len(table) == 2 + 2 + 2 + 3
    assert begin[0] == begin[2] and begin[1] == begin[4] and len(set(begin)) == 4
    for c in range(len(count)):
        np.testing.assert_array_equal(table[begin[c] : begin[c] + count[c]], rows[first[c] : first[c] + count[c]])


def cloud() -> Simulation:
    """Two templates in three groups, and a sphere between them."""
    at = np.stack(np.meshgrid(*[np.arange(3)] * 3, indexing="ij"), axis=-1).reshape(-1, 3) * 8e-3
    groups = [{"clump": "pair", "positions": at[:4].tolist()}, {"radius": 1e-3, "positions": at[4:5].tolist()},
              {"clump": "rod", "positions": at[5:8].tolist()}, {"clump": "pair", "positions": at[8:11].tolist()}]  # fmt: skip
    return Simulation(Scene.model_validate({
        "materials": {"g": {"density": 2500, "young_modulus": 5e6, "poisson_ratio": 0.3}},
        "pairs": [{"materials": ["g", "g"], "restitution": 0.5, "friction": 0.4}],
        "clumps": {"pair": {"spheres": PAIR}, "rod": {"spheres": ROD}},
        "grains": [{"material": "g", **group} for group in groups], "time": {"end": 1, "step": 1e-6},
    }), device="cpu", threads=1)  # fmt: skip


def test_places_of_members_are_kept_once_through_sorting_and_restoring():
    sim = cloud()
    clumps = sim.state.clumps
    assert clumps is not None
    assert len(clumps.arm) == len(PAIR) + len(ROD)
    before = clumps.arrays(sim.state.rank)["clump_arm"]
    assert np.abs(before).max() > 5e-4
    lead = clumps.lead()
    clumps.reorder(np.argsort(-lead, kind="stable"))
    assert len(clumps.arm) == len(PAIR) + len(ROD)
    back = np.argsort(np.argsort(-lead, kind="stable"))
    np.testing.assert_array_equal(clumps.arrays(back)["clump_arm"], before[np.argsort(sim.state.rank)])
