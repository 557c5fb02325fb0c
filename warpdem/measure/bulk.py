r"""Bulk properties of the grains in a region at one time: sums over grains and contacts, nothing is smoothed.

    V = sum m v / sum m,     T = sum m |v - V|^2 / (3 sum m)                                        [m/s], [m2/s2]
    Z = (2 N_pairs + N_walls) / N                                                                   [-]
    Phi_kl = sum b n_k n_l / sum b                                                                  [-]
    solid fraction = sum of the balls' volumes in the region / its volume                           [-]
    s_kl = (sum m (v - V)_k (v - V)_l + sum a f_k l_l) / its volume                                 [Pa]

f is the force on grain i, l the branch vector: the way to its centre from the other centre, or from the contact point at a
wall; a is the fraction of this line that lies in the region. Pressure is positive. So the contact stress of boxes side by side
adds up to that of the whole, and in a uniform state it does not depend on where the faces lie between the grains. Grains in m,
v, V, T, Z and the kinetic part of the stress are those whose centres are inside; Z counts all their contacts. Balls count by
the volume that they have in the region, overlaps of grains twice. n is the unit vector along the branch of a contact, b how
many of the region's grains the contact belongs to (1 or 2); the trace of the fabric tensor Phi is 1, and 1/3 on its diagonal
is isotropic. A selection counts as if its grains were alone, but for Z and Phi, which take all their contacts. Vectors are
relative to what the region is fixed to, and in its axes. T takes a mean flow that varies over the region for agitation: choose
the region small, or use the grid.
Sources: Babic 1997 (averages), Christoffersen, Mehrabadi and Nemat-Nasser 1981 (contact stress), Oda 1982 (fabric).
"""

from functools import cached_property

import numpy as np

from warpdem.core.snapshot import ContactNetwork
from warpdem.measure.box_share import BoxShare
from warpdem.measure.image_share import ImageShare
from warpdem.measure.mesh_share import MeshShare
from warpdem.measure.observers import Particles
from warpdem.measure.round_share import RoundShare
from warpdem.measure.seen_grains import SeenGrains
from warpdem.mesh.solid import Bounded, MeshSolid
from warpdem.scene.measures import Region


def share_of(
    region: Region, period: tuple[float, float, float], solid: Bounded | None
) -> BoxShare | ImageShare | None:
    """What tells how much of balls and lines is in a region, of a mesh by its ``solid``; None where nothing bounds it."""
    if region.box is not None:
        return BoxShare(region.box.min, region.box.max, period)
    if isinstance(solid, MeshSolid):
        return MeshShare(solid, period)
    shape = region.sphere or region.cylinder
    return None if shape is None or not has_share(region) else RoundShare(shape, period)


def has_share(region: Region) -> bool:
    """Whether solid fraction and stress are measured in a region: any but a cylinder without ends, and that of all grains."""
    return bool(region.shape_key) and (region.cylinder is None or region.cylinder.length is not None)


class Bulk:
    """The grains in a region at one time, and what is averaged over them; averages over no grain are nan.

    Args:
        region: name and shape, of the scene.
        particles: the grains of a simulation, as seen from the region.
        network: their contacts, as seen from it.
        period: length of the domain along each periodic axis [m], else 0.
        counts: whether each grain is one of the region's selection, shape (n,); None: all are.
        shape: of a region that is no box, with its mesh if it is one.
    """

    def __init__(
        self,
        region: Region,
        particles: Particles | SeenGrains,
        network: ContactNetwork,
        period: tuple[float, float, float] = (0.0, 0.0, 0.0),
        counts: np.ndarray | None = None,
        shape: Bounded | None = None,
    ) -> None:
        self._particles, self._network = particles, network
        self._share = share_of(region, period, shape)
        position = particles.position
        here = self._share if isinstance(self._share, BoxShare) else shape
        self._inside = np.ones(len(position), dtype=bool) if here is None else here.holds(position)
        self._counts = counts
        if counts is not None:
            self._inside &= counts
        self._mass, self._velocity = particles.mass[self._inside], particles.velocity[self._inside]
        self.grains = int(self._inside.sum())
        """Number of grains [-]."""

    @cached_property
    def mass(self) -> float:
        """Their mass [kg]."""
        return float(self._mass.sum()) if self.grains else 0.0

    @cached_property
    def velocity(self) -> np.ndarray:
        """Mean velocity by mass V [m/s], shape (3,)."""
        return self._mass @ self._velocity / self._mass.sum() if self.grains else np.full(3, np.nan)

    @cached_property
    def granular_temperature(self) -> float:
        """T [m2/s2]."""
        if not self.grains:
            return np.nan
        return self._mass @ np.sum((self._velocity - self.velocity) ** 2, axis=1) / (3.0 * self._mass.sum())

    @cached_property
    def speed(self) -> float:
        """Mean speed by mass, sum m |v| / sum m [m/s]."""
        return self._mass @ np.linalg.norm(self._velocity, axis=1) / self._mass.sum() if self.grains else np.nan

    @cached_property
    def centre(self) -> np.ndarray:
        """Centre of mass [m], shape (3,)."""
        position = self._particles.position[self._inside]
        return self._mass @ position / self._mass.sum() if self.grains else np.full(3, np.nan)

    @cached_property
    def _ends(self) -> np.ndarray:
        """How many of the grains each contact belongs to: 0, 1 or 2, shape (c,)."""
        ids, network = self._particles.id[self._inside], self._network
        return np.isin(network.i, ids).astype(float) + (np.isin(network.j, ids) & (network.wall < 0))

    @cached_property
    def coordination(self) -> float:
        """Z [-]."""
        return float(self._ends.sum()) / self.grains if self.grains else np.nan

    @cached_property
    def fabric(self) -> np.ndarray:
        """Phi [-], symmetric, shape (3, 3); nan without contacts."""
        branch = self._network.start - self._network.end
        normal = branch / np.linalg.norm(branch, axis=1)[:, None]
        total = self._ends.sum()
        return np.einsum("i,ij,ik->jk", self._ends, normal, normal) / total if total else np.full((3, 3), np.nan)

    @cached_property
    def solid_fraction(self) -> float:
        """Solid fraction [-]; only where ``share_of`` gives one."""
        assert self._share is not None
        counts = slice(None) if self._counts is None else self._counts
        return self._share.of_balls(self._particles.position[counts], self._particles.radius[counts]) / self._share.volume

    @cached_property
    def stress(self) -> np.ndarray:
        """Stress, symmetric, pressure positive [Pa], shape (3, 3); only where ``share_of`` gives one."""
        assert self._share is not None
        out = np.zeros((3, 3))
        if self.grains:
            fluctuation = self._velocity - self.velocity
            out += np.einsum("i,ij,ik->jk", self._mass, fluctuation, fluctuation)
        network = self._network
        part = self._share.of_lines(network.start, network.end)
        out += np.einsum("i,ij,ik->jk", part, network.force, network.start - network.end)
        return 0.5 * (out + out.T) / self._share.volume
