"""What ``check`` says of clumps."""

import numpy as np
import pytest

import warpdem
from warpdem.app.clump_rows import clump_lines, clump_rows


def test_a_dumbbell_is_described_by_its_numbers():
    spheres = [{"centre": [0, 0, z], "radius": 1e-3} for z in (0.0, 2e-3)]
    scene = warpdem.Scene.model_validate({
        "materials": {"stone": {"density": 2500.0, "young_modulus": 5e7, "poisson_ratio": 0.3}},
        "pairs": [{"materials": ["stone", "stone"], "restitution": 0.5}],
        "clumps": {"pair": {"spheres": spheres}, "spare": {"spheres": spheres}},
        "grains": [{"material": "stone", "clump": "pair", "positions": [[0, 0, 0]]}],
        "time": {"end": 1.0},
    })  # fmt: skip
    [row] = clump_rows(scene)  # no grain is of the other one
    ball = 2500.0 * 4.0 / 3.0 * np.pi * 1e-9
    assert row["mass"] == pytest.approx(2.0 * ball)
    assert row["moments"] == pytest.approx([2.8e-6 * ball, 2.8e-6 * ball, 0.8e-6 * ball])
    assert row["least_mass"] == pytest.approx(ball)  # its half; a force across the end of the arm meets 1.17 of it
    assert row["coverage"] is None
    [line] = clump_lines([row])
    assert line.startswith("clump pair of stone: 2 spheres of 0.001 to 0.001 m")
    assert "body of revolution" in line
    *_, fitted = clump_lines([row | {"coverage": 0.69, "mean_deviation": 1e-4, "deviation": 3e-4}])
    assert "covers 69 % of its mesh" in fitted
