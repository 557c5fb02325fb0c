"""Measurements during a run, as scene data."""

from typing import Literal

from pydantic import Field, StrictBool

from warpdem.scene.base import Direction, Length, Name, Point, SceneModel
from warpdem.scene.regions import Box


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


class Region(SceneModel):
    """A box, or all grains, over which bulk properties are averaged."""

    name: Name = Field(description="Unique name: letters, digits, _ and -.")
    box: Box | None = Field(
        None,
        description="Box in frame axes. Grains count by their centres, solid fraction and contact stress by the parts of "
        "spheres and branch vectors in the box. Default: all grains, without the quantities that need a volume.",
    )


class Mixing(SceneModel):
    """Mixing of two classes of grains by Lacey's index."""

    name: Name = Field(description="Unique name: letters, digits, _ and -.")
    by: Literal["material", "group", "size", "x", "y", "z"] = Field(
        description='Property that defines the two classes: "material" or "group" (the first of the scene against the rest), '
        '"size" (against the median radius), or "x", "y", "z" (below or above the initial median along a frame axis).',
    )
    cell: Length = Field(description="Edge of the cubic sample cells [m], > 0; some 3 to 5 grain diameters.")


class Grid(SceneModel):
    """The grid of the coarse-grained fields."""

    box: Box = Field(description="Box in frame axes that the grid spans.")
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
    mixing: list[Mixing] = Field([], description="Mixing indices, default none.")
    grid: Grid | None = Field(
        None,
        description="Grid of coarse-grained density, solid fraction, velocity, stress and granular temperature, written with "
        "every frame (VTI with grid.pvd), default none.",
    )
