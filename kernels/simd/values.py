"""Values of a function that is translated: expressions in C++ with their types, and how they are put together by a mask."""

import ast
from typing import Any, NamedTuple, Protocol

import warp as wp
from warpdem.kernels.simd.lane_types import INLINE, LANE, Kind, literal


def only_where_needed(function: Any) -> Any:
    """Mark a Warp function whose first argument, a number, says by 0 in which lanes nobody asks for its result.

    A register all of whose lanes say so gets zeros in its place: for what is costly and seldom needed.
    """
    function.only_where_needed = True
    return function


def in_lanes(function: Any, real: Any, text: str) -> None:
    """Give a native Warp function of numbers ``real`` to a number its C++ in lanes, where arguments are ``name_``."""
    function.in_lanes = real, text


class NotStraight(ValueError):
    """A function is not straight-line; the message says where."""


class Value(NamedTuple):
    """An expression in C++ and its type; or a number that is known now and has no type yet."""

    text: str
    kind: Any  # Kind; a tuple of them for the results of a function
    number: int | float | None = None


class Function(NamedTuple):
    """A function that is translated."""

    name: str
    arguments: tuple[Kind, ...]
    result: Any


class Members(Protocol):
    """The members of the struct that functions are put in: the functions, and helpers that they call."""

    def add(self, function: Any) -> Function:
        """The function in lanes, translated unless it has been."""

    def put(self, text: str) -> None:
        """Add the text of a member."""

    def helper(self, name: str, text: str) -> str:
        """The name of a helper, which is added if it was not yet."""

    def lane_by_lane(self, key: str, lane: str, count: int) -> str:
        """Name of a builtin of Warp applied to each lane of ``count`` arguments."""

    def extreme(self, key: str, lane: str) -> str:
        """Name of Warp's min or max in lanes."""


class Values:
    """Values of one function, which name the place in its source where something cannot be translated.

    Attributes:
        members: what the function may call.
        file, first_line: where the function stands.
        lines: its statements so far, in C++.
    """

    members: Members
    file: str
    first_line: int
    lines: list[str]

    def fail(self, node: Any, why: str) -> Any:
        """Refuse what cannot be translated.

        Raises:
            NotStraight: with file, line and the code there.
        """
        line = self.first_line + node.lineno - 1
        raise NotStraight(f"{self.file}, line {line}: {why}: {ast.unparse(node).splitlines()[0]}")

    def temporary(self, value: Value) -> Value:
        """The same value under a name."""
        if value.number is not None:
            return value
        name = f"t{len(self.lines)}"
        self.lines.append(f"const auto {name} = {value.text};")
        return Value(name, value.kind)

    def lanes(self, e: ast.AST, value: Value, wanted: Any = None) -> Value:
        """The value in lanes; a number without a type is a float32."""
        if value.number is None:
            return value
        single = Kind(wp.float32)
        if not isinstance(value.number, float) or wanted not in (None, single):
            self.fail(e, "a number without a type")
        return Value(literal(value.number, wp.float32), single)

    def mask(self, e: ast.AST, value: Value) -> Value:
        """The value, which must be the outcome of a comparison."""
        if value.number is not None or not isinstance(value.kind, Kind) or not value.kind.mask:
            self.fail(e, "no comparison of numbers")
        return value

    def joined(self, operator: str, a: Value, b: Value) -> Value:
        """``a & b`` or ``a | b`` of two masks."""
        return Value(f"({a.text} {operator} {self.as_wide(b, a.kind.scalar)})", a.kind)

    @staticmethod
    def as_wide(mask: Value, scalar: Any) -> str:
        """A mask for lanes of another number."""
        same = mask.kind.scalar is scalar
        return mask.text if same else f"__builtin_convertvector({mask.text}, {Kind(scalar, mask=True).text})"

    def pick(self, mask: Value, a: Value, b: Value) -> Value:
        """``a`` in the lanes of the mask, ``b`` in the others."""
        test = as_name = self.as_wide(mask, a.kind.scalar)
        if not a.kind.shape:
            return Value(f"({test} ? {a.text} : {b.text})", a.kind)
        name = f"pick_{LANE[a.kind.scalar]}_{'_'.join(map(str, a.kind.shape))}"
        member = {1: "c[k]", 2: "data[k / {0}][k % {0}]".format(a.kind.shape[-1])}[len(a.kind.shape)]
        body = f"for (int k = 0; k < {a.kind.size}; ++k) a.{member} = test ? a.{member} : b.{member}; return a;"
        of, lanes = Kind(a.kind.scalar, mask=True).text, a.kind.text
        text = f"        {INLINE} {lanes} {name}({of} test, {lanes} a, {lanes} b) {{ {body} }}\n"
        return Value(f"{self.members.helper(name, text)}({as_name}, {a.text}, {b.text})", a.kind)
