"""Streams: where grains come in, how many and what of, against arithmetic; in the laboratory and on a wall; bits."""

import numpy as np
import pytest
import trimesh

from warpdem import Scene, SceneError, Simulation, load_scene
from warpdem.app.phases import run as run_phases
from warpdem.filling.stream_amount import brought_by, mean_mass
from warpdem.mesh.solid import face_of, shape_of
from warpdem.scene.convert import convert
from warpdem.scene.tables import relative_to, scene_tables
from warpdem.scene.write_toml import toml_text

R = 1e-3
MASS = 2500.0 * 4.0 / 3.0 * np.pi * R**3
SHAPES = {
    "box": {"box": {"min": [-0.01, -0.01, 0], "max": [0.01, 0.02, 0.02]}},
    "cylinder": {"cylinder": {"point": [0, 0, 0.01], "axis": [1, 2, 1], "radius": 0.012, "length": 0.02}},
    "sphere": {"sphere": {"centre": [0.005, 0, 0.02], "radius": 0.012}},
    "mesh": {"mesh": {"file": "ring.stl", "translate": [0, 0, 0.01]}},
    "disk": {"disk": {"point": [0, 0, 0.02], "normal": [0, 1, 1], "radius": 0.012}},
    "face": {"face": {"file": "square.stl", "scale": 0.001, "rotate": {"axis": [1, 0, 0], "angle": 0.3}}},
}


def files(folder):
    trimesh.creation.annulus(r_min=0.005, r_max=0.012, height=0.015).export(folder / "ring.stl")
    square = [[[-10, -10, 0], [10, -10, 0], [10, 10, 0]], [[-10, -10, 0], [10, 10, 0], [-10, 10, 0]]]
    trimesh.Trimesh(**trimesh.triangles.to_kwargs(np.array(square, dtype=float))).export(folder / "square.stl")


def scene(folder, stream, **keys):
    files(folder)
    stream = {"velocity": [0, 0, -0.5], **stream}
    if "recipe" not in stream:
        stream = {"material": "g", "diameter": 2 * R, **stream}
    return Scene.model_validate(
        {
            "base": folder,
            "gravity": [0, 0, 0],
            "materials": {
                "g": {"density": 2500.0, "young_modulus": 1e6, "poisson_ratio": 0.3},
                "h": {"density": 5000.0, "young_modulus": 1e6, "poisson_ratio": 0.3},
            },
            "contact": {"tangential": "none", "rolling": "none"},
            "pairs": [
                {"materials": [a, b], "restitution": 0.7} for a, b in (("g", "g"), ("g", "h"), ("h", "h"))
            ],
            "streams": [stream],
            "time": {"end": 1.0, "step": 5e-5, "max_speed": 1.0},
            **keys,
        }
    )


