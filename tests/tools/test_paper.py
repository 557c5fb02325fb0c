"""The figures of the paper, in short: errors, orders, determinants against formulas; both frames; statistics; the tool."""

import json
import math

import numpy as np
import pytest

import warpdem
from paper import disk, figures, hourglass, one_grain, threads
from paper.common import SCENES, SCHEMES

HARMONIC, DAMPED, ROTATING = one_grain.PROBLEMS
W, L = one_grain.OMEGA, one_grain.LAMBDA


@pytest.fixture(scope="module")
def recorded():
    """The numbers that lie beside the pictures."""
    return json.loads((SCENES / "figures.json").read_text())


@pytest.mark.parametrize("path", sorted(SCENES.glob("*.toml")), ids=lambda path: path.stem)
def test_scene_loads_and_says_what_must_come_out(path):
    assert warpdem.load_scene(path).title
    head = path.read_text().split("title =")[0]
    assert "Shown:" in head and "Must come out" in head


# --- figures 4, 5, 8 -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("scheme", one_grain.REFERENCE)
def test_errors_of_the_rotating_grain_are_those_of_an_independent_program(scheme):
    for k, step in enumerate(one_grain.DECADES[:3]):
        reference = one_grain.REFERENCE[scheme][k]
        if reference > 1e-10:
            assert one_grain.error(ROTATING, scheme, step) == pytest.approx(reference, rel=0.01), step


@pytest.mark.parametrize("step", one_grain.DECADES[:3])
def test_exact_drift_is_exact_on_the_rotating_grain(step):
    assert one_grain.error(ROTATING, "exact_drift", step) < 1e-12


@pytest.mark.parametrize("problem", [HARMONIC, pytest.param(DAMPED, marks=pytest.mark.slow)], ids=lambda problem: problem.name)
def test_oscillators_show_their_orders(problem):
    for scheme, order in problem.orders.items():
        coarse = 2e-3 if scheme == "rk4" else 2e-4
        errors = [one_grain.error(problem, scheme, step) for step in (coarse, coarse / 2.0)]
        assert math.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.1), scheme


def test_slope_is_fitted_where_the_scheme_has_one():
    steps = np.array(one_grain.STEPS)
    assert one_grain.slope(steps, 3.0 * steps**2, "rk2") == pytest.approx(2.0)
    assert one_grain.slope(steps, np.where(steps < 1e-4, 1e-9, steps**4), "rk4") == pytest.approx(4.0, abs=1e-6)
    assert one_grain.slope(steps, np.full(len(steps), 1e-14), "exact_drift") is None


# --- figure 2: eqs. 52, 92-94 ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("problem", "scheme", "first", "later"),
    [
        (HARMONIC, "explicit_euler", 1.16, 1.16),  # 1 + (w h)^2
        (HARMONIC, "velocity_verlet", 1.0, 1.0),
        (DAMPED, "velocity_verlet", (1 - L * 1e-2) ** 2, 1 - 2 * L * 1e-2),
        (ROTATING, "rk2", (1 + 0.4**4 / 4) ** 2, (1 + 0.4**4 / 4) ** 2),
        # 1 + (w h)^2 each for A_1 and A_3; 1 + (2 w h)^2 for the kick from v^(k-1/2) to v^(k+1/2)
        (ROTATING, "velocity_verlet", 1.16**2, 1 + 4 * 0.16),
        (ROTATING, "scovel", 1.0, 1.0),
        (ROTATING, "exact_drift", 1.0, 1.0),
    ],
    ids=lambda value: getattr(value, "name", value),
)
def test_determinant_of_a_step(problem, scheme, first, later):
    np.testing.assert_allclose(one_grain.volumes(problem, scheme, 1e-2), (first, later), rtol=1e-11)


def test_volume_of_the_damped_oscillator_shrinks_as_it_must():
    """Exact drift: v* leaves an error of third order in one step."""
    off = [one_grain.volumes(DAMPED, "exact_drift", h)[1] - DAMPED.volume(h) for h in (2e-3, 1e-3)]
    assert math.log2(off[0] / off[1]) == pytest.approx(3.0, abs=0.2)


# --- figures 3, 6, 7 -------------------------------------------------------------------------------------------------


