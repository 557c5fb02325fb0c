"""Scene files that hold no scene, and numbers that cannot be computed with: each ends in a message."""

import numpy as np
import pytest

from hostile import GRAIN, HEAD, refused
from warpdem import Simulation, load_scene

pytestmark = pytest.mark.filterwarnings("error", "ignore:Cyclopts application invoked without tokens")


# --- text ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text", [b"\xef\xbb\xbf" + (HEAD + GRAIN).encode(), (HEAD + GRAIN).replace("\n", "\r\n").encode(), (HEAD + GRAIN).encode()]
)
def test_text_with_a_mark_or_line_ends_of_windows_is_read(tmp_path, text):
    (tmp_path / "scene.toml").write_bytes(text)
    assert load_scene(tmp_path / "scene.toml").materials["g"].density == 2500


OUTLET = 'outlets = [{{ name = "{}", box = {{ min = [2, 2, 2], max = [3, 3, 3] }} }}]'
TEXTS = {
    "UTF-16": ((HEAD + GRAIN).encode("utf-16"), ["text in UTF-16", "UTF-8: save it in UTF-8"]),
    "UTF-16 without a mark": ((HEAD + GRAIN).encode("utf-16-le"), ["zero byte (byte 1)", "UTF-16"]),
    "zero byte": (HEAD + GRAIN + "\0", ["zero byte"]),
    "bytes": (b"\xff\x80" * 100, ["no text in UTF-8 (byte 0)"]),
    "empty": ("", ["materials", "missing"]),
    "key twice": (HEAD + HEAD, ["line 6", "not valid TOML"]),
    "long number": (HEAD + GRAIN + f"a = 1{'0' * 5000}", ["line 6, column 5", "whole number of 5001 digits", "2^63"]),
    "long number in base 16": (HEAD + GRAIN + f"a = 0x{'f' * 5000}", ["a\n", "about 6021 digits", "2^63"]),
    "lists in lists": (HEAD + GRAIN + f"a = {'[' * 2000}{']' * 2000}", ["nested too deeply", "32 levels"]),
    "tables in tables": (HEAD + GRAIN + f"a = {'{a=' * 2000}1{'}' * 2000}", ["nested too deeply", "32 levels"]),
    "dots in dots": (HEAD + GRAIN + f"{'.'.join('a' * 2000)} = 1", ["a.a.a.a", "nested too deeply"]),
    "control characters": (HEAD + GRAIN + 'b = "\x1b[31m"', ["line 6", "not valid TOML", "\\x1b[31m"]),
    "name as a path": (HEAD + GRAIN + OUTLET.format("../x"), ["outlets[0].name", "letters"]),
    "long name": (HEAD + GRAIN + OUTLET.format("x" * 300), ["outlets[0].name", "100 bytes", "is 300"]),
    "control characters in a name": (HEAD.replace("als.g", 'als."a\\u0007"') + GRAIN, ["materials", "control char"]),
}


@pytest.mark.parametrize("case", TEXTS)
def test_text_that_is_no_scene(tmp_path, case):
    text, words = TEXTS[case]
    said = refused(tmp_path, text)
    for word in words:
        assert word in said, said
    assert "\x1b" not in said and "\x07" not in said and len(said) < 2000


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("title=" + "[" * 2000, ["override", "nested too deeply"]),
        (".".join("a" * 2000) + "=1", ["override", "nested too deeply"]),
        ("time.end=" + "1" * 5001, ["time.end", "a time"]),
        ("grains." + "1" * 5001 + ".radius=1", ["grains is a list of 1"]),
        ("time.end=1 " + "m*" * 3000, ["time.end", "a time"]),
    ],
)
def test_overrides_that_are_no_values(tmp_path, override, words):
    said = refused(tmp_path, HEAD + GRAIN, override)
    for word in words:
        assert word in said, said


def test_walls_that_differ_in_case_only_would_share_files(tmp_path):
    wall = '[[walls]]\nname = "{}"\nmaterial = "g"\nplane = {{ point = [0, 0, 0], normal = [0, 0, 1] }}\n'
    said = refused(tmp_path, HEAD + GRAIN + wall.format("Lid") + wall.format("lid"))
    assert 'walls[1].name = "lid"' in said and 'walls[0] is "Lid"' in said


# --- numbers -------------------------------------------------------------------------------------------------------------

NUMBERS = {
    "grains.0.radius=1e-200": ["grains[0].radius = 1e-200", "from 1e-12 to 1e+12 [m]"],
    "grains.0.radius=1e300": ["grains[0].radius", "from 1e-12 to 1e+12 [m]"],
    "grains.0.positions=[[0, 0, 1e300]]": ["grains[0].positions", "entry [0][2] = 1e+300", "at most 1e+12 [m] in magnitude"],
    "grains.0.positions=[[0, 0, 1e11]]": ["grains[0]: grain 0", "1e+11 m from the origin", "allowed is up to"],
    "grains.0.velocities=[[0, 0, 1e200]]": ["grains[0].velocities", "at most 1e+12 [m/s]"],
    "grains.0.spins=[[0, 0, 1e200]]": ["grains[0].spins", "at most 1e+12 [rad/s]"],
    "gravity=[0, 0, 1e200]": ["gravity[2] = 1e+200", "at most 1e+15 [m/s2]"],
    "materials.g.density=1e300": ["materials.g.density", "from 1e-09 to 1e+18 [kg/m3]"],
    "materials.g.young_modulus=1e-300": ["materials.g.young_modulus", "from 1e-09 to 1e+21 [Pa]"],
    "time.end=1e300": ["time.end", "from 1e-24 to 1e+15 [s]"],
    "time.step=1e-300": ["time.step", "from 1e-24 to 1e+15 [s]", '"auto"'],
    "time.step=1e-21": ["time.end = 0.0001 s is 1e+17 steps", "can be counted"],
    "frame={axis=[0, 0, 1], rate=1e200}": ["frame.rate", "at most 1e+12 [rad/s]"],
    "grains.0.radius=1e12": ["grains[0]: grain 0", "materials.g.density = 2500 kg/m3", "make a mass of"],
    "grains.0.radius='1e999999999 m'": ["grains[0].radius", "must be finite"],
}


@pytest.mark.parametrize("override", NUMBERS)
def test_numbers_that_cannot_be_computed_with(tmp_path, override):
    said = refused(tmp_path, HEAD + GRAIN, override)
    for word in NUMBERS[override]:
        assert word in said, said


@pytest.mark.parametrize("radius", [1e-7, 1e-6, 1.0, 1e3])
def test_powders_and_boulders_are_computed(tmp_path, radius):
    (tmp_path / "scene.toml").write_text(HEAD + GRAIN)
    place = f"grains.0.positions=[[0, 0, {3 * radius}], [0, 0, {5 * radius}]]"
    changes = [f"grains.0.radius={radius}", place, "time.step=auto", "time.end=1e3", "engine.precision=mixed"]
    sim = Simulation(load_scene(tmp_path / "scene.toml", changes), device="cpu", threads=1)
    sim.step(3)
    assert np.isfinite(sim.particles.position).all()


@pytest.mark.parametrize("cell", [1e-12, 0.5])
def test_cells_of_mixing_may_be_small(cell):
    from warpdem.measure.mixing import lacey_index

    place = np.array([[1e12, 0.0, -1e12], [-0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [5.0, 5.0, 5.0]])
    # the two in the middle share a cell, the others have one each: (1/4 - 1/8)/(1/4 - 3/16)
    assert lacey_index(np.array([True, True, False, False]), place, cell) == 2.0
