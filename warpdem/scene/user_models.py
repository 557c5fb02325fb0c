"""Models in files of the user: imported, checked for what their role needs, and blamed by line where they fail."""

import functools
import hashlib
import importlib
import importlib.util
import re
import sys
import traceback
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

from warpdem.errors import SceneError
from warpdem.kernels.contact import columns
from warpdem.kernels.contact.liquid import COUNT
from warpdem.kernels.field import NUMBERS
from warpdem.kernels.wall import record
from warpdem.scene.parse_units import DIMENSIONS

REQUIRED = {
    "normal": ("coefficients", "build", "energy"),
    "tangential": ("build",),
    "rolling": ("HISTORY", "build"),
    "twisting": ("build", "energy"),
    "liquid": ("FORMED", "BRIDGE", "rupture", "force", "energy", "build"),
    "field": ("PARAMETERS", "build"),
    "observer": ("UNIT", "PARAMETERS", "build"),
    "integrator": ("ORDER", "STAGES", "RELATIVE", "STORE", "build"),
}
"""Roles, and what each file of a role defines."""
LAWS = ("normal", "tangential", "rolling", "twisting", "liquid")
"""Roles of the contact law."""
CODE_PLACE = re.compile(r'Error while parsing function ".*?" at (.+?):(\d+):\n(.*?)\n;', re.DOTALL)
"""Where Warp failed to translate a function, outermost first: file, line and the code there."""


WITH = " + "
"""Between the parts of the name of a normal law with bridges: normal law, law of the bridges, "viscous" where they damp."""


def parts_of(normal: str) -> list[str]:
    """Names of the models that a normal law is made of: itself, or the normal law and the law of the bridges."""
    return normal.split(WITH)[:2]


def is_file(name: str) -> bool:
    """Whether a model's name is a file of the user."""
    return name.endswith(".py")


def digest(name: str) -> str:
    """Fingerprint of a user's file."""
    return hashlib.sha256(source_of(name)).hexdigest()


def source_of(file: str) -> bytes:
    """Contents of a user's file.

    Raises:
        SceneError: it cannot be read.
    """
    try:
        return Path(file).read_bytes()
    except OSError as error:
        raise SceneError(f"{file}: cannot be read ({error.strerror})") from None


def _article(role: str) -> str:
    return f"an {role}" if role[0] in "aeiou" else f"a {role}"


def user_model(role: str, file: str) -> ModuleType:
    """The model of ``role`` in a file of the user, by its absolute path.

    Raises:
        SceneError: the file cannot be read, it fails while it is imported, or it lacks what its role needs.
    """
    module = imported(file, source_of(file))
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
def imported(file: str, source: bytes) -> ModuleType:
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
    """While these models are compiled or called: what fails in a file of the user is reported with its place.

    Args:
        names: models as ``model`` takes them.
        failure: what it means that they fail, for messages.

    Raises:
        SceneError: a file of the user fails.
    """
    files = [name for name in dict.fromkeys(part for name in names for part in parts_of(name)) if is_file(name)]
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
            "radius", "inertia", "grain", columns.LOAD, columns.TWIST}  # fmt: skip
"""Names that a law cannot give numbers of its own."""


def _check_law(file: str, role: str, module: ModuleType) -> None:
    """Refuse numbers and keys of a contact law that nothing could be laid out or checked by."""
    for name in ("COEFFICIENTS", "HISTORY") if role == "normal" else ():
        declared = getattr(module, name, {})
        if not isinstance(declared, Mapping) or not all(isinstance(text, str) for entry in declared.items() for text in entry):
            raise SceneError(f"{file}: {name} = {declared!r}: must be a dict: name -> unit")
        of_bridges = {key for key in declared if key == COUNT or key.startswith(f"{COUNT}_")}
        if taken := RESERVED & declared.keys() | of_bridges:
            raise SceneError(f"{file}: {name}: the name {min(taken)!r} is taken")
    _check_losses(file, getattr(module, "LOSSES", ()), columns.declares_own(module))
    check_pair_keys(file, module)


def _check_losses(file: str, losses: Any, own: bool) -> None:
    """Refuse losses that are no columns of the energy budget."""
    known = ", ".join(f'"{name}"' for name in columns.LOSSES)
    if not isinstance(losses, tuple) or not set(losses) <= set(columns.LOSSES) or len(set(losses)) < len(losses):
        raise SceneError(f"{file}: LOSSES = {losses!r}: must be a tuple of some of {known}, each once")
    if losses and not own:
        raise SceneError(f"{file}: LOSSES = {losses!r}: a law that has losses declares COEFFICIENTS or HISTORY too")


def check_pair_keys(file: str, module: ModuleType) -> None:
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
