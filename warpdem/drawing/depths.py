"""How far away what a camera sees is: balls and surfaces, drawn without colours."""

import numpy as np
import pyvista as pv
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkFloatArray

from warpdem.drawing.balls import BallActor, Balls, set_depths
from warpdem.drawing.camera import Camera
from warpdem.drawing.plotter import aim, open_plotter


class DepthRenderer:
    """One plotter that gives depths, of as many pixels as ``open_plotter`` draws for a picture of ``size`` pixels."""

    def __init__(self, size: tuple[int, int]) -> None:
        self._plotter = open_plotter(size, "white")
        self._balls = BallActor(self._plotter)
        self._meshes = 0

    def depths(self, camera: Camera, wider: float, balls: Balls, meshes: list[pv.PolyData]) -> np.ndarray:
        """Distance along the line of sight of what each pixel shows [m], shape (h, w); infinite where that is nothing.

        Args:
            camera: The camera.
            wider: As of ``aim``.
            balls: Balls to draw.
            meshes: Surfaces to draw, none empty, from both sides.
        """
        aim(self._plotter, camera, wider)
        self._balls.set(balls, camera)
        for k in range(max(len(meshes), self._meshes)):
            if k < len(meshes):
                self._plotter.add_mesh(
                    meshes[k], color="white", name=f"mesh {k}", lighting=False, reset_camera=False, render=False
                )
            else:
                self._plotter.remove_actor(f"mesh {k}", reset_camera=False, render=False)  # type: ignore[arg-type]
        self._meshes = len(meshes)
        set_depths(self._plotter, balls, [np.asarray(mesh.points) for mesh in meshes])
        return self._read()

    def _read(self) -> np.ndarray:
        window, values = self._plotter.render_window, vtkFloatArray()
        assert window is not None
        window.SetMultiSamples(0)  # depths of several surfaces have no mean
        window.Render()  # Plotter.render draws nothing the first time
        width, height = window.GetSize()
        window.GetZbufferData(0, 0, width - 1, height - 1, values)
        buffer = vtk_to_numpy(values).reshape(height, width)[::-1].astype(float)
        near, far = self._plotter.camera.clipping_range
        if self._plotter.camera.parallel_projection:
            depth = near + buffer * (far - near)
        else:
            depth = near * far / (far - buffer * (far - near))
        return np.where(buffer < 1.0, depth, np.inf)

    def close(self) -> None:
        """Free what the plotter holds."""
        self._plotter.close()
