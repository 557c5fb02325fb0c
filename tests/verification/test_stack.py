"""Columns of grains at rest, and two grains squeezed between plates (exact_solutions 4)."""

import math

import numpy as np
from scipy.linalg import expm

from warpdem import Scene, Simulation

G = 9.81


def test_columns_rest_at_their_exact_overlaps(device):
    """Each contact bears the grains above it, d = (m g/K)^(2/3) with their mass m; K_w on a rigid floor, K_p between grains.

    Table of exact_solutions 4 for R = 5 mm, 2500 kg/m3, 5 MPa, 0.3: one grain 8.501655937e-6 m, two grains 1.349553758e-5 and
    1.700331187e-5 m. Damped at e = 0.3 the slowest swing of five falls as exp(-25 t/s): 1e-8 of the overlaps after 0.8 s.
    """
    radius, density, young, poisson = 5e-3, 2500.0, 5e6, 0.3
    mass = density * 4.0 / 3.0 * math.pi * radius**3
    floor = 4.0 / 3.0 * young / (1.0 - poisson**2) * math.sqrt(radius)
    pair = floor / 2.0**1.5  # E*/2 and R/2
    expected, place = [], []
    for column, count in enumerate((1, 2, 5)):
        above = count - np.arange(count)
        overlap = (above * mass * G / np.where(np.arange(count) == 0, floor, pair)) ** (2.0 / 3.0)
        expected.append(overlap)
        place += [[0.1 * column, 0.0, radius * (2 * k + 1)] for k in range(count)]
    assert np.allclose(expected[0], 8.501655937e-6, rtol=1e-9)
    assert np.allclose(expected[1], [1.349553758e-5, 1.700331187e-5], rtol=1e-9)
    glass = {"density": density, "young_modulus": young, "poisson_ratio": poisson}
    scene = {
        "gravity": [0, 0, -G],
        "materials": {"glass": glass, "rigid": glass | {"young_modulus": 1e12 * young}},
        "contact": {"normal": "hertz", "tangential": "mindlin", "rolling": "none"},
        "pairs": [{"materials": ["glass", m], "restitution": 0.3, "friction": 0.3} for m in ("glass", "rigid")],
        "grains": [{"material": "glass", "radius": radius, "positions": place}],
        "walls": [{"name": "floor", "material": "rigid", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}],
        "time": {"end": 1.0, "step": 2e-5, "max_speed": 1e-3},
        "engine": {"skin": 5e-3},
    }
    sim = Simulation(Scene.model_validate(scene), device=device, threads=1)
    sim.run(until=0.8)
    z = sim.particles.position[:, 2]
    found = np.split(np.where(np.isin(np.arange(8), [0, 1, 3]), radius - z, 2 * radius - np.diff(z, prepend=0.0)), [1, 3])
    for overlap, exact in zip(found, expected, strict=True):
        np.testing.assert_allclose(overlap, exact, rtol=1e-6)
    assert np.abs(sim.particles.velocity).max() < 1e-8
    np.testing.assert_allclose(z[[1, 2]], [4.986504462e-3, 1.496950115e-2], rtol=1e-8)


# DEM03 of MFIX: t [s], y1 [m], v1 [m/s], y2, v2 of the lower grain, 20000 kg/m3, and the upper one, 10000 kg/m3
SQUEEZED = np.array([
    (4.0e-4, 4.256463166e-4, -5.269413e-2, 1.378437488e-3, 4.492514e-1),
    (8.0e-4, 4.241821019e-4, 1.160077e-1, 1.367714034e-3, -5.035700e-1),
    (1.2e-3, 4.476969296e-4, -1.196945e-1, 1.350488380e-3, 1.364177e-1),
    (1.6e-3, 4.288738845e-4, -3.783979e-3, 1.387869059e-3, 3.131214e-1),
    (2.0e-3, 4.257206042e-4, 1.758990e-1, 1.358146993e-3, -4.754668e-1),
])  # fmt: skip


