"""Particle impacts of Chung and Ooi: spheres, published results, and scenes that repeat them.

J. Y. Ooi and Y. C. Chung, Granular Matter 13 (2011) 643: spheres that meet head on (test 1), meet a rigid wall head on (2, 3)
or obliquely (4, 5), and two that meet with opposite spins (7). Parameters and curves as kept by Kratos and YADE; measured
values of test 4 by Kharaz, Gorham and Salman, Powder Technology 120 (2001) 281. Angles [deg] from the normal, spins [rad/s]; a
negative spin slows the contact point.
"""

import math
from dataclasses import dataclass

import numpy as np

from warpdem import Scene

RIGID = 1e6
"""Stiffness of a rigid wall over that of the sphere: E* is off by this share."""


@dataclass(frozen=True)
class Sphere:
    """Radius [m], density [kg/m3], Young's modulus [Pa], Poisson's ratio, friction and restitution [-]."""

    radius: float
    density: float
    young_modulus: float
    poisson_ratio: float
    friction: float
    restitution: float

    @property
    def mass(self) -> float:
        """[kg]."""
        return self.density * 4.0 / 3.0 * math.pi * self.radius**3

    def impact(self, speed: float, rigid_wall: bool) -> tuple[float, float, float]:
        """Largest overlap [m], largest force [N] and time [s] of an undamped impact, on a rigid wall or with its like.

        d = (5 m* v^2/(4 K))^(2/5), F = K d^(3/2), t_c = 2.943275184 d/v with K = (4/3) E* sqrt(R*).
        """
        share = 1.0 if rigid_wall else 0.5  # of m, R and E/(1 - nu^2)
        elastic = share * self.young_modulus / (1.0 - self.poisson_ratio**2)
        stiffness = 4.0 / 3.0 * elastic * math.sqrt(share * self.radius)
        depth = (1.25 * share * self.mass * speed**2 / stiffness) ** 0.4
        return depth, stiffness * depth**1.5, 2.943275184 * depth / speed


GLASS = Sphere(0.010, 2800, 4.8e10, 0.20, 0.35, 1.0)
LIMESTONE = Sphere(0.010, 2500, 2.0e10, 0.25, 0.35, 1.0)
LARGE_ALUMINIUM = Sphere(0.100, 2699, 7.0e10, 0.30, 0.0, 1.0)
MAGNESIUM = Sphere(0.100, 1800, 4.0e10, 0.35, 0.0, 1.0)
OXIDE = Sphere(0.0025, 4000, 3.8e11, 0.23, 0.092, 0.98)
CAST_IRON = Sphere(0.0025, 7000, 1.0e11, 0.25, 0.0, 1.0)
ALUMINIUM = Sphere(0.0025, 2700, 7.0e10, 0.33, 0.092, 0.98)
STEEL = Sphere(1.0e-5, 7850, 2.08e11, 0.30, 0.3, 1.0)
SPINNING_ALUMINIUM = Sphere(0.100, 2700, 7.0e10, 0.33, 0.4, 0.5)
COPPER = Sphere(0.100, 8900, 1.2e11, 0.35, 0.4, 0.5)

ANGLES = np.arange(5.0, 90.0, 5.0)
SPEED = 3.9
"""Of test 4 [m/s]."""

PAPER_OXIDE = np.array([
    # angle, v_t'/v_t, spin, rebound angle of the contact point [deg]: the paper's DEM
    (5, 0.948, -19.3, 3.76), (10, 0.687, -213.0, -1.56), (15, 0.624, -377.8, -5.54), (20, 0.616, -510.6, -7.54),
    (25, 0.634, -599.4, -7.54), (30, 0.684, -616.5, -3.55), (35, 0.737, -582.3, 3.43), (40, 0.781, -544.8, 11.57),
    (50, 0.845, -457.0, 29.35), (60, 0.893, -357.5, 47.79), (70, 0.932, -246.2, 64.58), (80, 0.966, -126.3, 78.70),
    (85, 0.983, -63.1, 84.52),
])  # fmt: skip
PAPER_ALUMINIUM = np.array([
    # angle, v_t'/v_t, spin
    (5, 0.899, -35.3), (10, 0.671, -223.7), (15, 0.613, -389.6), (20, 0.609, -519.1), (25, 0.633, -599.4),
    (30, 0.683, -617.6),
])  # fmt: skip
FINE_OXIDE = {
    # angle, v_t'/v_t, spin, rebound angle: another code's integration of each law at t_c/20000
    "mindlin": np.array([(5, 0.857, -48.6, 2.55), (10, 0.713, -193.9, -0.03)]),
    "mindlin_displacement": np.array([
        (5, 0.9458, -18.4, 4.14), (10, 0.7007, -202.4, -0.48), (15, 0.6322, -370.7, -4.47), (20, 0.6218, -503.7, -6.83),
        (25, 0.6393, -593.8, -7.09), (30, 0.6845, -614.5, -3.49), (35, 0.7398, -581.4, 3.68), (40, 0.7829, -543.7, 11.64),
        (50, 0.8471, -456.3, 29.50), (60, 0.8948, -355.0, 48.17), (70, 0.9337, -242.9, 65.09), (80, 0.9679, -123.3, 78.98),
        (85, 0.9841, -61.9, 84.81),
    ]),
}  # fmt: skip
MEASURED_RATIO = np.array([
    # angle, v_t'/v_t: aluminium oxide on a glass anvil
    (2.24, 0.797), (4.22, 0.746), (9.84, 0.675), (20.22, 0.599), (30.36, 0.690), (39.54, 0.774), (49.60, 0.848),
    (71.07, 0.937), (79.23, 0.970), (85.17, 0.979),
])  # fmt: skip
MEASURED_SPIN = np.array([
    (5.90, -134.9), (10.87, -261.2), (21.12, -573.7), (31.14, -612.2), (38.95, -595.1), (50.24, -449.5), (60.10, -375.7),
    (69.96, -243.0), (78.56, -142.4), (84.32, -70.6),
])  # fmt: skip
FINE_STEEL = np.array([
    # x = v_t/(mu v_n), contact point's v'/(mu v_n), R spin/(mu v_n) of test 5 by the displacement law at t_c/20000
    (0.67, 0.623, -0.034), (1.0, 0.653, -0.248), (2.0, -0.295, -1.638), (3.0, -1.014, -2.857), (4.0, -1.412, -3.862),
    (5.0, -1.441, -4.597), (6.0, -0.972, -4.976), (10.0, 3.013, -4.987),
])  # fmt: skip


