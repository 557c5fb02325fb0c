import json
import math
import re
import subprocess
import sys
from typing import Annotated

import numpy as np
import pytest
from pydantic import BaseModel

from warpdem.scene.units import DIMENSIONS, Array, Quantity, Vector, to_si


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("0.45 mm", "m", 0.00045),
        ("1e-3m", "m", 0.001),
        ("2 µm", "m", 2e-6),
        ("20 ms", "s", 0.02),
        ("50 Hz", "1/s", 50.0),
        ("20 cm/s", "m/s", 0.2),
        ("9.81 m/s2", "m/s2", 9.81),
        ("9.81 m/s²", "m/s2", 9.81),
        ("2.6 g/cm^3", "kg/m3", 2600.0),
        ("2650 kg/m3", "kg/m3", 2650.0),
        (" 50 MPa ", "Pa", 5e7),
        ("5 N/mm", "N/m", 5000.0),
        ("90 deg", "rad", math.pi / 2),
        ("-90°", "rad", -math.pi / 2),
        ("30 rpm", "rad/s", math.pi),
        ("2 turn/s", "rad/s", 4 * math.pi),
        ("3.5 rad/s", "rad/s", 3.5),
        ("5 %", "-", 0.05),
    ],
)
def test_string_with_unit_gives_the_bits_of_the_si_number(text, unit, value):
    assert to_si(text, unit) == value


@pytest.mark.parametrize("value", [3, 3.0, np.float32(3), np.int64(3)])
def test_plain_number_is_si(value):
    result = to_si(value, "m")
    assert result == 3.0
    assert type(result) is float


@pytest.mark.parametrize("unit", DIMENSIONS)
def test_example_of_each_dimension_is_of_that_dimension_alone(unit):
    text = DIMENSIONS[unit].example
    assert math.isfinite(to_si(text, unit))
    for other, dimension in DIMENSIONS.items():
        if dimension.base == DIMENSIONS[unit].base:  # itself, or one such as J/m2 and N/m
            continue
        with pytest.raises(ValueError):
            to_si(text, other)


@pytest.mark.parametrize(
    ("value", "unit", "words"),
    [
        ("30 Hz", "rad/s", ["rpm", "rad/s", "Hz"]),
        ("30 1/s", "rad/s", ["rpm", "rad/s"]),
        ("30 rpm", "1/s", ["frequency", "rpm"]),
        ("30 rpm", "s", ["time", "[s]", "20 ms", "rpm"]),
        ("3 kg", "m", ["length", "[m]", "0.45 mm", '"kg" is not']),
        ("0.5 rad", "-", ["pure number"]),
        ("5 %", "rad", ["angle"]),
        ("3 furlongz", "m", ["furlongz", "no known unit"]),
        ("3", "m", ["without quotes"]),
        ("mm", "m", ["length"]),
        ("7/8 mm", "m", ["length"]),
        ("1 m)(", "m", ["no known unit"]),
        ("1 m**0.5", "m", ["is not a length"]),
        ("10 degC", "m", ["no known unit"]),
        ("1e400 m", "m", ["finite"]),
        ("", "m", ["length"]),
        (True, "m", ["length"]),
        (np.bool_(True), "m", ["length"]),
        (math.nan, "m", ["finite"]),
        (-math.inf, "s", ["finite", "time"]),
        (10**400, "m", ["finite"]),
        (None, "m", ["length"]),
        ([1], "m", ["length"]),
    ],
)
def test_wrong_number_is_refused_in_words(value, unit, words):
    with pytest.raises(ValueError) as error:
        to_si(value, unit)
    for word in words:
        assert word in str(error.value)


