"""Consistency of the parts of a scene: references by name, unique names and ids, streams, measures."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Protocol

import numpy as np

from warpdem.core.key_path import KeyPath
from warpdem.scene import models
from warpdem.scene.base import Problem, file_system_name
from warpdem.scene.borders import Borders
from warpdem.scene.grains import Grains
from warpdem.scene.measures import Measures
from warpdem.scene.regions import Outlet, Placed
from warpdem.scene.selection import selection_problems
from warpdem.scene.start import Start
from warpdem.scene.streams import Stream
from warpdem.scene.walls import Wall

SAMPLES = 1000
"""Points of a stream that show whether it inserts grains in an outlet [-]."""


class Named(Protocol):
    """A part of a scene with a name."""

    @property
    def name(self) -> str:
        """The name."""


def quoted(names: Iterable[str]) -> str:
    """Names in quotes, for messages."""
    return ", ".join(f'"{name}"' for name in names) or "none"


def material_problems(uses: Iterable[tuple[KeyPath, str]], materials: Iterable[str]) -> Iterator[Problem]:
    """Names of materials that the scene does not have.

    Args:
        uses: Key path of each use of a material, and the name there.
        materials: Names of the scene's materials.
    """
    known = list(materials)
    for key_path, name in uses:
        if name not in known:
            yield key_path, name, f"no such material; the scene has {quoted(known)}"


def source_problems(grains: Sequence[Grains], streams: Sequence[Stream], start: Start | None) -> Iterator[Problem]:
    """No grains at all, or grains beside a checkpoint that brings them."""
    if not grains and not streams and start is None:
        yield ("grains",), None, "missing: give at least one group of grains, a stream, or a start"
    if grains and start is not None:
        yield ("grains",), None, "cannot be given together with start, which provides the grains; streams may add others"


def name_problems(lists: Mapping[str, Sequence[Named]]) -> Iterator[Problem]:
    """Names given twice in one of the ``lists``, by key."""
    for key, parts in lists.items():
        names = [part.name for part in parts]
        for i, name in enumerate(names):
            if name in names[:i]:
                yield (key, i, "name"), name, f"{key}[{names.index(name)}] has this name too: names must differ"
            elif key in ("walls", "phases") and file_system_name(name) in map(file_system_name, names[:i]):
                other = list(map(file_system_name, names)).index(file_system_name(name))
                reason = f'{key}[{other}] is "{names[other]}": names must differ in more than case: files are named by them'
                yield (key, i, "name"), name, reason


def grain_problems(groups: Sequence[Grains], walls: Sequence[Wall]) -> Iterator[Problem]:
    """Walls to fill that are no mesh walls, and ids given twice."""
    names = [wall.name for wall in walls]
    meshes = [wall.name for wall in walls if wall.mesh is not None]
    first_group: dict[int, int] = {}
    for i, grains in enumerate(groups):
        wall = grains.fill.wall if grains.fill is not None else None
        if wall is not None and wall not in meshes:
            reason = "is an analytic shape; only a mesh can be filled" if wall in names else "no such wall"
            yield ("grains", i, "fill", "wall"), wall, f"{reason}; the scene's mesh walls: {quoted(meshes)}"
        for number in grains.ids.tolist() if grains.ids is not None else []:
            if number in first_group:
                yield ("grains", i, "ids"), number, f"grains[{first_group[number]}] has this id too: ids must be unique"
                break
            first_group[number] = i


def region_problems(regions: Iterable[tuple[KeyPath, Placed]], walls: Sequence[Wall]) -> Iterator[Problem]:
    """Regions that follow a wall which the scene does not have, or whose motion is not known beforehand."""
    names = [wall.name for wall in walls]
    by_load = [wall.name for wall in walls if wall.dynamic is not None]
    for key_path, region in regions:
        if region.follows is not None and region.follows not in names:
            yield (*key_path, "follows"), region.follows, f"no such wall; the scene has {quoted(names)}"
        if region.follows in by_load:
            reason = "has a servo or is free: its load moves it, and a region follows only a motion that is given"
            yield (*key_path, "follows"), region.follows, reason


def stream_problems(streams: Sequence[Stream], outlets: Sequence[Outlet], borders: Borders | None) -> Iterator[Problem]:
    """Streams whose grains would be removed where they are inserted, as far as this is seen without a mesh or a motion."""
    for i, stream in enumerate(streams):
        key = stream.shape_key
        for outlet in outlets:
            if (stream.fixed_to, stream.follows) == (outlet.fixed_to, outlet.follows) and _meet(stream, outlet):
                known = {"box": "box"}.get(outlet.shape_key, "region")
                yield ("streams", i, key), None, f'overlaps the {known} of the outlet "{outlet.name}", which removes grains'
        if stream.mesh is not None or stream.face is not None or borders is None:
            continue
        if stream.follows is not None or stream.fixed_to != borders.fixed_to:
            continue
        low, high = getattr(stream, key).bounds.tolist()
        for k, axis in enumerate("xyz"):
            border = getattr(borders, axis)
            if border is None:
                continue
            least, most = (("min", k), ("max", k)) if key == "box" else ((), ())
            if border.min is not None and low[k] < border.min:
                yield ("streams", i, key, *least), low[k], f"is below borders.{axis}.min = {border.min:g} m"
            if border.max is not None and high[k] > border.max:
                yield ("streams", i, key, *most), high[k], f"is above borders.{axis}.max = {border.max:g} m"


def _meet(stream: Stream, outlet: Outlet) -> bool:
    """Whether a stream inserts grains in an outlet that rests in the same axes; False where one of them is a mesh."""
    if stream.mesh is not None or stream.face is not None or outlet.mesh is not None:
        return False
    if stream.box is not None and outlet.box is not None:
        sides = zip(stream.box.min, stream.box.max, outlet.box.min, outlet.box.max, strict=True)
        return all(low < high_out and low_out < high for low, high, low_out, high_out in sides)
    radius = np.full(SAMPLES, 0.5 * stream.extremes[0])
    points = getattr(stream, stream.shape_key).random_points(np.random.default_rng(0), radius)
    return bool(getattr(outlet, outlet.shape_key).holds(points).any())


def measure_problems(
    measures: Measures, integrator: str, groups: list[str] | None, materials: list[str], exits: Sequence[str]
) -> Iterator[Problem]:
    """Measures that the integrator cannot make, names given twice, and groups, materials and outlets that are not there.

    Args:
        measures: of the scene.
        integrator: its name.
        groups: names of the scene's groups; None where they are not known yet.
        materials: names of its materials.
        exits: names of its outlets and of the borders through which grains leave.
    """
    for key in ("energy", "momentum"):
        if getattr(measures, key) and integrator != "exact_drift":
            yield ("measures", key), True, f'only with engine.integrator = "exact_drift"; it is "{integrator}"'
    if measures.wear is not None and integrator != "exact_drift":
        yield ("measures", "wear"), None, f'only with engine.integrator = "exact_drift"; it is "{integrator}"'
    stages = len(models.model("integrator", integrator).STAGES)
    if measures.flow and stages > 1:
        yield ("measures", "flow"), None, f'not with engine.integrator = "{integrator}", whose steps have stages'
    for i, one in enumerate(measures.residence):
        if one.outlet is not None and one.outlet not in exits:
            reason = f"grains do not leave there; they do through {', '.join(exits) or 'nothing: the scene has no outlet'}"
            yield ("measures", "residence", i, "outlet"), one.outlet, reason
    for key in ("flow", "regions", "profiles", "mixing", "residence"):
        names = [part.name for part in getattr(measures, key)]
        for i, name in enumerate(names):
            if name in names[:i]:
                reason = f"measures.{key}[{names.index(name)}] has this name too: names must differ"
                yield ("measures", key, i, "name"), name, reason
    yield from class_problems(measures, groups, materials)
    given = {region.name for region in measures.regions}
    for i, profile in enumerate(measures.profiles):
        for region in profile.regions:
            if region.name in given:
                reason = f'its slice "{region.name}" has the name of a region: names must differ'
                yield ("measures", "profiles", i, "name"), profile.name, reason
            given.add(region.name)


def class_problems(measures: Measures, groups: list[str] | None, materials: list[str]) -> Iterator[Problem]:
    """Groups and materials that measures select and that are not there; arguments as of ``measure_problems``."""
    for key, word in (("flow", "of"), ("regions", "of"), ("profiles", "of"), ("residence", "of"), ("mixing", "first")):
        for i, part in enumerate(getattr(measures, key)):
            yield from selection_problems(("measures", key, i, word), getattr(part, word), groups, materials)


def exits(borders: Borders | None, outlets: Sequence[Outlet]) -> list[str]:
    """Names of the borders through which grains leave, such as "x max", and of the outlets."""
    out = []
    for axis in "xyz":
        border = getattr(borders, axis) if borders else None
        if border is not None and border.kind != "periodic":
            kinds = border.kind if isinstance(border.kind, list) else [border.kind] * 2
            sides = zip(("min", "max"), (border.min, border.max), kinds, strict=True)
            out += [f"{axis} {side}" for side, place, kind in sides if place is not None and kind == "open"]
    return [*out, *(outlet.name for outlet in outlets)]
