"""Scenes that hold every key that a scene file may have, and the tables that hold them."""

from pathlib import Path
from typing import get_args

import numpy as np
from pydantic import BaseModel

from law_beds import in_a_bed
from usd_stages import new_stage
from warpdem import Scene
from warpdem.scene import pair_keys
from warpdem.scene.file import scene_from_dict
from warpdem.scene.models import model_names

NAMES = ("glass bead", "glass_bead", "é", "steel")
LIQUID = {"surface_tension": 0.0712, "contact_angle": 0.31, "viscosity": 1.1e-3, "roughness": 1.3e-6}
LAWS = {
    "hooke": {"stiffness": 1234.5, "tangential_stiffness_ratio": 0.3},
    "dmt": {"surface_energy": 0.0123, "tail_length": 1.7e-8},
    "jkr": {"surface_energy": 0.0123},
    "jkr_fixed_load": {"surface_energy": 0.0123},
    "sjkr": {"cohesion_energy_density": 12345.6},
    "luding": {
        "stiffness": 1234.5, "unloading_stiffness": 2345.6, "plasticity_depth": 0.031, "adhesion_stiffness": 56.7,
        "tangential_stiffness_ratio": 0.3,
    },
    "edinburgh": {
        "surface_energy": 0.0123, "pull_off_force": 1.1e-5, "plasticity_ratio": 0.61, "tensile_exponent": 2.5,
        "slope_exponent": 1.5, "tangential_stiffness_ratio": 0.3,
    },
    "spring": {"rolling_damping": 0.21},
    "bridge": LIQUID, "bridge_rabinovich": LIQUID,
}  # fmt: skip
"""A value of each key that a law of the package reads; a normal law that is not here takes those of its test file."""
READ = pair_keys.of_package().keys()
LAWS |= {law: keys for law in model_names("normal") if law not in LAWS and (keys := in_a_bed(law)) and READ & keys.keys()}


