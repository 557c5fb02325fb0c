"""The joined law along given paths: Coulomb limit, energy over closed cycles, the spring's turn, the rolling torque."""

import functools

import numpy as np
import pytest
import warp as wp
from warpdem.kernels.contact import columns, law
from warpdem.kernels.normal import hertz
from warpdem.kernels.rolling import constant, spring
from warpdem.kernels.tangential import mindlin, mindlin_displacement

STIFFNESS, SHEAR, FRICTION = 1e6, 1.2, 0.4  # K [N/m^1.5], k_t/k_n [-], mu [-]
DEPTH = 1e-4  # deepest overlap [m]
DT = 1e-3
EPS = {wp.float32: 1.2e-7, wp.float64: 2.3e-16}


def coefficients(real, **values):
    """Coefficients of Hertz's law by name; those not given are 0."""
    at = columns.coefficients(hertz)
    return at.vector(real)(*(values.pop(name, 0.0) for name in at.names))


@functools.cache
def path_kernel(real, tangential):
    """Kernel that takes one contact per thread along a path of relative positions (x, y tangential, z overlap)."""
    vec3 = wp.types.vector(3, real)
    joined = law.build(real, hertz, tangential, None, False)
    past, Coefficients, Constants, History = joined.history, joined.Coefficients, joined.Constants, joined.History

    @wp.kernel(module="unique", enable_backward=False)
    def kernel(
        path: wp.array2d(dtype=vec3),
        damping: real,
        c: Coefficients,
        spin: real,  # of both bodies about the normal [rad/step]
        force_out: wp.array2d(dtype=vec3),
        spring_out: wp.array2d(dtype=vec3),
    ):
        p = wp.tid()
        n = vec3(real(0.0), real(0.0), real(1.0))
        mean_rotation = n * spin
        k = Constants(real(wp.static(STIFFNESS)), damping, real(0.0))  # of bodies too heavy to move in a step
        history = History()
        for s in range(1, path.shape[1]):
            now = path[p, s]
            before = path[p, s - 1]
            # i sinks towards j as the overlap grows
            step = vec3(now[0] - before[0], now[1] - before[1], before[2] - now[2])
            velocity = step / real(wp.static(DT))
            force, _moment, after = joined.force(
                n, n, now[2], before[2], velocity, step, mean_rotation, vec3(), vec3(), real(wp.static(DT)), k, real(1.0),
                real(1.0), c, history,
            )  # fmt: skip
            history = after
            force_out[p, s] = force
            spring_out[p, s] = past.spring(after)

    return kernel


def follow(path, tangential, *, real=wp.float64, friction=FRICTION, damping=0.0, spin=0.0):
    """Forces on i [N] and springs [m] along paths of shape (paths, steps, 3)."""
    vec3 = wp.types.vector(3, real)
    out = [wp.zeros(path.shape[:2], dtype=vec3, device="cpu") for _ in range(2)]
    c = coefficients(real, shear=SHEAR, shear_damping=1.0, friction=friction)
    inputs = [wp.array(path, dtype=vec3, device="cpu"), damping, c, spin, *out]
    wp.launch(path_kernel(real, tangential), dim=path.shape[0], inputs=inputs, device="cpu")
    return [x.numpy().astype(float) for x in out]


def work(path, force):
    """Work of the contact on the two bodies [J] up to each step, normal and tangential, by trapezoids."""
    way = np.diff(path, axis=1) * [1.0, 1.0, -1.0]
    mid = 0.5 * (force[:, 1:] + force[:, :-1])
    done = np.cumsum(mid * way, axis=1)
    return done[..., 2], done[..., 0] + done[..., 1]


def lines(points, steps):
    """Path of straight lines between ``points`` (paths, k, 3), each of ``steps`` steps."""
    share = np.arange(steps) / steps
    legs = [
        points[:, [k]] + share[None, :, None] * (points[:, [k + 1]] - points[:, [k]])
        for k in range(points.shape[1] - 1)
    ]
    return np.concatenate([*legs, points[:, [-1]]], axis=1)


