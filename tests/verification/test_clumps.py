"""Clumps: the free top in any frame, impacts in closed form, what a cloud conserves, bits.

The top and its instants: moments (1, 2, 3), W = (0.3, 2, 0.2) in its axes, computed with 30 digits (Jacobi's functions agree to
1e-13). Impacts: integrated with full geometry to 1e-12; rigid ones by J = (1 + e) m_eff v.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import warpdem

MOMENTS, SPIN = [1.0, 2.0, 3.0], [0.3, 2.0, 0.2]
TOP = {
    1.0: (0.5295952252402711, 0.053751873234915361, 0.8430642424682295, 0.076696261955289949),
    10.0: (-0.35739232902914479, 0.91782939385206195, 0.076282208691741946, -0.15505144813702833),
}
"""Quaternion (w, x, y, z) from the axes of the top to the laboratory."""
AXIS = np.array([2.0, -1.0, 2.0]) / 3.0
ORIGIN = [0.25, -0.5, 1.0]
FRAMES = {
    "inertial": (None, lambda t: 0.0),
    "turning": ({"rate": 3.0}, lambda t: 3.0 * t),
    "fast": ({"rate": 64.0}, lambda t: 64.0 * t),
    "ramped": ({"schedule": [{"until": 4.0, "rate": [0.0, 8.0]}, {"rate": -2.0}]}, lambda t: 16.0 - 2.0 * (t - 4.0)),
    "shaken": ({"amplitude": [0.25, -0.5, 0.125], "frequency": 1.5}, lambda t: 0.0),
}
"""Motion of the frame, and the angle about AXIS that it has turned by at a time after 4 s or, if steady, at any [rad]."""


def scene(clumps, grains, *, step, friction=0.0, restitution=1.0, young_modulus=5e7, density=2500.0, **more):
    return warpdem.Scene.model_validate({
        "materials": {"stone": {"density": density, "young_modulus": young_modulus, "poisson_ratio": 0.3}},
        "pairs": [{"materials": ["stone", "stone"], "restitution": restitution, "friction": friction}],
        "clumps": clumps, "grains": grains, "gravity": [0.0, 0.0, 0.0], "time": {"end": 1e3, "step": step},
        "output": {"formats": ["vtk"]}, **more,
    })  # fmt: skip


def dumbbell(distance):
    return {"spheres": [{"centre": [0, 0, z], "radius": 1e-3} for z in (0.0, distance)]}


def top(moments=MOMENTS):
    spheres = [{"centre": [0, 0, -0.5], "radius": 0.75}, {"centre": [0.1, 0, 0.5], "radius": 0.5}]
    return {"spheres": spheres, "inertia": "given", "mass": 1.0, "moments": moments, "centre": [0.0, 0.1, 0.0]}


def frame_of(motion):
    if motion is None:
        return {}
    if "amplitude" in motion:
        return {"frame": motion}
    return {"frame": {"axis": AXIS.tolist(), "origin": ORIGIN, **motion}}


def flying(moments, spin, step, motion=None):
    grains = [{
        "material": "stone", "clump": "top", "positions": [[1.0, 0.5, 0.25]], "velocities": [[0.5, 0.25, -0.125]],
        "spins": [spin], "velocities_in": "laboratory",
    }]  # fmt: skip
    engine = {"skin": 1e6, "guards": "record"}
    made = scene({"top": top(moments)}, grains, step=step, young_modulus=1e-6, engine=engine, **frame_of(motion))
    return warpdem.Simulation(made, device="cpu", threads=1)


def axes_in_laboratory(sim, angle):
    w, x, y, z = sim.clumps.orientation[0]
    return (Rotation.from_rotvec(angle * AXIS) * Rotation.from_quat([x, y, z, w])).as_matrix()


def reference(t):
    w, x, y, z = TOP[t]
    return Rotation.from_quat([x, y, z, w]).as_matrix()


@pytest.mark.parametrize("frame", FRAMES)
@pytest.mark.parametrize(("step", "tolerance"), [(0.01, 1e-11), (0.05, 2e-11)])  # |W| dt = 0.02 and 0.1
def test_a_free_top_turns_as_it_must_in_any_frame(frame, step, tolerance):
    motion, angle = FRAMES[frame]
    sim = flying(MOMENTS, SPIN, step, motion)
    before = np.linalg.norm(sim.clumps.angular_momentum)
    sim.run(until=10.0)
    np.testing.assert_allclose(axes_in_laboratory(sim, angle(10.0)), reference(10.0), rtol=0, atol=tolerance)
    assert np.linalg.norm(sim.clumps.angular_momentum) == pytest.approx(before, rel=1e-12)
    members = sim.particles
    length = np.linalg.norm(members.position_lab[1] - members.position_lab[0])
    assert length == pytest.approx(np.hypot(1.0, 0.1), rel=1e-14), "the body is not rigid"


def test_frame_and_laboratory_agree_on_where_a_member_goes():
    motion, _ = FRAMES["ramped"]
    seen, still = (flying(MOMENTS, SPIN, 0.01, which) for which in (motion, None))
    for sim in (seen, still):
        sim.run(until=6.0)
    np.testing.assert_allclose(seen.particles.position_lab, still.particles.position_lab, rtol=0, atol=1e-10)
    np.testing.assert_allclose(seen.particles.velocity_lab, still.particles.velocity_lab, rtol=0, atol=1e-10)
    np.testing.assert_allclose(seen.particles.spin_lab, still.particles.spin_lab, rtol=0, atol=1e-10)


@pytest.mark.parametrize("moments", [[1.0, 1.0, 0.25], [2.0, 1.25, 1.25], [1.0, 1.0, 1.0]])
def test_a_body_of_revolution_turns_exactly_at_any_step(moments):
    sims = [flying(moments, SPIN, step) for step in (0.5, 0.0078125)]
    for sim in sims:
        sim.run(until=16.0)
    coarse, fine = (axes_in_laboratory(sim, 0.0) for sim in sims)
    np.testing.assert_allclose(coarse, fine, rtol=0, atol=1e-12)
    assert np.abs(coarse - np.eye(3)).max() > 0.1


def test_a_contact_finds_members_where_they_were():
    """Their velocity over a step is the chord of their path, at |W| dt = 0.2 too: slip and overlap of the step before."""
    sim = flying(MOMENTS, SPIN, 0.1)
    sim.step(3)
    before = sim.particles.position
    sim.step(1)
    record = sim.state.record.numpy()[sim.state.rank]
    np.testing.assert_allclose(record[:, 0:3] - 0.1 * record[:, 4:7], before, rtol=0, atol=1e-14)


def test_angular_momentum_stays_for_a_million_steps_in_turning_axes():
    sim = flying(MOMENTS, SPIN, 2.0**-7, {"rate": 16.0})
    before = np.linalg.norm(sim.clumps.angular_momentum)
    energy = sim.energy()["rotational"]
    sim.step(1_000_000)
    assert np.linalg.norm(sim.clumps.angular_momentum) == pytest.approx(before, rel=1e-12)
    assert sim.energy()["rotational"] == pytest.approx(energy, rel=1e-8)


# -- impacts ----------------------------------------------------------------------------------------------------------


def impact(distance, tilt, restitution, modulus, speed=0.5, steps=400):
    """A dumbbell, its axis tilted from the vertical, falls on a frictionless plane; its velocity and spin when it has left."""
    t = np.radians(tilt)
    turn = [np.cos(t / 2), 0.0, np.sin(t / 2), 0.0]
    # contact time of Hertz at the reduced mass of a sphere, as a scale
    stiffness = 4.0 / 3.0 * modulus / (1 - 0.3**2) / 2.0 * np.sqrt(1e-3)
    duration = 2.94 * (1.05e-5**2 / (stiffness**2 * speed)) ** 0.2 * 1.25**0.4
    low = 0.5 * distance * np.cos(t) + 1e-3
    grains = [{
        "material": "stone", "clump": "d", "positions": [[0, 0, low + 1e-6]], "velocities": [[0, 0, -speed]],
        "orientations": [turn],
    }]  # fmt: skip
    wall = {"name": "floor", "material": "stone", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}
    made = scene(
        {"d": dumbbell(distance)}, grains, step=duration / steps, restitution=restitution, young_modulus=modulus, walls=[wall],
        engine={"max_overlap": 0.5},
    )  # fmt: skip
    sim = warpdem.Simulation(made, device="cpu", threads=1)
    sim.step(3 * steps)
    assert len(sim.contacts().i) == 0
    return sim.clumps.velocity[0, 2], abs(sim.clumps.spin[0, 1])


@pytest.mark.parametrize(
    ("restitution", "velocity", "spin", "steps"),
    [(1.0, 0.2348529130636, 373.0608043371, 400), (0.5, 5.097310493800e-2, 279.2259800076, 25_600)],
)
def test_a_tilted_dumbbell_leaves_the_plane_as_integrated_finely(restitution, velocity, spin, steps):
    """Touching spheres at 45 degrees, E* that of 50 MPa on a rigid plane, to 1e-6.

    A dashpot of Tsuji acts as the root of the root of the overlap, so it begins at once, wherever in a step the impact does:
    8e-5 at 400 steps, 5e-6 at 1600, 1e-6 at 6400.
    """
    found = impact(2e-3, 45.0, restitution, 1e8, steps=steps)
    assert found[0] == pytest.approx(velocity, abs=1e-6 * 0.5)
    assert found[1] == pytest.approx(spin, rel=1e-6)


@pytest.mark.parametrize(
    ("distance", "tilt", "restitution", "velocity", "spin"),
    [
        (2e-3, 30.0, 1.0, 0.3484848484848, 303.0303030303),
        (2e-3, 30.0, 0.5, 0.1363636363636, 227.2727272727),
        (1e-3, 45.0, 1.0, 0.3550724637681, 409.9169746009),
        (1e-3, 45.0, 0.5, 0.1413043478261, 307.4377309507),
    ],
)
def test_stiff_dumbbells_leave_as_rigid_ones(distance, tilt, restitution, velocity, spin):
    found = impact(distance, tilt, restitution, 5e11, steps=400)
    assert found[0] == pytest.approx(velocity, abs=2e-3 * 0.5)
    assert found[1] == pytest.approx(spin, rel=2e-3)


@pytest.mark.parametrize("tilt", [5.0, 30.0, 60.0, 85.0])
def test_the_contact_point_has_the_restitution_asked_for(tilt):
    """With the mass of the clump in place of m_eff: 0.4991, 0.4704, 0.4194, 0.3978."""
    v, w = impact(2e-3, tilt, 0.5, 5e11)
    assert (v + w * 1e-3 * np.sin(np.radians(tilt))) / 0.5 == pytest.approx(0.5, abs=2e-3)


# -- clouds -----------------------------------------------------------------------------------------------------------


def cloud(restitution=0.7, friction=0.4, step=4e-6, outwards=-40.0, **more):
    """27 clumps of three spheres of several sizes, and 8 spheres, that fly together (or ``outwards`` [1/s]) and bounce on."""
    rng = np.random.default_rng(5)
    place = (np.stack(np.meshgrid(*[np.arange(3)] * 3), axis=-1).reshape(-1, 3) - 1.0) * 4.5e-3
    own = (np.stack(np.meshgrid(*[np.arange(2)] * 3), axis=-1).reshape(-1, 3) - 0.5) * 4.5e-3
    three = [
        {"centre": [0, 0, 0], "radius": 1e-3}, {"centre": [0, 0, 1.2e-3], "radius": 0.8e-3},
        {"centre": [0, 0.9e-3, 0.4e-3], "radius": 0.7e-3},
    ]  # fmt: skip
    grains = [
        {
            "material": "stone", "clump": "three", "positions": place, "velocities": outwards * place,
            "spins": rng.normal(0, 60.0, place.shape), "orientations": rng.normal(size=(27, 4)),
            "sizes": rng.uniform(0.7, 1.0, 27),
        },
        {"material": "stone", "positions": own, "velocities": 0.75 * outwards * own, "radius": 0.6e-3},
    ]  # fmt: skip
    return scene({"three": {"spheres": three}}, grains, step=step, friction=friction, restitution=restitution, **more)


def run(made, steps, threads=1, **more):
    sim = warpdem.Simulation(made, device="cpu", threads=threads, **more)
    sim.step(steps)
    return sim


def test_a_cloud_of_clumps_keeps_its_momenta_and_its_energy_closes():
    """What gravity gives is taken off: the rest of momentum and angular momentum stays, and energy is all accounted for."""
    made = cloud(measures={"energy": True, "momentum": True}, step=2e-6, gravity=[0.5, 0.0, -1.0])
    sim = warpdem.Simulation(made, device="cpu", threads=1)
    first = sum(sim.energy().values())
    moving, touched = np.abs(sim.particles.velocity).max(), 0
    mass = sim.particles.mass.sum()
    sim.step(0)
    for _ in range(20):
        sim.step(500)
        touched += len(sim.contacts().i)
        now = sim.budget.momentum()
        for axis in "xyz":
            assert abs(now[f"momentum_{axis} error"]) < 1e-12 * mass * moving
            assert abs(now[f"angular_momentum_{axis} error"]) < 1e-12 * mass * moving * 0.01
    assert now["momentum_z gravity"] == pytest.approx(-mass * sim.time, rel=1e-9)
    assert touched > 20
    books = sim.budget.energy()
    assert sum(books[f"dissipated_{part}"] for part in ("normal_damping", "tangential_damping", "sliding")) > 0.05 * first
    assert abs(books["integration_error"]) < 1e-3 * first


def test_frame_and_laboratory_agree_on_a_cloud_in_a_box_that_starts_to_turn():
    """Six walls that turn in the laboratory, or axes that turn with the box: friction, dashpots, members and spheres."""
    half = 7e-3
    turn = {
        "axis": [0, 1, 0], "origin": [2e-3, 0, 0],
        "schedule": [{"until": 0.005, "rate": [0.0, 60.0]}, {"until": 0.05, "rate": 60.0}],
    }  # fmt: skip
    normals = np.concatenate([np.eye(3), -np.eye(3)])
    box = [
        {"name": f"w{k}", "material": "stone", "plane": {"point": (-half * n).tolist(), "normal": n.tolist()}}
        for k, n in enumerate(normals)
    ]  # fmt: skip
    given = {"outwards": 150.0, "step": 2e-6, "gravity": [0.0, 0.0, -9.81]}
    found = []
    for more in ({"walls": [wall | {"motion": turn} for wall in box]}, {"walls": box, "frame": turn}):
        table = cloud(**given, **more).model_dump(exclude_unset=True)
        groups = [group | {"velocities_in": "laboratory"} for group in table["grains"]]
        found.append(run(warpdem.Scene.model_validate(table | {"grains": groups}), 5000))
    one, other = (sim.particles for sim in found)
    assert found[0].extremes["wall_approach_speed"] > 0.1 and found[0].extremes["pair_approach_speed"] > 0.1
    np.testing.assert_allclose(one.position_lab, other.position_lab, rtol=0, atol=1e-12)
    np.testing.assert_allclose(one.velocity_lab, other.velocity_lab, rtol=0, atol=1e-9)
    np.testing.assert_allclose(one.spin_lab, other.spin_lab, rtol=0, atol=1e-6)


def test_bits_do_not_depend_on_threads_lists_and_resume(tmp_path):
    """With a wall, a frame that turns, borders that clumps come round, and an outlet that they leave by."""
    drum = {"name": "drum", "material": "stone", "cylinder": {"point": [0, 0, 0], "axis": [0, 0, 1], "radius": 1.05e-2}}
    chute = {"name": "chute", "box": {"min": [-1.0, -1.0, -1.0], "max": [1.0, -6e-3, 1.0]}}
    more = {
        "walls": [drum], "gravity": [0.0, -300.0, 0.0], "frame": {"axis": [0, 0, 1], "rate": 20.0}, "outlets": [chute],
        "borders": {"z": {"kind": "periodic", "min": -7e-3, "max": 7e-3}}, "outwards": 150.0,
    }  # fmt: skip
    want = run(cloud(**more), 1500)
    assert 5 < want.left["chute"][0] < 30
    assert want.particles.position[:, 2].max() > 6e-3, "none is near the border"
    assert run(cloud(**more), 1500, threads=2).state_hash() == want.state_hash()
    assert run(cloud(**more, engine={"skin": 3e-5}), 1500).state_hash() == want.state_hash()
    assert run(cloud(**more), 1500, resident=True).state_hash() == want.state_hash()
    half = run(cloud(**more), 700)
    half.save_checkpoint(tmp_path / "half.h5")
    again = warpdem.Simulation.from_checkpoint(tmp_path / "half.h5", device="cpu", threads=1)
    assert again.state_hash() == half.state_hash()
    again.step(800)
    assert again.state_hash() == want.state_hash()
    np.testing.assert_array_equal(again.clumps.spin, want.clumps.spin)


def test_clumps_come_round_borders_with_their_centre_and_the_books_close():
    """Each member keeps within the borders; what the shift to the other side gives is carried in."""
    side = 7e-3
    borders = {axis: {"kind": "periodic", "min": -side, "max": side} for axis in "xyz"}
    made = cloud(
        outwards=200.0, borders=borders, measures={"energy": True, "momentum": True}, step=2e-6, gravity=[0.5, 0.0, -1.0]
    )
    sim = warpdem.Simulation(made, device="cpu", threads=1)
    first, mass = sum(sim.energy().values()), sim.particles.mass.sum()
    sim.step(5000)
    assert np.abs(sim.clumps.position).max() <= side and np.abs(sim.particles.position).max() <= side
    arm = sim.particles.position[:81] - np.repeat(sim.clumps.position, 3, axis=0)
    assert (np.abs(arm) > side).any(), "no clump is on both sides"
    arm -= 2.0 * side * np.rint(arm / (2.0 * side))
    assert np.linalg.norm(arm, axis=1).max() < 1e-3
    books, now = sim.budget.energy(), sim.budget.momentum()
    assert abs(books["carried_in"]) > 1e-4 * first and books["dissipated_normal_damping"] > 0.05 * first
    assert abs(books["integration_error"]) < 1e-3 * first
    for axis in "xyz":
        assert abs(now[f"momentum_{axis} error"]) < 1e-12 * mass
        assert abs(now[f"angular_momentum_{axis} error"]) < 1e-14 * mass


def test_clumps_leave_whole_where_their_centre_does():
    """By a box that the steps take them out in and, where books are kept, by the host; each counts once, with its mass."""
    low = -6.3e-3
    below = {"name": "below", "box": {"min": [-1.0, -1.0, -1.0], "max": [1.0, 1.0, low]}}
    for books in (False, True):
        measures = {"energy": books, "momentum": books, "residence": [{"name": "all"}]}
        sim = run(cloud(outwards=0.0, outlets=[below], gravity=[0.0, 0.0, -300.0], measures=measures), 0)
        mass, first, volume = sim.particles.mass.sum(), sum(sim.energy().values()), sim.clumps.mass / 2500.0
        sim.step(1600)
        count, gone = sim.left["below"]
        alone = int((sim.particles.id >= 81).sum())
        assert count == 27 - len(sim.clumps.id) + 8 - alone == 13
        assert len(sim.particles.id) == alone + 3 * len(sim.clumps.id)
        assert gone == pytest.approx(mass - sim.particles.mass.sum(), rel=1e-12)
        assert sim.clumps.position[:, 2].min() > low > sim.particles.position[:, 2].min()
        whole = sim.departed().id < 81
        radius = (0.75 / np.pi * volume[sim.departed().id[whole] // 3]) ** (1.0 / 3.0)
        np.testing.assert_allclose(sim.departed().radius[whole], radius)
    terms = sim.budget.energy()
    assert terms["integration_error"] == pytest.approx(0.0, abs=3e-6 * first)
    assert terms["carried_in"] > first


def test_a_scene_that_starts_from_a_checkpoint_goes_on_with_its_clumps(tmp_path):
    made = cloud()
    first = run(made, 1500)
    first.save_checkpoint(tmp_path / "a.h5")
    table = made.model_dump(mode="json", exclude_unset=True, exclude={"grains"})
    later = warpdem.Simulation(
        warpdem.Scene.model_validate({**table, "start": {"checkpoint": str(tmp_path / "a.h5")}}), device="cpu", threads=1
    )
    first.step(500)
    later.step(500)
    np.testing.assert_allclose(later.particles.position, first.particles.position, rtol=0, atol=1e-9)
    np.testing.assert_allclose(later.clumps.angular_momentum, first.clumps.angular_momentum, rtol=0, atol=1e-12)


@pytest.mark.slow
def test_an_elastic_gas_of_clumps_shares_its_energy():
    """Equipartition: 3 of 6 quadratic terms of a clump are of its rotation."""
    rng, n = np.random.default_rng(1), 6
    place = (np.stack(np.meshgrid(*[np.arange(n)] * 3), axis=-1).reshape(-1, 3) + 0.5) * 4e-3
    side = 4e-3 * n
    spheres = [
        {"centre": [0, 0, 0], "radius": 0.8e-3}, {"centre": [0, 0, 1.2e-3], "radius": 0.8e-3},
        {"centre": [0, 1e-3, 0], "radius": 0.8e-3},
    ]  # fmt: skip
    grains = [{
        "material": "stone", "clump": "three", "positions": place, "velocities": rng.normal(0, 0.3, place.shape),
        "orientations": rng.normal(size=(len(place), 4)),
    }]  # fmt: skip
    walls = [
        {"name": f"{axis}{end}", "material": "stone", "plane": {
            "point": (side * end * np.eye(3)[k]).tolist(), "normal": ((1 - 2 * end) * np.eye(3)[k]).tolist()}}
        for k, axis in enumerate("xyz") for end in (0, 1)
    ]  # fmt: skip
    sim = run(scene({"three": {"spheres": spheres}}, grains, step=4e-6, walls=walls), 20_000)
    ratio = []
    for _ in range(400):
        sim.step(200)
        energy = sim.energy()
        ratio.append(energy["rotational"] / (energy["kinetic"] + energy["rotational"]))
    assert np.mean(ratio) == pytest.approx(0.5, abs=0.01)
