"""The notebook for people who script: its cells run one after the other, and give what is said beside them."""

import ast
import json
from pathlib import Path

import numpy as np
import pytest

import warpdem

NOTEBOOK = Path(__file__).resolve().parents[2] / "scenes" / "scripting.ipynb"


@pytest.fixture(scope="module")
def cells():
    """Values that the code cells show, and the names that they leave behind."""
    notebook = json.loads(NOTEBOOK.read_text(encoding="utf-8"))
    assert (notebook["nbformat"], len({cell["id"] for cell in notebook["cells"]})) == (4, len(notebook["cells"]))
    names: dict = {}
    shown = []
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            assert not cell["outputs"], "results are not kept in the file"
            *first, last = ast.parse("".join(cell["source"])).body
            exec(compile(ast.Module(first, []), cell["id"], "exec"), names)
            value = isinstance(last, ast.Expr)
            code = ast.Expression(last.value) if value else ast.Module([last], [])
            result = (eval if value else exec)(compile(code, cell["id"], "eval" if value else "exec"), names)
            shown.append(result)
    return names, shown


def test_it_shows_a_simulation_and_a_picture(cells):
    _, shown = cells
    assert isinstance(shown[0], warpdem.Simulation) and "grains" in repr(shown[0])
    assert shown[1]._repr_png_().startswith(b"\x89PNG")


def test_what_it_says_comes_out(cells):
    names, shown = cells
    assert 0.01 < names["fastest"] < names["time"][-1] and names["kinetic"][-1] < 0.9 * names["kinetic"].max()
    assert names["between"].any() and not names["between"].all() and 0.0 < names["deepest"] < 1e-3
    assert names["load"][2] < 0.0  # the grains press the box down
    assert names["left"][0.2] < names["left"][0.8]
    assert shown[-1] is True and np.isclose(names["again"].time, 0.15, atol=1e-3)