def random_cycles(seed, paths=64, corners=12, steps=500):
    """Closed cycles: touch, wander in slip and overlap, come back to where the contact began."""
    rng = np.random.default_rng(seed)
    reach = FRICTION * DEPTH / SHEAR  # slip that reaches the Coulomb limit
    points = np.zeros((paths, corners, 3))
    points[..., :2] = 3 * reach * rng.uniform(-1, 1, (paths, corners, 2)) * rng.uniform(0.05, 1, (paths, 1, 1))
    points[..., 2] = DEPTH * rng.uniform(0.0, 1.0, (paths, corners))
    points[:, [0, -1]] = 0.0
    return lines(points, steps)


def force_scale():
    """Work of the largest normal force over the deepest overlap [J]."""
    return STIFFNESS * DEPTH**2.5


@pytest.mark.parametrize("friction", [0.1, FRICTION, 1e3], ids=["slips", "both", "sticks"])
@pytest.mark.parametrize("damping", [0.0, 1e4], ids=["elastic", "damped"])
def test_mindlin_takes_energy_over_every_closed_cycle(friction, damping):
    """Work of a closed cycle <= 0 (performance.md 4.5: only force history rescaled on unloading grants it)."""
    for seed in range(3):
        path = random_cycles(seed)
        force, _ = follow(path, mindlin, friction=friction, damping=damping)
        normal, tangential = (w[:, -1] for w in work(path, force))
        # trapezoids on d^(3/2) err by (h^2/12) F'' = (1/500)^2 / 16 per leg; the elastic cycle closes to that
        tolerance = 12 * force_scale() / (16 * 500**2)
        assert np.all(normal <= tolerance)
        # per step the spring is first rescaled, then stretched: the order costs at most (1/500) of one leg's rescaling,
        # always on the side of dissipation; the trapezoid leaves what it leaves in the normal direction
        assert np.all(tangential <= tolerance)
        assert np.all(normal + tangential < 0)


@pytest.mark.parametrize("tangential", [mindlin, mindlin_displacement])
@pytest.mark.parametrize("damping", [0.0, 1e4], ids=["elastic", "damped"])
def test_friction_never_exceeds_its_limit_and_never_pulls_without_load(real, tangential, damping):
    path = random_cycles(7)
    force, _ = follow(path, tangential, real=real, damping=damping)
    push = np.maximum(force[..., 2], 0.0)
    friction = np.linalg.norm(force[..., :2], axis=-1)
    assert np.all(friction <= FRICTION * push * (1 + 6 * EPS[real]))
    assert np.isclose(friction, FRICTION * push, rtol=1e-5)[push > 0].any(), "the path never slips"
    if damping > 0:
        assert np.any(force[..., 2] < 0), "the path never has an attractive normal force"


def shear_press_release(tangential):
    """Shear at overlap d, double the overlap, let the spring go; returned over stored energy."""
    d, s = 0.5 * DEPTH, 1e-6
    points = np.array([[[0, 0, d], [s, 0, d], [s, 0, 2 * d], [0, 0, 2 * d]]])
    path = lines(points, 400)
    force, _ = follow(path, tangential, friction=1e3)
    done = work(path, force)[1][0]
    stored = -done[399]
    return stored, (done[800:].max() - done[799]) / stored


def test_mindlin_displacement_creates_energy_when_a_sheared_contact_is_pressed():
    """sqrt(2) = 1.41 comes back after the overlap doubled (performance.md 4.5)."""
    stored, returned = shear_press_release(mindlin_displacement)
    assert stored == pytest.approx(0.5 * SHEAR * STIFFNESS * np.sqrt(0.5 * DEPTH) * 1e-12, rel=1e-12, abs=0)
    assert returned == pytest.approx(np.sqrt(2.0), rel=1e-12)


