"""Models from a user's own file: found beside the scene, checked against their role, run like those of the package."""

import math
from pathlib import Path

import numpy as np
import pytest

from law_scenes import ELASTIC, MASS, RADIUS, contact_time, impacts, parting_speeds
from warpdem import SceneError, Simulation
from warpdem.app.run import run_scene
from warpdem.model.impact import impact, rebound
from warpdem.scene import models
from warpdem.scene.file import scene_from_dict

KERNELS = Path(__file__).resolve().parent.parent / "kernels"
STEP = 1e-5


def data(**changes) -> dict:
    """Four grains that fall onto each other and a floor, spinning."""
    rng = np.random.default_rng(3)
    return {
        "gravity": [0, 0, -9.81],
        "materials": {"g": {"density": 2500.0, "young_modulus": 5e6, "poisson_ratio": 0.3}},
        "contact": {"normal": "hooke", "tangential": "mindlin", "rolling": "spring"},
        "pairs": [
            {"materials": ["g", "g"], "restitution": 0.6, "friction": 0.5, "rolling_friction": 0.2, "stiffness": 500.0}
        ],
        "grains": [
            {
                "material": "g",
                "positions": [[0, 0, 1e-3], [1.2e-3, 0, 2.7e-3], [0, 1e-3, 4.6e-3], [2.5e-3, 0, 1e-3]],
                "radius": 1e-3,
                "velocities": [[0.1, 0, -0.1]] * 4,
                "spins": rng.normal(0, 50, (4, 3)).tolist(),
            }
        ],
        "walls": [{"name": "floor", "material": "g", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}],
        "time": {"end": 1.0, "step": STEP, "max_speed": 1e-3},
        **changes,
    }


def simulation(folder, **changes) -> Simulation:
    return Simulation(scene_from_dict(data(**changes), folder), device="cpu", threads=1)


def message(folder, **changes) -> str:
    with pytest.raises(SceneError) as error:
        scene_from_dict(data(**changes), folder)
    return str(error.value)


# --- contact laws ----------------------------------------------------------------------------------------------------

COPIES = {"normal": "hooke", "tangential": "mindlin", "rolling": "spring"}


@pytest.fixture(scope="module")
def own(tmp_path_factory):
    """Folder with copies of the models that ``data`` names."""
    folder = tmp_path_factory.mktemp("own")
    for role, name in COPIES.items():
        (folder / f"{role}.py").write_text((KERNELS / role / f"{name}.py").read_text())
    return folder


def test_a_normal_law_and_a_law_of_bridges_of_ones_own_have_the_bits_of_the_laws(tmp_path):
    for role, name in {"normal": "hertz", "liquid": "bridge_rabinovich"}.items():
        (tmp_path / f"{role}.py").write_text((KERNELS / role / f"{name}.py").read_text())
    pair = {"materials": ["g", "g"], "restitution": 0.6, "surface_tension": "70 mN/m"}
    group = data()["grains"][0] | {"liquid_content": 0.02}
    sims = []
    for normal, liquid in (("normal.py", "liquid.py"), ("hertz", "liquid.py"), ("normal.py", "bridge_rabinovich"),
                           ("hertz", "bridge_rabinovich")):  # fmt: skip
        contact = {"normal": normal, "liquid": liquid, "tangential": "none"}
        sims.append(simulation(tmp_path, contact=contact, pairs=[pair], grains=[group]))
        sims[-1].step(500)
        assert sims[-1].plan.backend.lanes > 1 and sims[-1].liquid().bridge_count > 1
    assert len({sim.state_hash() for sim in sims}) == 1


def test_copies_of_the_laws_give_the_bits_of_the_laws(own):
    mine = simulation(own, contact={role: f"{role}.py" for role in COPIES})
    theirs = simulation(own)
    assert mine.plan.contact.normal == str(own / "normal.py")
    for sim in (mine, theirs):
        assert (sim.plan.memory, sim.plan.contact.inertia_factor) == (6, 3.5)
    kinds = set()
    for _ in range(40):
        for sim in (mine, theirs):
            sim.step(10)
        kinds |= set(np.sign(mine.contacts().j + 0.5))
        assert mine.energy() == theirs.energy()
    assert kinds == {-1.0, 1.0}, "the laws must have acted between grains and at the floor"
    np.testing.assert_array_equal(mine.particles.position, theirs.particles.position)
    assert mine.state_hash() == theirs.state_hash()


