"""What the figures of the paper share: their scenes, the names of the schemes, and how pictures are written."""

import io
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")  # no screen
import numpy as np
from matplotlib import pyplot as plt
from matplotlib.figure import Figure
from PIL import Image

import warpdem
from warpdem.scene.file import scene_from_dict

SCENES = Path(__file__).resolve().parents[2] / "scenes" / "paper"
COLOURS = 96  # of a picture's palette: small files, and lines still smooth

SCHEMES = {
    "explicit_euler": "explicit Euler",
    "rk2": "RK2",
    "rk4": "RK4",
    "velocity_verlet": "velocity Verlet",
    "modified_verlet": "modified velocity Verlet",
    "scovel": "Scovel",
    "lobatto": "Lobatto IIIA-IIIB",
    "exact_drift": "exact drift",
}
"""Integrators of the scene file and their names in pictures; exact drift is warpdem's default."""

STYLES = {
    name: {"color": f"C{k}", "marker": marker} for k, (name, marker) in enumerate(zip(SCHEMES, "osD^v<>*", strict=True))
}


def simulation(name: str, step: float | None = None, scheme: str | None = None, overrides: Sequence[str] = ()):
    """Simulation of ``scenes/paper/NAME.toml`` on one thread, with another time step [s] or integrator if given."""
    changes = [*overrides]
    changes += [] if step is None else [f"time.step={step!r}"]
    changes += [] if scheme is None else [f"engine.integrator={scheme}"]
    return warpdem.Simulation(warpdem.load_scene(SCENES / f"{name}.toml", changes), device="cpu", threads=1)


def tables(path: Path) -> dict[str, Any]:
    """The tables of a scene file."""
    return tomllib.loads(path.read_text())


def in_laboratory(scene: dict[str, Any]) -> dict[str, Any]:
    """The same scene without a moving frame: its motion becomes that of every wall.

    Grains that were given relative to the frame must be given relative to the laboratory first.
    """
    walls = [{**wall, "motion": scene["frame"]} for wall in scene["walls"]]
    return {**{key: value for key, value in scene.items() if key != "frame"}, "walls": walls}


def scene_of(scene: dict[str, Any], folder: Path, source: str) -> warpdem.Scene:
    """The scene of tables whose relative paths start from ``folder``."""
    return scene_from_dict(scene, folder, source)


def seen_every(sim: warpdem.Simulation, count: int, end: float) -> np.ndarray:
    """Numbers of about ``count`` steps from the first to that of ``end`` [s], evenly apart, shape (k,)."""
    last = sim.steps_until(end)
    return np.unique(np.linspace(0, last, min(count, last) + 1).round().astype(int))


def save(figure: Figure, path: Path) -> None:
    """Write a figure as PNG with a palette, and close it."""
    raw = io.BytesIO()
    figure.savefig(raw, format="png", dpi=90)
    plt.close(figure)
    picture = Image.open(raw).convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE)
    path.parent.mkdir(parents=True, exist_ok=True)
    picture.save(path, optimize=True)