def test_energies_of_the_oscillator_follow_their_formulas():
    x = (one_grain.ENERGY_OMEGA * one_grain.ENERGY_STEP) ** 2
    time, energy = one_grain.energies("explicit_euler", 20.0)
    np.testing.assert_allclose(energy, (1.0 + x) ** np.round(time / one_grain.ENERGY_STEP), rtol=1e-11)
    time, energy = one_grain.energies("velocity_verlet", 20.0)
    phase = 2.0 * math.asin(math.sqrt(x) / 2.0) * np.round(time / one_grain.ENERGY_STEP)
    np.testing.assert_allclose(energy, 1.0 - x / 4.0 * np.sin(phase) ** 2, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("scheme", "radius", "energy"), [("velocity_verlet", 3.2954, 1.04), ("scovel", 0.998934, 2.8e-9)]
)
def test_path_and_energy_of_the_rotating_grain(scheme, radius, energy):
    time, places, energies = one_grain.path_and_energy(scheme, 1e-4)
    assert time[-1] == pytest.approx(1.0)
    assert np.linalg.norm(places[-1]) == pytest.approx(radius, rel=1e-4)
    assert energies[-1] == pytest.approx(energy, rel=0.02)


# --- figure 9 --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("case", disk.CASES)
def test_disk_in_both_frames(case):
    time, there = disk.path(case, "exact_drift", 2e-5, True, 0.05)
    _, here = disk.path(case, "exact_drift", 2e-5, False, 0.05)
    assert np.abs(there - here).max() < 1e-6 * disk.RADIUS
    if case == "rolling":  # a circle at 2/7 of the rate of the disk, to the share of the overlap and the slip at the start
        rate = 2.0 / 7.0 * disk.RATE
        circle = 0.2 / rate * np.stack([np.sin(rate * time), 1.0 - np.cos(rate * time)], axis=1) + [0.05, 0.0]
        np.testing.assert_allclose(there[:, :2], circle, rtol=0, atol=0.01 * 0.2 * time[-1])
    # seen from the disk, a grain at rest in the laboratory turns backwards
    turned = disk.in_frame(np.array([0.01, math.pi / 40.0]), np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 2.0]]))
    np.testing.assert_allclose(turned, [[math.cos(0.2), -math.sin(0.2), 0.0], [1.0, 0.0, 2.0]], rtol=0, atol=1e-15)


# --- figures 10 to 13, 15 --------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def small():
    """Size of a hourglass of 30 grains that falls for an instant, and its start."""
    size = hourglass.Size(twins=2, count=30, rest=0.01)
    return size, hourglass.settled(hourglass.glass(size), SCENES, 0.002)


@pytest.mark.slow
def test_hourglass_runs_alike_in_both_settings(small):
    size, start = small
    rpm = 1500.0  # half a turn in 20 ms
    found = {s: [hourglass.run(size, rpm, s, start, twin) for twin in range(2)] for s in hourglass.SETTINGS}
    frame, laboratory = found["frame"][0], found["laboratory"][0]
    apart = np.abs(frame.places[1] - laboratory.places[1]).max()  # after 10 ms, a quarter turn
    assert 0.0 < apart < 1e-5, "the nudges differ, and chaos has hardly begun"
    assert np.abs(frame.places[1] - start["positions"]).max() > 1e-3, "the glass has moved its grains"
    numbers = hourglass.summary(size, rpm, found)
    assert numbers["grains"] == 30 and len(numbers["time_s"]) == len(numbers["share_passed"]["frame"]["mean"])


@pytest.mark.slow
def test_mass_counts_in_the_axes_of_the_glass(small):
    """Turned by half a turn at once, grains that stay where they are in the laboratory are in the other bulb."""
    size, start = small
    for setting in hourglass.SETTINGS:
        sim = hourglass.simulation(size, 120.0, setting, {**start, "velocities": 0.0 * start["velocities"]}, 0)
        assert hourglass.share_passed(sim) == 0.0
        mirrored = {**start, "positions": start["positions"] * [1.0, 1.0, -1.0]}
        assert hourglass.share_passed(hourglass.simulation(size, 120.0, setting, mirrored, 0)) == 1.0