def test_what_the_file_says_is_what_runs(own, tmp_path):
    """Twice the stiffness in the user's law is twice the stiffness in the scene; a file that changes is read again."""
    text = (own / "normal.py").read_text()
    stiff = text.replace("return pair.stiffness,", "return 2.0 * pair.stiffness,")
    assert stiff != text
    contact = {"normal": "law.py", "tangential": "none"}
    pairs = [{"materials": ["g", "g"], "restitution": 0.6, "stiffness": 500.0}]
    runs = []
    for law in (text, stiff):
        (tmp_path / "law.py").write_text(law)
        runs.append(simulation(tmp_path, contact=contact, pairs=pairs))
        runs[-1].step(400)
    twice = simulation(tmp_path, contact={**contact, "normal": "hooke"}, pairs=[{**pairs[0], "stiffness": 1000.0}])
    twice.step(400)
    assert runs[0].plan != runs[1].plan
    assert runs[1].state_hash() == twice.state_hash() != runs[0].state_hash()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["law.py"], "nothing is written beside the user's file"


def test_an_absolute_path_needs_no_folder(own, tmp_path):
    sim = simulation(tmp_path, contact={**data()["contact"], "normal": own / "normal.py"})
    assert sim.plan.contact.normal == str(own / "normal.py")
    assert f"runs      normal: {own / 'normal.py'}" in sim.plan.explain()


def test_a_file_is_imported_once(own):
    path = str(own / "normal.py")
    assert models.model("normal", path) is models.model("normal", path)


GOOD_FIELD = 'PARAMETERS = {"pull": ("N", 3, None)}\n\ndef build():\n    return None\n'


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (None, ["cannot be read", "No such file"]),
        ("", ["a normal model defines coefficients, build, energy", "missing here: coefficients, build, energy"]),
        ("coefficients = build = energy = 3\n", ["coefficients, build, energy must be a function"]),
        ("import math\n\nx = = 3\n", ["law.py, line 3: SyntaxError"]),
        ("import math\n\n\ndef f():\n    return 1 / 0\n\nf()\n", ["law.py, line 5: ZeroDivisionError"]),
        ("from warpdem import nothing_of_the_kind\n", ["law.py, line 1: ImportError"]),
    ],
)
def test_wrong_file_is_answered_by_key_file_and_reason(tmp_path, text, words):
    if text is not None:
        (tmp_path / "law.py").write_text(text)
    answer = message(tmp_path, contact={**data()["contact"], "normal": "law.py"})
    for word in ['contact.normal = "law.py"', str(tmp_path / "law.py"), *words]:
        assert word in answer


def test_each_role_asks_for_its_own(tmp_path):
    (tmp_path / "law.py").write_text("def build(real):\n    return None\n")
    answer = message(tmp_path, contact={"normal": "law.py", "tangential": "law.py", "rolling": "law.py"})
    assert "missing here: coefficients, energy" in answer
    assert "contact.rolling" in answer and "missing here: HISTORY" in answer
    assert "contact.tangential" not in answer


@pytest.mark.parametrize(
    ("result", "words"),
    [
        ("pair.hardness", ["pairs[0]", "AttributeError", "hardness"]),
        ("(1.0, 2.0)", ["pairs[0]", "gives [1.0, 2.0]", "four finite numbers"]),
        ("(1.0, 2.0, float('nan'), 0.0)", ["pairs[0]", "four finite numbers"]),
    ],
)
def test_coefficients_that_fail_are_named_with_the_pair(tmp_path, result, words):
    (tmp_path / "law.py").write_text(
        f"def coefficients(a, b, pair):\n    return {result}\n\ndef build(real): ...\n\ndef energy(d, k): ...\n"
    )
    answer = message(tmp_path, contact={**data()["contact"], "normal": "law.py"})
    for word in ["law.py", *words]:
        assert word in answer


# --- fields ----------------------------------------------------------------------------------------------------------

OWN_FIELD = '''
"""A uniform pull on every kilogram, and one that swings: F = m g + f cos(w t)."""
import functools

import warp as wp
from warpdem.kernels.field import Numbers

PARAMETERS = {"pull": ("m/s2", 3, None), "swing": ("N", 3, (0.0, 0.0, 0.0)), "rate": ("rad/s", 1, 0.0)}


@functools.cache
def build():
    @wp.func
    def force(
        q: wp.vec3d, v: wp.vec3d, mass: wp.float64, radius: wp.float64, time: wp.float64, p: Numbers
    ) -> wp.vec3d:
        return wp.vec3d(p[0], p[1], p[2]) * mass + wp.vec3d(p[3], p[4], p[5]) * wp.cos(p[6] * time)

    return force
'''
FRAME = {"axis": [1, 2, 3], "origin": [0.02, 0.0, 0.01], "rate": 20.0}
FREE = {
    "gravity": [0, 0, 0],
    "contact": {"tangential": "none"},
    "pairs": [{"materials": ["g", "g"], "restitution": 0.6}],
    "walls": [],
    "grains": [{"material": "g", "positions": [[0, 0, 0], [0, 0, 0.1]], "radii": [1e-3, 2e-3]}],
    "time": {"end": 1.0, "step": 1e-4, "max_speed": 1e-3},
    "engine": {"skin": 0.02},  # wide: fast grains would call for new lists all the time
}


