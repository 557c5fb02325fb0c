"""What of a stage's physics is not taken into a scene: refused or noted with its path, as `warpdem.usd.schemas` says."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from warpdem.errors import SceneError
from warpdem.usd.schemas import Prim, Rule, rule_of

MANY = 4
"""Paths that a note lists before it counts the others."""


def listed(names: Sequence[str]) -> str:
    """Some of the names, and how many there are besides."""
    more = f" and {len(names) - MANY} more" if len(names) > MANY else ""
    return ", ".join(names[:MANY]) + more


def notes(file: Path, prims: Sequence[dict[str, Any]]) -> list[str]:
    """What is noted about prims that say something about physics, those alike in one note.

    Args:
        file: The stage, for messages.
        prims: Fields of `warpdem.usd.schemas.Prim`, without its ``grains``.

    Raises:
        SceneError: Something would give another flow than the stage asks for; the message names all of it.
    """
    grains = tuple(prim["path"] for prim in prims if prim.get("kind") == "SpherePointsShape")
    refused: list[str] = []
    noted: dict[tuple[str, ...], list[str]] = {}  # paths by the names at them and what is said about these
    for said in prims:
        prim = Prim(**{**said, "schemas": tuple(said["schemas"]), "sampled": tuple(said.get("sampled", ()))}, grains=grains)
        told: dict[str, list[str]] = {}
        for name, rule in _answers(prim):
            if rule.verdict == "refused":
                refused.append(f"{prim.path}: {_with_value(name, prim)}: {rule.why}")
            elif rule.verdict == "taken" and name in prim.sampled:
                refused.append(f"{prim.path}: {name} changes with time: a scene has one value of it; take the time samples out")
            elif rule.verdict == "noted":
                told.setdefault(rule.why, []).append(name)
        for why, names in told.items():
            noted.setdefault((", ".join(sorted(names)), why), []).append(prim.path)
    if refused:
        head = f"{file}: " if len(refused) == 1 else f"{file}: {len(refused)} problems\n  "
        raise SceneError(head + "\n  ".join(refused))
    return [f"{listed(paths)}: {names}: {why}" for (names, why), paths in noted.items()]


def _answers(prim: Prim) -> Iterator[tuple[str, Rule]]:
    """The names of a prim and the rules that answer for them."""
    names = dict.fromkeys(name for name in (prim.type, *prim.schemas, *prim.values) if name)
    yield from ((name, rule_of(name, prim)) for name in names)


def _with_value(name: str, prim: Prim) -> str:
    if name in prim.sampled:
        return f"{name} (changes with time)"
    return f"{name} = {prim.values[name]}" if name in prim.values else name
