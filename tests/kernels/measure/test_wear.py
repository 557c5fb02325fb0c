"""Wear of walls: single impacts against closed forms, sums over meshes, belts and frames, bits, results and errors."""

import math

import numpy as np
import pytest
import warp as wp
from warpdem.kernels.measure.wear import finnie

from warpdem import SceneError, Simulation
from warpdem.app.run import run_scene
from warpdem.scene.file import scene_from_dict

R, M = 1e-3, 2500.0 * 4 / 3 * math.pi * 1e-9
ALL = {"archard": {"coefficient": 1e-4, "hardness": "1 GPa"}, "finnie": {"pressure": "1 GPa"}}


def data(velocity=(0, 0, 0), place=(0, 0, R), friction=0.1, restitution=0.6, young=5e9, **more):
    """A grain of 1 mm at a plane, without gravity."""
    return {
        "gravity": [0, 0, 0],
        "materials": {"g": {"density": 2500.0, "young_modulus": young, "poisson_ratio": 0.25}},
        "contact": {"rolling": "none"},
        "pairs": [{"materials": ["g", "g"], "restitution": restitution, "friction": friction}],
        "grains": [{"material": "g", "radius": R, "positions": [list(place)], "velocities": [list(velocity)]}],
        "walls": [{"name": "floor", "material": "g", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}],
        "time": {"end": 0.01, "accuracy": "impact", "max_speed": 1.5},
        "measures": {"wear": ALL},
        **more,
    }


def simulated(**keys):
    threads = keys.pop("threads", 1)
    resident = keys.pop("resident", None)
    return Simulation(scene_from_dict(data(**keys)), device="cpu", threads=threads, resident=resident)


def impact(**keys):
    """Wear of the floor by one impact, and the simulation after it."""
    sim = simulated(place=(0, 0, 1.001 * R), **keys)
    sim.run(until=5e-4)
    assert sim.particles.velocity[0, 2] > 0 and not len(sim.contacts().i)
    return sim.wall_wear()["floor"], sim


def test_an_oblique_impact_that_slides_against_the_closed_form():
    """Int F_n |v_t| dt = v_t P - (7/4) mu P^2/m with P = (1 + e) m v_n; elastic, so that F_n never attracts."""
    found, sim = impact(velocity=(1, 0, -0.5), restitution=1.0)
    impulse = 2.0 * M * 0.5
    wanted = impulse - 1.75 * 0.1 * impulse**2 / M
    assert wanted == pytest.approx(8.639379797371932e-6, rel=1e-9)
    assert found.sliding == pytest.approx([wanted], rel=3e-3)
    assert found.normal_impulse == pytest.approx([impulse], rel=1e-3)
    assert found.shear_work == pytest.approx([0.1 * wanted], rel=3e-3)
    assert found.archard_volume == pytest.approx([1e-4 * wanted / 1e9], rel=3e-3, abs=0)
    # what the grain has lost is what both took, to round-off
    energy = sim.energy()
    lost = 0.5 * M * 1.25 - energy["kinetic"] - energy["rotational"]
    assert float(found.shear_work[0] + found.impact_work[0]) == pytest.approx(lost, rel=1e-9, abs=0)
    assert found.normal_impulse[0] == pytest.approx(M * (sim.particles.velocity[0, 2] + 0.5), rel=1e-12, abs=0)


ANGLES = [(10, 6.585801170060691e-16), (math.degrees(math.atan(1 / 3)), 7.85398163397e-16), (30, 6.544984694978736e-16),
          (60, 2.1816615649929e-16)]  # fmt: skip
"""Angle [degrees], and volume [m3] of an impact of pi/3 1e-5 kg at 1 m/s with p = 1 GPa, K = 2, psi = 2."""


