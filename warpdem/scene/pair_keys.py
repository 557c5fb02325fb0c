"""Keys of ``[[pairs]]`` that contact laws declare."""

import functools
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from warpdem.kernels.contact import columns
from warpdem.kernels.contact.columns import PairKey
from warpdem.scene.models import model, model_names
from warpdem.scene.units import Quantity
from warpdem.scene.user_models import LAWS, check_pair_keys, imported, is_file, source_of

if TYPE_CHECKING:
    from warpdem.scene.contact import Contact, Pair


@functools.cache
def of_package() -> dict[str, tuple[PairKey, list[tuple[str, str]]]]:
    """Keys of ``[[pairs]]`` that laws of the package declare: what each is, and role and name of the laws that read it.

    Raises:
        TypeError: two laws declare the same key in two ways.
    """
    found: dict[str, tuple[PairKey, list[tuple[str, str]]]] = {}
    for role in LAWS:
        for name in model_names(role):
            for key, entry in columns.pair_keys(model(role, name)).items():
                known, laws = found.setdefault(key, (entry, []))
                if known != entry:
                    raise TypeError(f"PAIR[{key!r}] of {role}/{name}.py is not that of {'/'.join(laws[0])}.py")
                laws.append((role, name))
    return found


def of_file(file: str) -> dict[str, PairKey]:
    """Keys of ``[[pairs]]`` that a file of the user declares, whatever its role; none of a field or an observer.

    Args:
        file: absolute path of the file, which is imported.

    Raises:
        SceneError: the file cannot be read or imported, or its keys are wrong.
    """
    module = imported(file, source_of(file))
    check_pair_keys(file, module)
    keys: dict[str, PairKey] = columns.pair_keys(module)
    return keys


def read_by(contact: "Contact", pairs: Sequence["Pair"], located: Callable[[str], str]) -> dict[str, str]:
    """Unit of each key of ``[[pairs]]`` that the laws of a scene read.

    Args:
        contact: the laws.
        pairs: the coefficients. A file of the user may read a key of the package's laws without declaring it: it counts as
            read if a pair gives it.
        located: name of a law for ``models.model``.

    Raises:
        SceneError: a file of the user cannot be imported.
    """
    found = {"restitution": "-"}
    for role, key in (("tangential", "friction"), ("rolling", "rolling_friction")):
        if getattr(contact, role) != "none":
            found[key] = "-"
    for role in LAWS:
        name = getattr(contact, role)
        if name == "none":
            continue
        found |= {key: entry.unit for key, entry in columns.pair_keys(model(role, located(name))).items()}
        if is_file(name):
            for key, (entry, _) in of_package().items():
                if any(getattr(pair, key) != entry.default for pair in pairs):
                    found[key] = entry.unit
    return found


def quantity(entry: PairKey) -> Quantity:
    """What a key of ``[[pairs]]`` accepts."""
    return Quantity(entry.unit, gt=0) if entry.positive else Quantity(entry.unit, ge=0)
