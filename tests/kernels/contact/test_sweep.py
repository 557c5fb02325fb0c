"""Contacts in lanes: the bits of the law by itself, for every combination of models; a law that cannot be in lanes."""

from itertools import product
from pathlib import Path

import numpy as np
import pytest
import warp as wp
from warpdem.kernels import grain
from warpdem.kernels.contact import columns, dissipation, law, pairs
from warpdem.kernels.normal import hertz, hooke
from warpdem.kernels.rolling import constant, spring
from warpdem.kernels.step import border
from warpdem.kernels.tangential import mindlin, mindlin_displacement

from lane_probes import assert_same_bits
from switches import in_lanes
from warpdem import Scene, Simulation
from warpdem.model import compiled, lanes
from warpdem.scene.file import scene_from_dict

REALS = {"double": wp.float64, "single": wp.float32}
PERIOD = (0.05, 0.0, 0.04)


def contacts(made, n: int) -> dict:
    """Arguments of ``contact``: unequal grains apart, in touch and deep in each other; some at rest, some across a border."""
    rng = np.random.default_rng(7)
    real, width, of = made.real, grain.WIDTH[made.spins], made.law
    i, j = rng.normal(0, 1, (2, n, width))
    radius, normal = rng.uniform(0.5e-3, 1.5e-3, (2, n)), rng.normal(0, 1, (n, 3))
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    i[:, :3] *= 1e-2
    j[:, :3] = i[:, :3] - normal * (radius.sum(axis=0) * (1 - rng.uniform(-0.03, 0.05, n)))[:, None]
    j[:, :3] += np.array(PERIOD) * rng.integers(-1, 2, (n, 3))
    i[:, 3], j[:, 3] = radius
    if made.spins:
        i[:, 10:13] *= 50
        j[:, 10:13] *= 50
    i[::97, 4:] = j[::97, 4:]  # no relative motion
    given = {"stiffness": (1e5, 1e6), "damping": (0.0, 4.0), "inverse_mass": (1e5, 1e6)}
    constants = np.column_stack([rng.uniform(*given[name], n) for name in columns.OF_CONTACT])
    coefficients = rng.uniform(0.1, 1.0, (n, of.at.width))
    coefficients[::5, of.at.friction] = 0.0
    memory = rng.normal(0, 1e-6, (n, max(made.memory.width, 1)))
    memory[:, 3:] *= 1e4
    memory[::11] = 0.0
    record = grain.build(made.spins).Record
    return {
        "gi": (record, i),
        "gj": (record, j),
        "k": (of.Constants, constants),
        "radius": (real, radius[0] * radius[1] / radius.sum(axis=0)),
        "inertia": (real, rng.uniform(1e-12, 1e-11, n)),
        "c": (of.Coefficients, coefficients),
        "remembered": (made.memory.Memory, memory),
        "slip_time": (wp.float64, np.full(n, 1e-6)),
        "kick": (wp.float64, np.full(n, 1e-6)),
        "dt": (wp.float64, rng.uniform(1e-7, 2e-6, n)),
    }


def assert_lanes_have_the_bits_of(real, models, torsion: bool, energy: bool, lanes: int, n: int) -> None:
    of = law.build(real, *models, torsion)
    parts = dissipation.build(real, *models, torsion)[0] if energy else None
    kept = {"impulses": dissipation.impulses(*models)} if energy else {}
    made = pairs.build(
        real, of, parts, border.build(PERIOD, (0.0, 0.0, 0.0)), spins=bool(models[1] or models[2]), gap=0.0, **kept
    )
    number9 = wp.types.vector(9, real)
    results = (number9, made.memory.Memory, real, real, made.memory.Losses)
    force, now, ratio, approach, lost = assert_same_bits(made.contact, contacts(made, n), results, lanes)
    assert all(np.isfinite(a).all() for a in (force, now, ratio, approach, lost))
    touching = ratio[:, 0] > 0
    assert n / 4 < touching.sum() < 3 * n / 4
    assert np.count_nonzero(force[touching].any(axis=1)) > 0.99 * touching.sum()
    assert bool(np.count_nonzero(now)) == bool(energy or models[1] or models[2] is spring)
    assert bool(np.count_nonzero(lost)) == energy


@pytest.mark.parametrize(("precision", "lanes"), [("double", 8), ("single", 8), ("double", 4)])
@pytest.mark.parametrize(
    ("models", "torsion", "energy"),
    [
        ((hertz, mindlin, spring), False, True),
        ((hooke, mindlin_displacement, constant), True, True),
        ((hooke, None, None), False, False),
    ],
    ids=["hertz-mindlin-spring", "hooke-displacement-constant", "hooke"],
)
def test_a_contact_in_lanes_has_the_bits_of_the_law(models, torsion, energy, precision, lanes):
    assert_lanes_have_the_bits_of(REALS[precision], models, torsion, energy, lanes, 4096)