@pytest.mark.parametrize(("angle", "volume"), ANGLES)
def test_impacts_erode_by_finnie(angle, volume):
    a = math.radians(angle)
    by_hand = math.sin(2 * a) - 3 * math.sin(a) ** 2 if math.tan(a) <= 1 / 3 else math.cos(a) ** 2 / 3
    found, _ = impact(velocity=(math.cos(a), 0, -math.sin(a)))
    assert found.finnie_volume == pytest.approx([M * by_hand / 4e9], rel=5e-3, abs=0)
    assert M * by_hand / 4e9 == pytest.approx(volume * M / 1.0471975512e-5, rel=1e-9, abs=0)


def reaching(**keys):
    """A grain at a wall that pulls weakly from 31 um on, without friction or losses."""
    pair = {"materials": ["g", "g"], "restitution": 1.0, "friction": 0.0, "surface_energy": 1e-4, "tail_length": "1 um"}
    return simulated(contact={"rolling": "none", "normal": "dmt"}, pairs=[pair], young=5e6, **keys)


def test_a_grain_that_flies_past_within_the_reach_of_the_law_erodes_nothing():
    sim = reaching(place=(0, 0, R + 35e-6), velocity=(0.5, 0, -0.05))
    sim.run(until=4e-4)
    found = sim.wall_wear()["floor"]
    assert 10e-6 < sim.particles.position[0, 2] - R < 20e-6
    assert found.normal_impulse[0] < 0.0  # it was pulled
    assert found.erosion[0] == found.finnie_volume[0] == 0.0


def test_a_grain_that_bounces_within_the_reach_of_the_law_erodes_each_time():
    """From 10 um it falls for 1.4 ms, touches at 14 mm/s, and rises as high again."""
    sim = reaching(place=(0, 0, R + 10e-6), velocity=(0.02, 0, 0), gravity=[0, 0, -9.81])
    speed = math.sqrt(2 * 9.81 * 10e-6)
    assert 2.0 * 0.02 < 6.0 * speed  # steep: (K/6) cos^2 a
    once = M * 2.0 / 6.0 * 0.02**2
    touches = []
    for until in (1.3e-3, 2.6e-3, 6e-3):
        sim.run(until=until)
        assert sim.particles.position[0, 2] - R < 25e-6
        touches.append(sim.wall_wear()["floor"].erosion[0] / once)
    assert touches == pytest.approx([0.0, 1.0, 2.0], rel=1e-9, abs=1e-12)


def test_an_impact_from_below_or_none_erodes_nothing():
    @wp.kernel(enable_backward=False)
    def cut(out: wp.array(dtype=wp.float64)):
        out[0] = finnie(wp.float64(-0.1), wp.float64(1.0), wp.float64(2.0))
        out[1] = finnie(wp.float64(0.0), wp.float64(1.0), wp.float64(2.0))
        out[2] = finnie(wp.float64(1.0), wp.float64(0.0), wp.float64(2.0))
        out[3] = finnie(wp.float64(0.3), wp.float64(0.4), wp.float64(2.0))

    out = wp.zeros(4, dtype=wp.float64, device="cpu")
    wp.launch(cut, 1, [out], device="cpu")
    assert out.numpy()[:3].tolist() == [0, 0, 0]
    assert out.numpy()[3] == pytest.approx(0.25 * (math.cos(math.atan2(0.3, 0.4)) ** 2) / 3)


SHEET = {"name": "floor", "material": "g", "mesh": "floor.obj", "open": True}


def write_sheet(folder):
    """A floor of 4 x 4 mm made of four squares of two triangles each, from (-2, -2) to (2, 2) mm; numbers row by row."""
    lines = [f"v {x} {y} 0" for y in (-2, 0, 2) for x in (-2, 0, 2)]
    for row, column in ((0, 0), (0, 1), (1, 0), (1, 1)):
        a = 3 * row + column + 1
        lines += [f"f {a} {a + 1} {a + 4}", f"f {a} {a + 4} {a + 3}"]
    (folder / "floor.obj").write_text("\n".join(lines))


