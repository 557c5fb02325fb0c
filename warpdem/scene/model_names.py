"""Names of models in a scene: a file of ``kernels/<role>/``, or a file of the user that the scene may load."""

from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import Annotated, Any

from pydantic import AfterValidator, Field

from warpdem.core.access import Access
from warpdem.errors import SceneError
from warpdem.scene import models
from warpdem.scene.base import FileName


def model_name(role: str, *others: str) -> Any:
    """Annotation of a model's name: a file of ``kernels/<role>/``, a file of the user, or one of ``others``."""
    known = [*models.model_names(role), *others]

    def check(name: str) -> str:
        if name not in known and not models.is_file(name):
            raise ValueError(models.allowed(role, *others) + models.nearest(name, known))
        return name

    schema = {"anyOf": [{"enum": known}, {"pattern": r"\.py$"}]}
    return Annotated[FileName, AfterValidator(check), Field(json_schema_extra=schema)]


def plugin_refusal(name: str, known: Mapping[str, Any]) -> str | None:
    """Why a scene with this ``base`` and ``access`` may not load a model; None if it may."""
    return known.get("access", Access()).plugin_refusal(name, known.get("base", Path())) if models.is_file(name) else None


def user_model(role: str, name: str, known: Mapping[str, Any]) -> ModuleType:
    """Module of a model that a scene with this ``base`` and ``access`` names.

    Raises:
        SceneError: the file of a user may not be loaded, or is no model of this role.
    """
    if refusal := plugin_refusal(name, known):
        raise SceneError(refusal)
    return models.model(role, models.located(name, known.get("base", Path())))
