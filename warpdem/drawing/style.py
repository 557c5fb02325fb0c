"""How a picture of results looks: everything a user may choose, with its default."""

from dataclasses import dataclass, fields
from typing import Literal, get_args

from warpdem.errors import WarpdemError

View = Literal["frame", "laboratory"]
Preset = Literal["auto", "front", "back", "left", "right", "top", "bottom", "iso"]
Vector = tuple[float, float, float]


@dataclass(frozen=True)
class PictureStyle:
    """Camera, colours, cuts and walls of a picture; positions are in the axes of the view."""

    view: View = "laboratory"
    """Axes that stand still in the picture."""
    colour: str = "speed"
    """Field of the grains that colours them: speed, speed_lab, spin, force, size, mass, id, type, group, clump, or the name of
    any array in the files; vectors by their length, or a component as in v.x (in frame axes). Members of a clump have what
    the clump has; clump gives each clump a colour of its own, and grains of their own grey."""
    colour_range: tuple[float, float] | None = None
    """Values at the ends of the scale bar, in its unit in the files; None for those met in all frames of the film together,
    without the outermost 1 % (of few grains, one of them) where these go on far beyond the others."""
    spots: bool = False
    """Six dark spots on each grain that is no member of a clump, at the ends of its body axes: they show how it rolls. The run
    needs output.orientation = true."""
    chains: bool = False
    """Force chains: grains and walls are faded, and over them each contact is a line from centre to centre, or to the contact
    point of a wall, as wide and as dark as its normal force is large; blue where it pulls. The run needs output.contacts =
    true."""
    colour_map: str | None = None
    """Colour map by its Matplotlib name; None for viridis, or coolwarm for components."""
    camera: Preset = "auto"
    """Side from which the picture is taken. Up is against the gravity of the first frame, z without gravity. With z up front
    looks along +y and left along +x, with y up front along -z and left along +x; for other upward directions they are
    rotated as z is by the shortest rotation. top looks along gravity. auto looks along the frame's axis of rotation; as front
    if that is upright."""
    position: Vector | None = None
    """Position of the camera [m]; None for one that shows everything."""
    focus: Vector | None = None
    """Point in the middle of the picture [m]; None for the middle of everything."""
    up: Vector | None = None
    """Direction that points upwards in the picture [-]; None for against gravity, or in a view along gravity for where
    front looks."""
    zoom: float = 1.0
    """How much larger things appear than the camera alone would show them [-], > 0."""
    height: float | None = None
    """Height of the picture in a parallel projection [m], > 0; None for a perspective one."""
    cut: tuple[str, ...] = ()
    """What is shown, as in "y > 0", or "px,py,pz,nx,ny,nz" for the side of a plane through p to which n points [m]; grains by
    their centres, clumps whole by theirs. "frame: y > 0" or "laboratory: y > 0" names other axes than the view's."""
    hide: tuple[str, ...] = ()
    """Walls that are not drawn, by name."""
    opacity: float | None = None
    """Opacity of the walls, from 0 to 1; None for 0.16, or 0.6 where they are coloured."""
    wall_colour: str | None = None
    """Field of the walls' triangles that colours them, such as pressure; None for one tint."""
    wall_smooth: bool = True
    """Shade between the values of neighbouring triangles of a coloured wall, averaged at their corners, but not across sharp
    edges; False for one colour per triangle, as the files hold it. Forces of triangles are never averaged."""
    wall_range: tuple[float, float] | None = None
    """As colour_range, for the walls."""
    size: tuple[int, int] = (1280, 960)
    """Width and height in pixels, 64 to 8192; of a comparison, all panes together."""
    shadows: bool = False
    """Shadows of the light from above the camera: of grains and of walls with opacity 1, on these and on planes."""
    ruler: bool = False
    """A bar of a round length at the lower edge; in a perspective view it is right at the depth of the focus."""
    background: str = "white"
    """Colour behind everything, by its Matplotlib name or as "#rrggbb"."""

    def __post_init__(self) -> None:
        """Refuse what cannot be drawn."""
        _among("view", self.view, get_args(View))
        _among("camera", self.camera, get_args(Preset))
        for name in ("zoom", "height"):
            value = getattr(self, name)
            if value is not None and not 0.0 < value < float("inf"):
                raise WarpdemError(f"{name} {value!r} must be a finite number above 0")
        if self.opacity is not None and not 0.0 <= self.opacity <= 1.0:
            raise WarpdemError(f"opacity {self.opacity!r} must be from 0 to 1")
        for name in ("colour_range", "wall_range"):
            value = getattr(self, name)
            if value is not None and not value[0] < value[1]:
                raise WarpdemError(f"{name} {value!r} must be two numbers, the lesser one first")
        if not all(64 <= pixels <= 8192 for pixels in self.size):
            raise WarpdemError(f"size {self.size!r} must be a width and a height from 64 to 8192 pixels")


CHOICES = tuple(field.name for field in fields(PictureStyle))
"""Names of all choices."""


def _among(name: str, value: str, allowed: tuple[str, ...]) -> None:
    if value not in allowed:
        raise WarpdemError(f"{name} {value!r} is unknown; allowed are {', '.join(allowed)}")
