"""Streams of clumps: whole, counted as bodies, turned as asked, the same again; what a portion cannot be is named."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import warpdem
from warpdem.filling.packing_neighbors import worst_overlaps
from warpdem.filling.stream_grains import expected_count, extreme_grains

ROD = [{"centre": [0, 0, z * 1e-3], "radius": 0.7e-3} for z in range(4)]
PEANUT = [{"centre": [0, 0, 0], "radius": 1e-3}, {"centre": [0, 0, 1.2e-3], "radius": 0.8e-3}]
RODS = {"material": "nut", "clump": "rod", "number_share": 1, "name": "rods"}
PEANUTS = {"material": "husk", "clump": "peanut", "size": 1.2, "orientation": [1, 1, 0, 0], "number_share": 1}
BALLS = {"material": "nut", "diameter": 2e-3, "number_share": 2}


def scene(*recipe, stream=(), **more):
    kinds = ["nut", "husk"]
    box = {"min": [-6e-3, -6e-3, 2e-3], "max": [6e-3, 6e-3, 1.2e-2]}
    return warpdem.Scene.model_validate({
        "materials": {name: {"density": 1000.0, "young_modulus": 1e8, "poisson_ratio": 0.3} for name in kinds},
        "pairs": [{"materials": [a, b], "restitution": 0.5, "friction": 0.3} for a in kinds for b in kinds if a <= b],
        "clumps": {"rod": {"spheres": ROD}, "peanut": {"spheres": PEANUT}},
        "streams": [{
            "box": box, "velocity": [0.0, 0.0, -1.0], "count_rate": 6000.0, "recipe": list(recipe or (RODS, PEANUTS, BALLS)),
            **dict(stream),
        }],
        "gravity": [0.0, 0.0, -9.81], "time": {"end": 0.05, "step": 2e-6}, "output": {"formats": ["vtk"]}, **more,
    })  # fmt: skip


def run(made, steps, **more):
    sim = warpdem.Simulation(made, device="cpu", **{"threads": 1, **more})
    sim.step(steps)
    return sim


def test_clumps_and_spheres_come_whole_and_go_whole_with_the_same_bits_again(tmp_path):
    below = {"name": "below", "box": {"min": [-1.0, -1.0, -1.0], "max": [1.0, 1.0, 1.9e-3]}}
    made = scene(outlets=[below])
    want = run(made, 5000)
    count, mass = want.left["below"]
    clumps, alone = len(want.clumps.id), len(want.particles.id) - want.clumps.members.sum()
    assert count > 5 and set(want.clumps.type) == {0, 1}
    assert clumps + alone + count == want.inlets[0].count > 30
    assert mass + want.particles.mass.sum() == pytest.approx(want.inlets[0].mass, rel=1e-12)
    assert run(made, 5000, threads=2).state_hash() == want.state_hash()
    assert run(scene(outlets=[below], engine={"skin": 2e-4}), 5000).state_hash() == want.state_hash()
    assert run(made, 5000, resident=True).state_hash() == want.state_hash()
    half = run(made, 2600)
    half.save_checkpoint(tmp_path / "half.h5")
    again = warpdem.Simulation.from_checkpoint(tmp_path / "half.h5", device="cpu", threads=1)
    again.step(2400)
    assert again.state_hash() == want.state_hash() and again.left == want.left


def test_all_at_once_they_keep_clear_of_each_other_and_the_books_close():
    """In a laboratory seen from turning axes, where periodic borders of the axis are close."""
    made = scene(
        stream={"count_rate": None, "count": 18, "fixed_to": "laboratory"}, measures={"energy": True, "momentum": True},
        frame={"axis": [0, 0, 1], "rate": 40.0}, borders={"z": {"kind": "periodic", "min": 1e-3, "max": 1.3e-2}},
    )  # fmt: skip
    sim = run(made, 0)
    of = np.where(sim.snapshot().clump >= 0, sim.snapshot().clump, -1)
    assert worst_overlaps(sim.particles.position, sim.particles.radius, of)[0].max() <= 0.0
    assert len(sim.clumps.id) == 10
    np.testing.assert_allclose(sim.clumps.velocity @ [0, 0, 1], -1.0, rtol=1e-12)
    sim.step(1500)
    terms, now, mass = sim.budget.energy(), sim.budget.momentum(), sim.particles.mass.sum()
    assert abs(terms["integration_error"]) < 1e-4 * sum(sim.energy().values())
    for axis in "xyz":
        assert abs(now[f"momentum_{axis} error"]) < 1e-12 * mass
        assert abs(now[f"angular_momentum_{axis} error"]) < 1e-14 * mass


def test_an_orientation_is_that_in_the_axes_of_the_region():
    """Laboratory axes seen from a frame that has turned: by 40 rad/s times 1 ms."""
    late = {"count_rate": None, "count": 3, "start": 1e-3, "fixed_to": "laboratory"}
    sim = run(scene(PEANUTS, stream=late, frame={"axis": [0, 0, 1], "rate": 40.0}), 600)
    assert len(sim.clumps.id) == 3
    w, x, y, z = sim.clumps.orientation[0]
    found = Rotation.from_rotvec([0, 0, 40.0 * sim.time]) * Rotation.from_quat([x, y, z, w])
    np.testing.assert_allclose(found.as_matrix(), Rotation.from_rotvec([np.pi / 2, 0, 0]).as_matrix(), rtol=0, atol=1e-9)
    assert sim.clumps.mass[0] == pytest.approx(sim.inlets[0].mass / sim.inlets[0].count)


def test_members_count_one_by_one_in_what_is_expected():
    made = scene()
    assert expected_count(made, made.streams[0], 0.01) == 60 * (4 + 2 + 2 * 1) // 4
    some = extreme_grains(made)
    assert len(some) == 4 + 2 + 2 and len(some.clumps) == 2
    np.testing.assert_array_equal(some.clumps.of_grain, [0] * 4 + [1] * 2 + [-1] * 2)


@pytest.mark.parametrize(
    ("portion", "reason"),
    [
        ({"clump": "nail"}, r'recipe\[0\].clump.*\n.*no such clump; the scene has "rod", "peanut"'),
        ({"diameter": 1e-3}, r"recipe\[0\].diameter.*\n.*cannot be given with clump"),
        ({"clump": None, "diameter": 1e-3, "size": 2.0}, r"recipe\[0\].size.*\n.*belongs to a clump"),
        ({"clump": None}, r"recipe\[0\].diameter.*\n.*missing: give the diameter of the grains, or a clump"),
        ({"orientation": [0, 0, 0, 0]}, r"orientation.*\n.*must not be zero"),
        ({"orientation": "upright"}, r"orientation.*\n.*random"),
    ],
)
def test_what_a_portion_cannot_be_is_named(portion, reason):
    with pytest.raises(warpdem.SceneError, match=reason):
        scene({**RODS, **portion})


def test_a_region_thinner_than_a_clump_is_named():
    box = {"min": [-6e-3, -6e-3, 2e-3], "max": [6e-3, 6e-3, 5e-3]}
    with pytest.raises(warpdem.SceneError, match=r"streams\[0\].box: its .* 0.003 m must be at least the length"):
        run(scene(stream={"box": box}), 0)
