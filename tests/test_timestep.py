"""Characteristic times against closed forms and against trajectories integrated on their own."""

import math

import numpy as np
import pytest
import trimesh
from pxr import Gf, Usd, UsdGeom
from scipy.integrate import solve_ivp
from warpdem.kernels.normal import hertz

from warpdem import Scene, SceneError
from warpdem.filling.initial_grains import load_grains
from warpdem.mesh.triangle_mesh import build_mesh
from warpdem.model import expected_load, stability_limit, time_step
from warpdem.model.coefficients import coefficient_table
from warpdem.model.contact_cases import contact_cases, limits_at
from warpdem.model.impact import dashpot_slope, impact, pressed
from warpdem.model.restitution_error import restitution_error

RADIUS, DENSITY, YOUNG, POISSON = 1.0e-3, 2500.0, 1.0e7, 0.25
MASS = DENSITY * 4.0 / 3.0 * math.pi * RADIUS**3


def scene(**changes) -> Scene:
    data = {
        "materials": {"glass": {"density": DENSITY, "young_modulus": YOUNG, "poisson_ratio": POISSON}},
        "contact": {"tangential": "none"},
        "pairs": [{"materials": ["glass", "glass"], "restitution": 1.0}],
        "grains": [{"material": "glass", "positions": [[0, 0, 0], [0, 0, 0.1]], "radius": RADIUS}],
        "time": {"end": 1, "max_speed": 0.5},
    }
    return Scene.model_validate(data | changes)


def found(of: Scene) -> time_step.Limits:
    return time_step.limits(of, load_grains(of, {}), {})


def test_rayleigh_time():
    shear = YOUNG / (2.0 * (1.0 + POISSON))
    expected = math.pi * RADIUS * math.sqrt(DENSITY / shear) / (0.1631 * POISSON + 0.8766)
    assert found(scene()).rayleigh == pytest.approx(expected, rel=1e-14)


def test_smallest_grain_counts():
    grains = [{"material": "glass", "positions": [[0, 0, 0], [0, 0, 0.1]], "radii": [RADIUS, 4.0 * RADIUS]}]
    limits, small = found(scene(grains=grains)), found(scene())
    for name in ("rayleigh", "contact_time", "stable"):
        assert getattr(limits, name) == pytest.approx(getattr(small, name), rel=1e-14)


@pytest.mark.parametrize("normal", ["hertz", "hooke"])
@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_limit_of_a_bed_at_rest_is_that_of_a_packing_under_its_weight(normal, friction):
    """0.6 of the height of the grains is solid; a contact carries p pi d^2/3, under which Hertz's overlap is (F/K)^(2/3)."""
    pair = {"materials": ["glass", "glass"], "restitution": 0.4, "friction": friction}
    pair |= {"stiffness": 300.0} if normal == "hooke" else {}
    contact = {"normal": normal, "tangential": "mindlin" if friction else "none"}
    limits = found(scene(gravity=[0, 0, -5.0], pairs=[pair], contact=contact))
    force = 0.6 * DENSITY * 5.0 * (0.1 + 2.0 * RADIUS) * math.pi * (2.0 * RADIUS) ** 2 / 3.0
    k = 4.0 / 3.0 * YOUNG / (2.0 * (1.0 - POISSON**2)) * math.sqrt(0.5 * RADIUS)
    overlap = (force / k) ** (2.0 / 3.0)
    secant, tangent = (300.0, 300.0) if normal == "hooke" else (k * math.sqrt(overlap), 1.5 * k * math.sqrt(overlap))
    beta = -math.log(0.4) / math.hypot(math.log(0.4), math.pi)
    _, damping, ratio, ratio_damping, *_ = coefficient_table(scene(pairs=[pair], contact=contact)).reshape(-1)
    dashpot = damping * math.sqrt(secant * 0.5 * MASS)
    assert dashpot == pytest.approx((2.0 if normal == "hooke" else math.sqrt(5.0)) * beta * math.sqrt(secant * 0.5 * MASS))
    across = (ratio * secant, ratio_damping * dashpot) if friction else (0.0, 0.0)
    springs = stability_limit.along(tangent, dashpot, 0.5 * MASS), stability_limit.across(*across, 0.5 * MASS)
    assert limits.settled == pytest.approx(stability_limit.packing_limit(*springs), rel=1e-5)


