"""Liquid in a run: no count is lost over bridges, streams, outlets and wet walls; bits; results; bad input is named."""

import numpy as np
import pytest

from warpdem import Scene, Simulation
from warpdem.errors import SceneError
from warpdem.output.result_arrays import contact_arrays, grain_arrays
from warpdem.ranks.portion import made
from warpdem.state import contact_history, restart

GLASS = {"density": 2500, "young_modulus": "2 MPa", "poisson_ratio": 0.3}
STREAM_RADIUS, STREAM_CONTENT = 0.6e-3, 0.01


def slope(**changes) -> Scene:
    """Grains that rain on a wet slope, stick, slide and leave at its end; walls that are dry beside it."""
    data = {
        "materials": {"g": GLASS},
        "contact": {"liquid": "bridge"},
        "pairs": [{"materials": ["g", "g"], "restitution": 0.8, "friction": 0.3, "surface_tension": "20 mN/m",
                   "contact_angle": "20 deg"}],
        "walls": [
            {"name": "floor", "material": "g", "plane": {"point": [0, 0, 0], "normal": [0.4, 0, 1]}, "liquid_film": "20 um"},
            {"name": "left", "material": "g", "plane": {"point": [0, 0, 0], "normal": [1, 0, 0]}},
            {"name": "back", "material": "g", "plane": {"point": [0, 0, 0], "normal": [0, 1, 0]}},
            {"name": "front", "material": "g", "plane": {"point": [0, 0.01, 0], "normal": [0, -1, 0]}},
        ],
        "grains": [{"name": "wet", "material": "g", "liquid_content": "2 %", "fill": {
            "box": {"min": [0.001, 0.001, 0.001], "max": [0.012, 0.009, 0.009]}, "count": 60, "diameter": "1.6 mm"}}],
        "streams": [{"name": "rain", "material": "g", "liquid_content": STREAM_CONTENT, "diameter": 2 * STREAM_RADIUS,
                     "box": {"min": [0.001, 0.001, 0.012], "max": [0.008, 0.009, 0.015]}, "count_rate": 1500,
                     "velocity": [0.2, 0, -1]}],
        "outlets": [{"name": "end", "box": {"min": [0.012, -0.01, -0.05], "max": [0.05, 0.02, 0.05]}}],
        "time": {"end": 1.0, "step": 1.5e-5, "max_speed": 1.0},
        "engine": {"max_overlap": 0.3},
    }  # fmt: skip
    return Scene.model_validate(data | changes)


def inflow(sim: Simulation) -> int:
    """Counts that the stream has brought so far."""
    film = STREAM_CONTENT * 4.0 / 3.0 * np.pi * STREAM_RADIUS**3
    return (sim.state.next_id - 60) * int(np.rint(film / sim.model.liquid.quantum))


@pytest.mark.parametrize("engine", [{}, {"precision": "mixed"}], ids=["double", "mixed"])
def test_no_count_is_lost_with_streams_outlets_and_wet_walls(engine):
    sim = Simulation(slope(engine={"max_overlap": 0.3} | engine), device="cpu", threads=1)
    start = sim.liquid()
    for _ in range(12):
        sim.step(300)
        now = sim.liquid()
        assert now.brought == start.brought + inflow(sim)
    assert now.bridge_count > 30 and now.from_walls > 0 and now.left > 0
    assert sim.left["end"][0] > 10 and sim.state.next_id > 100
    assert (sim.state.film.numpy()[:, 0] >= 0).all()


def test_bits_over_threads_lists_graph_and_resume_while_grains_come_and_go(tmp_path):
    plain = Simulation(slope(), device="cpu", threads=1)
    plain.step(1700)
    plain.save_checkpoint(tmp_path / "c.h5")
    saved = plain.liquid()
    plain.step(700)
    for keywords in ({"threads": 2}, {"threads": 1, "resident": True}):
        other = Simulation(slope(), device="cpu", **keywords)
        other.step(2400)
        assert other.state_hash() == plain.state_hash()
    rebuilt = Simulation(slope(engine={"max_overlap": 0.3, "skin": 2e-5}), device="cpu", threads=1)
    rebuilt.step(2400)
    assert rebuilt.lists.rebuilds > 2 * plain.lists.rebuilds and rebuilt.state_hash() == plain.state_hash()
    again = Simulation.from_checkpoint(tmp_path / "c.h5", device="cpu", threads=1)
    assert again.liquid() == saved
    again.step(700)
    assert again.state_hash() == plain.state_hash() and again.liquid() == plain.liquid()


