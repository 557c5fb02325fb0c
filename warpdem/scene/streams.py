"""Streams as scene data: grains that are inserted during the run, where, how many, of what."""

import itertools
from typing import Annotated, Self

import numpy as np
from pydantic import BeforeValidator, Discriminator, Field, Tag, model_validator

from warpdem.scene.base import (
    GROUP_NAME,
    LIQUID_CONTENT,
    Duration,
    Label,
    LiquidContent,
    SceneModel,
    Vec3,
    Whole,
    exactly_one,
    validation_error,
)
from warpdem.scene.clumps import Orientation
from warpdem.scene.regions import VOLUMES, DiskFace, MeshFace, Region
from warpdem.scene.size_distribution import Diameter, SizeLaw, size_law
from warpdem.scene.units import Quantity, Vector

SHAPES = (*VOLUMES, "disk", "face")
"""Keys that say where grains are inserted."""


def _rate(unit: str) -> object:
    """Annotation of a rate: a number, or a table against time."""
    row = tuple[Annotated[float, Quantity("s")], Annotated[float, Quantity(unit, ge=0)]]
    table = Annotated[list[Annotated[row, BeforeValidator(_pair)]], Field(min_length=2), Tag("~table")]
    return Annotated[
        Annotated[float, Quantity(unit, gt=0), Tag("~number")] | table,
        Discriminator(lambda value: "~table" if isinstance(value, (list, tuple)) else "~number"),
    ]


def _pair(value: object) -> object:
    """Refuse what is no row of a table."""
    if not isinstance(value, (list, tuple)) or len(value) != 2:
        raise ValueError("must be a list of two numbers, [time, rate]")
    return value


Table = list[tuple[float, float]]
"""Rates against time: [time, rate] in each row [s, 1/s or kg/s]."""
MassRate = _rate("kg/s")
CountRate = _rate("1/s")


class _Bodies(SceneModel):
    """Base of what streams insert: what is to be said of clumps."""

    diameter: Diameter | None = Field(
        None, description="Diameter of the grains [m], > 0, or a distribution; not with clump, which has its size."
    )
    clump: str | None = Field(None, description="Name of the clump that each of them is, inserted whole; in place of diameter.")
    size: Annotated[float, Quantity("-", gt=0)] | None = Field(
        None, description="With clump: factor on its lengths [-], > 0, default 1."
    )
    orientation: Orientation | None = Field(
        None,
        description='With clump: "random" (default), all directions alike; "aligned", its axes along those of the region; or a '
        "quaternion (w, x, y, z) [-] from the axes of the clump to those of the region, of any length > 0.",
    )

    @model_validator(mode="after")
    def _clump_keys_agree(self) -> Self:
        if self.clump is None:
            for key in ("size", "orientation"):
                if (given := getattr(self, key)) is not None:
                    raise validation_error([((key,), given, "belongs to a clump: name it with clump")])
        elif self.diameter is not None:
            reason = "cannot be given with clump: the clump has its size, and size is a factor on it"
            raise validation_error([(("diameter",), None, reason)])
        if isinstance(self.orientation, tuple) and not any(self.orientation):
            raise validation_error([(("orientation",), self.orientation, "must not be zero")])
        return self


class Portion(_Bodies):
    """A part of a recipe: grains of one material and size law, or clumps."""

    name: Label | None = GROUP_NAME
    material: str = Field(description="Name of the material.")
    liquid_content: LiquidContent = LIQUID_CONTENT
    mass_share: Annotated[float, Quantity("-", gt=0)] | None = Field(
        None, description="Part of the stream's mass, relative to those of the other portions [-], > 0; this or number_share."
    )
    number_share: Annotated[float, Quantity("-", gt=0)] | None = Field(
        None, description="Part of the stream's grains, relative to those of the other portions [-], > 0; this or mass_share."
    )

    @property
    def share(self) -> float:
        """Its part of the stream, by mass or by number [-]."""
        return self.mass_share or self.number_share or 1.0

    @property
    def sizes(self) -> SizeLaw:
        """Law of the sizes of its spheres."""
        assert self.diameter is not None
        return size_law(self.diameter)

    @model_validator(mode="after")
    def _has_a_size(self) -> "Portion":
        if self.diameter is None and self.clump is None:
            raise validation_error([(("diameter",), None, "missing: give the diameter of the grains, or a clump")])
        return self