@pytest.mark.slow
@pytest.mark.parametrize("lanes", [4, 8])
@pytest.mark.parametrize("precision", REALS)
@pytest.mark.parametrize("rolling", [(None, False), *product((constant, spring), (False, True))])
@pytest.mark.parametrize("tangential", [None, mindlin, mindlin_displacement])
@pytest.mark.parametrize("normal", [hertz, hooke])
def test_every_combination_of_models_has_the_bits_of_the_law(normal, tangential, rolling, precision, lanes):
    assert_lanes_have_the_bits_of(
        REALS[precision], (normal, tangential, rolling[0]), rolling[1], True, lanes, 1_000_000
    )


# --- scenes ------------------------------------------------------------------------------------------------------------


def scene(folder: Path, *, pair: dict | None = None, different: bool = False, spins: bool = True, **changes):
    """Grains of two sizes and materials that fall on each other and on a floor."""
    rng = np.random.default_rng(11)
    cell = np.stack(np.meshgrid(*[np.arange(3)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    values = {"restitution": 0.6, "friction": 0.5, "rolling_friction": 0.1} | (pair or {})
    glass = {"density": 2500, "young_modulus": 1e7, "poisson_ratio": 0.3}
    couples = [{"materials": [*names]} | values for names in ("aa", "ab", "bb")]
    if different:
        couples = [one | {key: of[k] for key, of in DIFFERENT.items()} for k, one in enumerate(couples)]

    def group(k: int) -> dict:
        n = len(cell[k::2])
        out = {
            "material": "ab"[k],
            "positions": (cell * 2.0e-3 + [0, 0, 1.02e-3])[k::2],
            "velocities": rng.normal(0, 0.1, (n, 3)),
        }
        out["radii"] = rng.uniform(0.95, 0.999, n) * 1e-3
        return out | ({"spins": rng.normal(0, 50, (n, 3))} if spins else {})

    contact = {"normal": "hertz", "tangential": "mindlin", "rolling": "spring"} | changes.pop("contact", {})
    data = {
        "gravity": [0, 0, -200],
        "materials": {name: glass for name in "ab"},
        "contact": contact,
        "pairs": couples,
        "grains": [group(0), group(1)],
        "walls": [{"name": "floor", "material": "a", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}],
        "time": {"end": 1, "step": 1e-5, "max_speed": 1},
        "engine": {"max_overlap": 0.3},
    }
    return scene_from_dict(data | changes, folder)


README = (Path(__file__).parents[3] / "kernels" / "README.md").read_text()
BRIDGE = "# bridge.py:" + README.split("# bridge.py:", 1)[1].split("```", 1)[0]
AGAIN = """        for _k in range(int(joined + real(1.0))):
            within = within * real(1.0)
"""
LOOP = BRIDGE.replace("        load = touching", f"{AGAIN}        load = touching")
BORDERS = {axis: {"min": -0.1e-3, "max": 8.9e-3, "kind": "periodic"} for axis in "xy"}
TURNING = {"frame": {"axis": [0, 1, 0.2], "schedule": [{"rate": 40}]}}
ENERGY = {"measures": {"energy": True, "momentum": True}}
MIXED = {"engine": {"precision": "mixed", "max_overlap": 0.3}}
DIFFERENT = {"friction": (0.5, 0.2, 0.4), "restitution": (0.6, 0.9, 0.7), "rolling_friction": (0.1, 0.1, 0.3)}
FEATURES = {
    "all of it": {},
    "frictionless": {"pair": {"friction": 0.0, "rolling_friction": 0.0}, "spins": False},
    "constant rolling with torsion": {"contact": {"rolling": "constant", "torsion": True}},
    "displacement, energy": {"contact": {"tangential": "mindlin_displacement"}} | ENERGY,
    "hooke": {"contact": {"normal": "hooke", "rolling": "constant"}, "pair": {"stiffness": 500.0}},
    "table": {"different": True},
    "turning frame": TURNING,
    "borders": {"borders": BORDERS},
    "mixed, table": {"different": True} | MIXED,
    "mixed, turning, energy": TURNING | ENERGY | MIXED,
    "energy": ENERGY,
    "energy, frictionless": {"pair": {"friction": 0.0, "rolling_friction": 0.0}, "spins": False} | ENERGY,
    "stages": {"engine": {"integrator": "rk4", "max_overlap": 0.3}},
    "jkr, table, energy": {"contact": {"normal": "jkr"}, "pair": {"surface_energy": 0.05}, "different": True} | ENERGY,
    "jkr, turning, mixed": {"contact": {"normal": "jkr"}, "pair": {"surface_energy": 0.05}} | TURNING | MIXED,
    "user's law": {"contact": {"normal": "bridge.py"}, "pair": {"stiffness": 500.0, "tension": 0.01}},
}


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "bridge.py").write_text(BRIDGE)
    (tmp_path / "loop.py").write_text(LOOP)
    return tmp_path


def run(of, monkeypatch, lanes: int, threads: int = 1) -> Simulation:
    sim = in_lanes(of, lanes, monkeypatch, threads)
    sim.step(500)
    return sim


def assert_lanes_change_no_bit(of, monkeypatch, *ways: tuple[int, int]) -> None:
    """One lane is the law by itself, without a sweep; ``ways``: lanes and threads."""
    alone = run(of, monkeypatch, 1)
    assert np.count_nonzero(alone.contacts().j >= 0) > 4
    for width, threads in ways:
        sim = run(of, monkeypatch, width, threads)
        assert sim.state_hash() == alone.state_hash(), width
        if of.measures.energy:
            np.testing.assert_array_equal(sim.state.energies.numpy(), alone.state.energies.numpy())


@pytest.mark.parametrize("feature", FEATURES)
def test_lanes_change_no_bit(feature, folder, monkeypatch):
    assert_lanes_change_no_bit(scene(folder, **FEATURES[feature]), monkeypatch, (8, 1))


@pytest.mark.slow
@pytest.mark.parametrize("feature", FEATURES)
def test_width_and_threads_change_no_bit(feature, folder, monkeypatch):
    assert_lanes_change_no_bit(scene(folder, **FEATURES[feature]), monkeypatch, (4, 2), (2, 1))


def test_what_the_translator_has_not_foreseen_goes_one_by_one_and_is_said(folder, monkeypatch):
    of = scene(folder, **FEATURES["user's law"])
    swept = run(of, monkeypatch, 8, 1)

    def stumbles(*_):
        raise KeyError("an unknown word")

    monkeypatch.setattr(compiled.sweep, "translated", stumbles)
    alone = Simulation(of, device="cpu", threads=1)
    alone.step(500)
    assert any("the translation to registers fails: KeyError: 'an unknown word'" in line for line in alone.plan.explain())
    assert alone.state_hash() == swept.state_hash()


def test_a_law_that_cannot_be_in_lanes_is_evaluated_by_itself_and_the_reason_is_told(folder, monkeypatch):
    straight = scene(folder, **FEATURES["user's law"])
    looping = scene(folder, **FEATURES["user's law"] | {"contact": {"normal": "loop.py"}})
    sims = [Simulation(of, device="cpu", threads=1) for of in (straight, looping)]
    line = 1 + next(k for k, text in enumerate(LOOP.splitlines()) if "int(joined" in text)
    why = f"contacts side by side: {folder / 'loop.py'}, line {line}: a loop whose length depends on data"
    assert [any(why in told for told in sim.plan.explain()) for sim in sims] == [False, True]
    assert [sim.plan.backend.lanes > 1 for sim in sims] == [True, False]
    for sim in sims:
        sim.step(300)
    assert sims[0].state_hash() == sims[1].state_hash()


def test_lanes_go_by_processor_and_size(monkeypatch):
    monkeypatch.setattr(lanes, "wide_registers", lambda: True)
    assert [lanes.simd_lanes(n, "double") for n in (100, lanes.IN_CACHE, lanes.IN_CACHE + 1)] == [8, 8, 4]
    assert lanes.simd_lanes(lanes.IN_CACHE + 1, "mixed") == 8
    monkeypatch.setattr(lanes, "wide_registers", lambda: False)
    assert [lanes.simd_lanes(100, precision) for precision in ("double", "mixed")] == [4, 4]


@pytest.mark.parametrize("lanes", [1, 4])
def test_a_state_that_is_no_number_is_not_passed_over(lanes, monkeypatch):
    """Batches out of reach are passed over without their law; forces from a position that is no number are none either."""
    of = Scene.model_validate({
        "materials": {"g": {"density": 2500.0, "young_modulus": 1e7, "poisson_ratio": 0.3}},
        "contact": {"tangential": "none"}, "pairs": [{"materials": ["g", "g"], "restitution": 0.5}],
        "grains": [{"material": "g", "radius": 1e-3, "positions": [[0, 0, 0], [0.001999, 0, 0]]}],
        "time": {"end": 1.0, "step": "2 us", "max_speed": 1.0},
    })  # fmt: skip
    sim = in_lanes(of, lanes, monkeypatch)
    sim.prepare()
    assert np.isfinite(sim.lists.slot_force.numpy()[:2]).all()
    record = sim.state.record.numpy().copy()
    record[1, 0] = np.nan
    sim.state.record.assign(record)
    sim.engine.advance(0, True)
    assert np.isnan(sim.lists.slot_force.numpy()[:2, 0]).all()