def own_field(folder, axes="laboratory", **parameters) -> list[dict]:
    (folder / "pull.py").write_text(OWN_FIELD)
    return [{"model": "pull.py", "axes": axes, "parameters": parameters}]


def test_own_field_equals_gravity_in_a_turning_frame(tmp_path):
    pull = [1.0, -2.0, 3.0]
    mine = simulation(tmp_path, **FREE | {"fields": own_field(tmp_path, pull=pull), "frame": FRAME})
    gravity = simulation(tmp_path, **FREE | {"gravity": pull, "frame": FRAME})
    for sim in (mine, gravity):
        sim.run(until=0.3)
    np.testing.assert_allclose(mine.particles.position, gravity.particles.position, rtol=0, atol=1e-13)
    assert np.linalg.norm(gravity.particles.position[0]) > 0.1


def test_own_field_knows_the_time_and_the_mass(tmp_path):
    """From rest: v = f/(m w) sin(w t)."""
    swing, rate = np.array([1e-3, 0.0, 2e-3]), 30.0
    field = own_field(tmp_path, pull=[0, 0, 0], swing=swing.tolist(), rate="30 rad/s")
    sim = simulation(tmp_path, **FREE | {"fields": field})
    sim.run(until=0.25)
    exact = swing / (sim.particles.mass[:, None] * rate) * np.sin(rate * sim.time)
    # trapezoidal sum of the kicks: short by the factor 1 - (w dt)^2/12
    np.testing.assert_allclose(sim.particles.velocity, exact, rtol=(rate * 1e-4) ** 2 / 11)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('{"pull": ("N", 3, None)}', "3", ["PARAMETERS must be a dict"]),
        ('("N", 3, None)', '"N"', ["PARAMETERS['pull'] = 'N'", "(unit, numbers, default)"]),
        ('"N"', '"furlong"', ["PARAMETERS['pull']", "'furlong'", "known: m, s,"]),
        ("3, None", "2, None", ["PARAMETERS['pull']", "2 numbers", "1 or 3"]),
        ("3, None)", "3, None)" + "".join(f', "p{k}": ("m", 3, (0.0, 0.0, 0.0))' for k in range(4)), ["15 numbers", "12"]),
        ("PARAMETERS", "PARAMETER", ["a field model defines PARAMETERS, build", "missing here: PARAMETERS"]),
        ("3, None", "3, 0.0", ["fields[0].parameters.pull = 0.0", "list of 3"]),
    ],
)
def test_wrong_field_file_is_answered_by_file_and_what_is_allowed(tmp_path, old, new, words):
    assert old in GOOD_FIELD
    (tmp_path / "pull.py").write_text(GOOD_FIELD)
    field = {"model": "pull.py"}
    scene_from_dict(data(fields=[{**field, "parameters": {"pull": [1, 2, 3]}}]), tmp_path)
    (tmp_path / "pull.py").write_text(GOOD_FIELD.replace(old, new))
    answer = message(tmp_path, fields=[field])
    for word in ["fields[0]", *words]:
        assert word in answer


FORCE = "return wp.vec3d(p[0], p[1], p[2]) * mass + wp.vec3d(p[3], p[4], p[5]) * wp.cos(p[6] * time)"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (FORCE, "return wp.vec3d(p[0], p[1], p[2]) * weight", ["pull.py, line 17: ", "* weight: ", "undefined symbol: weight"]),
        (FORCE, "return wp.vec3d(p[0], p[1], p[2]) * 2.0", ["pull.py, line 17: ", "* 2.0: ", "same scalar type"]),
        (FORCE, "return wp.vec3d(wp.root(mass), p[1], p[2])", ["pull.py, line 17: ", "Could not find function wp.root"]),
        ("q: wp.vec3d, v", "q: wp.vec3, v", ["pull.py: ", "overload for 'force'"]),
        ("def build():", "def build(real):", ["pull.py: ", "missing 1 required positional argument"]),
        ("def build():\n", "def build():\n    1 / 0\n", ["pull.py, line 13: ", "1 / 0: ZeroDivisionError: division by zero"]),
    ],
)
def test_function_that_does_not_compile_is_refused_before_the_run(tmp_path, old, new, words):
    assert old in OWN_FIELD
    field = own_field(tmp_path, pull=[0, 0, 0])
    (tmp_path / "pull.py").write_text(OWN_FIELD.replace(old, new))
    for _ in range(2):  # Warp remembers what failed
        with pytest.raises(SceneError) as error:
            run_scene(scene_from_dict(data(**FREE | {"fields": field}), tmp_path), tmp_path / "out", device="cpu", threads=1)
        for word in [str(tmp_path), "Warp cannot compile it: ", *words]:
            assert word in str(error.value)
        assert "Error while parsing" not in str(error.value)
    assert not (tmp_path / "out").exists()


