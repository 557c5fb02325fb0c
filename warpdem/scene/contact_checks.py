"""Consistency of contact laws, materials and contact coefficients of a scene."""

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from warpdem.errors import SceneError
from warpdem.kernels.contact import columns
from warpdem.scene import models, pair_keys
from warpdem.scene.base import Problem
from warpdem.scene.checks import quoted
from warpdem.scene.contact import Contact, Material, Pair
from warpdem.scene.model_names import user_model
from warpdem.scene.user_models import is_file


def pair_problems(
    pairs: Sequence[Pair], materials: Mapping[str, Material], of_grains: Iterable[str], of_walls: Iterable[str]
) -> Iterator[Problem]:
    """Coefficients given twice, and missing ones of materials that can be in contact (grain-grain, grain-wall).

    Args:
        pairs: The scene's pairs.
        materials: The scene's materials by name.
        of_grains: Materials of all groups of grains and streams.
        of_walls: Materials of all walls.
    """
    given: dict[tuple[str, ...], int] = {}
    for i, pair in enumerate(pairs):
        key = tuple(sorted(pair.materials))
        if key in given:
            yield ("pairs", i, "materials"), pair.materials, f"pairs[{given[key]}] is this pair too: give it once"
        given.setdefault(key, i)

    # in the order of the scene, without repeats; unknown names have been reported already
    grains = [name for name in dict.fromkeys(of_grains) if name in materials]
    walls = [name for name in dict.fromkeys(of_walls) if name in materials]
    meeting = [*itertools.combinations_with_replacement(grains, 2), *itertools.product(grains, walls)]
    missing = dict.fromkeys(key for a, b in meeting if (key := tuple(sorted((a, b)))) not in given)
    if missing:
        listed = "; ".join(f"materials = [{quoted(key)}]" for key in missing)
        yield ("pairs",), None, f"no coefficients for materials that can be in contact: add [[pairs]] with {listed}"


def _choices(role: str) -> str:
    """The laws of a role, as a scene may name them."""
    return f"a {role} law, contact.{role} = " + " or ".join(f'"{name}"' for name in models.model_names(role))


def law_problems(contact: Contact, pairs: Sequence[Pair]) -> Iterator[Problem]:
    """Coefficients without a law to use them, and laws without their coefficients."""
    for i, pair in enumerate(pairs):
        if not pair.contact:
            continue

        def problem(key: str, text: str, i: int = i, pair: Pair = pair) -> Problem:
            return ("pairs", i, key), getattr(pair, key), text

        for key, (entry, laws) in pair_keys.of_package().items():
            if any(is_file(getattr(contact, role)) for role, _ in laws):
                continue  # a law of the user may read any key
            role, name = next(((r, n) for r, n in laws if getattr(contact, r) == n), laws[0])
            reads, least = getattr(contact, role) == name, "> 0" if entry.positive else ">= 0"
            if reads and getattr(pair, key) is None:
                noun = f"a{'n' * (key[0] in 'aeiou')} {key.replace('_', ' ')}"
                yield problem(key, f'missing; contact.{role} = "{name}" needs {noun} [{entry.unit}], {least}')
            elif not reads and getattr(pair, key) != entry.default:
                names = " or ".join(f'"{n}"' for _, n in laws)
                yield problem(key, f'only for contact.{role} = {names}; it is "{getattr(contact, role)}"')
        for role in ("normal", "liquid"):
            name = getattr(contact, role)
            law = None if is_file(name) or name == "none" else models.model(role, name)
            for key, text in getattr(law, "problems", lambda _: {})(pair).items():
                yield problem(key, text)
        if contact.tangential == "none" and pair.friction > 0:
            yield problem("friction", f'contact.tangential = "none": set friction = 0 or choose {_choices("tangential")}')
        if contact.rolling == "none" and pair.rolling_friction > 0:
            reason = f'contact.rolling = "none": set rolling_friction = 0 or choose {_choices("rolling")}'
            yield problem("rolling_friction", reason)


def own_law_problems(
    contact: Contact, pairs: Sequence[Pair], materials: Mapping[str, Material], known: Mapping[str, Any]
) -> Iterator[Problem]:
    """Files of the user that are no contact law, or that fail for the scene's coefficients. ``known``: its base and access."""
    for role in ("normal", "tangential", "rolling", "twisting", "liquid"):
        name = getattr(contact, role)
        if not is_file(name):
            continue
        try:
            module = user_model(role, name, known)
        except SceneError as error:
            yield ("contact", role), name, str(error)
            continue
        for i, pair in enumerate(pairs if role == "normal" else []):
            if not (pair.contact and set(pair.materials) <= materials.keys()):  # unknown names are reported already
                continue
            try:
                numbers = np.array(module.coefficients(*(materials[m] for m in pair.materials), pair), dtype=float)
            except Exception as error:  # any error of the user's function
                yield ("pairs", i), None, f"coefficients of {name} fails for this pair: {type(error).__name__}: {error}"
                continue
            own = columns.own_coefficients(module).names
            if numbers.shape != (len(columns.OF_NORMAL_LAW) + len(own),) or not np.isfinite(numbers).all():
                wanted = f"four finite numbers and {', '.join(own)}" if own else "four finite numbers"
                reason = f"coefficients of {name} gives {numbers.tolist()}; {wanted} are needed"
                yield ("pairs", i), None, reason
