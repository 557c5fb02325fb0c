"""Materials, contact laws and contact coefficients as scene data."""

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    ModelWrapValidatorHandler,
    SerializerFunctionWrapHandler,
    StrictBool,
    create_model,
    model_serializer,
    model_validator,
)

from warpdem.errors import SceneError
from warpdem.kernels.contact import columns
from warpdem.kernels.contact.columns import PairKey
from warpdem.scene import models, pair_keys
from warpdem.scene.base import FileName, Problem, SceneModel, validation_error
from warpdem.scene.messages import unknown_key
from warpdem.scene.model_names import ModelName, user_model
from warpdem.scene.units import Quantity
from warpdem.scene.user_models import LAWS, is_file


class Material(SceneModel):
    """What grains or walls are made of."""

    density: Annotated[float, Quantity("kg/m3", gt=0)] = Field(description="Density [kg/m3], > 0.")
    young_modulus: Annotated[float, Quantity("Pa", gt=0)] = Field(description="Young's modulus [Pa], > 0.")
    poisson_ratio: Annotated[float, Quantity("-", gt=-1, le=0.5)] = Field(
        description="Poisson's ratio [-], > -1 and <= 0.5."
    )


class Contact(SceneModel):
    """Contact laws, the same for all contacts of grains with grains and walls."""

    normal: Annotated[FileName, ModelName("normal")] = Field(
        models.default("normal"), description=models.choices("normal", models.default("normal"))
    )
    tangential: Annotated[FileName, ModelName("tangential", ("none",))] = Field(
        models.default("tangential"), description=models.choices("tangential", models.default("tangential"), "none")
    )
    rolling: Annotated[FileName, ModelName("rolling", ("none",))] = Field(
        "none", description=models.choices("rolling", "none", "none")
    )
    twisting: Annotated[FileName, ModelName("twisting", ("none",))] = Field(
        "none", description=models.choices("twisting", "none", "none")
    )
    liquid: Annotated[FileName, ModelName("liquid", ("none",))] = Field(
        "none", description=models.choices("liquid", "none", "none")
    )
    torsion: StrictBool = Field(
        False, description="Whether the rolling law also resists spin about the normal, default false."
    )

    @model_validator(mode="after")
    def _twisting_has_one_law(self) -> "Contact":
        if self.torsion and self.rolling == "none":
            reason = "needs a rolling law: set contact.rolling = " + " or ".join(
                f'"{name}"' for name in models.model_names("rolling")
            )
            raise validation_error([(("torsion",), True, reason)])
        if self.twisting != "none" and self.tangential == "none":
            reason = "goes by stiffness and limit of friction: set contact.tangential = " + " or ".join(
                f'"{name}"' for name in models.model_names("tangential")
            )
            raise validation_error([(("twisting",), self.twisting, reason)])
        if self.twisting != "none" and self.torsion:
            reason = "the rolling law resists twisting already, by contact.torsion = true: give one of the two"
            raise validation_error([(("twisting",), self.twisting, reason)])
        return self