def test_mindlin_gives_back_less_than_was_put_in():
    """1/sqrt(2) = 0.71 comes back after the overlap doubled: the force stays, the spring is stiffer."""
    # the release passes zero force inside a step: (1/400)^2
    assert shear_press_release(mindlin)[1] == pytest.approx(np.sqrt(0.5), rel=1e-4)


def test_tangential_force_at_fixed_overlap_is_the_stiffness_times_the_slip(real):
    """F_t = k_t s with k_t = (k_t/k_n) K sqrt(d) (exact_solutions 3, stiffness probe)."""
    path = lines(np.array([[[0, 0, DEPTH], [3e-6, -4e-6, DEPTH]]]), 10)
    force, _ = follow(path, mindlin, real=real)
    k_t = SHEAR * STIFFNESS * np.sqrt(DEPTH)
    np.testing.assert_allclose(force[0, 1:, :2], -k_t * path[0, 1:, :2], rtol=60 * EPS[real], atol=1e-30)


def test_a_sheared_contact_turned_about_its_normal_keeps_its_force_in_turning_axes():
    """Bodies that turn together by 0.01 rad per step carry the spring with them (design section 3)."""
    sheared = lines(np.array([[[0, 0, DEPTH], [3e-6, -4e-6, DEPTH]]]), 1)
    path = np.concatenate([sheared, np.repeat(sheared[:, -1:], 1000, axis=1)], axis=1)
    force, spring = follow(path, mindlin, spin=0.01)
    angle = 0.01 * np.arange(1001)
    turned = (force[0, 1:, 0] + 1j * force[0, 1:, 1]) * np.exp(-1j * angle)
    # per step the series of the turn errs by phi^5/120 in angle and phi^6/144 in length; the rest is round-off
    np.testing.assert_allclose(turned, turned[0], rtol=1000 * (0.01**5 / 120 + 0.01**6 / 144 + 20 * EPS[wp.float64]))
    assert np.linalg.norm(spring[0, -1]) == pytest.approx(5e-6, rel=1e-11, abs=0)


@functools.cache
def rolling_kernel(torsion):
    joined = law.build(wp.float64, hertz, None, constant, torsion)
    Coefficients, Constants, History = joined.Coefficients, joined.Constants, joined.History

    @wp.kernel(module="unique", enable_backward=False)
    def kernel(n: wp.vec3d, spin: wp.vec3d, c: Coefficients, out: wp.array(dtype=wp.vec3d)):
        zero = wp.vec3d()
        force, moment, _after = joined.force(
            n, n, wp.float64(1.0e-4), wp.float64(1.0e-4), zero, zero, zero, spin, spin, wp.float64(1.0e-9),
            Constants(wp.float64(1.0e6), wp.float64(0.0), wp.float64(0.0)), wp.float64(5.0e-4), wp.float64(1.0), c, History(),
        )  # fmt: skip
        out[0] = force
        out[1] = moment

    return kernel


@pytest.mark.parametrize("torsion", [False, True])
def test_rolling_torque_leaves_the_spin_about_the_normal_alone_unless_torsion_is_on(torsion):
    out = wp.zeros(2, dtype=wp.vec3d, device="cpu")
    c = coefficients(wp.float64, shear=SHEAR, shear_damping=1.0, friction=FRICTION, rolling_friction=0.1)
    wp.launch(
        rolling_kernel(torsion), dim=1, inputs=[wp.vec3d(0.0, 0.6, 0.8), wp.vec3d(0.0, 4.0, 7.0), c, out], device="cpu"
    )
    force, moment = out.numpy()
    np.testing.assert_allclose(force, [0.0, 0.6, 0.8], rtol=1e-14)  # K d^(3/2) = 1 N along n
    spin = np.array([0.0, 4.0, 7.0])
    rolled = spin if torsion else spin - np.array([0.0, 0.6, 0.8]) * 8.0  # w . n = 8
    # M = -mu_r R* F_n w/|w| = 0.1 * 5e-4 * 1
    np.testing.assert_allclose(moment, -5e-5 * rolled / np.linalg.norm(rolled), rtol=1e-13, atol=1e-19)


