"""What all parts of a scene are made of: their base class, annotated numbers, and errors that name a key."""

import math
import unicodedata
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError
from pydantic_core import InitErrorDetails, PydanticCustomError

from warpdem.core.file_names import unusable
from warpdem.scene.units import Quantity, Vector

Vec3 = tuple[float, float, float]


def unit_vector(vector: tuple[float, ...]) -> tuple[float, ...]:
    """The direction of ``vector``.

    Raises:
        ValueError: it has none.
    """
    norm = math.hypot(*vector)
    if norm == 0.0:
        raise ValueError("must not be the zero vector")
    # left alone when it is one already, so that a scene written out and read again keeps its bits
    return vector if abs(norm - 1.0) < 1e-15 else tuple(x / norm for x in vector)


LONGEST_NAME = 100
"""Bytes of a name that becomes a part of names of files [-]."""
LONGEST_LABEL = 200
"""Bytes of another name [-]."""


def _short(name: str) -> str:
    """Refuse a name too long to be part of the name of a file."""
    if (length := len(name.encode())) > LONGEST_NAME:
        raise ValueError(f"must be at most {LONGEST_NAME} bytes long, is {length}: results are named by it")
    return name


def _file_name(name: str) -> str:
    """Refuse what no file can be called."""
    if reason := unusable(name):
        raise ValueError(reason)
    return name


def _label(name: str) -> str:
    """Refuse a name that no message and no legend can show."""
    if any(unicodedata.category(c) in ("Cc", "Cs") for c in name) or len(name.encode(errors="replace")) > LONGEST_LABEL:
        raise ValueError(f"must be a name without control characters, at most {LONGEST_LABEL} bytes long")
    return name


Label = Annotated[str, AfterValidator(_label)]
Name = Annotated[str, Field(pattern=r"^[\w-]+$"), AfterValidator(_short)]
Point = Annotated[Vec3, Vector(Quantity("m"))]
Direction = Annotated[Vec3, Vector(Quantity("-")), AfterValidator(unit_vector)]
Length = Annotated[float, Quantity("m", gt=0)]
Duration = Annotated[float, Quantity("s", gt=0)]
AngularRate = Annotated[float, Quantity("rad/s")]
FileName = Annotated[
    str, BeforeValidator(lambda value: str(value) if isinstance(value, Path) else value), AfterValidator(_file_name)
]

Problem = tuple[tuple[str | int, ...], Any, str]
"""Place (keys and list indices), value there, and what is wrong."""


class SceneModel(BaseModel):
    """Base of all parts of a scene: unknown keys are refused, values do not change."""

    model_config = ConfigDict(extra="forbid", frozen=True, arbitrary_types_allowed=True)


def wrong(problems: Iterable[Problem]) -> ValidationError:
    """Error with the place of each problem, so that a message can name its key."""
    errors = [
        InitErrorDetails(type=PydanticCustomError("scene", "{reason}", {"reason": text}), loc=loc, input=value)
        for loc, value, text in problems
    ]
    return ValidationError.from_exception_data("Scene", errors)


def alike(name: str) -> str:
    """What two names have in common that some file systems take for one: equal but for case and composition of letters."""
    return unicodedata.normalize("NFC", name).casefold()


def none_twice(values: list[str]) -> list[str]:
    """Refuse a list in which something comes twice."""
    if len(set(values)) < len(values):
        raise ValueError("each at most once")
    return values


def relocated(error: ValidationError, place: Callable[[tuple], tuple]) -> ValidationError:
    """The same problems at other places."""
    errors = []
    for detail in error.errors(include_url=False):
        kind = detail["type"]
        if kind == "scene":
            kind = PydanticCustomError("scene", "{reason}", detail["ctx"])
        errors.append(
            InitErrorDetails(type=kind, loc=place(detail["loc"]), input=detail["input"], ctx=detail.get("ctx", {}))
        )
    return ValidationError.from_exception_data("Scene", errors)


def exactly_one(model: SceneModel, *keys: str) -> None:
    """Refuse a part in which none or several of these keys are given."""
    given = [key for key in keys if getattr(model, key) is not None]
    if len(given) != 1:
        raise ValueError(f"give exactly one of {', '.join(keys)}; found {' and '.join(given) or 'none'}")
