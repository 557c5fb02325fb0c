"""External fields and observers as scene data: a model by its name, with its parameters."""

from typing import Annotated, Any, Literal

from pydantic import Field, field_validator

from warpdem.scene.base import FileName, Name, SceneModel, require_unique
from warpdem.scene.model_names import ModelName


class ExternalField(SceneModel):
    """An external force on every grain: a model of ``kernels/field/`` or of the user, with its parameters."""

    model: Annotated[FileName, ModelName("field")] = Field(description='Field: "drag", "harmonic", "lorentz" or a .py file.')
    axes: Literal["laboratory", "frame"] = Field(
        "laboratory",
        description='Axes in which the field is at rest: "laboratory" (default) or "frame" (velocities relative to the frame).',
    )
    parameters: dict[str, Any] = Field(
        {}, description="Parameters of the field by name, as its file defines them: numbers or lists, in SI or with units."
    )


class Observer(SceneModel):
    """A quantity of each grain, reduced to columns of history.csv."""

    name: Name = Field(description="Unique name: letters, digits, _ and -.")
    model: Annotated[FileName, ModelName("observer")] = Field(description='Observer: "speed" or a .py file.')
    axes: Literal["laboratory", "frame"] = Field(
        "laboratory",
        description='Axes of positions, velocities and spins: "laboratory" (default) or "frame" (relative to the frame).',
    )
    parameters: dict[str, Any] = Field(
        {}, description="Parameters of the observer by name, as its file defines them: numbers or lists, in SI or with units."
    )
    reduce: Annotated[list[Literal["sum", "mean", "min", "max"]], Field(min_length=1)] = Field(
        ["mean"], description='Reductions over all grains, a column each: "sum", "mean", "min", "max"; default mean.'
    )

    _no_column_twice = field_validator("reduce")(require_unique)
