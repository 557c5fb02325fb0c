r"""Fields on a grid by coarse graining, with a kernel that ends at the distance w (Lucy's).

    phi(r) = 105/(16 pi w^3) (1 + 3 r/w) (1 - r/w)^3 for r < w, else 0,     int phi dV = 1

    density         rho = sum m phi                                     [kg/m3]
    solid fraction  sum (4/3) pi R^3 phi                                [-]
    velocity        V = sum m v phi / rho, relative to the frame        [m/s]
    kinetic stress  sum m (v - V)(v - V) phi                            [Pa]
    contact stress  sum f l int_0^1 phi(x - x_i + s l) ds               [Pa]
    granular temperature    tr(kinetic stress) / (3 rho)                [m2/s2]

f is the force on grain i, l the way to i from the other centre, or from the contact point at a wall: pressure is positive. The
integral along l is taken in closed form, however short w is beside l. Density, momentum and stress obey the balances of mass
and momentum exactly; within w of a wall part of phi lies outside, and the fields fall off. The kinetic stress holds what the
mean flow varies within w, too. Sources: Goldhirsch 2010, doi 10.1007/s10035-010-0181-z; Weinhart et al. 2012; Lucy 1977.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warpdem.core.snapshot import Snapshot


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
    def across(cls, low: Sequence[float] | np.ndarray, high: Sequence[float] | np.ndarray, cell: float) -> "Lattice":
        """Points from ``low`` on [m] that reach to ``high`` [m]."""
        low = np.array(low, dtype=float)
        x, y, z = (int(c) for c in np.ceil((np.array(high) - low) / cell - 1e-9).astype(int) + 1)
        return cls(low, (x, y, z), cell)


def coarse_grained(
    snapshot: Snapshot, lattice: Lattice, width: float, period: Sequence[float] = (0.0, 0.0, 0.0)
) -> dict[str, np.ndarray]:
    """Fields at the points of ``lattice`` by name, x running fastest, shapes (p,), (p, 3) or (p, 9).

    Args:
        snapshot: grains and contact network of one time.
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
    assert network is not None  # whoever asks for the fields has read them
    way = network.start - network.end
    stress = np.einsum("ij,ik->ijk", network.force, way).reshape(-1, 9)
    contact = _spread(network.start - 0.5 * way, stress, lattice, width, period, way)
    return {
        "density": rho,
        "solid_fraction": sums[:, 1],
        "velocity": mean,
        "kinetic_stress": kinetic,
        "contact_stress": contact,
        "granular_temperature": kinetic[:, [0, 4, 8]].sum(axis=1) / (3.0 * some[:, 0]),
    }


def _spread(
    position: np.ndarray, values: np.ndarray, lattice: Lattice, width: float, period: Sequence[float],
    way: np.ndarray | None = None,
) -> np.ndarray:  # fmt: skip
    """Sums of ``values`` (n, c) times phi at each point of ``lattice``, shape (p, c).

    With ``way`` (n, 3) [m] they are spread evenly over lines of this length and direction around ``position`` (n, 3).
    """
    shape, cell = np.array(lattice.shape), lattice.cell
    out = np.zeros((int(shape.prod()), values.shape[1]))
    high = lattice.origin + cell * (shape - 1)
    reach = width if way is None else width + 0.5 * np.abs(way)
    for image in itertools.product(*[(0.0, p, -p) if p else (0.0,) for p in period]):
        place = position + image
        near = ((place > lattice.origin - reach) & (place < high + reach)).all(axis=1)
        if near.any():
            _add(out, place[near], values[near], lattice, width, None if way is None else way[near])
    return out


def _add(
    out: np.ndarray, position: np.ndarray, values: np.ndarray, lattice: Lattice, width: float, way: np.ndarray | None
) -> None:
    shape, cell = np.array(lattice.shape), lattice.cell
    base = np.floor((position - lattice.origin) / cell).astype(int)
    length = np.zeros(len(position)) if way is None else np.linalg.norm(way, axis=1)
    along = None if way is None else way / np.where(length > 0.0, length, 1.0)[:, None]
    reach = int(np.ceil((width + 0.5 * length.max()) / cell))
    steps = np.array([1, shape[0], shape[0] * shape[1]])
    for offset in itertools.product(range(-reach, reach + 2), repeat=3):
        index = base + offset
        from_middle = lattice.origin + cell * index - position
        square = np.einsum("ij,ij->i", from_middle, from_middle)
        on = (square < (width + 0.5 * length) ** 2) & (index >= 0).all(axis=1) & (index < shape).all(axis=1)
        if not on.any():
            continue
        if along is None:
            phi = _kernel(np.sqrt(square[on]), width)
        else:
            phi = _kernel_along(square[on], np.einsum("ij,ij->i", from_middle[on], along[on]), length[on], width)
        np.add.at(out, index[on] @ steps, values[on] * phi[:, None])


def _kernel(r: np.ndarray, width: float) -> np.ndarray:
    """Kernel at distances r < w, shape (n,)."""
    q = r / width
    return 105.0 / (16.0 * np.pi * width**3) * (1.0 + 3.0 * q) * (1.0 - q) ** 3


def _kernel_along(square: np.ndarray, foot: np.ndarray, length: np.ndarray, width: float) -> np.ndarray:
    """Mean of phi over lines, shape (n,).

    With h the distance from the line and t along it, (1 + 3 q)(1 - q)^3 = 1 - 6 q^2 + 8 q^3 - 3 q^4 at q^2 = (h^2 + t^2)/w^2.

    Args:
        square: square of the distance from the middle of the line [m2].
        foot: distance of the foot of the perpendicular from the middle, along the line [m].
        length: of the line [m].
        width: w [m].
    """
    h2 = np.maximum(square - foot**2, 0.0) / width**2
    half = np.sqrt(np.maximum(1.0 - h2, 0.0))  # of the chord of the kernel's ball
    reach = 0.5 * length / width
    begin, end = (np.clip(side - foot / width, -half, half) for side in (-reach, reach))
    total = _primitive(end, h2) - _primitive(begin, h2)
    none = length <= 0.0
    mean = total / np.where(none, 1.0, 2.0 * reach)
    return 105.0 / (16.0 * np.pi * width**3) * np.where(none, 0.0, mean)


def _primitive(t: np.ndarray, h2: np.ndarray) -> np.ndarray:
    """Integral of 1 - 6 q^2 + 8 q^3 - 3 q^4 from 0 to t, lengths over w."""
    t2, h = t * t, np.sqrt(h2)
    q = np.sqrt(h2 + t2)
    cubes = t * q * (2.0 * t2 + 5.0 * h2) + 3.0 * h2**2 * np.arcsinh(t / np.where(h > 0.0, h, 1.0))
    return t - 6.0 * t * (h2 + t2 / 3.0) + cubes - 3.0 * t * (h2**2 + t2 * (2.0 / 3.0 * h2 + t2 / 5.0))
