"""Free walls lighter than the grains on them: the step that they chatter or rock above, by the guard and by ``check``."""

import math
import re

import numpy as np
import pytest
from warpdem.kernels.step.free_bodies import MOTION

from free_scenes import MASS, R, body_of, run, scene, slider
from warpdem.app import scene_warnings
from warpdem.guards import free_walls, stability
from warpdem.measure.observers import read_contacts
from warpdem.measure.totals import Totals


def pressed_plate(ratio, step, height=2 * R, **keys):
    """36 grains between a floor and a plate of ``ratio`` grains, 0.5 N on each."""
    x, y = (2.05 * R * a.ravel() for a in np.meshgrid(np.arange(6.0), np.arange(6.0)))
    floor = {"name": "floor", "material": "g", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}
    plate = {"plane": {"point": [0, 0, height], "normal": [0, 0, -1]}}
    engine = {"guards": "record", "max_overlap": 0.9}
    positions = np.stack([x, y, np.full(36, R)], axis=1)
    keys = {"walls": [floor], "time": {"end": 1, "step": step}, "engine": engine} | keys
    return scene(slider(ratio * MASS, force=-18.0), plate, positions, e=0.3, **keys)


@pytest.mark.parametrize("ratio, limit", [(10, 8.66e-6), (3, 3.643e-6)])
def test_a_light_plate_on_many_grains_is_told_to_chatter_and_only_then(ratio, limit):
    """At rest 4 % below the limit that the guard finds of it, and no word; chatters 4 % above, and the guard says why."""
    quiet = run(pressed_plate(ratio, 0.96 * limit))
    quiet.step(1000)
    assert abs(body_of(quiet).value("rate")) < 1e-6
    assert "stability" not in quiet.noticed
    assert quiet.guards.stability.seen.share == pytest.approx(0.96, abs=0.01)
    loud = run(pressed_plate(ratio, 1.04 * limit))
    loud.step(1000)
    assert abs(body_of(loud).value("rate")) > 0.3
    said = loud.noticed["stability"]
    assert "up to 1.02 times a run stays stable. The stiffest contacts: free wall 'body', its mass " in said
    assert re.search(r"with the 36 grains that it touches. Take a time.step below [0-9.e-]+ s, or a heavier wall.$", said)


def test_a_light_plate_on_the_end_of_its_range_is_left_alone():
    given = pressed_plate(3, 7e-6, height=1.98 * R)
    sim = run(given)
    sim.step(1)
    sim.guards.look()
    assert sim.guards.stability.seen.share > 1.02
    free = given.walls[0].free.model_copy(update={"range": (0.0, 1.0)})
    walls = [given.walls[0].model_copy(update={"free": free})]
    sim = run(given.model_copy(update={"walls": walls}))
    sim.step(1)
    sim.guards.look()
    assert sim.guards.stability.seen.share == 0.0


def test_a_hinge_and_a_free_body_are_measured_by_hand():
    """One grain on a flap at its arm l: w^2 = k/m + k l^2/I; the same on a free body: k/m + k/M. Elastic: dt = 2/w."""
    overlap = 0.01 * R
    flap = {"joint": "hinge", "axis": [0, 1, 0], "inertia": 4 * MASS * (3 * R) ** 2}
    body = {"joint": "none", "mass": 2 * MASS, "inertia": [1.0, 1.0, 1.0], "centre": [0, 0, -R]}
    for free, ratio in ((flap | {"rate": 1e-9}, 4), (body, 2)):
        sim = run(scene(free, positions=[[3 * R, 0, R - overlap]], e=1.0, time={"end": 1, "step": 8e-6}))
        sim.prepare()
        view, now = sim.view, Totals(sim.view)
        contacts, one = read_contacts(view), body_of(sim)
        found = stability.springs(view, contacts)
        grains = np.array([MASS]), np.array([0.4 * MASS * R**2])
        coupling = free_walls.coupling(one, now.bodies[one.number], contacts, found, *grains)
        k = 2 * 5e7 / (2 * 0.91) * math.sqrt(R * overlap)
        assert found.stiffness[0] == pytest.approx(k, rel=1e-7)
        assert free_walls.stable_step(coupling, 4e-5) == pytest.approx(2 / math.sqrt(k / MASS * (1 + 1 / ratio)), rel=1e-6)


