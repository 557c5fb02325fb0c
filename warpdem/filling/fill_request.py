"""The grains that a filling asks for: sizes drawn from its distribution, and what cannot fit refused at once."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warpdem.core import memory
from warpdem.errors import SceneError
from warpdem.filling.clump_template import ClumpTemplate
from warpdem.filling.fill_region import FillRegion
from warpdem.filling.placed_walls import PlacedWall
from warpdem.filling.rigid_moves import ClumpsToPlace
from warpdem.scene.size_distribution import SizeLaw
from warpdem.usd.motion import multiply_quaternions

DENSEST = 0.74
"""Solid fraction of the densest packing of equal spheres [-]; more is refused at once."""
HEIGHT_FRACTION = 0.55
"""Solid fraction of a filling of which only the height is given [-]: a poured bed, walls included, hardly settles."""
PACKING_BYTES = 350
"""Memory that packing takes at least per grain [B]; measured with 373 000 loose grains: 359, and 408 for moments."""


@dataclass(frozen=True, eq=False)
class Filling:
    """Grains that are to be placed in a region."""

    region: FillRegion
    radius: np.ndarray
    """Radii [m], shape (n,), in the order in which they were drawn."""
    generator: np.random.Generator
    """Random numbers of the positions; sizes come from a stream of their own."""
    key: str
    """Scene key, for messages."""
    walls: tuple[PlacedWall, ...] = ()
    """Walls that may come near them, beside the mesh of the region."""
    clumps: ClumpsToPlace | None = None
    """Clumps that the grains are members of; None where they are grains of their own."""

    @property
    def solid_fraction(self) -> float:
        """Volume of the grains over volume of the region [-]."""
        if self.clumps is not None:
            return self.clumps.volume / self.region.volume
        return float((self.radius**3).sum()) * 4.0 / 3.0 * np.pi / self.region.volume


def filling(
    space: FillRegion,
    sizes: SizeLaw,
    seed: int,
    count: int | None = None,
    solid_fraction: float | None = None,
    volume: float | None = None,
    key: str = "fill",
    walls: Sequence[PlacedWall] = (),
) -> Filling:
    """Draw the sizes of the grains of a filling.

    Sizes have their own stream of random numbers: the same seed gives the same sizes in any region.

    Args:
        space: Where the grains go.
        sizes: Size law.
        seed: Seed of the random numbers.
        count: Number of grains; exactly one of ``count``, ``solid_fraction`` and ``volume`` is given.
        solid_fraction: Volume of the grains over volume of the region [-].
        volume: Volume of the grains [m3].
        key: Scene key, for messages.
        walls: Walls to keep clear of, beside the mesh of the region.

    Raises:
        SceneError: Less than half a grain, or a solid fraction above that of the densest packing.
    """
    if sum(amount is not None for amount in (count, solid_fraction, volume)) != 1:
        raise SceneError(f"{key}: give exactly one of count, solid_fraction and volume")
    generator = np.random.default_rng(seed)
    positions = generator.spawn(1)[0]
    wanted = volume if volume is not None else (solid_fraction or 0.0) * space.volume
    number = count if count is not None else wanted / sizes.mean_volume
    if reason := memory.refusal(number * PACKING_BYTES, f"packing {number:.6g} grains", "ask for fewer or larger grains"):
        _refuse_too_dense(number, number * sizes.mean_volume / space.volume, space, key)
        raise SceneError(f"{key}: {reason}")
    if count is not None:
        diameter = sizes.draw(generator, int(count))
    else:
        _refuse_too_dense(wanted / sizes.mean_volume, wanted / space.volume, space, key)
        diameter = sizes.draw_volume(generator, wanted)
        if len(diameter) == 0:
            raise SceneError(
                f"{key}: {wanted:.6g} m3 of grains (solid fraction {wanted / space.volume:.3g} of {space.volume:.6g} m3) "
                f"is less than half a grain of {sizes.draw(np.random.default_rng(seed), 1)[0]:.6g} m"
            )
    largest = 0.5 * float(diameter.max())
    request = Filling(space, 0.5 * diameter, positions, key, tuple(w for w in walls if w.is_near(space.bounds, largest)))
    _refuse_too_dense(len(diameter), request.solid_fraction, space, key)
    return request


def clump_filling(
    space: FillRegion,
    template: ClumpTemplate,
    sizes: SizeLaw,
    seed: int,
    *,
    orientation: Sequence[float] | None,
    count: int | None = None,
    solid_fraction: float | None = None,
    mass: float | None = None,
    density: float,
    key: str = "fill",
    walls: Sequence[PlacedWall] = (),
) -> Filling:
    """The clumps of a filling.

    Args:
        space: Where they go.
        template: The clump.
        sizes: Distribution of the factor on its lengths [-], in place of a diameter.
        seed: Seed of the random numbers.
        orientation: Quaternion (w, x, y, z) from the axes of the clump to the frame axes, of any length; None: each is turned
            at random, all directions alike.
        count: Number of clumps; exactly one of ``count``, ``solid_fraction`` and ``mass`` is given.
        solid_fraction: Volume of the clumps over volume of the region [-].
        mass: Of all clumps [kg].
        density: Of their material [kg/m3].
        key: Scene key, for messages.
        walls: Walls to keep clear of, beside the mesh of the region.

    Raises:
        SceneError: Less than half a clump, or more than the region can hold.
    """
    generator = np.random.default_rng(seed)
    positions, of_sizes = generator.spawn(2)
    cube = 6.0 / np.pi * sizes.mean_volume  # mean of the third power of the factor
    at_1 = (solid_fraction or 0.0) * space.volume / template.volume if mass is None else mass / template.mass_at(density)
    wanted = at_1 / cube if count is None else count
    members = wanted * len(template.radius)
    if reason := memory.refusal(members * PACKING_BYTES, f"packing {members:.0f} members of clumps", "ask for fewer clumps"):
        raise SceneError(f"{key}: {reason}")
    size = sizes.draw(of_sizes, count) if count is not None else sizes.draw_volume(of_sizes, np.pi / 6.0 * at_1)
    number, volume = len(size), template.volume * float((size**3).sum())
    if number < 1:
        raise SceneError(f"{key}: what is asked for is {wanted:.3g} clumps of {template.name!r}, less than half of one")
    _refuse_too_dense(number, volume / space.volume, space, key, what="clumps")
    turn = generator.normal(size=(number, 4)) if orientation is None else np.tile(np.asarray(orientation, float), (number, 1))
    turn /= np.linalg.norm(turn, axis=1)[:, None]  # all rotations alike, or the given one
    turn = multiply_quaternions(turn, template.axes[None])
    radius = (size[:, None] * template.radius).ravel()
    reach = size * float((np.linalg.norm(template.arm, axis=1) + template.radius).max())
    clumps = ClumpsToPlace(
        of=np.repeat(np.arange(number), len(template.radius)), arm=(size[:, None, None] * template.arm).reshape(-1, 3),
        turn=turn, size=size, reach=reach, volume=volume,
    )  # fmt: skip
    near = tuple(wall for wall in walls if wall.is_near(space.bounds, float(radius.max())))
    return Filling(space, radius, positions, key, near, clumps)


def _refuse_too_dense(count: float, fraction: float, space: FillRegion, key: str, what: str = "grains") -> None:
    if fraction > DENSEST:
        raise SceneError(
            f"{key}: asked for {count:.0f} {what} in {space.volume:.6g} m3, a solid fraction of {fraction:.3g}; "
            f"allowed is at most {DENSEST} (the densest packing of equal spheres), within reach about 0.6: ask for "
            f"fewer or smaller grains; the space reaches from ({_text(space.bounds[0])}) to ({_text(space.bounds[1])}) m, and "
            "where a wall bounds several, fill.point says which one is meant"
        )


def _text(position: np.ndarray) -> str:
    return ", ".join(f"{x:.4g}" for x in position)
