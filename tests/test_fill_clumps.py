"""Fillings of clumps: whole, without overlap, inside, turned at random, the same again."""

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

import warpdem
from warpdem.filling.initial_grains import load_grains
from warpdem.filling.packing_neighbors import worst_overlaps
from warpdem.filling.packing_run import OVERLAP
from warpdem.mesh.triangle_mesh import signed_distance
from warpdem.model.walls import load_meshes

PEANUT = [{"centre": [0, 0, 0], "radius": 1e-3}, {"centre": [0, 0, 1.2e-3], "radius": 0.8e-3}]
ROD = [{"centre": [0, 0, z * 1e-3], "radius": 0.7e-3} for z in range(4)]
BOX = {"min": [0, 0, 0], "max": [1.5e-2, 1.5e-2, 1.5e-2]}


def scene(fill, spheres=PEANUT, *, more=(), **keys):
    return warpdem.Scene.model_validate({
        "materials": {"nut": {"density": 1000.0, "young_modulus": 5e6, "poisson_ratio": 0.3}},
        "pairs": [{"materials": ["nut", "nut"], "restitution": 0.5}],
        "clumps": {"c": {"spheres": spheres}},
        "grains": [{"material": "nut", "clump": "c", "fill": {"box": BOX, **fill}}, *more],
        "time": {"end": 1.0}, "output": {"formats": ["vtk"]}, **keys,
    })  # fmt: skip


def check_whole(grains):
    """Members stand where their clump says, and none overlaps another clump or sphere."""
    clumps = grains.clumps
    member = clumps.of_grain >= 0
    there = clumps.position[clumps.of_grain[member]] + clumps.arms()
    np.testing.assert_allclose(grains.position[member], there, rtol=0, atol=1e-15)
    assert worst_overlaps(grains.position, grains.radius, clumps.of_grain)[0].max() <= OVERLAP


@pytest.mark.parametrize(("spheres", "fraction"), [(PEANUT, 0.55), (ROD, 0.4)])
def test_a_box_is_filled_to_the_fraction_that_is_asked_for(spheres, fraction):
    grains = load_grains(scene({"solid_fraction": fraction}, spheres), {})
    check_whole(grains)
    solid = grains.clumps.mass.sum() / 1000.0 / 1.5e-2**3
    assert solid == pytest.approx(fraction, abs=0.5 * grains.clumps.mass[0] / 1000.0 / 1.5e-2**3 + 1e-9)
    assert (grains.position - grains.radius[:, None]).min() > -1e-9
    assert (grains.position + grains.radius[:, None]).max() < 1.5e-2 + 1e-9
    assert not grains.velocity.any()


@pytest.mark.slow
def test_dumbbells_pack_denser_than_spheres():
    """In the middle of a filling, which knows no friction: 0.714 of dumbbells 1.4 long; fillings of spheres reach 0.61."""
    dumbbell = [{"centre": [0, 0, z], "radius": 5e-4} for z in (0.0, 4e-4)]
    grains = load_grains(scene({"solid_fraction": 0.68, "seed": 1}, dumbbell), {})
    check_whole(grains)
    points = np.random.default_rng(0).uniform(2.5e-3, 1.25e-2, (40_000, 3))
    distance, _ = cKDTree(grains.position).query(points)
    assert (distance < 5e-4).mean() > 0.70, "spheres reach 0.61"


def test_directions_are_random_and_the_same_again():
    first, again, other = (load_grains(scene({"count": 300, "seed": seed}), {}) for seed in (3, 3, 4))
    np.testing.assert_array_equal(first.position, again.position)
    np.testing.assert_array_equal(first.clumps.turn, again.clumps.turn)
    assert (first.clumps.turn != other.clumps.turn).any()
    axis = first.clumps.matrices[:, :, 2]
    np.testing.assert_allclose(axis.mean(axis=0), 0.0, rtol=0, atol=4.0 / np.sqrt(3 * 300))
    np.testing.assert_allclose((axis**2).mean(axis=0), 1.0 / 3.0, rtol=0, atol=4.0 * 0.3 / np.sqrt(300))


def test_few_clumps_stay_aligned():
    grains = load_grains(scene({"count": 5, "orientation": "aligned"}), {})
    np.testing.assert_allclose(np.abs(grains.clumps.matrices[:, 2, 2]), 1.0, rtol=0, atol=0.05)


def test_amounts_and_sizes():
    one = load_grains(scene({"count": 1}), {}).clumps
    grains = load_grains(scene({"mass": 20.2 * 0.5**3 * one.mass[0], "size": 0.5}), {})
    assert len(grains.clumps) == 20
    np.testing.assert_allclose(grains.clumps.mass, one.mass[0] / 8.0)
    np.testing.assert_allclose(np.unique(grains.radius), [0.4e-3, 0.5e-3])


