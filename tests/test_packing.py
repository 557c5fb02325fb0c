import numpy as np
import pytest
import trimesh

from warpdem.core.threads import Threads
from warpdem.errors import SceneError
from warpdem.filling import fill_request, packing_neighbors, packing_run, packing_walls
from warpdem.filling.fill_region import closed_region
from warpdem.filling.fill_request import filling
from warpdem.filling.packing import fill, pack
from warpdem.filling.packing_neighbors import worst_overlaps
from warpdem.mesh.clipped_volume import clipped_volume
from warpdem.mesh.triangle_mesh import build_mesh, signed_distance
from warpdem.scene.size_distribution import DiameterDistribution, size_law

CUBE = np.array([[0.0, 0.0, 0.0], [0.01, 0.01, 0.01]])
SMALLEST, LARGEST = 0.5e-3, 1e-3
SIZES = DiameterDistribution(uniform=(SMALLEST, LARGEST))


def ball(radius=0.01):
    """A closed mesh of a ball about the origin."""
    return build_mesh(radius * np.array(trimesh.creation.icosphere(subdivisions=3).triangles))


def overlap_by_brute_force(position, radius):
    """Largest overlap of each grain as a share of the smaller radius, none as 0."""
    apart = np.linalg.norm(position[:, None] - position[None], axis=2)
    share = (radius[:, None] + radius[None] - apart) / np.minimum(radius[:, None], radius[None])
    np.fill_diagonal(share, 0.0)
    return np.maximum(share.max(axis=1), 0.0)


def solid_volume(radius):
    return 4.0 / 3.0 * np.pi * (radius**3).sum()


@pytest.mark.parametrize("fraction", [0.1, 0.56])
def test_box_is_filled_to_the_solid_fraction_without_overlap(fraction):
    position, radius = fill(None, CUBE, SIZES, 7, solid_fraction=fraction)
    # one grain more or less is the closest that whole grains allow
    assert abs(solid_volume(radius) / 1e-6 - fraction) <= 0.5 * np.pi / 6.0 * LARGEST**3 / 1e-6
    assert overlap_by_brute_force(position, radius).max() <= packing_run.OVERLAP
    assert (position >= radius[:, None]).all()
    assert (position <= 0.01 - radius[:, None]).all()
    assert radius.min() > 0.25e-3
    assert radius.max() < 0.5e-3


@pytest.mark.parametrize(("count", "fraction"), [(500, 0.58), (5000, 0.6)])
def test_dense_fillings_of_nearly_equal_grains(count, fraction):
    law = size_law(DiameterDistribution(uniform=(0.9, 1.1)))
    side = (count * law.mean_volume / fraction) ** (1.0 / 3.0)
    asked = filling(closed_region(None, [[0] * 3, [side] * 3], "fill"), law, 1, solid_fraction=fraction)
    [position], [took] = pack([asked])
    assert abs(asked.solid_fraction - fraction) < 2e-3
    assert worst_overlaps(position, asked.radius)[0].max() <= packing_run.OVERLAP
    assert (position >= asked.radius[:, None]).all()
    assert (position <= side - asked.radius[:, None]).all()
    # shaking is what reaches the small one, where walls matter more
    assert (took.shakes > 0) == (count == 500)
    assert (took.keys, took.grains) == (("fill",), len(asked.radius))
    assert took.steps > packing_run.GROWING_STEPS
    assert took.rebuilds > 10


def test_count_gives_as_many_grains_and_one_diameter_equal_ones():
    position, radius = fill(None, CUBE, 1e-3, 0, count=123)
    assert position.shape == (123, 3)
    np.testing.assert_array_equal(radius, 0.5e-3)


def test_sizes_are_uniform_by_number():
    _, radius = fill(None, 10 * CUBE, SIZES, 5, count=4000)
    # mean and deviation of a uniform distribution, within 4 standard errors
    width = 0.25e-3
    assert abs(radius.mean() - 0.375e-3) < 4 * width / np.sqrt(12 * 4000)
    assert abs(radius.std() - width / np.sqrt(12)) < 4 * width / np.sqrt(12 * 4000)


def test_same_seed_gives_the_same_bits_and_another_seed_other_grains():
    one, two, other = (fill(ball(), None, SIZES, seed, count=800) for seed in (3, 3, 4))
    assert one[0].tobytes() == two[0].tobytes()
    assert one[1].tobytes() == two[1].tobytes()
    assert (one[1] != other[1]).all()
    assert (one[0] != other[0]).all()


