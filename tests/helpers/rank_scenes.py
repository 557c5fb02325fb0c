"""Small scenes that are run over several ranks, each with many of the features that meet there."""

from pathlib import Path

import numpy as np

from warpdem import Scene

PACKAGE = Path(__file__).resolve().parents[2]
OWN = PACKAGE / "kernels"
"""Models of the package given by their files are models of one's own."""
BOX_MESH = PACKAGE / "scenes" / "meshes" / "box.stl"

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
        "time": {"end": 2e-3, "step": 2e-5, "max_speed": 1}, "engine": {"skin": 0.4 * RADIUS, "max_overlap": 0.3},
        "output": {"interval": 1e-3, "history_interval": 5e-4, "formats": ["vtk"]},
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


def sizes() -> Scene:
    """Sizes up to 4 to 1 between periodic borders, by a scheme of four stages; the large grain spans several parts."""
    small = lattice((7, 7, 3), 2.2e-3, (-6.6e-3, -6.6e-3, 1.1e-3), 2)
    large = {"positions": [[0, 0, 11.5e-3]], "radius": 3.5 * RADIUS, "velocities": [[0.3, 0, -1]]}
    border = {"min": -8e-3, "max": 8e-3, "kind": "periodic"}
    walls = [{"name": "floor", "material": "a", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}]
    return scene("sizes", walls=walls, borders={"x": border, "y": border},
                 grains=[{"material": "a", **small}, {"material": "b", **large}],
                 engine={"skin": 0.4 * RADIUS, "max_overlap": 0.5, "integrator": "rk4"})  # fmt: skip


def few() -> Scene:
    """Fewer grains than ranks for most of the time, in mixed precision, which stick; without walls."""
    grains = {"positions": [[-3e-3, 0, 0], [0, 1e-3, 0], [3.5e-3, 0, 0]], "radius": RADIUS,
              "velocities": [[1, 0, 0], [0, 0, 0], [-1, 0, 0]]}  # fmt: skip
    return scene("few", grains=[{"material": "a", **grains}], gravity=[0, 0, 0],
                 engine={"skin": 0.4 * RADIUS, "max_overlap": 0.5, "precision": "mixed"})  # fmt: skip


def poured(**tables) -> Scene:
    """A stream above a heap, which leaves by an outlet beside it and an open border."""
    walls = [{"name": f"p{k}", "material": "a", "plane": {"point": p, "normal": n}} for k, (p, n) in enumerate(BOX[:3:2])]
    stream = {"material": "b", "box": {"min": [-4e-3, -4e-3, 8e-3], "max": [4e-3, 4e-3, 14e-3]}, "velocity": [0.3, 0, -1],
              "diameter": {"uniform": ["1 mm", "1.5 mm"]}, "count_rate": 2e4, "seed": 3}  # fmt: skip
    heap = lattice((6, 6, 2), 2.1e-3, (-5.2e-3, -5.2e-3, 1e-3), 4)
    given = {
        "walls": walls, "streams": [stream], "grains": [{"material": "a", **heap}], "gravity": [30, 0, -60],
        "outlets": [{"name": "hole", "box": {"min": [6e-3, -1, -1], "max": [1, 1, 3e-3]}}],
        "borders": {"y": {"min": -6e-3, "max": 6e-3, "kind": "open"}}, "measures": {"residence": [{"name": "all"}]},
        "time": {"end": 4e-3, "step": 2e-5, "max_speed": 1},
    }  # fmt: skip
    return scene("poured", **{**given, **tables})


def drained() -> Scene:
    """The same with budgets, whose terms know what each grain brings and takes away, and grains that stick."""
    measures = {"energy": True, "momentum": True, "flow": [{"name": "lid", "point": [0, 0, 6e-3], "normal": [0, 0, 1]}]}
    sticky = [{"materials": list(pair), **NUMBERS, "surface_energy": 0.02} for pair in (("a", "a"), ("a", "b"), ("b", "b"))]
    return poured(title="drained", measures=measures, pairs=sticky, contact={"normal": "jkr", "rolling": "constant"})


