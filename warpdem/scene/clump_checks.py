"""What clumps need of the other parts of a scene, and what does not know them."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from warpdem.scene.base import Problem

if TYPE_CHECKING:
    from warpdem.scene.model import Scene


def clump_problems(scene: "Scene") -> Iterator[Problem]:
    """Names of clumps that the scene does not have, and parts of a scene that cannot be together with clumps."""
    known = ", ".join(f'"{name}"' for name in scene.clumps) or "none"
    for i, group in enumerate(scene.grains):
        if group.clump is not None and group.clump not in scene.clumps:
            yield ("grains", i, "clump"), group.clump, f"no such clump; the scene has {known}"
    for i, stream in enumerate(scene.streams):
        for k, portion in enumerate(stream.portions):
            path = ("recipe", k) if stream.recipe is not None else ()
            if portion.clump is not None and portion.clump not in scene.clumps:
                yield ("streams", i, *path, "clump"), portion.clump, f"no such clump; the scene has {known}"
    if not scene.clumps:
        return
    yield from _unknown_to_clumps(scene)


def _unknown_to_clumps(scene: "Scene") -> Iterator[Problem]:
    engine, contact = scene.engine, scene.contact
    refused: list[tuple[tuple[str, ...], Any, bool, str]] = [
        (
            ("engine", "integrator"), engine.integrator, engine.integrator != "exact_drift",
            'only "exact_drift" moves clumps: leave the key out',
        ),
        (
            ("engine", "precision"), engine.precision, engine.precision != "double",
            'clumps are computed in "double" precision only: leave the key out',
        ),
        (("measures", "wear"), None, scene.measures.wear is not None, "clumps wear no walls yet: leave it out"),
        (
            ("contact", "rolling"), contact.rolling, contact.rolling != "none",
            'rolling resistance stands for a shape, which clumps have: with clumps it is "none"',
        ),
    ]  # fmt: skip
    yield from ((key, value, reason) for key, value, there, reason in refused if there)
