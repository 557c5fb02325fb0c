"""Regions as scene data: a box, cylinder, sphere or closed mesh, or what lies beyond a plane; where each is at rest.

The same keys say where a stream inserts grains, a filling puts them, an outlet removes them and a measure looks at them. A
region rests in the frame or in the laboratory, or a wall carries it along; its coordinates are in those axes.
"""

import math
from typing import Literal, Protocol

import numpy as np
from pydantic import Field, model_validator

from warpdem.scene.base import Direction, FileName, Length, Name, Point, SceneModel, exactly_one, validation_error
from warpdem.scene.walls import FixedRotation, Scale


class Solid(Protocol):
    """A bounded region in its own axes."""

    @property
    def bounds(self) -> np.ndarray:
        """Least and greatest corner [m], shape (2, 3), of the smallest box around it; infinite where it has no end."""

    @property
    def volume(self) -> float:
        """Volume [m3]."""

    def depth(self, points: np.ndarray) -> np.ndarray:
        """Distance of points [m], shape (n, 3), from the surface [m], shape (n,), positive inside."""

    def holds(self, points: np.ndarray) -> np.ndarray:
        """Whether points [m], shape (n, 3), are inside; bool, shape (n,)."""

    def random_points(self, generator: np.random.Generator, radius: np.ndarray) -> np.ndarray:
        """Random points [m], shape (n, 3), at least ``radius`` [m], shape (n,), inside the surface."""


class Box(SceneModel):
    """Box aligned with the axes of the region."""

    min: Point = Field(description="Lowest corner [m].")
    max: Point = Field(description="Highest corner [m], above min along each axis.")

    @model_validator(mode="after")
    def _is_not_empty(self) -> "Box":
        if not all(low < high for low, high in zip(self.min, self.max, strict=True)):
            raise validation_error([(("max",), self.max, f"must be above min = {list(self.min)} along each axis")])
        return self

    @property
    def bounds(self) -> np.ndarray:
        """As ``Solid``."""
        return np.array([self.min, self.max])

    @property
    def volume(self) -> float:
        """As ``Solid``."""
        return float(np.prod(np.array(self.max) - np.array(self.min)))

    @property
    def thinnest(self) -> tuple[str, float]:
        """Diameter of the largest ball that fits [m], with its name."""
        return "shortest side", min(high - low for low, high in zip(self.min, self.max, strict=True))

    def depth(self, points: np.ndarray) -> np.ndarray:
        """As ``Solid``; outside the distance along one axis only."""
        return np.asarray(np.minimum(points - self.min, self.max - points).min(axis=1))

    def holds(self, points: np.ndarray) -> np.ndarray:
        """As ``Solid``; what lies at a lower face is inside, what lies at an upper one is not."""
        return np.asarray(((points >= self.min) & (points < self.max)).all(axis=1))

    def random_points(self, generator: np.random.Generator, radius: np.ndarray) -> np.ndarray:
        """As ``Solid``."""
        low, r = np.array(self.min), radius[:, None]
        return np.asarray(low + r + generator.random((len(radius), 3)) * (np.array(self.max) - low - 2.0 * r))