def places_at_insertion(sim, steps):
    """Centres of all grains in the step at which each was inserted, shape (n, 3)."""
    found = {}
    for _ in range(steps // sim.inlets[0].every):
        now = sim.particles
        for number, place in zip(now.id.tolist(), now.position, strict=True):
            found.setdefault(number, place)
        sim.step(sim.inlets[0].every)
    return np.array(list(found.values()))


@pytest.mark.parametrize("name", SHAPES)
def test_grains_come_in_within_the_region_and_spread_over_it(tmp_path, name):
    one = scene(tmp_path, {**SHAPES[name], "count_rate": 1000.0, "velocity": [0, 0, -0.9]})  # few at a time
    sim = Simulation(one, device="cpu", threads=1)
    places = places_at_insertion(sim, 3200)
    assert len(places) > 140
    stream = one.streams[0]
    face = stream.disk or stream.face
    shape = shape_of(one, stream.shape, "") if face is None else face_of(one, face, "")
    assert shape.depth(places).min() >= R * (1.0 - 1e-9)
    others = shape.random_points(np.random.default_rng(7), np.full(4000, R))
    # five standard errors of the mean of so many points
    error = others.std(axis=0) / np.sqrt(len(places))
    assert (np.abs(places.mean(axis=0) - others.mean(axis=0)) < 5.0 * error + 1e-12).all()
    if face is not None:  # flat: all on the face
        normal = np.linalg.svd(others - others.mean(axis=0))[2][2]
        assert np.abs((places - others.mean(axis=0)) @ normal).max() < 1e-12


@pytest.mark.parametrize("name", ["cylinder", "mesh", "face"])
def test_bits_on_threads_in_the_graph_and_after_a_resume(tmp_path, name):
    one = scene(tmp_path, {**SHAPES[name], "count_rate": 4000.0, "fixed_to": "laboratory", "mass": 300.2 * MASS},
                frame={"axis": [1, 0, 0], "rate": 5.0})  # fmt: skip
    hashes = {}
    for threads, resident in ((1, False), (2, False), (1, True)):
        sim = Simulation(one, device="cpu", threads=threads, resident=resident)
        sim.step(777)
        if (threads, resident) == (1, False):
            sim.save_checkpoint(tmp_path / "c.h5")
        sim.step(1300)
        assert sim.inlets[0].count == 300
        hashes[threads, resident] = sim.state_hash()
    resumed = Simulation.from_checkpoint(tmp_path / "c.h5", threads=2)
    resumed.step(1300)
    assert set(hashes.values()) == {resumed.state_hash()}
    assert resumed.inlets[0].mass == sim.inlets[0].mass


@pytest.mark.parametrize(
    ("amount", "count"),
    [
        ({"count": 20}, 20),
        ({"mass": 20.3 * MASS}, 20),
        ({"mass": 20.7 * MASS}, 21),
        ({"count": 20, "count_rate": 1000.0}, 20),
        ({"mass": 20.3 * MASS, "count_rate": 1000.0}, 20),
        ({"count": 20, "mass_rate": 1000.0 * MASS}, 20),
    ],
)
def test_totals(tmp_path, amount, count):
    sim = Simulation(scene(tmp_path, {**SHAPES["box"], **amount}), device="cpu", threads=1)
    if len(amount) == 1:
        assert len(sim.state) == count  # all at once
    sim.step(100)
    assert len(amount) == 1 or 0 < len(sim.state) < count
    sim.step(1000)
    assert len(sim.state) == sim.inlets[0].count == count
    assert sim.inlets[0].next_event(sim.step_number) is None
    assert sim.inlets[0].shortfall(sim.step_number) is None


def test_a_total_that_has_no_room_yet_comes_as_soon_as_there_is(tmp_path):
    stream = {"box": {"min": [0, 0, 0], "max": [0.006, 0.006, 0.006]}, "count": 30, "velocity": [0, 0, -1]}
    sim = Simulation(scene(tmp_path, stream), device="cpu", threads=1)
    assert 3 < len(sim.state) < 20
    assert "inserted" in (sim.inlets[0].shortfall(0) or "")
    sim.step(2000)
    assert len(sim.state) == 30
    assert sim.extremes["pair_overlap_share"] < 0.01


def test_a_rate_over_time_is_integrated(tmp_path):
    """Nothing up to 0.02 s, then a ramp to 2000 grains per second at 0.06 s, which stays."""
    table = {**SHAPES["sphere"], "count_rate": [[0.02, 0], [0.06, 2000]], "velocity": [0, 0, -1]}
    one = scene(tmp_path, table)
    sim = Simulation(one, device="cpu", threads=1)
    for time, wanted in ((0.02, 0.0), (0.04, 10.0), (0.06, 40.0), (0.08, 80.0)):
        sim.run(until=time)
        assert brought_by(one.streams[0], time) == pytest.approx(wanted, abs=1e-9)
        assert sim.inlets[0].count == pytest.approx(wanted, abs=2000 * sim.inlets[0].every * sim.dt + 1)
    later = one.later(0.03).streams[0]
    assert brought_by(later, 0.05) == pytest.approx(80.0 - brought_by(one.streams[0], 0.03), abs=1e-9)
    window = scene(tmp_path, {**table, "start": 0.04, "until": 0.05}).streams[0]
    assert brought_by(window, 1.0) == pytest.approx(0.5 * (1000 + 1500) * 0.01, abs=1e-9)


RECIPE = [
    {"name": "fine", "material": "g", "diameter": 1.5 * R, "mass_share": 3},
    {"material": "h", "diameter": {"uniform": [1.8 * R, 2.2 * R]}, "mass_share": 1},
    {"name": "coarse", "material": "g", "diameter": 3 * R, "mass_share": 4},
]


@pytest.mark.parametrize("by", ["mass", "number"])
def test_a_recipe_is_kept_within_a_grain_at_all_times(tmp_path, by):
    recipe = [{**{k: v for k, v in one.items() if k != "mass_share"}, f"{by}_share": one["mass_share"]} for one in RECIPE]
    one = scene(tmp_path, {**SHAPES["box"], "recipe": recipe, "mass_rate": 4000 * MASS, "velocity": [0, 0, -2], "name": "feed"})
    sim = Simulation(one, device="cpu", threads=1)
    assert one.groups == ["fine", "feed", "coarse"]
    for _ in range(4):
        sim.step(200)
        p = sim.particles
        assert p.type.tolist() == [[0, 1, 0][group] for group in p.group]
        np.testing.assert_allclose(p.radius[p.group != 1], np.where(p.group[p.group != 1] == 0, 0.75 * R, 1.5 * R), rtol=1e-15)
        parts = np.array([(p.mass[p.group == k].sum() if by == "mass" else (p.group == k).sum()) for k in range(3)])
        largest = p.mass.max() if by == "mass" else 1.0
        assert np.abs(parts - parts.sum() * np.array([3, 1, 4]) / 8).max() <= 1.01 * largest
    assert len(sim.state) > 60
    stream = one.streams[0]
    masses = [rho * portion.sizes.mean_volume for rho, portion in zip((2500.0, 5000.0, 2500.0), stream.portions, strict=True)]
    assert mean_mass(stream, masses) == pytest.approx(p.mass.mean(), rel=0.05)


def test_a_stream_of_the_laboratory_is_the_same_in_a_turning_frame(tmp_path):
    """Random numbers and places are those of the laboratory: the flight of each grain agrees to rounding until they meet."""
    stream = {**SHAPES["cylinder"], "count_rate": 300.0, "velocity": [0.1, 0, -1], "fixed_to": "laboratory"}
    turning = {"frame": {"axis": [1, 2, 0], "origin": [0.01, 0, 0], "rate": 30.0}, "gravity": [0, 0, -9.81]}
    both = []
    for keys in ({"gravity": [0, 0, -9.81]}, turning):
        sim = Simulation(scene(tmp_path, stream, **keys), device="cpu", threads=1)
        sim.step(800)
        assert len(sim.state) > 8
        both.append(sim.particles)
    still, moving = both
    assert still.id.tolist() == moving.id.tolist()
    np.testing.assert_allclose(moving.position_lab, still.position_lab, rtol=0, atol=1e-13)
    np.testing.assert_allclose(moving.velocity_lab, still.velocity_lab, rtol=0, atol=1e-11)


@pytest.mark.parametrize("integrator", ["exact_drift", "velocity_verlet"])
def test_a_stream_on_a_wall_moves_with_it(tmp_path, integrator):
    """A feed on an arm of 0.1 m that turns at 20 rad/s: grains leave it with the speed of the arm plus their own."""
    arm = {"name": "arm", "material": "g", "sphere": {"centre": [0.2, 0, 0], "radius": 0.01, "inside": False},
           "motion": {"axis": [0, 0, 1], "rate": 20.0}, "fixed_to": "laboratory"}  # fmt: skip
    stream = {"sphere": {"centre": [0.1, 0, 0], "radius": 0.002}, "count_rate": 500.0, "velocity": [0, 0, -1], "follows": "arm"}
    for frame in ({}, {"frame": {"axis": [0, 0, 1], "rate": 8.0}}):
        time = {"end": 1.0, "step": 2e-6, "max_speed": 4.0}
        sim = Simulation(
            scene(tmp_path, stream, walls=[arm], engine={"integrator": integrator}, time=time, **frame), device="cpu", threads=1
        )
        count = 0
        for _ in range(40):
            sim.step(sim.inlets[0].every)
            if sim.inlets[0].count > count:
                count = sim.inlets[0].count
                newest, angle = -1, 20.0 * sim.time
                place, speed = sim.particles.position_lab[newest], sim.particles.velocity_lab[newest]
                centre = 0.1 * np.array([np.cos(angle), np.sin(angle), 0.0])
                assert np.linalg.norm(place - centre) < 0.002
                wanted = np.cross([0, 0, 20.0], place) + np.array([0, 0, -1.0])
                np.testing.assert_allclose(speed, wanted, rtol=0, atol=0.02)
        assert count >= 2


def test_grains_of_a_moving_region_keep_clear_of_walls(tmp_path):
    """A region of the laboratory in a frame that turns a plate through it."""
    plate = {"name": "plate", "material": "g", "mesh": "plate.stl"}
    trimesh.creation.box([0.02, 0.002, 0.05]).export(tmp_path / "plate.stl")
    stream = {"box": {"min": [-0.02, -0.02, 0], "max": [0.02, 0.02, 0.02]}, "count_rate": 3000.0, "fixed_to": "laboratory"}
    sim = Simulation(
        scene(tmp_path, stream, walls=[plate], frame={"axis": [0, 0, 1], "rate": 3.0}, engine={"max_overlap": 0.5}),
        device="cpu", threads=1,
    )  # fmt: skip
    assert "streams[0].box: the wall 'plate' leaves" in " ".join(sim.notes)
    places = places_at_insertion(sim, 800)
    assert len(places) > 60
    outside = np.linalg.norm(np.maximum(np.abs(places) - [0.01, 0.001, 0.025], 0.0), axis=1)
    assert outside.min() >= R * (1.0 - 1e-6)


def test_a_total_goes_on_through_phases(tmp_path):
    one = scene(
        tmp_path, {**SHAPES["box"], "count": 40, "count_rate": 1000.0, "velocity": [0, 0, -1]},
        phases=[{"name": "a", "time": {"end": 0.02}}, {"name": "b", "time": {"end": 0.1}}],
        output={"picture": False, "interval": 0.02},
    )  # fmt: skip
    run_phases(one, tmp_path / "out", device="cpu")
    last = Simulation.from_checkpoint(tmp_path / "out" / "2-b" / "checkpoint.h5")
    assert len(last.state) == 40
    assert last.inlets[0].count < 30


def test_streams_survive_a_stage_and_a_file(tmp_path):
    arm = {"name": "arm", "material": "g", "sphere": {"centre": [0.5, 0, 0], "radius": 0.01, "inside": False}}
    rate = [[0, "1 g/s"], [2, 0]]
    one = scene(tmp_path, {**SHAPES["mesh"], "recipe": RECIPE, "mass_rate": rate, "follows": "arm"}, walls=[arm])
    others = [scene(tmp_path, {**shape, "count": 5, "fixed_to": "laboratory"}).streams[0] for shape in SHAPES.values()]
    more = [*one.streams, *others]
    one = Scene.model_validate({**one.model_dump(mode="json", exclude_unset=True), "base": tmp_path,
                                "streams": [s.model_dump(mode="json", exclude_unset=True) for s in more]})  # fmt: skip
    (tmp_path / "a.toml").write_text(toml_text(scene_tables(one, relative_to(tmp_path))))
    convert(tmp_path / "a.toml", tmp_path / "b.usda")
    convert(tmp_path / "b.usda", tmp_path / "c.toml")
    for name in ("a.toml", "b.usda", "c.toml"):
        assert load_scene(tmp_path / name).streams == one.streams, name


BOX = SHAPES["box"]
WRONG = {
    "no place": ({"count": 1}, "exactly one of box, cylinder, sphere, mesh, disk, face; found none"),
    "two places": ({**BOX, **SHAPES["disk"], "count": 1}, "found box and disk"),
    "no amount": (BOX, "one of mass_rate, count_rate; found none; or only a total, mass or count"),
    "two totals": ({**BOX, "count": 1, "mass": 1.0}, "at most one of mass and count"),
    "row": ({**BOX, "mass_rate": [[0, 1, 2], [1, 1, 1]]}, r"streams\[0\].mass_rate\[0\].*\n *must be a list of two numbers"),
    "one row": ({**BOX, "mass_rate": [[0, 1]]}, r"mass_rate.*\n *needs 2 or more entries"),
    "times": ({**BOX, "mass_rate": [[1, 1], [1, 2]]}, "times of its rows must increase"),
    "zero": ({**BOX, "count_rate": [[0, 0], [1, 0]]}, "at least one of its rates must be above 0"),
    "negative": ({**BOX, "count_rate": [[0, 1], [1, -2]]}, r"count_rate\[1\]\[1\] = -2\n *must be >= 0"),
    "material": ({**BOX, "count": 1, "recipe": RECIPE, "material": "g"}, "cannot be given with a recipe"),
    "shares": ({**BOX, "count": 1, "recipe": [{"material": "g", "diameter": R}]}, "give mass_share in each of its portions"),
    "unknown": ({**BOX, "count": 1, "recipe": [{"material": "x", "diameter": R, "mass_share": 1}]},
                r"streams\[0\].recipe\[0\].material = \"x\"\n *no such material"),
    "size": ({**SHAPES["sphere"], "count": 1, "diameter": 0.05}, r"streams\[0\].sphere\n *its diameter of 0.024 m must be"),
    "flat": ({**SHAPES["cylinder"], "count": 1, "diameter": 0.021}, "its length of 0.02 m must be at least"),
    "endless": ({"cylinder": {"point": [0, 0, 0], "axis": [0, 0, 1], "radius": 1}, "count": 1}, "cylinder.length\n *missing"),
    "thin": ({**SHAPES["mesh"], "count": 1, "diameter": 0.02}, r"streams\[0\].mesh: nowhere does a grain of 0.02 m"),
    "narrow": ({**SHAPES["face"], "count": 1, "diameter": 0.03}, r"streams\[0\].face: nowhere does a grain of 0.03 m"),
    "file": ({"face": {"file": "none.stl"}, "count": 1}, r"streams\[0\].face.file.*none.stl"),
    "wall": ({**BOX, "count": 1, "follows": "x"}, "no such wall"),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_said(tmp_path, case):
    stream, message = WRONG[case]
    with pytest.raises(SceneError, match=message):
        Simulation(scene(tmp_path, stream), device="cpu", threads=1)


def test_a_region_within_an_outlet_is_refused(tmp_path):
    outlet = {"name": "o", "sphere": {"centre": [0, 0, 0.01], "radius": 0.01}}
    for name in ("box", "cylinder", "sphere", "disk"):
        with pytest.raises(SceneError, match=rf"streams\[0\].{name}\n *overlaps the region of the outlet \"o\""):
            scene(tmp_path, {**SHAPES[name], "count": 1}, outlets=[outlet])
    far = {"name": "o", "sphere": {"centre": [0, 0, 0.1], "radius": 0.01}}
    scene(tmp_path, {**SHAPES["cylinder"], "count": 1}, outlets=[far])
    scene(tmp_path, {**SHAPES["cylinder"], "count": 1}, outlets=[{**outlet, "fixed_to": "laboratory"}])
