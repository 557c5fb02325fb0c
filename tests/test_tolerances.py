"""Absolute tolerances are what they say: NumPy's ``assert_allclose`` adds 1e-7 of the expected value unless told otherwise."""

import ast
from pathlib import Path

TESTS = Path(__file__).resolve().parent


def test_no_absolute_tolerance_is_widened_by_a_relative_one_that_nobody_wrote():
    calls = [
        (file, call)
        for file in sorted(TESTS.rglob("*.py"))
        for call in ast.walk(ast.parse(file.read_text()))
        if isinstance(call, ast.Call) and isinstance(call.func, ast.Attribute) and call.func.attr == "assert_allclose"
    ]
    assert len(calls) > 100, "nothing was looked at"
    keys = [(file, call.lineno, {word.arg for word in call.keywords}) for file, call in calls]
    wide = [f"{file.relative_to(TESTS)}:{line}" for file, line, given in keys if "atol" in given and "rtol" not in given]
    assert not wide, f"give rtol beside atol: {wide}"
