"""The standard tests: scenes that come with warpdem, and what is measured in each."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

from warpdem.core.nearest import nearest
from warpdem.errors import SceneError

STANDARD: dict[str, dict[str, str]] = {
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
