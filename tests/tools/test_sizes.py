"""The benchmark of broad sizes on tiny beds made here."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from bench import sizes
from bench.states import Settings


def test_sizes_have_equal_shares_of_the_volume():
    diameter = sizes.diameters(40_000, ratio=10.0, sizes=3)
    found, count = np.unique(diameter, return_counts=True)
    assert (len(diameter), len(found)) == (40_000, 3)
    np.testing.assert_allclose(found[-1], 10.0 * found[0])
    np.testing.assert_allclose(count * found**3 / (diameter**3).sum(), 1.0 / 3.0, rtol=0, atol=0.01)


def test_a_bed_holds_at_least_one_grain_of_each_size():
    _, count = np.unique(sizes.diameters(500, ratio=10.0, sizes=3), return_counts=True)
    assert count[-1] == 1 and count.sum() == 500


def test_beds_up_to_the_uniform_ratio_are_uniform_by_number():
    diameter = sizes.diameters(4000, sizes.UNIFORM, sizes=3)
    assert len(np.unique(diameter)) == 4000
    np.testing.assert_allclose(diameter.mean(), 1.5 * sizes.SMALLEST, rtol=0.01)


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    settings = Settings(skin="auto", warm=1, steps=4, repeats=2)
    return sizes.bench(
        grains=300, ratios=[2.0, 4.0], sizes=2, threads=1, settings=settings, settle=10, work=tmp_path_factory.mktemp("work")
    )


@pytest.mark.slow
def test_bench_reports_every_bed(report, capsys):
    assert json.loads(json.dumps(report)) == report
    first, second = report["cases"]
    assert (first["ratio"], second["ratio"]) == (2.0, 4.0)
    for case in report["cases"]:
        assert case["grains"] == 300
        assert len(case["ns_per_grain_step"]["all"]) == 2
        assert case["fill_seconds"] > 0.0
    least = [case["ns_per_grain_step"]["min"] for case in report["cases"]]
    np.testing.assert_allclose([first["over_first"], second["over_first"]], [1.0, least[1] / least[0]])
    sizes.print_report(report, sizes.Console(width=110))
    assert "300 grains, 1 threads" in capsys.readouterr().out


def test_times_are_per_grain_and_step_and_per_grain_and_list(tmp_path):
    """Two windows of 100 steps of 2 grains: 4 ms with one rebuild of 0.4 ms and no refresh, 2 ms without a rebuild."""
    file = tmp_path / "two.npz"
    np.savez(file, x=np.zeros((2, 3)), r=np.ones(2), v=np.zeros((2, 3)), w=np.zeros((2, 3)))
    common = {"contacts_per_grain": 3.0, "refreshes": 0}
    windows = [
        SimpleNamespace(seconds=4e-3, rebuilds=1, shares={"lists": 0.1, "refresh": 0.0}, **common),
        SimpleNamespace(seconds=2e-3, rebuilds=0, shares={"lists": 0.0, "refresh": 0.0}, **common),
    ]
    found = sizes.measured(sizes.Bed(1.0, sizes.Start("two", file, width=1.0), None), windows, steps=100)
    np.testing.assert_allclose(found["ns_per_grain_step"]["all"], [20e3, 10e3])
    np.testing.assert_allclose([found["rebuilds_per_1000_steps"], found["rebuild_ns"]], [5.0, 200e3])
    assert found["refresh_ns"] is None