def squeezed(device, step):
    """Positions and speeds of both grains at the times of the table, shape (5, 4)."""
    radius, stiffness, damping = 0.5e-3, 1000.0, 5.0
    density = {"lower": 20000.0, "upper": 10000.0}
    mass = {name: rho * 4.0 / 3.0 * math.pi * radius**3 for name, rho in density.items()}

    def pair(a, b, reduced):
        # dashpot damping * m* = 2 |beta| sqrt(m* k): the restitution that asks for it
        beta = 0.5 * damping * math.sqrt(reduced / stiffness)
        e = math.exp(-math.pi * beta / math.sqrt(1.0 - beta**2))
        return {"materials": [a, b], "restitution": e, "stiffness": stiffness}

    m1, m2 = mass.values()
    scene = {
        "gravity": [0, 0, -G],
        "materials": {
            name: {"density": rho, "young_modulus": 1e6, "poisson_ratio": 0.3}
            for name, rho in {**density, "plate": 1.0}.items()
        },
        "contact": {"normal": "hooke", "tangential": "none", "rolling": "none"},
        "pairs": [
            pair("lower", "upper", m1 * m2 / (m1 + m2)), pair("lower", "plate", m1), pair("upper", "plate", m2),
            *({"materials": [n, n], "restitution": 1, "stiffness": stiffness} for n in density),
        ],
        "grains": [
            {"material": "lower", "radius": radius, "positions": [[0, 0, 4.5e-4]]},
            {"material": "upper", "radius": radius, "positions": [[0, 0, 1.35e-3]]},
        ],
        "walls": [
            {"name": "floor", "material": "plate", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}},
            {"name": "lid", "material": "plate", "plane": {"point": [0, 0, 1.8e-3], "normal": [0, 0, -1]}},
        ],
        "time": {"end": 1.0, "step": step, "max_speed": 0.5},
        "engine": {"max_overlap": 0.5},
    }  # fmt: skip
    sim = Simulation(Scene.model_validate(scene), device=device, threads=1)
    rows = []
    for time in SQUEEZED[:, 0]:
        sim.run(until=time)
        assert abs(sim.time - time) < 1e-12
        assert len(sim.contacts().i) == 3, "a contact opened"
        z, v = sim.particles.position[:, 2], sim.particles.velocity[:, 2]
        rows.append([z[0], v[0], z[1], v[1]])
    return np.array(rows), m1, m2


def test_two_grains_squeezed_between_plates(device):
    """Three springs of k = 1000 N/m and dashpots of 5/s times the reduced mass: y' = A y + b, solved by exp(A t).

    Always in contact, so order 2: at w = 2.1e4/s of the quicker mode and 5e-7 s, (w dt)^2/24 w t = 2e-4 of the swing at last.
    """
    (found, m1, m2), (coarse, _, _) = (squeezed(device, step) for step in (5e-7, 1e-6))
    k, c, d, lid = 1000.0, 5.0, 1e-3, 1.8e-3
    c12 = c * m1 * m2 / (m1 + m2)
    matrix = np.zeros((5, 5))  # y1, v1, y2, v2, 1
    matrix[0, 1] = matrix[2, 3] = 1.0
    # the floor is felt below d/2, the partner below d, the lid above lid - d/2
    matrix[1] = np.array([-2 * k, -c * m1 - c12, k, c12, 0.5 * d * k - d * k - m1 * G]) / m1
    matrix[3] = np.array([k, c12, -2 * k, -c * m2 - c12, d * k + (lid - 0.5 * d) * k - m2 * G]) / m2
    start = np.array([4.5e-4, 0.0, 1.35e-3, 0.0, 1.0])
    exact = np.array([(expm(matrix * t) @ start)[:4] for t in SQUEEZED[:, 0]])
    np.testing.assert_allclose(exact, SQUEEZED[:, 1:], rtol=5e-7)
    size = np.abs(exact - [4.5e-4, 0.0, 1.35e-3, 0.0]).max(axis=0)
    error, larger = (np.abs(run - exact) / size for run in (found, coarse))
    assert error.max() < 2e-4
    assert np.log2(larger.max() / error.max()) > 1.9
