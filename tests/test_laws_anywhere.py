"""Every normal law of the package: bits in lanes, threads, graph and resume; frames, mixed precision, phases and budgets."""

import numpy as np
import pytest

from law_beds import in_a_bed
from switches import in_lanes
from warpdem import Scene, Simulation
from warpdem.scene.models import model_names
from warpdem.state import restart

WITH = " + "
"""Between a normal law and a law of liquid bridges."""

LAWS = {law: keys for law in model_names("normal") if (keys := in_a_bed(law)) is not None} | {
    "hertz + bridge": {
        "surface_tension": 0.07, "contact_angle": "20 deg", "viscosity": "5 mPa s", "roughness": "2 um"
    },
}
TWISTING = {"hertz_clamped", "jkr", "luding"}
"""Laws that are run with twisting resistance."""
TESTED_ELSEWHERE = {"hertz", "hooke", "jkr_fixed_load"}
"""Laws that other tests run in all these ways, and one that differs from its like by a number."""
MIXED = {"hertz_clamped", "jkr", "hertz + bridge"}
"""Laws that are run in mixed precision; the others with --slow, as their own tests hold their formulas in both precisions."""
STEPS = 500
CLOSES = {"hertz + bridge": 1e-3}
"""Integration error over what is lost [-] by law, at this step, some 30 per contact; 2e-3 where nothing is said."""
FALLING = LAWS | {
    "hertz": {}, "jkr_fixed_load": LAWS["jkr"],
    "hertz + bridge_rabinovich": LAWS["hertz + bridge"],
}  # fmt: skip
"""Laws whose energy is added up in a bed that falls; those of QUICK without --slow."""
QUICK = {"jkr", "luding", "hertz + bridge"}


