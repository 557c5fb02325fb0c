"""Materials that do not touch: `contact = false` in [[pairs]]."""

import numpy as np
import pytest
import trimesh

from warpdem import Scene, SceneError, Simulation, load_scene
from warpdem.filling.initial_grains import load_grains
from warpdem.scene.convert import convert
from warpdem.scene.tables import relative_to, scene_tables
from warpdem.scene.write_toml import toml_text

RADIUS = 1.0e-3
TURNING = {"frame": {"axis": [0, 0, 1], "rate": 3.0}}


def touch(a: str, b: str, **changes) -> dict:
    return {"materials": [a, b], "restitution": 0.7, "friction": 0.3} | changes


def apart(a: str, b: str) -> dict:
    return {"materials": [a, b], "contact": False}


def data(pairs, positions: dict, walls=(), **changes) -> dict:
    """Grains of each material at these places [m]; those that are alone there do not change what is compiled."""
    steel = {"density": 2500, "young_modulus": 1e7, "poisson_ratio": 0.3}
    return {
        "materials": {"red": steel, "blue": steel, "sieve": steel},
        "pairs": list(pairs),
        "grains": [
            {"name": name, "material": name, "positions": np.atleast_2d(at).tolist(), "radius": RADIUS}
            for name, at in positions.items()
        ],
        "walls": list(walls),
        "time": {"end": 1.0, "step": 1e-5, "max_speed": 1.0},
    } | changes


def simulate(*args, **changes) -> Simulation:
    return Simulation(Scene.model_validate(data(*args, **changes)), device="cpu", threads=1)


SIEVE = [touch("red", "red"), touch("blue", "blue"), apart("blue", "red"), touch("red", "sieve"), apart("sieve", "blue")]


def plane(height: float = 0.0, name: str = "sieve", material: str = "sieve") -> dict:
    return {"name": name, "material": material, "plane": {"point": [0, 0, height], "normal": [0, 0, 1]}}


def sheet(folder) -> dict:
    x = 0.02 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    trimesh.Trimesh(x, [[0, 1, 2], [0, 2, 3]]).export(folder / "sheet.stl")
    return {"name": "sieve", "material": "sieve", "mesh": str(folder / "sheet.stl"), "open": True}


@pytest.mark.parametrize("kind", ["plane", "mesh"])
@pytest.mark.parametrize("frame", [{}, TURNING], ids=["laboratory", "turning"])
@pytest.mark.parametrize("resident", [False, True], ids=["lists by the host", "graph"])
def test_a_sieve_stops_one_species_and_the_other_falls_freely_through_it_and_through_that_one(
    tmp_path, kind, frame, resident
):
    walls = [plane() if kind == "plane" else sheet(tmp_path), plane(-0.1, "floor", "red")]
    height = 2.0e-3
    given = data(SIEVE, {"red": [0, 0, RADIUS], "blue": [0, 0, height + 2.0 * RADIUS]}, walls, **frame)
    sim = Simulation(Scene.model_validate(given), device="cpu", threads=1, resident=resident)
    sim.run(0.03)
    red, blue = sim.particles.position[:, 2]
    assert abs(red - RADIUS) < 0.01 * RADIUS
    assert blue == pytest.approx(height + 2.0 * RADIUS - 0.5 * 9.81 * 0.03**2, rel=1e-9)
    assert sim.contacts().i.tolist() == [0]  # of the red one with the sieve
    assert sim.extremes["pair_overlap_share"] == 0.0
    sim.run(0.06)  # by now it is through, and no guard objects
    assert sim.particles.position[1, 2] < -RADIUS


def test_grains_that_pass_through_each_other_may_start_in_one_place_and_others_may_not():
    at = [[0, 0, RADIUS], [0.0, 1.9 * RADIUS, RADIUS]]
    sim = simulate(SIEVE[:3], {"red": at[0], "blue": at[0]}, gravity=[0, 0, 0])
    sim.run(1e-3)
    np.testing.assert_array_equal(sim.particles.position, [at[0], at[0]])
    with pytest.raises(SceneError, match="coincide"):
        simulate([touch("red", "red"), touch("blue", "blue"), touch("red", "blue")], {"red": at[0], "blue": at[0]})


