"""The rows of a sweep: keys of the scene and their values, from a CSV file, a grid, or random samples."""

from __future__ import annotations

import csv
import itertools
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from warpdem.core.nearest import nearest
from warpdem.errors import SceneError
from warpdem.scene.model import Scene

NOTE = "note"
"""Columns whose name begins so are of the user, and change nothing."""
MOST_ROWS = 100_000
NUMBER = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\D.*?)?\s*$")

Row = dict[str, str]
"""Values of a row by column, as text; an empty one leaves the scene's."""


def read_table(path: Path) -> list[Row]:
    """Rows of a CSV file whose header names keys of the scene, such as ``pairs.0.friction``, and columns of notes.

    Raises:
        SceneError: the file cannot be read, has no rows, or rows of another length than its header.
    """
    try:
        lines = list(csv.reader(path.read_text(encoding="utf-8-sig").splitlines()))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise SceneError(f"{path}: cannot be read as a table ({error})") from error
    numbered = [(number, line) for number, line in enumerate(lines, 1) if any(cell.strip() for cell in line)]
    if len(numbered) < 2:
        raise SceneError(f"{path}: must have a line that names the columns, and one or more rows")
    names = [name.strip() for name in numbered[0][1]]
    check_names(names, str(path))
    for number, line in numbered[1:]:
        if len(line) != len(names):
            words = f"line {number} has {len(line)} values, the header {len(names)} names"
            raise SceneError(f"{path}: {words}; quote values that hold commas")
    return [{name: cell.strip() for name, cell in zip(names, line, strict=True)} for _, line in numbered[1:]]


def check_names(names: Sequence[str], source: str) -> None:
    """Refuse columns that are neither keys of a scene nor notes.

    Raises:
        SceneError: names the column, and the key that may have been meant.
    """
    keys = [*Scene.model_fields]
    for k, name in enumerate(names):
        root = re.split(r"[.\[]", name)[0]
        if not name or names.index(name) != k:
            raise SceneError(f"{source}: column {k + 1} {'has no name' if not name else f'repeats {name!r}'}")
        if root not in keys and not name.startswith(NOTE):
            hint = nearest(root, keys) or f"; a key begins with one of {', '.join(keys)}"
            raise SceneError(f"{source}: column {name!r} is no key of a scene{hint} (a column of notes begins with {NOTE!r})")


def grid(choices: Sequence[str]) -> list[Row]:
    """All combinations of values: each choice is ``KEY=VALUE,VALUE,...``; the last one changes fastest.

    Raises:
        SceneError: a choice is none, or there are more than 100 000 combinations.
    """
    columns = {}
    for choice in choices:
        key, equals, text = choice.partition("=")
        values = split_values(text)
        if not equals or not key.strip() or not all(values):
            raise SceneError(f"--grid {choice}: must be KEY=VALUE,VALUE,..., such as pairs.0.friction=0.1,0.3,0.5")
        columns[key.strip()] = values
    check_names(list(columns), "--grid")
    if (count := math.prod(map(len, columns.values()))) > MOST_ROWS:
        raise SceneError(f"--grid: {count} combinations; at most {MOST_ROWS} rows are run")
    return [dict(zip(columns, values, strict=True)) for values in itertools.product(*columns.values())]


def split_values(text: str) -> list[str]:
    """Values between commas, but for commas within brackets, braces and quotes."""
    values, depth, quote = [""], 0, ""
    for sign in text:
        if quote:
            quote = "" if sign == quote else quote
        elif sign in "\"'":
            quote = sign
        elif sign in "[{":
            depth += 1
        elif sign in "]}":
            depth -= 1
        if sign == "," and not depth and not quote:
            values.append("")
        else:
            values[-1] += sign
    return [value.strip() for value in values]


@dataclass(frozen=True)
class Range:
    """Values of a key between two numbers of one unit."""

    key: str
    low: float
    high: float
    unit: str
    """Unit of the numbers; empty for none."""
    log: bool
    """Whether equal parts of the range are equal factors."""

    def number(self, fraction: float) -> float:
        """The number at a fraction of the range, from 0 to 1."""
        return self.low * (self.high / self.low) ** fraction if self.log else self.low + (self.high - self.low) * fraction

    def value(self, fraction: float) -> str:
        """The same as a value of a row, with its unit."""
        number = f"{self.number(fraction):.12g}"
        return f'"{number} {self.unit}"' if self.unit else number


def samples(ranges: Sequence[str], count: int, seed: int) -> list[Row]:
    """Random values that fill their ranges evenly: a Latin hypercube (McKay, Beckman and Conover 1979).

    Args:
        ranges: each ``KEY=LOW:HIGH``, numbers with one unit or none (``10 rpm:40 rpm``); ``KEY=LOW:HIGH:log`` on a log scale.
        count: number of rows.
        seed: of the random numbers; the same gives the same rows.

    Raises:
        SceneError: a range is none, or the count is not from 1 to 100 000.
    """
    if not 1 <= count <= MOST_ROWS:
        raise SceneError(f"--count {count}: must be from 1 to {MOST_ROWS}")
    parsed = {one.key: one for one in (parse_range(text, "--sample ") for text in ranges)}
    check_names(list(parsed), "--sample")
    fractions = latin_hypercube(np.random.default_rng(seed), count, len(parsed))
    return [{one.key: one.value(x) for one, x in zip(parsed.values(), row, strict=True)} for row in fractions.tolist()]


def latin_hypercube(random: np.random.Generator, count: int, dimensions: int) -> np.ndarray:
    """Shares of ranges: one value in each of ``count`` equal parts of each, in random order, shape (count, dimensions)."""
    columns = [(random.permutation(count) + random.random(count)) / count for _ in range(dimensions)]
    return np.stack(columns, axis=1)


def parse_range(text: str, source: str) -> Range:
    """The range that ``KEY=LOW:HIGH`` or ``KEY=LOW:HIGH:log`` is; ``source`` is what messages begin with.

    Raises:
        SceneError: it is none.
    """
    key, _, limits = text.partition("=")
    low, _, rest = limits.partition(":")
    high, _, scale = rest.partition(":")
    ends = [NUMBER.match(end) for end in (low, high)]
    if not key.strip() or scale not in ("", "log") or None in ends:
        raise SceneError(f"{source}{text}: must be KEY=LOW:HIGH or KEY=LOW:HIGH:log, such as frame.rate='10 rpm:40 rpm'")
    (least, first), (most, second) = ((float(end[1]), end[2] or "") for end in ends if end is not None)
    if first and second and first != second:
        raise SceneError(f"{source}{text}: its ends have two units, {first!r} and {second!r}; give one")
    if not least < most or (scale and least <= 0.0):
        raise SceneError(f"{source}{text}: the lesser number must come first{', and be above 0 for log' if scale else ''}")
    return Range(key.strip(), least, most, first or second, bool(scale))


def overrides(row: Row) -> list[str]:
    """The changes of a row as ``load_scene`` takes them."""
    return [f"{key}={value}" for key, value in row.items() if value and not key.startswith(NOTE)]
