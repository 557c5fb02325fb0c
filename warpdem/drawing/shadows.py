"""Shadows: what a light does not reach is darkened in the finished picture.

Pixels whose depths the camera gives are points in space; each is compared with the depths around it that a camera in the place
of the light gives. Williams, Casting curved shadows on curved surfaces, SIGGRAPH 1978; Reeves, Salesin and Cook, Rendering
antialiased shadows with depth maps, SIGGRAPH 1987.
"""

import numpy as np
import pyvista as pv

from warpdem.drawing.balls import Balls
from warpdem.drawing.camera import Camera
from warpdem.drawing.depths import DepthRenderer
from warpdem.drawing.plotter import OVERSAMPLING

ELEVATION, AZIMUTH = 38.0, 35.0
"""Where the light is, as seen from the middle of the picture: above and to the right of the camera [degree]."""
DARKEST = 0.45
"""How much a full shadow takes of the brightness [-]."""
SOFT = 0.3
"""Half the width of the edge of a shadow, in median radii [-]."""
NEAREST, FULL = 0.15, 0.5
"""How far before a point something must be to begin to darken it, and to darken it in full, in median radii [-]: a ball's own
surface is beside it."""
_SAMPLES = 32
"""Depths that each pixel is compared with."""
_PER_RADIUS = 10.0
_PIXELS = 512, 4096
"""Pixels of the light's camera in a median radius, and on a side: at least and at most."""


class Shadows:
    """Shadows in the pictures of one camera."""

    def __init__(self, size: tuple[int, int], camera: Camera, wider: float) -> None:
        self._camera, self._wider = camera, wider
        self._seen = DepthRenderer(size)
        self._lit: DepthRenderer | None = None
        right, up, forward = camera.axes
        high, aside = np.radians(ELEVATION), np.radians(AZIMUTH)
        self._towards = np.cos(high) * (np.sin(aside) * right - np.cos(aside) * forward) + np.sin(high) * up

    def brightness(self, balls: Balls, opaque: list[pv.PolyData], planes: list[pv.PolyData]) -> np.ndarray:
        """What is left of the brightness of each pixel drawn, from 1 - ``DARKEST`` to 1, shape (h, w).

        Args:
            balls: Balls; they and ``opaque`` cast shadows.
            opaque: Surfaces.
            planes: Flat surfaces wound about the direction of the grains; shadows fall on those that are not seen from behind.
        """
        faced = [plane for plane in planes if self._faces(plane)]
        depth = self._seen.depths(self._camera, self._wider, balls, [*opaque, *faced])
        bright = np.ones(depth.shape)
        shown = np.isfinite(depth)
        if len(balls.radius) and shown.any():
            radius = float(np.median(balls.radius))
            bright[shown] -= DARKEST * self._shadow(self._points(depth, shown), radius, balls, opaque)
        return bright

    def close(self) -> None:
        """Free what the plotters hold."""
        self._seen.close()
        if self._lit is not None:
            self._lit.close()

    def _faces(self, plane: pv.PolyData) -> bool:
        camera, a = self._camera, plane.points[0]
        sight = a - camera.position if camera.height is None else camera.axes[2]
        return bool(sight @ plane.face_normals[0] < 0.0)

    def _points(self, depth: np.ndarray, shown: np.ndarray) -> np.ndarray:
        """What the pixels of an image show, those that show something [m], shape (n, 3)."""
        camera, (height, width) = self._camera, depth.shape
        row, column = np.nonzero(shown)
        away = depth[shown]
        tall = 2.0 * away * np.tan(np.radians(0.5 * camera.angle)) if camera.height is None else camera.height
        pixel = self._wider * tall / height
        x, y = (column + 0.5 - 0.5 * width) * pixel, (0.5 * height - 0.5 - row) * pixel
        return np.asarray(camera.position + np.stack([x, y, away], axis=-1) @ camera.axes)

    def _shadow(self, points: np.ndarray, radius: float, balls: Balls, opaque: list[pv.PolyData]) -> np.ndarray:
        """How much of the light something keeps from points, from 0 to 1, shape (n,)."""
        casters = np.concatenate([balls.position, *(mesh.points for mesh in opaque)])
        largest = float(balls.radius.max())
        up = np.eye(3)[np.argmin(np.abs(self._towards))]
        middle = 0.5 * (casters.min(axis=0) + casters.max(axis=0))
        far = float(np.linalg.norm(np.ptp(casters, axis=0))) + 2.0 * largest
        light = Camera(middle + far * self._towards, middle, up, 0.0, None)
        across = (casters - light.position) @ light.axes.T
        extent = 2.0 * float(np.abs(across[:, :2]).max()) + 2.0 * largest + 4.0 * SOFT * radius
        light = Camera(light.position, middle, up, 0.0, extent)
        if self._lit is None:
            pixels = int(np.clip(extent / radius * _PER_RADIUS, *_PIXELS)) // OVERSAMPLING
            self._lit = DepthRenderer((pixels, pixels))
        depth = self._lit.depths(light, 1.0, balls, opaque)
        pixel = extent / len(depth)
        seen = (points - light.position) @ light.axes.T
        column, row = seen[:, 0] / pixel + 0.5 * len(depth), 0.5 * len(depth) - seen[:, 1] / pixel
        soft = max(SOFT * radius / pixel, 1.0)
        shadow = np.zeros(len(points))
        for k in range(_SAMPLES):
            # points of a disk, equally dense (Vogel, A better way to construct the sunflower head, 1979)
            turn, away = 2.399963 * k, soft * np.sqrt((k + 0.5) / _SAMPLES)
            i = np.clip(row + away * np.sin(turn), 0, len(depth) - 1).astype(int)
            j = np.clip(column + away * np.cos(turn), 0, len(depth) - 1).astype(int)
            before = (seen[:, 2] - depth[i, j]) / radius
            shadow += np.clip((before - NEAREST) / (FULL - NEAREST), 0.0, 1.0)
        return shadow / _SAMPLES
