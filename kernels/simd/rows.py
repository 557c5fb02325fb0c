"""Numbers that lie in rows of memory, one row per contact, to registers that hold one column of all lanes, and back.

A row is read ``lanes`` numbers at a time; ``lanes`` of such parts are a square that is transposed in registers. That takes a
few shuffles; a gather of each column would take an instruction per number. Of rows half as long two go into one register.
"""

from collections.abc import Sequence
from typing import Any

from warpdem.kernels.simd.lane_types import INLINE, LANE, NUMBER


def starts(width: int, lanes: int, first: int = 0) -> list[int]:
    """Where the parts of ``lanes`` columns begin that hold the columns ``first`` to ``width``; the last may overlap another."""
    return [min(at, width - lanes) for at in range(first, width, lanes)]


def _transposed(lane: str, lanes: int, registers: int) -> str:
    """Statements that transpose each square of ``registers`` columns that the registers ``r`` hold side by side."""
    steps, block = "", 1
    while block < registers:  # blocks of 1, 2, 4 ... numbers change places across the diagonal
        upper = [k if not k & block else lanes + (k ^ block) for k in range(lanes)]
        lower = [k | block if not k & block else lanes + k for k in range(lanes)]
        for i in (i for i in range(registers) if not i & block):
            a, b = f"r[{i}]", f"r[{i | block}]"
            new = [f"__builtin_shufflevector({a}, {b}, {', '.join(map(str, order))})" for order in (upper, lower)]
            steps += f"            {{ {lane} a = {new[0]}, b = {new[1]}; {a} = a; {b} = b; }}\n"
        block *= 2
    return steps


def helpers(scalar: Any, lanes: int) -> str:
    """Members of the local struct that ``read``, ``gathered`` and ``write`` call for numbers ``scalar``."""
    lane, number, half = LANE[scalar], NUMBER[scalar], lanes // 2
    parts, size = "", lanes
    while size > 1:
        vector = f"__attribute__((ext_vector_type({size}), aligned(sizeof({number}))))"
        parts += f"        typedef {number} {lane}_part{size} {vector};\n"
        size //= 2
    whole, part = f"{lane}_part{lanes}", f"*(const {lane}_part{half}*)"
    order = ", ".join(map(str, range(lanes)))
    both = f"__builtin_shufflevector({part}a, {part}b, {order})" if half > 1 else f"{lane}{{*a, *b}}"
    return f"""{parts}        {INLINE} void transpose({lane}* r) {{
{_transposed(lane, lanes, lanes)}        }}
        {INLINE} {lane} load(const {number}* from) {{ {lane} out = *(const {whole}*)from; return out; }}
        {INLINE} void store({number}* to, {lane} value) {{ *({whole}*)to = value; }}
        {INLINE} void read(const {number}* rows, int width, const wp::int32* index, {lane}* out) {{
            {lane} r[{lanes}];
            for (int k = 0; k < {lanes}; ++k) r[k] = load(rows + (long long)index[k] * width);
            transpose(r);
            for (int k = 0; k < {lanes}; ++k) out[k] = r[k];
        }}
        {INLINE} void read_sum(
            const {number}* rows, int width, const wp::int32* index, const wp::int32* other, {lane}* out
        ) {{
            {lane} r[{lanes}];
            for (int k = 0; k < {lanes}; ++k)
                r[k] = load(rows + (long long)index[k] * width) + load(rows + (long long)other[k] * width);
            transpose(r);
            for (int k = 0; k < {lanes}; ++k) out[k] = r[k];
        }}
        {INLINE} {lane} join(const {number}* a, const {number}* b) {{ return {both}; }}
        {INLINE} void read_half(const {number}* rows, int width, const wp::int32* index, {lane}* out) {{
            {lane} r[{half}];
            for (int k = 0; k < {half}; ++k)
                r[k] = join(rows + (long long)index[k] * width, rows + (long long)index[k + {half}] * width);
{_transposed(lane, lanes, half)}\
            for (int k = 0; k < {half}; ++k) out[k] = r[k];
        }}
"""


def gathered(name: str, kind: type, address: str, index: str, lanes: int) -> str:
    """Statements that read the vector ``name`` of each lane from row ``index`` of the array at ``address``."""
    width = kind._length_
    text = f"        wp::vec_t<{width}, f64> {name};\n"
    if 2 * width == lanes:
        return f"{text}        batch::read_half({address}, {width}, {index}, {name}.c);\n"
    if width < lanes:
        each = f"for (int f = 0; f < {width}; ++f) {name}.c[f][k] = ({address})[(long long){index}[k] * {width} + f];"
        return f"{text}        for (int k = 0; k < {lanes}; ++k) {each}\n"
    parts = starts(width, lanes)
    return text + "".join(
        f"        batch::read({address} + {at}, {width}, {index}, {name}.c + {at});\n" for at in parts
    )


def same(name: str, kind: type, address: str) -> str:
    """Statements that give every lane of the vector ``name`` the numbers at ``address``."""
    width = kind._length_
    return f"    wp::vec_t<{width}, f64> {name};\n    for (int f = 0; f < {width}; ++f) {name}.c[f] = ({address})[f];\n"


def write(scalar: Any, lanes: int, struct: str, rows: Sequence[tuple[str, Sequence[str]]]) -> str:
    """Statements that write registers to rows.

    Args:
        scalar: type of the numbers.
        lanes: how many lanes.
        struct: name of the local struct with ``helpers``.
        rows: of each row of a lane the address of its first number, as an expression in the lane ``k``, and its numbers, as
            expressions of a register. Rows follow each other in the squares that are transposed.
    """
    lane = LANE[scalar]
    placed = [(address, n, value) for address, values in rows for n, value in enumerate(values)]
    text = ""
    for first in range(0, len(placed), lanes):
        square = placed[first : first + lanes]
        values = [value for _, _, value in square] + [f"{lane}(0)"] * (lanes - len(square))
        text += f"        {{\n            {lane} r[{lanes}] = {{{', '.join(values)}}};\n            {struct}::transpose(r);\n"
        text += f"            for (int k = 0; k < {lanes}; ++k) {{\n"
        at = 0
        while at < len(square):
            address, column, _ = square[at]
            together = sum(1 for other, *_ in square[at:] if other == address)
            count = 1 << (together.bit_length() - 1)  # powers of two
            if count == 1:
                text += f"                {address}[{column}] = r[k][{at}];\n"
            else:
                picked = ", ".join(str(at + n) for n in range(count))
                part = "r[k]" if count == lanes else f"__builtin_shufflevector(r[k], r[k], {picked})"
                text += f"                *({struct}::{lane}_part{count}*)({address} + {column}) = {part};\n"
            at += count
        text += "            }\n        }\n"
    return text