class CylinderRegion(SceneModel):
    """Cylinder about an axis."""

    point: Point = Field(description="A point on the axis [m]; with length, the centre of the first end.")
    axis: Direction = Field(description="Direction of the axis [-], any length but zero; held as a unit vector.")
    radius: Length = Field(description="Radius [m], > 0.")
    length: Length | None = Field(
        None, description="Length from point along axis [m], > 0; default infinite, where no volume is needed."
    )

    @property
    def ends(self) -> tuple[float, float]:
        """Heights of both ends above the point [m]."""
        return (-math.inf, math.inf) if self.length is None else (0.0, self.length)

    @property
    def thinnest(self) -> tuple[str, float]:
        """Diameter of the largest ball that fits [m], with its name."""
        length = math.inf if self.length is None else self.length
        return ("length", length) if length < 2.0 * self.radius else ("diameter", 2.0 * self.radius)

    @property
    def bounds(self) -> np.ndarray:
        """As ``Solid``."""
        axis = np.array(self.axis)
        # a direction across an axis has no extent along it: 0 times infinity
        ends = np.array([np.multiply(axis, h, out=np.zeros(3), where=axis != 0.0) for h in self.ends])
        reach = self.radius * np.sqrt(np.maximum(1.0 - axis**2, 0.0))
        return np.array([np.array(self.point) + ends.min(axis=0) - reach, np.array(self.point) + ends.max(axis=0) + reach])

    @property
    def volume(self) -> float:
        """As ``Solid``."""
        return math.inf if self.length is None else math.pi * self.radius**2 * self.length

    def _coordinates(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Height above the point and distance from the axis [m], shapes (n,)."""
        arm, axis = points - np.array(self.point), np.array(self.axis)
        height = arm @ axis
        return height, np.linalg.norm(arm - height[:, None] * axis, axis=1)

    def depth(self, points: np.ndarray) -> np.ndarray:
        """As ``Solid``; beyond an edge the distance along one of the two coordinates only."""
        height, across = self._coordinates(points)
        start, end = self.ends
        return np.asarray(np.minimum(self.radius - across, np.minimum(height - start, end - height)))

    def holds(self, points: np.ndarray) -> np.ndarray:
        """As ``Solid``."""
        height, across = self._coordinates(points)
        start, end = self.ends
        return np.asarray((across <= self.radius) & (height >= start) & (height <= end))

    def random_points(self, generator: np.random.Generator, radius: np.ndarray) -> np.ndarray:
        """As ``Solid``."""
        assert self.length is not None  # who draws points asks for a length
        first, second = across(np.array(self.axis))
        fraction, angle, along = generator.random((len(radius), 3)).T
        distance, angle = (self.radius - radius) * np.sqrt(fraction), 2.0 * math.pi * angle
        height = radius + along * (self.length - 2.0 * radius)
        radial = np.outer(distance * np.cos(angle), first) + np.outer(distance * np.sin(angle), second)
        return np.asarray(np.array(self.point) + np.outer(height, self.axis) + radial)


class SphereRegion(SceneModel):
    """Sphere."""

    centre: Point = Field(description="Centre [m].")
    radius: Length = Field(description="Radius [m], > 0.")

    @property
    def thinnest(self) -> tuple[str, float]:
        """Diameter of the largest ball that fits [m], with its name."""
        return "diameter", 2.0 * self.radius

    @property
    def bounds(self) -> np.ndarray:
        """As ``Solid``."""
        return np.array([np.array(self.centre) - self.radius, np.array(self.centre) + self.radius])

    @property
    def volume(self) -> float:
        """As ``Solid``."""
        return 4.0 / 3.0 * math.pi * self.radius**3

    def depth(self, points: np.ndarray) -> np.ndarray:
        """As ``Solid``."""
        return np.asarray(self.radius - np.linalg.norm(points - np.array(self.centre), axis=1))

    def holds(self, points: np.ndarray) -> np.ndarray:
        """As ``Solid``."""
        return np.asarray(self.depth(points) >= 0.0)

    def random_points(self, generator: np.random.Generator, radius: np.ndarray) -> np.ndarray:
        """As ``Solid``."""
        fraction, height, angle = generator.random((len(radius), 3)).T
        distance, height, angle = (self.radius - radius) * np.cbrt(fraction), 2.0 * height - 1.0, 2.0 * math.pi * angle
        level = np.sqrt(np.maximum(1.0 - height**2, 0.0))
        direction = np.stack([level * np.cos(angle), level * np.sin(angle), height], axis=1)
        return np.asarray(np.array(self.centre) + distance[:, None] * direction)


class MeshFile(SceneModel):
    """A mesh that is no wall; its points after scale, rotate and translate, in this order."""

    file: FileName = Field(
        description="Mesh file (.stl, .obj, .ply, .usd, .usda, .usdc, .usdz, .step, .stp), relative to the scene file."
    )
    scale: Scale = Field(
        1.0, description="Factor from the file's lengths to metres [-], > 0, default 1; or three, one along each of its axes."
    )
    translate: Point = Field((0.0, 0.0, 0.0), description="Translation [m], after scale and rotate, default 0.")
    rotate: FixedRotation | None = Field(None, description="Rotation about the origin, after scale, default none.")


class MeshRegion(MeshFile):
    """The inside of a closed mesh that is no wall; its points after scale, rotate and translate, in this order."""


class PlaneRegion(SceneModel):
    """All that lies beyond a plane; with a radius, beyond a disk and no further from the line through its centre."""

    point: Point = Field(description="Point of the plane [m]; with a radius, the centre of the disk.")
    normal: Direction = Field(description="Direction into the region [-], any length but zero; held as a unit vector.")
    radius: Length | None = Field(None, description="Radius [m], > 0, default infinite.")

    def holds(self, points: np.ndarray) -> np.ndarray:
        """Whether points [m], shape (n, 3), are beyond the plane; bool, shape (n,)."""
        arm, normal = points - np.array(self.point), np.array(self.normal)
        height = arm @ normal
        across = np.linalg.norm(arm - height[:, None] * normal, axis=1)
        return np.asarray((height >= 0.0) & (across <= (math.inf if self.radius is None else self.radius)))


class DiskFace(SceneModel):
    """A disk on which grains are inserted."""

    point: Point = Field(description="Centre [m].")
    normal: Direction = Field(description="Normal [-], any length but zero; held as a unit vector.")
    radius: Length = Field(description="Radius [m], > 0.")

    @property
    def thinnest(self) -> tuple[str, float]:
        """Diameter of the largest grain that fits [m], with its name."""
        return "diameter", 2.0 * self.radius

    @property
    def bounds(self) -> np.ndarray:
        """As ``Solid``."""
        reach = self.radius * np.sqrt(np.maximum(1.0 - np.array(self.normal) ** 2, 0.0))
        return np.array([np.array(self.point) - reach, np.array(self.point) + reach])

    def depth(self, points: np.ndarray) -> np.ndarray:
        """Distance of points of the disk [m], shape (n, 3), from its rim [m], shape (n,)."""
        return np.asarray(self.radius - np.linalg.norm(points - np.array(self.point), axis=1))

    def random_points(self, generator: np.random.Generator, radius: np.ndarray) -> np.ndarray:
        """Random points of the disk [m], shape (n, 3), at least ``radius`` [m], shape (n,), from its rim."""
        first, second = across(np.array(self.normal))
        fraction, angle = generator.random((len(radius), 2)).T
        distance, angle = (self.radius - radius) * np.sqrt(fraction), 2.0 * math.pi * angle
        return np.asarray(
            np.array(self.point) + np.outer(distance * np.cos(angle), first) + np.outer(distance * np.sin(angle), second)
        )


class MeshFace(MeshFile):
    """An open surface on which grains are inserted; its points after scale, rotate and translate, in this order."""


Shape = Box | CylinderRegion | SphereRegion | MeshRegion | PlaneRegion
"""Shape of a region."""
VOLUMES = ("box", "cylinder", "sphere", "mesh")
"""Keys that name the shape of a bounded region."""


class Placed(SceneModel):
    """What a part of the scene rests in: the frame, the laboratory, or a wall that carries it along."""

    fixed_to: Literal["frame", "laboratory"] = Field(
        "frame", description='What it is fixed to, and whose axes its coordinates are in: "frame" (default) or "laboratory".'
    )
    follows: str | None = Field(
        None,
        description="Name of a wall that carries it along; its coordinates are then in the axes in which the geometry of that "
        "wall is given. Default none.",
    )

    @model_validator(mode="after")
    def _rests_in_one(self) -> "Placed":
        if self.follows is not None and self.fixed_to == "laboratory":
            reason = f'cannot be given with follows = "{self.follows}": a wall carries it along'
            raise validation_error([(("fixed_to",), self.fixed_to, reason)])
        return self


class Region(Placed):
    """A bounded region: exactly one of box, cylinder, sphere and mesh."""

    box: Box | None = Field(None, description="Box along the axes of the region; this, cylinder, sphere or mesh.")
    cylinder: CylinderRegion | None = Field(None, description="Cylinder; this, box, sphere or mesh.")
    sphere: SphereRegion | None = Field(None, description="Sphere; this, box, cylinder or mesh.")
    mesh: MeshRegion | None = Field(None, description="Inside of a closed mesh that is no wall; this, box, cylinder or sphere.")

    @property
    def shape_key(self) -> str:
        """The key that gives the shape; empty if none does."""
        return next((key for key in (*VOLUMES, "plane") if getattr(self, key, None) is not None), "")

    @property
    def shape(self) -> Shape:
        """The shape, one of which the region has."""
        shape: Shape = getattr(self, self.shape_key)
        return shape


class Outlet(Region):
    """A region that removes grains from the run and counts them: those whose centre is inside."""

    name: Name = Field(description="Unique name: letters, digits, _ and -.")
    plane: PlaneRegion | None = Field(
        None, description="Plane or disk: grains whose centre is beyond it, on the side of its normal, are removed."
    )

    @model_validator(mode="after")
    def _one_shape(self) -> "Outlet":
        exactly_one(self, *VOLUMES, "plane")
        return self


def across(axis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors square to a unit vector (3,) and to each other."""
    first = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    first = first / np.linalg.norm(first)
    return first, np.cross(axis, first)
