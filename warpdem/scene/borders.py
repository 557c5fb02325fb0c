"""Borders of the domain as scene data."""

from typing import Annotated, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from warpdem.scene.base import SceneModel, validation_error
from warpdem.scene.units import Quantity

Coordinate = Annotated[float, Quantity("m")]
# the tags select the branch of validation and are left out of messages
BothSides = Annotated[Literal["periodic", "open", "stop"], Tag("~both")]
TwoSides = Annotated[list[Literal["open", "stop"]], Field(min_length=2, max_length=2), Tag("~two")]


class Border(SceneModel):
    """The borders of one axis."""

    min: Coordinate | None = Field(None, description="Lower border [m]; default none.")
    max: Coordinate | None = Field(None, description="Upper border [m]; default none.")
    kind: BothSides | TwoSides = Field(
        discriminator=Discriminator(lambda value: "~two" if isinstance(value, (list, tuple)) else "~both"),
        description='"periodic" (both borders), "open" (grains beyond are removed and counted), "stop" (a grain beyond '
        'stops the run), or [at min, at max] for "open" and "stop".'
    )

    @model_validator(mode="after")
    def _keys_agree(self) -> "Border":
        if self.min is None and self.max is None:
            raise validation_error([(("min",), None, "missing: give min, max or both")])
        if self.kind == "periodic" and (self.min is None or self.max is None):
            raise validation_error([(("kind",), self.kind, "a periodic axis needs min and max")])
        if self.min is not None and self.max is not None and self.min >= self.max:
            raise validation_error([(("max",), self.max, f"must be above min = {self.min:g} m")])
        return self


class Borders(SceneModel):
    """Borders of the domain along the axes of the frame or of the laboratory."""

    x: Border | None = Field(None, description="Borders of the x axis, default none.")
    y: Border | None = Field(None, description="Borders of the y axis, default none.")
    z: Border | None = Field(None, description="Borders of the z axis, default none.")
    fixed_to: Literal["frame", "laboratory"] = Field(
        "frame", description='Whose axes they are square to and at rest in: "frame" (default) or "laboratory"; periodic ones '
        "belong to the frame.",
    )

    @model_validator(mode="after")
    def _periodic_ones_belong_to_the_frame(self) -> "Borders":
        for axis in "xyz":
            border = getattr(self, axis)
            if self.fixed_to == "laboratory" and border is not None and border.kind == "periodic":
                reason = 'periodic borders belong to the frame: leave fixed_to = "laboratory" out; outlets may have it instead'
                raise validation_error([((axis, "kind"), border.kind, reason)])
        return self
