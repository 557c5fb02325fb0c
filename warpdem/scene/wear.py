"""Wear and mean pressure of walls, as scene data."""

from typing import Annotated

from pydantic import Field

from warpdem.scene.base import SceneModel
from warpdem.scene.units import Quantity

Positive = Annotated[float, Quantity("-", gt=0)]
Stress = Annotated[float, Quantity("Pa", gt=0)]


class Archard(SceneModel):
    """Archard's law of abrasion: depth = k sliding/(H area)."""

    coefficient: Positive = Field(description="Wear coefficient k [-], > 0.")
    hardness: Stress = Field(description="Hardness H of the wall [Pa], > 0.")


class Finnie(SceneModel):
    """Finnie's law of erosion of ductile walls by impacts."""

    pressure: Stress = Field(description="Flow pressure p of the wall [Pa], > 0.")
    force_ratio: Positive = Field(2.0, description="Normal over tangential force while cutting, K [-], > 0, default 2.")
    depth_ratio: Positive = Field(2.0, description="Depth of contact over depth of the cut, psi [-], > 0, default 2.")


class Wear(SceneModel):
    """What wears walls, added up at every step for each triangle of a mesh and each wall; the walls keep their shape."""

    start: Annotated[float, Quantity("s", ge=0)] = Field(
        0.0, description="Time from which sums and means count [s], >= 0, default 0: after the transient."
    )
    archard: Archard | None = Field(None, description="Depth by Archard's law too, default no.")
    finnie: Finnie | None = Field(None, description="Depth by Finnie's law too, default no.")