def test_sizes_do_not_depend_on_the_space():
    in_ball = fill(ball(), None, SIZES, 3, count=300)[1]
    in_box = fill(None, CUBE, SIZES, 3, count=300)[1]
    assert in_ball.tobytes() == in_box.tobytes()
    # a solid fraction only decides how many are drawn
    by_fraction = fill(None, CUBE, SIZES, 3, solid_fraction=0.05)[1]
    assert 200 < len(by_fraction) < 300
    np.testing.assert_array_equal(by_fraction, in_box[: len(by_fraction)])


def test_mesh_clipped_by_a_region_is_filled_within_both():
    mesh = ball()
    box = np.array([[-1.0, -0.004, -1.0], [1.0, 1.0, 0.002]])
    position, radius = fill(mesh, box, DiameterDistribution(uniform=(1e-3, 2e-3)), 1, solid_fraction=0.5)
    volume = clipped_volume(mesh, box)
    assert abs(solid_volume(radius) / volume - 0.5) < 1e-3
    assert overlap_by_brute_force(position, radius).max() <= packing_run.OVERLAP
    distance, _ = signed_distance(mesh, position)
    assert (distance <= -radius).all()
    assert (position[:, 1] - radius >= -0.004 - 1e-15).all()
    assert (position[:, 2] + radius <= 0.002 + 1e-15).all()
    # and right up to the walls
    assert (distance > -1.01 * radius).sum() > 30
    assert (position[:, 2] + radius > 0.002 - 1e-6).sum() > 10


def test_neighbour_table_grows_to_what_it_must_hold():
    rng = np.random.default_rng(0)
    position, radius = rng.random((300, 3)), rng.uniform(0.01, 0.1, 300)
    narrow, wide = (packing_neighbors.NeighborTable(position, radius, 300, 0.05, Threads(1), room) for room in (2, 200))
    for one, two in zip(narrow.push_apart(1.0), wide.push_apart(1.0), strict=True):
        np.testing.assert_array_equal(one, two)
    np.testing.assert_allclose(narrow.overlap.numpy(), overlap_by_brute_force(position, radius), rtol=0, atol=1e-12)


def test_threads_do_not_change_the_bits(monkeypatch):
    found = []
    for threads in (1, 3):
        monkeypatch.setattr(packing_run, "available_threads", lambda threads=threads: threads)
        found.append(fill(None, CUBE, SIZES, 7, count=1500)[0].tobytes())
    assert found[0] == found[1]


def spike(depth):
    """A closed mesh of a tetrahedron with sharp corners: a triangle and a point behind it."""
    x, y, z, o = *(0.01 * np.eye(3)), np.full(3, depth)
    return build_mesh(np.array([[o, y, x], [o, z, y], [o, x, z], [x, y, z]]))


def test_places_in_a_small_part_of_the_bounding_box_are_found():
    # 2.7 % of the box around it, less what is too near to a face
    mesh = spike(0.0028)
    position, radius = fill(mesh, None, 0.5e-3, 0, count=60)
    assert (signed_distance(mesh, position)[0] <= -radius).all()


# with 0.55 of grains of one size the last overlap goes while a grain still pokes out of an edge
@pytest.mark.parametrize(
    ("diameter", "seed", "fraction"), [(SIZES, 2, 0.45), pytest.param(0.5e-3, 3, 0.55, marks=pytest.mark.slow)]
)
def test_sharp_corners_of_a_mesh_hold(diameter, seed, fraction):
    mesh = spike(0.004 / 3.0)
    position, radius = fill(mesh, None, diameter, seed, solid_fraction=fraction)
    distance, _ = signed_distance(mesh, position)
    assert (distance <= -radius).all()
    assert overlap_by_brute_force(position, radius).max() <= packing_run.OVERLAP


def test_worst_overlaps_agree_with_brute_force():
    rng = np.random.default_rng(0)
    position, radius = rng.random((400, 3)), rng.uniform(0.01, 0.08, 400)
    share, partner = worst_overlaps(position, radius)
    np.testing.assert_allclose(share, overlap_by_brute_force(position, radius), rtol=0, atol=1e-12)
    touching = share > 0.0
    assert (partner[~touching] == -1).all()
    i, j = np.flatnonzero(touching), partner[touching]
    gap = radius[i] + radius[j] - np.linalg.norm(position[i] - position[j], axis=1)
    np.testing.assert_allclose(gap / np.minimum(radius[i], radius[j]), share[i], rtol=1e-12)


def test_more_than_spheres_can_fill_is_refused_at_once():
    with pytest.raises(
        SceneError, match=r"grains\[0\]\.fill: asked for 3000 grains .*fraction of 1\.57.*at most 0\.74"
    ):
        fill(None, CUBE, 1e-3, 0, count=3000, key="grains[0].fill")


