"""The problems of ``measure.py``: each a warpdem scene of many copies, its figures, and what they should be."""

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from warpdem import Scene, Simulation

DENSITY, YOUNG_MODULUS, POISSON_RATIO = 2500.0, 5e6, 0.3  # [kg/m3], [Pa], [-]
RESTITUTION, FRICTION = 0.3, 0.52  # [-] Table 2 of the paper


def mass_of(radius: float) -> float:
    """Mass of a grain [kg]."""
    return DENSITY * 4.0 / 3.0 * np.pi * radius**3


@dataclass(frozen=True)
class Setting:
    """How a problem is solved."""

    integrator: str
    precision: str
    steps: int


class Problem:
    """A problem with everything that a run of it needs.

    Attributes:
        name: on the command line and in file names.
        title: for people.
        error_is: what the error means.
        duration: simulated time [s].
        steps: numbers of time steps over it.
        reference_steps: steps of the default scheme that give the reference; None if the solution is known.
        error_copies: copies that the error is measured on.
        samples: instants at which the figures are taken, evenly over the run.
        twins: further references whose start differs by 1e-9: their differences are the noise of a chaotic problem.
        has_pairs: whether grains touch grains, without which mixed precision changes nothing.
        batch: whether the scene can hold any number of copies.
        has_friction: whether contacts rub.
        young_modulus: of all grains and walls [Pa].
        guards: "record" where the error counts however large it is; else a run that guards stop has none.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    error_is: ClassVar[str]
    duration: ClassVar[float]
    steps: ClassVar[tuple[int, ...]]
    reference_steps: ClassVar[int | None]
    error_copies: ClassVar[int] = 1
    samples: ClassVar[int] = 1
    twins: ClassVar[int] = 0
    has_pairs: ClassVar[bool] = False
    batch: ClassVar[bool] = True
    has_friction: ClassVar[bool] = True
    young_modulus: ClassVar[float] = YOUNG_MODULUS
    guards: ClassVar[str] = "stop"

    def data(self, copies: int) -> dict:
        """The scene of ``copies`` copies, without time and engine."""
        raise NotImplementedError

    def skin(self) -> float | str:
        """Skin of the neighbour lists [m], or "auto"."""
        return "auto"

    def figures(self, sim: Simulation) -> np.ndarray:
        """What is compared at one instant [-], shape (copies, k)."""
        raise NotImplementedError

    def error(self, figures: np.ndarray, reference: np.ndarray) -> float:
        """Root mean square over samples and copies of the distance from the reference [-]; shapes (samples, copies, k)."""
        return float(np.sqrt(np.mean(np.sum((figures - reference) ** 2, axis=-1))))

    def exact(self, copies: int) -> np.ndarray:
        """Figures of the solution in closed form at the end, shape (1, copies, k), if ``reference_steps`` is None."""
        raise NotImplementedError

    def simulation(self, setting: Setting, copies: int, twin: int = 0) -> Simulation:
        """A simulation at its start, on one thread; twins differ in gravity by 1e-9 m/s2 each."""
        data = self.data(copies)
        data["gravity"] = np.add(data["gravity"], [1e-9 * twin, 0.0, 0.0]).tolist()
        if not self.has_friction:
            data["contact"] = {"tangential": "none"}
        step = self.duration / setting.steps
        friction = FRICTION if self.has_friction else 0.0
        scene = Scene.model_validate(
            {
                "materials": {
                    "g": {"density": DENSITY, "young_modulus": self.young_modulus, "poisson_ratio": POISSON_RATIO}
                },
                "pairs": [{"materials": ["g", "g"], "restitution": RESTITUTION, "friction": friction}],
                "base": str(Path(__file__).parent),
                # max_speed: large steps are wanted here, up to where a scheme fails
                "time": {"end": 2.0 * self.duration, "step": step, "max_speed": 1e-6},
                "engine": {
                    "integrator": setting.integrator,
                    "precision": setting.precision,
                    "skin": self.skin(),
                    "guards": self.guards,
                },
                "source": self.name,
                **data,
            }
        )
        return Simulation(scene, device="cpu", threads=1)


class FreeGrain(Problem):
    """A free grain that flies straight in the laboratory, seen in a frame at 40 rad/s: a spiral of 6.4 turns.

    Copies along the axis; the skin is wider than the path, so that no list is ever rebuilt.
    """

    name = "free_grain"
    title = "free grain in the turning frame"
    error_is = "distance from the exact place after 1 s over the starting radius, 1 m"
    duration = 1.0
    steps = (10, 32, 100, 316, 1000, 3162, 10_000, 31_623, 100_000)
    reference_steps = None
    has_friction = False
    young_modulus = 1.0  # nothing touches: so soft that no step is over the stability limit of contacts
    guards = "record"  # the energy that a scheme adds is its error
    start, velocity, rate = np.array([1.0, 0.0]), np.array([0.5, 0.2]), 40.0  # [m], [m/s] in the laboratory, [rad/s]

    def data(self, copies: int) -> dict:  # noqa: D102
        z = 20.0 * np.arange(copies)
        grains = {
            "material": "g",
            "positions": np.column_stack([np.tile(self.start, (copies, 1)), z]),
            "radius": 1e-3,
            "velocities": np.tile([*self.velocity, 0.0], (copies, 1)),
            "velocities_in": "laboratory",
        }
        return {"gravity": [0, 0, 0], "grains": [grains], "frame": {"axis": [0, 0, 1], "rate": self.rate}}

    def skin(self) -> float:  # noqa: D102
        return 10.0

    def figures(self, sim: Simulation) -> np.ndarray:  # noqa: D102
        return sim.particles.position[:, :2]

    def exact(self, copies: int) -> np.ndarray:  # noqa: D102
        angle = self.rate * self.duration
        turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        return np.tile(turn @ (self.start + self.duration * self.velocity), (1, copies, 1))


class DampedContact(Problem):
    """Two grains held together by a spring to the axis of a frame at 200 rad/s, started off their rest places.

    One swing: the overlap decays to 2 % of the radius, the grains roll on each other below the Coulomb limit, the pair as a
    whole swings across the axis and turns with the frame: the forces are smooth and orders show. Copies along the axis.
    """

    name = "damped_contact"
    title = "damped contact in the turning frame"
    error_is = "rms over the path of the distance of both grains from the reference over the overlap at rest"
    duration = 6e-4
    steps = (8, 16, 24, 32, 48, 64, 96, 128, 256, 512, 1024, 2048)
    reference_steps = 65_536
    samples = 8
    has_pairs = True
    radius, overlap, rate = 1e-3, 2e-5, 200.0

    def data(self, copies: int) -> dict:  # noqa: D102
        stiffness = 4.0 / 3.0 * YOUNG_MODULUS / (2.0 * (1.0 - POISSON_RATIO**2)) * np.sqrt(self.radius / 2.0)
        held = stiffness * self.overlap**1.5 / self.radius  # [N/m]
        half = self.radius - 0.65 * self.overlap  # each grain 0.15 of the overlap further in than at rest
        off = 2.0 * self.overlap
        pair = np.array([[half + off, 0.0, 0.0], [-half + off, 0.0, 0.0]])
        z = np.column_stack([np.zeros((copies, 2)), 5.0 * self.radius * np.arange(copies)])
        grains = {
            "material": "g",
            "positions": (z[:, None, :] + pair).reshape(-1, 3),
            "radius": self.radius,
            "spins": np.tile([[0.0, 0.0, 10.0], [0.0, 0.0, 0.0]], (copies, 1)),
        }
        return {
            "gravity": [0, 0, 0],
            "grains": [grains],
            "frame": {"axis": [0, 0, 1], "rate": self.rate},
            "fields": [{"model": "axis_spring.py", "parameters": {"stiffness": held}}],
        }

    def figures(self, sim: Simulation) -> np.ndarray:  # noqa: D102
        return sim.particles.position[:, :2].reshape(-1, 4) / self.overlap


class ObliqueImpact(Problem):
    """Impacts on a wall at 1 m/s under 17 angles from 5 to 85 degrees from the normal, with friction: stick and slip.

    Copies beside each other on one plane; each meets the wall at another instant, so that no step hits contact by luck.
    """

    name = "oblique_impact"
    title = "oblique impact on a wall, 5 to 85 degrees"
    error_is = "rms over the angles of the error of velocity and R x spin after the impact over the speed before it"
    duration = 3.2e-4
    steps = (40, 64, 128, 256, 512, 1024, 2048, 4096, 8192)
    reference_steps = 131_072
    error_copies = 17 * 12
    young_modulus = 5e7
    radius, speed, angles = 1e-3, 1.0, np.radians(np.linspace(5.0, 85.0, 17))

    def data(self, copies: int) -> dict:  # noqa: D102
        k = np.arange(copies)
        angle = self.angles[k % 17]
        phase = ((k // 17) * (np.sqrt(5.0) - 1.0) / 2.0) % 1.0
        approach = self.speed * np.cos(angle)
        gap = approach * 3e-5 * (1.0 + phase)  # [m]: contact begins between 3e-5 and 6e-5 s
        across = int(np.ceil(np.sqrt(copies)))
        place = np.column_stack([k % across, k // across]) * 5.0 * self.radius
        velocity = np.column_stack([self.speed * np.sin(angle), np.zeros(copies), -approach])
        grains = {
            "material": "g",
            "positions": np.column_stack([place, self.radius + gap]),
            "radius": self.radius,
            "velocities": velocity,
        }
        floor = {"name": "floor", "material": "g", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}
        return {"gravity": [0, 0, 0], "grains": [grains], "walls": [floor]}

    def figures(self, sim: Simulation) -> np.ndarray:  # noqa: D102
        p = sim.particles
        return np.column_stack([p.velocity, self.radius * p.spin]) / self.speed


class TurningDisk(Problem):
    """A grain rolling on a disk that turns at 20 rad/s: a circle at 2/7 of that rate in the laboratory.

    Copies all over a disk of 0.2 m radius. Each starts with the same velocity in the laboratory and the spin of rolling at its
    place, so that all draw the same circle there, while the frame sees them fly round the faster the further out they are.
    """

    name = "turning_disk"
    title = "grain rolling on a turning disk"
    error_is = "rms over the disk of the distance from the reference over the radius of the circle, 8.75 mm"
    duration = 0.1
    steps = (700, 1000, 2000, 4000, 8000, 16_000, 32_000)
    reference_steps = 256_000
    error_copies = 40
    radius, disk, rate, speed = 1e-3, 0.2, 20.0, 0.05

    def data(self, copies: int) -> dict:  # noqa: D102
        stiffness = 4.0 / 3.0 * YOUNG_MODULUS / (2.0 * (1.0 - POISSON_RATIO**2)) * np.sqrt(self.radius)
        overlap = (mass_of(self.radius) * 9.81 / stiffness) ** (2.0 / 3.0)
        arm = self.radius - overlap
        k = np.arange(copies)
        out, golden = self.disk * np.sqrt((k + 0.5) / copies), np.pi * (3.0 - np.sqrt(5.0))
        x, y = out * np.cos(golden * k), out * np.sin(golden * k)
        velocity = np.array([self.speed, 0.0, 0.0])
        # rolling: velocity - arm w x n = rate n x place with n along z
        slip = np.column_stack([self.speed + self.rate * y, -self.rate * x])
        spin = np.column_stack([-slip[:, 1] / arm, slip[:, 0] / arm, np.zeros(copies)])
        grains = {
            "material": "g",
            "positions": np.column_stack([x, y, np.full(copies, arm)]),
            "radius": self.radius,
            "velocities": np.tile(velocity, (copies, 1)),
            "spins": spin,
            "velocities_in": "laboratory",
        }
        floor = {"name": "disk", "material": "g", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}
        frame = {"axis": [0, 0, 1], "rate": self.rate}
        return {"gravity": [0, 0, -9.81], "grains": [grains], "walls": [floor], "frame": frame}

    def figures(self, sim: Simulation) -> np.ndarray:  # noqa: D102
        return sim.particles.position_lab[:, :2] / (self.speed / (2.0 / 7.0 * self.rate))


class Bed(Problem):
    """A bed of 2500 grains that falls into a box turning at 10 rad/s about its vertical axis.

    The bed is chaotic, so ensemble figures are compared: mean height, kinetic energy, contacts per grain, force on the floor,
    each averaged over 100 instants from the fall to the settled bed.
    """

    name = "bed"
    title = "bed of 2500 grains"
    error_is = "rms over four figures (mean height, kinetic energy, coordination, floor force) of the relative error"
    duration = 0.1
    steps = (3000, 4000, 5400, 7200, 9600)
    reference_steps = 19_200
    samples = 100
    twins = 2
    has_pairs = True
    batch = False
    error_copies = 2500
    radius = 0.5e-3

    def data(self, copies: int) -> dict:  # noqa: D102
        grain = 4.0 / 3.0 * np.pi * self.radius**3
        width = (copies * grain / 0.3 / 1.5) ** (1.0 / 3.0)
        low, high = [-0.5 * width, -0.5 * width, 0.0], [0.5 * width, 0.5 * width, 1.5 * width]
        fill = {"box": {"min": low, "max": high}, "count": copies, "diameter": 2.0 * self.radius, "seed": 1}
        sides = {"west": [1, 0, 0], "east": [-1, 0, 0], "south": [0, 1, 0], "north": [0, -1, 0]}
        planes = {name: {"point": np.multiply(-0.5 * width, n).tolist(), "normal": n} for name, n in sides.items()}
        planes["floor"] = {"point": [0, 0, 0], "normal": [0, 0, 1]}
        return {
            "gravity": [0, 0, -9.81],
            "grains": [{"material": "g", "fill": fill}],
            "walls": [{"name": name, "material": "g", "plane": plane} for name, plane in planes.items()],
            "frame": {"axis": [0, 0, 1], "rate": 10.0},
        }

    def figures(self, sim: Simulation) -> np.ndarray:  # noqa: D102
        p, contacts, energy = sim.particles, sim.contacts(), sim.energy()
        floor = len(sim.scene.walls) - 1
        force = contacts.force[contacts.j == -1 - floor, 2].sum()
        pairs = np.count_nonzero(contacts.j >= 0)
        moving = energy["kinetic"] + energy["rotational"]
        return np.array([[p.position[:, 2].mean(), moving, 2.0 * pairs / len(p.id), force]])

    def error(self, figures: np.ndarray, reference: np.ndarray) -> float:  # noqa: D102
        return float(np.sqrt(np.mean((figures.mean(axis=0) / reference.mean(axis=0) - 1.0) ** 2)))


PROBLEMS = {problem.name: problem for problem in (FreeGrain(), DampedContact(), ObliqueImpact(), TurningDisk(), Bed())}