def milled() -> Scene:
    """A mesh that moves through the grains and wears; laws, a field and observers in files of one's own; all measures."""
    walls = [{"name": f"p{k}", "material": "a", "plane": {"point": p, "normal": n}} for k, (p, n) in enumerate(BOX)]
    walls.append({"name": "blade", "material": "b", "mesh": BOX_MESH, "scale": [1e-3, 9e-3, 4e-3],
                  "translate": [-6e-3, -4.5e-3, 0.5e-3],
                  "motion": {"velocity": [0.4, 0, 0.3]}})  # fmt: skip
    box = {"min": [-6e-3, -6e-3, 0], "max": [6e-3, 6e-3, 8e-3]}
    measures = {
        "energy": True, "momentum": True,
        "flow": [{"name": "disk", "point": [0, 0, 6e-3], "normal": [0, 0, 1], "radius": 4e-3}],
        "regions": [{"name": "ball", "sphere": {"centre": [0, 0, 6e-3], "radius": 5e-3}, "fabric": True},
                    {"name": "all", "of": {"material": "b"}}],
        "profiles": [{"name": "height", "box": box, "along": "z", "slices": 3, "fixed_to": "laboratory"}],
        "mixing": [{"name": "sides", "by": "x", "cell": 4e-3}, {"name": "size", "by": "size", "cell": 4e-3}],
        "wear": {"archard": {"coefficient": 1e-4, "hardness": "1 GPa"}, "finnie": {"pressure": "1 GPa"}},
        "grid": {"box": box, "cell": 4e-3},
    }  # fmt: skip
    pairs = [{"materials": list(pair), "stiffness": 300, **NUMBERS} for pair in (("a", "a"), ("a", "b"), ("b", "b"))]
    grains = [{"material": "a", **lattice((5, 5, 5), 2.2e-3, (-3.3e-3, -4.4e-3, 5.8e-3), 6)}]
    contact = {"normal": OWN / "normal" / "hooke.py", "tangential": OWN / "tangential" / "mindlin.py", "rolling": "spring"}
    observers = [{"name": "fast", "model": OWN / "observer" / "speed.py", "reduce": ["sum", "mean", "min", "max"]},
                 {"name": "here", "model": "speed", "axes": "frame", "reduce": ["max"]}]  # fmt: skip
    fields = [{"model": OWN / "field" / "drag.py", "parameters": {"coefficient": 1e-5, "flow": [1, 0, 0]}}]
    return scene("milled", frame={"axis": [0, 1, 0.2], "rate": 20}, walls=walls, grains=grains, measures=measures, pairs=pairs,
                 contact=contact, observers=observers, fields=fields,
                 engine={"skin": 0.4 * RADIUS, "max_overlap": 0.4},
                 output={"interval": 1e-3, "history_interval": 5e-4, "formats": ["vtk", "vtkhdf", "usd"], "contacts": True,
                         "orientation": True})  # fmt: skip


def worn() -> Scene:
    """A mesh that moves through the grains and wears, a belt, a field with a potential: all columns that are sums."""
    walls = [{"name": f"p{k}", "material": "a", "plane": {"point": p, "normal": n}} for k, (p, n) in enumerate(BOX)]
    walls[0]["surface_velocity"] = [0.5, 0, 0]
    walls.append({"name": "blade", "material": "b", "mesh": BOX_MESH, "scale": [1e-3, 9e-3, 4e-3], "open": True,
                  "translate": [-6e-3, -4.5e-3, 0.5e-3], "motion": {"velocity": [0.4, 0, 0.3]}})  # fmt: skip
    measures = {
        "energy": True, "momentum": True,
        "flow": [{"name": "disk", "point": [0, 0, 6e-3], "normal": [0, 0, 1], "radius": 4e-3},
                 {"name": "heavy", "point": [0, 0, 4e-3], "normal": [0, 0, -1], "of": {"material": "b"}}],
        "wear": {"archard": {"coefficient": 1e-4, "hardness": "1 GPa"}, "finnie": {"pressure": "1 GPa"}},
    }  # fmt: skip
    grains = [{"material": kind, **{k: v[part] for k, v in lattice((6, 5, 5), 2.2e-3, (-3.3e-3, -4.4e-3, 1.5e-3), 6).items()}}
              for kind, part in (("a", slice(0, 80)), ("b", slice(80, 150)))]  # fmt: skip
    fields = [{"model": "harmonic", "parameters": {"stiffness": 1e-2, "centre": [4e-3, 0, 0.01]}}]
    return scene("worn", frame={"axis": [0, 1, 0.2], "rate": 20}, walls=walls, grains=grains, measures=measures, fields=fields)


