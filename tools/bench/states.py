"""What the benchmarks start from: settled beds and hourglasses in mid-discharge, made here or given, and their scenes.

Grains, coefficients and time step are those of Table 2 of the paper. A state is an .npz file with positions x, radii r,
velocities v and spins w in SI units.
"""

import functools
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

import warpdem
from warpdem.filling.packing import fill
from warpdem.scene.size_distribution import DiameterDistribution

ROOT = Path(__file__).resolve().parents[2]
DIAMETER = (0.3e-3, 0.6e-3)  # [m], uniform by number (Table 2 of the paper)
SIZES = DiameterDistribution(uniform=DIAMETER)
MEAN_VOLUME = np.pi / 6.0 * sum(DIAMETER) * (DIAMETER[0] ** 2 + DIAMETER[1] ** 2) / 4.0  # [m3]
BED_FRACTION = 0.57  # solid fraction at which a bed of one's own is filled [-]
TILE = 20_000  # grains [-]: larger beds are settled ones of this size side by side
OWN_GLASS = (5000, 0.45e-3, "hourglass.stl")  # grains [-], scale [m] and mesh of the hourglass made without --states

Model = Literal["full", "no_rolling", "frictionless"]
Law = Literal["mindlin", "mindlin_displacement"]
Precision = Literal["double", "mixed"]


@dataclass(frozen=True)
class Material:
    """Table 2 of the paper; grains and walls alike."""

    density: float = 2653.0
    young_modulus: float = 5.0e7
    poisson_ratio: float = 0.3
    restitution: float = 0.3
    friction: float = 0.52
    rolling_friction: float = 0.3


MATERIAL = Material()


@dataclass(frozen=True)
class Start:
    """A state that windows start from.

    Attributes:
        name: such as bed_20000.
        file: .npz with x, r, v, w.
        width: Width of the square box around a bed [m]; this or mesh.
        mesh: Closed mesh around the grains [m].
    """

    name: str
    file: Path
    width: float | None = None
    mesh: Path | None = None

    @functools.cached_property
    def state(self) -> dict[str, np.ndarray]:
        """Positions x, radii r, velocities v and spins w in SI units."""
        with np.load(self.file) as data:
            return {key: data[key] for key in ("x", "r", "v", "w")}


@dataclass(frozen=True)
class Settings:
    """What all windows share; ``resident`` as of ``Simulation``."""

    law: Law = "mindlin_displacement"
    step: float = 1e-6
    skin: float = 1e-4
    warm: int = 50
    steps: int = 400
    repeats: int = 3
    device: str = "cpu"
    precision: Precision = "double"
    resident: bool | None = None


def scene_of(start: Start, model: Model, settings: Settings) -> warpdem.Scene:
    """The scene of a case."""
    rolls, rubs = model == "full", model != "frictionless"
    if start.mesh is not None:
        walls = [{"name": "glass", "material": "grain", "mesh": str(start.mesh.resolve())}]
    else:
        w = start.width
        planes = [([0, 0, 0], [0, 0, 1]), ([0, 0, 0], [1, 0, 0]), ([w, 0, 0], [-1, 0, 0]), ([0, 0, 0], [0, 1, 0]),
                  ([0, w, 0], [0, -1, 0])]  # fmt: skip
        names = ["floor", "west", "east", "south", "north"]
        walls = [
            {"name": name, "material": "grain", "plane": {"point": point, "normal": normal}}
            for name, (point, normal) in zip(names, planes, strict=True)
        ]
    pair = {
        "materials": ["grain", "grain"],
        "restitution": MATERIAL.restitution,
        "friction": MATERIAL.friction if rubs else 0.0,
        "rolling_friction": MATERIAL.rolling_friction if rolls else 0.0,
    }
    stuff = {key: getattr(MATERIAL, key) for key in ("density", "young_modulus", "poisson_ratio")}
    return warpdem.Scene.model_validate(
        {
            "materials": {"grain": stuff},
            "contact": {"tangential": settings.law if rubs else "none", "rolling": "constant" if rolls else "none"},
            "pairs": [pair],
            "grains": [{"material": "grain", "file": str(start.file.resolve())}],
            "walls": walls,
            "time": {"end": 1.0, "step": settings.step},
            "engine": {"skin": settings.skin, "precision": settings.precision},
            "source": start.name,
        }
    )


def save_state(path: Path, sim: warpdem.Simulation, **more: float) -> None:
    """Write the present state of ``sim`` as .npz."""
    p = sim.particles
    np.savez(path, x=p.position, r=p.radius, v=p.velocity, w=p.spin, **more)