def test_pint_is_loaded_for_a_string_only():
    code = (
        "import sys, warpdem.scene.units as u; u.to_si(1.0, 'm'); assert 'pint' not in sys.modules;"
        "u.to_si('1 m', 'm'); assert 'pint' in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize(
    ("quantity", "inside", "outside"),
    [
        (Quantity("m", gt=0), 1e-9, 0),
        (Quantity("m", ge=0), 0, -1e-9),
        (Quantity("-", lt=1), 0.999, 1),
        (Quantity("-", gt=-1, le=0.5), 0.5, 0.51),
    ],
)
def test_range_is_kept_and_named(quantity, inside, outside):
    assert quantity.validate(inside) == inside
    with pytest.raises(ValueError) as error:
        quantity.validate(outside)
    assert quantity.range_text() in str(error.value)


def test_auto_is_a_value_only_where_declared():
    assert Quantity("s", auto=True).validate("auto") == "auto"
    assert Quantity("s", auto=True).validate("1 ms") == 0.001
    with pytest.raises(ValueError, match='or "auto"'):
        Quantity("s", auto=True).validate("atuo")
    with pytest.raises(ValueError):
        Quantity("s").validate("auto")


def make_model(annotation):
    return type("Model", (BaseModel,), {"__annotations__": {"x": annotation}})


def test_vector_takes_lists_arrays_and_units():
    model = make_model(Annotated[tuple[float, float, float], Vector(Quantity("m"))])
    assert model(x=[1, "2 mm", 3.0]).x == (1.0, 0.002, 3.0)
    assert model(x=np.array([1, 2, 3])).x == (1.0, 2.0, 3.0)
    for wrong in ([1, 2], [1, 2, 3, 4], "123", 1.0, [1, 2, True], [1, 2, "3 s"]):
        with pytest.raises(ValueError):
            model(x=wrong)


@pytest.mark.parametrize(
    ("item", "length", "example"),
    [(Quantity("-"), 3, "[0, 0, 1]"), (Quantity("m"), 3, '[0, 0, "0.45 mm"]'), (Quantity("rad/s"), 2, '[0, "30 rpm"]')],
)
def test_wrong_vector_is_told_one_that_would_do(item, length, example):
    model = make_model(Annotated[tuple, Vector(item, length=length)])
    with pytest.raises(ValueError, match=f"must be a list of {length} .*, such as {re.escape(example)}"):
        model(x="y")
    assert len(model(x=json.loads(example)).x) == length


@pytest.mark.parametrize(
    "value",
    [[[1, 2, 3], [0, "4 mm", 5.0]], np.array([[1, 2, 3], [0, 0.004, 5.0]]), [np.array([1, 2, 3]), (0, 0.004, 5)]],
)
def test_array_takes_lists_arrays_and_units(value):
    array = Array(Quantity("m"), columns=3).validate(value)
    np.testing.assert_array_equal(array, [[1, 2, 3], [0, 0.004, 5]])
    assert array.dtype == np.float64
    assert not array.flags.writeable


def test_array_is_a_copy():
    given = np.ones((2, 3))
    array = Array(Quantity("m"), columns=3).validate(given)
    given[0, 0] = 7.0
    assert array[0, 0] == 1.0


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ([], "rows of 3"),
        ([[1, 2]], "row [0]"),
        ([[1, 2, 3], 4], "row [1]"),
        (np.zeros((2, 2)), "rows of 3"),
        (np.zeros(3), "rows of 3"),
        (np.array([[True, False, True]]), "[0][0]"),
        ([[1, 2, 3], [1, True, 3]], "[1][1]"),
        ([[1, 2, 3], [1, 2, "3 s"]], "[1][2]"),
        ([[1, 2, 3], [1, math.nan, 3]], "[1][1] = nan: must be finite"),
        (np.array([[1, 2, np.inf]]), "[0][2]"),
        ([[1, 2, 10**400]], "too large"),
        ("abc", "rows of 3"),
    ],
)
def test_wrong_array_is_refused_with_its_entry(value, words):
    with pytest.raises(ValueError) as error:
        Array(Quantity("m"), columns=3).validate(value)
    assert words in str(error.value)


def test_array_keeps_its_range():
    with pytest.raises(ValueError, match=r"\[1\] = -1: must be finite and > 0"):
        Array(Quantity("m", gt=0)).validate([1.0, -1.0])
