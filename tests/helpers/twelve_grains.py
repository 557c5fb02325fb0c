"""A short run with its outputs: twelve grains that fall on a floor and roll."""

import csv
import io

import numpy as np
from rich.console import Console

from warpdem import Scene
from warpdem.app.run import run_scene

GLASS = {"density": 2500, "young_modulus": 1e7, "poisson_ratio": 0.3}


def scene(**changes) -> Scene:
    """Twelve grains that fall on a floor and roll."""
    rng = np.random.default_rng(12)
    cell = np.stack(np.meshgrid(np.arange(2), np.arange(2), np.arange(3), indexing="ij"), axis=-1).reshape(-1, 3)
    data = {
        "title": "twelve grains",
        "gravity": [0, 0, -60],
        "materials": {"glass": GLASS},
        "contact": {"rolling": "constant"},
        "pairs": [{"materials": ["glass", "glass"], "restitution": 0.6, "friction": 0.5, "rolling_friction": 0.1}],
        "grains": [
            {
                "material": "glass",
                "positions": cell * 2.05e-3 + [0, 0, 1.1e-3],
                "radius": 1e-3,
                "velocities": rng.normal(0, 0.05, (12, 3)),
            }
        ],
        "walls": [{"name": "floor", "material": "glass", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}],
        "time": {"end": 6e-3, "step": 1e-5, "max_speed": 1},
        "output": {"interval": 2e-3, "formats": [], "picture": False},
        "engine": {"max_overlap": 0.3},
    }
    return Scene.model_validate(data | changes)


def run(of: Scene, folder, **keys):
    text = io.StringIO()
    sim = run_scene(of, folder, device="cpu", threads=1, console=Console(file=text, width=200), **keys)
    return sim, text.getvalue()


def history(folder) -> tuple[list[str], np.ndarray]:
    with (folder / "history.csv").open(newline="") as file:
        header, *rows = list(csv.reader(file))
    return header, np.array(rows, dtype=float)


OFTEN = {"interval": 2e-3, "formats": [], "picture": False, "checkpoint_interval": 2e-4}
