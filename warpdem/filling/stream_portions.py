"""What the portions of a stream insert: grains, or whole clumps; what is drawn of the next one, its mass and its members."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from warpdem.core.rigid_motion import quaternion_rotation_increment
from warpdem.filling.clump_grains import InitialClumps, no_clumps, placed
from warpdem.filling.clump_template import ClumpTemplate, clump_templates
from warpdem.scene.model import Scene
from warpdem.scene.size_distribution import SizeLaw
from warpdem.scene.streams import Portion, Stream
from warpdem.usd.motion import multiply_quaternions, quaternion_of

Drawn = Any
"""Of the next grain: its diameter [m]; of the next clump the quaternion (w, x, y, z) from its axes to those of the region."""
Members = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
"""Positions [m], radii [m], velocities [m/s] and spins [rad/s] of grains."""


@dataclass(frozen=True)
class Spheres:
    """Grains that are their own bodies; ``ClumpBodies`` has the same methods."""

    sizes: SizeLaw
    """Of their diameters."""
    density: float
    """Of their material [kg/m3]."""
    members = 1
    """Grains of each body."""

    @property
    def extremes(self) -> tuple[float, float]:
        """Diameter of the smallest and the largest, of a clump that of the sphere about its centre that holds it [m]."""
        return self.sizes.extremes

    @property
    def narrowest(self) -> float:
        """Radius of the smallest grain [m]."""
        return 0.5 * self.sizes.extremes[0]

    @property
    def mean_mass(self) -> float:
        """Mean mass of a body [kg]."""
        return self.density * self.sizes.mean_volume

    def draw(self, generator: np.random.Generator) -> Drawn:
        """What is drawn of the next body, as JSON."""
        return float(self.sizes.draw(generator, 1)[0])

    def mass(self, drawn: Drawn) -> float:
        """Mass of a body [kg]."""
        return float(self.density * 4.0 / 3.0 * np.pi * (0.5 * drawn) ** 3)

    def reach(self, drawn: Drawn) -> float:
        """Radius of the sphere about its centre that holds it [m]."""
        return 0.5 * float(drawn)

    def grains(self, drawn: Drawn, center: np.ndarray, axes: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
        """Centers (k, 3) [m] and radii (k,) [m] of the grains of a body.

        Args:
            drawn: of ``draw``.
            center: in frame axes [m], shape (3,).
            axes: of the region in frame axes, shape (3, 3); None where they are those of the frame.
        """
        return center[None], np.array([0.5 * drawn])

    def moving(
        self, drawn: list[Drawn], center: np.ndarray, velocity: np.ndarray, spin: np.ndarray, axes: np.ndarray | None
    ) -> tuple[InitialClumps, Members]:
        """The bodies as clumps, and their grains, for centers (n, 3) [m], their velocities [m/s] and spins [rad/s]."""
        return no_clumps(len(center)), (center, 0.5 * np.array(drawn), velocity, spin)


@dataclass(frozen=True)
class ClumpBodies:
    """Clumps of one template and size."""

    template: ClumpTemplate
    number: int
    """Of the template in the scene."""
    size: float
    """Factor on its lengths [-]."""
    turn: tuple[float, float, float, float] | None
    """Quaternion (w, x, y, z), of any length, from its axes to those of the region; None: drawn, all directions alike."""
    density: float
    """Of their material [kg/m3]."""

    @property
    def members(self) -> int:
        """As of ``Spheres``, and so the others."""
        return len(self.template.radius)

    @cached_property
    def extremes(self) -> tuple[float, float]:
        """As there."""
        reach = self.reach(None)
        return 2.0 * reach, 2.0 * reach

    @property
    def narrowest(self) -> float:
        """As there."""
        return self.size * float(self.template.radius.min())

    @property
    def mean_mass(self) -> float:
        """As there."""
        return self.mass(None)

    def draw(self, generator: np.random.Generator) -> Drawn:
        """As there."""
        turn = np.array(self.turn) if self.turn is not None else generator.normal(size=4)
        return (turn / np.linalg.norm(turn)).tolist()

    def mass(self, drawn: Drawn) -> float:
        """As there."""
        return self.template.mass_at(self.density) * self.size**3

    def reach(self, drawn: Drawn) -> float:
        """As there."""
        return self.size * float((np.linalg.norm(self.template.arm, axis=1) + self.template.radius).max())

    def grains(self, drawn: Drawn, center: np.ndarray, axes: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
        """As there."""
        turn = multiply_quaternions(np.array(drawn)[None], self.template.axes[None])
        turned = (np.eye(3) + quaternion_rotation_increment(turn)[0]).astype(float)
        turned = turned if axes is None else axes @ turned
        return center + self.size * self.template.arm @ turned.T, self.size * self.template.radius

    def moving(
        self, drawn: list[Drawn], center: np.ndarray, velocity: np.ndarray, spin: np.ndarray, axes: np.ndarray | None
    ) -> tuple[InitialClumps, Members]:
        """As there."""
        turn = np.array(drawn)
        if axes is not None:
            turn = multiply_quaternions(quaternion_of(axes)[None], turn)
        size = np.full(len(center), self.size)
        return placed(self.template, self.number, self.density, center, velocity, spin, turn.astype(float), size)


PortionBodies = Spheres | ClumpBodies


def portions_of(scene: Scene, stream: Stream) -> list[PortionBodies]:
    """What each portion of a stream inserts.

    Raises:
        SceneError: A file of a clump is missing or wrong.
    """
    clumps = any(portion.clump is not None for portion in stream.portions)
    templates = clump_templates(scene) if clumps else {}
    return [_bodies(scene, portion, templates) for portion in stream.portions]


def _bodies(scene: Scene, portion: Portion, templates: dict[str, ClumpTemplate]) -> PortionBodies:
    density = scene.materials[portion.material].density
    if portion.clump is None:
        return Spheres(portion.sizes, density)
    turn = {"random": None, "aligned": (1.0, 0.0, 0.0, 0.0)}
    given = portion.orientation if portion.orientation is not None else "random"
    return ClumpBodies(
        template=templates[portion.clump], number=list(templates).index(portion.clump), size=portion.size or 1.0,
        turn=turn[given] if isinstance(given, str) else given, density=density,
    )  # fmt: skip


def extremes_of(bodies: list[PortionBodies]) -> tuple[float, float]:
    """Smallest and largest diameter that the portions of a stream bring [m]."""
    return min(one.extremes[0] for one in bodies), max(one.extremes[1] for one in bodies)


def extreme_bodies(bodies: PortionBodies, center: np.ndarray, velocity: np.ndarray) -> tuple[InitialClumps, Members]:
    """The smallest and the largest of a portion (a clump once), at rest but for ``velocity`` [m/s], shape (3,)."""
    generator = np.random.default_rng(0)
    drawn = [bodies.draw(generator)] if isinstance(bodies, ClumpBodies) else list(bodies.extremes)
    rows = np.ones((len(drawn), 1))
    return bodies.moving(drawn, rows * center, rows * velocity, 0.0 * rows * center, None)