def test_a_bed_in_a_turning_frame_is_pressed_by_its_turning_too():
    still, turning = (found(scene(frame={"axis": [0, 0, 1], "rate": rate})) for rate in (0.0, 100.0))
    assert turning.settled < 0.8 * still.settled
    assert found(scene(gravity=[0, 0, 0])).settled == math.inf


def test_a_servo_counts_as_grains_that_weigh_three_times_its_pressure():
    """Pressure, or force over the area of the mesh, the largest of the course; what it holds may bear so much across."""
    weight = 0.6 * DENSITY * 30.0 * (0.1 + 2.0 * RADIUS) / 3.0
    lid = {"name": "lid", "material": "glass", "mesh": "lid.stl"}
    loads = ({"pressure": weight}, {"pressure": [[0.0, 0.0], [0.5, weight], [1.0, 1.0]]}, {"force": 0.04 * weight})
    heavy = found(scene(gravity=[0, 0, -30.0])).settled
    plate = {"lid": build_mesh(trimesh.creation.box((0.2, 0.2, 0.01)).triangles)}
    for load in loads:
        of = scene(gravity=[0, 0, 0], walls=[lid | {"servo": {"axis": [0, 0, -1], "max_speed": 0.1} | load}])
        assert time_step.limits(of, load_grains(of, {}), plate).settled == pytest.approx(heavy, rel=1e-6)


@pytest.mark.parametrize("speed", [0.01, 0.5, 3.0])
def test_hertz_contact_time_is_that_of_the_trajectory(speed):
    """Of an undamped impact of two equal grains, integrated from touch to separation."""
    stiffness = 4.0 / 3.0 * (YOUNG / (2.0 * (1.0 - POISSON**2))) * math.sqrt(0.5 * RADIUS)

    def motion(_, y):
        return [y[1], -stiffness * max(y[0], 0.0) ** 1.5 / (0.5 * MASS)]

    def apart(_, y):
        return y[0]

    apart.terminal, apart.direction = True, -1
    start = impact("hertz", stiffness / math.sqrt(0.5 * RADIUS), 0.5 * MASS, 0.5 * RADIUS, speed).overlap / speed
    path = solve_ivp(
        motion, (0.0, 10.0 * start), [0.0, speed], events=apart, rtol=1e-10, atol=1e-16, max_step=start / 50
    )
    limits = found(scene(time={"end": 1, "max_speed": speed}))
    assert limits.contact_time == pytest.approx(path.t_events[0][-1], rel=1e-6)
    deepest = impact("hertz", stiffness / math.sqrt(0.5 * RADIUS), 0.5 * MASS, 0.5 * RADIUS, speed).overlap
    assert path.y[0].max() == pytest.approx(deepest, rel=1e-3)


def test_hooke_contact_time():
    pairs = [{"materials": ["glass", "glass"], "restitution": 1.0, "stiffness": 200.0}]
    limits = found(scene(contact={"normal": "hooke", "tangential": "none"}, pairs=pairs))
    assert limits.contact_time == pytest.approx(math.pi * math.sqrt(0.5 * MASS / 200.0), rel=1e-14)


def test_stable_limit_of_two_undamped_frictionless_hooke_grains():
    """Two grains on a spring k: w^2 = 2 k/m, and a leapfrog is stable up to 2/w."""
    pairs = [{"materials": ["glass", "glass"], "restitution": 1.0, "stiffness": 200.0}]
    limits = found(scene(contact={"normal": "hooke", "tangential": "none"}, pairs=pairs))
    assert limits.stable == pytest.approx(2.0 / math.sqrt(2.0 * 200.0 / MASS), rel=1e-6)


