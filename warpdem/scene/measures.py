"""Keys of a scene that say what is measured while it runs."""

from typing import Literal

from pydantic import Field, StrictBool

from warpdem.scene.base import Direction, Length, Name, Point, SceneModel
from warpdem.scene.borders import Box


class FlowPlane(SceneModel):
    """A plane, or a disk of one, whose crossings are counted."""

    name: Name = Field(description="Name, one of a kind: letters, digits, _ and -.")
    point: Point = Field(description="Point of the plane [m]; the centre, if it has a radius.")
    normal: Direction = Field(description="Direction that counts as positive [-], any length but zero; held as a unit vector.")
    radius: Length | None = Field(
        None, description="Only what crosses within this distance of the point counts [m], > 0, default the whole plane."
    )
    fixed_to: Literal["frame", "laboratory"] = Field(
        "frame", description='What the plane is fixed to: "frame" (default) or "laboratory".'
    )


class Region(SceneModel):
    """A box, or the whole run, that bulk properties are averaged over."""

    name: Name = Field(description="Name, one of a kind: letters, digits, _ and -.")
    box: Box | None = Field(
        None,
        description="Box in frame axes. Grains count by their centres, solid fraction and contact stress by the parts of balls "
        "and branch vectors in the box. Default: all grains, without what needs a volume.",
    )


class Mixing(SceneModel):
    """Two kinds of grains whose mixing is told by Lacey's index."""

    name: Name = Field(description="Name, one of a kind: letters, digits, _ and -.")
    by: Literal["material", "group", "size", "x", "y", "z"] = Field(
        description='What makes the two kinds: "material" or "group" (the first of the scene against the rest), "size" '
        '(against the median radius), or "x", "y", "z" (below or above the median of the start along a frame axis).',
    )
    cell: Length = Field(description="Edge of the cubic cells that are the samples [m], > 0; some 3 to 5 grain diameters.")


class Grid(SceneModel):
    """A grid that coarse-grained fields are written on."""

    box: Box = Field(description="Box in frame axes that the grid spans.")
    cell: Length = Field(description="Distance of grid points [m], > 0.")
    width: Length | None = Field(
        None, description="Radius of the averaging kernel [m], > 0, default 2 cell; some 1.5 to 3 grain diameters."
    )


class Measures(SceneModel):
    """What is measured while the run goes on: columns of history.csv, and fields on a grid."""

    energy: StrictBool = Field(
        False,
        description="Whether the energy budget is added up at every step, default false: what is dissipated by damping, "
        "sliding and rolling, work of walls and fields, and what does not close.",
    )
    momentum: StrictBool = Field(
        False,
        description="Whether the budgets of momentum and angular momentum are added up at every step, default false: impulse "
        "of walls, gravity and fields, and what does not close.",
    )
    flow: list[FlowPlane] = Field(
        [], description="Planes whose crossings are counted at every step, default none."
    )
    regions: list[Region] = Field(
        [],
        description="Regions of which mass, velocity, granular temperature, coordination number and stress are told, "
        "default none.",
    )
    mixing: list[Mixing] = Field([], description="Mixing indices, default none.")
    grid: Grid | None = Field(
        None,
        description="Grid of coarse-grained density, solid fraction, velocity, stress and granular temperature, written with "
        "every frame (VTI with grid.pvd), default none.",
    )
