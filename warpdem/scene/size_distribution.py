"""Size distributions of grains: diameters as scene data, and random samples of them.

Every distribution becomes one polyline: its cumulative fraction by number, linear between nodes. A single diameter is one step,
a table a sequence of steps; normal curves are divided so finely that the polyline deviates by less than 1e-5. A sample is one
interpolation of uniform random numbers, so that the same generator gives the same bits.
"""

import math
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import Discriminator, Field, Tag, model_validator

from warpdem.scene.base import Length, SceneModel, exactly_one, validation_error
from warpdem.scene.units import Quantity, Vector

FINE_RATIO = 0.003
"""Largest distance of two nodes in the logarithm of the diameter [-] when a fraction by mass is converted to one by number."""
MIN_FRACTION = 1e-6
"""Smallest fraction of a normal curve that must lie between the cut-offs [-]."""

Share = Annotated[float, Quantity("-", ge=0)]


class Spread(SceneModel):
    """Normal or log-normal curve with cut-offs; mean and deviation are those of the uncut curve."""

    mean: Length = Field(description="Mean diameter [m], > 0.")
    deviation: Length = Field(description="Standard deviation of the diameter [m], > 0.")
    min: Length = Field(description="Smallest diameter [m], > 0.")
    max: Length = Field(description="Largest diameter [m], > 0 and not below min.")

    @model_validator(mode="after")
    def _rises(self) -> "Spread":
        if self.min > self.max:
            raise validation_error([(("max",), self.max, f"must not be below min = {self.min:g} m")])
        return self


class DiameterDistribution(SceneModel):
    """Distribution of diameters; exactly one form is given."""

    uniform: Annotated[tuple[float, float], Vector(Quantity("m", gt=0), length=2)] | None = Field(
        None, description="Smallest and largest diameter [m], > 0; diameters are uniform between them."
    )
    normal: Spread | None = Field(None, description="Normal distribution of the diameter, cut off at min and max.")
    lognormal: Spread | None = Field(None, description="Log-normal distribution of the diameter, cut off at min and max.")
    table: Annotated[list[tuple[Length, Share]], Field(min_length=1)] | None = Field(
        None, description="Rows [diameter [m], > 0, fraction [-], >= 0]: only these diameters; fractions in any scale."
    )
    cumulative: Annotated[list[tuple[Length, Share]], Field(min_length=2)] | None = Field(
        None,
        description="Rows [diameter [m], > 0, finer fraction [-], >= 0], increasing from fraction 0, linear in between: "
        "a sieve curve; fractions in any scale.",
    )
    by: Literal["number", "mass"] = Field(
        "number", description='Quantity that the fractions count: the "number" of grains (default) or their "mass".'
    )

    @model_validator(mode="after")
    def _makes_sense(self) -> "DiameterDistribution":
        exactly_one(self, "uniform", "normal", "lognormal", "table", "cumulative")
        if self.uniform is not None and self.uniform[0] > self.uniform[1]:
            raise validation_error([(("uniform",), self.uniform, "the first diameter must not be above the second")])
        if self.table is not None:
            if sum(share for _, share in self.table) <= 0.0:
                raise validation_error([(("table",), self.table, "the fractions must not all be 0")])
        if self.cumulative is not None:
            diameter, share = np.array(self.cumulative).T
            if (np.diff(diameter) <= 0.0).any() or (np.diff(share) < 0.0).any():
                raise validation_error([(("cumulative",), self.cumulative, "diameters must increase, fractions not decrease")])
            if share[0] != 0.0 or share[-1] <= 0.0:
                raise validation_error([(("cumulative",), self.cumulative, "the fraction must start at 0 and end above 0")])
        for key in ("normal", "lognormal"):
            spread = getattr(self, key)
            if spread is None or spread.min == spread.max:
                continue
            inside = np.diff(_cumulative(self)[1][[0, -1]])[0]
            if not inside > MIN_FRACTION:
                reason = f"only {inside:.3g} of the distribution lies between min and max; at least {MIN_FRACTION:g} must"
                raise validation_error([((key,), None, reason)])
        return self


