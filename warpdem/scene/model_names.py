"""Names of models in a scene: a file of ``kernels/<role>/``, or a file of the user that the scene may load."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import core_schema

from warpdem.core.access import Access
from warpdem.core.nearest import nearest
from warpdem.errors import SceneError
from warpdem.scene import models
from warpdem.scene.user_models import is_file


@dataclass(frozen=True)
class ModelName:
    """Annotation of a model's name: a file of ``kernels/<role>/``, a file of the user, or one of ``others``.

    ``Annotated[FileName, ModelName("tangential", "none")]`` accepts "mindlin", "none" and "own_law.py".
    """

    role: str
    others: tuple[str, ...] = ()

    def validate(self, name: str) -> str:
        """The name itself.

        Raises:
            ValueError: No model has this name; the text names the allowed ones.
        """
        known = self._known()
        if name not in known and not is_file(name):
            raise ValueError(models.allowed(self.role, *self.others) + nearest(name, known))
        return name

    def _known(self) -> list[str]:
        return [*models.model_names(self.role), *self.others]

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        return core_schema.no_info_after_validator_function(self.validate, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        return {**handler(schema), "anyOf": [{"enum": self._known()}, {"pattern": r"\.py$"}]}


def plugin_refusal(name: str, known: Mapping[str, Any]) -> str | None:
    """Reason why a scene may not load a model; None if it may. ``known`` holds the scene's ``base`` and ``access``."""
    access: Access = known.get("access", Access())
    return access.plugin_refusal(name, known.get("base", Path())) if is_file(name) else None


def user_model(role: str, name: str, known: Mapping[str, Any]) -> ModuleType:
    """Module of a model that a scene names. ``known`` holds the scene's ``base`` and ``access``.

    Raises:
        SceneError: The file of a user may not be loaded, or is no model of this role.
    """
    if refusal := plugin_refusal(name, known):
        raise SceneError(refusal)
    return models.model(role, models.located(name, known.get("base", Path())))