def everything(folder: Path) -> Scene:
    """A scene with what the gallery lacks: odd names, digits beyond single precision, lists in lists, files."""
    np.savez(folder / "state.npz", position=[[0.0, 0.0, 0.5]], radius=[0.01])
    (folder / "lid.obj").write_text("o lid\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", encoding="utf-8")
    rng = np.random.default_rng(0)
    return scene_from_dict(
        {
            "title": 'a "title"\twith \\ and \x7f and é',
            "gravity": [0.1, 0.2, -9.80665],
            "materials": {
                name: {"density": 2500.0 + 1e-9, "young_modulus": 1e7 / 3.0, "poisson_ratio": 0.3}
                for name in NAMES
            },
            "contact": {"rolling": "spring", "torsion": True},
            "pairs": [
                {"materials": [a, b], "restitution": 0.1 + 0.2, "friction": 1 / 3, "rolling_friction": 0.1}
                for k, a in enumerate(NAMES)
                for b in NAMES[k:]
            ],
            "grains": [
                {"material": "é", "file": "state.npz"},
                {
                    "material": "glass bead", "positions": rng.random((3, 3)), "radii": rng.uniform(0.001, 0.002, 3),
                    "velocities": rng.random((3, 3)), "spins": rng.random((3, 3)), "ids": [7, 2**40, 3], "name": "first layer",
                },
                {"material": "steel", "positions": [[2.0, 0.0, 0.0]], "diameters": [0.1 / 3.0]},
                {
                    "material": "glass_bead",
                    "fill": {"box": {"min": [0, 0, 2], "max": [1, 1, 3]}, "count": 3,
                             "diameter": {"cumulative": [[0.01, 0.0], [0.02, 0.5], [0.03, 1.0]], "by": "mass"}},
                },
            ],
            "walls": [
                {"name": "a-b", "material": "steel", "plane": {"point": [0, 0, -1], "normal": [1, 2, 3]}},
                {"name": "lid", "material": "steel", "mesh": "lid.obj", "part": "lid", "scale": [1e-3, 1 / 3, 2], "open": True,
                 "driven": True, "surface_velocity": [0.1, 1 / 3, 0]},
                {"name": "belt", "material": "steel", "cylinder": {"point": [0, 0, -9], "axis": [0, 1, 0], "radius": 0.1},
                 "surface_velocity": {"axis": [0, 1, 0], "table": [[0, 0.1], [1, 1 / 3]], "until": 0.7}},
                {"name": "ramp", "material": "steel", "plane": {"point": [0, 0, -2], "normal": [0, 0, 1]},
                 "surface_velocity": {"axis": [0, 1, 0], "schedule": [{"until": 1, "speed": [0, 1]}, {"speed": 1}]}},
                {"name": "press", "material": "steel", "plane": {"point": [0, 0, 9], "normal": [0, 0, -1]},
                 "servo": {"axis": [1, 0, -1], "pressure": [[0, 0.1], [1, 1 / 3]], "area": 0.3, "max_speed": 0.1, "start": 1}},
                {"name": "flap", "material": "steel", "plane": {"point": [0, 0, 7], "normal": [0, 0, -1]},
                 "fixed_to": "laboratory",
                 "free": {"joint": "hinge", "axis": [0, 1, 0], "origin": [0.1, 0, 0], "inertia": 1 / 3, "mass": 0.1,
                          "centre": [0.1, 0, 0.1], "motor": [[0, 1 / 3], [1, 0]], "range": [-1, 1],
                          "torque": [[0, 0], [1, 2]]}},
                {"name": "deck", "material": "steel", "plane": {"point": [0, 0, 5], "normal": [0, 0, -1]},
                 "fixed_to": "laboratory",
                 "free": {"joint": "none", "mass": 1, "centre": [0, 0, 1 / 3], "inertia": [1, 2, 2.5], "spin": [0, 1 / 3, 0],
                          "mounts": [{"point": [0, 0, 1], "stiffness": 3, "damping": 0.1}, {"point": [1, 0, 1]}]}},
                {"name": "sieve", "material": "steel", "plane": {"point": [0, 0, 6], "normal": [0, 0, -1]},
                 "fixed_to": "laboratory",
                 "free": {"joint": "slider", "axis": [0, 0, 1], "mass": 0.1, "stiffness": 1 / 3, "damping": 0.1, "rest": 0.1}},
                {"name": "rotor", "material": "steel", "plane": {"point": [0, 0, 4], "normal": [0, 0, -1]},
                 "fixed_to": "laboratory",
                 "free": {"joint": "none", "mass": 1, "centre": [0, 0, 1 / 3], "inertia": [1, 2, 2.5], "axes": [1, 0, 2, 0]}},
                {"name": "vane", "material": "steel", "plane": {"point": [0, 0, 8], "normal": [0, 0, -1]},
                 "servo": {"axis": [0, 1, 0], "origin": [0.1, 0, 0], "torque": 0.1, "max_rate": "5 rpm"}},
                {
                    "name": "a_b", "material": "steel", "cone": {"apex": [0, 0, -1], "axis": [0, 0, 1], "half_angle": "30 deg"},
                    "motion": [
                        {"velocity": [0, 0, 0]}, {"axis": [1, 1, 0], "table": [[0.0, 1.0], [0.5, 2.0], [1.0, -1.0]]},
                        {"schedule": [{"until": 0.2, "velocity": [[0, 0, 0], [0, 0, 1]]}, {"velocity": [0, 0, 1]}]},
                        {"table": [[0.0, 0, 0, 1], [1.0, 0, 0.1, 0]], "start": 0.1, "until": 0.9},
                        {"axis": [0, 0, 1], "rate": 1, "pitch": "5 mm"},
                    ],
                },
            ],
            "frame": [
                {"axis": [0, 0, 1], "schedule": [{"until": 0.5, "rate": [0, "30 rpm"]}, {"rate": "30 rpm"}]},
                {"axis": [1, 0, 0], "sinusoid": {"amplitude": 2.0, "frequency": "3 Hz"}},
                {"amplitude": [0.0, 0.1, 0.0], "frequency": 2.0, "phase": 0.1},
            ],
            "fields": [{"model": "lorentz", "parameters": {"charge": 1e-9, "magnetic": [0.0, 0.0, 0.1]}}],
            "borders": {"x": {"min": -3.0, "kind": "open"}, "z": {"min": -4.0, "max": 5.0, "kind": ["open", "stop"]}},
            "outlets": [{"name": "drain", "box": {"min": [0, 0, -3], "max": [1, 1, -2]}}],
            "streams": [{"material": "é", "box": {"min": [0, 0, 3], "max": [1, 1, 4]}, "diameter": 0.01, "count_rate": 5}],
            "measures": {
                "momentum": True,
                "flow": [{"name": name, "point": [0, 0, 0], "normal": [0, 0, -1]} for name in ("a-b", "a_b")],
                "regions": [{"name": "all"}, {"name": "bed", "box": {"min": [0, 0, 0], "max": [1, 1, 1]}}],
                "mixing": [{"name": "list", "by": "material", "cell": "15 mm"},
                           {"name": "other", "first": {"diameter": [0, "15 mm"]}, "cell": "15 mm"}],
                "profiles": [{"name": "p", "box": {"min": [0, 0, 0], "max": [1, 1, 1]}, "along": "y", "slices": 3,
                              "of": {"material": "é", "group": "grains[0]"}}],
                "grid": {"box": {"min": [0, 0, 0], "max": [1, 1, 1]}, "cell": 0.1},
                "wear": {"start": 0.1, "archard": {"coefficient": 1e-4, "hardness": 1e9},
                         "finnie": {"pressure": 1e9, "force_ratio": 1.5, "depth_ratio": 2.5}},
            },
            "observers": [{"name": "v", "model": "speed", "reduce": ["mean", "max"]}],
            "phases": [
                {"name": "first", "time": {"end": 0.5}},
                {
                    "name": "second", "without": ["a_b"], "gravity": [0, 0, -1e-50], "materials": {"é": {"density": 1000.0}},
                    "walls": [{"name": "a-b", "motion": {"velocity": [0, 0, 1]}},
                              {"name": "new", "material": "steel", "sphere": {"centre": [0, 0, 9], "radius": 0.5}}],
                    "measures": {"flow": [{"name": "late", "point": [0, 0, 0], "normal": [0, 0, 1]}]},
                    "streams": [], "observers": [{"name": "v", "model": "speed", "reduce": ["min"]}],
                },
            ],
            "time": {"end": 1.0, "step": "auto"},
            "output": {"formats": ["vtkhdf"], "contacts": True, "orientation": True, "history_interval": "1 ms"},
            "engine": {"skin": "0.1 mm", "guards": "record", "precision": "mixed"},
        },
        folder,
    )  # fmt: skip