Diameter = Annotated[
    Annotated[Length, Tag("~number")] | Annotated[DiameterDistribution, Tag("~distribution")],
    # the tags select the branch of validation and appear in the key paths of errors; messages leave out those with "~"
    Discriminator(lambda value: "~distribution" if isinstance(value, (dict, DiameterDistribution)) else "~number"),
]


class FactorDistribution(SceneModel):
    """Distribution of the factor on the lengths of a clump, by number; exactly one form is given."""

    uniform: Annotated[tuple[float, float], Vector(Quantity("-", gt=0), length=2)] | None = Field(
        None, description="Least and greatest factor [-], > 0; factors are uniform between them."
    )
    table: Annotated[list[tuple[Annotated[float, Quantity("-", gt=0)], Share]], Field(min_length=1)] | None = Field(
        None, description="Rows [factor [-], > 0, fraction of the clumps [-], >= 0]: only these; fractions in any scale."
    )

    @model_validator(mode="after")
    def _makes_sense(self) -> "FactorDistribution":
        exactly_one(self, "uniform", "table")
        if self.uniform is not None and self.uniform[0] > self.uniform[1]:
            raise validation_error([(("uniform",), self.uniform, "the first factor must not be above the second")])
        if self.table is not None and sum(share for _, share in self.table) <= 0.0:
            raise validation_error([(("table",), self.table, "the fractions must not all be 0")])
        return self


Factor = Annotated[
    Annotated[float, Quantity("-", gt=0), Tag("~number")] | Annotated[FactorDistribution, Tag("~distribution")],
    Discriminator(lambda value: "~distribution" if isinstance(value, (dict, FactorDistribution)) else "~number"),
]


def factor_law(factor: "float | FactorDistribution | None") -> "SizeLaw":
    """Cumulative distribution of a factor, in place of a diameter; None stands for 1."""
    if isinstance(factor, FactorDistribution):
        return size_law(DiameterDistribution(uniform=factor.uniform, table=factor.table))
    return size_law(1.0 if factor is None else factor)


@dataclass(frozen=True, eq=False)
class SizeLaw:
    """Cumulative distribution of diameters by number: linear between nodes, a step where a diameter is repeated."""

    diameter: np.ndarray
    """Nodes [m], shape (k,), not decreasing."""
    share: np.ndarray
    """Fraction of finer grains [-], shape (k,), from 0 to 1, not decreasing."""

    @property
    def extremes(self) -> tuple[float, float]:
        """Smallest and largest diameter [m]."""
        return float(self.diameter[0]), float(self.diameter[-1])

    @property
    def mean_diameter(self) -> float:
        """Mean diameter by number [m]."""
        return float((np.diff(self.share) * 0.5 * (self.diameter[1:] + self.diameter[:-1])).sum())

    @property
    def mean_volume(self) -> float:
        """Mean volume of a grain by number [m3]."""
        a, b = self.diameter[:-1], self.diameter[1:]
        # int(d^3, a..b) / (b - a) without the cancellation of (b^4 - a^4) / (b - a)
        return float(np.pi / 6.0 * (np.diff(self.share) * 0.25 * (a + b) * (a * a + b * b)).sum())

    def draw(self, generator: np.random.Generator, count: int) -> np.ndarray:
        """Diameters [m] of ``count`` grains, shape (count,); a larger count begins with the same diameters."""
        return np.asarray(np.interp(generator.random(count), self.share, self.diameter))

    def draw_volume(self, generator: np.random.Generator, volume: float) -> np.ndarray:
        """Diameters [m] of grains whose total volume is closest to ``volume`` [m3], shape (n,).

        The diameters are those of ``draw``, in the same order.
        """
        diameter = np.empty(0)
        while (filled := np.cumsum(np.pi / 6.0 * diameter**3)).max(initial=0.0) < volume:
            batch = int(1.1 * (volume - filled.max(initial=0.0)) / self.mean_volume) + 16
            diameter = np.concatenate([diameter, self.draw(generator, batch)])
        n = int(np.searchsorted(filled, volume))
        # the last grain, which exceeds the volume, is included if that gives the smaller error
        below = filled[n - 1] if n else 0.0
        return diameter[: n + bool(filled[n] - volume < volume - below)]


