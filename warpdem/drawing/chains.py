"""Force chains: a line for each contact, as wide as its normal force is large, over faded grains.

Radjai, Jean, Moreau and Roux, Force distributions in dense two-dimensional granular systems, Phys. Rev. Lett. 77 (1996).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pyvista as pv

from warpdem.drawing.camera import Camera
from warpdem.drawing.plotter import aim, open_plotter, reduced

WIDEST = 0.35
"""Half the width of the line of a force at the upper end of the scale bar, over the median radius of the grains [-]."""
FADED = 0.75
"""How much of the background covers grains and walls behind the lines [-]."""
THINNEST = 0.01
"""Forces over that at the upper end of the scale bar, below which no line is drawn: it would be too thin to be seen [-]."""
PULLING = (44, 111, 187)
"""Colour of a contact that pulls, as red, green, blue of 0 to 255."""
_SIDES = 12
"""Faces of the tube that is drawn as a line."""


@dataclass(frozen=True)
class Chains:
    """The lines to draw."""

    ends: np.ndarray
    """Both ends of each line in the axes of the view [m], shape (c, 2, 3)."""
    radius: np.ndarray
    """Half the width of each line [m], shape (c,)."""
    colour: np.ndarray
    """Red, green, blue of each line, of 0 to 255, shape (c, 3), uint8."""


def chains_of(ends: np.ndarray, force: np.ndarray, top: float, grain: float, colour: np.ndarray) -> Chains:
    """The lines of contacts; those of forces too small to be seen are left out.

    Args:
        ends: Both ends of each line in the axes of the view [m], shape (c, 2, 3).
        force: Normal forces [N], negative where a contact pulls, shape (c,).
        top: Force at the upper end of the scale bar [N], above 0.
        grain: Median radius of the grains [m].
        colour: Colours by the size of the force, shape (c, 3), uint8.
    """
    share = np.minimum(np.abs(force) / top, 1.0)
    seen = share >= THINNEST  # False for what is no number
    colours = np.where((force < 0.0)[:, None], np.array(PULLING, dtype=np.uint8), colour)
    return Chains(ends[seen], WIDEST * grain * share[seen], colours[seen])


class ChainRenderer:
    """Draws lines alone, to be laid over a picture: through grains and walls all of them are seen."""

    def __init__(self, size: tuple[int, int], camera: Camera, background: str) -> None:
        self._plotter, self._height = open_plotter(size, background), size[1]
        aim(self._plotter, camera, 1.0)

    def draw_over(self, image: np.ndarray, background: np.ndarray, chains: Chains) -> np.ndarray:
        """The image faded to the background, red, green, blue of 0 to 255, with the lines over it, shape (h, w, 3), uint8."""
        faded = FADED * background + (1.0 - FADED) * image
        if len(chains.radius):
            layer = self._drawn(chains)
            cover = layer[..., 3:] / 255.0
            faded = layer[..., :3] + (1.0 - cover) * faded
        return np.asarray(np.round(faded).astype(np.uint8))

    def close(self) -> None:
        """Free what the plotter holds."""
        self._plotter.close()

    def _drawn(self, chains: Chains) -> np.ndarray:
        """Red, green, blue, each times how much of the pixel is covered, and that, of 0 to 255, shape (h, w, 4)."""
        count = len(chains.radius)
        cells = np.column_stack([np.full(count, 2), np.arange(2 * count).reshape(-1, 2)])
        lines = pv.PolyData(chains.ends.reshape(-1, 3), lines=cells.ravel())
        lines.point_data["radius"] = np.repeat(chains.radius, 2)
        lines.point_data["colour"] = np.repeat(chains.colour, 2, axis=0)
        tubes = lines.tube(scalars="radius", absolute=True, n_sides=_SIDES)
        style: dict[str, Any] = {"reset_camera": False, "render": False, "show_scalar_bar": False}
        self._plotter.add_mesh(
            tubes, scalars="colour", rgb=True, name="chains", ambient=0.45, diffuse=0.6, specular=0.0, smooth_shading=True,
            **style,
        )  # fmt: skip
        self._plotter.renderer.ResetCameraClippingRange()
        self._plotter.render()
        fine = np.asarray(self._plotter.screenshot(return_img=True, transparent_background=True)).astype(float)
        fine[..., :3] *= fine[..., 3:] / 255.0
        return reduced(fine)
