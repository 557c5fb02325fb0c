"""JSON schema of a scene file, for editors."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from warpdem.core.file_names import expanded
from warpdem.scene import pair_keys
from warpdem.scene.contact import Pair
from warpdem.scene.model import Scene
from warpdem.scene.phases import NOT_IN_A_PHASE
from warpdem.scene.user_models import LAWS


def scene_schema(plugins: Sequence[str | Path] = ()) -> dict[str, Any]:
    """JSON schema of a scene file, for editors; numbers with a unit appear as "number or string".

    Keys of ``[[pairs]]`` that a contact law of the user declares are known once its file is. Without ``plugins`` the
    schema allows any key there in a scene that names a .py file as a law, and only those of the package in all others.

    Args:
        plugins: .py files with contact laws of your own, which are imported: their keys are in the schema, and no other.

    Raises:
        SceneError: A plugin cannot be imported, or declares its keys wrongly.
    """
    schema = Scene.model_json_schema()
    parts = {key: {"description": f"Changes of {key}."} for key in Scene.model_fields if key not in NOT_IN_A_PHASE}
    phase = schema["$defs"]["Phase"]
    phase |= {"properties": {**phase["properties"], **parts}, "additionalProperties": False}
    pair = schema["$defs"]["Pair"]
    if plugins:
        own = {key: entry for file in plugins for key, entry in pair_keys.of_file(str(expanded(file).resolve())).items()}
        pair["properties"] |= Pair.with_keys(own).model_json_schema()["properties"]
    else:
        del pair["additionalProperties"]
        of_package = {"properties": {role: {"not": {"pattern": r"\.py$"}} for role in LAWS}}
        known = {"propertyNames": {"enum": list(pair["properties"])}}
        schema |= {
            "if": {"properties": {"contact": of_package}},
            "then": {"properties": {"pairs": {"items": known}}},
        }
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}