def test_standardised_rms():
    first, second = np.array([[0.0, 1.0, 5.0], [0.0, 3.0, 7.0]]), np.array([[0.0, 4.0, 6.0], [0.0, 6.0, 8.0]])
    # means 2 and 5, 6 and 7; each variance 2, so that the error is sqrt(2/2 + 2/2); the first instant does not count
    assert hourglass.standardised_rms(first, second) == pytest.approx(math.sqrt((9.0 + 1.0) / 2.0 / 2.0))
    assert hourglass.standardised_rms(first[:, :1], second[:, :1]) == 0.0
    assert hourglass.standardised_rms(first[:, :1], second[:, :1] + 1.0) == math.inf


def test_time_of_a_share_is_interpolated():
    time, passed = np.array([0.0, 1.0, 2.0, 3.0]), np.array([0.0, 0.2, 0.6, 0.5])
    assert hourglass.time_of(0.5, time, passed) == pytest.approx(1.75)
    assert math.isnan(hourglass.time_of(0.7, time, passed)), "it never has"
    assert math.isnan(hourglass.time_of(0.1, time, passed + 0.5)), "it had before the start"


def test_paper_size_is_the_papers():
    scene = hourglass.glass(hourglass.Size(paper=True))
    assert scene["grains"][0]["fill"]["count"] == 160_000 and scene["time"]["step"] == 1e-6
    assert scene["walls"][0] == {"name": "glass", "material": "grain", "mesh": "../meshes/hourglass_paper.stl", "scale": 0.001}


def test_windows_of_both_settings_start_at_the_angle(tmp_path):
    windows = threads.Windows(warm=0, steps=1, repeats=1, count=20, settle=1e-4)
    saved = threads.checkpoints(windows, tmp_path, angles=(0.5,))
    frame, laboratory = (warpdem.Simulation.from_checkpoint(saved[0.5, s], threads=1) for s in hourglass.SETTINGS)
    assert frame.time == laboratory.time > 0.0
    assert math.degrees(frame.schedule.pose(frame.time).angle) == pytest.approx(0.5, abs=0.01)
    np.testing.assert_allclose(frame.particles.position_lab, laboratory.particles.position_lab, rtol=0, atol=1e-9)
    assert laboratory.scene.frame is None


# --- the tool and what it has recorded -------------------------------------------------------------------------------


@pytest.mark.slow
def test_tool_writes_a_picture_and_adds_its_numbers(tmp_path):
    (tmp_path / "figures.json").write_text('{"figure 8": {"old": 1}}')
    figures.main(["--figure", "3", "--quick", "--out", str(tmp_path)])
    entries = json.loads((tmp_path / "figures.json").read_text())
    assert list(entries) == ["figure 3", "figure 8"] and entries["figure 8"] == {"old": 1}
    assert entries["figure 3"]["quick"] is True
    assert (tmp_path / "figure_03.png").stat().st_size < 120_000


def test_tool_refuses_one_twin_and_unknown_figures(capsys):
    for arguments, words in ((["--twins", "1"], "at least 2"), (["--figure", "14"], "invalid choice: 14")):
        with pytest.raises(SystemExit):
            figures.main(arguments)
        assert words in capsys.readouterr().err


def test_recorded_orders_are_those_expected(recorded):
    for problem in one_grain.PROBLEMS:
        entry = recorded[f"figure {problem.figure}"]
        assert not entry["quick"]
        for scheme in SCHEMES:
            found = entry["schemes"][scheme]
            if scheme in problem.orders:
                assert found["slope"] == pytest.approx(problem.orders[scheme], abs=0.1), (problem.name, scheme)
            else:
                assert found["slope"] is None and max(found["errors_m"]) < 1e-12


def test_recorded_hourglass_is_the_same_in_both_frames(recorded):
    for figure in ("figure 10, 12", "figure 11, 13"):
        entry = recorded[figure]
        assert entry["twins"] == 8 and not entry["quick"]
        assert entry["standardised_rms"] <= 2.5
        assert entry["largest_overlap_share"] < 0.02
        for share in entry["times_passed_s"].values():
            assert abs(share["difference_in_standard_errors"]) <= 3.0
