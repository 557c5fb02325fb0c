"""Borders of the domain and outlets as the engine takes them: where grains come round, leave, or stop the run."""

import itertools
import math

import numpy as np

from warpdem.core.key_path import key_text
from warpdem.errors import SceneError
from warpdem.filling.initial_grains import InitialGrains
from warpdem.filling.packing_neighbors import worst_overlaps
from warpdem.kernels.step.region import BOX, CYLINDER, MESH, SPHERE
from warpdem.model.exits import Exits
from warpdem.scene.borders import Border
from warpdem.scene.model import Scene
from warpdem.scene.motion import FixedPlacement, Translation
from warpdem.scene.motion_chain import Chain
from warpdem.scene.regions import Box, CylinderRegion, MeshRegion, Placed, PlaneRegion, Shape, SphereRegion

AXES = "xyz"
LEAST_PERIOD = 2.05  # in largest diameters: a grain must not touch two images of another, nor change over in a few steps


def _periodic_span(border: Border | None) -> tuple[float, float]:
    """Length and lower border of an axis [m], 0 and 0 where it is not periodic."""
    if border is None or border.kind != "periodic":
        return 0.0, 0.0
    assert border.min is not None and border.max is not None  # a periodic axis has both
    return border.max - border.min, border.min


KINDS = {Box: BOX, CylinderRegion: CYLINDER, PlaneRegion: CYLINDER, SphereRegion: SPHERE, MeshRegion: MESH}
"""Kind of each shape in the kernels; what lies beyond a plane is a cylinder without an end."""
NOT_PLACED = Placed()
"""At rest in the frame."""


class Domain:
    """Borders and outlets of a scene as the engine takes them.

    Attributes:
        period: length along each axis [m], 0 where it is not periodic.
        lower: lower border along each periodic axis [m], else 0.
        shapes: regions in which grains leave, each in its own axes.
        places: what each region is at rest in.
        keys: the key of the scene that each region comes from.
        names: what each region is called.
        stops: whether a grain in it stops the run.
    """

    def __init__(self, scene: Scene) -> None:
        borders: list[Border | None] = [getattr(scene.borders, axis) if scene.borders else None for axis in AXES]
        round_ = [b is not None and b.kind == "periodic" for b in borders]
        x, y, z = (_periodic_span(border) for border in borders)
        self.period, self.lower = (x[0], y[0], z[0]), (x[1], y[1], z[1])
        self.shapes: list[Shape] = []
        self.places: list[Placed] = []
        self.keys, self.names, self.stops = [], [], []
        borders_at = Placed(fixed_to=scene.borders.fixed_to) if scene.borders else NOT_PLACED
        for k, (border, periodic) in enumerate(zip(borders, round_, strict=True)):
            if border is None or periodic:
                continue
            kinds = border.kind if isinstance(border.kind, list) else [border.kind] * 2
            for side, place, kind in (("min", border.min, kinds[0]), ("max", border.max, kinds[1])):
                if place is not None:
                    corners = np.array([[-np.inf] * 3, [np.inf] * 3])
                    corners[1 if side == "min" else 0, k] = place
                    # half of all space: more than a scene may give
                    self.shapes.append(Box.model_construct(min=tuple(corners[0].tolist()), max=tuple(corners[1].tolist())))
                    self.places.append(borders_at)
                    self.keys.append(f"borders.{AXES[k]}")
                    self.names.append(f"{AXES[k]} {side}")
                    self.stops.append(kind == "stop")
        for number, outlet in enumerate(scene.outlets):
            self.shapes.append(outlet.shape)
            self.places.append(outlet)
            self.keys.append(f"outlets[{number}]")
            self.names.append(outlet.name)
            self.stops.append(False)

    @property
    def kinds(self) -> tuple[int, ...]:
        """Kinds of regions in the kernels that are among them, in ascending order."""
        return tuple(sorted({KINDS[type(shape)] for shape in self.shapes}))

    @property
    def placed(self) -> bool:
        """Whether some region is not at rest in the frame."""
        return any(place.follows is not None or place.fixed_to == "laboratory" for place in self.places)

    @property
    def images(self) -> np.ndarray:
        """Shifts to the images of a place [m], shape (k, 3), numbered as in ``kernels.step.border``, the first of them 0."""
        return np.array([*itertools.product(*((0.0, p, -p) if p else (0.0,) for p in self.period))])

    def wrapped(self, position: np.ndarray) -> np.ndarray:
        """Images of positions (n, 3) [m] within the periodic borders."""
        period, lower = np.array(self.period), np.array(self.lower)
        periods = np.floor_divide(position - lower, np.where(period > 0, period, np.inf))
        return position - np.where(period > 0, periods * period, 0.0)

    def nearest(self, way: np.ndarray) -> np.ndarray:
        """The shortest of the differences (n, 3) [m] between images, as ``kernels.step.border`` computes it."""
        period = np.array(self.period)
        periods = np.where(way > 0.5 * period, 1.0, np.where(way < -0.5 * period, -1.0, 0.0))
        return way - np.where(period > 0, periods * period, 0.0)


