"""What messages tell to do can be done: keys and options that they name exist, and values that they suggest are accepted."""

import ast
import inspect
import re
from dataclasses import fields
from pathlib import Path

import pytest

from warpdem import Scene, SceneError
from warpdem.app import cli
from warpdem.app.cli_options import AccuracyOptions
from warpdem.drawing.style import PictureStyle
from warpdem.scene import models
from warpdem.scene.messages import _all_keys, rounded_down, rounded_up
from warpdem.scene.parse_units import DIMENSIONS, to_si

PACKAGE = Path(cli.__file__).parents[1]
KEY = re.compile(r"\b([a-z]+(?:\[[^\]\s]*\])?(?:\.[a-z_]+(?:\[[^\]\s]*\])?)+)\b")
OPTION = re.compile(r"(?<![\w-])--([a-z][a-z-]+)")
KEYS = set(_all_keys(Scene))
TABLES = {key.split(".")[0].removesuffix("[]") for key in KEYS}
BASE = {
    "materials": {"g": {"density": 2500, "young_modulus": 5e6, "poisson_ratio": 0.3}},
    "pairs": [{"materials": ["g", "g"], "restitution": 0.5}],
    "grains": [{"material": "g", "radius": 1e-3, "positions": [[0, 0, 0]]}],
    "time": {"end": 1.0},
}


def texts() -> dict[str, str]:
    """Texts of the package that a user may see, by file and line: strings that are no docstring; what is filled in is {}."""
    found = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        parents = {child: node for node in ast.walk(tree) for child in ast.iter_child_nodes(node)}
        for node in ast.walk(tree):
            inside = isinstance(parents.get(node), (ast.JoinedStr, ast.Expr))
            if isinstance(node, ast.JoinedStr) and not isinstance(parents.get(node), ast.FormattedValue):
                parts = [part.value if isinstance(part, ast.Constant) else "{}" for part in node.values]
                found[f"{path.relative_to(PACKAGE)}:{node.lineno}"] = "".join(parts)
            elif isinstance(node, ast.Constant) and isinstance(node.value, str) and not inside:
                found[f"{path.relative_to(PACKAGE)}:{node.lineno}"] = node.value
    return {place: text for place, text in found.items() if " " in text}


def generic(key: str) -> str:
    """A key as the model lists it: walls[0].mesh and walls[{}].mesh are walls[].mesh."""
    return re.sub(r"\[[^\]]*\]", "[]", key)


def known(key: str) -> bool:
    """Whether a scene has a key; motions and grains may be named without the index of their list."""
    bare = {re.sub(r"\[\]|\.NAME", "", each) for each in KEYS}
    return re.sub(r"\[\]|\.\{\}", "", generic(key)) in bare


def test_keys_that_messages_name_exist():
    named = {
        (place, key)
        for place, text in texts().items()
        for key in KEY.findall(re.sub(r"(?<=\bmaterials)\.\{\}", "", text))
        if re.split(r"[.\[]", key)[0] in TABLES and not key.endswith((".py", ".toml", ".h5"))
    }
    assert len(named) > 40
    strange = {(place, key) for place, key in named if not known(key)}
    # attributes of Python's own objects in texts for programmers
    assert {key for _, key in strange} <= {"time.process_time", "time.perf_counter", "frame.add"}, sorted(strange)


def test_options_that_messages_name_exist():
    parameters = [name for command in cli.COMMANDS.values() for name in inspect.signature(command).parameters]
    there = {name.strip("_").replace("_", "-") for name in parameters}
    there |= {field.name.replace("_", "-") for options in (PictureStyle, AccuracyOptions) for field in fields(options)}
    there |= {"accuracy-twins", "accuracy-steps"}
    there |= {f"no-{name}" for name in ("picture", "probe")}
    named = {(place, option) for place, text in texts().items() for option in OPTION.findall(text)}
    assert len(named) > 10
    assert {option for _, option in named} <= there, sorted(pair for pair in named if pair[1] not in there)


@pytest.mark.parametrize("unit", DIMENSIONS)
def test_numbers_that_messages_give_as_examples_are_read(unit):
    assert to_si(DIMENSIONS[unit].example, unit) > 0.0


@pytest.mark.parametrize("role", ["tangential", "rolling"])
def test_a_missing_law_is_answered_by_those_there_are(role):
    coefficient = {"tangential": "friction", "rolling": "rolling_friction"}[role]
    data = {**BASE, "contact": {role: "none"}, "pairs": [{**BASE["pairs"][0], coefficient: 0.3}]}
    with pytest.raises(SceneError) as error:
        Scene.model_validate(data)
    named = re.findall(r'"(\w+)"', str(error.value).split("choose")[1])
    assert named == list(models.model_names(role))
    for name in named:
        Scene.model_validate({**data, "contact": {role: name}})


@pytest.mark.parametrize(
    ("motion", "remedy"),
    [
        ({"velocity": [0, 0, 1], "schedule": [{"until": 1, "rate": 1}]}, "missing: Velocity [m/s], three numbers"),
        ({"axis": [0, 0, 1], "schedule": [{"until": 1, "velocity": [0, 0, 1], "rate": 2}]}, "a motion of its own"),
    ],
)
def test_a_velocity_in_a_schedule_of_rates_is_answered_by_what_there_is_for_it(motion, remedy):
    with pytest.raises(SceneError) as error:
        Scene.model_validate({**BASE, "frame": motion})
    assert "frame.schedule[0].velocity" in str(error.value) and remedy in str(error.value)
    assert "phases" in KEYS and "frame.usd" in KEYS and "axis" not in str(error.value).split("\n")[1]


@pytest.mark.parametrize("value", [1.0, 0.99999, 1.51e-5, 7.34e8, 3.3333e-12, 9.96])
def test_suggested_numbers_are_rounded_to_the_side_that_is_accepted(value):
    assert 0.9 * value < float(rounded_down(value)) <= value <= float(rounded_up(value)) < 1.1 * value
