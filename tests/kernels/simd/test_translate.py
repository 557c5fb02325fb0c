"""Warp functions in lanes: the bits of the functions themselves, and what is refused, where."""

import inspect

import numpy as np
import pytest
import warp as wp
from warpdem.kernels.simd.translate import Translator
from warpdem.kernels.simd.values import NotStraight, only_where_needed

from lane_probes import assert_same_bits

TYPES = {"double": (wp.float64, wp.vec3d, wp.mat33d), "single": (wp.float32, wp.vec3, wp.mat33)}
N = 4096
FACTOR, COUNT = 0.1, 3
HALF = wp.float64(0.5)


def numbers(n: int, width: int, seed: int) -> np.ndarray:
    """Numbers of all sizes and signs, zeros of both signs and equal ones among them."""
    rng = np.random.default_rng(seed)
    out = rng.normal(0, 1, (n, width)) * 10.0 ** rng.integers(-3, 4, (n, width))
    out[::7] = out[::7, :1]
    out[::11] = 0.0
    out[1::11] = -0.0
    return out if width > 1 else out[:, 0]


def build(real, vec3, mat33):
    """A function that uses all that can be translated."""

    @wp.func
    def parts(v: vec3, a: real):
        both = v * a + vec3(a, real(-0.0), -a)
        return both, wp.length(both), -v

    @wp.func
    def mixture(a: real, b: real, v: vec3, m: mat33):
        w = vec3()
        for k in range(3):
            w[k] = v[k] * real(wp.static(1.0 / 3.0)) + wp.exp(-wp.abs(a))
        w += v / (real(1.0) + b * b)
        w[COUNT - 1] -= real(FACTOR)
        turned, size, back = parts(w, b)
        s = wp.pow(wp.abs(a), real(0.3)) + wp.min(a, b) - wp.max(a, wp.sin(b)) + wp.dot(w, m * v)
        near = a < b and not (b < real(0.1))
        t = s if near or a == b else wp.where(a >= b, real(3.0), wp.sqrt(wp.abs(a)))
        if wp.static(COUNT > 2):
            t = t + wp.clamp(a, real(-1.0), b)
        else:
            t = real(0.0)
        if a > b:
            t = -t
            turned = wp.cross(turned, back)
            if a > real(1.0):
                w[0] = t
        elif b != real(2.0):
            size = size + wp.sign(a)
        p, q = b, a
        single = wp.float32(p) * wp.float32(q)
        if single > wp.float32(0.25):
            size += real(single)
        return w, turned if near else back, t - p * q, size * wp.length_sq(m * back), wp.transpose(m) / a

    return mixture


@pytest.mark.parametrize("lanes", [2, 4, 8])
@pytest.mark.parametrize("precision", TYPES)
def test_lanes_have_the_bits_of_warp(precision, lanes):
    real, vec3, mat33 = TYPES[precision]
    given = {
        "a": (real, numbers(N, 1, 1)),
        "b": (real, numbers(N, 1, 2)),
        "v": (vec3, numbers(N, 3, 3)),
        "m": (mat33, numbers(N, 9, 4)),
    }
    results = assert_same_bits(build(real, vec3, mat33), given, (vec3, vec3, real, real, mat33), lanes)
    for values in results:
        assert len(np.unique(values)) > N // 2


@wp.func
def both(a: wp.float64, b: wp.float64):
    return a * b, wp.min(a, wp.float64(wp.inf))


@wp.func
def wrapped(a: wp.float64, b: wp.float64):
    return both(a, b)


def test_results_of_another_function_and_infinity_pass_through():
    given = {"a": (wp.float64, numbers(N, 1, 1)), "b": (wp.float64, numbers(N, 1, 2))}
    product, least = assert_same_bits(wrapped, given, (wp.float64, wp.float64), 4)
    np.testing.assert_array_equal(least[:, 0], given["a"][1])
    np.testing.assert_array_equal(product[:, 0], given["a"][1] * given["b"][1])


@only_where_needed
@wp.func
def costly(needed: wp.float64, v: wp.vec3d) -> wp.vec3d:
    return v * wp.sin(needed)


@wp.func
def seldom(a: wp.float64, v: wp.vec3d) -> wp.vec3d:
    needed = a if a > wp.float64(900.0) else wp.float64(0.0)
    if needed > wp.float64(0.0):
        v = costly(needed, v)
    return v