@pytest.mark.parametrize(("contacts", "rough", "smooth"), [(6, 0.50, 1.00), (8, 0.43, 0.87), (12, 0.35, 0.71)])
def test_limits_of_cubic_packings_are_those_of_their_bloch_waves(contacts, rough, smooth):
    """Simple cubic, body- and face-centred, in sqrt(m/k_n), with k_t = 0.8 k_n and without; m* = m/2."""
    normal = stability_limit.along(1.0, 0.0, 0.5)
    limit = stability_limit.packing_limit(normal, stability_limit.across(0.8, 0.0, 0.5), contacts)
    assert limit == pytest.approx(rough, abs=0.005)
    limit = stability_limit.packing_limit(normal, stability_limit.across(0.0, 0.0, 0.5), contacts)
    assert limit == pytest.approx(smooth, abs=0.005)


@pytest.mark.parametrize(("restitution", "limit"), [(1.0, 2.0), (0.9, 1.87), (0.5, 1.31), (0.31, 1.04), (0.1, 0.73)])
def test_limit_of_a_damped_oscillator_under_the_predicted_velocity(restitution, limit):
    """Largest stable w dt, from the eigenvalues of the scheme."""
    beta = -math.log(restitution) / math.hypot(math.log(restitution), math.pi)
    assert stability_limit.stable_step(1.0, lambda _: 2.0 * beta, 1.0) == pytest.approx(limit, abs=0.006)


def test_damping_and_friction_lower_the_limit():
    pair = {"materials": ["glass", "glass"], "restitution": 1.0}
    plain = found(scene()).stable
    damped = found(scene(pairs=[pair | {"restitution": 0.1}])).stable
    rough = found(scene(contact={"tangential": "mindlin"}, pairs=[pair | {"friction": 0.5}])).stable
    assert damped == pytest.approx(math.sqrt(0.7) * plain)  # no dashpot takes more than 0.3 m*/dt
    assert rough < 0.95 * plain


def test_auto_takes_the_least_and_names_it():
    limits = found(scene())
    assert time_step.choose(scene(), limits) == min(limits.candidates.values())
    assert limits.candidates[limits.binding] == min(limits.candidates.values())
    fast = scene(frame={"axis": [0, 0, 1], "rate": 1e6})
    assert time_step.choose(fast, found(fast)) == pytest.approx(0.02 / 1e6)
    assert "rad of the frame" in found(fast).binding


def test_step_over_the_limit_is_refused_with_both_numbers():
    limit = found(scene()).stable
    fine = scene(time={"end": 1, "step": 0.99 * limit, "max_speed": 0.5})
    assert time_step.choose(fine, found(fine)) == 0.99 * limit
    bad = scene(time={"end": 1, "step": 1.01 * limit, "max_speed": 0.5})
    with pytest.raises(SceneError, match=rf"time\.step = {1.01 * limit:g} s is over the stability limit {limit:.3g} s"):
        time_step.choose(bad, found(bad))


def test_fall_speed_is_that_of_the_highest_fall():
    """sqrt(v0^2 + 2 g H) over the extent along gravity, plus what moves."""
    grains = [{"material": "glass", "positions": [[0, 0, 0], [0.7, 0, 0.2]], "radius": RADIUS}]
    of = scene(grains=grains, time={"end": 1})
    assert expected_load.fall_speed(of, load_grains(of, {}), {}) == pytest.approx(math.sqrt(2 * 9.81 * 0.2), rel=1e-12)
    moving = scene(grains=[grains[0] | {"velocities": [[0, 3, 4], [0, 0, 0]]}], time={"end": 1})
    expected = math.hypot(math.sqrt(2 * 9.81 * 0.2), 5.0)
    assert expected_load.fall_speed(moving, load_grains(moving, {}), {}) == pytest.approx(expected, rel=1e-12)
    for axis, height, arm in (([0, 0, 1], 0.2, 0.7), ([0, 1, 0], math.hypot(0.7, 0.2), math.hypot(0.7, 0.2))):
        turning = scene(grains=grains, time={"end": 1}, frame={"axis": axis, "rate": 10.0})
        # gravity turns against the axes about y: the extent along each of its directions may become the height
        expected = math.sqrt(2 * 9.81 * height) + 10.0 * arm
        assert expected_load.fall_speed(turning, load_grains(turning, {}), {}) == pytest.approx(expected, rel=1e-3)


