"""What is to be run, fixed before the first step."""

from dataclasses import dataclass, replace

import numpy as np
import warp as wp

from warpdem.filling.initial_grains import InitialGrains
from warpdem.kernels import KernelSet
from warpdem.mesh.triangle_mesh import TriangleMesh
from warpdem.model.digests import Given
from warpdem.model.domain import Domain
from warpdem.model.exits import Exits
from warpdem.model.features import Features
from warpdem.model.liquid import Liquid
from warpdem.model.schedule import Schedule
from warpdem.model.time_step import Limits
from warpdem.model.walls import Walls
from warpdem.scene.model import Scene


@dataclass(frozen=True)
class Model:
    """A scene on a device with all that follows from it before the first step; built by ``model.prepare``."""

    given: Given
    """The scene as it was given, with its digests."""
    scene: Scene
    """The scene that is run: as given, or going on from the checkpoint that it starts from."""
    device: wp.Device
    """Where the arrays are and the kernels run."""
    meshes: dict[str, TriangleMesh]
    """Mesh walls by name."""
    domain: Domain
    """Borders and outlets."""
    exits: Exits
    """The regions of these in which grains leave, where they stand."""
    expected: InitialGrains
    """Grains at the start, and of each stream those that represent it: what limits and cutoffs are made for."""
    schedule: Schedule
    """Frame, gravity and wall motions against time."""
    features: Features
    """What is compiled and allocated, and what is left out."""
    limits: Limits
    """What bounds the time step."""
    dt: float
    """Time step [s]."""
    kernels: KernelSet
    """Kernels and array structs of the features."""
    density: np.ndarray
    """Density of each material [kg/m3], shape (materials,)."""
    coefficients: wp.array
    """Contact coefficients on the device: of each ordered pair of materials, or the one set that all contacts share."""
    coefficient_table: np.ndarray
    """The same on the host, shape (sets, columns)."""
    apart: wp.array
    """Whether two materials pass through each other, shape (materials, materials); of size 0 where all that meet touch."""
    liquid: Liquid | None
    """The liquid in counts; None without a law of bridges."""
    walls: Walls | None
    """Walls on the device; None without any."""
    notes: tuple[str, ...]
    """What of the scene's file was not taken, and what is odd or was mended in its meshes."""

    def at_present(self) -> "Model":
        """The same for a copy of the run that is read while it goes on: walls that move by the load on them stay there."""
        schedule = self.schedule.at_present()
        return self if schedule is self.schedule else replace(self, schedule=schedule)
