"""A plotter of VTK without a screen: how it is opened, aimed, and how its pixels become those of a picture."""

import ctypes.util

import numpy as np
import pyvista as pv
from matplotlib.colors import to_rgb

from warpdem.drawing.camera import Camera
from warpdem.errors import WarpdemError
from warpdem.output.vtk_files import quiet_vtk

OVERSAMPLING = 2
"""Pixels drawn for one of the picture, in both directions: smooth edges at a quarter of
the cost of VTK's own method without a GPU."""


def open_plotter(size: tuple[int, int], background: str) -> pv.Plotter:
    """Plotter without a screen, for a picture of ``size`` pixels: it draws more of them, see ``reduced``.

    Raises:
        WarpdemError: The machine has no OpenGL library at all, where VTK would crash.
    """
    with quiet_vtk():  # VTK reports at length that there is no screen before it draws without one
        plotter = pv.Plotter(off_screen=True, window_size=[OVERSAMPLING * pixels for pixels in size])
        window = plotter.render_window
        if window is not None and window.GetClassName() == "vtkOSOpenGLRenderWindow" and not ctypes.util.find_library("OSMesa"):
            plotter.close()
            raise WarpdemError(
                "pictures need an OpenGL library and none was found; on Debian or Ubuntu: apt install libegl1"
            )
        plotter.set_background(to_rgb(background))  # type: ignore[arg-type]
        return plotter


def aim(plotter: pv.Plotter, camera: Camera, wider: float) -> None:
    """Put the camera of a plotter where ``camera`` is, with an angle of view ``wider`` than that [-]."""
    view = plotter.camera
    view.position, view.focal_point, view.up = tuple(camera.position), tuple(camera.focus), tuple(camera.up)
    view.view_angle = 2.0 * np.degrees(np.arctan(wider * np.tan(np.radians(0.5 * camera.angle))))
    if camera.height is not None:
        view.enable_parallel_projection()  # type: ignore[no-untyped-call]
        view.parallel_scale = 0.5 * wider * camera.height


def reduced(fine: np.ndarray) -> np.ndarray:
    """Means over the pixels drawn for each pixel of the picture, shape (h, w, c), from (n h, n w, c)."""
    n = OVERSAMPLING
    height, width, channels = fine.shape
    return np.asarray(fine.reshape(height // n, n, width // n, n, channels).mean(axis=(1, 3)))