def test_grains_fall_from_where_they_are_unless_something_lifts_them():
    """A floor 0.1 m below the grain; of walls that move alike one counts, and the two fastest."""
    grains = [{"material": "glass", "positions": [[0, 0, 0]], "radius": RADIUS}]

    def speed(*walls):
        of = scene(grains=grains, time={"end": 1}, walls=list(walls))
        return expected_load.fall_speed(of, load_grains(of, {}), {})

    floor = {"name": "floor", "material": "glass", "plane": {"point": [0, 0, -0.1], "normal": [0, 0, 1]}}
    assert speed(floor) == pytest.approx(math.sqrt(2 * 9.81 * 0.1))
    assert speed(floor | {"motion": {"velocity": [0, 0, 2]}}) == pytest.approx(math.sqrt(2 * 9.81 * 0.1) + 2)
    several = [floor | {"name": f"w{k}", "motion": {"velocity": [0, 0, speed]}} for k, speed in enumerate((2, 2, 1, 0.5))]
    assert speed(*several) == pytest.approx(math.sqrt(2 * 9.81 * 0.1) + 3)


@pytest.mark.parametrize(
    ("accuracy", "normal", "restitution", "steps"),
    [
        ("impact", "hertz", 0.5, 40), ("bulk", "hertz", 0.5, 8), ("bulk", "hertz", 0.2, 9), ("bulk", "hertz", 0.1, 12),
        ("bulk", "hertz_clamped", 0.1, 12), ("bulk", "jkr", 0.5, 12),
    ],
)  # fmt: skip
def test_auto_takes_the_fewest_steps_in_a_contact_that_its_accuracy_allows(accuracy, normal, restitution, steps):
    """``bulk``: from 8, until the restitution is right within 0.003; 12 where none is, or where a law acts beyond contact."""
    pair = {"materials": ["glass", "glass"], "restitution": restitution} | ({"surface_energy": 0.01} if normal == "jkr" else {})
    of = scene(
        pairs=[pair], contact={"normal": normal, "tangential": "none"}, time={"end": 1, "max_speed": 0.5, "accuracy": accuracy}
    )
    assert found(of).contact_steps == steps
    assert time_step.choose(of, found(of)) == pytest.approx(found(of).contact_time / steps)


@pytest.mark.parametrize("restitution", [0.1, 0.3, 0.5, 0.7, 0.9, 0.95])
@pytest.mark.parametrize("normal", ["hertz", "hooke"])
@pytest.mark.parametrize("wall", [False, True])
def test_restitution_with_auto_is_right_in_the_mean(restitution, normal, wall):
    """By the model of ``check``, which test_restitution.py compares with runs: within 0.003, and within 0.001 for impacts."""
    pair = {"materials": ["glass", "glass"], "restitution": restitution} | ({"stiffness": 200.0} if normal == "hooke" else {})
    more = {"walls": [{"name": "w", "material": "glass", "plane": {"point": [0, 0, -1], "normal": [0, 0, 1]}}]} if wall else {}
    for accuracy, bound in (("bulk", 0.003), ("impact", 0.001)):
        of = scene(
            pairs=[pair], contact={"normal": normal, "tangential": "none"}, gravity=[0, 0, 0],
            time={"end": 1, "max_speed": 0.5, "accuracy": accuracy}, **more,
        )  # fmt: skip
        error = restitution_error(of, load_grains(of, {}), 0.5, time_step.choose(of, found(of)))
        assert error is not None
        assert abs(error.mean) <= bound
        assert abs(error.worst) >= abs(error.mean)


def test_check_tells_what_the_cap_costs_a_strong_dashpot():
    """``hertz_clamped`` at e = 0.1: the numbers of its docstring, at 12 and at 40 steps per contact."""
    pair = {"materials": ["glass", "glass"], "restitution": 0.1}
    for accuracy, off in (("bulk", 0.11), ("impact", 0.0)):
        of = scene(
            pairs=[pair], contact={"normal": "hertz_clamped", "tangential": "none"}, gravity=[0, 0, 0],
            time={"end": 1, "max_speed": 0.5, "accuracy": accuracy},
        )  # fmt: skip
        error = restitution_error(of, load_grains(of, {}), 0.5, time_step.choose(of, found(of)))
        assert error is not None
        assert error.mean == pytest.approx(off, abs=0.003)


