"""Models found by name: the files of ``kernels/<role>/``, and files of the user that define the same things."""

import functools
import hashlib
import importlib
import importlib.util
import pkgutil
import re
import sys
import traceback
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

import warpdem.kernels as kernels
from warpdem.core.nearest import nearest
from warpdem.errors import SceneError
from warpdem.kernels.contact import columns
from warpdem.kernels.contact.columns import PairKey
from warpdem.kernels.field import NUMBERS
from warpdem.kernels.wall import record
from warpdem.scene.units import DIMENSIONS, Quantity, Vector

REQUIRED = {
    "normal": ("coefficients", "build", "energy"),
    "tangential": ("build",),
    "rolling": ("HISTORY", "build"),
    "field": ("PARAMETERS", "build"),
    "observer": ("UNIT", "PARAMETERS", "build"),
    "integrator": ("ORDER", "STAGES", "RELATIVE", "STORE", "build"),
}
"""Roles, and what each file of a role defines."""
LAWS = ("normal", "tangential", "rolling")
"""Roles of the contact law."""
CODE_PLACE = re.compile(r'Error while parsing function ".*?" at (.+?):(\d+):\n(.*?)\n;', re.DOTALL)
"""Where Warp failed to translate a function, outermost first: file, line and the code there."""


@functools.cache
def model_names(role: str) -> tuple[str, ...]:
    """Names of the models of a role: the files of ``kernels/<role>/``."""
    package = importlib.import_module(f"{kernels.__name__}.{role}")
    return tuple(sorted(m.name for m in pkgutil.iter_modules(package.__path__)))


def is_file(name: str) -> bool:
    """Whether a model's name is a file of the user."""
    return name.endswith(".py")


def located(name: str, base: Path) -> str:
    """Name of a model as ``model`` takes it: a file of the user, relative to ``base``, becomes an absolute path."""
    return str((base / Path(name).expanduser()).resolve()) if is_file(name) else name


def allowed(role: str, *others: str) -> str:
    """What may stand where a model of ``role`` is named, in words."""
    known = [f'"{name}"' for name in (*model_names(role), *others)]
    return f"must be {' or '.join([', '.join(known[:-1]), *known[-1:]] if known[1:] else known)}, or a .py file of your own"


def default(role: str) -> str:
    """Name of the model of a role that a scene has if it names none."""
    name: str = importlib.import_module(f"{kernels.__name__}.{role}").DEFAULT
    return name


def choices(role: str, chosen: str, *others: str) -> str:
    """The models of a role, each with a few words on it, for the schema; ``chosen`` is the default, ``others`` no model."""
    known = {name: importlib.import_module(f"{kernels.__name__}.{role}.{name}").SUMMARY for name in model_names(role)}
    known = {**dict.fromkeys(others, ""), **known} if chosen in others else {**known, **dict.fromkeys(others, "")}
    words = {name: "; ".join(filter(None, [about, "default" * (name == chosen)])) for name, about in known.items()}
    listed = [f'"{name}"' + (f" ({about})" if about else "") for name, about in words.items()]
    return f"{role.capitalize()} law: {', '.join(listed)} or a .py file."


@functools.cache
def pair_keys() -> dict[str, tuple[PairKey, list[tuple[str, str]]]]:
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


def user_pair_keys(file: str) -> dict[str, PairKey]:
    """Keys of ``[[pairs]]`` that a file of the user declares, whatever its role; none of a field or an observer.

    Args:
        file: absolute path of the file, which is imported.

    Raises:
        SceneError: the file cannot be read or imported, or its keys are wrong.
    """
    module = _imported(file, _read(file))
    _check_pair_keys(file, module)
    keys: dict[str, PairKey] = columns.pair_keys(module)
    return keys


def quantity(entry: PairKey) -> Quantity:
    """What a key of ``[[pairs]]`` accepts."""
    return Quantity(entry.unit, gt=0) if entry.positive else Quantity(entry.unit, ge=0)


