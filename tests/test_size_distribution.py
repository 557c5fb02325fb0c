"""Size distributions against their exact cumulatives."""

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError
from scipy import integrate, stats

from warpdem.scene.size_distribution import Diameter, DiameterDistribution, size_law

SPREAD = {"mean": 3.0, "deviation": 1.0, "min": 1.0, "max": 6.0}


def normal(d):
    return np.exp(-0.5 * ((d - 3.0) / 1.0) ** 2)


def lognormal(d):
    square = np.log(1.0 + 1.0 / 9.0)
    return stats.lognorm.pdf(d, np.sqrt(square), scale=3.0 * np.exp(-0.5 * square))


def sieve(d):
    return np.where(d < 2.0, 0.2, 0.8 / 3.0)


CONTINUOUS = {
    "uniform": ({"uniform": [1.0, 6.0]}, np.ones_like),
    "normal": ({"normal": SPREAD}, normal),
    "lognormal": ({"lognormal": SPREAD}, lognormal),
    "cumulative": ({"cumulative": [[1.0, 0.0], [2.0, 20.0], [5.0, 100.0], [6.0, 100.0]]}, lambda d: sieve(d) * (d < 5.0)),
}


@pytest.mark.parametrize("by", ["number", "mass"])
@pytest.mark.parametrize("kind", CONTINUOUS)
def test_law_is_the_exact_cumulative_by_number(kind, by):
    keys, density = CONTINUOUS[kind]
    law = size_law(DiameterDistribution(**keys, by=by))
    d = np.linspace(1.0, 6.0, 50_001)
    number = density(d) / (d**3 if by == "mass" else 1.0)
    exact = integrate.cumulative_simpson(number, x=d, initial=0.0)
    # the corner of the sieve curve lies between two points of the exact integral
    tolerance = 1e-4 if kind == "cumulative" else 1e-5
    np.testing.assert_allclose(np.interp(d, law.diameter, law.share), exact / exact[-1], rtol=0, atol=tolerance)
    for value, power, scale in ((law.mean_diameter, 1, 1.0), (law.mean_volume, 3, np.pi / 6.0)):
        moment = scale * integrate.simpson(number * d**power, x=d) / exact[-1]
        np.testing.assert_allclose(value, moment, rtol=1e-4)


@pytest.mark.parametrize("by", ["number", "mass"])
@pytest.mark.parametrize("kind", CONTINUOUS)
def test_draws_follow_the_distribution(kind, by):
    keys, density = CONTINUOUS[kind]
    drawn = size_law(DiameterDistribution(**keys, by=by)).draw(np.random.default_rng(1), 20_000)
    d = np.linspace(1.0, 6.0, 5001)
    exact = integrate.cumulative_simpson(density(d) / (d**3 if by == "mass" else 1.0), x=d, initial=0.0)
    assert stats.kstest(drawn, lambda x: np.interp(x, d, exact / exact[-1])).pvalue > 1e-3
    assert 1.0 <= drawn.min() < drawn.max() <= 6.0
    # the other way of counting is another distribution
    other = density(d) / (d**3 if by == "number" else 1.0)
    wrong = integrate.cumulative_simpson(other, x=d, initial=0.0)
    assert stats.kstest(drawn, lambda x: np.interp(x, d, wrong / wrong[-1])).pvalue < 1e-6


def test_lognormal_has_the_mean_and_deviation_asked_for():
    spread = {"mean": 3.0, "deviation": 1.0, "min": 0.1, "max": 90.0}
    drawn = size_law(DiameterDistribution(lognormal=spread)).draw(np.random.default_rng(0), 400_000)
    assert abs(drawn.mean() - 3.0) < 4.0 / np.sqrt(400_000)
    assert abs(drawn.std() - 1.0) < 0.01


