"""Commands of a LIGGGHTS script: lines joined, comments taken off, variables put in."""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from warpdem.errors import SceneError

LARGEST = 10_000_000
"""Largest script that is read [bytes]."""
DEEPEST = 8
"""Files that may include each other."""
FLOW = ("jump", "next", "if", "label", "python")
"""Commands that change which lines come next: they are not followed."""
OPERATORS: dict[type, Callable[[float, float], float]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv, ast.Pow: operator.pow,
}  # fmt: skip
FUNCTIONS: dict[str, Callable[[float], float]] = {
    "sqrt": math.sqrt, "exp": math.exp, "ln": math.log, "log": math.log10, "abs": abs, "sin": math.sin, "cos": math.cos,
    "tan": math.tan, "asin": math.asin, "acos": math.acos, "atan": math.atan, "ceil": math.ceil, "floor": math.floor,
    "round": round,
}  # fmt: skip


@dataclass(frozen=True)
class Command:
    """A command of a script.

    Attributes:
        words: its words, the command itself first.
        place: file and line, for messages.
    """

    words: tuple[str, ...]
    place: str

    def __str__(self) -> str:
        return f"{self.place}: {' '.join(self.words[:4])}{' ...' if len(self.words) > 4 else ''}"


def read_script(path: Path) -> tuple[list[Command], list[str]]:
    """Commands of a script and of the files that it includes, and notes on what was not followed.

    Raises:
        SceneError: it cannot be read, or is no text.
    """
    script = _Script()
    return list(script.commands(path)), script.notes


class _Script:
    """Variables so far, and notes."""

    def __init__(self) -> None:
        self.values: dict[str, str] = {}
        self.formulas: dict[str, str] = {}
        self.notes: list[str] = []

    def commands(self, path: Path, depth: int = 0) -> Iterator[Command]:
        """The commands of a file and of those that it includes."""
        for number, line in _lines(path):
            place = f"{path.name} line {number}"
            words = tuple(self._filled(line, place).split())
            if not words:
                continue
            command = Command(words, place)
            if words[0] == "variable":
                self._define(command)
            elif words[0] == "include" and len(words) == 2 and depth < DEEPEST:
                yield from self.commands(path.parent / words[1], depth + 1)
            elif words[0] in FLOW:
                self.notes.append(f"{command}: not followed; the lines are taken once, in their order")
            else:
                yield command

    def _define(self, command: Command) -> None:
        """Take up a variable of the styles equal, string and index; others, which are made anew in a run, stay unknown."""
        if len(command.words) < 4:
            return
        name, style, text = command.words[1], command.words[2], " ".join(command.words[3:]).strip("\"'")
        if style == "equal":
            self.formulas[name] = text
            self.values.pop(name, None)
        elif style in ("string", "index") and (style == "string" or name not in self.values):
            self.values[name] = text if style == "string" else command.words[3]

    def _filled(self, line: str, place: str) -> str:
        """A line with the values of its variables: ${name}, $x, and v_name of numbers."""

        def value(found: re.Match[str]) -> str:
            name = found[1] or found[2] or found[3]
            known = self._value(name)
            if known is None and not found[3]:
                self.notes.append(f"{place}: the variable {name} is not known before the run")
            return known if known is not None else found[0]

        pattern = r"\$\{(\w+)\}|\$(\w)|(?<=\s)v_(\w+)"
        return line if line.split()[:1] == ["variable"] and "$" not in line else re.sub(pattern, value, line)

    def _value(self, name: str) -> str | None:
        if name in self.values:
            return self.values[name]
        if name not in self.formulas:
            return None
        try:
            return repr(self._number(self.formulas[name], {name}))
        except (ValueError, KeyError, SyntaxError, TypeError, ArithmeticError, RecursionError):
            return None

    def _number(self, formula: str, above: set[str]) -> float:
        """Value of a formula; ``above``: names of the variables that ask for it."""
        text = re.sub(r"\$\{(\w+)\}", r"v_\1", formula).replace("^", "**")

        def of(node: ast.expr) -> float:
            if isinstance(node, ast.Constant) and isinstance(node.value, (int, float)):
                return float(node.value)
            if isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.USub, ast.UAdd)):
                return -of(node.operand) if isinstance(node.op, ast.USub) else of(node.operand)
            if isinstance(node, ast.BinOp) and type(node.op) in OPERATORS:
                return OPERATORS[type(node.op)](of(node.left), of(node.right))
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and len(node.args) == 1:
                return float(FUNCTIONS[node.func.id](of(node.args[0])))
            if isinstance(node, ast.Name) and node.id == "PI":
                return math.pi
            if isinstance(node, ast.Name) and node.id.startswith("v_") and node.id[2:] not in above:
                name = node.id[2:]
                return self._number(self.formulas[name], above | {name}) if name in self.formulas else float(self.values[name])
            raise ValueError(formula)

        return of(ast.parse(text, mode="eval").body)


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    """Lines with their numbers: those that end in & joined with the next, then comments taken off, as LIGGGHTS does."""
    try:
        if path.stat().st_size > LARGEST:
            raise SceneError(f"{path}: a script has at most {LARGEST} bytes, this one has {path.stat().st_size}")
        text = path.read_text(encoding="utf-8", errors="strict")
    except (OSError, UnicodeDecodeError, ValueError) as error:
        raise SceneError(f"{path}: cannot be read as a script of LIGGGHTS ({error})") from error
    if "\0" in text:
        raise SceneError(f"{path}: is no script of LIGGGHTS: it has bytes that are no text")
    begun, first = "", 0
    for number, line in enumerate(text.splitlines(), 1):
        first = first if begun else number
        if line.rstrip().endswith("&"):
            begun += line.rstrip()[:-1] + " "
            continue
        yield first, (begun + line).partition("#")[0]
        begun = ""
    if begun:
        yield first, begun.partition("#")[0]
