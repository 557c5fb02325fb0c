"""Measurements during a run, as scene data."""

from typing import Annotated, Literal

from pydantic import Field, StrictBool, model_validator

from warpdem.scene import regions
from warpdem.scene.base import Direction, Length, Name, Point, SceneModel, exactly_one
from warpdem.scene.regions import Box
from warpdem.scene.selection import Selection
from warpdem.scene.wear import Wear

OF = "Which grains count: group, material, diameter = [smallest, largest]. Default all."


class FlowPlane(SceneModel):
    """A plane, or a disk, through which the flow of grains is counted."""

    name: Name = Field(description="Unique name: letters, digits, _ and -.")
    point: Point = Field(description="Point of the plane [m]; with a radius, the centre of the disk.")
    normal: Direction = Field(description="Direction of positive flow [-], any length but zero; held as a unit vector.")
    radius: Length | None = Field(
        None, description="Radius of the disk around the point within which crossings count [m], > 0, default the whole plane."
    )
    fixed_to: Literal["frame", "laboratory"] = Field(
        "frame", description='What the plane is fixed to: "frame" (default) or "laboratory".'
    )
    of: Selection | None = Field(None, description=OF)


class Region(regions.Region):
    """A region, or all grains, over which bulk properties are averaged.

    Grains count by their centres. Solid fraction and contact stress, by the parts of spheres and branch vectors inside, are
    measured in all but cylinders without a length. Vectors are relative to what the region is fixed to, in its axes.
    """

    name: Name = Field(description="Unique name: letters, digits, _ and -.")
    box: Box | None = Field(
        None,
        description="Box along the axes of the region; this, cylinder, sphere or mesh. Default of them: all grains.",
    )
    of: Selection | None = Field(None, description=f"{OF} A selection has no stress.")
    fabric: StrictBool = Field(
        False, description="Whether the fabric tensor of the contacts is measured too, default false: six columns."
    )

    @model_validator(mode="after")
    def _one_shape_at_most(self) -> "Region":
        if self.shape_key:
            exactly_one(self, *regions.VOLUMES)
        return self


class Profile(regions.Placed):
    """Slices of a box along an axis, each a region of its own."""

    name: Name = Field(description="Unique name: letters, digits, _ and -; the slices are NAME_0, NAME_1 ...")
    box: Box = Field(description="Box along the axes of what it is fixed to, that is divided.")
    along: Literal["x", "y", "z"] = Field(description="Axis across which it is cut.")
    slices: Annotated[int, Field(strict=True, ge=1, le=1000)] = Field(description="Number of slices, 1 to 1000.")
    of: Selection | None = Field(None, description=f"{OF} A selection has no stress.")
    fabric: StrictBool = Field(False, description="As in regions.")

    @property
    def regions(self) -> list[Region]:
        """The slices, in ascending order along the axis."""
        k, box = "xyz".index(self.along), self.box
        low, high = box.min[k], box.max[k]
        faces = [low + (high - low) * i / self.slices for i in range(self.slices)] + [high]

        def cut(corner: tuple[float, float, float], face: float) -> tuple[float, float, float]:
            x, y, z = (face if axis == k else value for axis, value in enumerate(corner))
            return x, y, z

        return [
            Region(
                name=f"{self.name}_{i}",
                box=Box(min=cut(box.min, faces[i]), max=cut(box.max, faces[i + 1])),
                of=self.of,
                fabric=self.fabric,
                fixed_to=self.fixed_to,
                follows=self.follows,
            )
            for i in range(self.slices)
        ]


class Residence(SceneModel):
    """Residence times of the grains that leave."""

    name: Name = Field(description="Unique name: letters, digits, _ and -.")
    outlet: str | None = Field(
        None, description='Name of the outlet, or border such as "x max", that they leave through; default any.'
    )
    of: Selection | None = Field(None, description=OF)


class Mixing(SceneModel):
    """Mixing of two classes of grains by Lacey's index."""

    name: Name = Field(description="Unique name: letters, digits, _ and -.")
    by: Literal["material", "group", "size", "x", "y", "z"] | None = Field(
        None,
        description='Property that defines the two classes: "material" or "group" (the first of the scene against the rest), '
        '"size" (against the median radius), or "x", "y", "z" (below or above the initial median along a frame axis); '
        "or give first.",
    )
    first: Selection | None = Field(
        None, description="Grains of the first class, all others are the second: group, material, diameter. Or by."
    )
    cell: Length = Field(description="Edge of the cubic sample cells [m], > 0; some 3 to 5 grain diameters.")

    @model_validator(mode="after")
    def _two_classes(self) -> "Mixing":
        exactly_one(self, "by", "first")
        return self


class Grid(SceneModel):
    """The grid of the coarse-grained fields."""

    box: Box = Field(description="Box along the axes of what it is fixed to, that the grid spans.")
    fixed_to: Literal["frame", "laboratory"] = Field(
        "frame", description='What the grid is fixed to, and whose axes its vectors are in: "frame" (default) or "laboratory".'
    )
    cell: Length = Field(description="Spacing of the grid points [m], > 0.")
    width: Length | None = Field(
        None, description="Radius of the averaging kernel [m], > 0, default 2 cell; some 1.5 to 3 grain diameters."
    )


class Measures(SceneModel):
    """Measurements during the run: columns of history.csv, and fields on a grid."""

    energy: StrictBool = Field(
        False,
        description="Whether the energy budget is accumulated at every step, default false: dissipation by damping, sliding "
        "and rolling, work of walls and fields, and the residual.",
    )
    momentum: StrictBool = Field(
        False,
        description="Whether the budgets of momentum and angular momentum are accumulated at every step, default false: "
        "impulse of walls, gravity and fields, and the residual.",
    )
    flow: list[FlowPlane] = Field(
        [], description="Planes through which the flow is counted at every step, default none."
    )
    regions: list[Region] = Field(
        [],
        description="Regions in which mass, velocity, granular temperature, coordination number and stress are measured, "
        "default none.",
    )
    profiles: list[Profile] = Field(
        [], description="Boxes cut into slices along an axis, in each of which the same is measured, default none."
    )
    residence: list[Residence] = Field(
        [],
        description="Residence times, from insertion or the start to the way out, of grains that have left; default none.",
    )
    mixing: list[Mixing] = Field([], description="Mixing indices, default none.")
    wear: Wear | None = Field(
        None,
        description="Wear and mean pressure of the walls, added up at every step: columns of history.csv, and arrays of the "
        "triangles of meshes in frames of VTK; default none.",
    )
    grid: Grid | None = Field(
        None,
        description="Grid of coarse-grained density, solid fraction, velocity, stress and granular temperature, written with "
        "every frame (VTI with grid.pvd), default none.",
    )

    @property
    def all_regions(self) -> list[Region]:
        """The regions, and the slices of the profiles."""
        return [*self.regions, *(region for profile in self.profiles for region in profile.regions)]
