"""Scenes spoiled at random end in words or are sound: no other error, no warning of NumPy, in bounded time and memory.

Each mutant of a sound scene is written as TOML, loaded, set up and described, as ``warpdem check --no-probe`` does. Hundreds
come with the fast tests, thousands with --slow; one that fails is shown with its number, which makes it again.
"""

import copy
import gc
import json
import random
import time
import warnings
from pathlib import Path

import psutil
import pytest
import trimesh

from warpdem import SceneError, Simulation, load_scene
from warpdem.app import check

MOST_SECONDS = 30.0
"""Processor time of one mutant [s]; most take milliseconds, those that are sound kernels to set up."""
MOST_BYTES = 1.5e9
"""Growth of the process over all mutants of a test [B]: NumPy, Warp and VTK themselves are most of it."""

PLACES = [[0.0, 0.0, 0.004], [0.003, 0.0, 0.004]]
PART = {"material": "g", "positions": PLACES, "radius": "1 mm", "velocities": [[0, 0, 0], [0, 0, 1]]}
BOX = {"min": [-0.008, -0.008, 0.01], "max": [0.008, 0.008, 0.018]}
FILL = {"box": BOX, "count": 20, "diameter": {"uniform": ["1 mm", "2 mm"]}}
FLOOR = {"name": "floor", "material": "g", "plane": {"point": [0.0, 0.0, 0.0], "normal": [0, 0, 1]}}
TUB = {"name": "tub", "material": "g", "mesh": "tub.stl", "scale": 1.0, "rotate": {"axis": [0, 0, 1], "angle": "10 deg"}}
BASE = {
    "title": "a scene",
    "gravity": [0, 0, -9.81],
    "materials": {"g": {"density": 2500, "young_modulus": "5 MPa", "poisson_ratio": 0.3}},
    "contact": {"normal": "hertz", "tangential": "mindlin", "rolling": "none"},
    "pairs": [{"materials": ["g", "g"], "restitution": 0.5, "friction": 0.4}],
    "grains": [PART],
    "walls": [FLOOR],
    "time": {"end": "10 ms", "step": "auto", "max_speed": 1.0},
    "output": {"interval": "1 ms", "formats": ["vtk"], "picture": False},
    "engine": {"skin": "auto", "max_overlap": 0.1},
}
SCENES = {
    "plain": {},
    "filled": {"grains": [PART, {"material": "g", "name": "bed", "fill": FILL}], "walls": [FLOOR, TUB]},
    "moved": {
        "frame": {"axis": [0, 0, 1], "schedule": [{"until": 0.1, "rate": [0, "30 rpm"]}, {"rate": 1.0}]},
        "walls": [{**FLOOR, "motion": {"amplitude": [0, 0, "1 mm"], "frequency": "50 Hz"}, "fixed_to": "laboratory"}],
        "fields": [{"model": "drag", "parameters": {"coefficient": 1e-6}}],
    },
    "fed": {
        "streams": [{"material": "g", "box": FILL["box"], "diameter": "2 mm", "mass_rate": "1 g/s", "velocity": [0, 0, -0.1]}],
        "outlets": [{"name": "out", "box": {"min": [-1, -1, -0.1], "max": [1, 1, -0.05]}}],
        "borders": {"x": {"min": -0.02, "max": 0.02, "kind": "open"}},
    },
    "measured": {
        "measures": {
            "energy": True, "flow": [{"name": "p", "point": [0, 0, 0.01], "normal": [0, 0, 1]}],
            "regions": [{"name": "r", "box": FILL["box"]}], "mixing": [{"name": "m", "by": "x", "cell": "5 mm"}],
            "grid": {"box": FILL["box"], "cell": "2 mm", "width": "4 mm"},
        },
        "observers": [{"name": "s", "model": "speed", "reduce": ["mean", "max"]}],
    },
    "phased": {"phases": [{"name": "a"}, {"name": "b", "gravity": [0, 0, 9.81], "time": {"end": 0.1}}]},
}  # fmt: skip


class Raw(str):
    """A value as it stands in the file."""


NUMBERS = [
    *map(Raw, ("nan", "inf", "-0.0", "0", "-1", "1e308", "-1e308", "1e-308", "5e-324", "1e30", "1e-30", "1e12", "1e-12")),
    *map(Raw, ("1e9", "1e-9", "1e6", "1e-6", "-1e3", "1e3", "0.5", "1", "2", "1e15", "1e-15", "1e21", "-1e12", "999999999999")),
]
"""Numbers that stand in the place of others."""
HOSTILE = [
    *NUMBERS,
    *map(Raw, ("true", "false", "''", "[]", "{}", "[[]]", "[1, 2, 3]", "{a = 1}", "1979-05-27", "07:32:00")),
    *map(Raw, ("1" * 5001, "0x" + "f" * 400, "[" * 2000 + "]" * 2000, "[" * 60 + "]" * 60, "9223372036854775807")),
    "x", "auto", "none", "1e400 m", "1e-400 m", "1 kg", "30 rpm", "NaN", "../../x", "/dev/zero", "~nobody/x.stl", "a\0b",
    "\x1b[31m", "x" * 5000, "é" * 90, "[/b]", "tub.stl", "missing.stl", "law.py", "a\nb", "g", "tub", ["g", "h"], [["1 mm"]],
    {"g": {}},
]  # fmt: skip
"""Values that stand in the place of others."""


