"""The standard tests: scenes that come with warpdem, and what is measured in each."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

from warpdem.core.nearest import nearest
from warpdem.errors import SceneError

STANDARD: dict[str, dict[str, str]] = {
    "heap_test": {"angle": "frame.cone_angle", "height": "frame.height"},
    "drum_test": {
        "angle": "angle(product(-1, centre_x:mean@1:), product(-1, centre_z:mean@1:))",
        "torque": "size(drum torque y:mean@1:)",
    },
    "hopper_test": {"rate": "outlet hole mass:rate@0.15:0.35"},
    "shear_cell": {
        "friction": "size(ratio(lid force x:mean@0.5:, lid force z:mean@0.5:))",
        "angle": "angle(size(lid force x:mean@0.5:), size(lid force z:mean@0.5:))",
        "stress": "lid pressure:mean@0.5:",
    },
    "tumbled_test": {"density": "product(2500, region core solid_fraction:mean@1.2:)"},
}
"""Measures of each standard test by their names, as quantities."""


def standard_scene(test: str) -> Path:
    """The scene file of a standard test.

    Raises:
        SceneError: there is no such test.
    """
    if test not in STANDARD:
        hint = nearest(test, list(STANDARD)) or f"; there are {', '.join(STANDARD)}"
        raise SceneError(f"test = {test!r}: there is no such standard test{hint}")
    return Path(str(resources.files("warpdem.scenes"))) / f"{test}.toml"


def standard_text(test: str | None, measure: str) -> str:
    """The quantity that a measure of a standard test is; any other text as it is."""
    return STANDARD.get(test or "", {}).get(measure, measure)
