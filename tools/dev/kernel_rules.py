"""Check the rules of ``kernels/`` that neither Warp nor ruff knows: ``python tools/dev/kernel_rules.py``.

no ``from __future__ import annotations``     the types that a factory captures would be lost
``enable_backward`` off for every kernel      the adjoint would be compiled for nothing
``module="unique"`` for nested kernels        two variants of one factory would meet in one module
no bare float where a factory has ``real``    ``2.0 * x`` compiles for one precision only; allowed: ``real(2.0)``,
                                              ``wp.float64(2.0)``, ``wp.static(2.0)``
one literal in a cast                         ``wp.float64(1.0 / 6.0)`` is divided in float32 first; write
                                              ``wp.float64(1.0) / wp.float64(6.0)`` or ``wp.static(1.0 / 6.0)``
"""

import ast
import sys
from pathlib import Path

KERNELS = Path(__file__).resolve().parents[2] / "kernels"
TYPED = {"real", "float", "float32", "float64", "static"}
"""Calls that give a literal its type: ``real(...)``, ``wp.float64(...)``, ``wp.static(...)``, ``float(...)``."""


def _name(node: ast.expr) -> str:
    """Last part of a name: ``float64`` of ``wp.float64(1.0)`` and of ``wp.float64``; empty if there is none."""
    node = node.func if isinstance(node, ast.Call) else node
    return node.attr if isinstance(node, ast.Attribute) else node.id if isinstance(node, ast.Name) else ""


def _options(node: ast.expr, known: dict[str, dict[str, ast.expr]]) -> dict[str, ast.expr] | None:
    """Options of a ``wp.kernel`` (called, bare, partial, or a name bound to one of them); None if it is something else."""
    if isinstance(node, ast.Name) and node.id in known:
        return known[node.id]
    if isinstance(node, ast.Attribute):
        return {} if node.attr == "kernel" else None
    if not isinstance(node, ast.Call):
        return None
    given = {k.arg: k.value for k in node.keywords if k.arg}
    if _name(node) == "partial" and node.args:
        base = _options(node.args[0], known)
    else:
        base = _options(node.func, known)
    return None if base is None else {**base, **given}


def _is_func(node: ast.expr) -> bool:
    return _name(node) == "func"


def _is(node: ast.expr | None, value: object) -> bool:
    return isinstance(node, ast.Constant) and node.value == value


def _bare_floats(function: ast.FunctionDef) -> list[ast.Constant]:
    """Float literals of a function's body that no call gives a type."""
    found = []

    def visit(node: ast.AST) -> None:
        if isinstance(node, ast.Call) and _name(node) in TYPED:
            return
        if isinstance(node, ast.Constant) and isinstance(node.value, float):
            found.append(node)
        for child in ast.iter_child_nodes(node):
            visit(child)

    for statement in function.body:
        visit(statement)
    return found


def _casts_of_arithmetic(function: ast.FunctionDef) -> list[ast.Call]:
    """Casts of a function's body around something that reckons with bare float literals; Python reckons in ``static``."""
    found = []

    def visit(node: ast.AST) -> None:
        if isinstance(node, ast.Call) and _name(node) in TYPED:
            if _name(node) == "static":
                return
            if any(reckons(argument) for argument in node.args):
                found.append(node)
        for child in ast.iter_child_nodes(node):
            visit(child)

    def reckons(node: ast.AST, inside: bool = False) -> bool:
        if isinstance(node, ast.Call) and _name(node) in TYPED:
            return False  # has its own type, and is looked at by itself
        if isinstance(node, ast.Constant):
            return inside and isinstance(node.value, float)
        inside |= isinstance(node, (ast.BinOp, ast.IfExp, ast.Compare))
        return any(reckons(child, inside) for child in ast.iter_child_nodes(node))

    for statement in function.body:
        visit(statement)
    return found


def check_source(source: str, name: str) -> list[str]:
    """Broken rules of one file, each as ``name:line: what``."""
    tree = ast.parse(source)
    problems: list[tuple[int, str]] = []
    known: dict[str, dict[str, ast.expr]] = {}

    def visit(node: ast.AST, nested: bool, has_real: bool) -> None:
        if isinstance(node, ast.ImportFrom) and node.module == "__future__":
            if any(alias.name == "annotations" for alias in node.names):
                problems.append((node.lineno, "from __future__ import annotations"))
        if isinstance(node, ast.Assign) and (options := _options(node.value, known)) is not None:
            known.update({target.id: options for target in node.targets if isinstance(target, ast.Name)})
        if isinstance(node, ast.FunctionDef):
            kernels = [o for d in node.decorator_list if (o := _options(d, known)) is not None]
            for options in kernels:
                if not _is(options.get("enable_backward"), False):
                    problems.append((node.lineno, f"kernel {node.name} without enable_backward=False"))
                if nested and not _is(options.get("module"), "unique"):
                    problems.append((node.lineno, f'nested kernel {node.name} without module="unique"'))
            if kernels or any(_is_func(d) for d in node.decorator_list):
                for cast in _casts_of_arithmetic(node):
                    problems.append((cast.lineno, f"float32 arithmetic in {ast.unparse(cast)} of {node.name}"))
                for literal in _bare_floats(node) if has_real else ():
                    problems.append((literal.lineno, f"bare float {literal.value} in {node.name}"))
            nested = True
            arguments = node.args
            has_real |= any(a.arg == "real" for a in (*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs))
        for child in ast.iter_child_nodes(node):
            visit(child, nested, has_real)

    visit(tree, nested=False, has_real=False)
    return [f"{name}:{line}: {what}" for line, what in sorted(problems)]


def check_folder(folder: Path = KERNELS) -> list[str]:
    """Broken rules of all files below ``folder``."""
    files = sorted(folder.rglob("*.py"))
    return [
        line
        for path in files
        for line in check_source(path.read_text(encoding="utf-8"), path.relative_to(folder).as_posix())
    ]


if __name__ == "__main__":
    found = check_folder()
    print("\n".join(found) or f"{KERNELS.name}: all rules kept")
    sys.exit(1 if found else 0)
