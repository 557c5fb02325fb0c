"""Each key of a scene file, found by walking its tables: the reader refuses what it cannot be, in words, as the schema does."""

import copy
import math
from collections.abc import Iterator
from pathlib import Path
from types import MappingProxyType

import pytest
from pydantic import BaseModel

from full_scenes import LAWS, continued, everything, keys_of, of_law, plant, remainder
from warpdem import Scene, SceneError
from warpdem.core.key_path import KeyPath, key_text
from warpdem.scene.file import scene_from_dict
from warpdem.scene.messages import PYTHON_ONLY
from warpdem.scene.schema import scene_schema
from warpdem.scene.tables import relative_to, scene_tables

SCHEMA = MappingProxyType(scene_schema())
NOT_OF_FILES = {*(("Scene", key) for key in PYTHON_ONLY), ("Start", "liquid"), ("Start", "groups")}
KEYS = {
    table: [key for key in sorted(keys) if (table, key) not in NOT_OF_FILES] for table, keys in keys_of(Scene, {}).items()
}
"""Keys of each table, by the name of its model."""
NEVER = ({"nonsense": 1}, [{"nonsense": 1}], [["nonsense"]])
"""What no key can be."""
OTHERS = ("nonsense", "1 parsec", True, -1e30, math.nan, [], [math.nan] * 3, ["nonsense"], 1979)
"""What few keys can be."""
NOISE = ("pydantic", "Input should", "union[", "Value error", "~", "literal[", "function-", "Traceback", "String should")


def keys_in(value: object, tables: object, path: KeyPath = ()) -> Iterator[tuple[str, str, KeyPath]]:
    """Table, key and key path of all that a scene sets."""
    if isinstance(value, (list, tuple)) and not isinstance(tables, list):  # one motion may be held as a list of one
        [value] = value
    if isinstance(value, BaseModel):
        for key in sorted(value.model_fields_set & set(tables)):
            yield type(value).__name__, key, (*path, key)
            yield from keys_in(getattr(value, key), tables[key], (*path, key))
    elif isinstance(value, (dict, list, tuple)):
        for key, one in value.items() if isinstance(value, dict) else enumerate(value):
            if isinstance(one, (BaseModel, dict, list, tuple)):
                yield from keys_in(one, tables[key], (*path, key))


@pytest.fixture(scope="module")
def places(tmp_path_factory):
    """Of each table and key: a folder, the tables of a sound scene that sets it, and its path there."""
    found = {}
    makers = {**{f"law_{law}": lambda folder, law=law: of_law(law, folder) for law in LAWS}}
    for make in (continued, remainder, plant, everything):
        makers[make.__name__] = make
    for name, make in makers.items():
        folder = tmp_path_factory.mktemp(name)
        scene = make(folder)
        tables = scene_tables(scene, relative_to(folder))
        assert refusal(folder, tables, ("title",), "sound") == ""
        for table, key, path in keys_in(scene, tables):
            found.setdefault((table, key), (folder, tables, path))
    return found


def refusal(folder: Path, tables: dict, path: KeyPath, value: object) -> str:
    """What the reader says of the scene with another value at a key; empty if it takes it."""
    changed = copy.deepcopy(tables)
    *above, last = path
    here = changed
    for part in above:
        here = here[part]
    here[last] = value
    try:
        scene_from_dict(changed, folder)
    except SceneError as error:
        return str(error)
    return ""


def part(table: str, key: str) -> dict:
    """What the schema says of a key."""
    return (SCHEMA if table == "Scene" else SCHEMA["$defs"][table])["properties"][key]


def test_every_key_of_every_table_is_set_by_one_of_the_scenes(places):
    assert {(table, key) for table, keys in KEYS.items() for key in keys} <= set(places)


@pytest.mark.parametrize("table", KEYS)
def test_the_schema_has_the_keys_and_describes_them(table):
    for key in KEYS[table]:
        found = part(table, key)
        found = found if "description" in found else SCHEMA["$defs"][found["$ref"].rsplit("/", 1)[-1]]
        assert len(found["description"]) > 6, key


@pytest.mark.parametrize("table", KEYS)
def test_what_a_key_cannot_be_is_refused_by_name(places, table):
    for number, key in enumerate(KEYS[table]):
        said = refusal(*places[table, key], NEVER[number % len(NEVER)])
        assert key_text(places[table, key][-1]) in said, said
        assert not [noise for noise in NOISE if noise in said], said


@pytest.mark.slow
@pytest.mark.parametrize("table", KEYS)
def test_schema_and_reader_agree_about_what_a_key_cannot_be(places, table):
    """The reader refuses what the schema does, and what no key can be; what it refuses is told in words."""
    jsonschema = pytest.importorskip("jsonschema", reason="the extra test is not installed")
    for key in KEYS[table]:
        validator = jsonschema.Draft202012Validator({"$defs": SCHEMA["$defs"], **part(table, key)})
        for value in (*NEVER, *OTHERS):
            said, refused = refusal(*places[table, key], value), not validator.is_valid(value)
            assert key_text(places[table, key][-1]) in said or not (refused or value in NEVER), (key, value, said)
            assert not [noise for noise in NOISE if noise in said], said
