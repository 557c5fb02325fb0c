"""The reference pair of the adhesion tests, spheres of 1 mm of a soft material, and its impacts, or those on a plane."""

import functools
import math

import numpy as np
import warp as wp

from warpdem import Scene

RADIUS, DENSITY, YOUNG, POISSON, ENERGY = 1e-3, 2500.0, 1e7, 0.3, 0.1
REDUCED = 0.5 * RADIUS
MASS = 0.5 * DENSITY * 4.0 / 3.0 * math.pi * RADIUS**3
"""m* of the pair [kg]."""
PULL, PULL_OFF = 2.35619449019e-4, 8.83484169187e-7
"""F_c [N] and d_c [m] of the pair."""


def meeting(speed, step, phase=0.5, *, normal="jkr", restitution=1.0, wall=False, energy=ENERGY, **changes) -> Scene:
    """Two grains, or a grain and a plane, a little apart, that meet at ``speed`` [m/s]; ``phase``: of the step of the touch."""
    gap = 2.0 * PULL_OFF + phase * speed * step
    grains = {"positions": [[0, 0, 0.5 * gap + RADIUS], [0, 0, -0.5 * gap - RADIUS]]}
    grains["velocities"] = [[0, 0, -0.5 * speed], [0, 0, 0.5 * speed]]
    if wall:
        grains = {"positions": [[0, 0, gap + RADIUS]], "velocities": [[0, 0, -speed]]}
    floor = {"name": "floor", "material": "g", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}
    data = {
        "gravity": [0, 0, 0],
        "materials": {"g": {"density": DENSITY, "young_modulus": YOUNG, "poisson_ratio": POISSON}},
        "contact": {"normal": normal, "tangential": "none"},
        "pairs": [{"materials": ["g", "g"], "restitution": restitution, "surface_energy": energy}],
        "grains": [{"material": "g", "radius": RADIUS, **grains}],
        "walls": [floor] if wall else [],
        "time": {"end": 1.0, "step": step, "max_speed": speed},
    }
    return Scene.model_validate({**data, **changes})


@functools.cache
def _kernels(law, real):
    constants, force, lost = law.build(real)
    Own, History = (wp.types.vector(1, real) for _ in range(2))

    @wp.kernel(module="unique", enable_backward=False)
    def probe(
        overlap: wp.array(dtype=real), before: wp.array(dtype=real), speed: real, stiffness: real, damping: real,
        pull_off: real, history: wp.array(dtype=real), out: wp.array2d(dtype=real),
    ):  # fmt: skip
        i = wp.tid()
        own, past = Own(pull_off), History(history[i])
        f_n, load, k_n, gamma_n, depth, depth_before, now = force(
            overlap[i], before[i], speed, stiffness, damping, own, past
        )
        loss = lost(overlap[i], before[i], stiffness, damping, own, past, now)
        out[i, 0] = f_n
        out[i, 1] = load
        out[i, 2] = k_n
        out[i, 3] = gamma_n
        out[i, 4] = depth
        out[i, 5] = depth_before
        out[i, 6] = now[0]
        out[i, 7] = loss[0]

    @wp.kernel(module="unique", enable_backward=False)
    def of_contact(
        base: real, damping: real, pull_off: real, radius: wp.array(dtype=real), mass: real, out: wp.array2d(dtype=real)
    ):
        i = wp.tid()
        stiffness, dashpot, own = constants(base, damping, Own(pull_off), radius[i], mass)
        out[i, 0] = stiffness
        out[i, 1] = dashpot
        out[i, 2] = own[0]

    return probe, of_contact


RESULTS = ("force", "load", "k_n", "gamma_n", "depth", "depth_before", "now", "loss")


def contacts(law, real, overlap, before, history, *, stiffness, pull_off, speed=0.0, damping=0.0) -> dict[str, np.ndarray]:
    """What the law's ``force`` and ``lost`` give for contacts of these overlaps now and before and this history [m]."""
    overlap, before, history = np.broadcast_arrays(*(np.asarray(x, dtype=float) for x in (overlap, before, history)))
    arrays = [wp.array(x.ravel().copy(), dtype=real, device="cpu") for x in (overlap, before, history)]
    out = wp.zeros((overlap.size, len(RESULTS)), dtype=real, device="cpu")
    inputs = [arrays[0], arrays[1], speed, stiffness, damping, pull_off, arrays[2], out]
    wp.launch(_kernels(law, real)[0], dim=overlap.size, inputs=inputs, device="cpu")
    return dict(zip(RESULTS, out.numpy().astype(float).T, strict=True))


def constants(law, real, base, damping, pull_off, radius, mass) -> np.ndarray:
    """What the law's ``constants`` gives for contacts of these R* [m]: K, C and d_c, shape (n, 3)."""
    out = wp.zeros((len(radius), 3), dtype=real, device="cpu")
    inputs = [base, damping, pull_off, wp.array(np.asarray(radius), dtype=real, device="cpu"), mass, out]
    wp.launch(_kernels(law, real)[1], dim=len(radius), inputs=inputs, device="cpu")
    return out.numpy().astype(float)