class Stream(_Bodies, Region):
    """Inlet: grains inserted during the run at random positions of a region or face that are free of grains and walls."""

    name: Label | None = GROUP_NAME
    material: str | None = Field(None, description="Name of the material; this and diameter or clump, or recipe.")
    liquid_content: LiquidContent = LIQUID_CONTENT
    recipe: list[Portion] | None = Field(
        None,
        min_length=1,
        description="Grains of several materials or sizes, and clumps, in place of material and diameter. Each is of the "
        "portion that is furthest behind its share.",
    )
    disk: DiskFace | None = Field(None, description="Disk on which the centres are; the grains' largest sections lie on it.")
    face: MeshFace | None = Field(
        None, description="Open surface on which the centres are, evenly by area, a radius or more from its rim."
    )
    velocity: Annotated[Vec3, Vector(Quantity("m/s"))] = Field(
        (0.0, 0.0, 0.0), description="Their velocity relative to what the region is fixed to, in its axes [m/s], default 0."
    )
    mass_rate: MassRate | None = Field(  # type: ignore[valid-type]
        None,
        description="Mass per time [kg/s], > 0; or a table [[time [s], rate], ...], rates >= 0 at times of the run, straight "
        "lines between them, constant before and after. This or count_rate, or only a total.",
    )
    count_rate: CountRate | None = Field(  # type: ignore[valid-type]
        None, description="Grains per time [1/s], > 0, or a table [[time [s], rate >= 0], ...] as of mass_rate."
    )
    mass: Annotated[float, Quantity("kg", gt=0)] | None = Field(
        None,
        description="Total mass [kg], > 0, reached within half a grain; without a rate all at once, as far as there is room.",
    )
    count: Annotated[int, Field(strict=True, ge=1)] | None = Field(
        None, description="Total number of grains [-], >= 1; without a rate all at once, as far as there is room."
    )
    start: Annotated[float, Quantity("s", ge=0)] = Field(0.0, description="Start time [s], >= 0, default 0.")
    until: Duration | None = Field(None, description="End time [s], > 0 and above start; default none.")
    seed: Whole = Field(0, description="Seed of the random numbers [-], >= 0, default 0.")

    @property
    def shape_key(self) -> str:
        """The key that says where."""
        return next(key for key in SHAPES if getattr(self, key) is not None)

    @property
    def portions(self) -> list[Portion]:
        """What is inserted: the recipe, or the one portion that material and diameter are."""
        if self.recipe is not None:
            return self.recipe
        assert self.material is not None
        same = ("material", "diameter", "clump", "size", "orientation", "name", "liquid_content")
        return [Portion.model_construct(**{key: getattr(self, key) for key in same})]

    @property
    def by_mass(self) -> bool:
        """Whether the shares of the recipe are by mass, not by number."""
        return self.portions[0].mass_share is not None

    @property
    def extremes(self) -> tuple[float, float]:
        """Smallest and largest diameter of the spheres that it may bring [m]; of clumps their templates know, 0 without any."""
        all_extremes = [portion.sizes.extremes for portion in self.portions if portion.clump is None]
        return min((low for low, _ in all_extremes), default=0.0), max((high for _, high in all_extremes), default=0.0)

    def later(self, time: float) -> "Stream":
        """The stream from ``time`` [s] on: it starts, ends and changes its rate earlier by this time."""
        ahead: dict[str, object] = {"start": max(0.0, self.start - time), "until": self.until and self.until - time}
        for key in ("mass_rate", "count_rate"):
            if isinstance(table := getattr(self, key), list):
                ahead[key] = [(at - time, rate) for at, rate in table]
        return self.model_copy(update=ahead)

    @property
    def moved(self) -> float:
        """Speed of the grains relative to the region [m/s]."""
        return float(np.linalg.norm(self.velocity))

    @model_validator(mode="after")
    def _keys_agree(self) -> "Stream":
        exactly_one(self, *SHAPES)
        self._check_amounts()
        self._check_portions()
        if self.until is not None and self.until <= self.start:
            raise validation_error([(("until",), self.until, f"must be later than start = {self.start:g} s")])
        key, largest = self.shape_key, self.extremes[1]
        if key in ("box", "cylinder", "sphere", "disk"):
            what, size = getattr(self, key).thinnest
            if size < largest:
                reason = f"its {what} of {size:g} m must be at least the diameter of the largest grain, {largest:g} m"
                raise validation_error([((key,), None, reason)])
        if self.cylinder is not None and self.cylinder.length is None:
            raise validation_error([(("cylinder", "length"), None, "missing: grains are spread evenly over the volume")])
        return self

    def _check_amounts(self) -> None:
        rates = [key for key in ("mass_rate", "count_rate") if getattr(self, key) is not None]
        totals = [key for key in ("mass", "count") if getattr(self, key) is not None]
        if len(rates) > 1 or not (rates or totals):
            found = " and ".join(rates) or "none"
            raise ValueError(f"give exactly one of mass_rate, count_rate; found {found}; or only a total, mass or count")
        if len(totals) > 1:
            raise ValueError("give at most one of mass and count")
        for key in rates:
            table = getattr(self, key)
            if not isinstance(table, list):
                continue
            times = [time for time, _ in table]
            if any(after <= before for before, after in itertools.pairwise(times)):
                raise validation_error([((key,), None, "the times of its rows must increase")])
            if not any(rate > 0.0 for _, rate in table):
                raise validation_error([((key,), None, "at least one of its rates must be above 0")])

    def _check_portions(self) -> None:
        if self.recipe is None:
            for key in ("material", "diameter"):
                if getattr(self, key) is None and (key == "material" or self.clump is None):
                    raise validation_error([((key,), None, "missing: give material and diameter or clump, or a recipe")])
            return
        if self.liquid_content > 0.0:
            raise validation_error([(("liquid_content",), self.liquid_content, "give it in the portions of the recipe")])
        for key in ("material", "diameter", "clump"):
            if (given := getattr(self, key)) is not None:
                raise validation_error([((key,), given, "cannot be given with a recipe, whose portions have their own")])
        kinds = {tuple(key for key in ("mass_share", "number_share") if getattr(p, key) is not None) for p in self.recipe}
        if len(kinds) > 1 or len(kinds.pop()) != 1:
            raise validation_error([(("recipe",), None, "give mass_share in each of its portions, or number_share in each")])