def test_a_bridge_that_has_just_broken_gives_back_its_liquid_after_a_resume(tmp_path):
    """It is in no list any more that a dry contact at its distance would be in, but its last force and gifts are due."""
    sim, broken = Simulation(slope(), device="cpu", threads=1), 0
    sim.step(900)
    while broken == 0:
        sim.step(1)
        pairs = contact_history.read(sim.view)
        empty = made(pairs["pair_own_bridge"]) == 0.0
        broken = np.count_nonzero(made(pairs["pair_share_i"])[empty, -1] > 0.0)
    sim.save_checkpoint(tmp_path / "c.h5")
    again = Simulation.from_checkpoint(tmp_path / "c.h5", device="cpu", threads=1)
    assert again.liquid() == sim.liquid()
    for run in (sim, again):
        run.step(200)
    assert again.state_hash() == sim.state_hash() and again.liquid() == sim.liquid()


def test_another_scene_takes_the_liquid_over_to_the_last_count(tmp_path):
    first = Simulation(slope(), device="cpu", threads=1)
    first.step(1500)
    first.save_checkpoint(tmp_path / "c.h5")
    held = first.liquid()
    walls = [wall.model_dump(mode="json", exclude_unset=True) for wall in slope().walls]
    for change in ({"streams": []}, {"streams": [], "walls": walls[:1]}, {"contact": {"liquid": "bridge_rabinovich"}}):
        onward = Simulation(restart.started_from(slope(**change), tmp_path / "c.h5"), device="cpu", threads=1)
        now = onward.liquid()
        assert (now.left, now.from_walls, now.quantum) == (0, 0, held.quantum)
        assert now.brought == held.films + held.bridges, change
        onward.step(50)
        assert onward.liquid().brought == now.brought + (0 if "streams" in change else inflow(onward) - inflow(first))


def test_results_hold_films_and_bridges(tmp_path):
    sim = Simulation(slope(output={"contacts": True}), device="cpu", threads=1)
    sim.step(900)
    shot, totals = sim.snapshot(), sim.liquid()
    assert grain_arrays(shot)["liquid"].sum() == pytest.approx(totals.volume("films"), rel=1e-12)
    bridges = contact_arrays(shot.contacts)[1]["bridge"]
    assert np.count_nonzero(bridges) == totals.bridge_count > 5
    assert bridges.sum() == pytest.approx(totals.volume("bridges"), rel=1e-12)
    apart = shot.contacts.overlap < 0.0
    assert (bridges[apart] > 0.0).all() and (shot.contacts.normal_force[apart] < 0.0).all()
    row = sim.measure()
    assert row["liquid brought [m3]"] == totals.volume("brought") and row["liquid bridge_count [-]"] == totals.bridge_count


def gas(**changes) -> Scene:
    """A thousand wet grains that fly about in a box with a wet floor, more that come, and a hole in a corner."""
    walls = [("floor", [0, 0, 0], [0, 0, 1]), ("lid", [0, 0, 0.02], [0, 0, -1]), ("left", [0, 0, 0], [1, 0, 0]),
             ("right", [0.02, 0, 0], [-1, 0, 0]), ("front", [0, 0, 0], [0, 1, 0]),
             ("back", [0, 0.02, 0], [0, -1, 0])]  # fmt: skip
    grid = (np.stack(np.meshgrid(*[np.arange(10)] * 3, indexing="ij"), axis=-1).reshape(-1, 3) + 1) * 1.8e-3
    group = {"name": "wet", "material": "g", "radius": "0.5 mm", "positions": grid, "liquid_content": 0.02,
             "velocities": np.random.default_rng(1).normal(0.0, 0.7, (1000, 3))}  # fmt: skip
    stream = {"name": "rain", "material": "g", "liquid_content": STREAM_CONTENT, "diameter": 2 * STREAM_RADIUS,
              "box": {"min": [0.01, 0.01, 0.012], "max": [0.018, 0.018, 0.018]}, "count_rate": 300, "velocity": [0, 0, -1]}
    data = slope().model_dump(mode="json", exclude_unset=True) | {
        "gravity": [0, 0, 0],
        "pairs": [{"materials": ["g", "g"], "restitution": 1.0, "surface_tension": "0.1 mN/m"}],
        "walls": [{"name": name, "material": "g", "plane": {"point": point, "normal": normal},
                   "liquid_film": "1 um" if name == "floor" else 0.0} for name, point, normal in walls],
        "grains": [group], "streams": [stream],
        "outlets": [{"name": "end", "box": {"min": [0, 0, 0], "max": [0.0015, 0.0015, 0.0015]}}],
        "materials": {"g": {**GLASS, "young_modulus": "20 MPa"}}, "time": {"end": 10.0, "step": 6e-6, "max_speed": 3.0},
    }  # fmt: skip
    return Scene.model_validate(data | changes)


