"""The 3-d part of a picture: grains as true balls and see-through walls, drawn by VTK without a screen."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import pyvista as pv
from vtkmodules.vtkFiltersHybrid import vtkPolyDataSilhouette

from warpdem.drawing.balls import BallActor, Balls, set_depths
from warpdem.drawing.camera import Camera
from warpdem.drawing.legend import ink_on
from warpdem.drawing.plotter import OVERSAMPLING, aim, open_plotter, reduced
from warpdem.drawing.shadows import Shadows
from warpdem.drawing.wall_nodes import SHARP_ANGLE

_WALL = "#9db4c8"
_BORDER = 8
"""Pixels drawn beyond each edge and cut off: there VTK takes the shade of the gaps from the opposite edge."""
_SHADE_DISTANCE = 3.5
"""How far grains darken the gaps between them, in radii [-]."""


@dataclass(frozen=True)
class Surface:
    """A wall to draw."""

    name: str
    vertices: np.ndarray
    """Corners in the axes of the view [m], shape (v, 3)."""
    triangles: np.ndarray
    """Corner numbers of each triangle, shape (t, 3)."""
    colour: np.ndarray | None
    """Red, green, blue of each triangle, shape (t, 3), or of each corner, shape (v, 3), uint8; None for the tint of walls."""
    at_corners: bool
    """Whether the colours are those of the corners, shaded in between."""
    cuts: tuple[tuple[np.ndarray, float], ...]
    """Half-spaces n . x > d in the axes of the view of which the wall is shown."""
    plane: bool
    """Whether it is a part of an infinite plane, wound about the direction of the grains."""

    def mesh(self) -> pv.PolyData:
        """What is shown of it; may be empty."""
        mesh: pv.PolyData = pv.PolyData.from_regular_faces(self.vertices, self.triangles)
        if self.colour is not None:
            (mesh.point_data if self.at_corners else mesh.cell_data)["colour"] = self.colour
        for normal, offset in self.cuts:
            mesh = mesh.clip(normal=tuple(-normal), origin=tuple(offset * normal))
        return mesh


class VtkRenderer:
    """One plotter that draws frame after frame with one camera."""

    def __init__(self, size: tuple[int, int], camera: Camera, background: str, opacity: float, shadows: bool) -> None:
        self._size, self._camera, self._opacity = size, camera, opacity
        self._ink = ink_on(background)
        drawn = (size[0] + 2 * _BORDER, size[1] + 2 * _BORDER)
        self._plotter = open_plotter(drawn, background)
        self._balls = BallActor(self._plotter)
        self._shade_distance = 0.0
        aim(self._plotter, camera, drawn[1] / size[1])
        self._shadows = Shadows(drawn, camera, drawn[1] / size[1]) if shadows else None
        self._walls: dict[str, Surface] = {}

    def draw(self, balls: Balls, walls: list[Surface]) -> np.ndarray:
        """Pixels of one frame, shape (height, width, 3), uint8."""
        self._balls.set(balls, self._camera)
        if not self._shade_distance and len(balls.radius):
            self._shade_distance = _SHADE_DISTANCE * float(np.median(balls.radius))
            self._plotter.enable_ssao(radius=self._shade_distance, bias=0.05 * self._shade_distance, kernel_size=64)  # type: ignore[call-arg]
        for name in self._walls.keys() - {wall.name for wall in walls}:
            self._remove(name)
        for wall in walls:
            self._draw_wall(wall)
        set_depths(self._plotter, balls, [wall.vertices for wall in walls])
        self._plotter.render()  # screenshot alone would give the pixels of the frame before
        fine = np.asarray(self._plotter.screenshot(return_img=True))[..., :3]
        if self._shadows is not None:
            fine = fine * self._brightness(self._shadows, balls, walls)[..., None]
        cut = OVERSAMPLING * _BORDER
        return np.asarray(np.round(reduced(fine[cut:-cut, cut:-cut])).astype(np.uint8))

    def close(self) -> None:
        """Free what the plotter holds."""
        self._plotter.close()
        if self._shadows is not None:
            self._shadows.close()

    def _brightness(self, shadows: Shadows, balls: Balls, walls: list[Surface]) -> np.ndarray:
        opaque = self._opacity == 1.0
        meshes = [(wall, wall.mesh()) for wall in walls if wall.plane or opaque]
        meshes = [(wall, mesh) for wall, mesh in meshes if mesh.n_cells]
        planes = [mesh for wall, mesh in meshes if wall.plane]
        return shadows.brightness(balls, [mesh for wall, mesh in meshes if not wall.plane], planes)

    def _remove(self, name: str) -> None:
        del self._walls[name]
        for part in ("back", "front", "outline"):
            self._plotter.remove_actor(f"{part} {name}", reset_camera=False, render=False)  # type: ignore[arg-type]

    def _draw_wall(self, wall: Surface) -> None:
        """See-through surface with its outline and sharp edges as lines."""
        last = self._walls.get(wall.name)
        if last is not None:
            if all(np.array_equal(getattr(last, key), getattr(wall, key)) for key in ("vertices", "triangles", "colour")):
                return
            self._remove(wall.name)
        self._walls[wall.name] = wall
        mesh = wall.mesh()
        if not mesh.n_cells:
            return
        style: dict[str, Any] = {"reset_camera": False, "render": False}
        paint: dict[str, Any] = {"color": _WALL} if wall.colour is None else {"scalars": "colour", "rgb": True}
        # a see-through wall has one tint all over; light is for opaque ones, and leaves the colours of a field readable
        light: dict[str, Any] = {"lighting": self._opacity == 1.0, "ambient": 0.55, "diffuse": 0.5, "specular": 0.0}
        # the far side first, so that each side shines through the one before it from any camera position
        sides: tuple[tuple[str, Literal["front", "back"]], ...] = (("back", "front"), ("front", "back"))
        for part, culling in sides:
            self._plotter.add_mesh(
                mesh, opacity=self._opacity, culling=culling, name=f"{part} {wall.name}", show_scalar_bar=False,
                **paint, **light, **style,
            )  # fmt: skip
        # meshes from STL may hold each corner once per triangle; edges are found only where triangles share corners
        outline = vtkPolyDataSilhouette()
        outline.SetInputData(mesh.clean())
        outline.SetCamera(self._plotter.camera)
        outline.SetEnableFeatureAngle(True)
        outline.SetFeatureAngle(SHARP_ANGLE)
        outline.BorderEdgesOn()
        outline.Update()
        lines = pv.wrap(outline.GetOutput())
        if lines.n_points:
            width = max(1.0, 1.5e-3 * self._size[1]) * OVERSAMPLING
            self._plotter.add_mesh(
                lines, color=self._ink, opacity=0.8, line_width=width, name=f"outline {wall.name}", **style
            )