def test_fraction_out_of_reach_is_refused_with_what_was_reached(monkeypatch):
    monkeypatch.setattr(packing_run, "PATIENCE", 60)
    monkeypatch.setattr(packing_run, "SHAKES", (100,))
    with pytest.raises(
        SceneError, match=r"grains\[0\]\.fill: asked for solid fraction 0\.7\d+ .*reached 0\.(\d+)"
    ) as e:
        fill(None, CUBE, 1e-3, 0, solid_fraction=0.71, key="grains[0].fill")
    reached = float(str(e.value).split("reached ")[1].split()[0])
    assert 0.45 < reached < 0.66


def test_grain_without_a_place_is_refused():
    with pytest.raises(SceneError, match=r"no position found for 1 grains, the largest 0\.011 m .*0\.01 x 0\.01 x 0\.01"):
        fill(None, CUBE, 0.011, 0, count=1)
    # fits the bounding box of the corner of a cube, but the corner itself only holds 0.0042 m
    o, x, y, z = np.zeros(3), *(0.01 * np.eye(3))
    corner = build_mesh(np.array([[o, y, x], [o, z, y], [o, x, z], [x, y, z]]))
    with pytest.raises(SceneError, match=r"no position found for 1 grains, the largest 0\.005 m"):
        fill(corner, None, 0.005, 0, count=1)
    fill(corner, None, 0.003, 0, count=1)


def test_region_beside_the_mesh_and_fraction_of_less_than_a_grain_are_refused():
    with pytest.raises(SceneError, match="does not meet the mesh"):
        fill(ball(), [[1, 1, 1], [2, 2, 2]], 1e-3, 0, count=1)
    with pytest.raises(SceneError, match="holds nothing of the inside"):
        fill(ball(), [[0.008, 0.008, 0.008], [2, 2, 2]], 1e-3, 0, count=1)
    with pytest.raises(SceneError, match=r"is less than half a grain of 0\.009 m"):
        fill(None, CUBE, 0.009, 0, solid_fraction=0.1)


def test_open_mesh_cannot_be_filled():
    mesh = build_mesh(np.array(trimesh.creation.box((1, 1, 1)).triangles)[1:])
    with pytest.raises(SceneError, match=r"grains\[0\]\.fill: .*3 open edges"):
        fill(mesh, None, 0.1, 0, count=1, key="grains[0].fill")


def test_mass_of_grains_is_met_within_half_a_grain():
    law = size_law(SIZES)
    asked = filling(closed_region(None, CUBE, "fill"), law, 3, volume=2e-7)
    assert abs(solid_volume(asked.radius) - 2e-7) <= 0.5 * np.pi / 6.0 * LARGEST**3
    with pytest.raises(SceneError, match="exactly one of count, solid_fraction and volume"):
        filling(closed_region(None, CUBE, "fill"), law, 3, volume=2e-7, count=3)
    with pytest.raises(SceneError, match=r"fill: asked for \d+ grains .*fraction of 2; .*at most 0\.74"):
        filling(closed_region(None, CUBE, "fill"), law, 3, volume=2e-6)


def test_fillings_of_one_vessel_and_held_grains_keep_clear_of_each_other():
    mesh = ball()
    large = filling(closed_region(mesh, None, "a"), size_law(2e-3), 1, solid_fraction=0.25, key="a")
    space = closed_region(mesh, [[-1, -1, -1], [1, 1, 0.004]], "b")
    small = filling(space, size_law(SIZES), 1, solid_fraction=0.15, key="b")
    held = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.03]]), np.array([3e-3, 1e-3])
    places, [took] = pack([large, small], held)
    assert took.keys == ("a", "b")
    position = np.concatenate([*places, held[0]])
    radius = np.concatenate([large.radius, small.radius, held[1]])
    assert overlap_by_brute_force(position, radius).max() <= packing_run.OVERLAP
    assert (signed_distance(mesh, np.concatenate(places))[0] <= -radius[:-2]).all()
    assert (places[1][:, 2] + small.radius <= 0.004 + 1e-15).all()


def test_fillings_apart_do_not_know_of_each_other():
    def asked(shift, key):
        return filling(closed_region(None, CUBE + np.array([shift, 0.0, 0.0]), key), size_law(SIZES), 4, count=300, key=key)

    together, took = pack([asked(0.0, "a"), asked(0.011, "b")])
    alone, _ = pack([asked(0.011, "b")])
    assert [one.keys for one in took] == [("a",), ("b",)]
    assert together[1].tobytes() == alone[0].tobytes()
    both, took = pack([asked(0.0, "a"), asked(0.005, "b"), asked(0.012, "c")])
    assert [one.keys for one in took] == [("a", "b", "c")]
    radius = np.concatenate([asked(0.0, "a").radius] * 3)
    assert overlap_by_brute_force(np.concatenate(both), radius).max() <= packing_run.OVERLAP


