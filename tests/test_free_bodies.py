"""Free walls with six degrees of freedom: tops, impacts off centre, mounts; bits, both frames, phases, refusals."""

import math

import numpy as np
import pytest
from warpdem.kernels.step.free_bodies import BODY, MOTION, MOUNTS

from free_scenes import FAR, MASS, PLATE, G, R, body_of, columns, run, scene
from warpdem import SceneError, Simulation
from warpdem.model.free_bodies import matrix_of, principal
from warpdem.scene import free as keys_of_free

LAB = {"fixed_to": "laboratory"}
BALL = {"sphere": {"centre": [0, 0, 0], "radius": 0.01, "inside": False}}


def body(mass=0.1, centre=(0, 0, 0), inertia=(1e-3, 2e-3, 3e-3), **keys):
    return {"joint": "none", "mass": mass, "centre": centre, "inertia": inertia, **keys}


def motion(sim, name):
    return body_of(sim).motion[MOTION.of(name)]


@pytest.mark.parametrize("frame", [None, {"axis": [2, 1, 0], "rate": 7.0}], ids=["laboratory", "turning"])
def test_a_top_flies_and_turns_exactly(frame):
    """Moments 1 : 2 : 3 by Jacobi's functions (30 digits), here a hundred times as fast; the center goes straight."""
    spin, velocity = np.array([30.0, 200.0, 20.0]), np.array([0.1, -0.2, 0.3])
    free = body(spin=spin, velocity=velocity, centre=[0.01, 0.02, 0.0])
    sim = run(scene(free, BALL | LAB, frame=frame, time={"end": 1, "step": 2e-5}))
    sim.step(5000)
    q = motion(sim, "orientation")
    exact = np.array([-0.35739232902914479, 0.91782939385206195, 0.076282208691741946, -0.15505144813702833])
    start = body_of(sim).body[BODY.of("orientation")]
    turn = matrix_of(q) @ matrix_of(start).T
    np.testing.assert_allclose(turn, matrix_of(exact), rtol=0, atol=1e-11)
    exact = 100 * np.array([1.1474523355968126, -1.6653387455810364, 0.66998678157771149])
    np.testing.assert_allclose(turn.T @ motion(sim, "seen_spin"), exact, rtol=1e-10)
    np.testing.assert_array_equal(motion(sim, "momentum"), np.array([1e-3, 2e-3, 3e-3]) * spin)
    np.testing.assert_allclose(motion(sim, "place"), [0.01, 0.02, 0.0] + velocity * sim.time, rtol=0, atol=1e-14)
    shown = columns(sim)
    np.testing.assert_allclose([shown[f"center {a}"] for a in "xyz"], motion(sim, "place"), rtol=0, atol=1e-13)
    np.testing.assert_allclose([shown[f"velocity {a}"] for a in "xyz"], velocity, rtol=0, atol=1e-11)
    np.testing.assert_allclose([shown[f"spin {a}"] for a in "xyz"], motion(sim, "seen_spin"), rtol=1e-12)
    energy = 0.05 * velocity @ velocity + 0.5 * np.array([1e-3, 2e-3, 3e-3]) @ spin**2
    assert shown["kinetic"] == pytest.approx(energy, rel=1e-12)


def impact(threads=1, **keys):
    """A grain that hits a plate of 5 m at 4 mm from its center, without friction."""
    free = body(5 * MASS, inertia=[MASS * 1e-5, MASS * 2e-5, MASS * 2.5e-5])
    return run(scene(free, PLATE, [[4e-3, 0, 1.01 * R]], [[0, 0, -0.2]], e=1.0, time={"end": 1, "step": 1e-6}, **keys), threads)


@pytest.fixture(scope="module")
def hit():
    sim = impact()
    sim.step(1000)
    return sim


def test_an_impact_off_centre_keeps_both_momenta_and_the_energy(hit):
    """J = 2 v/(1/m + 1/M + a^2/I_y) as rigid bodies; linear and angular momentum to round-off."""
    v, arm = 0.2, 4e-3
    grain, plate, momentum = hit.particles.velocity[0], motion(hit, "velocity"), motion(hit, "momentum")
    np.testing.assert_allclose(grain + 5 * plate, [0, 0, -v], rtol=0, atol=1e-15)
    about = np.cross(hit.particles.position[0], MASS * grain) + np.cross(motion(hit, "place"), 5 * MASS * plate) + momentum
    np.testing.assert_allclose(about, [0, MASS * v * arm, 0], rtol=0, atol=1e-13 * MASS * v * arm)
    impulse = 2 * v / (1 / MASS + 1 / (5 * MASS) + arm**2 / (MASS * 2e-5))
    assert -5 * MASS * plate[2] == pytest.approx(impulse, rel=1e-3)
    assert momentum[1] == pytest.approx(impulse * arm, rel=1e-3)
    shown = columns(hit)
    assert shown["kinetic"] + hit.energy()["kinetic"] == pytest.approx(0.5 * MASS * v**2, rel=1e-4)
    assert hit.budget.energy()["body work"] == pytest.approx(-shown["kinetic"], rel=1e-12)


