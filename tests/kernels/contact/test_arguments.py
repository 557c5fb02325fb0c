"""What the contact law is told: the same numbers between grains, at a wall, and by the contact of one GPU thread."""

import functools

import numpy as np
import pytest
import warp as wp
from warpdem.kernels.contact import law

from warpdem import Scene, Simulation
from warpdem.model import compiled

RADII = 1.0e-3, 2.0e-3
DENSITY, STIFFNESS, STEP = 2500.0, 500.0, 1.0e-5
TOLD = ("radius", "overlap", "overlap_before", "friction", "inertia", "damping over stiffness")
"""What the probe leaves in the contact history: the first three in place of the tangential spring, the others of the rolling
spring, where there is one."""


def probe(build):
    """``law.build`` whose law records its arguments in the contact history, in place of its springs."""

    @functools.cache
    def probing(*args, **kwargs):
        real = args[0]
        joined = build(*args, **kwargs)
        at, vec3 = joined.at, wp.types.vector(3, real)
        History, Constants, Coefficients = joined.History, joined.Constants, joined.Coefficients

        @wp.func
        def force(
            n: vec3, n_before: vec3, overlap: real, overlap_before: real, velocity: vec3, slip: vec3, turning: vec3, spin: vec3,
            spin_predicted: vec3, dt: real, k: Constants, radius: real, inertia: real, c: Coefficients, before: History,
        ):  # fmt: skip
            told = History()
            told[0] = radius
            told[1] = overlap
            told[2] = overlap_before
            if wp.static(joined.history.at.width == len(TOLD)):
                told[3] = c[wp.static(at.friction)]
                told[4] = inertia
                told[5] = k[1] / k[0]
            return vec3(), vec3(), told

        return type(joined)(**{**vars(joined), "force": force})

    return probing


@pytest.fixture
def recorded(monkeypatch):
    """Run a scene under the probe and return what its law was told, by contact."""
    monkeypatch.setattr(law, "build", probe(law.build))
    monkeypatch.setattr(compiled, "_built", compiled._built.__wrapped__)

    def run(rolling: str, precision: str = "double", speed: float = 0.0, **keywords) -> dict:
        sim = Simulation(scene(rolling, precision, speed), device="cpu", threads=1, **keywords)
        sim.step(1)
        contacts = sim.contacts()
        return {
            (int(i), int(j)): dict(zip(TOLD, (*spring, *angle), strict=True))
            for i, j, spring, angle in zip(contacts.i, contacts.j, contacts.spring, contacts.angle, strict=True)
        }

    return run


def scene(rolling: str, precision: str, speed: float) -> Scene:
    """Two unequal grains that overlap, in the floor too; one that comes down on it, 0.5 um above, at ``speed`` [m/s]."""
    pair = {"restitution": 0.6, "friction": 0.3, "stiffness": STIFFNESS, "rolling_friction": 0.2 * (rolling != "none")}
    return Scene.model_validate(
        {
            "gravity": [0, 0, 0],
            "materials": {"g": {"density": DENSITY, "young_modulus": 5e6, "poisson_ratio": 0.3}},
            "contact": {"normal": "hooke", "tangential": "mindlin", "rolling": rolling},
            "pairs": [{"materials": ["g", "g"], **pair}],
            "grains": [{"material": "g", "positions": [[0, 0, 0.95e-3], [2.95e-3, 0, 0.95e-3]], "radii": RADII}, {
                "material": "g", "radius": 1e-3, "positions": [[0.1, 0, 1e-3 + 5e-7]], "velocities": [[0, 0, -speed]]}],
            "walls": [{"name": "floor", "material": "g", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}],
            "time": {"end": 1, "step": STEP, "max_speed": 1e-3},
            "engine": {"precision": precision, "max_overlap": 0.9},
        }
    )


@pytest.mark.parametrize(("precision", "resident"), [("double", False), ("double", True), ("mixed", False)])
def test_the_law_is_told_the_same_between_grains_and_at_a_wall(recorded, precision, resident):
    """Reduced radius and mass of the two bodies, of the grain alone at a wall; inertia about the contact point."""
    told = recorded("spring", precision, resident=resident)
    mass = [DENSITY * 4.0 / 3.0 * np.pi * r**3 for r in RADII]
    inertia = [0.4 * m * r**2 for m, r in zip(mass, RADII, strict=True)]
    beta = -np.log(0.6) / np.hypot(np.log(0.6), np.pi)

    def alone(k: int, overlap: float) -> dict:
        return expected(RADII[k], mass[k], 3.5 * inertia[k], overlap)

    def expected(radius: float, m: float, i: float, overlap: float) -> dict:
        damping = 2 * beta * np.sqrt(m / STIFFNESS)
        return dict(zip(TOLD, (radius, overlap, overlap, 0.3, i, damping), strict=True))

    both = [x[0] * x[1] / (x[0] + x[1]) for x in (RADII, mass, inertia)]
    wanted = {
        (0, 1): expected(both[0], both[1], 3.5 * both[2], 5e-5),
        (0, -1): alone(0, 5e-5),
        (1, -1): alone(1, RADII[1] - 0.95e-3),
    }
    assert told.keys() == wanted.keys()
    for contact, numbers in wanted.items():
        single = precision == "mixed" and contact[1] >= 0
        for name, value in numbers.items():
            # the overlap is a difference of positions of 1e-3 m
            tolerance = 1e-6 if single else 1e-11
            assert told[contact][name] == pytest.approx(value, rel=tolerance), (contact, name)


@pytest.mark.parametrize("resident", [False, True], ids=["steps", "graph"])
def test_the_law_knows_the_reduced_radius_where_no_rolling_model_asks_for_it(recorded, resident):
    """Without a rolling model the constants of a contact hold no radius: the law is told it all the same."""
    told = recorded("none", resident=resident)
    assert told[0, 1]["radius"] == pytest.approx(RADII[0] * RADII[1] / sum(RADII), rel=1e-14)
    assert told[0, -1]["radius"] == RADII[0]


@pytest.mark.parametrize("resident", [False, True], ids=["steps", "graph"])
def test_a_new_contact_with_a_wall_knows_the_overlap_of_the_step_before(recorded, resident):
    """It had none, but was as far apart as the step took it: 0.5 um above the floor, then 0.5 um in it."""
    told = recorded("none", speed=1e-6 / STEP, resident=resident)[2, -1]
    assert told["overlap"] == pytest.approx(5e-7, rel=1e-6)
    assert told["overlap_before"] == pytest.approx(-5e-7, rel=1e-6)