def light_ball(step):
    """A free ball of two grains that 3 N press on six of them, which stand in a ring on a floor; with friction."""
    angle, radius = np.arange(6) * math.pi / 3, 6 * R
    positions = np.stack([2.02 * R * np.cos(angle), 2.02 * R * np.sin(angle), np.full(6, R)], axis=1)
    height = R + math.sqrt((7 * R) ** 2 - (2.02 * R) ** 2)
    centre = [0, 0, height]
    free = {"joint": "none", "mass": 2 * MASS, "centre": centre, "inertia": [0.8 * MASS * radius**2] * 3, "force": [0, 0, -3.0]}
    walls = [{"name": "floor", "material": "g", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}},
             {"name": "ring", "material": "g", "cylinder": {"point": [0, 0, 0], "axis": [0, 0, 1], "radius": 3.02 * R,
                                                            "inside": True}}]  # fmt: skip
    engine = {"guards": "record", "max_overlap": 0.9}
    ball = {"sphere": {"centre": centre, "radius": radius, "inside": False}}
    return scene(free, ball, positions, e=0.3, friction=0.5, walls=walls, time={"end": 1, "step": step}, engine=engine)


def test_a_light_ball_that_rocks_by_its_friction_is_told_and_only_then():
    """Its springs and dashpots across, at 6 radii from its centre, set the limit of 9.55 us."""
    for step, quiet in ((9.2e-6, True), (1e-5, False)):
        sim = run(light_ball(step))
        sim.step(2000)
        sim.guards.look()
        assert sim.guards.stability.seen.share == pytest.approx(step / 9.55e-6, rel=0.03)
        spin = np.linalg.norm(body_of(sim).motion[MOTION.of("seen_spin")])
        assert (spin < 1e-6) == quiet
        assert ("stability" not in sim.noticed) == quiet


def test_a_sphere_on_a_grain_is_measured_by_hand():
    """Across, both turn: w^2 = k_t (1/m + r^2/(2/5 m R^2) + 1/M + r^2/I). Elastic: dt = 2/w."""
    overlap, inertia = 0.01 * R, 0.5 * MASS * R**2
    ball = {"joint": "none", "mass": 2 * MASS, "inertia": [inertia] * 3, "centre": [0, 0, 0]}
    sphere = {"sphere": {"centre": [0, 0, 0], "radius": R, "inside": False}}
    sim = run(scene(ball, sphere, [[0, 0, 2 * R - overlap]], e=1.0, friction=0.5, time={"end": 1, "step": 8e-6}))
    sim.prepare()
    contacts, now = read_contacts(sim.view), Totals(sim.view)
    found = stability.springs(sim.view, contacts)
    grains = np.array([MASS]), np.array([0.4 * MASS * R**2])
    coupling = free_walls.coupling(body_of(sim), now.bodies[0], contacts, found, *grains)
    own, point = R - overlap, contacts.point[0, 2]
    square = found.stiffness[1] * (1 / MASS + own**2 / (0.4 * MASS * R**2) + 0.5 / MASS + point**2 / inertia)
    assert point == pytest.approx(R, rel=1e-9)
    assert square > 1.2 * found.stiffness[0] * 1.5 / MASS
    assert free_walls.stable_step(coupling, 4e-5) == pytest.approx(2 / math.sqrt(square[0]), rel=1e-6)


def test_check_warns_of_a_wall_lighter_than_the_grains_on_it():
    """The step that it tells is below the limit of the plate, 8.66 and 3.64 us, and not by much; none at it, none if heavy."""
    for ratio, limit in ((10, 8.66e-6), (3, 3.643e-6)):
        [said] = [text for text in scene_warnings.warnings(run(pressed_plate(ratio, 9e-6))) if "walls[0].free" in text]
        assert f"the wall has {ratio / 36:.2g} of the mass (of a hinge: of the moment of inertia) of the 36 grains" in said
        step = float(re.search(r"take at most ([0-9.e-]+) s, or a heavier wall", said)[1])
        assert 0.6 * limit < step < limit
        assert "walls[0].free" not in str(scene_warnings.warnings(run(pressed_plate(ratio, step))))
    assert "walls[0].free" not in str(scene_warnings.warnings(run(pressed_plate(40, 9e-6))))


def test_check_warns_of_a_body_that_rocks_by_its_friction():
    """The ball of two grains on six, whose limit in the run is 9.55 us: a warning above it, none with a tenth of that."""
    [said] = [text for text in scene_warnings.warnings(run(light_ball(1.2e-5))) if "walls[0].free" in text]
    step = float(re.search(r"take at most ([0-9.e-]+) s, or a heavier wall", said)[1])
    assert 0.6 * 9.55e-6 < step < 1.1 * 9.55e-6
    assert "walls[0].free" not in str(scene_warnings.warnings(run(light_ball(1e-6))))