def own_bed(count: int, folder: Path, settings: Settings, settle: int) -> Start:
    """A bed filled at random and settled for ``settle`` steps, or the one made before."""
    # grains pack more loosely beside walls: as if each wall stood 0.15 mean diameters further in
    width = (count * MEAN_VOLUME / BED_FRACTION) ** (1.0 / 3.0) + 0.15 * sum(DIAMETER)
    start = Start(f"bed_{count}", folder / f"bed_{count}_{settle}.npz", width=width)
    if not start.file.exists():
        position, radius = fill(None, ((0.0,) * 3, (width,) * 3), SIZES, seed=1, count=count)
        rest = np.zeros_like(position)
        raw = Start(start.name, folder / f"bed_{count}_raw.npz", width=width)
        np.savez(raw.file, x=position, r=radius, v=rest, w=rest)
        sim = warpdem.Simulation(scene_of(raw, "full", settings), device=settings.device)
        sim.step(settle)
        save_state(start.file, sim, L=width)
    return start


def tiled(start: Start, times: int, folder: Path) -> Start:
    """``times`` by ``times`` copies of a bed side by side: faces that touched a wall now touch each other."""
    width, count = start.width * times, len(start.state["r"]) * times**2
    out = Start(f"bed_{count}", folder / f"{start.file.stem}_x{times}.npz", width=width)
    if not out.file.exists():
        shift = np.array([[i * start.width, j * start.width, 0.0] for i in range(times) for j in range(times)])
        state = {key: np.concatenate([value] * times**2) for key, value in start.state.items()}
        state["x"] = state["x"] + np.repeat(shift, len(start.state["r"]), axis=0)
        np.savez(out.file, **state, L=width)
    return out


def bed(count: int, folder: Path, settings: Settings, settle: int) -> Start:
    """About ``count`` grains: a settled bed of one's own, or several of them."""
    times = 1 if count <= 2 * TILE else max(1, round((count / TILE) ** 0.5))
    start = own_bed(count if times == 1 else TILE, folder, settings, settle)
    return start if times == 1 else tiled(start, times, folder)


def given_bed(count: int, states: Path) -> Start:
    """A bed of the folder ``states``."""
    file = find(states, f"bed_{count}.npz")
    with np.load(file) as data:
        return Start(file.stem, file, width=float(data["L"]))


def mid_discharge(
    count: int, states: Path | None, mesh: str | None, folder: Path, settings: Settings, flow: float
) -> Start:
    """An hourglass ``flow`` seconds after it was turned over, from a settled one or from one filled at random."""
    import trimesh

    count = count if states is not None else OWN_GLASS[0]
    if states is None:
        file, scale = ROOT / "scenes" / "meshes" / OWN_GLASS[2], OWN_GLASS[1]
    elif mesh is None:
        raise SystemExit("--mesh: give the mesh of the glasses of --states, such as meshes/hourglass_{n}.stl")
    else:
        path = Path(mesh.replace("{n}", str(count)))
        file, scale = find(path.parent, path.name), 1.0
    # turned about y with its grains; ASCII, the only form that the peer reads
    shell = trimesh.load(file, force="mesh")
    turned = shell.vertices * scale * [-1.0, 1.0, -1.0]
    turned_mesh = folder / f"hourglass_{count}.stl"
    write_ascii_stl(turned_mesh, turned[shell.faces])
    start = Start(f"hourglass_{count}", folder / f"hourglass_{count}_{flow:g}.npz", mesh=turned_mesh)
    if not start.file.exists():
        if states is None:
            from warpdem.mesh.triangle_mesh import load_mesh

            upper = ((-1.0, -1.0, 0.0), (1.0, 1.0, 1.0))
            position, radius = fill(load_mesh(turned_mesh), upper, SIZES, seed=1, count=count)
            state = {"x": position, "r": radius, "v": np.zeros_like(position), "w": np.zeros_like(position)}
        else:
            state = Start("", find(states, f"glass_{count}.npz")).state
            turn = np.array([-1.0, 1.0, -1.0])
            state = {key: value if key == "r" else value * turn for key, value in state.items()}
        raw = Start(start.name, folder / f"hourglass_{count}_raw.npz", mesh=turned_mesh)
        np.savez(raw.file, **state)
        sim = warpdem.Simulation(scene_of(raw, "full", settings), device=settings.device)
        sim.run(until=flow)
        save_state(start.file, sim)
    return start


def find(folder: Path, name: str) -> Path:
    """The file ``name`` in ``folder``; ends the program with a list of what is there if it is missing."""
    if not (folder / name).is_file():
        there = sorted(p.name for p in folder.glob(f"*{Path(name).suffix}"))
        raise SystemExit(f"{folder / name}: no such file; there: {', '.join(there) or 'none'}")
    return folder / name


def write_ascii_stl(path: Path, triangles: np.ndarray) -> None:
    """Write triangles (t, 3, 3) [m] as ASCII STL; the normals are left to the reader."""
    facets = ("".join(f"vertex {x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in corners) for corners in triangles)
    body = "".join(f"facet normal 0 0 0\nouter loop\n{corners}endloop\nendfacet\n" for corners in facets)
    path.write_text(f"solid mesh\n{body}endsolid mesh\n")