def model(role: str, name: str) -> ModuleType:
    """The module of one model.

    Args:
        role: one of ``REQUIRED``.
        name: a file of ``kernels/<role>/`` without its suffix, or the absolute path of a file of the user.

    Raises:
        SceneError: there is no such file, it fails while it is imported, or it lacks what its role needs.
    """
    if is_file(name):
        return _user_model(role, name)
    if name not in model_names(role):
        raise SceneError(f'{role} model "{name}": {allowed(role)}{nearest(name, model_names(role))}')
    return importlib.import_module(f"{kernels.__name__}.{role}.{name}")


def digest(name: str) -> str:
    """Fingerprint of a user's file."""
    return hashlib.sha256(_read(name)).hexdigest()


def field_values(
    module: ModuleType, given: Mapping[str, Any]
) -> tuple[dict[str, Any], list[tuple[tuple[str, ...], Any, str]]]:
    """Parameters of an external field or an observer in SI units, defaults filled in, in the order of its ``PARAMETERS``.

    Args:
        module: the field or observer.
        given: parameters as the scene has them: numbers, lists, strings with units.

    Returns:
        The values, and for each mistake its place in ``given``, the value there and what is wrong.
    """
    known = list(module.PARAMETERS)
    problems: list[tuple[tuple[str, ...], Any, str]] = [
        ((key,), value, "unknown parameter" + (nearest(key, known) or f"; known here: {', '.join(known) or 'none'}"))
        for key, value in given.items()
        if key not in known
    ]
    values: dict[str, Any] = {}
    for key, (unit, count, default) in module.PARAMETERS.items():
        value = given.get(key, default)
        quantity = Quantity(unit)
        if value is None:
            problems.append(((key,), None, f"missing: {count} number{'s' * (count > 1)} in [{unit}]"))
            continue
        try:
            if count == 1:
                values[key] = quantity.validate(value)
            else:
                values[key] = tuple(quantity.validate(entry) for entry in Vector(quantity, count).listed(value))
        except ValueError as error:
            problems.append(((key,), value, str(error)))
    return values, problems


def numbers(values: Mapping[str, Any]) -> np.ndarray:
    """The values of ``field_values`` one after the other, filled up with zeros, SI units, shape (NUMBERS,)."""
    row = np.zeros(NUMBERS)
    given = np.hstack([(), *values.values()])
    row[: len(given)] = given
    return row


# --- files of the user -----------------------------------------------------------------------------------------------


def _read(file: str) -> bytes:
    try:
        return Path(file).read_bytes()
    except OSError as error:
        raise SceneError(f"{file}: cannot be read ({error.strerror})") from None


def _article(role: str) -> str:
    return f"an {role}" if role[0] in "aeiou" else f"a {role}"


def _user_model(role: str, file: str) -> ModuleType:
    module = _imported(file, _read(file))
    missing = [name for name in REQUIRED[role] if not hasattr(module, name)]
    if missing:
        raise SceneError(
            f"{file}: {_article(role)} model defines {', '.join(REQUIRED[role])}; missing here: {', '.join(missing)}"
        )
    functions = [name for name in REQUIRED[role] if name.islower() and not callable(getattr(module, name))]
    if functions:
        raise SceneError(f"{file}: in {_article(role)} model {', '.join(functions)} must be a function")
    if "PARAMETERS" in REQUIRED[role]:
        _check_parameters(file, module.PARAMETERS)
    if role in LAWS:
        _check_law(file, role, module)
    if not isinstance(getattr(module, "UNIT", ""), str):
        raise SceneError(f"{file}: UNIT = {module.UNIT!r}: must be a text such as \"m/s\"")
    return module


@functools.cache
def _imported(file: str, source: bytes) -> ModuleType:
    """Import a file, once for each of its contents.

    The source is compiled here: the import system would take a cached byte code file for a source of equal size and age,
    and would write one beside the user's file.
    """
    name = f"warpdem_user_{Path(file).stem}_{hashlib.sha256(file.encode() + source).hexdigest()[:16]}"
    spec = importlib.util.spec_from_file_location(name, file)
    assert spec is not None  # a name that ends in .py has a loader
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # Warp asks there for the module of a function
    try:
        exec(compile(source, file, "exec"), vars(module))
    except Exception as error:
        del sys.modules[name]
        places = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == file]
        if isinstance(error, SyntaxError) and error.filename == file:
            places.append(error.lineno)
        line = f", line {places[-1]}" if places else ""
        raise SceneError(f"{file}{line}: {type(error).__name__}: {error}") from error
    return module


