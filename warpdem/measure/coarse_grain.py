r"""Fields on a grid by coarse graining, with a kernel that ends at the distance w (Lucy's).

    phi(r) = 105/(16 pi w^3) (1 + 3 r/w) (1 - r/w)^3 for r < w, else 0,     int phi dV = 1

    density         rho = sum m phi                                     [kg/m3]
    solid fraction  sum (4/3) pi R^3 phi                                [-]
    velocity        V = sum m v phi / rho, relative to the frame        [m/s]
    kinetic stress  sum m (v - V)(v - V) phi                            [Pa]
    contact stress  sum f l int_0^1 phi(x - x_i + s l) ds               [Pa]
    granular temperature    tr(kinetic stress) / (3 rho)                [m2/s2]

f is the force on grain i, l the way to i from the other centre, or from the contact point at a wall: pressure is positive. The
integral along l is taken by Gauss's rule with four points. Density, momentum and stress obey the balances of mass and momentum
exactly up to that rule; within w of a wall part of phi lies outside, and the fields fall off. The kinetic stress holds what the
mean flow varies within w, too. Sources: Goldhirsch 2010, doi 10.1007/s10035-010-0181-z; Weinhart et al. 2012; Lucy 1977.
"""

import itertools
from dataclasses import dataclass

import numpy as np

from warpdem.snapshot import Snapshot

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(4)


@dataclass(frozen=True)
class Lattice:
    """Points x = origin + cell (i, j, k)."""

    origin: np.ndarray
    """First point [m], shape (3,)."""
    shape: tuple[int, int, int]
    """Points along each axis."""
    cell: float
    """Distance of points [m]."""

    @classmethod
    def across(cls, low, high, cell: float) -> "Lattice":
        """Points from ``low`` on [m] that reach to ``high`` [m]."""
        low = np.array(low, dtype=float)
        counts = np.ceil((np.array(high) - low) / cell - 1e-9).astype(int) + 1
        return cls(low, tuple(int(c) for c in counts), cell)


def coarse_grained(snapshot: Snapshot, lattice: Lattice, width: float, period=(0.0, 0.0, 0.0)) -> dict[str, np.ndarray]:
    """Fields at the points of ``lattice`` by name, x running fastest, shapes (p,), (p, 3) or (p, 9).

    Args:
        snapshot: grains and contact network of one instant.
        lattice: where the fields are wanted.
        width: w [m].
        period: length of the domain along each periodic axis [m], else 0.
    """
    m, v = snapshot.mass, snapshot.velocity
    volume = 4.0 / 3.0 * np.pi * snapshot.radius**3
    moments = np.einsum("i,ij,ik->ijk", m, v, v).reshape(-1, 9)
    of_grains = np.column_stack([m, volume, m[:, None] * v, moments])
    sums = _spread(snapshot.position, of_grains, lattice, width, period)
    rho, momentum = sums[:, 0], sums[:, 2:5]
    some = np.where(rho > 0.0, rho, 1.0)[:, None]
    mean = momentum / some
    kinetic = sums[:, 5:] - np.einsum("ij,ik->ijk", momentum, mean).reshape(-1, 9)
    network = snapshot.contacts
    way = network.start - network.end
    stress = np.einsum("ij,ik->ijk", network.force, way).reshape(-1, 9)
    contact = np.zeros((len(sums), 9))
    for node, weight in zip(0.5 + 0.5 * _NODES, 0.5 * _WEIGHTS, strict=True):
        contact += weight * _spread(network.start - node * way, stress, lattice, width, period)
    return {
        "density": rho,
        "solid_fraction": sums[:, 1],
        "velocity": mean,
        "kinetic_stress": kinetic,
        "contact_stress": contact,
        "granular_temperature": kinetic[:, [0, 4, 8]].sum(axis=1) / (3.0 * some[:, 0]),
    }


def _spread(position: np.ndarray, values: np.ndarray, lattice: Lattice, width: float, period) -> np.ndarray:
    """Sums of ``values`` (n, c) times phi at each point of ``lattice``, shape (p, c)."""
    shape, cell = np.array(lattice.shape), lattice.cell
    out = np.zeros((int(shape.prod()), values.shape[1]))
    high = lattice.origin + cell * (shape - 1)
    for image in itertools.product(*[(0.0, p, -p) if p else (0.0,) for p in period]):
        place = position + image
        near = ((place > lattice.origin - width) & (place < high + width)).all(axis=1)
        if near.any():
            _add(out, place[near], values[near], lattice, width)
    return out


def _add(out: np.ndarray, position: np.ndarray, values: np.ndarray, lattice: Lattice, width: float) -> None:
    shape, cell = np.array(lattice.shape), lattice.cell
    base = np.floor((position - lattice.origin) / cell).astype(int)
    reach = int(np.ceil(width / cell))
    steps = np.array([1, shape[0], shape[0] * shape[1]])
    for offset in itertools.product(range(-reach, reach + 2), repeat=3):
        index = base + offset
        r = np.linalg.norm(lattice.origin + cell * index - position, axis=1) / width
        on = (r < 1.0) & (index >= 0).all(axis=1) & (index < shape).all(axis=1)
        if on.any():
            phi = 105.0 / (16.0 * np.pi * width**3) * (1.0 + 3.0 * r[on]) * (1.0 - r[on]) ** 3
            np.add.at(out, index[on] @ steps, values[on] * phi[:, None])