def test_threads_a_resume_and_another_frame_change_nothing(hit, tmp_path):
    sim = impact(threads=2)
    sim.step(100)
    sim.save_checkpoint(tmp_path / "a.h5")
    again = Simulation.from_checkpoint(tmp_path / "a.h5", device="cpu", threads=1)
    again.step(900)
    assert again.state_hash() == hit.state_hash()
    np.testing.assert_array_equal(body_of(again).motion, body_of(hit).motion)
    free = body(5 * MASS, inertia=[MASS * 1e-5, MASS * 2e-5, MASS * 2.5e-5])
    turned = run(scene(free, PLATE | LAB, [[4e-3, 0, 1.01 * R]], [[0, 0, -0.2]], e=1.0, frame={"axis": [1, 1, 1], "rate": 9.0},
                       time={"end": 1, "step": 1e-6}))  # fmt: skip
    turned.step(1000)
    for name, size in (("place", R), ("velocity", 0.2), ("momentum", MASS * 0.2 * R)):
        np.testing.assert_allclose(motion(turned, name), motion(hit, name), rtol=0, atol=1e-8 * size)


def test_given_axes_turn_the_moments_and_a_body_flies_as_its_twin():
    """A body whose moments are about turned axes moves as one about x, y and z that is turned as a whole.

    No torque: |L| stays to round-off, the energy within 1e-12.
    """
    turn = matrix_of(np.array([1.0, 2.0, -1.0, 0.5]) / 2.5)
    spin = np.array([3.0, 20.0, 2.0])
    soft = {"g": {"density": 2500, "young_modulus": "100 Pa", "poisson_ratio": 0.3}}
    keys = {"positions": [[5, 5, 5]], "materials": soft, "time": {"end": 20, "step": 1e-4}}
    given = body(inertia=(1e-3, 2e-3, 2.7e-3), axes=[1.0, 2.0, -1.0, 0.5])
    turned, twin = run(scene(given | {"spin": turn @ spin}, BALL, **keys)), run(
        scene(body(inertia=(1e-3, 2e-3, 2.7e-3)) | {"spin": spin}, BALL, **keys)
    )
    start = 0.5 * np.array([1e-3, 2e-3, 2.7e-3]) @ spin**2
    for sim in (turned, twin):
        sim.step(3000)
        assert columns(sim)["kinetic"] == pytest.approx(start, rel=1e-12)
    np.testing.assert_allclose(motion(turned, "seen_spin"), turn @ motion(twin, "seen_spin"), rtol=0, atol=1e-8 * 20)


def mounted(**keys):
    """A plate of 0.1 kg on four mounts of 500 N/m, 20 mm from its center."""
    corners = [[x, y, 0] for x in (-0.02, 0.02) for y in (-0.02, 0.02)]
    return body(0.1, mounts=[{"point": p, "stiffness": 500, **keys} for p in corners], inertia=[1e-5, 1e-5, 2e-5])


def test_a_plate_on_mounts_swings_up_and_down_and_tilts():
    """Up and down at sqrt(4 k/M) about the sag M g/(4 k); tilted by a spin about y at sqrt(4 k a^2/I); both are known."""
    sim = run(scene(mounted() | {"spin": [0, 0.5, 0]}, gravity=[0, 0, -G], time={"end": 1, "step": 2e-5}))
    sag, bounce, tilt = 0.1 * G / 2000, math.sqrt(2000 / 0.1), math.sqrt(2000 * 0.02**2 / 1e-5)
    for steps in (300, 700, 1500):
        sim.step(steps)
        t = sim.time
        np.testing.assert_allclose(motion(sim, "place"), [0, 0, -sag * (1 - math.cos(bounce * t))], rtol=0, atol=2e-4 * sag)
        angle = 2 * math.asin(motion(sim, "orientation") @ quaternion_of_y(sim))
        assert angle == pytest.approx(0.5 / tilt * math.sin(tilt * t), abs=1e-3 * 0.5 / tilt)
    shown = columns(sim)
    total = 0.5 * 1e-5 * 0.5**2
    assert shown["kinetic"] + shown["spring"] + shown["gravity"] == pytest.approx(total, abs=1e-3 * (total + shown["spring"]))


def test_a_mount_beside_the_center_pulls_towards_where_it_is_fixed():
    """At rest nothing pulls; displaced by the velocity of the start, a ball on one mount of 500 N/m at its edge swings."""
    edge = {"point": [0.02, 0, 0], "stiffness": 500}
    sim = run(scene(body(0.1, mounts=[edge], inertia=[1e-5, 1e-5, 2e-5]), time={"end": 1, "step": 2e-5}))
    sim.step(500)
    np.testing.assert_array_equal(motion(sim, "place"), 0.0)
    sim = run(scene(body(0.1, mounts=[edge], inertia=[1e-5, 1e-5, 2e-5], velocity=[0.1, 0, 0]), time={"end": 1, "step": 2e-5}))
    sim.step(700)
    rate = math.sqrt(500 / 0.1)  # along its arm: it does not turn
    way = 0.1 / rate * math.sin(rate * sim.time)
    np.testing.assert_allclose(motion(sim, "place"), [way, 0, 0], rtol=0, atol=1e-3 * 0.1 / rate)