def test_law_and_observer_that_do_not_compile_are_refused_before_the_run(own, tmp_path):
    text = (own / "normal.py").read_text()
    for old, new, words in (
        ("touching * stiffness", "touching * stiff", r"Warp cannot compile it: spring = .*undefined symbol: stiff$"),
        ("0.5 * stiffness *", "0.5 * stiff *", r"it fails in the estimate of an impact: return .*: NameError: name 'stiff' "),
    ):
        assert old in text
        (tmp_path / "law.py").write_text(text.replace(old, new))
        with pytest.raises(SceneError, match=r"law\.py, line \d+: " + words):
            simulation(tmp_path, contact={**data()["contact"], "normal": "law.py"})
    (tmp_path / "tally.py").write_text(
        'import functools\nimport warp as wp\nfrom warpdem.kernels.field import Numbers\nUNIT = "x"\nPARAMETERS = {}\n'
        "@functools.cache\ndef build():\n    @wp.func\n    def observe(q: wp.vec3d, v: wp.vec3d, w: wp.vec3d, mass: wp.float64,"
        " radius: wp.float64, time: wp.float64, p: Numbers) -> wp.float64:\n        return mass * radus\n    return observe\n"
    )
    with pytest.raises(SceneError, match=r"tally\.py, line 10: Warp cannot compile it: return mass \* radus: .*: radus"):
        simulation(tmp_path, **FREE | {"observers": [{"name": "a", "model": "tally.py"}]})


def test_time_step_limits_know_a_law_by_its_energy_alone(tmp_path):
    """A copy of hertz under another name gets hertz's limits; one whose force is ten times stiffer gets shorter ones."""
    text = (KERNELS / "normal" / "hertz.py").read_text()
    (tmp_path / "same.py").write_text(text)
    (tmp_path / "stiffer.py").write_text(text.replace("0.4 * stiffness", "4.0 * stiffness"))
    hertz, same, stiffer = (
        impact(law, 1e7, 1e-6, 1e-3, 0.5) for law in ("hertz", str(tmp_path / "same.py"), str(tmp_path / "stiffer.py"))
    )
    depth = (5.0 * 1e-6 * 0.5**2 / (4.0 * 1e7 * math.sqrt(1e-3))) ** 0.4
    assert hertz.overlap == pytest.approx(depth, rel=1e-12)
    assert hertz.time == pytest.approx(2.943275184 * depth / 0.5, rel=1e-9)
    assert hertz.tangent == pytest.approx(1.5 * hertz.secant, rel=1e-6)
    assert hertz.secant == pytest.approx(1e7 * math.sqrt(1e-3 * depth), rel=1e-7)
    assert same == hertz
    assert stiffer.time == pytest.approx(hertz.time * 10**-0.4, rel=1e-9)


VISCOELASTIC = '''

def damping_coefficient(k_n, stiffness, damping, mass):
    return damping * k_n
'''


def test_estimates_know_the_dashpot_of_a_law_by_its_damping_coefficient(tmp_path):
    """Kuwabara and Kono 1987: (3/2) K A sqrt(d) v_n, so gamma_n goes with k_n and not with its root."""
    text = (KERNELS / "normal" / "hertz.py").read_text()
    for old, new in (
        ("math.sqrt(5.0) * beta, ratio", "2.25e-5, ratio"), ("damping * wp.sqrt(mass * stiffness)", "damping * stiffness"),
        ("damping * wp.sqrt(root)", "damping * root"),
    ):  # fmt: skip
        assert text.count(old) == 1
        text = text.replace(old, new)
    law = tmp_path / "viscoelastic.py"
    law.write_text(text + VISCOELASTIC)
    speed, phases = 0.1, 32
    step = contact_time(speed) / 15.0
    scene = impacts("viscoelastic.py", {"restitution": 0.9}, speed, step, phases=phases, base=tmp_path)
    sim = Simulation(scene, device="cpu", threads=1)
    hertz = Simulation(impacts("hertz", {"restitution": 1.0}, speed, step, phases=1), device="cpu", threads=1)
    sim.run(until=60.0 * step)
    at_wall = parting_speeds(sim, phases)[1] / speed
    estimated = rebound(str(law), 4.0 / 3.0 * ELASTIC, 2.25e-5, MASS, RADIUS, speed, step)
    np.testing.assert_allclose(estimated, at_wall, rtol=0, atol=1e-6)
    assert 0.5 < at_wall.mean() < 0.9
    assert sim.limits.stable < 0.97 * hertz.limits.stable
