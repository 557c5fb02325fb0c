import math
from types import SimpleNamespace

import numpy as np
import pytest
from warpdem.kernels.normal import hooke, luding

from law_probe import Contacts
from law_scenes import MASS, RADIUS, impacts, parting_speeds
from model_probes import RTOL
from warpdem import SceneError, Simulation

K1, KP, DEPTH, M = 100.0, 500.0, 2e-5, 5e-6  # stiffnesses [N/m], d_p [m], m* [kg]
BED = {"stiffness": 300, "unloading_stiffness": 900, "adhesion_stiffness": 100}
"""Keys of the pair of materials in the bed of ``test_laws_anywhere``."""
REDUCED = 0.5 * RADIUS
PHASES = 8
TABLE = [
    # speed, k_c, largest overlap, d0, k2, least force and where, restitution: exact, by pieces
    (0.02, 0.0, 4.472135955e-6, 2.11145618e-6, 189.4427191, 0.0, None, 0.726542528005),
    (0.02, 100.0, 4.472135955e-6, 2.11145618e-6, 189.4427191, -1.38196601125e-4, 1.38196601125e-6, 0.61803398875),
    (0.02, 500.0, 4.472135955e-6, 2.11145618e-6, 189.4427191, -2.90089364148e-4, 5.80178728e-7, 0.470753178066),
    (0.05, 0.0, 1.11803398875e-5, 7.72542485937e-6, 323.60679775, 0.0, None, 0.555892970251),
    (0.05, 100.0, 1.11803398875e-5, 7.72542485937e-6, 323.60679775, -5.90169943749e-4, None, None),
]


def pair(kc=0.0, kp=KP, restitution=1.0):
    phi = DEPTH * (KP - K1) / (KP * 2.0 * REDUCED)
    return SimpleNamespace(
        restitution=restitution, stiffness=K1, tangential_stiffness_ratio=2 / 7, unloading_stiffness=kp, plasticity_depth=phi,
        adhesion_stiffness=kc,
    )  # fmt: skip


def contacts(kc=0.0, **keywords):
    return Contacts(luding, luding.coefficients(None, None, pair(kc)), REDUCED, M, **keywords)


def along(made, path):
    """Forces along a path of overlaps, each remembering the one before; and the largest overlaps remembered."""
    history, before = np.zeros((1, 1)), 0.0
    forces, deepest = [], []
    for d in path:
        out = made.force([d], [before], history=history)
        history, before = out["history"], d
        forces.append(out["force"][0])
        deepest.append(history[0, 0])
    return np.array(forces), np.array(deepest)


@pytest.mark.parametrize(("speed", "kc", "deepest", "rest", "k2", "least", "where", "e"), TABLE)
def test_impacts_by_pieces(speed, kc, deepest, rest, k2, least, where, e):
    """Work of the law's own force along its straight pieces: exact, so restitution and pull are to round-off."""
    made = contacts(kc)
    top = speed * math.sqrt(M / K1)
    assert top == pytest.approx(deepest, rel=1e-10, abs=0)
    touch = made.force([top], 0.0)
    assert touch["force"][0] == pytest.approx(K1 * top, rel=1e-14)
    line = made.force([0.99 * top, 0.98 * top], top, history=touch["history"])["force"]
    slope = (line[0] - line[1]) / (0.01 * top)
    assert slope == pytest.approx(k2, rel=1e-9)
    assert top - K1 * top / slope == pytest.approx(rest, rel=1e-8, abs=0)
    # where the branch begins, by bisection of the force that is least
    low, high = 0.0, rest
    for _ in range(60):
        middle = 0.5 * (low + high)
        kept = made.force([middle], top, history=touch["history"])["history"][0, 0]
        low, high = (middle, high) if kept < top else (low, middle)
    begun = 0.5 * (low + high)
    force = made.force([begun], top, history=touch["history"])["force"][0]
    assert force == pytest.approx(least, rel=1e-11, abs=1e-16)
    if where is not None:
        assert begun == pytest.approx(where, rel=1e-8, abs=0)
    given = 0.5 * (K1 * top + force) * (top - begun) + 0.5 * force * begun
    if e is None:
        assert given < 0.0, "it takes more to part than the impact has left"
    else:
        assert math.sqrt(2.0 * given / M) / speed == pytest.approx(e, rel=1e-12)


def test_the_branch_forgets_and_pressing_again_starts_from_there(real):
    made = contacts(100.0, real=real)
    forces, deepest = along(made, [1e-5, 1e-6, 0.5e-6, 0.6e-6, deepest_at(made, 0.5e-6) + 1e-7])
    tolerance = {"rtol": 30 * RTOL[real]}
    np.testing.assert_allclose(forces[:3], [K1 * 1e-5, -100.0 * 1e-6, -100.0 * 0.5e-6], **tolerance)
    assert deepest[0] > deepest[1] > deepest[2] > 0.5e-6
    k2 = K1 + (KP - K1) * deepest[2] / DEPTH
    assert forces[3] - forces[2] == pytest.approx(k2 * 0.1e-6, rel=1e-3 if real.__name__ == "float32" else 1e-9)
    np.testing.assert_allclose(forces[4], K1 * deepest[4], **tolerance)  # yields again


def deepest_at(made, d):
    return along(made, [1e-5, d])[1][1]


def test_beyond_its_depth_a_contact_is_elastic(real):
    made = contacts(100.0, real=real)
    forces, _ = along(made, [3e-5, 2.5e-5, 3e-5, 3.5e-5])
    line = K1 * DEPTH + KP * (np.array([3e-5, 2.5e-5, 3e-5, 3.5e-5]) - DEPTH)
    np.testing.assert_allclose(forces, line, rtol=1e-5 if real.__name__ == "float32" else 1e-13)


