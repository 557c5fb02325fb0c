"""No grain passes through a mesh: random impacts up to the largest travel per step that the checks let through.

The stiffness of each batch is chosen such that an impact lasts N = 6 to 11 steps (at fewer the step is refused; longer ones
overlap by more than 0.8 of the radius), the speed such that a grain goes up to 0.2 of its radius in a step beside a closed
mesh and 0.1 beside an open one. A grain is lost when its centre ends on the other side.
"""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import ConvexHull, cKDTree

from warpdem import Scene, Simulation
from warpdem.mesh.triangle_mesh import load_mesh, signed_distance
from warpdem.model.travel import CLOSED, OPEN

MESHES = Path(__file__).resolve().parents[2] / "scenes/meshes"
STEPS = 12
FINENESS = (30, 300)
"""Extent of a mesh over the grains' radius."""
NAMES = ("hourglass", "box", "bowl", "sheet")
ROOM = 2.0 + 2.0 * CLOSED * STEPS
"""Distance of two grains at the start, in radii, that keeps them from meeting."""


def write_stl(path: Path, triangles: np.ndarray) -> None:
    data = np.zeros(len(triangles), dtype=[("normal", "<f4", 3), ("corner", "<f4", (3, 3)), ("rest", "<u2")])
    data["corner"] = triangles
    path.write_bytes(bytes(80) + np.uint32(len(triangles)).tobytes() + data.tobytes())


def bowl() -> np.ndarray:
    """A closed half ball meshed badly: corners at random, many in pairs 1e-4 apart, which makes needles."""
    rng = np.random.default_rng(7)
    points = rng.normal(size=(300, 3))
    points[:, 2] = -np.abs(points[:, 2])
    points /= np.linalg.norm(points, axis=1)[:, None]
    angle = rng.random(80) * 2 * np.pi
    points = np.concatenate([points, np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)])
    near = points[:150] + 1e-4 * rng.normal(size=(150, 3))
    points = np.concatenate([points, near / np.linalg.norm(near, axis=1)[:, None]])
    points[:, 2] = np.minimum(points[:, 2], 0.0)
    hull = ConvexHull(points)
    triangles = points[hull.simplices]
    outward = np.einsum("ij,ij->i", np.cross(*(triangles[:, k] - triangles[:, 0] for k in (1, 2))), hull.equations[:, :3])
    return np.where((outward > 0)[:, None, None], triangles, triangles[:, ::-1])


class Sheet:
    """A thin wavy sheet, open, of triangles of all lengths; z is up."""

    def __init__(self) -> None:
        rng = np.random.default_rng(8)
        self.x, self.y = (np.concatenate([[0.0], np.sort(rng.random(22)), [1.0]]) for _ in range(2))
        grid = np.stack(np.meshgrid(self.x, self.y, indexing="ij"), axis=-1)
        self.z = 0.05 * np.sin(9.0 * grid.sum(axis=-1))
        points = np.concatenate([grid, self.z[..., None]], axis=-1)
        a, b, c, d = points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]
        self.triangles = np.concatenate([np.stack(t, axis=2).reshape(-1, 3, 3) for t in ((a, b, c), (a, c, d))])

    def above(self, points: np.ndarray) -> np.ndarray:
        """Height of points over the sheet; nan beyond its rim."""
        i, j = (np.searchsorted(line, points[:, k]) - 1 for k, line in enumerate((self.x, self.y)))
        on = (i >= 0) & (j >= 0) & (i < len(self.x) - 1) & (j < len(self.y) - 1)
        i, j = np.where(on, i, 0), np.where(on, j, 0)
        s, t = (points[:, 0] - self.x[i]) / np.diff(self.x)[i], (points[:, 1] - self.y[j]) / np.diff(self.y)[j]
        a, b, c, d = self.z[i, j], self.z[i + 1, j], self.z[i + 1, j + 1], self.z[i, j + 1]
        height = np.where(s > t, a + s * (b - a) + t * (c - b), a + t * (d - a) + s * (c - d))
        return np.where(on, points[:, 2] - height, np.nan)


SHEET = Sheet()


@pytest.fixture(scope="module")
def meshes(tmp_path_factory) -> dict:
    folder = tmp_path_factory.mktemp("meshes")
    paths = {name: (MESHES if name in ("hourglass", "box") else folder) / f"{name}.stl" for name in NAMES}
    write_stl(paths["bowl"], bowl())
    write_stl(paths["sheet"], SHEET.triangles)
    return {name: (path, load_mesh(path)) for name, path in paths.items()}