def plant(folder: Path) -> Scene:
    """What ``everything`` leaves out: regions of every shape and place, streams, free walls, servos, clumps."""
    (folder / "hull.obj").write_text("o hull\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", encoding="utf-8")
    (folder / "solid.step").write_text("ISO-10303-21;", encoding="utf-8")
    stage = new_stage(folder / "hull.usda")
    stage.DefinePrim("/hull", "Xform")
    stage.Save()
    (folder / "rod.csv").write_text("x,y,z,radius\n0,0,0,0.01\n0.01,0,0,0.01\n", encoding="utf-8")
    mesh = {"file": "hull.obj", "scale": [1, 2, 1 / 3], "rotate": {"axis": [0, 0, 1], "angle": 0.1}, "translate": [0.1, 0, 0]}
    cylinder = {"point": [0, 0, 1 / 3], "axis": [0, 0.6, 0.8], "radius": 0.3, "length": 1 / 3}
    sphere, box = {"centre": [1 / 3, 0, 0], "radius": 0.7}, {"min": [0, 0, 0], "max": [1, 1, 1 / 3]}
    disk = {"point": [0, 0, 1 / 3], "normal": [0, 0, -1], "radius": 0.2}
    lab, on = {"fixed_to": "laboratory"}, {"follows": "arm"}
    chosen = {"material": "g", "group": "fed", "diameter": [0, 1 / 3]}
    floor = {"material": "g", "plane": {"point": [0, 0, -9], "normal": [0, 0, 1]}}
    shapes = [{"box": box}, {"cylinder": cylinder}, {"sphere": sphere}, {"mesh": mesh}, {"disk": disk}, {"face": mesh}]
    away = [{"box": {"min": [5, 0, 0], "max": [6, 1, 1 / 3]}}, {"cylinder": cylinder | {"point": [5, 0, 1 / 3]}},
            {"sphere": sphere | {"centre": [5, 0, 1 / 3]}}, {"mesh": mesh | {"translate": [5, 0, 1 / 3]}}]  # fmt: skip
    totals = [
        {"count": 7, "start": 0.1, "until": 1 / 3}, {"mass": 1 / 3}, {"mass_rate": [[0, 0.1], [0.5, 1 / 3]], "mass": 2.0},
        {"count_rate": [[0, 1], [0.5, 3]]}, {"count_rate": 3, "velocity": [0, 0, -1 / 3]}, {"mass_rate": 1 / 3, "seed": 5},
    ]  # fmt: skip
    inserted = [
        {"material": "g", "diameter": 0.01, "name": "fed", "liquid_content": 0.01},
        {"recipe": [{"material": "g", "diameter": {"normal": {"mean": 0.01, "deviation": 1e-3, "min": 8e-3, "max": 0.012}},
                     "mass_share": 1 / 3, "name": "coarse", "liquid_content": 0.02},
                    {"material": "g", "clump": "rod", "size": 1 / 3, "orientation": [1, 0, 0, 0.1], "mass_share": 0.5}]},
        {"recipe": [{"material": "g", "diameter": {"lognormal": {"mean": 0.01, "deviation": 1e-3, "min": 8e-3, "max": 0.012}},
                     "number_share": 3}]},
        {"material": "g", "clump": "rod", "size": 1 / 3, "orientation": "aligned"},
        {"material": "g", "diameter": {"table": [[0.01, 0.5], [0.02, 0.5]]}},
        {"material": "g", "diameter": {"uniform": [0.01, 0.02]}},
    ]  # fmt: skip
    places = [{}, lab, on, {}, lab, on]
    free = {
        "slide": {"joint": "slider", "axis": [0, 0, 1], "mass": 0.1, "velocity": 1 / 3, "force": [[0, 0.1], [1, 1 / 3]],
                  "motor": [[0, 1 / 3], [1, 0]], "range": [-1, 1 / 3]},
        "door": {"joint": "hinge", "axis": [0, 0, 1], "inertia": 0.1, "rate": 1 / 3, "stiffness": 0.1, "rest": 0.2,
                 "damping": 0.3},
        "raft": {"joint": "none", "mass": 0.1, "centre": [0, 0, 0], "inertia": [1, 1, 1], "velocity": [0, 0, 1 / 3],
                 "force": [0, 0.1, 0], "torque": [1 / 3, 0, 0], "mounts": [{"point": [0, 0, 0], "anchor": [0, 0, 1 / 3]}]},
    }  # fmt: skip
    (folder / "bed.h5").write_bytes(b"")
    fills = [
        {"tile": "bed.h5", "copies": [2, 1, 3], "spacing": [0.1, 1 / 3, 0.2]},
        {"cylinder": cylinder, "mass": 1 / 3, "diameter": 0.01}, {"sphere": sphere, "height": 0.1, "diameter": 0.01},
        {"mesh": mesh, "count": 3, "diameter": 0.01}, {"wall": "hull", "region": box, "point": [0.1, 0, 0], "count": 3,
                                                       "diameter": 0.01, "seed": 3},
    ]  # fmt: skip
    of_clumps = [
        {"clump": "rod", "fill": {"box": box, "count": 3, "size": size, "orientation": turned}}
        for size, turned in (({"uniform": [0.5, 1.5]}, "aligned"), ({"table": [[1, 0.5], [2, 0.5]]}, [1, 0, 0, 2]))
    ]  # fmt: skip
    return scene_from_dict(
        {
            "materials": {name: {"density": 2500, "young_modulus": 1e7, "poisson_ratio": 0.3} for name in ("g", "sieve")},
            "contact": {"twisting": "marshall", "liquid": "bridge"},
            "pairs": [{"materials": ["g", "g"], "restitution": 0.5, "friction": 0.1, **LAWS["bridge"]},
                      {"materials": ["g", "sieve"], "contact": False}],
            "clumps": {
                "rod": {"file": "rod.csv", "inertia": "given", "mass": 0.1, "moments": [1, 1, 1 / 3], "centre": [0.1, 0, 0],
                        "axes": [1, 0, 0, 2]},
                "stone": {"fit": {"spheres": 5, "coverage": 0.9, "outside": 1e-3}, "mesh": "hull.obj", "scale": 1 / 3},
            },
            "grains": [{"material": "g", "fill": fill} for fill in fills] + [{"material": "g", **one} for one in of_clumps] + [
                {"material": "g", "clump": "rod", "positions": [[0, 0, 9]], "orientations": [[1, 0, 0, 2]], "sizes": [1 / 3]}],
            "walls": [
                {"name": "arm", **floor, "torque_about": [0, 0, 1 / 3], "liquid_film": 1e-6, "motion": [
                    {"axis": [0, 0, 1], "rate": 1, "start": 0.1, "until": 1 / 3}, {"quaternion": [1, 0, 0, 2]},
                    {"shift": [0, 0, 1 / 3]}, {"axis": [0, 1, 0], "sinusoid": {"amplitude": 1, "frequency": 1, "phase": 0.1,
                                                                               "mean": 0.2}}]},
                {"name": "ball", "material": "g", "sphere": {"centre": [0, 0, 1 / 3], "radius": 0.1, "inside": False}},
                {"name": "funnel", "material": "g", "cone": {"apex": [0, 0, -1], "axis": [0, 0, 1], "half_angle": 0.3,
                                                             "start": 0.1, "end": 1 / 3, "inside": False}},
                {"name": "belt", **floor, "surface_velocity": {"axis": [0, 1, 0], "speed": 1 / 3, "start": 0.1}},
                {"name": "press", **floor, "servo": {"axis": [0, 0, 1], "force": 1 / 3, "max_speed": 1, "until": 0.5}},
                {"name": "hull", "material": "g", "mesh": "hull.obj", "open": True},
                {"name": "solid", "material": "sieve", "mesh": "solid.step", "tolerance": 1e-4 / 3,
                 "motion": {"usd": "hull.usda", "prim": "/hull", "start": 0.1, "until": 1 / 3}},
                *({"name": name, **floor, **lab, "free": keys} for name, keys in free.items()),
            ],
            "fields": [{"model": "drag", "axes": "frame", "parameters": {"coefficient": 1e-9}}],
            "borders": {"x": {"min": -3.0, "kind": "open"}, **lab},
            "outlets": [
                {"name": f"out{k}", **shape, **place} for k, (shape, place) in enumerate(zip(away, places, strict=False))
            ] + [{"name": "below", "plane": {"point": [0, 0, -5], "normal": [0, 0, -1], "radius": 1 / 3}}],
            "streams": [
                shape | total | what | place
                for shape, total, what, place in zip(shapes, totals, inserted, places, strict=True)
            ],
            "measures": {
                "flow": [{"name": "f", "point": [0, 0, 0], "normal": [0, 0, 1], "radius": 1 / 3, **lab, "of": chosen}],
                "regions": [{"name": f"r{k}", **shape, **place, "of": chosen, "fabric": True}
                            for k, (shape, place) in enumerate(zip(shapes[:4], places, strict=False))],
                "profiles": [{"name": f"p{k}", "box": box, "along": "z", "slices": 2, "fabric": True, **place}
                             for k, place in enumerate((lab, on))],
                "residence": [{"name": "t", "outlet": "below", "of": chosen}],
                "mixing": [{"name": "m", "first": chosen, "cell": 0.1}],
                "grid": {"box": box, "cell": 0.1, "width": 1 / 3, **lab},
            },
            "observers": [{"name": "v", "model": "speed", "axes": "frame"}],
            "time": {"end": 1.0, "accuracy": "impact", "max_speed": 1 / 3},
            "output": {"interval": 0.1, "wall_loads": False, "picture": False, "pieces": "one", "checkpoint_interval": 0.2,
                       "checkpoint_wall_time": 3},
            "engine": {"max_overlap": 1 / 3},
        },
        folder,
    )  # fmt: skip