def bed(law: str, *, skin: float | str = 4e-4, gravity: float = -200.0, **changes) -> Scene:
    """27 grains of two sizes that fall on each other and a floor in a frame that turns, spinning."""
    rng = np.random.default_rng(5)
    cell = np.stack(np.meshgrid(*[np.arange(3)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    n = len(cell)
    normal, *liquid = law.split(WITH)
    data = {
        "gravity": [0, 0, gravity],
        "materials": {"g": {"density": 2500, "young_modulus": 4e6, "poisson_ratio": 0.3}},
        "contact": {"normal": normal, "tangential": "mindlin", "rolling": "spring", "liquid": (liquid or ["none"])[0]}
        | ({"twisting": "marshall"} if law in TWISTING else {}),
        "pairs": [
            {"materials": ["g", "g"], "restitution": 0.6, "friction": 0.5, "rolling_friction": 0.1} | FALLING[law],
        ],
        "grains": [
            {
                "material": "g", "positions": cell * 1.97e-3 + [0, 0, 1.0e-3], "radii": rng.uniform(0.9, 0.98, n) * 1e-3,
                "velocities": rng.normal(0, 0.1, (n, 3)), "spins": rng.normal(0, 50, (n, 3)),
                "liquid_content": 0.03 if liquid else 0.0,
            }
        ],
        "walls": [{"name": "floor", "material": "g", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}],
        "frame": {"axis": [0, 1, 0.2], "schedule": [{"until": 1e-3, "rate": [0, 5]}, {"rate": 5}]},
        "time": {"end": 1, "step": 1e-5, "max_speed": 1},
        "engine": {"skin": skin, "max_overlap": 0.3},
    }  # fmt: skip
    return Scene.model_validate(data | changes)


def after(scene: Scene, steps: int = STEPS, **keywords) -> Simulation:
    sim = Simulation(scene, device="cpu", **{"threads": 1} | keywords)
    sim.step(steps)
    return sim


def test_all_laws_are_here():
    assert {name.split(WITH)[0] for name in (*LAWS, *TESTED_ELSEWHERE)} == set(model_names("normal"))


@pytest.fixture(scope="module", params=LAWS)
def law(request):
    return request.param


@pytest.fixture(scope="module")
def plain(law):
    sim = after(bed(law))
    assert sim.plan.backend.lanes > 1, "the law must be straight-line code"
    contacts = sim.contacts()
    touching = contacts.overlap > 0.0
    assert (touching & (contacts.j >= 0)).sum() > 12 and (touching & (contacts.j < 0)).sum() > 5, "it must have fallen together"
    assert np.count_nonzero(np.linalg.norm(contacts.spring, axis=1)) > 12
    return sim


@pytest.mark.slow
@pytest.mark.parametrize("lanes", [1, 4, 8])
def test_lanes_change_no_bit(law, plain, lanes, monkeypatch):
    sim = in_lanes(bed(law), lanes, monkeypatch)
    sim.step(STEPS)
    assert sim.state_hash() == plain.state_hash()


def test_threads_lists_and_the_graph_change_no_bit(law, plain):
    """The graph evaluates one contact after the other, so this is also a test of the lanes."""
    assert after(bed(law), threads=2).state_hash() == plain.state_hash()
    rebuilt = after(bed(law, skin=1e-5))
    assert rebuilt.lists.rebuilds > 2 * plain.lists.rebuilds
    assert rebuilt.state_hash() == plain.state_hash()
    assert after(bed(law), resident=True).state_hash() == plain.state_hash()


def test_a_resume_changes_no_bit_and_the_next_phase_takes_everything_over(law, plain, tmp_path):
    half = after(bed(law), STEPS // 2)
    half.save_checkpoint(tmp_path / "half.h5")
    again = Simulation.from_checkpoint(tmp_path / "half.h5", device="cpu", threads=2)
    again.step(STEPS - STEPS // 2)
    assert again.state_hash() == plain.state_hash()
    onward = bed(law, frame={"axis": [0, 1, 0.2], "rate": 5.0})
    started = Simulation(restart.started_from(onward, tmp_path / "half.h5"), device="cpu", threads=1)
    place = half.particles.position
    for sim in (half, started):
        sim.step(20)
    np.testing.assert_array_equal(started.contacts().i, half.contacts().i)
    moved = np.abs(half.particles.position - place).max()
    np.testing.assert_allclose(started.particles.position, half.particles.position, rtol=0, atol=1e-3 * moved)
    np.testing.assert_allclose(started.contacts().spring, half.contacts().spring, rtol=0, atol=1e-3 * moved)
    for name, values in half.contacts().own.items():
        np.testing.assert_allclose(started.contacts().own[name], values, rtol=1e-3, atol=1e-3 * np.abs(values).max())


@pytest.mark.parametrize(
    "law", [pytest.param(law, marks=() if law in MIXED else pytest.mark.slow) for law in LAWS], scope="module"
)
def test_mixed_precision_stays_near_double(law):
    """Over the first contacts: later a bed amplifies any rounding."""
    double = after(bed(law), 60)
    mixed = after(bed(law, engine={"skin": 4e-4, "max_overlap": 0.3, "precision": "mixed"}), 60)
    assert len(double.contacts().i) == len(mixed.contacts().i) > 5
    moved = np.linalg.norm(double.particles.position - after(bed(law), 1).particles.position, axis=1).max()
    assert np.abs(mixed.particles.position - double.particles.position).max() < 1e-5 * moved


@pytest.mark.slow
def test_the_frame_does_not_matter(law):
    """The same grains beside nothing but each other, in axes that turn and in those that do not."""
    # no gravity; towards the middle, 0.2 mm in all
    sims = []
    for change in ({"frame": None}, {}):
        scene = bed(law, gravity=0.0, walls=[], **change)
        x = np.array(scene.grains[0].positions)
        group = scene.grains[0].model_copy(update={"velocities": 100.0 * (x.mean(axis=0) - x)})
        sims.append(after(scene.model_copy(update={"grains": [group]}), 100))
    a, b = sims
    assert len(a.contacts().i) > 5
    np.testing.assert_allclose(b.particles.position_lab, a.particles.position_lab, rtol=0, atol=1e-12)


def test_energy_closes_in_the_budget(law):
    sim = after(bed(law, measures={"energy": True}, frame=None))
    budget = sim.budget.energy()
    lost = sum(value for name, value in budget.items() if name.startswith("dissipated"))
    assert lost > 1e-6
    assert abs(budget["integration_error"]) < CLOSES.get(law, 2e-3) * lost


def falling(law: str, step: float | str) -> tuple[float, Simulation]:
    """120 grains that fall into a box and come to rest; integration error over what is lost at the worst of ten times."""
    walls = [
        {"name": name, "material": "g", "plane": {"point": point, "normal": normal}}
        for name, point, normal in (
            ("floor", [0, 0, 0], [0, 0, 1]), ("left", [-6e-3, 0, 0], [1, 0, 0]), ("right", [6e-3, 0, 0], [-1, 0, 0]),
            ("front", [0, -6e-3, 0], [0, 1, 0]), ("back", [0, 6e-3, 0], [0, -1, 0]),
        )
    ]  # fmt: skip
    space = {"min": [-6e-3, -6e-3, 1e-3], "max": [6e-3, 6e-3, 0.035]}
    fill = {"box": space, "count": 120, "diameter": {"uniform": [1.8e-3, 2.2e-3]}, "seed": 1}
    grains = {"material": "g", "fill": fill, "liquid_content": 0.03 if WITH in law else 0.0}
    scene = bed(
        law, gravity=-9.81, grains=[grains], walls=walls, frame=None, measures={"energy": True}, time={"end": 1, "step": step}
    )
    sim = Simulation(scene, device="cpu", threads=1)
    start, worst = sim.energy()["potential"], 0.0
    for _ in range(10):
        sim.run(until=sim.time + 0.01)
        worst = max(worst, abs(sim.budget.energy()["integration_error"]) / (start - sim.energy()["potential"]))
    return worst, sim


@pytest.mark.parametrize(
    "law", [pytest.param(law, marks=() if law in QUICK else pytest.mark.slow) for law in FALLING], scope="module"
)
def test_energy_of_a_falling_bed_closes_to_a_thousandth_at_28_steps_per_contact(law):
    """As ever with Hertz; at the step of "auto", 9 to 14 per contact, no law is further off than Hertz is (8.3e-3)."""
    auto, sim = falling(law, "auto")
    assert auto < 8.5e-3
    fine, sim = falling(law, sim.limits.contact_time / 28)
    print(f"{law}: {auto:.1e} at auto, {fine:.1e} at 28")
    assert fine < 1e-3
    assert np.linalg.norm(sim.particles.velocity, axis=1).mean() < 0.05, "they must have fallen together"
