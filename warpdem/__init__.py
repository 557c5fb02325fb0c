"""warpdem: discrete element method for granular flow in rotating and moving equipment, on NVIDIA Warp.

scene = warpdem.load_scene("scenes/hourglass.toml")
sim = warpdem.Simulation(scene, device="cpu", threads=2)
sim.run(until=0.5)
sim.particles.position
warpdem.picture(sim)                                    # shown by a notebook
warpdem.render("out/hourglass", "film.mp4")             # results in a folder
"""

from importlib.metadata import version

from warpdem.errors import SceneError, StabilityError, WarpdemError
from warpdem.scene.file import load_scene
from warpdem.scene.model import Scene
from warpdem.simulation import Simulation

__version__ = version("warpdem")

__all__ = [
    "Scene",
    "SceneError",
    "Simulation",
    "StabilityError",
    "WarpdemError",
    "__version__",
    "load_scene",
    "picture",
    "render",
]


def __getattr__(name: str):
    """Import what draws when it is first asked for: its libraries take seconds to load."""
    if name == "render":
        from warpdem.drawing.rendering import render

        return render
    if name == "picture":
        from warpdem.notebook import picture

        return picture
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
