"""warpdem: discrete element method for granular flow in rotating and moving equipment, on NVIDIA Warp.

scene = warpdem.load_demo("hourglass")                  # or warpdem.load_scene("own.toml")
sim = warpdem.Simulation(scene, device="cpu", threads=2)
sim.run(until=0.5)
sim.particles.position
warpdem.picture(sim)                                    # shown by a notebook
warpdem.render("hourglass/results", "film.mp4")         # of a run: warpdem demo hourglass
"""

from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

if find_spec("warpdem.kernels") is None:
    raise ImportError(
        f"{__path__[0]} is a folder of the checkout, which hides the installed package from Python here: "
        'go to another folder, or install the checkout with "pip install -e ."'
    )

from warpdem.errors import SceneError, StabilityError, WarpdemError

if TYPE_CHECKING:
    from warpdem import runs as runs
    from warpdem.app.demo import load_demo
    from warpdem.app.notebook import picture
    from warpdem.drawing.curves import plot
    from warpdem.drawing.rendering import render
    from warpdem.reports.write_report import report
    from warpdem.scene.file import load_scene
    from warpdem.scene.model import Scene
    from warpdem.simulation import Simulation

    __version__: str

__all__ = [
    "Scene",
    "SceneError",
    "Simulation",
    "StabilityError",
    "WarpdemError",
    "__version__",
    "load_demo",
    "load_scene",
    "picture",
    "plot",
    "render",
    "report",
]


LATER = {
    "Scene": "scene.model",
    "Simulation": "simulation",
    "load_demo": "app.demo",
    "load_scene": "scene.file",
    "picture": "app.notebook",
    "plot": "drawing.curves",
    "report": "reports.write_report",
    "render": "drawing.rendering",
}
"""Modules of names that are imported when first asked for: their libraries take a second or more.

Until then the command has begun, which answers Ctrl-C in its own words.
"""


def __getattr__(name: str) -> Any:
    """Import a name of ``LATER``, or look up the version."""
    if name == "__version__":
        from importlib.metadata import version

        globals()[name] = found = version("warpdem")
        return found
    if name == "runs":  # the module
        return import_module("warpdem.runs")
    if name not in LATER:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = thing = getattr(import_module(f"{__name__}.{LATER[name]}"), name)
    return thing


def __dir__() -> list[str]:
    """What the package holds, with what is not imported yet."""
    return sorted({*globals(), *__all__, "runs"})