def resting(folder, **more):
    """Four grains of a weight each, on the third square two of them: at rest on the sheet."""
    write_sheet(folder)
    sink = 2.02e-7  # where the Hertz spring of 5 MPa bears m g
    places = [[-1e-3, -1e-3], [-1.6e-3, 1e-3], [0.4e-3, 1.1e-3]]
    grains = [{"material": "g", "radius": 4e-4, "positions": [[*p, 4e-4 - sink] for p in places]}]
    keys = {"gravity": [0, 0, -9.81], "young": 5e6, "walls": [{**SHEET, "scale": 1e-3}], "grains": grains, **more}
    keys |= {"time": {"end": 0.4, "max_speed": 0.1}}
    return scene_from_dict(data(**keys), folder)


def test_mean_pressure_over_the_triangles_bears_the_weight(tmp_path):
    sim = Simulation(resting(tmp_path, measures={"wear": {"start": 0.2}}), device="cpu", threads=1)
    sim.run(until=0.1)
    assert not sim.wall_wear()["floor"].normal_impulse.any() and sim.wall_wear()["floor"].time == 0.0
    sim.run(until=0.4)
    found = sim.wall_wear()["floor"]
    weight = sim.particles.mass[0] * 9.81
    assert found.time == pytest.approx(0.2, rel=1e-3)
    np.testing.assert_allclose(found.area, 2e-6)
    # which of its two triangles a grain on the diagonal counts for is open; squares are not
    squares = (found.mean_pressure * found.area).reshape(4, 2).sum(axis=1)
    np.testing.assert_allclose(squares, [weight, 0, weight, weight], rtol=2e-3)
    assert found.archard_volume is None and found.finnie_volume is None


def test_a_belt_rubs_and_a_floor_that_moves_along_does_not():
    """For three steps, over which the grain keeps its speed: the belt slides under it by the difference of the two."""
    keys = {"place": (0, 0, R - 1e-7), "velocity": (0.3, 0, 0), "friction": 0.2}
    floor = data()["walls"][0]
    for surface, slip in ([0.5, 0, 0], 0.2), ([0.3, 0, 0], 0.0):
        sim = simulated(**keys, walls=[{**floor, "surface_velocity": surface}], restitution=1.0)
        sim.step(3)
        found = sim.wall_wear()["floor"]
        assert found.sliding[0] == pytest.approx(slip * found.normal_impulse[0], rel=1e-3, abs=1e-12)
    sim = simulated(**keys, walls=[{**floor, "motion": {"velocity": [0.3, 0, 0]}}], restitution=1.0)
    sim.step(3)
    assert sim.wall_wear()["floor"].sliding[0] == pytest.approx(0.0, abs=1e-12)


def many(folder, **more):
    """Grains that fall on the sheet, with friction."""
    write_sheet(folder)
    rng = np.random.default_rng(4)
    places = [[x, y, z] for z in (0.5e-3, 1.2e-3) for x in np.arange(-1.6e-3, 1.7e-3, 0.8e-3)
              for y in np.arange(-1.6e-3, 1.7e-3, 0.8e-3)]  # fmt: skip
    speeds = rng.normal(0, 0.05, (len(places), 3)) - [0, 0, 0.2]
    grains = [{"material": "g", "radius": 3e-4, "positions": places, "velocities": speeds.tolist()}]
    keys = {"gravity": [0, 0, -9.81], "young": 5e6, "walls": [{**SHEET, "scale": 1e-3}], "grains": grains}
    return scene_from_dict(data(**{**keys, "time": {"end": 0.01, "step": 4e-6, "max_speed": 0.5}, **more}), folder)


def digits(scene, steps=1500, **keys):
    sim = Simulation(scene, device="cpu", **keys)
    sim.step(steps)
    return sim.engine.digits["wear"]


def test_bits_do_not_depend_on_threads_skin_executor_or_a_resume(tmp_path):
    plain = digits(many(tmp_path), threads=1)
    assert (plain[:, :4] != 0).any(axis=1).sum() > 25
    np.testing.assert_array_equal(digits(many(tmp_path), threads=2), plain)
    np.testing.assert_array_equal(digits(many(tmp_path, engine={"skin": 1e-4}), threads=1), plain)
    np.testing.assert_array_equal(digits(many(tmp_path), threads=1, resident=True), plain)
    sim = Simulation(many(tmp_path), device="cpu", threads=2)
    sim.step(700)
    sim.save_checkpoint(tmp_path / "half.h5")
    again = Simulation.from_checkpoint(tmp_path / "half.h5", device="cpu", threads=1)
    again.step(800)
    np.testing.assert_array_equal(again.engine.digits["wear"], plain)