@pytest.mark.parametrize("by", ["number", "mass"])
def test_table_gives_its_diameters_in_its_shares(by):
    law = size_law(DiameterDistribution(table=[[2.0, 30], [1.0, 10], [4.0, 0], [3.0, 60]], by=by))
    drawn = law.draw(np.random.default_rng(2), 100_000)
    diameter, count = np.unique(drawn, return_counts=True)
    np.testing.assert_array_equal(diameter, [1.0, 2.0, 3.0])
    share = count * (diameter**3 if by == "mass" else 1.0)
    np.testing.assert_allclose(share / share.sum(), [0.1, 0.3, 0.6], rtol=0.05)
    np.testing.assert_allclose(law.mean_volume, np.pi / 6.0 * (drawn**3).mean(), rtol=0.02)
    assert law.extremes == (1.0, 4.0)


def test_one_diameter_for_all():
    law = size_law(0.003)
    np.testing.assert_array_equal(law.draw(np.random.default_rng(0), 5), 0.003)
    np.testing.assert_allclose([law.mean_diameter, law.mean_volume], [0.003, np.pi / 6.0 * 0.003**3])


@pytest.mark.parametrize("keys", [{"normal": {**SPREAD, "max": 1.0}}, {"uniform": [1.0, 1.0], "by": "mass"}])
def test_cut_offs_that_leave_one_diameter(keys):
    np.testing.assert_array_equal(size_law(DiameterDistribution(**keys)).draw(np.random.default_rng(0), 4), 1.0)


def test_same_generator_same_bits_and_a_longer_draw_begins_alike():
    law = size_law(DiameterDistribution(normal=SPREAD, by="mass"))
    one, two, other = (law.draw(np.random.default_rng(seed), count) for seed, count in ((3, 50), (3, 80), (4, 50)))
    assert one.tobytes() == two[:50].tobytes()
    assert (one != other).all()


def test_volume_is_met_within_half_a_grain():
    law = size_law(DiameterDistribution(uniform=[1.0, 6.0], by="mass"))
    for seed in range(20):
        diameter = law.draw_volume(np.random.default_rng(seed), 5e4)
        one_more = law.draw(np.random.default_rng(seed), len(diameter) + 1)
        np.testing.assert_array_equal(diameter, one_more[:-1])
        assert abs(np.pi / 6.0 * (diameter**3).sum() - 5e4) <= 0.5 * np.pi / 6.0 * max(one_more[-2:]) ** 3
    assert len(size_law(1.0).draw_volume(np.random.default_rng(0), 0.2)) == 0
    assert len(size_law(1.0).draw_volume(np.random.default_rng(0), 0.3)) == 1


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"uniform": [2, 1]}, "first diameter must not be above the second"),
        ({"uniform": [0, 1]}, "> 0"),
        ({}, "exactly one of uniform, normal, lognormal, table, cumulative; found none"),
        ({"uniform": [1, 2], "table": [[1, 1]]}, "found uniform and table"),
        ({"normal": {**SPREAD, "min": 7.0}}, "not be below min = 7 m"),
        ({"normal": {**SPREAD, "deviation": 0.01, "min": 4.0}}, "only 0 of the distribution lies between min and max"),
        ({"lognormal": {**SPREAD, "deviation": 0}}, "> 0"),
        ({"table": [[1, 0], [2, 0]]}, "fractions must not all be 0"),
        ({"table": [[1, -1], [2, 3]]}, ">= 0"),
        ({"cumulative": [[1, 0], [1, 1]]}, "diameters must increase"),
        ({"cumulative": [[1, 0], [2, 2], [3, 1]]}, "fractions not decrease"),
        ({"cumulative": [[1, 0.1], [2, 1]]}, "must start at 0"),
        ({"uniform": [1, 2], "by": "volume"}, "'number' or 'mass'"),
    ],
)
def test_senseless_distribution_is_refused(keys, message):
    with pytest.raises(ValidationError, match=message):
        DiameterDistribution(**keys)


def test_numbers_and_distributions_with_units_in_a_scene():
    read = TypeAdapter(Diameter).validate_python
    assert read("2 mm") == 0.002
    table = read({"table": [["1 mm", "20 %"], [0.002, 0.8]], "by": "mass"})
    assert table.table == [(0.001, 0.2), (0.002, 0.8)]
    assert TypeAdapter(Diameter).validate_json(TypeAdapter(Diameter).dump_json(table)) == table