def belted() -> Scene:
    """A law of springs that yield and stick by their history, twisting, a belt; speeds are held relative to axes that turn."""
    walls = [{"name": "belt", "material": "a", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]},
              "surface_velocity": [0.5, 0, 0]}]  # fmt: skip
    numbers = {**NUMBERS, "stiffness": 300, "unloading_stiffness": 900, "adhesion_stiffness": 100}
    pairs = [{"materials": list(pair), **numbers} for pair in (("a", "a"), ("a", "b"), ("b", "b"))]
    grains = [{"material": "a", **lattice((6, 5, 4), 2.0e-3, (-5e-3, -4e-3, 1e-3), 7)}]
    frame = {"axis": [0, 1, 0.2], "schedule": [{"until": 1e-3, "rate": [0, 40]}, {"rate": 40}]}
    return scene("belted", frame=frame, walls=walls, grains=grains, pairs=pairs,
                 contact={"normal": "luding", "rolling": "constant", "twisting": "marshall"},
                 engine={"skin": 0.4 * RADIUS, "max_overlap": 0.5, "integrator": "velocity_verlet"})  # fmt: skip


def pressed(cells: dict | None = None) -> Scene:
    """A lid that a servo presses, a free body between grains; both budgets."""
    walls = [{"name": f"p{k}", "material": "a", "plane": {"point": p, "normal": n}} for k, (p, n) in enumerate(BOX)]
    walls += [
        {"name": "lid", "material": "b", "plane": {"point": [0, 0, 12e-3], "normal": [0, 0, -1]},
         "servo": {"axis": [0, 0, -1], "force": 0.5, "max_speed": 0.5}},
        {"name": "ball", "material": "b", "sphere": {"centre": [0, 0, 5.5e-3], "radius": 2.5e-3, "inside": False},
         "free": {"joint": "none", "centre": [0, 0, 5.5e-3], "mass": "20 g", "inertia": [1e-6, 1e-6, 1e-6],
                  "velocity": [0.2, 0, 0]}},
    ]  # fmt: skip
    if cells is None:
        cells = lattice((6, 6, 5), 2.2e-3, (-5.5e-3, -5.5e-3, 1.1e-3), 8)
    far = np.linalg.norm(cells["positions"] - [0, 0, 5.5e-3], axis=1) > 3.6e-3
    return scene("pressed", walls=walls, grains=[{"material": "a", **{name: values[far] for name, values in cells.items()}}],
                 measures={"energy": True, "momentum": True})  # fmt: skip


def held() -> Scene:
    """The same with three grains, so that some ranks have none and move the walls all the same."""
    cells = {"positions": np.array([[-3.7e-3, 0, 5.5e-3], [4.6e-3, 0, 5.5e-3], [0, 0, 10.8e-3]]), "radii": np.full(3, RADIUS)}
    return pressed({**cells, "velocities": np.array([[0.5, 0, 0], [-0.5, 0, 0], [0, 0, 0.3]])})


def phased() -> Scene:
    """A stream whose second phase starts from the state that the first one left, other gravity and a stream that goes on."""
    first = {"name": "fill", "time": {"end": 2e-3, "step": 2e-5, "max_speed": 1}}
    second = {"name": "tilt", "gravity": [-40, 0, -40]}
    return poured(title="phased", phases=[first, second])


