"""Wall contacts in the lanes of registers have the bits of those evaluated one by one."""

import numpy as np
import pytest
import trimesh
from warpdem.kernels.simd.values import NotStraight
from warpdem.kernels.wall import sweep

from warpdem import Scene, Simulation
from warpdem.model import compiled

WIDTH, RADIUS = 0.012, 5e-4
ENERGY = {"measures": {"energy": True, "momentum": True}}
TURNING = {"motion": [{"axis": [0, 0, 1], "origin": [WIDTH / 2, WIDTH / 2, 0], "rate": "200 rpm"}]}
FRAME = {"frame": [{"axis": [0, 0.3, 1], "rate": "60 rpm"}]}


def planes(_, materials=("g", "g", "g")):
    """A corner: grains lie on the floor, and some of them at one or two sides too."""
    normals = ([0, 0, 1], [1, 0, 0], [0, 1, 0])
    return [
        {"name": f"w{k}", "material": material, "plane": {"point": [0, 0, 0], "normal": normal}}
        for k, (normal, material) in enumerate(zip(normals, materials, strict=True))
    ]


def mesh(folder):
    """The same corner in triangles: grains touch many at once."""
    box = trimesh.creation.box((WIDTH, WIDTH, WIDTH))
    box.apply_translation((WIDTH / 2,) * 3)
    box = box.subdivide().subdivide().subdivide()
    box.invert()
    box.export(folder / "box.stl")
    return [{"name": "box", "material": "g", "mesh": str(folder / "box.stl")}]


def others(_):
    return [{"name": "tube", "material": "hard", "cylinder": {"point": [WIDTH / 2, WIDTH / 2, 0], "axis": [0, 0, 1],
                                                             "radius": 0.72 * WIDTH}}, *planes(_)[:1]]  # fmt: skip


def grains():
    """In layers pressed on the floor and the sides, with motions that make them slip and roll."""
    rng = np.random.default_rng(1)
    x = np.arange(RADIUS * 0.9995, WIDTH - RADIUS, 2.02 * RADIUS)
    position = np.stack(np.meshgrid(x, x, x[:2], indexing="ij"), axis=-1).reshape(-1, 3)
    n = len(position)
    motion = {
        "velocities": rng.normal(size=(n, 3), scale=0.05).tolist(),
        "spins": rng.normal(size=(n, 3), scale=50).tolist(),
    }
    return {"material": "g", "positions": position.tolist(), "radius": RADIUS} | motion


CASES = {
    "three materials": (lambda _: planes(_, ("g", "hard", "slippery")), {}, ENERGY),
    "turning frame": (planes, {"rolling": "spring", "torsion": True}, ENERGY | FRAME),
    "turning mesh": (lambda folder: [mesh(folder)[0] | TURNING], {"rolling": "spring"}, ENERGY),
    "stages": (lambda folder: [mesh(folder)[0] | TURNING], {}, {"engine": {"integrator": "rk2"}}),
    "tube, mixed precision": (others, {}, {"engine": {"precision": "mixed"}}),
    "frictionless": (planes, {"tangential": "none", "rolling": "none"}, {}),
}


def scene(walls, contact, more):
    soft = {"density": 2500.0, "young_modulus": 1e7, "poisson_ratio": 0.3}
    names = ("g", "hard", "slippery")
    rolls = contact.get("rolling") != "none"
    return Scene.model_validate({
        "materials": {"g": soft, "hard": soft | {"young_modulus": 4e7}, "slippery": soft},
        "contact": {"normal": "hertz", "tangential": "mindlin", "rolling": "constant"} | contact,
        "pairs": [{"materials": ["g", other], "restitution": 0.5, "friction": mu if "tangential" not in contact else 0.0,
                   "rolling_friction": 0.1 if rolls else 0.0} for other, mu in zip(names, (0.5, 0.3, 0.05), strict=True)],
        "grains": [grains()], "walls": walls, "time": {"end": 1.0, "step": "2 us", "max_speed": 1.0},
    } | more)  # fmt: skip


def outcome(given):
    """State, history and forces at walls, and what is added up, after steps in which contacts open and close."""
    sim = Simulation(given, device="cpu", threads=2)
    sim.step(120)
    contacts = sim.contacts()
    at_walls = contacts.j < 0
    assert at_walls.sum() > 20
    sums = [getattr(sim.state, name).numpy()[sim.state.rank].tobytes() for name in sim.state.sums]
    numbers = [getattr(contacts, name)[at_walls].tobytes() for name in ("force", "point", "spring", "angle")]
    return sim.state.digest(sim.step_number), numbers, sums, sim.particles.force.tobytes()


@pytest.mark.parametrize("case", CASES)
def test_lanes_have_the_bits_of_one_contact_at_a_time(case, tmp_path, monkeypatch):
    walls, contact, more = CASES[case]
    given, asked = scene(walls(tmp_path), contact, more), []
    build = sweep.build
    monkeypatch.setattr(sweep, "build", lambda *args: asked.append(args) or build(*args))
    compiled._built.cache_clear()
    side_by_side = outcome(given)
    assert [args[3] for args in asked] in ([4], [8])

    def refuse(*_):
        raise NotStraight

    monkeypatch.setattr(sweep, "build", refuse)
    compiled._built.cache_clear()
    try:
        assert outcome(given) == side_by_side
    finally:
        compiled._built.cache_clear()
