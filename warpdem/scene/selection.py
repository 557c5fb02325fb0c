"""Which grains a measure counts: those of a group, of a material, of a range of diameters."""

from collections.abc import Iterator
from typing import Annotated

from pydantic import AfterValidator, Field, model_validator

from warpdem.core.key_path import KeyPath
from warpdem.scene.base import Label, Name, Problem, SceneModel
from warpdem.scene.units import Quantity, Vector


def _ascending(limits: tuple[float, float]) -> tuple[float, float]:
    """Refuse limits that leave nothing between them."""
    low, high = limits
    if not 0.0 <= low < high:
        raise ValueError(f"must be two diameters, 0 <= smallest < largest; the first is {low:g} m, the second {high:g} m")
    return limits


Diameters = Annotated[tuple[float, float], Vector(Quantity("m"), 2), AfterValidator(_ascending)]


class Selection(SceneModel):
    """Grains that fulfil every condition that is given."""

    group: Label | None = Field(None, description="Name of a group of grains or of a stream, default any.")
    material: Name | None = Field(None, description="Name of a material, default any.")
    diameter: Diameters | None = Field(
        None, description="Smallest and largest diameter [m]; the first counts, the second does not. Default any."
    )

    @model_validator(mode="after")
    def _selects(self) -> "Selection":
        if self.group is None and self.material is None and self.diameter is None:
            raise ValueError("give at least one of group, material, diameter; without `of` all grains count")
        return self


def selection_problems(
    path: KeyPath, of: Selection | None, groups: list[str] | None, materials: list[str]
) -> Iterator[Problem]:
    """Groups and materials that the scene has not.

    Args:
        path: key path of the selection.
        of: the selection; None selects all.
        groups: names of the scene's groups; None where they are not known yet.
        materials: names of its materials.
    """
    for key, known in (("group", groups), ("material", materials)):
        name = getattr(of, key, None)
        if name is not None and known is not None and name not in known:
            yield (*path, key), name, f"no such {key}; the scene has {', '.join(known) or 'none'}"
