"""A calibration file: parameters with ranges, experiments with the scene of each, targets with their uncertainty."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from warpdem.calibration.standard import standard_scene, standard_text
from warpdem.core.nearest import nearest
from warpdem.errors import SceneError
from warpdem.scene.file import read_tables
from warpdem.scene.messages import scene_error
from warpdem.sweep.quantities import Quantity
from warpdem.sweep.table import Range, check_names, parse_range

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9 _.-]*$")
MOST_PARAMETERS = 8
"""Parameters at most: the first round alone takes 48 runs of each experiment with 8."""


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Parameter(_Table):
    """What is to be found."""

    name: str = Field(description="Name of the parameter in results.")
    key: str | list[str] = Field(description="Key of the scenes that it sets, or several, as in --set: pairs.0.friction.")
    range: str = Field(description='Least and greatest value, "0.1:0.9", "1:50 MPa:log" on a logarithmic scale.')

    @property
    def keys(self) -> list[str]:
        """The keys of the scenes that it sets."""
        return [self.key] if isinstance(self.key, str) else self.key

    @property
    def limits(self) -> Range:
        """The range as numbers."""
        return parse_range(f"{self.name}={self.range}", "range of ")


class Target(_Table):
    """What was measured."""

    measure: str = Field(description="Quantity of the run as in warpdem sweep --results, or a measure of the standard test.")
    value: float = Field(allow_inf_nan=False, description="Measured value, in the unit of the quantity.")
    uncertainty: float = Field(gt=0, allow_inf_nan=False, description="Its standard deviation, in the same unit, > 0.")
    name: str | None = Field(None, description="Name in results, default the measure.")

    @property
    def title(self) -> str:
        """Name in results."""
        return self.name or self.measure


class Experiment(_Table):
    """A scene that is run, and what was measured in it."""

    name: str = Field(description="Name of the experiment, and of its folder.")
    scene: str | None = Field(None, description="Scene file, relative to the calibration file; this or test.")
    test: str | None = Field(None, description="A standard test that comes with warpdem; this or scene.")
    set: list[str] = Field([], description='Changes of the scene that all runs share, as "time.end=0.5".')
    keys: dict[str, list[str]] = Field({}, description="Keys of parameters in this scene, if others; none leaves it as it is.")
    seeds: list[str] | None = Field(None, description="Keys of the seeds that repeats change; default those of all grains.")
    targets: Annotated[list[Target], Field(min_length=1)] = Field(description="What was measured.")

    def path(self, folder: Path) -> Path:
        """The scene file; ``folder`` is that of the calibration file."""
        return standard_scene(self.test) if self.test is not None else folder / str(self.scene)

    @property
    def quantities(self) -> list[Quantity]:
        """Of each target."""
        return [Quantity(standard_text(self.test, target.measure)) for target in self.targets]


class Calibration(_Table):
    """What a calibration file holds."""

    title: str = Field("", description="What is calibrated.")
    runs: int | None = Field(None, ge=4, description="Most runs of each experiment, default by the number of parameters.")
    repeats: int = Field(1, ge=1, le=100, description="Runs with other seeds at each point, default 1.")
    confidence: float = Field(0.95, gt=0.5, lt=1, description="Probability that the intervals hold all values, default 0.95.")
    seed: int = Field(0, ge=0, description="Seed of the points that are tried, default 0.")
    parameters: Annotated[list[Parameter], Field(min_length=1, max_length=MOST_PARAMETERS)]
    experiments: Annotated[list[Experiment], Field(min_length=1)]

    def keys(self, parameter: Parameter, experiment: Experiment) -> Sequence[str]:
        """Keys of a scene that a parameter sets."""
        return experiment.keys.get(parameter.name, parameter.keys)


def load_calibration(path: Path) -> Calibration:
    """Read a calibration file; its scenes are read when they are run.

    Raises:
        SceneError: file, key, value and what is allowed.
    """
    data = read_tables(path)
    try:
        made = Calibration.model_validate(data)
    except ValidationError as error:
        raise scene_error(error, str(path), Calibration) from None
    for what, names in (("parameters", [one.name for one in made.parameters]),
                        ("experiments", [one.name for one in made.experiments])):  # fmt: skip
        for k, name in enumerate(names):
            if not NAME.match(name) or names.index(name) != k:
                why = "is there twice" if names.index(name) != k else "must be of letters, digits, spaces and _.-"
                raise SceneError(f"{path}: {what}[{k}].name = {name!r}: {why}")
    for k, parameter in enumerate(made.parameters):
        try:
            parameter.limits  # noqa: B018
            check_names(parameter.keys, f"parameters[{k}].key")
        except SceneError as error:
            raise SceneError(f"{path}: {error}") from None
    for k, experiment in enumerate(made.experiments):
        _check_experiment(made, experiment, f"{path}: experiments[{k}]")
    for parameter in made.parameters:
        if not any(made.keys(parameter, one) for one in made.experiments):
            raise SceneError(f"{path}: parameter {parameter.name!r} is set in no experiment")
    return made


def _check_experiment(made: Calibration, experiment: Experiment, where: str) -> None:
    if (experiment.scene is None) == (experiment.test is None):
        raise SceneError(f"{where}: give either scene, a file, or test, a standard test, and not both")
    known = [one.name for one in made.parameters]
    for name, keys in experiment.keys.items():
        if name not in known:
            hint = nearest(name, known) or f"; there are {', '.join(known)}"
            raise SceneError(f"{where}.keys: there is no parameter {name!r}{hint}")
        check_names(keys, f"{where}.keys.{name}")
    titles = [one.title for one in experiment.targets]
    for k, title in enumerate(titles):
        if titles.index(title) != k:
            raise SceneError(f"{where}.targets[{k}]: a target {title!r} is there already; give it another name")
    try:
        for target in experiment.targets:
            Quantity(standard_text(experiment.test, target.measure))
        if experiment.test is not None:
            standard_scene(experiment.test)
    except SceneError as error:
        raise SceneError(f"{where}: {error}") from None
