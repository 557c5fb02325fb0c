"""External fields and observers as scene data: a model by its name, with parameters."""

from typing import Annotated, Any, Literal

from pydantic import Field, field_validator

from warpdem.scene.base import Name, SceneModel, require_unique
from warpdem.scene.model_names import model_name


class ExternalField(SceneModel):
    """A force on every grain from outside: a model of ``kernels/field/`` or of the user, with its parameters."""

    model: model_name("field") = Field(description='Field: "drag", "harmonic", "lorentz" or a .py file.')
    axes: Literal["laboratory", "frame"] = Field(
        "laboratory",
        description='Where the field is at rest: "laboratory" (default) or "frame" (velocities relative to the frame).',
    )
    parameters: dict[str, Any] = Field(
        {}, description="The field's parameters by name, as its file lists them: numbers or lists, SI or with units."
    )


class Observer(SceneModel):
    """A number read off each grain, and columns of history.csv made of it."""

    name: Name = Field(description="Name, one of a kind: letters, digits, _ and -.")
    model: model_name("observer") = Field(description='Observer: "speed" or a .py file.')
    axes: Literal["laboratory", "frame"] = Field(
        "laboratory",
        description='Axes of positions, velocities and spins: "laboratory" (default) or "frame" (relative to the frame).',
    )
    parameters: dict[str, Any] = Field(
        {}, description="The observer's parameters by name, as its file lists them: numbers or lists, SI or with units."
    )
    reduce: Annotated[list[Literal["sum", "mean", "min", "max"]], Field(min_length=1)] = Field(
        ["mean"], description='Columns over all grains: "sum", "mean", "min", "max"; default mean.'
    )

    _no_column_twice = field_validator("reduce")(require_unique)
