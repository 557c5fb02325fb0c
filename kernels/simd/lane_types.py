"""C++ types whose numbers are registers of several lanes, and what the types of Warp become."""

from typing import Any, NamedTuple

import warp as wp

LANE = {wp.float64: "f64", wp.float32: "f32"}
"""Register of numbers."""
MASK = {wp.float64: "m64", wp.float32: "m32"}
"""Register that holds of each lane whether a comparison of such numbers is true."""
NUMBER = {wp.float64: "double", wp.float32: "float"}
"""A number of such a register."""
INLINE = "static inline __attribute__((always_inline))"
"""How helpers are declared: members of a local struct, so that they see nothing but their arguments."""


class Kind(NamedTuple):
    """Type of a value: of numbers ``scalar``, a scalar of shape (), a vector or a matrix; or a mask."""

    scalar: Any
    shape: tuple[int, ...] = ()
    mask: bool = False

    @property
    def text(self) -> str:
        """The C++ type."""
        if self.mask:
            return MASK[self.scalar]
        lane = LANE[self.scalar]
        name = {0: "", 1: "vec_t", 2: "mat_t"}[len(self.shape)]
        return f"wp::{name}<{', '.join(map(str, self.shape))}, {lane}>" if name else lane

    @property
    def size(self) -> int:
        """Numbers of a lane."""
        out = 1
        for length in self.shape:
            out *= length
        return out


def kind(warp_type: Any) -> Kind | None:
    """What a type of Warp becomes in lanes; None where there is nothing of the kind."""
    scalar = getattr(warp_type, "_wp_scalar_type_", warp_type)
    if not isinstance(scalar, type) or scalar not in LANE:
        return None
    return Kind(scalar, tuple(getattr(warp_type, "_shape_", ())))


def literal(value: float, scalar: Any) -> str:
    """A number in all lanes; hexadecimal, so that no digit is lost."""
    number = float(value)
    if number != number:
        text = '__builtin_nan("")'
    elif number in (float("inf"), float("-inf")):
        text = f"{'-' if number < 0.0 else ''}__builtin_inf()"
    else:
        text = f"{number.hex()}{'f' if scalar is wp.float32 else ''}"
    return f"{LANE[scalar]}({text})"


def declarations(lanes: int) -> str:
    """The types, for ``lanes`` lanes, a power of two."""
    return f"""
    typedef double f64 __attribute__((ext_vector_type({lanes})));
    typedef float f32 __attribute__((ext_vector_type({lanes})));
    typedef decltype(f64(0.0) < f64(0.0)) m64;
    typedef decltype(f32(0.0f) < f32(0.0f)) m32;
"""