@functools.cache
def one_step_kernel():
    """Kernel that evaluates one contact of Hertz, Mindlin and the rolling spring."""
    joined = law.build(wp.float64, hertz, mindlin, spring, False)
    past, Coefficients, Constants, Own = joined.history, joined.Coefficients, joined.Constants, joined.history.Own

    @wp.kernel(module="unique", enable_backward=False)
    def kernel(vectors: wp.array(dtype=wp.vec3d), numbers: wp.array(dtype=wp.float64), c: Coefficients,
               out: wp.array(dtype=wp.vec3d)):  # fmt: skip
        force, moment, after = joined.force(
            vectors[0], vectors[1], numbers[0], numbers[0], vectors[2], vectors[3], vectors[4], vectors[5], vectors[6],
            numbers[1], Constants(numbers[2], numbers[3], numbers[4]), numbers[5], numbers[6], c,
            past.joined(vectors[7], vectors[8], wp.float64(0.0), wp.float64(0.0), Own()),
        )  # fmt: skip
        out[0] = force
        out[1] = moment
        out[2] = past.spring(after)
        out[3] = past.angle(after)

    return kernel


CONTACT = {
    "overlap": DEPTH, "dt": DT, "stiffness": STIFFNESS, "damping": 50.0, "inverse_mass": 0.0, "radius": 5e-4, "inertia": 1e-9,
}  # fmt: skip
COEFFICIENTS = {"shear": SHEAR, "shear_damping": 0.7, "friction": 0.9, "rolling_friction": 0.2, "rolling_damping": 0.3}
VECTORS = ("n", "n_before", "velocity", "slip", "mean_rotation", "spin", "spin_predicted", "spring", "angle")


def one_step(contact=CONTACT, **vectors):
    """Force [N], rolling torque [N m], tangential spring [m] and rolling spring [rad] of one contact; zero where not given."""
    given = wp.array([vectors.get(name, np.zeros(3)) for name in VECTORS], dtype=wp.vec3d, device="cpu")
    numbers = wp.array(list(contact.values()), dtype=wp.float64, device="cpu")
    out = wp.zeros(4, dtype=wp.vec3d, device="cpu")
    c = coefficients(wp.float64, **COEFFICIENTS)
    wp.launch(one_step_kernel(), dim=1, inputs=[given, numbers, c, out], device="cpu")
    return out.numpy()


def test_each_coefficient_acts_where_the_formulas_say():
    """A contact that sticks, rolls and parts at once, against the formulas written out (design section 3)."""
    n = np.array([0.0, 0.6, 0.8])
    velocity, slip, held = np.array([0.02, 0.03, -0.01]), np.array([1e-7, -2e-7, 3e-7]), np.array([2e-7, 0.8e-7, -0.6e-7])
    spin, predicted, angle = np.array([1.0, 2.0, -3.0]), np.array([-4.0, 1.0, 2.0]), np.array([0.01, 0.04, -0.03])
    force, torque, spring_now, angle_now = one_step(
        n=n, n_before=n, velocity=velocity, slip=slip, spin=spin, spin_predicted=predicted, spring=held, angle=angle
    )

    def across(v):
        return v - n * (v @ n)

    k_n, gamma_n = STIFFNESS * DEPTH**0.5, CONTACT["damping"] * DEPTH**0.25
    normal = k_n * DEPTH - gamma_n * (velocity @ n)
    stretched = held + across(slip)
    expected = n * normal - SHEAR * k_n * stretched - 0.7 * gamma_n * across(velocity)
    np.testing.assert_allclose(spring_now, stretched, rtol=1e-13)
    np.testing.assert_allclose(force, expected, rtol=1e-13)
    k_r = 2.25 * k_n * (0.2 * CONTACT["radius"]) ** 2
    rolled = angle + across(spin) * DT
    assert k_r * np.linalg.norm(rolled) < 0.2 * CONTACT["radius"] * normal, "the rolling spring slides"
    np.testing.assert_allclose(angle_now, rolled, rtol=1e-13)
    viscous = 2 * 0.3 * np.sqrt(CONTACT["inertia"] * k_r) / (1 + 0.5 * k_r * DT**2 / CONTACT["inertia"])
    np.testing.assert_allclose(torque, -k_r * rolled - viscous * across(predicted), rtol=1e-13)


