"""Walls at periodic borders: each acts at its images too, wherever it stands, or is refused with time and place."""

import itertools

import numpy as np
import pytest
import trimesh

from warpdem import Scene, SceneError, Simulation

R = 1e-3
LOWER, UPPER = -0.004, 0.036
LENGTH = UPPER - LOWER
MIDDLE = 0.5 * (LOWER + UPPER)
LANE = 0.02
"""Distance of lanes along y: in each a grain meets one wall."""


def box(folder, at, **keys):
    """A post of 2 x 6 x 6 mm, placed in float64: in the file each place would be rounded by itself."""
    trimesh.creation.box((2e-3, 6e-3, 6e-3)).export(folder / "post.stl")
    return {"mesh": str(folder / "post.stl"), "translate": at, **keys}


def strip(path, begin, end, pieces, y, z=0.0):
    """A floor from x = begin to end, in so many pieces, 8 mm wide."""
    x = np.linspace(begin, end, pieces + 1)
    low, high = y - 4e-3, y + 4e-3
    corners = [[[a, low, z], [b, low, z], [b, high, z], [a, high, z]] for a, b in itertools.pairwise(x)]
    soup = np.array([q for c in corners for q in (c[:3], [c[0], c[2], c[3]])])
    trimesh.Trimesh(soup.reshape(-1, 3), np.arange(len(soup) * 3).reshape(-1, 3), process=False).export(path)
    return str(path)


class Lanes:
    """A scene in which each lane is as one another but for its place along x: (walls, grain) once at the border, once not."""

    def __init__(self, folder):
        self.folder, self.walls, self.grains, self.pairs = folder, [], [], []

    def add(self, wall, x, velocity, spin=(0, 0, 0), z=0.0):
        """A wall, a function of (x0, y0) that gives its table, and a grain at x0 + x."""
        pair = []
        for middle in (LOWER, MIDDLE):
            y = LANE * len(self.grains)
            pair.append(len(self.grains))
            self.walls.append(wall(middle, y) | {"name": f"w{len(self.grains)}", "material": "g"})
            self.grains.append(([LOWER + (middle + x - LOWER) % LENGTH, y, z], velocity, spin))
        self.pairs.append(pair)

    def scene(self, **keys):
        position, velocity, spin = (np.array(column, float) for column in zip(*self.grains, strict=True))
        return Scene.model_validate(
            {
                "gravity": [0, 0, 0],
                "materials": {"g": {"density": 2500.0, "young_modulus": 1e7, "poisson_ratio": 0.3}},
                "contact": {"normal": "hertz", "tangential": "mindlin", "rolling": "none"},
                "pairs": [{"materials": ["g", "g"], "restitution": 0.7, "friction": 0.5}],
                "grains": [{"material": "g", "positions": position, "velocities": velocity, "spins": spin, "radius": R}],
                "walls": self.walls,
                "borders": {"x": {"min": LOWER, "max": UPPER, "kind": "periodic"}},
                "time": {"end": 0.2, "step": 1e-5, "max_speed": 1.0},
            }
            | keys
        )


@pytest.fixture(scope="module")
def lanes(tmp_path_factory):
    folder = tmp_path_factory.mktemp("lanes")
    out = Lanes(folder)

    def post(x, y):
        return box(folder, (x, y, 0))

    def pusher(x, y):
        # comes from the left, over the border, and on: x is where it meets the grain
        at = x - 6e-3 if x > LOWER else x + LENGTH - 6e-3
        return box(folder, (at, y, 0), motion={"velocity": [0.3, 0, 0]})

    def ball(x, y):
        return {"sphere": {"centre": [x, y, 0], "radius": 2e-3, "inside": False}}

    def rod(x, y):
        return {"cylinder": {"point": [x, y, -0.01], "axis": [0, 0, 1], "radius": 1.5e-3, "length": 0.02, "inside": False}}

    out.add(post, -4e-3, [0.3, 0.02, 0.01], (5, 20, 30))
    out.add(post, 4e-3, [-0.3, 0.02, 0.01])
    out.add(post, -0.9e-3, [0, 0, 0], z=20e-3)  # above it, nothing is touched
    out.add(pusher, 0.0, [0, 0.02, 0], (0, 0, 100))
    out.add(pusher, 2.1013e-3, [-0.1, 0, 0])  # not in touch at just a step
    out.add(ball, -5e-3, [0.3, 0.05, 0.02])
    out.add(rod, 5e-3, [-0.3, 0.1, 0.02])
    return out


def simulated(scene, device="cpu", threads=1, **keys):
    return Simulation(scene, device=device, threads=threads, **keys)


STEPS = 2500


@pytest.fixture(scope="module")
def met(lanes):
    sim = simulated(lanes.scene())
    sim.step(STEPS)
    return sim


