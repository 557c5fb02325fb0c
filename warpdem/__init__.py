"""warpdem: discrete element method for granular flow in rotating and moving equipment, on NVIDIA Warp.

scene = warpdem.load_scene("scenes/hourglass.toml")
sim = warpdem.Simulation(scene, device="cpu", threads=2)
sim.run(until=0.5)
sim.particles.position
"""

from importlib.metadata import version

from warpdem.errors import SceneError, StabilityError, WarpdemError
from warpdem.scene import Scene
from warpdem.scene_file import load_scene
from warpdem.simulation import Simulation

__version__ = version("warpdem")

__all__ = ["Scene", "SceneError", "Simulation", "StabilityError", "WarpdemError", "__version__", "load_scene"]
