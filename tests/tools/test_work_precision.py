"""The benchmark of error against run time: its comparisons on made-up curves, its problems, one tiny run."""

import json

import numpy as np
import pytest

from bench.work_precision import compare, measure, plot
from bench.work_precision.problems import PROBLEMS, Setting


def curve(integrator, errors, calls=1, precision="double"):
    """Settings of one scheme at 10, 100, 1000... steps."""
    return [
        {"integrator": integrator, "precision": precision, "steps": 10 ** (k + 1), "calls_per_step": calls,
         "force_calls": calls * 10 ** (k + 1), "error": error, "seconds": None}
        for k, error in enumerate(errors)
    ]  # fmt: skip


# --- comparisons -----------------------------------------------------------------------------------------------------


def test_cost_at_an_error_lies_on_the_line_between_settings():
    first = curve("a", [1e-1, 1e-2, 1e-3])
    assert compare.cost_at(first, 1e-2, "force_calls") == pytest.approx(100)
    assert compare.cost_at(first, 10**-2.5, "force_calls") == pytest.approx(10**2.5)
    assert compare.cost_at(first, 0.5, "force_calls") == 10
    assert compare.cost_at(first, 1e-4, "force_calls") is None


def test_lucky_zeros_and_break_downs_do_not_count():
    lucky = curve("a", [1e-1, 1e-9, 1e-2, 1e-3])
    assert compare.cost_at(lucky, 10**-2.5, "force_calls") == pytest.approx(10**3.5)
    assert compare.cost_at(curve("a", [None, 1e-9, 1e-10]), 1e-2, "force_calls") == 100


def test_frontier_keeps_what_nothing_beats():
    settings = [*curve("a", [1e-1, 1e-2, 1e-3]), *curve("b", [1e-1, 1e-5, 1e-4], calls=2), *curve("c", [None, None])]
    kept = [(s["integrator"], s["steps"]) for s in compare.frontier(settings, "force_calls")]
    assert kept == [("a", 10), ("a", 100), ("b", 100)]


def test_another_winner_is_named():
    settings = [*curve("exact_drift", [1e-2, 1e-3, 1e-4]), *curve("rk4", [1e0, 1e-8], calls=4)]
    rows = {row["error"]: row for row in compare.cheapest(settings, "force_calls")}
    assert rows[1e-2]["integrator"] == "exact_drift" and rows[1e-4]["integrator"] == "rk4"
    told = compare.others_win(list(rows.values()))
    assert any(line.startswith("error 1e-04: rk4 (double) wins, exact_drift costs") for line in told)
    assert any("does not reach it" in line for line in told)
    assert not any("1e-02" in line for line in told)


def test_claim_on_the_damped_contact_looks_at_one_call_schemes_only():
    settings = [*curve("exact_drift", [1e-2, 1e-4, 1e-6]), *curve("scovel", [1e-2, 1e-3, 1e-4]), *curve("rk4", [1e-9], 4)]
    [claim] = compare.claims("damped_contact", settings, "force_calls")
    assert claim["holds"] and claim["worst"]["rival"] == "scovel"
    better = [*settings, *curve("lobatto", [1e-2, 1e-5, 1e-6])]
    [claim] = compare.claims("damped_contact", better, "force_calls")
    assert not claim["holds"] and claim["worst"]["rival"] == "lobatto" and claim["worst"]["ratio"] > 1.1


def test_claims_on_the_free_grain():
    settings = [*curve("exact_drift", [1e-15, 1e-14]), *curve("rk4", [1e0, 1e-8], 4), *curve("scovel", [1e0, 1e-1])]
    only, cheaper = compare.claims("free_grain", settings, "force_calls")
    assert only["holds"] and only["exact"] == ["exact_drift"]
    assert cheaper["rival"] == "rk4" and cheaper["ratio"] == pytest.approx(4 * 10**0.5) and cheaper["holds"]
    only, _ = compare.claims("free_grain", [*settings, *curve("lobatto", [1e-14, 1e-14])], "force_calls")
    assert not only["holds"]


# --- problems --------------------------------------------------------------------------------------------------------


def test_free_grain_in_closed_form_is_what_the_default_scheme_gives():
    problem = PROBLEMS["free_grain"]
    figures, _ = measure.follow(problem, Setting("exact_drift", "double", 10), copies=3)
    assert figures.shape == (1, 3, 2)
    np.testing.assert_allclose(figures, problem.exact(3), rtol=0, atol=1e-13)


