import copy
import json
import math
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from warpdem.errors import SceneError
from warpdem.scene.model import Scene


def minimal() -> dict:
    return {
        "materials": {"glass": {"density": 2500, "young_modulus": "50 MPa", "poisson_ratio": 0.25}},
        "pairs": [{"materials": ["glass", "glass"], "restitution": 0.9}],
        "grains": [{"material": "glass", "positions": [[0, 0, 0], [0, 0, 0.1]], "diameter": "1 mm"}],
        "time": {"end": 1},
        "output": {"interval": "20 ms"},
    }


def test_defaults():
    scene = Scene.model_validate(minimal())
    assert scene.gravity == (0.0, 0.0, -9.81)
    assert (scene.contact.normal, scene.contact.tangential, scene.contact.rolling) == ("hertz", "mindlin", "none")
    assert scene.pairs[0].tangential_stiffness_ratio == 2 / 7
    assert scene.pairs[0].rolling_damping == 0.3
    assert scene.output.formats == ["vtk", "usd"]
    assert (scene.time.step, scene.engine.skin, scene.engine.max_overlap) == ("auto", "auto", 0.1)
    assert (scene.frame, scene.walls) == (None, [])
    assert (scene.base, scene.source) == (Path.cwd(), "<scene>")


def test_wrong_scene_from_python_is_told_as_that_of_a_file_is():
    data = minimal() | {"frame": {"axis": "y", "rate": 3}, "source": "mine"}
    data["time"] |= {"ned": 1}
    with pytest.raises(SceneError) as error:
        Scene.model_validate(data)
    head, *lines = str(error.value).splitlines()
    assert head == "mine: 2 problems"
    told = dict(zip(lines[::2], lines[1::2], strict=True))
    assert told == {
        '  frame.axis = "y"': "      must be a list of 3 pure numbers, such as [0, 0, 1]",
        "  time.ned = 1": '      unknown key; did you mean "end"?',
    }
    with pytest.raises(SceneError, match=r"^<scene>: one problem\n  the scene = \[3\]\n      must be a table$"):
        Scene.model_validate([3])


def test_values_are_si_and_immutable():
    scene = Scene.model_validate(minimal())
    assert scene.materials["glass"].young_modulus == 5e7
    assert scene.output.interval == 0.02
    with pytest.raises(ValidationError):
        scene.title = "other"
    with pytest.raises(ValueError):
        scene.grains[0].positions[0, 0] = 1.0


def test_dump_gives_the_same_scene_again():
    data = minimal()
    data["frame"] = {"axis": [1, 2, 3], "schedule": [{"until": 1, "rate": ["10 rpm", "30 rpm"]}, {"rate": 2}]}
    data["walls"] = [
        {"name": "drum", "material": "glass", "mesh": "drum.stl", "motion": {"axis": [0, 1, 0], "rate": 1}}
    ]
    data["grains"].append({"material": "glass", "fill": {"wall": "drum", "count": 7, "diameter": {"uniform": [1, 2]}}})
    scene = Scene.model_validate(data)
    assert Scene.model_validate(scene.model_dump()) == scene
    assert Scene.model_validate(json.loads(scene.model_dump_json())) == scene
    assert "base" not in scene.model_dump()
    assert "source" not in scene.model_dump()
    moved = copy.deepcopy(data)
    moved["grains"][0]["positions"][1][2] = 0.2
    assert Scene.model_validate(moved) != scene


def test_explicit_columns_have_their_defaults():
    data = minimal()
    [grains] = Scene.model_validate(data).grains
    np.testing.assert_array_equal(grains.explicit_radii, [0.0005, 0.0005])
    np.testing.assert_array_equal(grains.explicit_velocities, np.zeros((2, 3)))
    np.testing.assert_array_equal(grains.explicit_spins, np.zeros((2, 3)))
    del data["grains"][0]["diameter"]
    data["grains"][0] |= {
        "diameters": [0.2, 0.4],
        "velocities": [[1, 0, 0], [0, 1, 0]],
        "spins": [["30 rpm", 0, 0]] * 2,
    }
    [grains] = Scene.model_validate(data).grains
    np.testing.assert_array_equal(grains.explicit_radii, [0.1, 0.2])
    np.testing.assert_array_equal(grains.explicit_velocities, [[1, 0, 0], [0, 1, 0]])
    np.testing.assert_array_equal(grains.explicit_spins, [[math.pi, 0, 0]] * 2)