def remainder(folder: Path) -> Scene:
    """What neither ``everything`` nor ``plant`` has."""
    plant(folder)  # its files
    floor = {"material": "g", "plane": {"point": [0, 0, -9], "normal": [0, 0, 1]}}
    return scene_from_dict(
        {
            "materials": {"g": {"density": 2500, "young_modulus": 1e7, "poisson_ratio": 0.3}},
            "contact": {"normal": "hooke", "tangential": "none", "liquid": "bridge"},
            "pairs": [{"materials": ["g", "g"], "restitution": 0.5, **LAWS["hooke"], **LIQUID}],
            "clumps": {"pair": {"spheres": [{"centre": [0, 0, 1 / 3], "radius": 0.2}, {"centre": [0, 0, 0], "radius": 0.1}]}},
            "grains": [
                {"material": "g", "radius": 0.1, "positions": [[0, 0, 1 / 3]], "velocities_in": "laboratory"},
                {"material": "g", "diameter": 0.1, "positions": [[0, 0, 1]], "liquid_content": 0.01},
                {"material": "g", "fill": {"box": {"min": [2, 0, 0], "max": [3, 1, 1]}, "solid_fraction": 1 / 3,
                                           "diameter": 0.1}},
            ],
            "walls": [
                {"name": "floor", **floor},
                {"name": "hull", "material": "g", "mesh": "hull.usda", "prim": "/hull", "translate": [0, 0, 9],
                 "rotate": {"axis": [0, 0, 1], "angle": 0.1}},
                {"name": "tube", "material": "g", "cylinder": {"point": [0, 0, 9], "axis": [0, 0, 1], "radius": 0.5,
                                                               "length": 1 / 3, "inside": False}},
            ],
            "frame": {"axis": [0, 0, 1], "rate": 1, "origin": [0.1, 0, 0]},
            "measures": {"energy": True},
            "borders": {"y": {"max": 5.0, "kind": "open"}},
            "time": {"end": 1.0},
            "engine": {"integrator": "exact_drift"},
        },
        folder,
    )  # fmt: skip


