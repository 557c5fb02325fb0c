"""C++ for lanes of contacts from the Warp functions of one contact.

    vector - normal * wp.dot(vector, normal)      wp::sub(vector_, wp::mul(normal_, wp::dot(vector_, normal_)))
    a / real(2.0) if x < y else real(0.0)         ((x_ < y_) ? (a_ / f64(2.0)) : f64(0.0))

Everything that does not depend on a contact is evaluated now: ``wp.static``, names of the function's surroundings, loops over
a known range, an ``if`` on a known value. An ``if`` on data becomes assignments that only its lanes take part in. Functions of
a number that are no machine instruction (``wp.exp``) are called lane by lane.

Refused, with file and line (``NotStraight``): loops over data, ``while``, return before the end, arrays, structs, integers
that depend on data, indices that do, numbers without a type beside float64.
"""

import ast
from typing import Any, NamedTuple

import warp as wp
from warpdem.kernels.simd.lane_types import INLINE, LANE, Kind, kind, literal

ARITHMETIC = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}
COMPARISONS = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}
INSTRUCTIONS = {"sqrt": "__builtin_elementwise_sqrt", "abs": "__builtin_elementwise_abs"}
LANE_BY_LANE = frozenset(
    """acos acosh asin asinh atan atan2 atanh cbrt ceil cos cosh exp exp2 floor log log10 log2 mod nonzero pow rint round sign
    sin sinh step tan tanh trunc""".split()
)
"""Functions of Warp from numbers to a number of the same type, beside those that are an instruction."""


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


class Translator:
    """Warp functions and all that they call in C++, each once.

    ``text`` holds them as static members, to be put into a struct behind ``lane_types.declarations``.
    """

    def __init__(self, lanes: str = "LANES") -> None:
        """``lanes``: the number of lanes, in C++."""
        self.text = ""
        self._lanes = lanes
        self._functions: dict[Any, Function] = {}
        self._helpers: set[str] = set()
        self._count = 0

    def add(self, function: Any) -> Function:
        """Translate a Warp function, unless it has been.

        Raises:
            NotStraight: it, or one that it calls, cannot be translated.
        """
        if function not in self._functions:
            self._count += 1
            name = f"{getattr(getattr(function, 'func', None), '__name__', 'function')}_{self._count}"
            self._functions[function] = _Source(self, function, name).translated()
        return self._functions[function]

    def helper(self, name: str, text: str) -> str:
        """The name of a helper, which is added if it was not yet."""
        if name not in self._helpers:
            self._helpers.add(name)
            self.text += text
        return name

    def lane_by_lane(self, key: str, lane: str, count: int) -> str:
        """Name of a builtin of Warp applied to each lane of ``count`` arguments."""
        name, letters = f"each_{key}_{lane}", "abcd"[:count]
        arguments, lanes = (", ".join(form.format(a) for a in letters) for form in (f"{lane} {{}}", "{}[k]"))
        body = f"for (int k = 0; k < {self._lanes}; ++k) a[k] = wp::{key}({lanes}); return a;"
        return self.helper(name, f"        {INLINE} {lane} {name}({arguments}) {{ {body} }}\n")

    def extreme(self, key: str, lane: str) -> str:
        """Name of Warp's min or max: of two numbers one of which is none, the other."""
        name, relation = f"{key}_{lane}", {"min": "<=", "max": ">="}[key]
        body = f"return (a {relation} b) ? a : ((b == b) ? b : a);"
        return self.helper(name, f"        {INLINE} {lane} {name}({lane} a, {lane} b) {{ {body} }}\n")