def test_walls_at_the_border_act_as_in_the_middle(lanes, met):
    p = met.particles
    start = np.array([velocity for _, velocity, _ in lanes.grains])
    for number, (border, middle) in enumerate(lanes.pairs):
        way = p.position[border] - p.position[middle] + [MIDDLE - LOWER, -LANE * (border - middle), 0]
        assert np.abs(met.domain.nearest(way[None])).max() < 1e-10, f"pair {number}"
        np.testing.assert_allclose(p.velocity[border], p.velocity[middle], rtol=0, atol=1e-9)
        np.testing.assert_allclose(p.spin[border], p.spin[middle], rtol=0, atol=1e-6)
        changed = np.abs(p.velocity[[border, middle]] - start[[border, middle]]).max()
        assert changed == 0.0 if number == 2 else changed > 0.05, f"pair {number}: met nothing, or what is not there"


def test_bits_of_walls_at_borders_do_not_depend_on_lists_threads_or_resume(lanes, met, tmp_path):
    assert met.lists.rebuilds > 1
    other = simulated(lanes.scene(engine={"skin": 2.5e-4}), threads=2)
    other.step(STEPS // 2)
    other.save_checkpoint(tmp_path / "half.h5")
    again = Simulation.from_checkpoint(tmp_path / "half.h5", device="cpu", threads=1)
    again.step(STEPS - STEPS // 2)
    assert again.state_hash() == met.state_hash()


def test_a_wall_that_goes_on_through_borders_meets_its_grain_each_time(lanes, tmp_path):
    """A plate that goes round three times, and carries what falls against it."""
    plate = box(tmp_path, (0, 0, 0), name="plate", material="g", motion={"velocity": [0.8, 0, 0]})
    keys = {"walls": [plate], "gravity": [-2, 0, 0], "pairs": [{"materials": ["g", "g"], "restitution": 0.05, "friction": 0.5}]}
    grain = [{"material": "g", "positions": [[UPPER - 1e-3, 0, 0]], "radius": R}]
    sim = simulated(lanes.scene(**keys, grains=grain))
    caught = 0
    for _ in range(16):
        sim.step(1000)
        wall = LOWER + (0.8 * sim.time - LOWER) % LENGTH
        ahead = sim.domain.nearest(sim.particles.position - [wall, 0, 0])[0, 0]
        caught += bool(0 < ahead < 0.02)
        assert np.abs(ahead) > 2e-3 - 0.1 * R
    assert 0.8 * sim.time > 3 * LENGTH
    assert caught >= 12
    assert abs(sim.particles.velocity[0, 0] - 0.8) < 0.02


@pytest.mark.parametrize("begin", [0.0, -2.5e-3, 0.4 * LENGTH], ids=["exact", "beyond", "across"])
def test_a_floor_has_no_seam_at_the_border(lanes, tmp_path, begin):
    """As far as the domain, further, and laid across the border: a grain that slides, then rolls comes round on it."""
    ends = []
    for first, last, pieces in ((LOWER - 1.2 * LENGTH, UPPER + 1.2 * LENGTH, 3), (LOWER + begin, None, 24)):
        last = last or (UPPER - begin if begin < 0.0 else UPPER + begin)
        mesh = strip(tmp_path / f"{pieces}.stl", first, last, pieces, 0.0)
        keys = {"walls": [{"name": "floor", "material": "g", "mesh": mesh, "open": True}], "gravity": [0, 0, -9.81]}
        grain = [{"material": "g", "positions": [[0.03, 0, R]], "velocities": [[0.9, 0.0, 0]], "radius": R}]
        sim = simulated(lanes.scene(**keys, grains=grain))
        for _ in range(400):
            sim.step(30)
            assert len(sim.contacts().i) == 1  # at no time does it hop over the border
        ends.append((sim.particles.position[0], sim.particles.velocity[0], sim.particles.spin[0]))
    for a, b, size in zip(*ends, (R, 0.6, 600.0), strict=True):
        np.testing.assert_allclose(b, a, rtol=0, atol=3e-6 * size)  # corners are float32


def test_a_grain_rides_through_the_border_on_what_moves(lanes, tmp_path):
    """The wall is brought back by a period while it is touched: it has not slipped by one below the grain."""
    post = box(tmp_path, (0, 0, 0), name="post", material="g", motion={"velocity": [0.8, 0, 0]})
    grain = [{"material": "g", "positions": [[0, 0, 3e-3 + R - 1e-7]], "velocities": [[0.8, 0, 0]], "radius": R}]
    sim = simulated(lanes.scene(walls=[post], gravity=[0, 0, -9.81], grains=grain))
    for _ in range(240):
        sim.step(50)
        assert len(sim.contacts().i) == 1
        assert abs(sim.particles.velocity[0, 0] - 0.8) < 1e-9
    assert 0.8 * sim.time > 2 * LENGTH


def test_a_tube_that_ends_at_the_borders_has_no_seam(lanes):
    """A grain that rolls along the bottom of a tube, and stays beside the border at its end, has one contact."""
    tube = {"name": "tube", "material": "g", "cylinder": {"point": [LOWER, 0, 0], "axis": [1, 0, 0], "radius": 0.01}}
    ends = []
    for length in ({"length": LENGTH}, {}):
        walls = [tube | {"cylinder": tube["cylinder"] | length}, *lanes.walls[-2:]]
        grain = [{"material": "g", "positions": [[UPPER - 0.02e-3, 0, -9e-3]], "velocities": [[0.01, 0, 0]], "radius": R}]
        sim = simulated(lanes.scene(walls=walls, grains=grain, gravity=[0, 0, -9.81]))
        sim.step(1000)
        assert len(sim.contacts().i) == 1
        ends.append((sim.particles.position[0], sim.particles.velocity[0], sim.particles.spin[0]))
    assert LOWER < ends[0][0][0] < LOWER + R
    for a, b, size in zip(*ends, (R, 0.01, 10.0), strict=True):
        np.testing.assert_allclose(b, a, rtol=0, atol=1e-9 * size)


def beside(lanes, *walls, time=None, **keys):
    """A scene of one grain far from all walls."""
    grain = [{"material": "g", "positions": [[MIDDLE, 0, 0]], "radius": R}]
    walls = [{"name": f"wall{k}", "material": "g", **wall} for k, wall in enumerate(walls)]
    return lanes.scene(walls=walls, grains=grain, **keys)


REFUSED = {
    "a plane across": ({"plane": {"point": [-0.003, 0, 0], "normal": [1, 0, 0]}}, "images would fill the domain"),
    "an oblique plane": ({"plane": {"point": [0, 0, -1], "normal": [0.1, 0, 1]}}, "images would fill the domain"),
    "an infinite cone": ({"cone": {"apex": [MIDDLE, 0, -0.05], "axis": [0, 0, 1], "half_angle": 0.3}}, "end of a cone"),
    "an oblique tube": (
        {"cylinder": {"point": [MIDDLE, 0, 0], "axis": [0.1, 0, 1], "radius": 0.01}}, "not the same all along",
    ),
    "a vessel across the border": (
        {"sphere": {"centre": [MIDDLE, 0, 0], "radius": 0.0201}}, r"it reaches beyond: at t = 0 s it stands at x = -0\.0041",
    ),
    "a vessel that leaves": (
        {"sphere": {"centre": [MIDDLE, 0, 0], "radius": 0.0195}, "motion": {"velocity": [-0.01, 0, 0]}},
        r"reaches beyond: at t = 0\.0501 s it stands at x = -0\.004001 to 0\.034999 m",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED.values(), ids=REFUSED.keys())
def test_walls_that_cannot_act_at_their_images_are_refused(lanes, case):
    wall, words = case
    with pytest.raises(SceneError, match=r"walls\[0\] \('wall0'\) and the periodic borders of x .*" + words):
        simulated(beside(lanes, wall))


def test_a_long_floor_that_leaves_the_border_is_refused_with_the_time(lanes, tmp_path):
    mesh = strip(tmp_path / "long.stl", LOWER - 5e-3, UPPER + 5e-3, 4, 0.0, z=-5e-3)
    floor = {"mesh": mesh, "open": True}
    simulated(beside(lanes, floor))
    moving = floor | {"motion": {"velocity": [0.05, 0, 0]}}
    with pytest.raises(SceneError, match=r"0\.05 m long, .* at t = 0\.08\d* s it stands at x = -0\.00[45]\d* .*draw it longer"):
        simulated(beside(lanes, moving))
    with pytest.raises(SceneError, match=r"far beyond; draw it between the borders"):
        simulated(beside(lanes, {"sphere": {"centre": [0.1, 0, 0], "radius": 1e-3, "inside": False}}))


def test_what_is_the_same_all_along_or_away_from_the_borders_costs_nothing(lanes, tmp_path):
    walls = [
        {"plane": {"point": [0, 0, -0.01], "normal": [0, 0, 1]}},
        {"cylinder": {"point": [0, 0, 0], "axis": [1, 0, 0], "radius": 0.02}},
        {"sphere": {"centre": [MIDDLE, 0, 0], "radius": 0.0199}},
        box(tmp_path, (MIDDLE, 0, -5e-3)),
    ]
    assert not simulated(beside(lanes, *walls)).plan.walls.images
    closing = [{"plane": {"point": [x, 0, 0], "normal": [n, 0, 0]}} for x, n in ((LOWER, 1), (UPPER, -1))]
    assert not simulated(beside(lanes, *closing)).plan.walls.images
    assert simulated(beside(lanes, box(tmp_path, (UPPER, 0, -5e-3)))).plan.walls.images


def test_the_captured_graph_sees_walls_at_their_images(lanes, met):
    sim = simulated(lanes.scene(), resident=True)
    sim.step(STEPS)
    assert sim.state_hash() == met.state_hash()
