"""Scene files from one format to the other and back: the same scene, readable, and nothing overwritten."""

import tomllib
from pathlib import Path

import numpy as np
import pytest
from pydantic import BaseModel

from full_scenes import LAWS, continued, everything, keys_of, of_law, plant, remainder
from usd_stages import validation_errors
from warpdem import Scene, SceneError, load_scene
from warpdem.app.cli import app
from warpdem.scene import pair_keys
from warpdem.scene.base import FileName
from warpdem.scene.convert import convert
from warpdem.scene.messages import models_in
from warpdem.scene.tables import FILE_KEYS, MODEL_KEYS, relative_to, scene_tables
from warpdem.scene.write_toml import toml_text

SCENES = Path(__file__).resolve().parent.parent / "scenes"
ALL = sorted(path for path in SCENES.rglob("*") if path.suffix in (".toml", ".usda"))


def plain(scene: Scene) -> dict:
    """All values of a scene, files by where they are."""
    data = scene.model_dump(mode="json")
    for place, name in scene.files():
        here = data
        for part in place[:-1]:
            # one motion may be held as a list of one
            here = here[part] if isinstance(here, dict) or isinstance(part, int) else here[0][part]
        here = here[0] if isinstance(here, list) else here
        here[place[-1]] = str(scene.resolve(name).resolve())
    return data


def there_and_back(scene: Scene, folder: Path) -> list[Scene]:
    """The scene by way of a text stage, a binary one, and TOML."""
    (folder / "a.toml").write_text(toml_text(scene_tables(scene, relative_to(folder))), encoding="utf-8")
    found, options = [], {"allow_paths": [SCENES, folder]}
    for source, target in (("a.toml", "b.usda"), ("b.usda", "c.usdc"), ("c.usdc", "d.toml")):
        convert(folder / source, folder / target, **options)
        found.append(load_scene(folder / target, **options))
    return [load_scene(folder / "a.toml", **options), *found]


@pytest.mark.parametrize("path", ALL, ids=lambda path: path.relative_to(SCENES).as_posix())
def test_scenes_come_back_equal_by_way_of_the_other_format(tmp_path, path):
    scene, options = load_scene(path, allow_paths=[SCENES]), {"allow_paths": [SCENES]}
    for source, target in ((path, "a.toml"), (tmp_path / "a.toml", "b.usda")):
        convert(source, tmp_path / target, **options)
        again = load_scene(tmp_path / target, **options)
        assert plain(again) == plain(scene)
        assert again.notes == ()
    assert validation_errors(tmp_path / "b.usda") == []


def test_a_value_of_every_key_of_every_law_is_here():
    for key, (_, laws) in pair_keys.of_package().items():
        for _, law in laws:
            assert key in LAWS.get(law, {}), f"BED of tests/kernels/normal/test_{law}.py lacks {key}"


@pytest.mark.parametrize("law", LAWS)
def test_keys_of_contact_laws_come_back_equal_from_every_format(tmp_path, law):
    scene = of_law(law, tmp_path)
    told = scene.pairs[0].model_dump(exclude_unset=True)
    for again in there_and_back(scene, tmp_path):
        given = again.pairs[0].model_dump(exclude_unset=True)
        plainly = {key: told[key] if isinstance(value, str) else value for key, value in LAWS[law].items()}
        assert {key: given[key] for key in LAWS[law]} == plainly
        assert plain(again) == plain(scene)
        assert again.notes == ()


OF_RUNS = {
    "Scene": {"base", "access", "source", "notes"},  # where a file is
    "Start": {"liquid", "groups"},  # what it goes on from
    "Pair": set(pair_keys.of_package()),  # every law's keys have their test above
}
"""Keys that no table of a file holds, or that have a test of their own."""


def given_in(value, found: set[tuple[str, str]]) -> set[tuple[str, str]]:
    """Models and keys that are set anywhere in a scene."""
    if isinstance(value, BaseModel):
        for key in value.model_fields_set:
            found.add((type(value).__name__, key))
            given_in(getattr(value, key), found)
    elif isinstance(value, (dict, list, tuple)):
        for one in value.values() if isinstance(value, dict) else value:
            given_in(one, found)
    return found


def test_every_key_of_a_scene_makes_the_way_there_and_back(tmp_path):
    """One that is new fails here until a scene that is converted has it."""
    given = set()
    for make in (everything, plant, remainder, continued):
        given_in(make(tmp_path), given)
    missing = [
        f"{name}.{key}" for name, keys in keys_of(Scene, {}).items() for key in sorted(keys - OF_RUNS.get(name, set()))
        if (name, key) not in given
    ]  # fmt: skip
    assert missing == [], missing


@pytest.mark.parametrize("make", [plant, remainder, continued])
def test_a_plant_comes_back(tmp_path, make):
    scene = make(tmp_path)
    assert [plain(other) == plain(scene) for other in there_and_back(scene, tmp_path)] == [True] * 4
    assert [validation_errors(tmp_path / name) for name in ("b.usda", "c.usdc")] == [[], []]


