"""The JSON schema of a scene file: up to date, and of the same opinion as the reader of scenes."""

import json
import sys
import tomllib
from pathlib import Path

import pytest

from warpdem import SceneError
from warpdem.app import cli
from warpdem.scene.file import scene_from_dict
from warpdem.scene.schema import scene_schema

SCENES = Path(__file__).parents[1] / "scenes"
SCHEMA = SCENES / "scene.schema.json"
pytestmark = pytest.mark.filterwarnings("ignore:Cyclopts application invoked without tokens")

LAW = """
from warpdem.kernels.normal.hooke import *
PAIR = {"tension": ("N/m", None, "Surface tension [N/m], >= 0.")}
"""


def test_schema_file_is_up_to_date():
    assert json.loads(SCHEMA.read_text()) == scene_schema(), "warpdem schema > scenes/scene.schema.json"


def test_schema_refuses_unknown_keys_and_allows_units():
    schema = json.loads(SCHEMA.read_text())
    assert schema["additionalProperties"] is False
    assert all(part["additionalProperties"] is False for name, part in schema["$defs"].items() if name != "Pair")
    assert not {"base", "source"} & schema["properties"].keys()
    forms = schema["$defs"]["Material"]["properties"]["density"]["anyOf"]
    assert [form["type"] for form in forms] == ["number", "string"]
    assert forms[0]["exclusiveMinimum"] == 0


def tables(normal: str, **keys) -> dict:
    return {
        "materials": {"g": {"density": 2500, "young_modulus": "5 MPa", "poisson_ratio": 0.3}},
        "contact": {"normal": normal},
        "pairs": [{"materials": ["g", "g"], "restitution": 0.5, "stiffness": "1 N/mm", **keys}],
        "grains": [{"material": "g", "radius": "1 mm", "positions": [[0, 0, 0]]}],
        "time": {"end": 1},
    }


PAIRS = {
    "package": ("hooke", {}, (True, True, True)),
    "package, key of nobody": ("hooke", {"tensoin": 0.07}, (False, False, False)),
    "package, key of the law": ("hooke", {"tension": 0.07}, (False, True, False)),
    "own law": ("law.py", {"tension": 0.07}, (True, True, True)),
    "own law, with a unit": ("law.py", {"tension": "70 mN/m"}, (True, True, True)),
    "own law, key of nobody": ("law.py", {"tension": 0.07, "tensoin": 0.07}, (True, False, False)),
    "own law, wrong value": ("law.py", {"tension": -1}, (True, False, False)),
}
"""Normal law, keys of the pair; who accepts them: the schema, the schema with the keys of the law, the reader."""


@pytest.fixture
def law(tmp_path):
    (tmp_path / "law.py").write_text(LAW)
    return tmp_path / "law.py"


@pytest.mark.parametrize("case", PAIRS)
def test_keys_of_a_law_of_the_user_are_known_to_the_schema(law, case):
    """An editor marks what the reader refuses; without the file of the law, a key that the law may have is accepted."""
    jsonschema = pytest.importorskip("jsonschema", reason="the extra test is not installed")
    normal, keys, accepted = PAIRS[case]
    data = tables(normal, **keys)
    schemas = json.loads(SCHEMA.read_text()), scene_schema([law])
    found = [jsonschema.Draft202012Validator(schema).is_valid(data) for schema in schemas]
    try:
        scene_from_dict(data, law.parent)
        found.append(True)
    except SceneError:
        found.append(False)
    assert tuple(found) == accepted


def test_every_scene_of_the_gallery_fits_the_schema():
    jsonschema = pytest.importorskip("jsonschema", reason="the extra test is not installed")
    validator = jsonschema.Draft202012Validator(json.loads(SCHEMA.read_text()))
    for file in SCENES.rglob("*.toml"):
        validator.validate(tomllib.loads(file.read_text()))


def test_command_prints_the_schema_with_keys_of_the_plugin(law, monkeypatch, capfd):
    """Its description is what an editor shows."""
    monkeypatch.setattr(sys, "argv", ["warpdem", "schema", "--plugin", str(law)])
    cli.main()
    pair = json.loads(capfd.readouterr().out)["$defs"]["Pair"]
    assert pair["properties"]["tension"]["description"] == "Surface tension [N/m], >= 0."
    assert pair["additionalProperties"] is False
    assert {"materials", "friction"} < pair["properties"].keys()


@pytest.mark.parametrize(
    ("text", "words"),
    [("PAIR = 3", "PAIR must be a dict"), ("PAIR = {'a': ('kW', None, '')}", "unit 'kW' is not known"), ("a b", "line 1")],
)
def test_files_that_declare_their_keys_wrongly_are_named(tmp_path, text, words):
    (tmp_path / "law.py").write_text(text)
    with pytest.raises(SceneError, match=r"law\.py") as error:
        scene_schema([tmp_path / "law.py"])
    assert words in str(error.value)
    with pytest.raises(SceneError, match=r"none\.py: cannot be read"):
        scene_schema([tmp_path / "none.py"])
