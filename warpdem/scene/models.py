"""Models found by name: the files of ``kernels/<role>/``, and files of the user (``user_models``)."""

import functools
import importlib
import importlib.util
import pkgutil
from pathlib import Path
from types import ModuleType

import warpdem.kernels as kernels
from warpdem.core.nearest import nearest
from warpdem.errors import SceneError
from warpdem.kernels.contact.liquid import joined
from warpdem.scene.user_models import WITH, is_file, user_model


def with_liquid(normal: str, liquid: str, viscous: bool) -> str:
    """Name of a normal law with liquid bridges, as ``model`` takes it (``kernels.contact.liquid.joined``)."""
    return WITH.join([normal, liquid, *["viscous"] * viscous])


@functools.cache
def model_names(role: str) -> tuple[str, ...]:
    """Names of the models of a role: the files of ``kernels/<role>/``."""
    package = importlib.import_module(f"{kernels.__name__}.{role}")
    return tuple(sorted(m.name for m in pkgutil.iter_modules(package.__path__)))


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


def model(role: str, name: str) -> ModuleType:
    """The module of one model.

    Args:
        role: one of ``user_models.REQUIRED``.
        name: a file of ``kernels/<role>/`` without its suffix, or the absolute path of a file of the user; of a normal law also
            one ``with_liquid``.

    Raises:
        SceneError: there is no such file, it fails while it is imported, or it lacks what its role needs.
    """
    if WITH in name:
        normal, liquid, *viscous = name.split(WITH)
        of_both: ModuleType = joined(model("normal", normal), model("liquid", liquid), bool(viscous))
        return of_both
    if is_file(name):
        return user_model(role, name)
    if name not in model_names(role):
        raise SceneError(f'{role} model "{name}": {allowed(role)}{nearest(name, model_names(role))}')
    return importlib.import_module(f"{kernels.__name__}.{role}.{name}")
