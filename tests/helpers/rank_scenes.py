"""Small scenes that are run over several ranks, each with many of the features that meet there."""

import numpy as np

from warpdem import Scene

RADIUS = 1.0e-3
MATERIALS = {"a": {"density": 2500, "young_modulus": 4e6, "poisson_ratio": 0.3},
             "b": {"density": 4000, "young_modulus": 6e6, "poisson_ratio": 0.25}}  # fmt: skip
NUMBERS = {"restitution": 0.6, "friction": 0.5, "rolling_friction": 0.2}
BOX = [([0, 0, 0], [0, 0, 1]), ([-9e-3, 0, 0], [1, 0, 0]), ([9e-3, 0, 0], [-1, 0, 0]), ([0, -9e-3, 0], [0, 1, 0]),
       ([0, 9e-3, 0], [0, -1, 0])]  # fmt: skip


def lattice(shape: tuple[int, int, int], apart: float, low: tuple[float, float, float], seed: int) -> dict:
    """Grains on a lattice with speeds and spins at random, every third of them of the second material."""
    rng = np.random.default_rng(seed)
    cell = np.stack(np.meshgrid(*[np.arange(k) for k in shape], indexing="ij"), axis=-1).reshape(-1, 3)
    n = len(cell)
    return {
        "positions": cell * apart + low, "radii": rng.uniform(0.8, 1.0, n) * RADIUS,
        "velocities": rng.normal(0.0, 0.2, (n, 3)), "spins": rng.normal(0.0, 30.0, (n, 3)), "ids": rng.permutation(n) * 3 + 5,
    }  # fmt: skip


def scene(name: str, **tables) -> Scene:
    given = {
        "title": name, "gravity": [0, 0, -60], "materials": MATERIALS,
        "pairs": [{"materials": list(pair), **NUMBERS} for pair in (("a", "a"), ("a", "b"), ("b", "b"))],
        "contact": {"normal": "hertz", "tangential": "mindlin", "rolling": "spring"},
        "time": {"end": 4e-3, "step": 2e-5, "max_speed": 1}, "engine": {"skin": 0.4 * RADIUS, "max_overlap": 0.3},
        "output": {"interval": 2e-3, "history_interval": 1e-3, "formats": ["vtk"]},
    }  # fmt: skip
    return Scene.model_validate({**given, **tables})


def stirred() -> Scene:
    """A box of planes in axes that turn, with a wall that moves through the grains; both budgets."""
    frame = {"axis": [0, 1, 0.2], "origin": [0, 0, 5e-3], "schedule": [{"until": 4e-3, "rate": [0, 40]}, {"rate": 40}]}
    walls = [{"name": f"p{k}", "material": "a", "plane": {"point": p, "normal": n}} for k, (p, n) in enumerate(BOX)]
    walls.append({"name": "rod", "material": "b", "motion": {"velocity": [0.5, 0.2, 0]},
                  "cylinder": {"point": [-7e-3, 0, 2e-3], "axis": [0, 1, 0], "radius": 1.5e-3, "inside": False}})  # fmt: skip
    grains = [{"material": kind, **{k: v[part] for k, v in lattice((6, 6, 5), 2.2e-3, (-4.5e-3, -4.5e-3, 6.5e-3), 1).items()}}
              for kind, part in (("a", slice(0, 120)), ("b", slice(120, 180)))]  # fmt: skip
    return scene("stirred", frame=frame, walls=walls, grains=grains, measures={"energy": True, "momentum": True})


SCENES = {"stirred": stirred}