def quaternion_of_y(sim):
    """What takes the component along y out of the quaternion of the rotation since the start."""
    w, x, y, z = body_of(sim).body[BODY.of("orientation")]
    return np.array([-y, z, w, -x])  # (q start^-1) . (0, 0, 1, 0)


def test_dampers_take_what_is_missing_and_a_force_gives_what_is_there():
    """A plate pulled by 0.2 N comes to rest where its mounts hold it; energies add up."""
    free = mounted(damping=4.0) | {"force": [0, 0, 0.2], "spin": [0.1, 0.2, 0.0]}
    sim = run(scene(free, time={"end": 1, "step": 2e-5}))
    sim.run(until=0.2)
    np.testing.assert_allclose(motion(sim, "place"), [0, 0, 0.2 / 2000], rtol=0, atol=1e-6 * 0.2 / 2000)
    shown = columns(sim)
    assert shown["driven"] == pytest.approx(0.2 * motion(sim, "place")[2], rel=1e-3)
    start = 0.5 * 1e-5 * (0.1**2 + 0.2**2)
    assert shown["spring"] + shown["lost"] + shown["kinetic"] == pytest.approx(shown["driven"] + start, rel=1e-3)


def test_a_phase_goes_on_with_the_body_where_it_is(tmp_path):
    """Turned by a third of a turn and pulled by its mounts: the rest of the way as without the break."""
    free = mounted() | {"spin": [3.0, 2.0, 30.0], "velocity": [0.1, 0, 0.05], "force": [0.1, 0, 0], "torque": [0, 1e-4, 0]}
    time = {"end": 1, "step": 2e-5}
    whole, first = run(scene(free, time=time)), run(scene(free, time=time))
    whole.step(4000)
    first.step(2500)
    first.save_checkpoint(tmp_path / "a.h5")
    then = run(scene(free, start={"checkpoint": str(tmp_path / "a.h5")}, grains=[], time=time))
    np.testing.assert_allclose(then.schedule.bodies(0.0)[0, :12], first.schedule.bodies(first.time)[0, :12], rtol=0, atol=1e-12)
    then.step(1500)
    found, expected = (sim.schedule.bodies(sim.time)[0] for sim in (then, whole))
    np.testing.assert_allclose(found[:9], expected[:9], rtol=0, atol=1e-5)
    np.testing.assert_allclose(found[9:12], expected[9:12], rtol=0, atol=1e-7)
    np.testing.assert_allclose(found[12:18], expected[12:18], rtol=0, atol=2e-3)


def test_axes_of_a_tensor_are_principal_and_alike_moments_come_first():
    rng = np.random.default_rng(2)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    for moments in ([1.0, 2.0, 2.5], [1.0, 1.0, 1.7], [1.0, 2.0, 2.0], [3.0, 3.0, 3.0]):
        tensor = turn @ np.diag(moments) @ turn.T
        found, axes = principal(tensor)
        np.testing.assert_allclose(axes @ np.diag(found) @ axes.T, tensor, rtol=0, atol=1e-14)
        assert np.linalg.det(axes) == pytest.approx(1.0)
        if len(set(moments)) < 3:
            assert found[0] == found[1]


def test_as_many_mounts_are_read_as_may_be_given():
    assert MOUNTS == keys_of_free.MOUNTS


BAD = [
    ({"joint": "none"}, r"free.mass\n.*missing: only a closed mesh has one of its own"),
    ({"joint": "none", "mass": 1, "centre": [0, 0, 0]}, r"free.inertia\n.*missing: only a closed mesh"),
    (body(inertia=[1, 1, 3]), r"free.inertia = \[1.0, 1.0, 3.0\]\n.*of no body: none of the three may exceed"),
    (body(mounts=[{"point": [0, 0, 0]}] * 9), r"free.mounts.*8"),
    (body(mounts=[{"stiffness": 1}]), r"free.mounts\[0\].point\n.*missing"),
    (body(motor=[[0, 1]]), "free.motor"),
]


@pytest.mark.parametrize("free, message", BAD, ids=[str(n) for n in range(len(BAD))])
def test_what_is_wrong_with_a_body_is_said(free, message):
    with pytest.raises(SceneError, match=rf"(?s){message}"):
        scene(free)


def test_what_a_body_cannot_have_is_refused():
    with pytest.raises(SceneError, match=r"walls\[0\].free: its axis would move with the frame"):
        run(scene(body(), frame={"axis": [0, 0, 1], "rate": 1.0}))
    with pytest.raises(SceneError, match="its mass of 1e-06 kg is below that of the heaviest grain"):
        run(scene(body(1e-6)))
    with pytest.raises(SceneError, match=r"free.mounts: .* lets the wall swing"):
        run(scene(body(mounts=[{"point": [0.1, 0, 0], "stiffness": 1e8}]), time={"end": 1, "step": 1e-5}))
    with pytest.raises(SceneError, match=r"borders.x: periodic, but walls\[0\].free turns it about another axis"):
        run(scene(body(), borders={"x": {"min": -1, "max": 1, "kind": "periodic"}}, positions=FAR))