def ruptures(sim: Simulation) -> int:
    """Bridges between grains that broke in the last step: each gives a gift to two grains."""
    listed = sim.lists.view()
    slot, row = listed.slot_i.numpy().ravel(), listed.slot_force.numpy()
    return int(np.count_nonzero(row[slot[slot < len(row) - 1], -1]))


@pytest.mark.slow
def test_a_million_births_and_ruptures_lose_no_count():
    sim = Simulation(gas(), device="cpu", threads=1)
    start, broken, sampled = sim.liquid(), 0.0, 0
    while broken < 1.0e6:
        sim.step(480)
        found = 0
        for _ in range(20):  # a twenty-fifth of all steps is looked at one by one
            sim.step(1)
            found += ruptures(sim)
        sampled += found
        broken += 25.0 * found
        now = sim.liquid()
        assert now.brought == start.brought + (sim.state.next_id - 1000) * int(
            np.rint(STREAM_CONTENT * 4.0 / 3.0 * np.pi * STREAM_RADIUS**3 / now.quantum)
        )
    assert sampled > 30_000 and sim.left["end"][0] > 100 and now.left > 0 and now.from_walls != 0


BAD = {
    "liquid on grains without a law": (
        {"contact": {}, "pairs": [{"materials": ["g", "g"], "restitution": 0.8}]},
        r'grains\[0\].liquid_content = .*contact.liquid = "none": choose contact.liquid = "bridge"',
    ),
    "a negative surface tension": ({"surface_tension": "-1 mN/m"}, r"pairs\[0\].surface_tension.*must be .*0"),
    "no surface tension": ({"surface_tension": None}, r'surface_tension.*missing; contact.liquid = "bridge" needs'),
    "a liquid that does not wet": ({"contact_angle": "95 deg"}, r"contact_angle.*must be below 90 deg"),
    "a viscosity without a roughness": ({"viscosity": "1 mPa s"}, r"roughness.*missing: with a viscosity"),
    "a unit of another kind": ({"surface_tension": "72 mPa"}, r"surface_tension.*mPa.* is not"),
    "a key of another law": ({"surface_energy": 0.1}, r"surface_energy.*only for contact.normal"),
    "more liquid than grain": ({"liquid_content": 1.5}, r"grains\[0\].liquid_content = 1.5.*must be .*1"),
    "several stages": ({"integrator": "rk4"}, r"engine.integrator = .*liquid changes hands once per step"),
    "a group of two contents": ({"second": 0.05}, r'grains\[1\].*the group "wet" has grains of liquid_content 0.02'),
}


@pytest.mark.parametrize("case", BAD)
def test_what_a_scene_may_not_ask_for_is_named(case):
    given, words = BAD[case]
    data = slope().model_dump(mode="json", exclude_unset=True)
    pair, group = data["pairs"][0], data["grains"][0]
    for key, value in given.items():
        if key in ("contact", "pairs"):
            data[key] = value
        elif key == "liquid_content":
            group[key] = value
        elif key == "integrator":
            data["engine"][key] = value
        elif key == "second":
            data["grains"].append({**group, "liquid_content": value})
        elif value is None:
            del pair[key]
        else:
            pair[key] = value
    with pytest.raises(SceneError, match=f"(?s){words}"):
        Scene.model_validate(data)


def test_keys_of_liquid_without_a_law_of_bridges_are_named():
    data = slope().model_dump(mode="json", exclude_unset=True)
    data["contact"] = {}
    with pytest.raises(SceneError, match=r'(?s)surface_tension.*only for contact.liquid = "bridge" or "bridge_rabinovich"'):
        Scene.model_validate(data)
    with pytest.raises(SceneError, match="there is no liquid"):
        dry = {"materials": {"g": GLASS}, "pairs": [{"materials": ["g", "g"], "restitution": 0.8}], "time": {"end": 1},
               "grains": [{"material": "g", "radius": "1 mm", "positions": [[0, 0, 0]]}]}  # fmt: skip
        Simulation(Scene.model_validate(dry), device="cpu").liquid()
