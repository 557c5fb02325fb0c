"""Scenes with one free wall, and what is read of it."""

import math

from warpdem import Scene, Simulation
from warpdem.measure.column import Readings
from warpdem.output.history import history_columns, history_row

R, DT, G = 1e-3, 5e-6, 9.81
MASS = 2500 * 4 / 3 * math.pi * R**3
PLATE = {"plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}
FAR = [[0.0, 0.0, 0.5]]


def scene(free, wall=PLATE, positions=FAR, velocities=None, *, e=0.5, friction=0.0, walls=(), **keys):
    grains = {"material": "g", "radius": R, "positions": positions, "velocities_in": "laboratory"}
    given = {
        "gravity": [0, 0, 0],
        "materials": {"g": {"density": 2500, "young_modulus": "50 MPa", "poisson_ratio": 0.3}},
        "pairs": [{"materials": ["g", "g"], "restitution": e, "friction": friction}],
        "grains": [grains | ({} if velocities is None else {"velocities": velocities})],
        "walls": [{"name": "body", "material": "g", **wall, "free": free}, *walls],
        "measures": {"energy": True},
        "time": {"end": 10, "step": DT},
    }
    return Scene.model_validate(given | keys)


def slider(mass, **keys):
    return {"joint": "slider", "axis": [0, 0, 1], "mass": mass, **keys}


def run(given, threads=1):
    return Simulation(given, device="cpu", threads=threads)


def body_of(sim):
    return sim.schedule.dynamic[0]


def columns(sim):
    """The columns of the body by their names."""
    found = history_columns(sim.scene)
    row = zip((c.name for c in found), history_row(found, Readings(sim.view)), strict=True)
    return {name.removeprefix("body "): value for name, value in row if name.startswith("body ")}