@pytest.mark.parametrize(("key", "value"), [("radius", 0.3), ("radii", [0.3, 0.3]), ("diameter", 0.6)])
def test_size_may_be_given_in_each_form(key, value):
    data = minimal()
    del data["grains"][0]["diameter"]
    data["grains"][0][key] = value
    np.testing.assert_array_equal(Scene.model_validate(data).grains[0].explicit_radii, [0.3, 0.3])


def test_ids_are_whole_and_unique():
    data = minimal()
    data["grains"][0]["ids"] = [7, 3]
    ids = Scene.model_validate(data).grains[0].ids
    assert ids.tolist() == [7, 3]
    assert ids.dtype == np.int64
    for wrong in ([7, 7], [1, -1], [1.5, 2], [True, 2], [[1], [2, 3]], [2**63, 1], 5, []):
        data["grains"][0]["ids"] = wrong
        with pytest.raises(SceneError, match=r"grains\[0\]\.ids"):
            Scene.model_validate(data)


def test_pair_is_found_in_either_order():
    data = minimal()
    data["materials"]["steel"] = data["materials"]["glass"]
    data["walls"] = [{"name": "floor", "material": "steel", "plane": {"point": [0, 0, -1], "normal": [0, 0, 1]}}]
    data["pairs"].append({"materials": ["steel", "glass"], "restitution": 0.3})
    scene = Scene.model_validate(data)
    assert scene.pair("glass", "steel") is scene.pair("steel", "glass") is scene.pairs[1]
    with pytest.raises(KeyError):
        scene.pair("steel", "steel")


def test_paths_start_from_base():
    scene = Scene.model_validate(minimal() | {"base": "folder"})
    assert scene.resolve("a.stl") == Path("folder/a.stl")
    assert scene.resolve(Path("/x/a.stl")) == Path("/x/a.stl")
    assert scene.resolve("~/a.stl") == Path.home() / "a.stl"


def test_many_positions_are_exact():
    data = minimal()
    positions = np.random.default_rng(0).random((100_000, 3))
    data["grains"][0]["positions"] = positions.tolist()
    np.testing.assert_array_equal(Scene.model_validate(data).grains[0].positions, positions)


def all_models(model=Scene, seen=None):
    seen = set() if seen is None else seen
    if model not in seen:
        seen.add(model)
        for field in model.model_fields.values():
            for part in parts(field.annotation):
                all_models(part, seen)
    return seen


def parts(annotation):
    if hasattr(annotation, "model_fields"):
        return [annotation]
    return [model for inner in getattr(annotation, "__args__", ()) for model in parts(inner)]


def quantities(schema):
    """Units that a JSON schema of a field speaks of."""
    if isinstance(schema, dict):
        text = schema.get("description", "")
        if schema.get("type") == "number" and text.startswith("in ["):
            yield text.removeprefix("in "), schema
        for value in schema.values():
            yield from quantities(value)
    elif isinstance(schema, list):
        for value in schema:
            yield from quantities(value)


def test_each_field_is_described_with_unit_and_range():
    models = all_models()
    assert len(models) >= 15
    for model in models:
        properties = model.model_json_schema(ref_template="{model}")["properties"]
        for name, field in model.model_fields.items():
            assert field.description, f"{model.__name__}.{name} has no description"
            for unit, number in quantities(properties.get(name, {})):
                assert unit in field.description, f"{model.__name__}.{name}: {unit}"
                for key, sign in (("exclusiveMinimum", ">"), ("minimum", ">="), ("maximum", "<=")):
                    if key in number:
                        assert f"{sign} {number[key]:g}" in field.description, f"{model.__name__}.{name}: {key}"


def test_a_fill_takes_one_amount_and_a_height_stands_for_one():
    def fill(**keys):
        box = {"min": [0, 0, 0], "max": [1, 1, 1]}
        data = minimal()
        data["grains"] = [{"material": "glass", "fill": {"box": box, "diameter": "1 cm", **keys}}]
        return Scene.model_validate(data).grains[0].fill

    assert fill(mass="2 kg").mass == 2.0
    assert fill(height="20 cm").height == 0.2
    assert fill(height=0.2, count=3).count == 3
    for keys in ({}, {"count": 3, "mass": 2.0}, {"height": 0.2, "solid_fraction": 0.5, "count": 3}):
        with pytest.raises(SceneError, match="exactly one of count, mass, solid_fraction"):
            fill(**keys)
