"""Statements of a Warp function to C++: assignments, loops over a known range, branches on data as masks."""

import ast
from typing import Any

import warp as wp
from warpdem.kernels.simd.expressions import Expressions
from warpdem.kernels.simd.lane_types import INLINE, Kind, kind
from warpdem.kernels.simd.values import Function, Members, NotStraight, Value


class Source(Expressions):
    """One function in the making."""

    def __init__(self, members: Members, function: Any, name: str) -> None:
        adjoint = getattr(function, "adj", None)
        if not isinstance(function, wp.Function) or adjoint is None or function.native_snippet is not None:
            raise NotStraight(f"{getattr(function, 'key', function)} is no Warp function written in Python")
        self.members, self.name, self.function = members, name, function
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

    def translated(self) -> Function:
        """Translate it; its text is added to the members."""
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
            self.members.put(f"        struct {self.name}_results {{ {members} }};\n")
        if getattr(self.function, "only_where_needed", False):
            asked = f"{self.tree.args.args[0].arg}_ != {arguments[0].text}(0)"
            self.lines.insert(0, f"if (!__builtin_reduce_or({asked})) return {{}};")
        lines = "".join(f"            {line}\n" for line in self.lines)
        self.members.put(f"        {INLINE} {self.type_of(of)} {self.name}({head}) {{\n{lines}        }}\n")
        return Function(self.name, tuple(arguments), of)

    def type_of(self, of: Any) -> str:
        """The C++ type of a result."""
        return of.text if isinstance(of, Kind) else f"{self.name}_results"

    def block(self, body: list[ast.stmt]) -> None:
        """Translate statements one after the other."""
        for statement in body:
            if self.result is not None:
                self.fail(statement, "behind a return")
            self.statement(statement)

    def statement(self, s: Any) -> None:
        """Translate one statement."""
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

    def branch(self, s: ast.If) -> None:
        """An ``if``: of a value that is known now one side, else both, each in its lanes."""
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
        """Assign to a name or to an element of one."""
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

    def assign_name(self, s: ast.stmt, name: str, value: Value) -> None:
        """Assign to a name, in the lanes that take part; a number that is known now stays known."""
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
        known = name in self.declared or name in self.types  # or an argument
        self.lines.append(f"{'' if known else f'{self.type_of(value.kind)} '}{new.text} = {value.text};")
        self.declared.add(name)
        self.local[name] = new

    def where(self, value: Value, old: Value) -> Value:
        """``value`` in the lanes that take part, else what was there."""
        return value if self.taking_part is None else self.pick(self.taking_part, value, old)