def clumped() -> Scene:
    """Clumps and spheres, poured between periodic and open borders onto a sloping floor, and out of a hole; both budgets."""
    rod = [{"centre": [0, 0, 0.9e-3 * k], "radius": 0.8 * RADIUS} for k in range(4)]
    rng = np.random.default_rng(9)
    groups = []
    for clump, shape, apart, low in (
        ("pair", (4, 4, 2), 3.8e-3, (-6e-3, -6e-3, 2e-3)), ("rod", (3, 3, 2), 5e-3, (-5e-3, -5e-3, 10e-3)),
        (None, (5, 5, 1), 3e-3, (-6e-3, -6e-3, 18.5e-3)),
    ):  # fmt: skip
        cells = {name: values for name, values in lattice(shape, apart, low, 10).items() if name not in ("ids", "radii")}
        turns = {"clump": clump, "orientations": rng.normal(size=(len(cells["spins"]), 4))} if clump else {"radius": RADIUS}
        groups.append({"material": "a" if clump else "b", **cells, **turns})
    stream = {"material": "a", "clump": "pair", "box": {"min": [-5e-3, -5e-3, 20e-3], "max": [5e-3, 5e-3, 24e-3]},
              "velocity": [0.3, 0, -1], "count_rate": 1e4, "seed": 3}  # fmt: skip
    border = {"min": -8e-3, "max": 8e-3, "kind": "periodic"}
    walls = [{"name": "floor", "material": "a", "plane": {"point": [0, 0, 0], "normal": [0, 0.1, 1]}}]
    numbers = {"restitution": 0.6, "friction": 0.5}
    pairs = [{"materials": list(pair), **numbers} for pair in (("a", "a"), ("a", "b"), ("b", "b"))]
    return scene("clumped", pairs=pairs, contact={"normal": "hertz"}, grains=groups, streams=[stream], walls=walls,
                 clumps={"pair": {"spheres": rod[:2]}, "rod": {"spheres": rod}}, measures={"energy": True, "momentum": True},
                 borders={"x": border, "y": border | {"kind": "open"}}, gravity=[60, 0, -300],
                 outlets=[{"name": "hole", "box": {"min": [2e-3, -1, -1], "max": [6e-3, 1, 1.2e-3]}}],
                 time={"end": 4e-3, "step": 1e-5, "max_speed": 2},
                 engine={"skin": 0.4 * RADIUS, "max_overlap": 0.5})  # fmt: skip


def soaked() -> Scene:
    """Wet grains that rain on a wet floor, in bridges with each other, and leave by a hole and an open border."""
    numbers = {**NUMBERS, "surface_tension": 0.02, "contact_angle": "20 deg", "viscosity": "5 mPa s", "roughness": "2 um"}
    heap = lattice((6, 6, 2), 2.1e-3, (-5.2e-3, -5.2e-3, 1e-3), 4)
    walls = [{"name": "floor", "material": "a", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}, "liquid_film": "20 um"}]
    stream = {"material": "b", "box": {"min": [-4e-3, -4e-3, 8e-3], "max": [4e-3, 4e-3, 14e-3]}, "velocity": [0.3, 0, -1],
              "diameter": {"uniform": ["1 mm", "1.5 mm"]}, "count_rate": 2e4, "seed": 3, "liquid_content": 0.02}  # fmt: skip
    return poured(title="soaked", walls=walls, streams=[stream], measures={"energy": True, "residence": [{"name": "all"}]},
                  grains=[{"material": "a", "liquid_content": 0.03, **heap}], gravity=[60, 0, -120],
                  pairs=[{"materials": list(pair), **numbers} for pair in (("a", "a"), ("a", "b"), ("b", "b"))],
                  contact={"normal": "hertz", "rolling": "constant", "liquid": "bridge_rabinovich"})  # fmt: skip


ALL = stirred, sizes, few, poured, drained, milled, worn, belted, pressed, held, phased, clumped, soaked
SCENES = {one.__name__: one for one in ALL}


def in_pieces(scene: Scene, pieces: str) -> Scene:
    """The scene with frames in all formats, in pieces or in one."""
    output = scene.output.model_copy(update={"formats": ["vtk", "vtkhdf", "usd"], "pieces": pieces})
    return scene.model_copy(update={"output": output})