def test_wear_changes_no_bit_of_the_run(tmp_path):
    hashes = []
    for measures in ({}, {"wear": ALL}):
        sim = Simulation(many(tmp_path, measures=measures), device="cpu", threads=1)
        sim.step(1000)
        hashes.append(sim.state_hash())
    assert hashes[0] == hashes[1]
    none = Simulation(many(tmp_path, measures={}), device="cpu", threads=1)
    assert none.wall_wear() == {} and "wear of walls" in none.plan.left_out
    assert "runs      wear of walls, added up at every step" in sim.plan.explain()


def test_a_turning_frame_sees_the_same_wear():
    found = []
    for frame in (None, {"axis": [0, 0, 1], "rate": 40.0}):
        keys = {"frame": frame} if frame else {}
        grains = [{"material": "g", "radius": R, "positions": [[0.01, 0, 1.001 * R]], "velocities": [[0.4, 0.2, -0.5]],
                   "velocities_in": "laboratory"}]  # fmt: skip
        floor = {**data()["walls"][0], "fixed_to": "laboratory"}
        sim = simulated(grains=grains, walls=[floor], time={"end": 0.01, "step": 5e-7, "max_speed": 1.5}, **keys)
        sim.run(until=5e-4)
        wear = sim.wall_wear()["floor"]
        found.append([float(getattr(wear, name)[0]) for name in ("normal_impulse", "shear_work", "sliding", "erosion")])
    np.testing.assert_allclose(found[1], found[0], rtol=1e-7)
    assert min(found[0]) > 0


def test_history_and_frames_hold_it(tmp_path):
    import pyvista

    scene = many(tmp_path, output={"formats": ["vtk", "vtkhdf"], "interval": 0.005, "picture": False})
    sim = run_scene(scene, tmp_path / "out", device="cpu", threads=1, quiet=True)
    table = np.genfromtxt(tmp_path / "out/history.csv", delimiter=",", names=True, deletechars="", replace_space=" ")
    wear = sim.wall_wear()["floor"]
    for name in ("normal_impulse [N s]", "shear_work [J]", "impact_work [J]", "archard_volume [m3]", "finnie_volume [m3]"):
        assert table[f"floor {name}"][-1] == getattr(wear, name.split()[0]).sum() != 0.0
    last = sorted((tmp_path / "out").glob("wall_*floor*.vtp"))[-1]
    mesh = pyvista.read(last)
    shown = wear.of_triangles()
    for name in ("mean_pressure", "shear_work", "impact_work", "archard_depth", "finnie_depth"):
        np.testing.assert_allclose(mesh.cell_data[name], getattr(shown, name), rtol=1e-6)
    assert "mean_pressure" in pyvista.read(tmp_path / "out/result_walls.vtkhdf").cell_data


BAD = [
    ({"measures": {"wear": {"archard": {"coefficient": 1e-4}}}}, r"archard\.hardness"),
    ({"measures": {"wear": {"finnie": {"pressure": "1 m"}}}}, r"finnie\.pressure"),
    ({"measures": {"wear": {"start": -1}}}, r"wear\.start.*>= 0"),
    ({"measures": {"wear": {}}, "engine": {"integrator": "rk4"}}, r'measures\.wear.*"exact_drift"; it is "rk4"'),
    ({"measures": {"wear": {"hardness": 1}}}, r"measures\.wear\.hardness"),
]


@pytest.mark.parametrize(("keys", "message"), BAD)
def test_what_cannot_be_added_up_is_refused(keys, message):
    with pytest.raises(SceneError, match=f"(?s){message}"):
        scene_from_dict(data(**keys), source="bad.toml")