class _Source:
    """One function in the making."""

    def __init__(self, translator: Translator, function: Any, name: str) -> None:
        adjoint = getattr(function, "adj", None)
        if not isinstance(function, wp.Function) or adjoint is None or function.native_snippet is not None:
            raise NotStraight(f"{getattr(function, 'key', function)} is no Warp function written in Python")
        self.translator, self.name = translator, name
        self.file, self.first_line = adjoint.filename, adjoint.fun_lineno
        self.tree: Any = ast.parse(adjoint.source).body[0]  # what Warp itself compiles
        func = function.func
        cells = zip(func.__code__.co_freevars, func.__closure__ or (), strict=True)
        self.outer = {**func.__globals__, **{name: cell.cell_contents for name, cell in cells}}
        self.local: dict[str, Value] = {}
        self.lines: list[str] = []
        self.declared: set[str] = set()
        self.taking_part: Value | None = None  # mask of the lanes that an ``if`` is about
        self.result: Any = None
        self.types = function.input_types

    def fail(self, node: Any, why: str) -> Any:
        line = self.first_line + node.lineno - 1
        raise NotStraight(f"{self.file}, line {line}: {why}: {ast.unparse(node).splitlines()[0]}")

    def translated(self) -> Function:
        arguments = []
        for argument in self.tree.args.args:
            made = kind(self.types.get(argument.arg)) or self.fail(
                self.tree, f"no lanes of the type of {argument.arg} in"
            )
            self.local[argument.arg] = Value(f"{argument.arg}_", made)
            arguments.append(made)
        if self.tree.args.vararg or self.tree.args.kwarg or self.tree.args.kwonlyargs or self.tree.args.defaults:
            self.fail(self.tree, "only plain arguments are translated")
        head = ", ".join(f"{made.text} {name}_" for made, name in zip(arguments, self.types, strict=True))
        self.block(self.tree.body)
        if self.result is None:
            self.fail(self.tree.body[-1], "no return at the end")
        of = self.result
        if isinstance(of, tuple) and not isinstance(of, Kind):
            members = " ".join(f"{made.text} r{k};" for k, made in enumerate(of))
            self.translator.text += f"        struct {self.name}_results {{ {members} }};\n"
        lines = "".join(f"            {line}\n" for line in self.lines)
        self.translator.text += f"        {INLINE} {self.type_of(of)} {self.name}({head}) {{\n{lines}        }}\n"
        return Function(self.name, tuple(arguments), of)

    def type_of(self, of: Any) -> str:
        return of.text if isinstance(of, Kind) else f"{self.name}_results"

    # --- statements ---------------------------------------------------------------------------------------------------

    def block(self, body: list[ast.stmt]) -> None:
        for statement in body:
            if self.result is not None:
                self.fail(statement, "behind a return")
            self.statement(statement)

    def statement(self, s: Any) -> None:
        match s:
            case ast.Pass() | ast.Expr(value=ast.Constant(value=str())):
                pass
            case ast.Assign(targets=[ast.Tuple(elts=targets)]):
                for target, value in zip(targets, self.several(s.value, len(targets)), strict=True):
                    self.assign(s, target, value)
            case ast.Assign(targets=[target]):
                self.assign(s, target, self.value(s.value))
            case ast.AugAssign(target=target, op=op):
                self.assign(s, target, self.arithmetic(s, op, self.value(target), self.value(s.value)))
            case ast.If():
                self.branch(s)
            case ast.For(target=ast.Name(id=name), iter=ast.Call(func=ast.Name(id="range"), args=bounds), orelse=[]):
                numbers = [self.whole(bound) for bound in bounds]
                if None in numbers:
                    self.fail(s.iter, "a loop whose length depends on data")
                for k in range(*numbers):
                    self.local[name] = Value("", None, k)
                    self.block(s.body)
            case ast.Return(value=ast.Tuple(elts=parts)) if self.taking_part is None:
                values = [self.lanes(part, self.value(part)) for part in parts]
                self.result = tuple(value.kind for value in values)
                self.lines.append(f"return {{{', '.join(value.text for value in values)}}};")
            case ast.Return(value=value) if value is not None and self.taking_part is None:
                found = self.value(value)
                if found.kind is not None and not isinstance(found.kind, Kind):  # the results of another function
                    made = self.temporary(found)
                    texts = ", ".join(f"{made.text}.r{k}" for k in range(len(found.kind)))
                    self.result = found.kind
                    self.lines.append(f"return {{{texts}}};")
                    return
                made = self.lanes(value, found)
                self.result = made.kind
                self.lines.append(f"return {made.text};")
            case ast.Return():
                self.fail(s, "a return before the end")
            case _:
                self.fail(s, "not straight-line")

    def several(self, e: ast.expr, count: int) -> list[Value]:
        """The values that are unpacked: of a tuple, or the results of a function."""
        if isinstance(e, ast.Tuple) and len(e.elts) == count:
            return [self.temporary(self.value(part)) for part in e.elts]
        value = self.value(e)
        if isinstance(value.kind, Kind) or value.kind is None or len(value.kind) != count:
            self.fail(e, f"not {count} results")
        made = self.temporary(value)
        return [Value(f"{made.text}.r{k}", part) for k, part in enumerate(value.kind)]

    def temporary(self, value: Value) -> Value:
        """The same value under a name."""
        if value.number is not None:
            return value
        name = f"t{len(self.lines)}"
        self.lines.append(f"const auto {name} = {value.text};")
        return Value(name, value.kind)

    def branch(self, s: ast.If) -> None:
        test = self.value(s.test)
        if test.number is not None:
            body = s.body if test.number else s.orelse
            if isinstance(s.test, ast.Compare):
                for one in body:
                    if isinstance(one, ast.Assign) and isinstance(one.value, ast.Constant):
                        self.refuse_bare(one, Value("", None, one.value.value))
            self.block(body)
            return
        before, mask = self.taking_part, self.temporary(self.mask(s.test, test))
        for body, side in ((s.body, mask), (s.orelse, Value(f"(~{mask.text})", mask.kind))):
            if body:
                self.taking_part = side if before is None else self.temporary(self.joined("&", before, side))
                self.block(body)
        self.taking_part = before

    def assign(self, s: ast.stmt, target: ast.expr, value: Value) -> None:
        match target:
            case ast.Name(id="_"):
                pass
            case ast.Name(id=name):
                self.assign_name(s, name, value)
            case ast.Subscript(value=ast.Name(id=name)) if name in self.declared:
                place = self.value(target)
                value = self.lanes(s, value, place.kind)
                if value.kind != place.kind:
                    self.fail(s, "another type than what is there")
                self.lines.append(f"{place.text} = {self.where(value, place).text};")
            case _:
                self.fail(s, "not straight-line")

    def refuse_bare(self, e: ast.AST, value: Value) -> None:
        """Refuse a number without a type that a comparison chooses: Warp keeps it in single precision."""
        if isinstance(value.number, float):
            self.fail(e, "a number without a type that a comparison chooses")

    def assign_name(self, s: ast.stmt, name: str, value: Value) -> None:
        old = self.local.get(name)
        if value.kind is not None and not isinstance(value.kind, Kind):
            self.fail(s, "several results under one name")
        if value.kind is None and old is not None and old.kind is None and self.taking_part is not None:
            self.fail(s, "a number without a type that depends on data")
        if value.number is not None and (self.taking_part is None or old is None):
            if self.taking_part is not None:
                self.fail(s, "a number without a type")
            self.local[name] = value
            return
        if old is not None and old.kind is not None:
            value = self.lanes(s, value, old.kind)
            if value.kind != old.kind:
                self.fail(s, f"another type than {name} had")
        new = Value(f"{name}_", value.kind)
        if old is not None and self.taking_part is not None:
            value = self.where(value, self.lanes(s, old, value.kind))
        known = name in self.declared
        self.lines.append(f"{'' if known else f'{self.type_of(value.kind)} '}{new.text} = {value.text};")
        self.declared.add(name)
        self.local[name] = new

    def where(self, value: Value, old: Value) -> Value:
        """``value`` in the lanes that take part, else what was there."""
        return value if self.taking_part is None else self.pick(self.taking_part, value, old)

    # --- what is known now --------------------------------------------------------------------------------------------

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

    # --- expressions --------------------------------------------------------------------------------------------------

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
        return Value(f"{self.translator.helper(name, text)}({as_name}, {a.text}, {b.text})", a.kind)

    def value(self, e: Any) -> Value:
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

    def choice(self, e: ast.AST, test: Value, first: Any, second: Any) -> Value:
        if test.number is not None:
            return first() if test.number else second()
        a, b = first(), second()
        wanted = a.kind or b.kind
        a, b = self.lanes(e, a, wanted), self.lanes(e, b, wanted)
        if a.kind != b.kind:
            self.fail(e, "two types")
        return self.pick(self.mask(e, test), a, b)

    def comparison(self, e: ast.AST, operator: str, a: Value, b: Value) -> Value:
        if a.number is not None and b.number is not None:
            x, y = a.number, b.number
            known = {"<": x < y, "<=": x <= y, ">": x > y, ">=": x >= y, "==": x == y, "!=": x != y}
            return Value("", None, known[operator])
        a, b = self.lanes(e, a, b.kind), self.lanes(e, b, a.kind)
        if a.kind != b.kind or not isinstance(a.kind, Kind) or a.kind.shape or a.kind.mask:
            self.fail(e, "not two numbers of one type")
        return Value(f"({a.text} {operator} {b.text})", Kind(a.kind.scalar, mask=True))

    def whole(self, e: ast.expr) -> int | None:
        """A whole number that is known now, else None."""
        try:
            number = self.value(e).number
        except NotStraight:
            return None
        return number if isinstance(number, int) else None

    def element(self, e: ast.AST, of: Value, place: ast.expr) -> Value:
        places = [self.whole(p) for p in (place.elts if isinstance(place, ast.Tuple) else [place])]
        if not isinstance(of.kind, Kind) or len(places) != len(of.kind.shape) or of.kind.mask:
            self.fail(e, "no element of a vector or a matrix")
        if not all(p is not None and 0 <= p < n for p, n in zip(places, of.kind.shape, strict=True)):
            self.fail(e, "an index that is not known beforehand")
        member = "c" if len(places) == 1 else "data"
        return Value(f"{of.text}.{member}" + "".join(f"[{p}]" for p in places), Kind(of.kind.scalar))

    def arithmetic(self, e: ast.AST, op: ast.operator, a: Value, b: Value) -> Value:
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

    # --- calls --------------------------------------------------------------------------------------------------------

    def call(self, e: ast.AST, called: Any, args: list[ast.expr]) -> Value:
        values = [self.value(a) for a in args]
        if isinstance(called, type):
            return self.constructed(e, called, values)
        if not isinstance(called, wp.Function):
            return self.fail(e, "no Warp function")
        if called.is_builtin():
            return self.builtin(e, called.key, values)
        function = self.translator.add(called)
        values = [self.lanes(e, v, k) for v, k in zip(values, function.arguments, strict=False)]
        if tuple(v.kind for v in values) != function.arguments:
            self.fail(e, "arguments of other types")
        return Value(f"{function.name}({', '.join(v.text for v in values)})", function.result)

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
                return Value(f"{self.translator.extreme(key, LANE[scalar])}({inside})", number)
            case ("clamp", 3, 0) if together:
                least, most = (self.translator.extreme(word, LANE[scalar]) for word in ("min", "max"))
                return Value(f"{least}({most}({texts[1]}, {texts[0]}), {texts[2]})", number)
            case (_, 1 | 2, 0) if key in LANE_BY_LANE and together:
                return Value(f"{self.translator.lane_by_lane(key, LANE[scalar], len(values))}({inside})", number)
        return self.fail(e, "not translated")