def test_a_vector_that_few_lanes_need_and_an_argument_that_gets_another_value():
    given = {"a": (wp.float64, numbers(N, 1, 1)), "v": (wp.vec3d, numbers(N, 3, 2))}
    (found,) = assert_same_bits(seldom, given, (wp.vec3d,), 4)
    changed = (found != given["v"][1]).any(axis=1)
    assert 0 < changed.sum() < N // 4


@wp.func
def loops(x: wp.float64) -> wp.float64:
    y = x
    for _i in range(int(x)):
        y = y + wp.float64(1.0)
    return y


@wp.func
def waits(x: wp.float64) -> wp.float64:
    y = x
    while y > wp.float64(1.0):
        y = y * wp.float64(0.5)
    return y


@wp.func
def early(x: wp.float64) -> wp.float64:
    if x > wp.float64(0.0):
        return wp.float64(1.0)
    return x


@wp.func
def endless(x: wp.float64):
    pass


@wp.func
def bare(x: wp.float64) -> wp.float64:
    return x * 2.0


@wp.func
def array(x: wp.array(dtype=wp.float64)) -> wp.float64:
    return x[0]


@wp.func
def indexed(x: wp.vec3d, k: wp.float64) -> wp.float64:
    return x[int(k)]


@wp.func
def mixed(x: wp.float64, y: wp.float32) -> wp.float64:
    return x + y


@wp.func
def counts(x: wp.float64, n: wp.int32) -> wp.float64:
    return x * wp.float64(n)


@wp.func
def unknown(x: wp.vec3d) -> wp.float64:
    return wp.max(x)


@wp.func
def matrices(x: wp.mat33d) -> wp.mat33d:
    return x * x


@wp.func
def outside(x: wp.float64) -> wp.float64:
    return early(x)


@wp.func
def flagged(x: wp.float64) -> wp.float64:
    flag = 0.0
    if x > wp.float64(0.0):
        flag = 1.0
    return x * wp.float64(flag)


@wp.func
def chosen(x: wp.float64) -> wp.float64:
    return x * wp.float64(0.3 if COUNT > 2 else 0.1)


@wp.func
def switched(x: wp.float64) -> wp.float64:
    share = 0.1
    if COUNT > 2:
        share = 0.3
    return x * wp.float64(share)


@wp.func
def several(x: wp.float64) -> wp.float64:
    pair = both(x, x)  # noqa: F841
    return x


@wp.func_native("return x;")
def native(x: wp.float64) -> wp.float64: ...


REFUSED = {
    "loops": ("a loop whose length depends on data", "range(int(x))"),
    "waits": ("not straight-line", "while y"),
    "early": ("a return before the end", "return wp.float64(1.0)"),
    "endless": ("no return at the end", "pass"),
    "bare": ("a number without a type", "x * 2.0"),
    "array": ("no lanes of the type of x", "def array("),
    "indexed": ("an index that is not known beforehand", "x[int(k)]"),
    "mixed": ("operands", "x + y"),
    "counts": ("no lanes of the type of n", "def counts("),
    "unknown": ("not translated", "wp.max(x)"),
    "matrices": ("operands", "x * x"),
    "flagged": ("a number without a type that depends on data", "flag = 1.0"),
    "chosen": ("a number without a type that a comparison chooses", "0.3 if COUNT"),
    "switched": ("a number without a type that a comparison chooses", "share = 0.3"),
    "several": ("several results under one name", "pair = both"),
    "outside": ("a return before the end", "return wp.float64(1.0)"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_not_straight_is_refused_with_file_and_line(name):
    with pytest.raises(NotStraight) as error:
        Translator().add(globals()[name])
    why, code = REFUSED[name]
    where = early if name == "outside" else globals()[name]
    lines, first = inspect.getsourcelines(where.func)
    line = first + next(k for k, text in enumerate(lines) if code in text)
    assert str(error.value).startswith(f"{__file__}, line {line}: {why}")


def test_what_is_no_warp_function_in_python_is_refused():
    for thing in (native, wp.sqrt, inspect.getsource):
        with pytest.raises(NotStraight, match="is no Warp function written in Python"):
            Translator().add(thing)


def test_typed_constants_of_the_surroundings_and_each_function_once():
    @wp.func
    def twice(x: wp.float64) -> wp.float64:
        return x * HALF

    @wp.func
    def four(x: wp.float64) -> wp.float64:
        return twice(x) + twice(twice(x))

    translator = Translator()
    translator.add(four)
    translator.add(twice)
    assert translator.text.count("static inline") == 2
    assert "(x_ * f64(0x1.0000000000000p-1))" in translator.text
