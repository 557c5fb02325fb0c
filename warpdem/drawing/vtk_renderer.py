"""The 3-d part of a picture: grains as true balls and see-through walls, drawn by VTK without a screen."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import pyvista as pv
from vtkmodules.vtkFiltersHybrid import vtkPolyDataSilhouette
from vtkmodules.vtkRenderingOpenGL2 import vtkOpenGLSphereMapper

from warpdem.drawing.camera import Camera
from warpdem.drawing.legend import ink_on
from warpdem.drawing.plotter import OVERSAMPLING, aim, open_plotter, reduced
from warpdem.drawing.visibility import visible
from warpdem.drawing.wall_nodes import SHARP_ANGLE

_WALL = "#9db4c8"
_BORDER = 8
"""Pixels drawn beyond each edge and cut off: there VTK takes the shade of the gaps from the opposite edge."""
_SHADE_DISTANCE = 3.5
"""How far grains darken the gaps between them, in radii [-]."""


@dataclass(frozen=True)
class Balls:
    """The grains to draw."""

    position: np.ndarray
    """Centres in the axes of the view [m], shape (n, 3)."""
    radius: np.ndarray
    """Radii [m], shape (n,)."""
    colour: np.ndarray
    """Red, green, blue of 0 to 255, shape (n, 3), uint8."""


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


class VtkRenderer:
    """One plotter that draws frame after frame with one camera."""

    def __init__(self, size: tuple[int, int], camera: Camera, background: str, opacity: float) -> None:
        self._size, self._camera, self._opacity = size, camera, opacity
        self._ink = ink_on(background)
        drawn = (size[0] + 2 * _BORDER, size[1] + 2 * _BORDER)
        self._plotter = open_plotter(drawn, background)
        self._mapper = vtkOpenGLSphereMapper()
        self._mapper.SetScaleArray("radius")
        self._mapper.SetScalarModeToUsePointFieldData()
        self._mapper.SelectColorArray("colour")
        self._mapper.SetColorModeToDirectScalars()
        self._actor = pv.Actor()
        self._actor.SetMapper(self._mapper)
        light = self._actor.GetProperty()
        light.SetAmbient(0.3)
        light.SetDiffuse(0.8)
        light.SetSpecular(0.12)
        light.SetSpecularPower(20.0)
        self._plotter.add_actor(self._actor, reset_camera=False, render=False)
        self._shade_distance = 0.0
        aim(self._plotter, camera, drawn[1] / size[1])
        self._walls: dict[str, Surface] = {}

    def draw(self, balls: Balls, walls: list[Surface]) -> np.ndarray:
        """Pixels of one frame, shape (height, width, 3), uint8."""
        self._set_grains(balls)
        if not self._shade_distance and len(balls.radius):
            self._shade_distance = _SHADE_DISTANCE * float(np.median(balls.radius))
            self._plotter.enable_ssao(radius=self._shade_distance, bias=0.05 * self._shade_distance, kernel_size=64)  # type: ignore[call-arg]
        for name in self._walls.keys() - {wall.name for wall in walls}:
            self._remove(name)
        for wall in walls:
            self._draw_wall(wall)
        self._plotter.camera.clipping_range = self._depths(balls, walls)
        self._plotter.render()  # screenshot alone would give the pixels of the frame before
        fine = np.asarray(self._plotter.screenshot(return_img=True))[..., :3]
        cut = OVERSAMPLING * _BORDER
        return np.asarray(np.round(reduced(fine[cut:-cut, cut:-cut])).astype(np.uint8))

    def close(self) -> None:
        """Free what the plotter holds."""
        self._plotter.close()

    def _set_grains(self, balls: Balls) -> None:
        self._actor.SetVisibility(bool(len(balls.radius)))
        if not len(balls.radius):
            return
        shown = visible(balls.position, balls.radius, self._camera)
        # vtkOpenGLSphereMapper reads single precision only, it crashes on double
        grains = pv.PolyData(balls.position[shown].astype(np.float32))
        grains.point_data["radius"] = balls.radius[shown].astype(np.float32)
        grains.point_data["colour"] = balls.colour[shown]
        self._mapper.SetInputData(grains)

    def _depths(self, balls: Balls, walls: list[Surface]) -> tuple[float, float]:
        """Least and greatest distance from the camera of what is drawn [m]; VTK itself ignores the radii."""
        view = self._plotter.camera
        points = [balls.position, *(wall.vertices for wall in walls)]
        depth = (np.concatenate(points) - view.position) @ np.array(view.direction)
        border = float(balls.radius.max(initial=0.0)) + 1e-3 * float(np.ptp(depth)) if len(depth) else 0.0
        far = max(float(depth.max(initial=0.0)) + border, 1e-6)
        # a near plane at the eye would leave no digits for the depth
        return max(float(depth.min(initial=far)) - border, 1e-3 * far), far * (1.0 + 1e-6)

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
        mesh = pv.PolyData.from_regular_faces(wall.vertices, wall.triangles)
        if wall.colour is not None:
            (mesh.point_data if wall.at_corners else mesh.cell_data)["colour"] = wall.colour
        for normal, offset in wall.cuts:
            mesh = mesh.clip(normal=tuple(-normal), origin=tuple(offset * normal))
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