GRAIN = [{"material": "glass", "positions": [[0.3, 0, 0]], "radius": RADIUS}]


def test_no_known_speed_leaves_a_share_of_the_rayleigh_time():
    """Without gravity and speeds at the start: a field, or a program, may move grains all the same."""
    of = scene(time={"end": 1}, gravity=[0, 0, 0])
    assert found(of).max_speed == 0.0
    assert time_step.choose(of, found(of)) == pytest.approx(0.1 * found(of).rayleigh)


def test_a_spring_without_slope_is_bound_by_its_dashpot_alone():
    assert stability_limit.stable_step(0.0, lambda dt: 2.0, 1.0) == pytest.approx(0.5)
    assert stability_limit.stable_step(0.0, lambda dt: 0.3 / max(dt, 0.1), 1.0) == math.inf  # capped
    assert stability_limit.stable_step(-1.0, lambda dt: 0.0, 1.0) == math.inf


def test_a_law_whose_force_saturates_below_the_weight_has_a_limit_all_the_same(monkeypatch):
    """1 N at any overlap, where 2 N are to be carried: the stiffness at an overlap of R*."""
    monkeypatch.setattr("warpdem.model.impact._force_over_overlap", lambda normal, overlap, *_: 1.0 / overlap)
    secant, _ = pressed("hertz", 1e7, RADIUS, 2.0)
    assert 0.0 < secant <= 1e7 * math.sqrt(RADIUS) * math.sqrt(2.0 * RADIUS)


def test_nested_frames_are_bound_by_the_sum_of_their_rates():
    mill = [{"axis": [0, 0, 1], "rate": 4e5}, {"axis": [0, 1, 0], "sinusoid": {"amplitude": -6e5, "frequency": 3}}]
    limits = found(scene(frame=mill))
    assert limits.frame == pytest.approx(0.02 / 1e6)
    shaker = scene(frame={"amplitude": [0.1, 0, 0], "frequency": 50})
    assert found(shaker).frame == math.inf


def test_speeds_of_shifting_frames_and_walls_count():
    """Velocity + 2 pi f amplitude, of the frame and of each wall, whatever the place; nested rotations by their arms."""
    shaker = {"velocity": [3, 0, 4], "amplitude": [0, 0.01, 0], "frequency": 50}
    speed = 5.0 + 2 * math.pi * 50 * 0.01
    of = scene(grains=GRAIN, time={"end": 1}, frame=shaker)
    assert expected_load.fall_speed(of, load_grains(of, {}), {}) == pytest.approx(speed, rel=1e-12)
    plane = {"name": "w", "material": "glass", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}
    belt = plane | {"surface_velocity": {"axis": [0, 1, 0], "schedule": [{"until": 1, "speed": [0, -20]}, {"speed": 1}]}}
    of = scene(grains=GRAIN, time={"end": 1}, gravity=[0, 0, 0], walls=[belt])
    assert expected_load.fall_speed(of, load_grains(of, {}), {}) == pytest.approx(20.0, rel=1e-12)
    of = scene(grains=GRAIN, time={"end": 1}, gravity=[0, 0, 0], walls=[plane | {"motion": shaker}])
    assert expected_load.fall_speed(of, load_grains(of, {}), {}) == pytest.approx(speed, rel=1e-12)
    mill = [{"axis": [0, 0, 1], "rate": 10}, {"axis": [0, 0, 1], "origin": [0.2, 0, 0], "rate": -7}]
    of = scene(grains=GRAIN, time={"end": 1}, gravity=[0, 0, 0], frame=mill)
    # 0.1 m from the inner axis, so at most 0.3 m from the outer one
    assert expected_load.fall_speed(of, load_grains(of, {}), {}) == pytest.approx(7 * 0.1 + 10 * 0.3, rel=1e-12)


