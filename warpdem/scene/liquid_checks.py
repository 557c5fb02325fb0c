"""Liquid of a scene without a law for it, and what does not know liquid."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

from warpdem.core.key_path import KeyPath
from warpdem.scene import models
from warpdem.scene.base import Problem

if TYPE_CHECKING:
    from warpdem.scene.model import Scene


def _contents(scene: "Scene") -> Iterator[tuple[KeyPath, str, float]]:
    """Key path, group and liquid content of all that brings grains."""
    for i, (group, name) in enumerate(zip(scene.grains, scene.group_names, strict=False)):
        yield ("grains", i, "liquid_content"), name, group.liquid_content
    for i, stream in enumerate(scene.streams):
        for k, (portion, name) in enumerate(zip(stream.portions, scene.stream_groups(i), strict=True)):
            within = ("recipe", k) if stream.recipe is not None else ()
            yield ("streams", i, *within, "liquid_content"), name, portion.liquid_content


def liquid_problems(scene: "Scene") -> Iterator[Problem]:
    """Liquid that no law takes up, an integrator that no law of bridges knows, a group of two liquid contents."""
    law, integrator = scene.contact.liquid, scene.engine.integrator
    of_group: dict[str, float] = {}
    wet = [(key, content) for key, _, content in _contents(scene)]
    wet += [(("walls", i, "liquid_film"), wall.liquid_film) for i, wall in enumerate(scene.walls)]
    if law == "none":
        names = " or ".join(f'"{name}"' for name in models.model_names("liquid"))
        for key, amount in wet:
            if amount > 0.0:
                yield key, amount, f'contact.liquid = "none": choose contact.liquid = {names}, or leave it out'
        return
    for key, name, content in _contents(scene):
        if of_group.setdefault(name, content) != content:
            yield key, content, f'the group "{name}" has grains of liquid_content {of_group[name]:g}: give one, or another name'
    if len(models.model("integrator", integrator).STAGES) > 1:
        reason = f'contact.liquid = "{law}": liquid changes hands once per step: take a scheme of one stage, "exact_drift"'
        yield ("engine", "integrator"), integrator, reason