def test_lanes_without_a_contact_hold_no_two_grains_in_one_place():
    """One contact in a batch of several: the others of it hold grains that touch nothing, whose overlap counts for nothing."""
    there = [0.01, 0.01, 0.01]
    red = [[0, 0, 0], there, [0.01, 0.01, 0.01 + 1.99 * RADIUS]]
    sim = simulate(SIEVE[:3], {"red": red, "blue": [0, 0, 0.1 * RADIUS]}, gravity=[0, 0, 0])
    sim.run(2e-5)
    assert sim.extremes["pair_overlap_share"] == pytest.approx(0.01, rel=1e-6)


def mixed(count: int = 60, seed: int = 1) -> dict:
    """Places of two species that fill the same box, each without overlaps of its own."""
    generator, out = np.random.default_rng(seed), {}
    for name in ("red", "blue"):
        places = np.stack(np.meshgrid(*[np.arange(4)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)[:count] * 2.3 * RADIUS
        out[name] = places + generator.uniform(0, 0.2 * RADIUS, places.shape) + RADIUS
    return out


@pytest.mark.parametrize("frame", [{}, TURNING], ids=["laboratory", "turning"])
@pytest.mark.parametrize("resident", [False, True], ids=["lists by the host", "graph"])
def test_each_of_two_species_that_share_a_place_moves_as_if_it_were_alone(frame, resident):
    both = mixed()
    floor = plane(name="floor")
    pairs = [touch("red", "red"), touch("blue", "blue"), apart("red", "blue"), touch("red", "sieve"), touch("blue", "sieve")]

    def run(groups):
        scene = Scene.model_validate(data(pairs, groups, [floor], **frame))
        sim = Simulation(scene, device="cpu", threads=1, resident=resident)
        sim.run(0.03)
        return sim.particles

    together = run(both)
    for number, name in enumerate(both):
        alone = run({name: both[name]})
        np.testing.assert_array_equal(together.position[together.group == number], alone.position)
        np.testing.assert_array_equal(together.spin[together.group == number], alone.spin)


def cube(folder, half: float = 0.02, middle=(0, 0, 0), name: str = "sieve") -> dict:
    box = trimesh.creation.box((2 * half,) * 3)
    box.apply_translation(middle)
    box.export(folder / f"{name}.stl")
    return {"name": name, "material": name, "mesh": str(folder / f"{name}.stl")}


@pytest.mark.parametrize("material", ["red", "blue"])
def test_a_closed_mesh_holds_those_that_touch_it_alone(tmp_path, material):
    """Red grains in a box and a blue one outside of it, which then flies through: neither start nor guards mind it."""
    inside = [[0, 0, 0], [0.004, 0, 0], [0, 0.004, 0]]
    moved = {"red": inside, material: [*inside, [-0.03, 0, 0]] if material == "red" else [-0.03, 0, 0]}

    def run():
        scene = data(SIEVE, moved, [cube(tmp_path)], gravity=[0, 0, 0])
        if material == "blue":
            scene["grains"][1]["velocities"] = [[1.0, 0, 0]]
        sim = Simulation(Scene.model_validate(scene), device="cpu", threads=1)
        sim.run(0.03)
        return sim

    if material == "red":
        with pytest.raises(SceneError, match="outside the closed mesh 'sieve'"):
            run()
        return
    np.testing.assert_allclose(run().particles.position, [*inside, [0, 0, 0]], rtol=0, atol=1e-12)


def test_a_filling_keeps_clear_of_what_its_material_touches_alone(tmp_path):
    """Blue fills a box that a red filling and a sheet of the sieve fill too: as it would alone. Together 0.7 do not fit."""
    box = {"min": [-0.02, -0.02, -0.02], "max": [0.02, 0.02, 0.02]}
    sieve = {"name": "sieve", "material": "sieve", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}

    def filled(pairs, *names):
        scene = data(pairs, {}, [sieve])
        scene["grains"] = [
            {"material": name, "fill": {"box": box, "solid_fraction": 0.35, "diameter": 0.005, "seed": 3}} for name in names
        ]
        return load_grains(Scene.model_validate(scene), {})

    sorts = [touch("red", "red"), touch("blue", "blue"), apart("blue", "sieve"), touch("red", "sieve")]
    alone = filled([*sorts, touch("red", "blue")], "blue")
    both = filled([*sorts, apart("red", "blue")], "red", "blue")
    blue = both.type == 1
    np.testing.assert_array_equal(both.position[blue], alone.position)
    assert (both.position[blue, 2] < 0.0).any() and (both.position[~blue, 2] > 0.0).all()


def test_the_wrong_side_of_a_plane_is_wrong_for_those_that_touch_it(tmp_path):
    for name in ("blue", "red"):
        given = data(SIEVE, {name: [0, 0, -0.5 * RADIUS]}, [plane()])
        if name == "blue":
            Simulation(Scene.model_validate(given), device="cpu")
            continue
        with pytest.raises(SceneError, match="behind the plane 'sieve'"):
            Simulation(Scene.model_validate(given), device="cpu")


def test_what_does_not_touch_limits_no_time_step(tmp_path):
    """Stiff and small grains that pass through each other and the mesh: only the red ones on it count."""
    def limits(pairs, groups, **changes):
        given = data(pairs, groups, [sheet(tmp_path)])
        given["materials"]["blue"] = {"density": 2500, "young_modulus": 1e9, "poisson_ratio": 0.3}
        given["grains"][-1]["radius"] = 0.1 * RADIUS if len(groups) > 1 else RADIUS
        return Simulation(Scene.model_validate(given | changes), device="cpu", threads=1).limits

    red = [[0, 0, 0.01], [0, 0, 0.0125]]
    both = {"red": red, "blue": red}
    time = {"end": 1.0, "max_speed": 1.0}
    none = [touch("red", "red"), apart("blue", "blue"), *SIEVE[2:]]
    there, alone = limits(none, both, time=time), limits(SIEVE, {"red": red}, time=time)
    assert (there.stable, there.contact_time, there.travel) == (alone.stable, alone.contact_time, alone.travel)


def test_streams_bring_grains_that_pass_through_the_others():
    """Newcomers are put into lists by another way than the rest: falling through a bed at rest, they touch only the floor."""
    bed = [[x, y, RADIUS] for x in (-2e-3, 0, 2e-3) for y in (-2e-3, 0, 2e-3)]
    pairs = [touch("red", "red"), touch("blue", "blue"), apart("red", "blue"), touch("red", "sieve"), touch("blue", "sieve")]
    stream = {"material": "blue", "diameter": 1.5e-3, "box": {"min": [-1e-3, -1e-3, 2e-3], "max": [1e-3, 1e-3, 3.7e-3]},
              "velocity": [0, 0, -1.0], "count_rate": 200.0}  # fmt: skip
    sim = simulate(pairs, {"red": bed}, [plane(name="floor")], streams=[stream])
    lowest = np.inf
    for time in np.linspace(1e-3, 0.03, 30):
        sim.run(time)
        blue = sim.particles.group == 1
        lowest = min(lowest, sim.particles.position[blue, 2].min(initial=np.inf))
    assert blue.sum() >= 3
    assert lowest < 1.2e-3  # on the floor, amid the bed
    np.testing.assert_allclose(sim.particles.position[~blue, :2], np.array(bed)[:, :2], rtol=0, atol=1e-12)


def test_each_portion_of_a_stream_keeps_clear_of_the_walls_that_it_touches():
    """Blue grains begin anywhere in a box that the sieve crosses, and fall through it; red ones begin clear of it."""
    box = {"min": [-4e-3, -4e-3, -3e-3], "max": [4e-3, 4e-3, 3e-3]}
    recipe = [{"material": kind, "diameter": 2 * RADIUS, "number_share": 1.0} for kind in ("red", "blue")]
    stream = {"recipe": recipe, "box": box, "count_rate": 2e4, "count": 40}
    for walls in ([plane(name="sieve")], [plane(name="sieve") | {"motion": {"velocity": [0, 0, 1e-3]}}]):
        sim = simulate(SIEVE, {}, walls, streams=[stream], gravity=[0, 0, 0])
        sim.run(until=4e-3)
        red, blue = (sim.particles.position[sim.particles.type == kind, 2] for kind in (0, 1))
        assert len(red) > 5 and len(blue) > 5
        assert red.min() > 0.99 * RADIUS
        assert blue.min() < -RADIUS and (np.abs(blue) < RADIUS).any()
    one = {"material": "blue", "diameter": 2 * RADIUS, "box": {"min": [-4e-3, -4e-3, -3e-3], "max": [4e-3, 4e-3, -1e-4]}}
    sim = simulate(SIEVE, {}, [plane(name="sieve")], streams=[one | {"count_rate": 100.0}])  # all of it below the sieve
    assert not any("sieve" in note for note in sim.notes)
    with pytest.raises(SceneError, match="clear of the wall 'sieve'"):
        simulate(SIEVE, {}, [plane(name="sieve")], streams=[one | {"material": "red", "count_rate": 100.0}])


def test_a_resumed_run_goes_on_bit_for_bit_and_a_start_may_change_what_touches(tmp_path):
    both, floor = mixed(), plane(name="floor")
    pairs = [touch("red", "red"), touch("blue", "blue"), apart("red", "blue"), touch("red", "sieve"), touch("blue", "sieve")]
    sim = simulate(pairs, both, [floor])
    sim.run(0.02)
    sim.save_checkpoint(tmp_path / "saved.h5")
    again = Simulation.from_checkpoint(tmp_path / "saved.h5", device="cpu", threads=1)
    for one in (sim, again):
        one.run(0.025)
    assert again.state_hash() == sim.state_hash()
    given = data([apart("blue", "blue"), touch("red", "red"), *pairs[2:]], both, [floor])
    del given["grains"]
    given["start"] = {"checkpoint": str(tmp_path / "saved.h5")}
    later = Simulation(Scene.model_validate(given), device="cpu", threads=1)
    later.run(0.005)
    contacts, group = later.contacts(), later.particles.group
    assert not (group[contacts.i[contacts.j >= 0]] == 1).any()


def test_phases_take_contact_away_and_give_it_back():
    pairs = [touch("red", "red"), touch("red", "sieve")]
    phases = [
        {"name": "on", "time": {"end": 0.01}},
        {"name": "through", "pairs": [apart("sieve", "red")], "time": {"end": 0.01}},
        {"name": "back", "pairs": [touch("red", "sieve", friction=0.1)], "time": {"end": 0.01}},
    ]
    scene = Scene.model_validate(data(pairs, {"red": [0, 0, RADIUS]}, [plane()], phases=phases))
    assert [scene.phase(k).pair("red", "sieve").contact for k in range(3)] == [True, False, True]
    assert scene.phase(2).pair("red", "sieve").friction == 0.1


@pytest.mark.parametrize(
    ("pair", "message"),
    [
        ({"contact": False, "restitution": 0.5}, r"(?s)pairs\[2\].restitution.*do not touch, contact = false"),
        ({"contact": False, "friction": 0.5}, r"(?s)pairs\[2\].friction.*leave this out"),
        ({"contact": False, "frction": 0.5}, r"pairs\[2\].frction"),
        ({"contact": True}, r"(?s)pairs\[2\].restitution.*missing"),
        ({}, r"(?s)pairs\[2\].restitution.*missing"),
        ({"contact": 0, "restitution": 0.5}, r"pairs\[2\].contact.*"),
        ({"contact": "false"}, r"pairs\[2\].contact"),
    ],
)
def test_errors(pair, message):
    given = data([*SIEVE[:2], {"materials": ["red", "blue"]} | pair], {"red": [0, 0, 0], "blue": [1, 0, 0]})
    with pytest.raises(SceneError, match=message):
        Scene.model_validate(given)


def test_what_does_not_touch_is_compiled_only_where_it_meets():
    def features(pairs, groups):
        return simulate(pairs, groups, gravity=[0, 0, 0]).plan

    without = features(SIEVE, {"red": [0, 0, 0]})
    assert not without.contact.apart and "materials that do not touch" in without.left_out
    assert "runs      materials that do not touch, left out of the lists" in features(
        SIEVE, {"red": [0, 0, 0], "blue": [1, 0, 0]}
    ).explain()


def test_toml_and_usd_give_the_same_pairs_again(tmp_path):
    pairs = [apart("red", "red"), *SIEVE[1:]]
    one = Scene.model_validate(data(pairs, {"red": [0, 0, 0.01], "blue": [0, 0, 0.02]}, [plane()]))
    (tmp_path / "a.toml").write_text(toml_text(scene_tables(one, relative_to(tmp_path))), encoding="utf-8")
    for source, target in (("a.toml", "b.usda"), ("b.usda", "c.toml")):
        convert(tmp_path / source, tmp_path / target)
    for name in ("a.toml", "b.usda", "c.toml"):
        again = load_scene(tmp_path / name)
        assert again.pairs == one.pairs and again.notes == ()
    shown = again.model_dump(mode="json")["pairs"]
    assert shown[0] == {"materials": ["red", "red"], "contact": False} and "contact" not in shown[1]
