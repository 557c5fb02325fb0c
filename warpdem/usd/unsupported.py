"""Physics of a stage that a scene does not take over: refused or noted with its path, by the rules of `warpdem.usd.schemas`."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from warpdem.errors import SceneError
from warpdem.usd.schemas import Prim, Rule, rule_of

MAX_LISTED = 4
"""Paths that a note lists; it counts the others."""


def listed(names: Sequence[str]) -> str:
    """The first names, and the number of the others."""
    more = f" and {len(names) - MAX_LISTED} more" if len(names) > MAX_LISTED else ""
    return ", ".join(names[:MAX_LISTED]) + more


def notes(file: Path, prims: Sequence[dict[str, Any]]) -> list[str]:
    """Notes on prims with physics; equal notes are joined.

    Args:
        file: The stage, for messages.
        prims: Fields of `warpdem.usd.schemas.Prim`, without its ``grains``.

    Raises:
        SceneError: The flow would differ from that of the stage; the message names every cause.
    """
    grains = tuple(prim["path"] for prim in prims if prim.get("kind") == "SpherePointsShape")
    refused: list[str] = []
    noted: dict[tuple[str, ...], list[str]] = {}  # paths by the names of schemas and attributes and the reason
    for fields in prims:
        lists = {"schemas": tuple(fields["schemas"]), "sampled": tuple(fields.get("sampled", ()))}
        prim = Prim(**{**fields, **lists}, grains=grains)
        by_reason: dict[str, list[str]] = {}
        for name, rule in _rules_of(prim):
            if rule.verdict == "refused":
                refused.append(f"{prim.path}: {_with_value(name, prim)}: {rule.why}")
            elif rule.verdict == "taken" and name in prim.sampled:
                refused.append(f"{prim.path}: {name} changes with time: a scene has one value of it; remove the time samples")
            elif rule.verdict == "noted":
                by_reason.setdefault(rule.why, []).append(name)
        for why, names in by_reason.items():
            noted.setdefault((", ".join(sorted(names)), why), []).append(prim.path)
    if refused:
        head = f"{file}: " if len(refused) == 1 else f"{file}: {len(refused)} problems\n  "
        raise SceneError(head + "\n  ".join(refused))
    return [f"{listed(paths)}: {names}: {why}" for (names, why), paths in noted.items()]


def _rules_of(prim: Prim) -> Iterator[tuple[str, Rule]]:
    """The names of a prim and the rules that apply to them."""
    names = dict.fromkeys(name for name in (prim.type, *prim.schemas, *prim.values) if name)
    yield from ((name, rule_of(name, prim)) for name in names)


def _with_value(name: str, prim: Prim) -> str:
    if name in prim.sampled:
        return f"{name} (changes with time)"
    return f"{name} = {prim.values[name]}" if name in prim.values else name