@contextmanager
def using(names: Sequence[str], failure: str = "Warp cannot compile it") -> Iterator[None]:
    """While these models are compiled or called: what fails in a file of the user is told with its place.

    Args:
        names: models as ``model`` takes them.
        failure: what it means that they fail, for messages.

    Raises:
        SceneError: a file of the user fails.
    """
    files = [name for name in dict.fromkeys(names) if is_file(name)]
    try:
        yield
    except SceneError:
        raise
    except Exception as error:
        if not files:
            raise
        # a KeyError's own text is quoted, with its line ends written out
        text = str(error.args[0] if error.args else error).strip()
        places = [(file, line, code.strip()) for file, line, code in CODE_PLACE.findall(text) if file in files]
        frames = [f for f in traceback.extract_tb(error.__traceback__) if f.filename in files]
        places = places or [(f.filename, f.lineno, f.line) for f in frames]
        reason = re.sub(r"\w+__locals__", "", text.split("\n;")[-1].strip())
        if not CODE_PLACE.search(text):
            reason = f"{type(error).__name__}: {reason}"
        if not places:
            raise SceneError(f"{', '.join(files)}: {failure}: {reason}") from error
        file, line, code = places[-1]
        raise SceneError(f"{file}, line {line}: {failure}: {code}: {reason}") from error


RESERVED = {*columns.OF_NORMAL_LAW, *columns.OF_PAIR, *columns.VECTORS, *record.GEOMETRY.names, *record.RESULT.names,
            "radius", "inertia", "grain", columns.LOAD}  # fmt: skip
"""Names that a law cannot give numbers of its own."""


def _check_law(file: str, role: str, module: ModuleType) -> None:
    """Refuse numbers and keys of a contact law that nothing could be laid out or checked by."""
    for name in ("COEFFICIENTS", "HISTORY") if role == "normal" else ():
        declared = getattr(module, name, {})
        if not isinstance(declared, Mapping) or not all(isinstance(text, str) for entry in declared.items() for text in entry):
            raise SceneError(f"{file}: {name} = {declared!r}: must be a dict: name -> unit")
        if taken := RESERVED & declared.keys():
            raise SceneError(f"{file}: {name}: the name {min(taken)!r} is taken")
    _check_pair_keys(file, module)


def _check_pair_keys(file: str, module: ModuleType) -> None:
    """Refuse keys of ``[[pairs]]`` that no value could be checked by."""
    if not isinstance(getattr(module, "PAIR", {}), Mapping):
        raise SceneError(f"{file}: PAIR must be a dict: key -> (unit, default, text)")
    for key, entry in getattr(module, "PAIR", {}).items():
        if not isinstance(entry, tuple) or len(entry) not in (3, 4):
            raise SceneError(f"{file}: PAIR[{key!r}] = {entry!r}: must be (unit, default, text), and True if 0 is refused")
        if entry[0] not in DIMENSIONS:
            raise SceneError(f"{file}: PAIR[{key!r}]: unit {entry[0]!r} is not known; known: {', '.join(DIMENSIONS)}")


def _check_parameters(file: str, parameters: Any) -> None:
    """Refuse ``PARAMETERS`` of a field that the scene could not be checked against."""
    if not isinstance(parameters, Mapping):
        raise SceneError(f"{file}: PARAMETERS must be a dict: name -> (unit, numbers, default)")
    total = 0
    for key, entry in parameters.items():
        if not isinstance(key, str) or not isinstance(entry, tuple) or len(entry) != 3:
            raise SceneError(f"{file}: PARAMETERS[{key!r}] = {entry!r}: must be (unit, numbers, default)")
        unit, count, default = entry
        if unit not in DIMENSIONS:
            raise SceneError(f"{file}: PARAMETERS[{key!r}]: unit {unit!r} is not known; known: {', '.join(DIMENSIONS)}")
        if count not in (1, 3):
            raise SceneError(f"{file}: PARAMETERS[{key!r}]: {count!r} numbers; allowed: 1 or 3")
        total += count
    if total > NUMBERS:
        raise SceneError(f"{file}: PARAMETERS hold {total} numbers; allowed: at most {NUMBERS}")
