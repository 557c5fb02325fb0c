"""Size of a mesh compared with that of the grains, which reveals a file in other units."""

import numpy as np
import numpy.typing as npt

from warpdem.errors import SceneError

LARGEST_MESH = 20_000.0
"""Largest size of a mesh in mean grain diameters [-]: more grains side by side do not fit into any computer."""
SMALLEST_MESH = 0.2
"""Smallest size of a mesh in mean grain diameters [-]: a thinner needle is no wall for such grains."""
USUAL_MESH = (3.0, 1000.0)
"""Range of sizes in mean grain diameters [-] outside which a warning is given."""


def size_warning(name: str, bounds: np.ndarray, diameters: npt.ArrayLike, key: str) -> str | None:
    """Warning if the size of a mesh is unusual for its grains, as when millimetres are read as metres; None if it is not.

    Args:
        name: File of the mesh.
        bounds: Its least and greatest corner [m], shape (2, 3).
        diameters: Grain diameters [m], any shape.
        key: Scene key of the mesh, for messages.

    Raises:
        SceneError: The mesh is more than `LARGEST_MESH` or less than `SMALLEST_MESH` mean grain diameters large.
    """
    diameter = float(np.mean(np.asarray(diameters)))
    size = float((bounds[1] - bounds[0]).max())
    ratio = size / diameter
    low, high = USUAL_MESH
    if low <= ratio <= high:
        return None
    factor, unit = (0.001, "millimetres") if ratio > high else (1000.0, "kilometres, or was it scaled twice")
    advice = "check the scale of the mesh, and the unit of the grains' diameters (a number without one is in metres)"
    if low <= ratio * factor <= high:
        grains = "are the grains' diameters in the wrong unit"
        if ratio < low:
            grains = f"do the grains' diameters lack their unit, as in \"{1000.0 * diameter / factor:.6g} mm\""
        advice = (
            f"is the file in {unit}? Then multiply its scale by {factor:g} (scale = {factor:g} if it had none). "
            f"Or {grains}? A number without a unit is in metres"
        )
    text = (
        f"{key}: {name}: the mesh is {size:.6g} m large and the grains are {diameter:.6g} m in diameter: "
        f"{float(f'{ratio:.3g}'):g} diameters"
    )
    if SMALLEST_MESH <= ratio <= LARGEST_MESH:
        return f"{text}, usual are {low:g} to {high:g}; {advice}"
    raise SceneError(f"{text}, allowed {SMALLEST_MESH:g} to {LARGEST_MESH:g}; {advice}")
