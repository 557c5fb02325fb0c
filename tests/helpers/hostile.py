"""Scenes that must be refused in a message, in bounded memory."""

from pathlib import Path

import psutil
import pytest

from warpdem import SceneError, Simulation, load_scene

HEAD = """
materials.g = { density = 2500, young_modulus = "10 MPa", poisson_ratio = 0.3 }
pairs = [ { materials = ["g", "g"], restitution = 0.5 } ]
time = { end = 1e-4, step = "1 us" }
"""
GRAIN = 'grains = [ { material = "g", radius = "1 mm", positions = [[0, 0, 0.01]] } ]\n'
GROWTH = 400e6
"""Memory that refusing a file may take [B]: libraries that are loaded for it."""


def refused(folder: Path, text: str | bytes, *overrides: str) -> str:
    """What is said of a scene that must not be set up."""
    file = folder / "scene.toml"
    file.write_bytes(text.encode() if isinstance(text, str) else text)
    before = psutil.Process().memory_info().rss
    with pytest.raises(SceneError) as error:
        Simulation(load_scene(file, overrides), device="cpu", threads=1)
    assert psutil.Process().memory_info().rss - before < GROWTH
    assert error.value.exit_code == 2
    assert "scene.toml" in str(error.value)
    return str(error.value)


VTP = (
    '<?xml version="1.0"?><VTKFile type="PolyData"><PolyData><Piece NumberOfPoints="{}"><PointData><DataArray type="Float64" '
    'Name="radius" format="ascii" NumberOfTuples="{}">1e-3</DataArray></PointData><Points><DataArray type="Float64" '
    'NumberOfComponents="3" format="ascii">0 0 {}</DataArray></Points></Piece></PolyData></VTKFile>'
)
"""A file of one grain: points and values that it claims to hold, height of the grain."""
