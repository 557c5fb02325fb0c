"""A Warp function of numbers and vectors on many arguments, one by one and in lanes: the results must have the same bits."""

import numpy as np
import warp as wp
from warpdem.kernels import MODULE_OPTIONS
from warpdem.kernels.simd.lane_types import declarations, kind
from warpdem.kernels.simd.translate import Translator

NUMPY = {wp.float64: np.float64, wp.float32: np.float32}


def both_ways(function: wp.Function, arguments: dict, results: tuple, lanes: int) -> tuple[list, list]:
    """Results of ``function`` by Warp and in lanes.

    Args:
        function: a Warp function.
        arguments: by name, type of Warp and array of its values, one row per call; shape (n, ...).
        results: types of what it returns; a number, a vector.
        lanes: calls side by side; it divides n.

    Returns:
        Arrays of the results, one row per call, in both ways.
    """
    n = len(next(iter(arguments.values()))[1])
    assert n % lanes == 0
    translator = Translator()
    made = translator.add(function)
    given = {name: kind(of) for name, (of, _) in arguments.items()}
    text = declarations(lanes) + f"    struct law {{\n        enum {{ LANES = {lanes} }};\n{translator.text}    }};\n"
    each = f"    for (int lane = 0; lane < {lanes}; ++lane) "
    for name, of in given.items():
        text += f"    {of.text} {name}_;\n"
        for f in range(of.size):
            text += each + f"{_number(f'{name}_', of, f)}[lane] = {name}.data[(first + lane) * {of.size} + {f}];\n"
    text += f"    const auto o = law::{made.name}({', '.join(f'{name}_' for name in given)});\n"
    shapes = [kind(of) for of in results]
    for r, of in enumerate(shapes):
        value = f"o.r{r}" if len(results) > 1 else "o"
        for f in range(of.size):
            text += each + f"out{r}.data[(first + lane) * {of.size} + {f}] = {_number(value, of, f)}[lane];\n"
    names = [*given, *(f"out{r}" for r in range(len(results)))]
    arrays = [of for of, _ in arguments.values()] + list(results)
    kinds = [*given.values(), *shapes]
    space = {"wp": wp, "function": function, "text": text, "OPTIONS": MODULE_OPTIONS, "n_lanes": lanes}
    space |= {f"T{k}": of for k, of in enumerate(arrays)} | {f"S{k}": of.scalar for k, of in enumerate(kinds)}
    flat = ", ".join(f"{name}: wp.array(dtype=S{k})" for k, name in enumerate(names))
    whole = ", ".join(f"{name}: wp.array(dtype=T{k})" for k, name in enumerate(names))
    call = f"function({', '.join(f'{name}[i]' for name in given)})"
    unpacked = ", ".join(f"r{r}" for r in range(len(results)))
    stored = "\n".join(f"    out{r}[i] = r{r}" for r in range(len(results)))
    source = f"""
@wp.func_native(text)
def wide(first: int, {flat}): ...

@wp.kernel(enable_backward=False, module="unique", module_options=OPTIONS)
def by_lane({whole}):
    i = wp.tid()
    {unpacked} = {call}
{stored}

@wp.kernel(enable_backward=False, module="unique", module_options=OPTIONS)
def in_lanes({flat}):
    wide(wp.tid() * wp.static(n_lanes), {", ".join(names)})
"""
    _define(source, space)
    values = [
        np.ascontiguousarray(v, dtype=NUMPY[of.scalar])
        for (_, v), of in zip(arguments.values(), given.values(), strict=True)
    ]
    assert [v.size for v in values] == [n * of.size for of in given.values()]
    out = {}
    for way, size in (("by_lane", n), ("in_lanes", n // lanes)):
        flat_arrays = [
            wp.array(v.ravel(), dtype=of.scalar, device="cpu") for v, of in zip(values, given.values(), strict=True)
        ]
        flat_arrays += [wp.zeros(n * of.size, dtype=of.scalar, device="cpu") for of in shapes]
        passed = flat_arrays
        if way == "by_lane":
            passed = [
                wp.array(ptr=a.ptr, shape=n, dtype=of, device="cpu") for a, of in zip(flat_arrays, arrays, strict=True)
            ]
        wp.launch(space[way], size, passed, device="cpu")
        out[way] = [a.numpy().reshape(n, of.size) for a, of in zip(flat_arrays[len(given) :], shapes, strict=True)]
    return out["by_lane"], out["in_lanes"]


def bits(array: np.ndarray) -> np.ndarray:
    """The bits of numbers, as integers: so -0 is not 0."""
    return array.view(np.uint64 if array.dtype == np.float64 else np.uint32)


def assert_same_bits(function: wp.Function, arguments: dict, results: tuple, lanes: int) -> list:
    """Call ``both_ways`` and compare; return the results."""
    first, second = both_ways(function, arguments, results, lanes)
    for r, (a, b) in enumerate(zip(first, second, strict=True)):
        differ = bits(a) != bits(b)
        assert not differ.any(), (
            f"result {r}: {differ.sum(axis=0)} of {len(a)} differ, first {a[differ][0]!r} {b[differ][0]!r}"
        )
    return first


def _number(value: str, of, f: int) -> str:
    """Number ``f`` of a value in lanes."""
    if not of.shape:
        return value
    return f"{value}.c[{f}]" if len(of.shape) == 1 else f"{value}.data[{f // of.shape[1]}][{f % of.shape[1]}]"


def _define(source: str, space: dict) -> None:
    """Run source in a way that Warp finds it again."""
    import linecache

    name = f"<lanes {len(linecache.cache)}>"
    linecache.cache[name] = (len(source), None, source.splitlines(keepends=True), name)
    exec(compile(source, name, "exec"), space)