def continued(folder: Path) -> Scene:
    """A scene that starts from a checkpoint."""
    (folder / "bed.h5").write_bytes(b"")
    return scene_from_dict(
        {
            "materials": {"g": {"density": 2500, "young_modulus": 1e7, "poisson_ratio": 0.3}},
            "pairs": [{"materials": ["g", "g"], "restitution": 0.5}],
            "start": {"checkpoint": "bed.h5", "continues": ["frame"]},
            "frame": {"axis": [0, 0, 1], "rate": 1},
            "time": {"end": 1.0},
        },
        folder,
    )


def of_law(law: str, folder: Path) -> Scene:
    """A scene with all keys that a contact law reads."""
    [role] = {role for _, laws in pair_keys.of_package().values() for role, name in laws if name == law}
    return scene_from_dict(
        {
            "materials": {"g": {"density": 2500, "young_modulus": 1e7, "poisson_ratio": 0.3}},
            "contact": {role: law, "twisting": "marshall"},
            "pairs": [{"materials": ["g", "g"], "restitution": 0.5, "friction": 0.1, **LAWS[law]}],
            "grains": [{"material": "g", "radius": 1e-3, "positions": [[0, 0, 0.01]]}], "time": {"end": 1.0},
        },
        folder,
    )  # fmt: skip


def keys_of(kind: type[BaseModel], found: dict[str, set[str]]) -> dict[str, set[str]]:
    """Keys of a model and of all that it holds, by the name of the model."""

    def models(annotation):
        if isinstance(annotation, type) and issubclass(annotation, BaseModel):
            yield annotation
        for part in get_args(annotation):
            yield from models(part)

    if kind.__name__ not in found:
        found[kind.__name__] = {key for key in kind.model_fields if key != "elapsed"}  # of a run that goes on
        for field in kind.model_fields.values():
            for other in models(field.annotation):
                keys_of(other, found)
    return found