def test_speed_of_a_sampled_frame_counts(tmp_path):
    """Half a metre in two seconds while turning by a quarter: steady speeds."""
    stage = Usd.Stage.CreateNew(str(tmp_path / "a.usda"))
    stage.SetTimeCodesPerSecond(1)
    UsdGeom.SetStageMetersPerUnit(stage, 1)
    UsdGeom.SetStageUpAxis(stage, "Z")
    xform = UsdGeom.Xform.Define(stage, "/A")
    shift, turn = xform.AddTranslateOp(), xform.AddRotateZOp(UsdGeom.XformOp.PrecisionDouble)
    for code, x, angle in ((0, 0.0, 0.0), (2, 0.5, 90.0)):
        shift.Set(Gf.Vec3d(x, 0, 0), code)
        turn.Set(angle, code)
    stage.Save()
    of = scene(grains=GRAIN, time={"end": 1}, gravity=[0, 0, 0], frame={"usd": str(tmp_path / "a.usda"), "prim": "/A"})
    wanted = 0.25 + 0.3 * math.pi / 4
    assert expected_load.fall_speed(of, load_grains(of, {}), {}) == pytest.approx(wanted, rel=1e-9)
    assert found(of).frame == pytest.approx(0.02 / (math.pi / 4), rel=1e-9)


def test_damped_contact_factor_against_trajectories():
    """Hertz with Tsuji's damping, K = m = 1: K x^(3/2) + C x^(1/4) x', C = sqrt(5) |beta| sqrt(m K), from touch to touch."""
    for e in (0.1, 0.3, 0.5, 0.9):
        damping = math.sqrt(5.0) * -math.log(e) / math.hypot(math.log(e), math.pi)

        def motion(_, y, damping=damping):
            x = max(y[0], 0.0)
            return [y[1], -(x**1.5) - damping * x**0.25 * y[1]]

        def apart(_, y):
            return y[0]

        apart.terminal, apart.direction = True, -1
        path = solve_ivp(motion, (0.0, 50.0), [0.0, 1.0], events=apart, rtol=1e-9, atol=1e-12, max_step=0.05)
        undamped = 2.943275184 * 1.25**0.4
        assert -path.y_events[0][-1][1] == pytest.approx(e, abs=1e-3)
        factor = hertz.damped_time(e)
        assert factor == pytest.approx(path.t_events[0][-1] / undamped, rel=5e-3)
    assert np.all(np.diff([hertz.damped_time(e) for e in np.linspace(0.05, 1.0, 50)]) < 0)


def test_a_lone_free_grain_has_no_contact_to_limit_it():
    alone = found(scene(grains=[{"material": "glass", "positions": [[0, 0, 0]], "radius": RADIUS}]))
    assert alone.stable == alone.contact_time == math.inf
    assert alone.overlap == 0.0


def test_a_dashpot_is_reduced_by_the_kernel_s_slope_where_a_law_unloads_more_steeply():
    """Luding: k1, not k2; Hertz and JKR, whose slope is TANGENT k_n or less: that slope, to the bit."""
    assert dashpot_slope("luding", 500.0, 100.0) == 100.0
    assert dashpot_slope("edinburgh", 300.0, 100.0) == 150.0
    assert dashpot_slope("jkr", 120.0, 100.0) == 120.0
    assert dashpot_slope("hertz", 150.00001, 100.0) == 150.00001
    acting = stability_limit.along(500.0, 0.2, 1e-6, 100.0).acting(1e-5)
    assert acting == pytest.approx(0.2 / max(1.0 + 100.0 * 1e-10 / 2e-6, 0.2 * 1e-5 / 0.3e-6))
    packed = [
        limits_at(of, next(contact_cases(of, load_grains(of, {}))), 100.0, 500.0, None)[0]
        for of in (scene(contact={"normal": normal, "tangential": "none"}, pairs=[pair]) for normal, pair in YIELDING)
    ]
    assert packed[0] < 0.97 * packed[1], "a dashpot that acts more leaves less"


YIELDING = [
    ("luding", {"materials": ["glass", "glass"], "restitution": 0.6, "stiffness": 100.0, "unloading_stiffness": 500.0}),
    ("hooke", {"materials": ["glass", "glass"], "restitution": 0.6, "stiffness": 100.0}),
]
