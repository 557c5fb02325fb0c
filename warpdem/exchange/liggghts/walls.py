"""Walls of a script: meshes and primitives that a fix wall/gran names."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from warpdem.errors import SceneError
from warpdem.exchange.liggghts.contact import material_name
from warpdem.exchange.liggghts.deck import Deck, Fix, numbers
from warpdem.exchange.liggghts.motion import motions
from warpdem.mesh.triangle_mesh import load_mesh

AXES = "xyz"


class Placement:
    """Where a mesh is put: x -> scale R x + shift, as fix mesh/surface moves, turns and scales it, one after the other.

    Args:
        fix: the words of the mesh, in their order.
    """

    def __init__(self, fix: Fix) -> None:
        self.scale, self.shift, self._turn = 1.0, np.zeros(3), np.eye(4)
        words, at = fix.words, 0
        while at < len(words):
            if words[at] == "scale":
                factor = numbers(words[at + 1 : at + 2], fix.command)[0]
                self.scale, self.shift = self.scale * factor, self.shift * factor
            elif words[at] == "move":
                self.shift = self.shift + numbers(words[at + 1 : at + 4], fix.command)
            elif words[at] == "rotate":
                axis, angle = numbers(words[at + 2 : at + 5], fix.command), numbers(words[at + 6 : at + 7], fix.command)
                step = _transformations().rotation_matrix(math.radians(angle[0]), axis)
                self._turn, self.shift = step @ self._turn, step[:3, :3] @ self.shift
            at += 1

    def table(self) -> dict[str, Any]:
        """Keys of a wall or a face; what is as in the file is left out."""
        out: dict[str, Any] = {} if self.scale == 1.0 else {"scale": self.scale}
        if not np.allclose(self._turn, np.eye(4), atol=1e-12):
            angle, axis, _ = _transformations().rotation_from_matrix(self._turn)
            out["rotate"] = {"axis": [float(x) for x in axis], "angle": float(angle)}
        if np.abs(self.shift).max() > 0.0:
            out["translate"] = [float(x) for x in self.shift]
        return out


def _transformations() -> Any:
    """Matrices of rotations and back; without types, and slow to import."""
    from trimesh import transformations

    return transformations


def mesh_file(fix: Fix, deck: Deck, path_of: Callable[[str], str]) -> str:
    """Path of the file of a mesh as the scene names it.

    Raises:
        SceneError: the fix names none.
    """
    name = fix.after("file")
    if name is None:
        raise SceneError(f"{fix.command.place}: this mesh is not of a file; only those are converted")
    return path_of(name[0])


def meshes(deck: Deck) -> dict[str, Fix]:
    """Meshes of surfaces by their names."""
    return {fix.name: fix for fix in deck.of_style("mesh/surface")}


def wall_tables(deck: Deck, path_of: Callable[[str], str]) -> list[dict[str, Any]]:
    """The walls.

    Args:
        deck: the script.
        path_of: path of a file as the scene names it, from the one that the script names.
    """
    surfaces, moves = meshes(deck), motions(deck)
    out: list[dict[str, Any]] = []
    for fix in deck.of_style("wall/gran"):
        if fix.start > 0.0:
            deck.notes.append(f"{fix.command}: begins at {fix.start:g} s; here the wall is there from the start")
        if fix.until is not None and fix.until < deck.end:
            words = "here it stays: end the run there and let a phase go on without it"
            deck.notes.append(f"{fix.command}: is taken off at {fix.until:g} s; {words}")
        if "primitive" in fix.words:
            out.append(_primitive(fix, deck))
            continue
        count = fix.numbers("n_meshes")
        if count is None:
            deck.notes.append(f"{fix.command}: neither a primitive nor a mesh; not converted")
            continue
        for name in fix.after("meshes", int(count[0])) or ():
            if name not in surfaces:
                raise SceneError(f"{fix.command.place}: there is no mesh {name!r}; there are {', '.join(surfaces) or 'none'}")
            out.append(_mesh(surfaces[name], deck, path_of, moves.pop(name, None)))
    deck.notes += [f"the motion of mesh {name}, which is no wall, is not converted" for name in moves]
    return out


def _mesh(fix: Fix, deck: Deck, path_of: Callable[[str], str], motion: Any) -> dict[str, Any]:
    """A wall of a mesh; open, if its surface is not closed."""
    placement, file = Placement(fix), mesh_file(fix, deck, path_of)
    kind = fix.numbers("type")
    wall: dict[str, Any] = {"name": fix.name, "material": material_name(kind[0] if kind else 1), "mesh": file}
    wall |= placement.table()
    source = deck.path.parent / (fix.after("file") or ("",))[0]
    if source.is_file() and not load_mesh(source, placement.scale, key=f"walls[].mesh of {fix.name}").is_closed:
        wall["open"] = True
    if motion is not None:
        wall["motion"] = motion
    if (velocity := fix.numbers("surface_vel", 3)) is not None:
        wall["surface_velocity"] = velocity
    if "surface_ang_vel" in fix.words:
        deck.notes.append(f"{fix.command}: surface_ang_vel: not converted; surface_velocity has a speed around an axis")
    if "servo" in fix.style:
        wall |= _servo(fix, deck)
    if "6dof" in fix.style:
        deck.notes.append(f"{fix.command}: a free body: give the wall 'free' with its mass and inertia")
    if "wear" in fix.words:
        deck.notes.append(f"{fix.command}: wear: [measures.wear] has it, with a pressure in place of k_finnie")
    return wall


def _servo(fix: Fix, deck: Deck) -> dict[str, Any]:
    """A wall that a controller moves; the gains of the controller are not needed here."""
    what, axis, target = fix.after("ctrlPV"), fix.numbers("axis", 3), fix.numbers("target_val")
    speed = fix.numbers("vel_max")
    if what is None or axis is None or target is None or what[0] != "force" or speed is None:
        deck.notes.append(f"{fix.command}: this controller is not converted; give the wall a 'servo'")
        return {}
    sign = 1.0 if target[0] >= 0.0 else -1.0
    deck.notes.append(f"{fix.command}: a servo that pushes the grains along target_val x axis; its gains are not needed")
    return {"servo": {"axis": [sign * x for x in axis], "force": abs(target[0]), "max_speed": speed[0]}}


def _primitive(fix: Fix, deck: Deck) -> dict[str, Any]:
    """A plane or a cylinder; the grains are on the side where the domain is."""
    kind, words = fix.numbers("type"), fix.words[fix.words.index("primitive") + 1 :]
    words = words[2:] if words[:1] == ("type",) else words
    wall: dict[str, Any] = {"name": fix.name, "material": material_name(kind[0] if kind else 1)}
    shape, values = words[0], words[1:]
    axis = AXES.find(shape[:1])
    middle = _middle(deck)
    if axis >= 0 and shape[1:] == "plane":
        at = numbers(values[:1], fix.command)[0]
        side = 1.0 if middle[axis] >= at else -1.0
        return wall | {"plane": {"point": _along(axis, at), "normal": _along(axis, side)}}
    if axis >= 0 and shape[1:] == "cylinder":
        radius, first, second = numbers(values[:3], fix.command)
        point = np.insert([first, second], axis, 0.0)
        across = np.delete(np.array(middle) - point, axis)
        inside = bool(np.linalg.norm(across) <= radius)
        shape_table = {"point": point.tolist(), "axis": _along(axis, 1.0), "radius": radius}
        return wall | {"cylinder": shape_table | ({} if inside else {"inside": False})}
    raise SceneError(f"{fix.command.place}: the primitive {shape!r} is not converted; planes and cylinders along an axis are")


def _along(axis: int, value: float) -> list[float]:
    return [value if k == axis else 0.0 for k in range(3)]


def _middle(deck: Deck) -> Sequence[float]:
    """Middle of the domain [m]."""
    words = deck.regions.get(deck.domain or "", ())
    try:
        low_high = [float(word) for word in words[1:7]]
    except ValueError:
        low_high = []
    if len(low_high) < 6:
        return (0.0, 0.0, 0.0)
    return tuple(0.5 * (low_high[2 * k] + low_high[2 * k + 1]) for k in range(3))
