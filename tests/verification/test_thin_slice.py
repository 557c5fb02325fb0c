"""A periodic slice of a little over two diameters gives what three such slices side by side give."""

import numpy as np
import pytest

from warpdem import SceneError, Simulation
from warpdem.scene.file import scene_from_dict

R, PERIOD = 1e-3, 4.1e-3
STEPS = 1500


def heap():
    """Grains that fall on each other and on a floor in a slice of 2.05 diameters along y, shape (n, 3)."""
    rng = np.random.default_rng(7)
    cells = np.stack(np.meshgrid(np.arange(4), np.arange(1), np.arange(5), indexing="ij"), axis=-1).reshape(-1, 3)
    places = cells * [2.1e-3, 0, 2.1e-3] + [0, 0.5e-3, 1.0e-3]
    return places + rng.uniform([-4e-5, 0, -4e-5], [4e-5, 3e-3, 4e-5], places.shape)


def simulated(copies, **keys):
    places = np.concatenate([heap() + np.array([0, k * PERIOD, 0]) for k in range(copies)])
    sides = (("floor", [0, 0, 0], [0, 0, 1]), ("left", [-1.1e-3, 0, 0], [1, 0, 0]), ("right", [7.4e-3, 0, 0], [-1, 0, 0]))
    walls = [{"name": name, "material": "g", "plane": {"point": at, "normal": normal}} for name, at, normal in sides]
    data = {
        "gravity": [0, 0, -100],
        "materials": {"g": {"density": 2500.0, "young_modulus": 5e6, "poisson_ratio": 0.25}},
        "contact": {"rolling": "constant"},
        "pairs": [{"materials": ["g", "g"], "restitution": 0.5, "friction": 0.5, "rolling_friction": 0.1}],
        "grains": [{"material": "g", "radius": R, "positions": places.tolist()}],
        "walls": walls,
        "borders": {"y": {"min": 0, "max": copies * PERIOD, "kind": "periodic"}},
        "time": {"end": 1.0, "step": 1.5e-5, "max_speed": 0.5},
        **keys,
    }
    return Simulation(scene_from_dict(data), device="cpu", threads=1, resident=keys.get("resident"))


@pytest.fixture(scope="module")
def thin():
    sim = simulated(1)
    sim.step(STEPS)
    return sim


def test_a_thin_slice_is_one_of_three_side_by_side(thin):
    """Grains touch both ways round the slice of 2.05 diameters; a domain of three slices is as thick as any."""
    thick = simulated(3)
    thick.step(STEPS)
    n = len(thin.particles.id)
    contacts, others = thin.contacts(), thick.contacts()
    assert len(contacts.i) >= n and len(others.i) == 3 * len(contacts.i)
    for name in ("velocity", "force"):
        here, there = getattr(thin.particles, name), getattr(thick.particles, name)
        np.testing.assert_allclose(there[:n], here, rtol=0, atol=1e-6 * np.abs(here).max(), err_msg=name)
    place, other = thin.particles.position, thick.particles.position[:n]
    np.testing.assert_allclose(other[:, [0, 2]], place[:, [0, 2]], rtol=0, atol=1e-6 * R)
    way = (other - place)[:, 1] / PERIOD
    np.testing.assert_allclose(way, np.rint(way), rtol=0, atol=1e-6)


def test_pairs_near_both_ways_round_are_listed_once():
    """A skin far beyond the gap: most pairs are near in two images; and in all directions of a cube."""
    borders = {axis: {"min": 0, "max": PERIOD, "kind": "periodic"} for axis in "xyz"}
    grains = [{"material": "g", "radius": R, "positions": [[0, 0, 0], [1.99e-3, 0.1e-3, 0], [1e-4, 2.2e-3, 1e-3]]}]
    sim = simulated(1, borders=borders, grains=grains, walls=[], engine={"skin": 1.5e-3}, gravity=[0, 0, 0])
    contacts = sim.contacts()
    assert list(zip(contacts.i, contacts.j, strict=True)) == [(0, 1)]
    outer = sim.lists.outer
    start, count, slot = (array.numpy() for array in (outer.start, outer.neighbors, outer.slot))
    for row in range(3):
        listed = slot[start[row] : start[row] + count[row]].tolist()
        assert len(set(listed)) == len(listed)
    assert count.sum() == 6


def test_bits_of_a_thin_slice_do_not_depend_on_skin_or_executor(thin):
    other = simulated(1, engine={"skin": 3e-4})
    other.step(STEPS)
    assert other.lists.rebuilds != thin.lists.rebuilds
    assert other.state_hash() == thin.state_hash()


def test_a_slice_in_which_a_grain_would_touch_two_images_is_refused():
    with pytest.raises(SceneError, match=r"borders\.y: its length of 0\.00405 m is below 2\.05 diameters"):
        simulated(1, borders={"y": {"min": 0, "max": 4.05e-3, "kind": "periodic"}})