def wall_impacts(
    sphere: Sphere, normal_speed, tangential_speed, tangential: str, *, spins=None, restitution=None, friction=None, steps=200,
    phase=0.5,
) -> tuple[Scene, float]:  # fmt: skip
    """Spheres far apart that fly at a rigid wall, z = 0, without gravity; and the time by which all have left it [s].

    Args:
        sphere: the sphere and its contact with the wall.
        normal_speed: towards the wall [m/s], shape (n,).
        tangential_speed: along x [m/s], shape (n,).
        tangential: tangential law.
        spins: spins before [rad/s], shape (n, 3); none if not given.
        restitution: in place of the sphere's, shape (n,) [-].
        friction: in place of the sphere's [-].
        steps: time steps per contact of the quickest one.
        phase: steps before they touch, a number or shape (n,).
    """
    normal_speed, tangential_speed = np.broadcast_arrays(np.asarray(normal_speed, float), np.asarray(tangential_speed, float))
    n = len(normal_speed)
    restitutions = np.full(n, sphere.restitution) if restitution is None else np.asarray(restitution)
    mu = sphere.friction if friction is None else friction
    step = sphere.impact(normal_speed.max(), rigid_wall=True)[2] / steps
    place = np.zeros((n, 3))
    place[:, 1] = 6.0 * sphere.radius * np.arange(n)
    place[:, 2] = sphere.radius + phase * normal_speed * step
    velocity = np.stack([tangential_speed, np.zeros(n), -normal_speed], axis=1)
    spin = np.zeros((n, 3)) if spins is None else np.asarray(spins)
    material = {"density": sphere.density, "young_modulus": sphere.young_modulus, "poisson_ratio": sphere.poisson_ratio}
    kinds = {f"sphere{k}": e for k, e in enumerate(np.unique(restitutions))}
    balls = [[a, b] for k, a in enumerate(kinds) for b in list(kinds)[k:]]
    scene = {
        "gravity": [0, 0, 0],
        "materials": {"wall": material | {"young_modulus": RIGID * sphere.young_modulus}} | dict.fromkeys(kinds, material),
        "contact": {"normal": "hertz", "tangential": tangential, "rolling": "none"},
        "pairs": [
            *({"materials": [name, "wall"], "restitution": e, "friction": mu} for name, e in kinds.items()),
            *({"materials": two, "restitution": 1, "friction": mu} for two in balls),
        ],
        "grains": [
            {
                "material": name, "radius": sphere.radius, "ids": np.flatnonzero(restitutions == e),
                "positions": place[restitutions == e], "velocities": velocity[restitutions == e],
                "spins": spin[restitutions == e],
            }
            for name, e in kinds.items()
        ],
        "walls": [{"name": "wall", "material": "wall", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}],
        "time": {"end": 1.0, "step": step, "max_speed": float(normal_speed.max())},
    }  # fmt: skip
    longest = sphere.impact(normal_speed.min(), rigid_wall=True)[2]
    return Scene.model_validate(scene), 2.0 * longest  # 1.8 times at e = 0.05


def oblique(sphere: Sphere, tangential: str, angles=ANGLES, steps: int = 200) -> tuple[Scene, float]:
    """Test 4: impacts on a rigid wall at ``SPEED`` [m/s] and ``angles`` [deg], and the time by which they are over [s]."""
    a = np.radians(angles)
    return wall_impacts(sphere, SPEED * np.cos(a), SPEED * np.sin(a), tangential, steps=steps)


def rebound(sim) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Tangential speed [m/s], spin [rad/s] and rebound angle of the contact point [deg] after test 4, each of shape (n,)."""
    p = sim.particles
    spin = -p.spin[:, 1]
    return p.velocity[:, 0], spin, np.degrees(np.arctan2(p.velocity[:, 0] + p.radius * spin, p.velocity[:, 2]))
