"""A normal law with keys, constants and a history of its own: ``bridge.py`` of kernels/README.md, as it stands there."""

import re
from pathlib import Path

import numpy as np
import pytest

from warpdem import SceneError, Simulation
from warpdem.guards.energy import driven
from warpdem.measure import measures
from warpdem.model import compiled
from warpdem.scene.file import scene_from_dict
from warpdem.state import restart

PAGE = Path(__file__).resolve().parents[3] / "kernels" / "README.md"
RADIUS, TENSION, STIFFNESS, LONGEST = 1.0e-3, 0.05, 500.0, 0.1
PULL = 2.0 * np.pi * TENSION  # [N] per R*


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("bridge")
    text = re.search(r"```python\n(# bridge\.py.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)[1]
    (made / "bridge.py").write_text(text)
    return made


def data(**changes) -> dict:
    """A grain that leaves a grain and one that leaves a floor, both from an overlap of 1 um, faster than their bridges hold."""
    speed = 0.05
    return {
        "gravity": [0, 0, 0],
        "materials": {"g": {"density": 2500, "young_modulus": 5e6, "poisson_ratio": 0.3}},
        "contact": {"normal": "bridge.py", "tangential": "none"},
        "pairs": [{"materials": ["g", "g"], "restitution": 1.0, "stiffness": STIFFNESS, "tension": "50 mJ/m^2"}],
        "grains": [
            {
                "material": "g",
                "radius": RADIUS,
                "positions": [[0, 0, 0.1], [2 * RADIUS - 1e-6, 0, 0.1], [0.1, 0, RADIUS - 1e-6]],
                "velocities": [[-speed, 0, 0], [speed, 0, 0], [0, 0, 0.12]],
            }
        ],
        "walls": [{"name": "floor", "material": "g", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}],
        "time": {"end": 1.0, "step": 2e-6, "max_speed": 1e-3},
        **changes,
    }


def simulation(folder, changes=None, **keywords) -> Simulation:
    return Simulation(scene_from_dict(data(**changes or {}), folder), device="cpu", threads=1, **keywords)


@pytest.mark.parametrize("resident", [False, True], ids=["steps", "graph"])
def test_a_bridge_forms_by_touch_pulls_as_r_star_says_and_breaks_at_its_length(folder, resident):
    sim = simulation(folder, resident=resident)
    assert sim.plan.contact.history.names == ("joined",)
    assert sim.plan.contact.gap == pytest.approx(1.5 * LONGEST * RADIUS)
    seen = {0: [], 2: []}
    for _ in range(30):
        sim.step(50)
        c = sim.contacts()
        for i in seen:
            for k in np.flatnonzero(c.i == i):
                seen[i].append((c.overlap[k], c.force[k] @ c.normal[k], c.own["joined"][k]))
    for i, reduced in ((0, 0.5 * RADIUS), (2, RADIUS)):
        overlap, force, joined = np.array(seen[i]).T
        within = overlap > -LONGEST * reduced
        assert (overlap[within] < 0).any() and (~within).any(), "it must pass through the bridge's length"
        assert (joined == within).all()
        expected = STIFFNESS * np.maximum(overlap, 0.0) - within * PULL * reduced
        np.testing.assert_allclose(force, expected, rtol=1e-9, atol=1e-15)


def test_without_a_touch_there_is_no_bridge_and_energy_is_kept_while_there_is_one(folder):
    apart = {"positions": [[0, 0, 0.1], [2.02 * RADIUS, 0, 0.1]], "velocities": [[-0.01, 0, 0], [0.01, 0, 0]]}
    sim = simulation(folder, {"grains": [{"material": "g", "radius": RADIUS, **apart}]})
    sim.step(20)
    assert sim.contacts().own["joined"].tolist() == [0.0]
    assert sim.contacts().force.tolist() == [[0.0, 0.0, 0.0]]
    sim = simulation(folder)
    sim.step(1)
    first = sum(sim.energy().values())
    kinetic = sim.energy()["kinetic"]
    sim.step(200)
    assert sim.contacts().own["joined"].tolist() == [1.0, 1.0]
    assert abs(sim.energy()["kinetic"] - kinetic) > 0.05 * kinetic
    # uneven only where the spring ends: (1/2) k d dt v of it there
    assert sum(sim.energy().values()) == pytest.approx(first, rel=1e-3)


def meeting(folder, step, **keywords):
    """A grain that meets a grain and one that meets a floor, with the energies that they have and lose added up."""
    grains = {
        "positions": [[0, 0, 0.1], [2.004 * RADIUS, 0, 0.1], [0.1, 0, 1.004 * RADIUS]],
        "velocities": [[0.05, 0, 0], [-0.05, 0, 0], [0, 0, -0.12]],
    }
    changes = {
        "grains": [{"material": "g", "radius": RADIUS, **grains}],
        "measures": {"energy": True},
        "time": {"end": 1.0, "step": step, "max_speed": 1e-3},
    }
    return simulation(folder, changes, **keywords)


def test_energy_closes_over_bridges_that_form_and_break(folder):
    errors = []
    for step in (8e-6, 4e-6, 2e-6):
        sim = meeting(folder, step)
        motion, worst = sim.energy()["kinetic"], 0.0
        for _ in range(30):
            sim.step(round(1.6e-4 / step))
            worst = max(worst, abs(sim.budget.energy()["integration_error"]) / motion)
        errors.append(worst)
    budget = sim.budget.energy()
    assert sim.contacts().own["joined"].sum() == 0.0
    # what a bridge holds is lost when it forms: F_b s R*
    lost = PULL * LONGEST * ((0.5 * RADIUS) ** 2 + RADIUS**2)
    assert budget["dissipated_liquid"] == pytest.approx(lost, rel=1e-12)
    assert motion - sim.energy()["kinetic"] == pytest.approx(lost, rel=4 * errors[-1])
    assert errors[-1] < 1e-3
    assert errors[0] > 4 * errors[-1]


def test_losses_are_the_same_bits_in_the_graph_and_after_a_resume(folder, tmp_path):
    whole, graph, cut = meeting(folder, 8e-6), meeting(folder, 8e-6, resident=True), meeting(folder, 8e-6)
    for sim in (whole, graph):
        sim.step(400)
    cut.step(150)
    cut.save_checkpoint(tmp_path / "saved.h5")
    again = Simulation.from_checkpoint(tmp_path / "saved.h5", device="cpu", threads=1, plugins=[folder / "bridge.py"])
    again.step(250)
    assert whole.budget.energy()["dissipated_liquid"] > 0.0
    assert graph.budget.energy() == whole.budget.energy() == again.budget.energy()
    assert graph.state_hash() == whole.state_hash() == again.state_hash()


def test_what_a_law_loses_is_a_column_of_the_history(folder):
    scene = scene_from_dict(data(measures={"energy": True}), folder)
    names = [column.header for column in measures.columns(scene)]
    assert "dissipated_liquid [J]" in names
    assert not any("adhesion" in name or "plasticity" in name for name in names)


def test_a_law_that_attracts_may_be_watched(folder):
    """Two grains that a bridge holds together swing for ever, their energy negative: that is no alarm."""
    near = {"positions": [[0, 0, 0.1], [2 * RADIUS - 1e-8, 0, 0.1]]}
    changes = {"grains": [{"material": "g", "radius": RADIUS, **near}], "walls": []}
    sim = simulation(folder, changes)
    assert not driven(sim.model)
    lowest = 0.0
    for _ in range(60):
        sim.step(40)
        lowest = min(lowest, sum(sim.energy().values()))
        sim.guards.look()
    assert lowest < 0.0
    assert not sim.noticed


def test_the_law_is_evaluated_in_lanes(folder):
    assert not compiled.no_lanes(meeting(folder, 8e-6).plan)


def test_the_history_survives_a_checkpoint_and_a_new_start(folder, tmp_path):
    whole = simulation(folder)
    whole.step(150)
    whole.save_checkpoint(tmp_path / "saved.h5")
    again = Simulation.from_checkpoint(
        tmp_path / "saved.h5", device="cpu", threads=1, plugins=[folder / "bridge.py"]
    )
    started = Simulation(restart.started_from(whole.scene, tmp_path / "saved.h5"), device="cpu", threads=1)
    for sim in (whole, again, started):
        sim.step(50)
        assert sim.contacts().own["joined"].tolist() == [1.0, 1.0]
    assert again.state_hash() == whole.state_hash()
    np.testing.assert_allclose(started.particles.position, whole.particles.position, rtol=0, atol=1e-12)


def test_scalars_of_the_history_do_not_turn_with_the_axes_and_stay_through_new_lists(folder):
    still = simulation(folder)
    turning = simulation(folder, {
        "frame": {"axis": [1, 2, 3], "rate": 5.0}, "engine": {"skin": 1e-5},
        "contact": {"normal": "bridge.py", "tangential": "mindlin"},
        "pairs": [{**data()["pairs"][0], "friction": 0.3}],
    })  # fmt: skip
    for sim in (still, turning):
        sim.step(200)
    assert turning.plan.contact.history.names == ("spring", "load", "joined")
    assert turning.lists.inner_rebuilds > 1
    pair = [sim.contacts().own["joined"][0] for sim in (still, turning)]
    assert pair == [1.0, 1.0]


@pytest.mark.parametrize(
    ("pair", "words"),
    [
        ({"tensoin": 0.05}, ["pairs[0].tensoin = 0.05", 'did you mean "tension"', "missing: Surface tension"]),
        ({"tension": "50 mN"}, ["pairs[0].tension", "must be a surface energy"]),
        ({"tension": -1.0}, ["pairs[0].tension = -1.0", ">= 0"]),
    ],
)
def test_keys_of_a_law_are_checked_as_those_of_the_scene(folder, pair, words):
    given = {k: v for k, v in data()["pairs"][0].items() if k != "tension"}
    with pytest.raises(SceneError) as error:
        scene_from_dict(data(pairs=[given | pair]), folder)
    for word in words:
        assert word in str(error.value)


def test_keys_of_a_law_have_defaults_and_are_refused_without_the_law(folder):
    [pair] = scene_from_dict(data(), folder).pairs
    assert (pair.tension, pair.longest) == (0.05, LONGEST)
    with pytest.raises(SceneError, match=r"pairs\[0\]\.tension = \"50 mJ/m\^2\"\n\s+unknown key"):
        scene_from_dict(data(contact={"normal": "hooke", "tangential": "none"}), folder)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('{"joined": "-"}', '["joined"]', "HISTORY = ['joined']: must be a dict: name -> unit"),
        ('{"joined": "-"}', '{"overlap": "-"}', "HISTORY: the name 'overlap' is taken"),
        ('"J/m2", None', '"J/furlong", None', "PAIR['tension']: unit 'J/furlong' is not known"),
        ('("J/m2", None, "Surface tension g of the liquid [J/m2], >= 0.")', '"J/m2"', "PAIR['tension'] = 'J/m2': must be"),
        ("pair.tension, pair.longest\n", "pair.tension\n", "four finite numbers and pull, longest are needed"),
        ('LOSSES = ("liquid",)', 'LOSSES = ("heat",)', "LOSSES = ('heat',): must be a tuple of some of \"adhesion\", "),
        ('LOSSES = ("liquid",)', 'LOSSES = ("liquid", "liquid")', "each once"),
        ('LOSSES = ("liquid",)', 'LOSSES = "liquid"', "LOSSES = 'liquid': must be a tuple"),
    ],
)
def test_a_law_that_cannot_be_laid_out_is_refused(folder, tmp_path, old, new, words):
    text = (folder / "bridge.py").read_text()
    assert old in text
    (tmp_path / "bridge.py").write_text(text.replace(old, new))
    with pytest.raises(SceneError) as error:
        scene_from_dict(data(), tmp_path)
    assert words in str(error.value)