def starts(mesh, radius: float, closed: bool, rng) -> tuple[np.ndarray, np.ndarray]:
    """Centres just off the surface, far from each other, and the side of the wall (unit normals towards the grains)."""
    a, b, c = mesh.corners.transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    area = np.linalg.norm(normal, axis=1)
    wanted = int(0.5 * area.sum() / (0.7 * ROOM * radius) ** 2) + 1
    k = rng.choice(len(a), wanted, p=area / area.sum())
    u, v = rng.random((2, wanted, 1))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    side = normal[k] / area[k][:, None] * (-1.0 if closed else rng.choice([-1.0, 1.0], (wanted, 1)))
    centre = a[k] + u * (b - a)[k] + v * (c - a)[k] + side * radius * (1.0 + 0.15 * rng.random((wanted, 1)))
    distance = signed_distance(mesh, centre)[0]
    free = distance < -radius if closed else np.abs(distance) > radius
    centre, side = centre[free], side[free]
    alone = np.ones(len(centre), dtype=bool)
    for i, j in cKDTree(centre).query_pairs(ROOM * radius):
        alone[j] &= not alone[i]
    return centre[alone], side[alone]


def impacts(name: str, path: Path, mesh, rng) -> tuple[int, int]:
    """Throw one batch of grains at a mesh; returns how many hit it and how many were lost."""
    closed = name != "sheet"
    share = CLOSED if closed else OPEN
    extent = float((mesh.vertices.max(axis=0) - mesh.vertices.min(axis=0)).max())
    radius = extent / np.exp(rng.uniform(*np.log(FINENESS)))
    centre, side = starts(mesh, radius, closed, rng)
    way = rng.normal(size=centre.shape)
    way /= np.linalg.norm(way, axis=1)[:, None]
    way *= -np.sign(np.einsum("ij,ij->i", way, side))[:, None]
    step = share * radius * (1.0 - 1e-9)  # at 1 m/s
    velocity = way * rng.choice([1.0, 0.8, 0.4], (len(way), 1))
    # Hertz: t_c = 2.9433 d/v = N dt, d = (15 m v^2 / (16 E* sqrt R))^(2/5)
    depth = rng.uniform(6.0, 11.0) * step / 2.9433
    mass = 2500.0 * 4.0 / 3.0 * np.pi * radius**3
    modulus = 2.0 * (1.0 - 0.3**2) * 15.0 * mass / (16.0 * np.sqrt(radius) * depth**2.5)
    scene = dict(
        gravity=[0, 0, 0],
        materials=dict(g=dict(density=2500.0, young_modulus=modulus, poisson_ratio=0.3)),
        pairs=[dict(materials=["g", "g"], restitution=rng.uniform(0.85, 1.0), friction=0.5)],
        grains=[dict(material="g", positions=centre, radius=radius, velocities=velocity)],
        walls=[dict(name="wall", material="g", mesh=str(path), open=not closed)],
        time=dict(end=1e3 * step, step=step, max_speed=1.0),
        engine=dict(max_overlap=1.0, guards="record"),  # at this coarseness an impact may end some per mille faster
    )
    sim = Simulation(Scene.model_validate(scene), device="cpu", threads=1)
    sim.step(STEPS * (1 if closed else 2))
    particles = sim.particles
    hit = np.linalg.norm(particles.velocity - velocity, axis=1) > 1e-9
    if closed:
        lost = signed_distance(mesh, particles.position)[0] > 0.0
    else:  # a grain may roll over the rim: none is counted that starts or ends beyond it
        lost = hit & (SHEET.above(centre) * SHEET.above(particles.position) < 0.0) & inner(centre, 8.0 * radius)
    return int(hit.sum()), int(lost.sum())


def inner(points: np.ndarray, rim: float) -> np.ndarray:
    """Which points lie over the sheet, ``rim`` off its border."""
    return ((points[:, :2] > rim) & (points[:, :2] < 1.0 - rim)).all(axis=1)


@pytest.mark.parametrize("name", NAMES)
def test_no_grain_passes_through(name, meshes, request):
    wanted = 250_000 if request.config.getoption("--slow") else 5_000
    rng = np.random.default_rng(1)
    hits = 0
    while hits < wanted:
        hit, lost = impacts(name, *meshes[name], rng)
        assert lost == 0, f"{lost} of {hit} grains lost after {hits} impacts"
        hits += hit
