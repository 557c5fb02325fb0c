"""Operations on values in lanes: arithmetic, comparisons, choices, elements, Warp's types and builtin functions."""

import ast
from typing import Any

import warp as wp
from warpdem.kernels.simd.lane_types import LANE, Kind, kind, literal
from warpdem.kernels.simd.values import Value, Values

ARITHMETIC = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}
COMPARISONS = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}
INSTRUCTIONS = {"sqrt": "__builtin_elementwise_sqrt", "abs": "__builtin_elementwise_abs"}
LANE_BY_LANE = frozenset(
    """acos acosh asin asinh atan atan2 atanh cbrt ceil cos cosh exp exp2 floor log log10 log2 mod nonzero pow rint round sign
    sin sinh step tan tanh trunc""".split()
)
"""Functions of Warp from numbers to a number of the same type, beside those that are an instruction."""


class Operations(Values):
    """What is made of values, each operation as Warp's own templates have it."""

    def choice(self, e: ast.AST, test: Value, first: Any, second: Any) -> Value:
        """``first`` where the test is true, ``second`` elsewhere; where the test is known now, only that one is translated."""
        if test.number is not None:
            return first() if test.number else second()
        a, b = first(), second()
        wanted = a.kind or b.kind
        a, b = self.lanes(e, a, wanted), self.lanes(e, b, wanted)
        if a.kind != b.kind:
            self.fail(e, "two types")
        return self.pick(self.mask(e, test), a, b)

    def comparison(self, e: ast.AST, operator: str, a: Value, b: Value) -> Value:
        """A mask, or the outcome where both are known now."""
        if a.number is not None and b.number is not None:
            x, y = a.number, b.number
            known = {"<": x < y, "<=": x <= y, ">": x > y, ">=": x >= y, "==": x == y, "!=": x != y}
            return Value("", None, known[operator])
        a, b = self.lanes(e, a, b.kind), self.lanes(e, b, a.kind)
        if a.kind != b.kind or not isinstance(a.kind, Kind) or a.kind.shape or a.kind.mask:
            self.fail(e, "not two numbers of one type")
        return Value(f"({a.text} {operator} {b.text})", Kind(a.kind.scalar, mask=True))

    def arithmetic(self, e: ast.AST, op: ast.operator, a: Value, b: Value) -> Value:
        """Sum, difference, product or quotient."""
        operator = ARITHMETIC.get(type(op)) or self.fail(e, "operator")
        if a.number is not None and b.number is not None:
            if not (isinstance(a.number, int) and isinstance(b.number, int)) or operator == "/":
                self.fail(e, "a number without a type")
            return Value(
                "", None, {"+": a.number + b.number, "-": a.number - b.number, "*": a.number * b.number}[operator]
            )
        a, b = self.lanes(e, a, b.kind), self.lanes(e, b, a.kind)
        made = self.made_of(operator, a.kind, b.kind) or self.fail(e, "operands")
        if not a.kind.shape and not b.kind.shape:
            return Value(f"({a.text} {operator} {b.text})", made)
        word = {"+": "add", "-": "sub", "*": "mul", "/": "div"}[operator]
        return Value(f"wp::{word}({a.text}, {b.text})", made)

    @staticmethod
    def made_of(operator: str, a: Any, b: Any) -> Kind | None:
        """Type of a sum, product or quotient; None where there is none."""
        if not all(isinstance(k, Kind) and not k.mask for k in (a, b)) or a.scalar is not b.scalar:
            return None
        x, y = a.shape, b.shape
        if operator in "+-":
            return a if x == y else None
        if not y:
            return a
        if operator == "/":
            return None
        if not x:
            return b
        if len(x) + len(y) != 3 or x[-1] != y[0]:  # of two matrices Warp makes fused products, of numbers only
            return None
        return Kind(a.scalar, (x[0],) if len(x) == 2 else (y[1],))

    def constructed(self, e: ast.AST, called: type, values: list[Value]) -> Value:
        """A number of another type, or a vector of numbers."""
        made = kind(called) or self.fail(e, "no lanes of this type")
        scalar = made.scalar
        if not made.shape:
            if len(values) == 1 and values[0].number is not None:
                return Value(literal(values[0].number, scalar), made)
            if len(values) == 1 and values[0].kind in (Kind(wp.float64), Kind(wp.float32)):
                same = values[0].kind == made
                return Value(
                    values[0].text if same else f"__builtin_convertvector({values[0].text}, {made.text})", made
                )
            return self.fail(e, "no number")
        numbers = [self.lanes(e, v, Kind(scalar)) for v in values]
        if any(v.kind != Kind(scalar) for v in numbers) or len(numbers) not in (0, 1, made.size):
            self.fail(e, "not made of numbers of its type")
        if len(numbers) < 2:
            return Value(f"{made.text}({''.join(v.text for v in numbers)})", made)
        inside = ", ".join(v.text for v in numbers)
        return Value(f"{made.text}(wp::initializer_array<{made.size}, {LANE[scalar]}>{{{{{inside}}}}})", made)

    def builtin(self, e: ast.AST, key: str, values: list[Value]) -> Value:
        """A builtin function of Warp."""
        if key == "where" and len(values) == 3:
            return self.choice(e, values[0], lambda: values[1], lambda: values[2])
        first = next((v.kind for v in values if v.kind is not None), None)
        values = [self.lanes(e, v, first) for v in values]
        kinds, texts = [v.kind for v in values], [v.text for v in values]
        if not values or any(not isinstance(k, Kind) or k.mask or k.scalar is not kinds[0].scalar for k in kinds):
            self.fail(e, "arguments")
        scalar, shape, together, inside = (
            kinds[0].scalar,
            kinds[0].shape,
            all(k == kinds[0] for k in kinds),
            ", ".join(texts),
        )
        number = Kind(scalar)
        match key, len(values), len(shape):
            case ("dot", 2, 1) if together:
                return Value(f"wp::dot({inside})", number)
            case ("cross", 2, 1) if together and shape == (3,):
                return Value(f"wp::cross({inside})", kinds[0])
            case ("cw_mul" | "cw_div", 2, 1) if together:
                return Value(f"wp::{key}({inside})", kinds[0])
            case ("length_sq", 1, 1):
                return Value(f"wp::length_sq({inside})", number)
            case ("length", 1, 1):
                return Value(f"{INSTRUCTIONS['sqrt']}(wp::length_sq({inside}))", number)
            case ("transpose", 1, 2):
                return Value(f"wp::transpose({inside})", Kind(scalar, shape[::-1]))
            case ("sqrt" | "abs", 1, 0):
                return Value(f"{INSTRUCTIONS[key]}({inside})", number)
            case ("min" | "max", 2, 0) if together:
                return Value(f"{self.members.extreme(key, LANE[scalar])}({inside})", number)
            case ("clamp", 3, 0) if together:
                least, most = (self.members.extreme(word, LANE[scalar]) for word in ("min", "max"))
                return Value(f"{least}({most}({texts[1]}, {texts[0]}), {texts[2]})", number)
            case (_, 1 | 2, 0) if key in LANE_BY_LANE and together:
                return Value(f"{self.members.lane_by_lane(key, LANE[scalar], len(values))}({inside})", number)
        return self.fail(e, "not translated")
