"""A ruler: a bar of a round length, as on a map."""

from dataclasses import dataclass

import numpy as np

from warpdem.drawing.camera import Camera

LONGEST = 0.25
"""Length of a bar over the width of its pane, at most [-]."""
_UNITS = (("km", 1e3), ("m", 1.0), ("mm", 1e-3), ("µm", 1e-6), ("nm", 1e-9))


@dataclass(frozen=True)
class Ruler:
    """A bar and what is written beside it."""

    pixels: float
    """Length in the picture [pixel]."""
    words: str
    """Length with its unit."""


def ruler_of(camera: Camera, width: float, height: float) -> Ruler:
    """The longest bar of 1, 2 or 5 times a power of ten that takes at most ``LONGEST`` of a pane.

    In a perspective view things at the depth of the focus have this scale; nearer ones are larger.

    Args:
        camera: Camera of the pane.
        width: Width of the pane [pixel].
        height: Height of the pane [pixel].
    """
    metres = camera.height
    if metres is None:
        distance = np.linalg.norm(camera.focus - camera.position)
        metres = 2.0 * float(distance) * float(np.tan(np.radians(0.5 * camera.angle)))
    most = LONGEST * width * metres / height
    power = int(np.floor(np.log10(most)))
    length = max(
        digit * 10.0**k for k in (power - 1, power) for digit in (1, 2, 5) if digit * 10.0**k <= most * (1.0 + 1e-9)
    )
    unit, size = next(((u, s) for u, s in _UNITS if length >= s * (1.0 - 1e-9)), _UNITS[-1])
    return Ruler(length * height / metres, f"{length / size:.3g} {unit}")
