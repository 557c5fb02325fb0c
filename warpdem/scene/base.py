"""Building blocks of all parts of a scene: their base class, annotated numbers, and validation errors that name a key."""

import math
import unicodedata
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError
from pydantic_core import InitErrorDetails, PydanticCustomError

from warpdem.core.file_names import unusable
from warpdem.core.key_path import KeyPath
from warpdem.scene.units import Quantity, Vector

Vec3 = tuple[float, float, float]


def unit_vector(vector: tuple[float, ...]) -> tuple[float, ...]:
    """Unit vector along ``vector``.

    Raises:
        ValueError: The vector is zero.
    """
    norm = math.hypot(*vector)
    if norm == 0.0:
        raise ValueError("must not be the zero vector")
    # a unit vector is returned as it is, so that a scene written to a file and read again keeps its bits
    return vector if abs(norm - 1.0) < 1e-15 else tuple(x / norm for x in vector)


LONGEST_NAME = 100
"""Maximum length of a name that becomes a part of file names [bytes]."""
LONGEST_LABEL = 200
"""Maximum length of any other name [bytes]."""


def _short_name(name: str) -> str:
    """Refuse a name that is too long to be part of a file name."""
    if (length := len(name.encode())) > LONGEST_NAME:
        raise ValueError(f"must be at most {LONGEST_NAME} bytes long, is {length}: results are named by it")
    return name


def _file_name(name: str) -> str:
    """Refuse a name that no file can have."""
    if reason := unusable(name):
        raise ValueError(reason)
    return name


def _label(name: str) -> str:
    """Refuse a name that messages and legends cannot show."""
    if any(unicodedata.category(c) in ("Cc", "Cs") for c in name) or len(name.encode(errors="replace")) > LONGEST_LABEL:
        raise ValueError(f"must be a name without control characters, at most {LONGEST_LABEL} bytes long")
    return name


Label = Annotated[str, AfterValidator(_label)]
Name = Annotated[str, Field(pattern=r"^[\w-]+$"), AfterValidator(_short_name)]
Point = Annotated[Vec3, Vector(Quantity("m"))]
Direction = Annotated[Vec3, Vector(Quantity("-")), AfterValidator(unit_vector)]
Length = Annotated[float, Quantity("m", gt=0)]
Duration = Annotated[float, Quantity("s", gt=0)]
AngularRate = Annotated[float, Quantity("rad/s")]
FileName = Annotated[
    str, BeforeValidator(lambda value: str(value) if isinstance(value, Path) else value), AfterValidator(_file_name)
]

# strict: neither true, nor 5000.5, nor "5000" is a count
Whole = Annotated[int, Field(strict=True, ge=0)]
LiquidContent = Annotated[float, Quantity("-", ge=0, le=1)]
LIQUID_CONTENT = Field(
    0.0,
    description="Liquid on each grain: its volume over that of the grain [-], >= 0 and <= 1, default 0; needs contact.liquid. "
    "Its mass is left out.",
)
GROUP_NAME = Field(
    None,
    min_length=1,
    description="Name of the grains' group in results; entries of the same name form one group; default: a group of its own.",
)

Problem = tuple[KeyPath, Any, str]
"""Key path, value there, and what is wrong."""


class SceneModel(BaseModel):
    """Base of all parts of a scene: unknown keys are refused, values do not change."""

    model_config = ConfigDict(extra="forbid", frozen=True, arbitrary_types_allowed=True)


def validation_error(problems: Iterable[Problem]) -> ValidationError:
    """Error with the key path of each problem, so that a message can name the key."""
    return ValidationError.from_exception_data("Scene", _details(problems))


def _details(problems: Iterable[Problem]) -> list[InitErrorDetails]:
    return [
        InitErrorDetails(type=PydanticCustomError("scene", "{reason}", {"reason": text}), loc=loc, input=value)
        for loc, value, text in problems
    ]


def file_system_name(name: str) -> str:
    """Form in which two names are equal if a file system may take them for one: they differ in case or Unicode composition."""
    return unicodedata.normalize("NFC", name).casefold()


def require_unique(values: list[str]) -> list[str]:
    """Refuse a list with an entry given twice."""
    if len(set(values)) < len(values):
        raise ValueError("each at most once")
    return values


def relocated(
    error: ValidationError, new_key_path: Callable[[KeyPath], KeyPath], more: Iterable[Problem] = ()
) -> ValidationError:
    """The same problems at other key paths, and the problems ``more``."""
    errors = []
    for detail in error.errors(include_url=False):
        error_type: str | PydanticCustomError = detail["type"]
        if error_type == "scene":
            error_type = PydanticCustomError("scene", "{reason}", detail["ctx"])
        errors.append(
            InitErrorDetails(
                type=error_type, loc=new_key_path(detail["loc"]), input=detail["input"], ctx=detail.get("ctx", {})
            )
        )
    errors += _details(more)
    return ValidationError.from_exception_data("Scene", errors)


def exactly_one(model: SceneModel, *keys: str) -> None:
    """Require that exactly one of these keys is given."""
    given = [key for key in keys if getattr(model, key) is not None]
    if len(given) != 1:
        raise ValueError(f"give exactly one of {', '.join(keys)}; found {' and '.join(given) or 'none'}")