def test_contacts_end_at_no_overlap_and_remember_nothing_and_friction_goes_by_the_pressure():
    made = contacts(100.0)
    out = made.force([-1e-9], 1e-9, history=[[1e-5]])
    assert (out["force"][0], out["load"][0], out["k_n"][0], out["history"][0, 0]) == (0.0, 0.0, 0.0, 0.0)
    d = np.array([8e-6, 5.5e-6, 0.5e-6])
    out = made.force(d, 1e-5, history=[[1e-5]])
    pressure = np.maximum(out["force"] + 100.0 * d, 0.0)
    assert (pressure > 0.0).tolist() == [True, True, False]
    np.testing.assert_allclose(out["load"], pressure, rtol=1e-14, atol=1e-20)
    assert (out["k_n"] == K1).all()


def test_without_hardening_it_is_hooke():
    made = Contacts(luding, luding.coefficients(None, None, pair(kp=K1)), REDUCED, M)
    d = np.array([1e-6, 1e-5, 1e-4])
    np.testing.assert_allclose(made.force(d, history=[[1e-4]])["force"], K1 * d, rtol=1e-7)
    assert luding.coefficients(None, None, pair(restitution=0.5))[:4] == hooke.coefficients(None, None, pair(restitution=0.5))


def test_energies_for_readers_are_the_work_of_the_force():
    made = contacts(100.0)
    own = dict(zip(luding.COEFFICIENTS, made.constants[3:], strict=True))
    told = luding.own_constants(REDUCED, *luding.coefficients(None, None, pair(100.0))[4:])
    np.testing.assert_allclose([float(x) for x in told.values()], made.constants[3:], rtol=1e-14)
    h, top = 1e-10, 1e-5
    for d in (9e-6, 5e-6):
        force = made.force([d], top, history=[[top]])["force"][0]
        at = [luding.stored(d + s * h, K1, **own, deepest=top) for s in (1, -1)]
        assert (at[0] - at[1]) / (2 * h) == pytest.approx(force, rel=1e-6)
    for d in (5e-6, 3e-5):
        force = made.force([d], 0.0)["force"][0]
        at = [luding.energy(d + s * h, K1, **own, deepest=0.0) for s in (1, -1)]
        assert (at[0] - at[1]) / (2 * h) == pytest.approx(force, rel=1e-6)
    assert luding.slope(1e-5, K1, **own, deepest=0.0) == pytest.approx(300.0)
    assert luding.slope(1e-6, K1, **own, deepest=1.0) == KP
    assert luding.stored(-1e-6, K1, **own, deepest=0.0) == 0.0


@pytest.mark.parametrize(("kc", "e"), [(0.0, 0.726542528005), (100.0, 0.61803398875), (500.0, 0.470753178066)])
def test_a_run_gives_back_what_it_should_and_tells_what_was_lost(kc, e):
    """The impact of the table in units in which two grains of the reference have m* = 5e-6 kg: stiffness scaled by m*."""
    scale = 0.5 * MASS / M
    given = {
        "stiffness": K1 * scale, "unloading_stiffness": KP * scale, "adhesion_stiffness": kc * scale,
        "plasticity_depth": pair().plasticity_depth,
    }  # fmt: skip
    half = math.pi * math.sqrt(M / K1)
    errors = {}
    for steps in (50, 200):
        scene = impacts("luding", given, 0.02, half / steps, phases=PHASES, measures={"energy": True})
        sim = Simulation(scene, device="cpu", threads=1)
        sim.run(until=3.0 * half)
        of_pairs, at_wall = parting_speeds(sim, PHASES)
        errors[steps] = np.abs(of_pairs / 0.02 - e).max()
        budget = sim.budget.energy()
        lost = budget["dissipated_plasticity"] + budget["dissipated_adhesion"]
        start = 0.5 * 0.02**2 * MASS * 1.5 * PHASES
        left = 0.5 * MASS * (0.5 * (of_pairs**2).sum() + (at_wall**2).sum())
        assert lost == pytest.approx(start - left, rel=1e-3 if steps == 200 else 1e-2)
        assert (budget["dissipated_adhesion"] > 0.02 * lost) == (kc > 0.0)
        assert budget["dissipated_plasticity"] > 0.3 * lost
        assert abs(budget["integration_error"]) < (1e-3 if steps == 200 else 1e-2) * start
    assert errors[200] < 1e-3
    assert errors[200] < errors[50] / 4.0


def test_a_contact_that_unloads_softer_than_it_loads_is_refused():
    given = {"stiffness": 500, "unloading_stiffness": 100}
    with pytest.raises(SceneError, match="at least the stiffness of loading.* = 500 N/m"):
        impacts("luding", given, 0.1, 1e-6)


def test_next_to_no_hardening_is_elastic_in_single_precision_too(real):
    """k_p = k1 (1 + 1e-8) is k1 in float32."""
    made = Contacts(luding, luding.coefficients(None, None, pair(100.0, kp=K1 * (1.0 + 1e-8))), REDUCED, M, real=real)
    forces, deepest = along(made, [1e-5, 0.0, -1e-6, 1e-5])
    np.testing.assert_allclose(forces, [K1 * 1e-5, 0.0, 0.0, K1 * 1e-5], rtol=10 * RTOL[real])
    np.testing.assert_allclose(deepest, [1e-5, 0.0, 0.0, 1e-5], rtol=10 * RTOL[real])