def places(here, place=()):
    """Places of all values within tables and lists."""
    inner = here.items() if isinstance(here, dict) else enumerate(here) if isinstance(here, list) else ()
    for key, value in inner:
        yield (*place, key)
        yield from places(value, (*place, key))


def spoil(data: dict, chance: random.Random) -> None:
    """Change one thing in the tables."""
    *above, last = chance.choice(list(places(data)))
    here = data
    for key in above:
        here = here[key]
    kind = chance.random()
    if isinstance(here[last], (int, float)) and not isinstance(here[last], bool) and kind < 0.9:
        here[last] = chance.choice(NUMBERS)
    elif kind < 0.7:
        here[last] = copy.deepcopy(chance.choice(HOSTILE))
    elif kind < 0.8:
        del here[last]
    elif kind < 0.85 and isinstance(here, dict):
        here[chance.choice(["", "x", "nane", "velocity", "fixed_to", "a.b", "\0", "x" * 300])] = here[last]
    elif kind < 0.9 and isinstance(here, list):
        here.insert(last, copy.deepcopy(here[last]))
    else:
        other = data
        for key in chance.choice(list(places(data))):
            other = other[key]
        here[last] = copy.deepcopy(other)


def toml(value) -> str:
    """A value in TOML, on one line."""
    if isinstance(value, Raw):
        return str(value)
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(key)} = {toml(inner)}" for key, inner in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    return json.dumps(value)


def text_of(data: dict, chance: random.Random) -> bytes:
    """The tables as a file; now and then a line comes twice, is cut off, or has bytes that are no text."""
    lines = [f"{json.dumps(key)} = {toml(value)}" for key, value in data.items()]
    if chance.random() < 0.05:
        lines.append(chance.choice(lines))
    text = "\n".join(lines).encode()
    if chance.random() < 0.05:
        at = chance.randrange(len(text))
        text = text[:at] + chance.choice([b"", b"\0", b"\xff", b"\xef\xbb\xbf", b"[", b'"']) + text[at + chance.randrange(3) :]
    return text


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Folder of the mutants, with the mesh that they name."""
    folder = tmp_path_factory.mktemp("mutants")
    trimesh.creation.box((0.04, 0.04, 0.06)).export(folder / "tub.stl")
    return folder


def try_out(folder: Path, name: str, number: int) -> bool:
    """Whether one mutant of a scene is sound; fails for whatever is neither sound nor told in words."""
    chance = random.Random(f"{name} {number}")
    data = copy.deepcopy(BASE | SCENES[name])
    for _ in range(chance.choice([1, 1, 1, 2, 3])):
        spoil(data, chance)
    file = folder / "mutant.toml"
    file.write_bytes(text_of(data, chance))
    begin = time.process_time()
    try:
        scene = load_scene(file)
        for one in [scene.phase(k) for k in range(len(scene.phases))][:1] or [scene]:
            json.dumps(check.describe(Simulation(one, device="cpu", threads=1), probe=False), allow_nan=False)
        return True
    except SceneError as error:
        assert str(error).startswith(str(folder)) or "--" in str(error)
        assert len(str(error)) < 6000
        return False
    finally:
        assert time.process_time() - begin < MOST_SECONDS


def try_many(folder: Path, name: str, numbers) -> None:
    before = psutil.Process().memory_info().rss
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for number in numbers:
            try:
                try_out(folder, name, number)
            except BaseException as error:
                error.add_note(f"mutant {number} of {name}: {(folder / 'mutant.toml').read_bytes()[:3000]!r}")
                raise
    gc.collect()
    assert psutil.Process().memory_info().rss - before < MOST_BYTES


@pytest.mark.parametrize("name", SCENES)
def test_the_scenes_that_are_spoiled_are_sound(folder, name):
    (folder / "sound.toml").write_text("\n".join(f"{key} = {toml(value)}" for key, value in (BASE | SCENES[name]).items()))
    assert load_scene(folder / "sound.toml").source


@pytest.mark.parametrize("name", SCENES)
def test_spoiled_scenes_end_in_words(folder, name):
    try_many(folder, name, range(60))


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_many_spoiled_scenes_end_in_words(folder, name):
    try_many(folder, name, range(60, 1500))
