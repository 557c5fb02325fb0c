r"""Bulk properties of the grains in a region at one instant: sums over grains and contacts, nothing is smoothed.

    V = sum m v / sum m,     T = sum m |v - V|^2 / (3 sum m)                                        [m/s], [m2/s2]
    Z = (2 N_pairs + N_walls) / N                                                                   [-]
    solid fraction = sum of the balls' volumes in the box / box volume                              [-]
    s_kl = (sum m (v - V)_k (v - V)_l + sum a f_k l_l) / box volume                                 [Pa]

f is the force on grain i, l the branch vector: the way to its centre from the other centre, or from the contact point at a
wall; a is the share of this line that lies in the box. Pressure is positive. So the contact stress of boxes side by side adds
up to that of the whole, and in a uniform state it does not depend on where the faces lie between the grains. Grains in m, v,
V, T, Z and the kinetic part of the stress are those whose centres are inside; Z counts all their contacts. Balls count by the
volume that they have in the box, overlaps of grains twice. Velocities are relative to the frame. T takes a mean flow that
varies over the region for agitation: choose the region small, or use the grid.
Sources: Babic 1997 (averages), Christoffersen, Mehrabadi and Nemat-Nasser 1981 (contact stress).
"""

import numpy as np

from warpdem.core.snapshot import ContactNetwork
from warpdem.measure.box_share import BoxShare

AXES = ("xx", "yy", "zz", "xy", "yz", "zx")
_PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))


def columns(region) -> list[str]:
    """Names and units of what ``bulk`` gives."""
    names = ["grains [-]", "mass [kg]", *(f"velocity_{axis} [m/s]" for axis in "xyz")]
    names += ["granular_temperature [m2/s2]", "coordination [-]"]
    if region.box is not None:
        names += ["solid_fraction [-]", *(f"stress_{axes} [Pa]" for axes in AXES)]
    return [f"{region.name} {name}" for name in names]


def bulk(region, particles, network: ContactNetwork, period=(0.0, 0.0, 0.0)) -> list[float]:
    """Properties of the grains in ``region`` in the order of ``columns``; those of no grain are nan.

    Args:
        region: name and box, of the scene.
        particles: the grains of a simulation.
        network: their contacts.
        period: length of the domain along each periodic axis [m], else 0.
    """
    position, mass, velocity = particles.position, particles.mass, particles.velocity
    box = None if region.box is None else BoxShare(region.box.min, region.box.max, period)
    inside = np.ones(len(position), dtype=bool) if box is None else box.holds(position)
    grains, m, v = int(inside.sum()), mass[inside], velocity[inside]
    if not grains:
        out = [0.0, 0.0, *[np.nan] * 5]
    else:
        mean = m @ v / m.sum()
        agitation = m @ np.sum((v - mean) ** 2, axis=1) / (3.0 * m.sum())
        ids = particles.id[inside]
        ends = np.isin(network.i, ids).sum() + np.isin(network.j[network.wall < 0], ids).sum()
        out = [grains, m.sum(), *mean, agitation, ends / grains]
    if box is not None:
        stress = np.zeros((3, 3))
        if grains:
            stress += np.einsum("i,ij,ik->jk", m, v - mean, v - mean)
        share = box.of_lines(network.start, network.end)
        stress += np.einsum("i,ij,ik->jk", share, network.force, network.start - network.end)
        stress = 0.5 * (stress + stress.T) / box.volume
        out += [box.of_balls(position, particles.radius) / box.volume, *(stress[k] for k in _PAIRS)]
    return [float(number) for number in out]