def test_copies_of_the_damped_contact_are_the_same_problem_and_touch_throughout():
    problem = PROBLEMS["damped_contact"]
    sim = problem.simulation(Setting("exact_drift", "double", 256), copies=3)
    depth = []
    for _ in range(64):
        sim.step(4)
        contacts = sim.contacts()
        assert len(contacts.i) == 3, "a pair has come apart, or copies touch"
        depth.append(contacts.overlap[0] / problem.overlap)
        slip = np.linalg.norm(contacts.force - (contacts.force * contacts.normal).sum(1)[:, None] * contacts.normal, axis=1)
        assert np.all(slip < 0.45 * np.linalg.norm(contacts.force, axis=1)), "it must not reach the Coulomb limit"
    assert np.ptp(depth) > 0.1, "the overlap must swing"
    figures = problem.figures(sim)
    np.testing.assert_allclose(figures, np.tile(figures[0], (3, 1)), rtol=0, atol=1e-9)


def test_impacts_start_apart_and_are_over_at_the_end():
    problem = PROBLEMS["oblique_impact"]
    sim = problem.simulation(Setting("exact_drift", "double", 512), copies=34)
    assert len(sim.contacts().i) == 0
    sim.step(512)
    assert len(sim.contacts().i) == 0
    assert sim.extremes["wall_approach_speed"] > 0.9
    assert np.all(problem.figures(sim)[:, 2] > 0), "all grains have bounced"


@pytest.mark.slow
def test_grain_on_the_turning_disk_draws_the_circle_of_rolling():
    """2/7 of the rate of the disk, about the centre at speed/(2/7 rate) beside the start, wherever on the disk."""
    problem = PROBLEMS["turning_disk"]
    sim = problem.simulation(Setting("exact_drift", "double", 2000), copies=5)
    start = problem.figures(sim)
    sim.step(2000)
    angle = 2.0 / 7.0 * problem.rate * problem.duration
    way = np.array([np.sin(angle), 1.0 - np.cos(angle)])
    np.testing.assert_allclose(problem.figures(sim) - start, np.tile(way, (5, 1)), rtol=0, atol=0.02)


def test_figures_of_the_bed_are_those_of_its_contacts():
    problem = PROBLEMS["bed"]
    sim = problem.simulation(Setting("exact_drift", "double", 10_000), copies=60)
    sim.step(10_000)
    height, energy, coordination, force = problem.figures(sim)[0]
    assert 0 < height < 0.01 and energy > 0 and coordination > 1
    weight = 9.81 * sim.particles.mass.sum()
    assert 0.2 * weight < force < 3 * weight


# --- a tiny run ------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_report_of_a_tiny_run(tmp_path):
    report = measure.bench(
        PROBLEMS["free_grain"],
        copies=2,
        steps=[100, 316],
        integrators=["exact_drift", "velocity_verlet"],
        repeats=1,
        console=measure.Console(quiet=True),
    )
    assert json.loads(json.dumps(report)) == report
    assert report["cost"] == "seconds"
    assert all(s["seconds"] > 0 for s in report["settings"])
    assert [s["force_calls"] for s in report["settings"]] == [100, 316] * 2
    errors = [s["error"] for s in report["settings"]]
    assert max(errors[:2]) < 1e-12 and min(errors[2:]) > 1.0
    assert "mixed" in report["skipped"]
    assert report["claims"][0]["holds"]
    plot.plot(report, tmp_path / "p.png")
    assert (tmp_path / "p.png").read_bytes()[:4] == b"\x89PNG"


def test_a_run_that_breaks_down_is_kept_without_an_error(monkeypatch):
    """A step so long that grains pass into each other: the guards stop the run, the benchmark goes on."""
    problem = PROBLEMS["bed"]
    monkeypatch.setattr(type(problem), "error_copies", 60)
    setting = Setting("exact_drift", "double", 1000)
    result = measure.measure(problem, setting, np.ones((problem.samples, 1, 4)), copies=0, repeats=1)
    assert result["error"] is None and result["seconds"] is None and result["stopped"].startswith("stopped at t =")
    assert result["force_calls"] == 1000