def test_everything_that_a_scene_can_say_comes_back(tmp_path):
    scene = everything(tmp_path)
    others = there_and_back(scene, tmp_path)
    assert [plain(other) == plain(scene) for other in others] == [True] * 4
    # other programs see names that USD allows, all different
    text = (tmp_path / "b.usda").read_text(encoding="utf-8")
    assert "vector3f physxSurfaceVelocity:surfaceVelocity = (0.1, 0.33333334, 0)" in text
    for part in ('def Material "glass_bead"', 'def Material "glass_bead_2"', 'def "a_b_2"', 'def Points "first_layer"'):
        assert part in text
    assert [validation_errors(tmp_path / name) for name in ("b.usda", "c.usdc")] == [[], []]


def test_names_that_usd_does_not_allow_are_refused_in_words(tmp_path):
    scene = everything(tmp_path)
    phases = [{"name": "one", "materials": {"glass bead": {"density": 1e3}}}]
    (tmp_path / "a.toml").write_text(
        toml_text(scene_tables(scene, relative_to(tmp_path)) | {"phases": phases}), encoding="utf-8"
    )
    with pytest.raises(SceneError, match=r"one: materials.glass bead: USD allows letters, digits and _ in names: rename"):
        convert(tmp_path / "a.toml", tmp_path / "b.usda")
    assert not (tmp_path / "b.usda").exists()


def test_a_user_can_read_what_is_written(tmp_path):
    convert(SCENES / "hourglass.toml", tmp_path / "a.toml")
    text = (tmp_path / "a.toml").read_text()
    for part in (
        "\n[materials.grain]\ndensity = 2653.0\n",
        '\n[[pairs]]\nmaterials = ["grain", "grain"]\n',
        "region = { min = [-2.0, -2.0, -3.0], max = [2.0, 2.0, 0.0] }\n",
        "schedule = [\n  { until = 0.1, rate = [0.0, 3.141592653589793] },\n",
    ):
        assert part in text
    rows = toml_text({"grains": [{"positions": np.arange(300.0).reshape(-1, 3).tolist(), "ids": list(range(100))}]})
    assert "positions = [\n  [0.0, 1.0, 2.0],\n" in rows
    assert "ids = [\n  0, 1, 2, 3, 4, 5, 6, 7,\n" in rows


def test_toml_text_is_toml():
    tables = {
        "plain": "", "list": [], "empty": {}, "numbers": [1, -2.5e-300, float("inf"), 1e22], "truth": [True, False],
        "a b": {"c.d": {"e": 'x"y', "f": [{"g": 1}, {}]}, "long": ["word " * 30, {"a": "b" * 200}]},
        "tables": [{"a": [{"b": 1, "c": {"d": "e" * 150}}], "z": 1}, {}],
    }  # fmt: skip
    assert tomllib.loads(toml_text(tables)) == tables
    with pytest.raises(TypeError):
        toml_text({"a": None})


def test_every_key_that_names_a_file_is_known():
    """A new key for a file must be among those that are renamed when a scene goes to another folder."""
    marker, keys, seen = FileName.__metadata__[0], set(), set()

    def holds(annotation) -> bool:
        return annotation is marker or any(
            holds(inner) for inner in (*getattr(annotation, "__metadata__", ()), *getattr(annotation, "__args__", ()))
        )

    def visit(model: type[BaseModel]) -> None:
        if model in seen:
            return
        seen.add(model)
        for name, field in model.model_fields.items():
            if marker in field.metadata or holds(field.annotation):
                keys.add(name)
            for part, _ in models_in(field.annotation):
                visit(part)

    visit(Scene)
    assert {"mesh", "usd", "file", "normal"} <= keys <= {*FILE_KEYS, *MODEL_KEYS}


def test_convert_overwrites_nothing_and_says_what_it_takes(tmp_path, capsys):
    target = tmp_path / "a.toml"
    target.write_text("mine")
    for arguments, part in (
        ([SCENES / "box_bed.toml", target], "exists already; choose another name, or use --overwrite"),
        ([SCENES / "box_bed.toml", tmp_path / "a.usdz"], "must end in .toml, .usda, .usdc, .usd"),
        ([SCENES / "box_bed.toml", tmp_path / "no" / "a.usda"], "there is no folder"),
        ([target, target, "--overwrite"], "exists already; choose another name"),
    ):
        with pytest.raises(SceneError, match=part):
            app(["convert", *map(str, arguments)], result_action="return_value")
    assert target.read_text() == "mine"
    app(["convert", str(SCENES / "box_bed.toml"), str(target), "--overwrite"], result_action="return_value")
    assert plain(load_scene(target, allow_paths=[SCENES])) == plain(load_scene(SCENES / "box_bed.toml"))
