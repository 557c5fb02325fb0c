"""Grains as true balls: each is drawn as a square in which the graphics card finds the ball, with its depth."""

from dataclasses import dataclass

import numpy as np
import pyvista as pv
from vtkmodules.vtkRenderingOpenGL2 import vtkOpenGLSphereMapper

from warpdem.drawing.camera import Camera
from warpdem.drawing.visibility import visible


@dataclass(frozen=True)
class Balls:
    """The grains to draw."""

    position: np.ndarray
    """Centres in the axes of the view [m], shape (n, 3)."""
    radius: np.ndarray
    """Radii [m], shape (n,)."""
    colour: np.ndarray
    """Red, green, blue of 0 to 255, shape (n, 3), uint8."""


class BallActor:
    """The balls of one plotter."""

    def __init__(self, plotter: pv.Plotter) -> None:
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
        plotter.add_actor(self._actor, reset_camera=False, render=False)

    def set(self, balls: Balls, camera: Camera) -> None:
        """Show these balls; those that others hide from the camera are left out."""
        self._actor.SetVisibility(bool(len(balls.radius)))
        if not len(balls.radius):
            return
        shown = visible(balls.position, balls.radius, camera)
        # vtkOpenGLSphereMapper reads single precision only, it crashes on double
        grains = pv.PolyData(balls.position[shown].astype(np.float32))
        grains.point_data["radius"] = balls.radius[shown].astype(np.float32)
        grains.point_data["colour"] = balls.colour[shown]
        self._mapper.SetInputData(grains)


def set_depths(plotter: pv.Plotter, balls: Balls, points: list[np.ndarray]) -> None:
    """Set the least and the greatest distance of what a plotter draws: balls, and ``points`` [m], each of shape (n, 3).

    VTK itself ignores the radii.
    """
    view = plotter.camera
    depth = (np.concatenate([balls.position, *points]) - view.position) @ np.array(view.direction)
    border = float(balls.radius.max(initial=0.0)) + 1e-3 * float(np.ptp(depth)) if len(depth) else 0.0
    far = max(float(depth.max(initial=0.0)) + border, 1e-6)
    # a near plane at the eye would leave no digits for the depth
    view.clipping_range = max(float(depth.min(initial=far)) - border, 1e-3 * far), far * (1.0 + 1e-6)