class Pair(SceneModel):
    """Contact coefficients of two materials (or of one with itself), given once, in either order."""

    # keys of a law of the user's are checked once that is known; in the schema see warpdem.scene.schema
    model_config = ConfigDict(
        extra="allow",
        json_schema_extra={
            "additionalProperties": False,
            "required": ["materials"],
            "anyOf": [
                {"required": ["restitution"]},
                {"required": ["contact"], "properties": {"contact": {"const": False}}, "maxProperties": 2},
            ],
        },
    )

    materials: Annotated[list[str], Field(min_length=2, max_length=2)] = Field(
        description="Names of the two materials, in any order."
    )
    contact: StrictBool = Field(
        True,
        description="Whether the two touch, default true; false: they pass through each other, and no other key is given.",
    )
    restitution: Annotated[float, Quantity("-", gt=0, le=1)] = Field(
        description="Coefficient of normal restitution [-], > 0 and <= 1."
    )
    friction: Annotated[float, Quantity("-", ge=0)] = Field(
        0.0, description="Coefficient of sliding friction [-], >= 0, default 0."
    )
    rolling_friction: Annotated[float, Quantity("-", ge=0)] = Field(
        0.0, description="Coefficient of rolling friction [-], >= 0, default 0."
    )

    @model_validator(mode="wrap")
    @classmethod
    def _nothing_of_no_contact(cls, given: Any, handler: ModelWrapValidatorHandler["Pair"]) -> "Pair":
        """Materials that do not touch have no coefficients; the field holds a restitution that nothing reads."""
        if not isinstance(given, Mapping) or given.get("contact") is not False:
            return handler(given)
        reason = "the two do not touch, contact = false: leave this out, or leave out contact"
        if problems := [((key,), value, reason) for key, value in given.items() if key not in ("materials", "contact")]:
            raise validation_error(problems)
        pair = handler({**given, "restitution": 1.0})
        pair.model_fields_set.discard("restitution")
        return pair

    @model_serializer(mode="wrap")
    def _only_what_was_given_of_no_contact(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """``contact`` where it is false, and no coefficients then."""
        whole: dict[str, Any] = handler(self)
        if self.contact:
            return {key: value for key, value in whole.items() if key != "contact"}
        return {key: value for key, value in whole.items() if key in ("materials", "contact")}

    @classmethod
    def with_keys(cls, keys: Mapping[str, PairKey]) -> "type[Pair]":
        """The same with the keys that contact laws declare."""
        fields: dict[str, Any] = {}
        for key, entry in keys.items():
            number = Annotated[float, pair_keys.quantity(entry)]
            fields[key] = (number if entry.default is not None else number | None, Field(entry.default, description=entry.text))
        return create_model("Pair", __base__=cls, __doc__=cls.__doc__, **fields)


if not TYPE_CHECKING:
    Pair = Pair.with_keys({key: entry for key, (entry, _) in pair_keys.of_package().items()})


def own_pair_keys(known: Mapping[str, Any]) -> dict[str, PairKey] | None:
    """Keys of ``[[pairs]]`` that laws of the user declare; None if one of them cannot be loaded."""
    if "contact" not in known:
        return None
    named = [(role, getattr(known["contact"], role)) for role in LAWS]
    found: dict[str, PairKey] = {}
    for role, name in named:
        try:
            found |= columns.pair_keys(user_model(role, name, known)) if is_file(name) else {}
        except SceneError:
            return None
    return found


def unknown_keys(given: object, known: Mapping[str, Any], root: type[BaseModel]) -> Iterator[Problem]:
    """Keys of ``[[pairs]]`` that neither a pair nor a law has; of entries that cannot be read otherwise.

    Args:
        given: The entries as the scene has them.
        known: As in ``with_own_keys``.
        root: Model of the whole scene, for messages.
    """
    own = own_pair_keys(known)
    if own is None or not isinstance(given, list):
        return
    for i, entry in enumerate(given):
        for key in entry if isinstance(entry, Mapping) else ():
            if key not in own and key not in Pair.model_fields:
                yield (i, key), entry[key], unknown_key(("pairs", i, key), root, list(own))


def with_own_keys(pairs: list[Pair], known: Mapping[str, Any], root: type[BaseModel]) -> list[Pair]:
    """Pairs with the keys that laws of the user declare, in SI units, defaults filled in.

    Args:
        pairs: Pairs as the scene has them.
        known: The scene's ``contact``, ``base`` and ``access``, as far as they are valid.
        root: Model of the whole scene, for messages.

    Raises:
        ValidationError: A key is unknown, missing, or has a wrong value.
    """
    own = own_pair_keys(known)
    if own is None:  # the error of the law is reported for the law
        return pairs
    checked: list[Pair] = []
    problems: list[Problem] = []
    for i, pair in enumerate(pairs):
        if not pair.contact:
            checked.append(pair)
            continue
        given: dict[str, Any] = pair.model_extra or {}
        values: dict[str, Any] = {}
        for key, value in given.items():
            if key not in own:
                text = unknown_key(("pairs", i, key), root, list(own))
                problems.append(((i, key), value, text))
                continue
            try:
                values[key] = pair_keys.quantity(own[key]).validate(value)
            except ValueError as error:
                problems.append(((i, key), value, str(error)))
        for key, entry in own.items():
            is_field = key in Pair.model_fields
            if entry.default is None and key not in given and not (is_field and getattr(pair, key) is not None):
                problems.append(((i, key), None, f"missing: {entry.text}"))
            elif key not in given and not is_field:
                values[key] = entry.default
        checked.append(pair.model_copy(update=values) if values else pair)
    if problems:
        raise validation_error(problems)
    return checked