def size_law(diameter: float | DiameterDistribution) -> SizeLaw:
    """Cumulative distribution of one diameter [m] for all grains, or of a distribution."""
    if not isinstance(diameter, DiameterDistribution):
        return SizeLaw(np.array([diameter, diameter], dtype=float), np.array([0.0, 1.0]))
    nodes, share = _cumulative(diameter)
    if diameter.by == "mass":
        nodes, share = _by_number(nodes, share)
    return SizeLaw(nodes, (share - share[0]) / (share[-1] - share[0]))


def _cumulative(given: DiameterDistribution) -> tuple[np.ndarray, np.ndarray]:
    """Nodes [m] and cumulative fraction, in the scale of the scene, by number or mass as in the scene."""
    if given.uniform is not None:
        return np.array(given.uniform), np.array([0.0, 1.0])
    if given.cumulative is not None:
        diameter, share = np.array(given.cumulative).T
        return diameter, share
    if given.table is not None:
        diameter, share = np.array(sorted(given.table)).T
        return np.repeat(diameter, 2), np.insert(np.repeat(np.cumsum(share), 2)[:-1], 0, 0.0)
    if (normal := given.normal) is not None:
        return _normal_curve(normal.min, normal.max, normal.mean, normal.deviation)
    spread = given.lognormal
    if spread is None:
        raise ValueError("an empty distribution")  # refused by validation
    # parameters of ln d for the given mean and deviation of d
    square = math.log1p((spread.deviation / spread.mean) ** 2)
    centre = math.log(spread.mean) - 0.5 * square
    nodes, share = _normal_curve(math.log(spread.min), math.log(spread.max), centre, math.sqrt(square))
    return np.clip(np.exp(nodes), spread.min, spread.max), share


def _normal_curve(low: float, high: float, centre: float, deviation: float) -> tuple[np.ndarray, np.ndarray]:
    """Nodes between two cut-offs and the cumulative normal distribution there; [0, 1] if the cut-offs are equal."""
    if low == high:
        return np.array([low, high]), np.array([0.0, 1.0])
    core = np.clip(centre + deviation * np.linspace(-8.0, 8.0, 2049), low, high)
    nodes = np.union1d(np.linspace(low, high, 1025), core)
    return nodes, np.array([0.5 * math.erfc(z) for z in (centre - nodes) / (math.sqrt(2.0) * deviation)])


def _by_number(diameter: np.ndarray, share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and cumulative fraction by number of a distribution given by mass.

    Between two nodes a and b the mass is uniform, so that the number there is its fraction times the mean of d^-3,
    (a + b) / (2 a^2 b^2); nodes are added where they are too far apart for the number to be uniform too.
    """
    (a, b), (low, high) = (diameter[:-1], diameter[1:]), (share[:-1], share[1:])
    pieces = np.ceil(np.log(b / a) / FINE_RATIO).astype(int).clip(min=1)
    cell = np.repeat(np.arange(len(a)), pieces)
    part = (np.arange(len(cell)) - np.repeat(np.cumsum(pieces) - pieces, pieces)) / pieces[cell]
    fine = a[cell] * (b / a)[cell] ** part
    width = np.where(b > a, b - a, 1.0)
    fine_share = low[cell] + (high - low)[cell] * (fine - a[cell]) / width[cell]
    fine, fine_share = np.append(fine, diameter[-1]), np.append(fine_share, share[-1])
    a, b = fine[:-1] / fine[0], fine[1:] / fine[0]
    number = np.diff(fine_share) * (a + b) / (2.0 * a * a * b * b)
    return fine, np.insert(np.cumsum(number), 0, 0.0)
