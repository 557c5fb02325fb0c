"""Expressions of a Warp function to values: what is known now is evaluated, the rest becomes C++."""

import ast
from typing import Any

import warp as wp
from warpdem.kernels.simd.lane_types import LANE, Kind, literal
from warpdem.kernels.simd.operations import COMPARISONS, Operations
from warpdem.kernels.simd.values import NotStraight, Value


class Expressions(Operations):
    """Expressions of one function.

    Attributes:
        local: its variables.
        outer: names of its surroundings.
    """

    local: dict[str, Value]
    outer: dict[str, Any]

    def known(self, e: ast.expr) -> Any:
        """What a name, an attribute or ``wp.static`` stands for outside of the function; None if it is a value within."""
        match e:
            case ast.Name(id=name) if name not in self.local:
                return self.outer.get(name, getattr(wp, name, None))
            case ast.Attribute(value=value, attr=attr):
                return getattr(self.known(value), attr, None)
            case ast.Call(func=func, args=[inner]) if self.known(func) is wp.static:
                numbers = {name: value.number for name, value in self.local.items() if value.number is not None}
                return eval(compile(ast.Expression(inner), self.file, "eval"), self.outer | numbers)
        return None

    def value(self, e: Any) -> Value:
        """The value of an expression."""
        match e:
            case ast.Constant(value=bool() | int() | float() as number):
                return Value("", None, number)
            case ast.Name(id=name) if name in self.local:
                return self.local[name]
            case ast.BinOp(op=op):
                return self.arithmetic(e, op, self.value(e.left), self.value(e.right))
            case ast.UnaryOp(op=ast.USub()):
                value = self.value(e.operand)
                if value.number is not None:
                    return Value("", None, -value.number)
                return Value(f"wp::neg({value.text})", value.kind)  # of a number 0 - x: the sign of a zero is Warp's
            case ast.UnaryOp(op=ast.Not()):
                value = self.value(e.operand)
                if value.number is not None:
                    return Value("", None, not value.number)
                return Value(f"(~{self.mask(e, value).text})", value.kind)
            case ast.IfExp():
                chosen = self.choice(e, self.value(e.test), lambda: self.value(e.body), lambda: self.value(e.orelse))
                if isinstance(e.test, ast.Compare):
                    self.refuse_bare(e, chosen)
                return chosen
            case ast.Compare(ops=[op], comparators=[right]) if type(op) in COMPARISONS:
                return self.comparison(e, COMPARISONS[type(op)], self.value(e.left), self.value(right))
            case ast.BoolOp(op=op, values=parts):
                first, *others = (self.value(part) for part in parts)
                if all(part.number is not None for part in (first, *others)):
                    numbers = [bool(part.number) for part in (first, *others)]
                    return Value("", None, all(numbers) if isinstance(op, ast.And) else any(numbers))
                for other in others:
                    first = self.joined(
                        "&" if isinstance(op, ast.And) else "|", self.mask(e, first), self.mask(e, other)
                    )
                return first
            case ast.Subscript(value=value, slice=place):
                return self.element(e, self.value(value), place)
            case ast.Call(func=func, args=args, keywords=[]) if (called := self.known(func)) is not wp.static:
                return self.call(e, called, args)
        known = self.known(e)
        if isinstance(known, bool | int | float):
            return Value("", None, known)
        if type(known) in LANE:
            return Value(literal(known.value, type(known)), Kind(type(known)))
        return self.fail(e, "not straight-line")

    def refuse_bare(self, e: ast.AST, value: Value) -> None:
        """Refuse a number without a type that a comparison chooses: Warp keeps it in single precision."""
        if isinstance(value.number, float):
            self.fail(e, "a number without a type that a comparison chooses")

    def whole(self, e: ast.expr) -> int | None:
        """A whole number that is known now, else None."""
        try:
            number = self.value(e).number
        except NotStraight:
            return None
        return number if isinstance(number, int) else None

    def element(self, e: ast.AST, of: Value, place: ast.expr) -> Value:
        """An element of a vector or a matrix, at an index that is known now."""
        places = [self.whole(p) for p in (place.elts if isinstance(place, ast.Tuple) else [place])]
        if not isinstance(of.kind, Kind) or len(places) != len(of.kind.shape) or of.kind.mask:
            self.fail(e, "no element of a vector or a matrix")
        if not all(p is not None and 0 <= p < n for p, n in zip(places, of.kind.shape, strict=True)):
            self.fail(e, "an index that is not known beforehand")
        member = "c" if len(places) == 1 else "data"
        return Value(f"{of.text}.{member}" + "".join(f"[{p}]" for p in places), Kind(of.kind.scalar))

    def call(self, e: ast.AST, called: Any, args: list[ast.expr]) -> Value:
        """A number, vector or mask of a type of Warp, or what a function gives."""
        values = [self.value(a) for a in args]
        if isinstance(called, type):
            return self.constructed(e, called, values)
        if not isinstance(called, wp.Function):
            return self.fail(e, "no Warp function")
        if called.is_builtin():
            return self.builtin(e, called.key, values)
        function = self.members.add(called)
        values = [self.lanes(e, v, k) for v, k in zip(values, function.arguments, strict=False)]
        if tuple(v.kind for v in values) != function.arguments:
            self.fail(e, "arguments of other types")
        return Value(f"{function.name}({', '.join(v.text for v in values)})", function.result)
