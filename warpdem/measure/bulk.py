r"""Bulk properties of the grains in a region at one instant: sums over grains and contacts, nothing is smoothed.

    V = sum m v / sum m,     T = sum m |v - V|^2 / (3 sum m)                                        [m/s], [m2/s2]
    Z = (2 N_pairs + N_walls) / N                                                                   [-]
    s_kl = (sum m (v - V)_k (v - V)_l + sum f_k l_l) / box volume                                   [Pa]

f is the force on grain i, l the way to it from the other centre, or from the contact point at a wall: pressure is positive.
Centres of grains and middles of contacts decide what is inside. Velocities are relative to the frame. T takes a mean flow that
varies over the region for agitation: choose the region small, or use the grid.
Sources: Babic 1997 (averages), Christoffersen, Mehrabadi and Nemat-Nasser 1981 (contact stress).
"""

from collections.abc import Callable

import numpy as np

from warpdem.snapshot import ContactNetwork

AXES = ("xx", "yy", "zz", "xy", "yz", "zx")
_PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))


def columns(region) -> list[str]:
    """Names and units of what ``bulk`` gives."""
    names = ["grains [-]", "mass [kg]", *(f"velocity_{axis} [m/s]" for axis in "xyz")]
    names += ["granular_temperature [m2/s2]", "coordination [-]"]
    if region.box is not None:
        names += ["solid_fraction [-]", *(f"stress_{axes} [Pa]" for axes in AXES)]
    return [f"{region.name} {name}" for name in names]


def bulk(region, particles, network: ContactNetwork, wrapped: Callable[[np.ndarray], np.ndarray]) -> list[float]:
    """Properties of the grains in ``region`` in the order of ``columns``; those of no grain are nan.

    Args:
        region: name and box, of the scene.
        particles: the grains of a simulation.
        network: their contacts.
        wrapped: function of positions (n, 3) [m] that gives their images within the periodic borders.
    """
    position, mass, velocity = particles.position, particles.mass, particles.velocity
    inside = _within(region.box, position)
    grains, m, v = int(inside.sum()), mass[inside], velocity[inside]
    if not grains:
        out = [0.0, 0.0, *[np.nan] * 5]
    else:
        mean = m @ v / m.sum()
        agitation = m @ np.sum((v - mean) ** 2, axis=1) / (3.0 * m.sum())
        ids = particles.id[inside]
        ends = np.isin(network.i, ids).sum() + np.isin(network.j[network.wall < 0], ids).sum()
        out = [grains, m.sum(), *mean, agitation, ends / grains]
    if region.box is not None:
        volume = float(np.prod(np.subtract(region.box.max, region.box.min)))
        solid = 4.0 / 3.0 * np.pi * np.sum(particles.radius[inside] ** 3)
        stress = np.zeros((3, 3))
        if grains:
            stress += np.einsum("i,ij,ik->jk", m, v - mean, v - mean)
        here = _within(region.box, wrapped(0.5 * (network.start + network.end)))
        stress += np.einsum("ij,ik->jk", network.force[here], (network.start - network.end)[here])
        stress = 0.5 * (stress + stress.T) / volume
        out += [solid / volume, *(stress[k] for k in _PAIRS)]
    return [float(number) for number in out]


def _within(box, position: np.ndarray) -> np.ndarray:
    """Which positions (n, 3) [m] are in a box, or anywhere if there is none; shape (n,)."""
    if box is None:
        return np.ones(len(position), dtype=bool)
    return ((position >= box.min) & (position < box.max)).all(axis=1)