def test_grains_that_do_not_fit_among_others_are_refused(monkeypatch):
    monkeypatch.setattr(packing_run, "PATIENCE", 60)
    monkeypatch.setattr(packing_run, "SHAKES", ())
    asked = filling(closed_region(None, CUBE, "grains[1].fill"), size_law(1.5e-3), 0, solid_fraction=0.2, key="grains[1].fill")
    held = np.full((1, 3), 0.005), np.array([5.8e-3])
    with pytest.raises(SceneError, match=r"grains\[1\]\.fill: asked for .*0\.2.* among 1 grains given by position"):
        pack([asked], held)


def test_grains_that_fit_exactly_in_rows_find_places():
    # ten abreast: a row between two walls touches to the last bit; 7.5 high: a column in an edge must leave it
    asked = filling(closed_region(None, [[0, 0, 0], [4, 4, 3]], "fill"), size_law(0.4), 0, solid_fraction=0.55)
    [position], _ = pack([asked])
    assert worst_overlaps(position, asked.radius)[0].max() <= packing_run.OVERLAP


def test_broad_sizes_are_packed_without_overlap():
    """About equal volumes of small and large grains; the table has room for what each size needs, not the largest."""
    radius = np.where(np.arange(2000) < 2, 0.5e-3, 0.05e-3)
    side = (9.0 * (radius**3).sum()) ** (1.0 / 3.0)
    asked = fill_request.Filling(closed_region(None, [[0.0] * 3, [side] * 3], "fill"), radius, np.random.default_rng(4), "fill")
    with packing_run.PackingRun([asked], np.zeros((0, 3)), np.zeros(0)) as packed:
        packed.run()
        position, listed = packed.positions()[0], packed._neighbours
        way = listed._built_at[:, None] - listed._built_at[None]
        gap = np.sqrt(np.einsum("ijk,ijk->ij", way, way)) - packed._radius[:, None] - packed._radius
        np.fill_diagonal(gap, np.inf)
        count = listed._count.numpy()
        np.testing.assert_array_equal(count, (gap < listed._skin).sum(axis=1))
        assert count.max() > 100
        assert listed._table.shape[0] < 0.5 * count.max() * len(radius)
    assert overlap_by_brute_force(position, radius).max() <= packing_run.OVERLAP


def test_overlaps_of_many_small_radii_do_not_shrink_the_grains_to_nothing(monkeypatch):
    """A small grain may lie deep in a large one: what is within reach is looked for in steps that do not grow with that."""
    left, goals = iter([20.0, 20.0, 20.0, 20.0, 0.0]), []

    def settle(self, goal=1.0, start=1.0, growing=0):
        goals.append(goal)
        return next(left)

    monkeypatch.setattr(packing_run.PackingRun, "_settle", settle)
    monkeypatch.setattr(packing_run, "SHAKES", ())
    with pytest.raises(SceneError, match=r"asked for solid fraction 0\.524 .* reached 0\.148 without"):
        fill(None, CUBE, 1e-3, 0, count=1000)
    np.testing.assert_allclose(goals, 0.9 ** np.arange(5))


def test_a_filling_whose_grains_cannot_be_kept_off_a_wall_ends_soon_with_the_place(monkeypatch):
    """Where a grain never gets off a wall no overlap is left that could shrink: not each attempt takes all its steps."""
    mesh = ball()
    asked = filling(closed_region(mesh, None, "fill"), size_law(1e-3), 0, count=300)

    class Stubborn(packing_walls.PackingWall):
        def reached(self, position):
            return 0.5

    monkeypatch.setattr(packing_walls, "PackingWall", Stubborn)
    with packing_run.PackingRun([asked], np.zeros((0, 3)), np.zeros(0)) as packed:
        with pytest.raises(SceneError, match=r"not all found a position clear of the walls .* keeps reaching into 'mesh'"):
            packed.run()
        assert packed._steps < packing_run.MOST_STEPS // 2


def test_what_does_not_fit_is_told_with_what_fits():
    with pytest.raises(SceneError, match=r"reached 0\.(5|6)\d+ without overlap: about \d+ grains of these sizes fit") as error:
        fill(None, CUBE, 1e-3, 0, count=1350)
    fits = int(str(error.value).split("about ")[1].split()[0])
    assert 950 < fits < 1150
    fill(None, CUBE, 1e-3, 0, count=fits)