def test_sizes_of_a_distribution_stay_with_their_clumps():
    fill = {"solid_fraction": 0.4, "size": {"uniform": [0.5, 1.5]}, "seed": 2}
    grains = load_grains(scene(fill), {})
    check_whole(grains)
    clumps = grains.clumps
    size = grains.radius[clumps.first] / 1e-3
    assert size.min() < 0.6
    assert size.max() > 1.4
    one = load_grains(scene({"count": 1}), {}).clumps.mass[0]
    np.testing.assert_allclose(clumps.mass, one * size**3)
    arm = np.linalg.norm(grains.position[clumps.first + 1] - grains.position[clumps.first], axis=1)
    np.testing.assert_allclose(arm, 1.2e-3 * size)
    assert clumps.mass.sum() == pytest.approx(0.4 * 1.5e-2**3 * 1000.0, rel=0.01)
    two = load_grains(scene({"count": 40, "size": {"table": [[0.5, 1], [1.0, 3]]}}), {}).clumps.mass / one
    assert sorted(set(np.round(two, 12))) == [0.125, 1.0]
    assert 22 <= (two > 0.5).sum() <= 38


def test_few_clumps_keep_the_orientation_they_are_given():
    half = np.sqrt(0.5)
    grains = load_grains(scene({"count": 5, "orientation": [2 * half, 2 * half, 0, 0]}), {})
    along = np.diff(grains.position.reshape(5, 2, 3), axis=1)[:, 0]  # z of the clump is -y of the frame
    np.testing.assert_allclose(along / 1.2e-3, np.tile([0.0, -1.0, 0.0], (5, 1)), rtol=0, atol=0.05)


def test_clumps_and_spheres_fill_one_space():
    spheres = {"material": "nut", "fill": {"box": BOX, "solid_fraction": 0.2, "diameter": 1.2e-3}}
    held = {"material": "nut", "clump": "c", "positions": [[7.5e-3, 7.5e-3, 7.5e-3]]}
    grains = load_grains(scene({"solid_fraction": 0.3}, more=[spheres, held]), {})
    check_whole(grains)
    assert (grains.clumps.of_grain < 0).sum() > 500
    np.testing.assert_allclose(grains.clumps.position[-1], 7.5e-3)


def test_a_mesh_is_filled(tmp_path):
    mesh = trimesh.creation.cylinder(radius=1e-2, height=1.5e-2, sections=24)
    mesh.apply_transform(trimesh.transformations.rotation_matrix(0.7, [1, 0.5, 0]))
    mesh.export(tmp_path / "can.stl")
    can = {"name": "can", "mesh": "can.stl", "material": "nut"}
    made = scene({"box": None, "wall": "can", "solid_fraction": 0.45}, ROD, walls=[can], base=tmp_path)
    meshes = load_meshes(made)
    grains = load_grains(made, meshes)
    check_whole(grains)
    assert (signed_distance(meshes["can"], grains.position)[0] + grains.radius).max() <= 1e-9


def test_a_filled_scene_runs():
    floor = {"name": "floor", "material": "nut", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}
    sim = warpdem.Simulation(scene({"count": 40}, walls=[floor]), device="cpu", threads=1)
    sim.step(50)
    assert len(sim.clumps.id) == 40
    assert sim.clumps.velocity[:, 2].mean() < 0.0


@pytest.mark.parametrize(
    ("fill", "more", "reason"),
    [
        ({"solid_fraction": 0.9}, {}, "less than or equal|0.74"),
        ({"count": 2, "diameter": 1e-3}, {}, "cannot be given with clump"),
        ({"mass": 1e-12}, {}, "less than half of one"),
        ({"count": 20000}, {}, "clumps in .* a solid fraction of"),
        ({"count": 1, "size": 5.0}, {}, "no position found"),
        ({"count": 1, "size": {"uniform": [2.0, 1.0]}}, {}, "must not be above the second"),
        ({"count": 1, "size": {"table": [[1.0, 0.0]]}}, {}, "must not all be 0"),
        ({"count": 1, "size": {}}, {}, "uniform"),
        ({"count": 1, "orientation": [0, 0, 0, 0]}, {}, "must not be zero"),
        ({"count": 1, "orientation": "upright"}, {}, "orientation"),
    ],
)
def test_wrong_fillings_are_named(fill, more, reason):
    with pytest.raises(warpdem.SceneError, match=reason):
        load_grains(scene(fill, **more), {})


def test_too_many_clumps_end_in_words():
    with pytest.raises(warpdem.SceneError, match=r"fill: asked for solid fraction 0.7\d+ \(\d+ clumps\): overlaps of"):
        load_grains(scene({"box": {"min": [0, 0, 0], "max": [6e-3, 6e-3, 6e-3]}, "solid_fraction": 0.7}), {})


@pytest.mark.parametrize("key", [{"size": 2.0}, {"orientation": "random"}, {"diameter": None}])
def test_a_filling_of_spheres_needs_its_own_keys(key):
    spheres = {"material": "nut", "fill": {"box": BOX, "count": 1, "diameter": 1e-3, **key}}
    with pytest.raises(warpdem.SceneError, match="clump"):
        scene({"count": 1}, more=[spheres])