@pytest.mark.parametrize("damping", [2e-3, 200.0])
def test_dashpots_make_up_for_the_predicted_velocity_and_have_a_cap(damping):
    """gamma/(1 + k dt^2/(2 m)), with the slope 1.5 k_n along and m_t = (2/7) m* across; at most 0.3 m*/dt and 0.25 m_t/dt."""
    contact = CONTACT | {"inverse_mass": 1.0 / 4e-3, "damping": damping}
    n, velocity = np.array([0.0, 0.6, 0.8]), np.array([0.02, 0.03, -0.01])
    force = one_step(contact, n=n, n_before=n, velocity=velocity)[0]
    k_n, gamma_n = STIFFNESS * DEPTH**0.5, damping * DEPTH**0.25
    mass, across = 4e-3 * 2 / 7, velocity - n * (velocity @ n)
    along = min(gamma_n / (1 + 1.5 * k_n * DT**2 / (2 * 4e-3)), 0.3 * 4e-3 / DT)
    sideways = min(0.7 * gamma_n / (1 + SHEAR * k_n * DT**2 / (2 * mass)), 0.25 * mass / DT)
    assert (along == 0.3 * 4e-3 / DT) is (sideways == 0.25 * mass / DT) is (damping > 1.0)
    np.testing.assert_allclose(force, n * (k_n * DEPTH - along * (velocity @ n)) - sideways * across, rtol=1e-13)


def test_an_approach_along_the_mid_step_normal_is_no_slip():
    """The normal swings by 0.2 rad while the two approach: nothing of that stretches the spring (Vyas et al. 2025)."""
    n_before, n = np.array([0.0, 0.0, 1.0]), np.array([np.sin(0.2), 0.0, np.cos(0.2)])
    spring_now = one_step(n=n, n_before=n_before, slip=-1e-6 * (n + n_before))[2]
    np.testing.assert_allclose(spring_now, 0.0, rtol=0, atol=1e-21)
    # and a slip across it counts in full
    side = np.array([np.cos(0.1), 0.0, -np.sin(0.1)])
    assert one_step(n=n, n_before=n_before, slip=1e-8 * side)[2] @ side == pytest.approx(1e-8 * np.cos(0.1) ** 2, rel=1e-12)


def test_both_springs_swing_and_turn_with_the_contact():
    """A contact turned rigidly about another axis takes its springs along (second order in the turn)."""
    u = np.array([3e-3, -2e-3, 4e-3])
    n_before = np.array([0.0, 0.6, 0.8])
    spring_before, angle_before = 1e-8 * np.array([3.0, 0.8, -0.6]), 1e-3 * np.array([-1.0, 1.6, -1.2])
    n, spring_expected, angle_expected = (v + np.cross(u, v) + 0.5 * np.cross(u, np.cross(u, v))
                                          for v in (n_before, spring_before, angle_before))  # fmt: skip
    n /= np.linalg.norm(n)
    *_, spring_now, angle_now = one_step(
        n=n, n_before=n_before, mean_rotation=u, spring=spring_before, angle=angle_before
    )
    for now, expected in ((spring_now, spring_expected), (angle_now, angle_expected)):
        np.testing.assert_allclose(now, expected, rtol=0, atol=1e-7 * np.linalg.norm(expected))