def check(scene: Scene, start: InitialGrains, frame: Chain, gap: float, exits: Exits) -> None:
    """Refuse borders that cannot be, and grains that start beyond them.

    Args:
        scene: validated scene.
        start: grains at the start.
        frame: motions of the frame.
        gap: how far beyond contact the normal law acts [m].
        exits: regions in which grains leave.

    Raises:
        SceneError: a periodic axis is too short for its grains, or the frame rotates it; a grain is outside.
    """
    domain, largest = Domain(scene), float(start.radius.max(initial=0.0))
    widest = max(largest, 0.0 if start.clumps is None else start.clumps.reach(start.radius))
    for k, length in enumerate(domain.period):
        if length == 0.0:
            continue
        key = f"{scene.source}: borders.{AXES[k]}"
        if length < LEAST_PERIOD * (2.0 * widest + gap):
            what = "grain" if widest == largest else "clump, end to end"
            raise SceneError(
                f"{key}: its length of {length:g} m is below {LEAST_PERIOD} diameters of the largest {what} "
                f"({2.0 * widest:g} m): it would meet two images of another"
            )
        for motion in scene.frame or ():
            axis = getattr(motion, "axis", None)
            along = axis is not None and math.isclose(abs(axis[k]), 1.0, rel_tol=1e-12)
            if isinstance(motion, FixedPlacement):
                along = np.allclose(np.delete(motion.quaternion[1:], k), 0.0, atol=1e-12)
            if not (isinstance(motion, Translation) or along) and frame.rotates:
                raise SceneError(f"{key}: periodic, but the frame turns about another axis; only the axis of rotation may be")
        for number, wall in enumerate(scene.walls):
            if wall.driven:
                raise SceneError(
                    f"{key}: periodic, but walls[{number}] ({wall.name!r}) is driven: where it will go is not known, "
                    "nor at which periodic images it acts; take the periodic border away, or driven"
                )
            by_load = wall.dynamic
            if by_load is not None and (abs(by_load.axis[k]) != 1.0 if by_load.rotates else by_load.axis[k] != 0.0):
                kind = "servo" if wall.servo is not None else "free"
                how = "turns it about another axis" if by_load.rotates else "moves it along that axis"
                raise SceneError(
                    f"{key}: periodic, but walls[{number}].{kind} {how}, to where the wall would not repeat itself; only an "
                    "axis across the periodic ones will do"
                )
            for motion in wall.motion or ():
                axis = getattr(motion, "axis", None)
                if axis is not None and not math.isclose(abs(axis[k]), 1.0, rel_tol=1e-12):
                    raise SceneError(f"{key}: periodic, but walls[{number}].motion turns about another axis")
    _check_places(scene, domain.period)
    where = exits.left_by(start.position if start.clumps is None else start.clumps.centres(start.position))
    if (where >= 0).any():
        first = int(np.flatnonzero(where >= 0)[0])
        place = ", ".join(f"{x:.4g}" for x in start.position[first])
        outlet = where[first] >= len(domain.names) - len(scene.outlets)
        raise SceneError(
            f"{scene.source}: grains: grain {start.id[first]} at ({place}) m starts "
            f"{'in the outlet' if outlet else 'beyond the border'} {domain.names[where[first]]} "
            f"({int((where >= 0).sum())} of {len(where)} grains do)"
        )
    _check_overlaps_of_images(scene, start, domain, largest)


def _check_places(scene: Scene, period: tuple[float, float, float]) -> None:
    """Refuse regions that would cross a periodic border: grains come round there, and regions do not."""
    if not any(period):
        return
    borders = [("borders", Placed(fixed_to=scene.borders.fixed_to))] if scene.borders else []
    for key, place in [*borders, *((key_text(path), place) for path, place in scene.regions())]:
        if place.follows is not None:
            raise SceneError(
                f"{scene.source}: {key}.follows = {place.follows!r}: a region that follows a wall has no periodic images: "
                "leave follows out, or the periodic borders"
            )
        if place.fixed_to == "laboratory" and any(isinstance(motion, Translation) for motion in scene.frame or ()):
            raise SceneError(
                f'{scene.source}: {key}.fixed_to = "laboratory": the frame is shifted, and a region has no periodic images: '
                "leave fixed_to out, or the periodic borders"
            )


def _check_overlaps_of_images(scene: Scene, start: InitialGrains, domain: Domain, largest: float) -> None:
    """Grains that overlap across a periodic border."""
    for k, length in enumerate(domain.period):
        if length == 0.0:
            continue
        close = np.flatnonzero(start.position[:, k] < domain.lower[k] + 2.0 * largest)
        if not len(close):
            continue
        beyond = start.position[close] + length * np.eye(3)[k]
        of = None if start.clumps is None else start.clumps.of_grain
        ratio, _ = worst_overlaps(
            np.concatenate([start.position, beyond]), np.concatenate([start.radius, start.radius[close]]),
            None if of is None else np.concatenate([of, of[close]]),
        )  # fmt: skip
        deepest = int(np.argmax(ratio))
        if ratio[deepest] > scene.engine.max_overlap:
            ids = np.concatenate([start.id, start.id[close]])
            raise SceneError(
                f"{scene.source}: grains: grain {ids[deepest]} overlaps another across the periodic borders of {AXES[k]} by "
                f"{ratio[deepest]:.3g} of the smaller radius; allowed at the start is {scene.engine.max_overlap:g}"
            )
