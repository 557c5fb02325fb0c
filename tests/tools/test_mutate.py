"""The table of tools/dev/mutate.py fits the kernels as they stand; the tool tells killed, survived and broken mutants apart."""

import re
from pathlib import Path

import pytest

from dev import mutate

ROOT = Path(__file__).resolve().parents[2]
MUTANTS, CATCH_ALL = mutate.read_table()
WITHOUT = set(
    "__init__ barrier exchange columns grain packing size_grids explicit_euler record surface lane_types".split()
)
"""Files without a formula of their own (none of ``api`` has one), and ``packing``: it makes a start whose overlaps are checked
wherever it is used."""


def test_there_are_enough_and_their_names_differ():
    names = [m.name for m in MUTANTS]
    assert len(names) == len(set(names)) >= 60


@pytest.mark.parametrize("mutant", MUTANTS, ids=lambda m: m.name)
def test_the_original_stands_once_and_the_mutant_is_python(mutant):
    text = (ROOT / mutant.file).read_text()
    compile(mutant.changed(text), mutant.file, "exec")
    assert mutant.new != mutant.old


@pytest.mark.parametrize("test", sorted({t for m in MUTANTS for t in m.tests} | set(CATCH_ALL)))
def test_the_named_tests_exist(test):
    path, _, function = test.partition("::")
    assert (ROOT / path).exists()
    if function:
        assert re.search(rf"^def {re.escape(function.split('[')[0])}\(", (ROOT / path).read_text(), re.MULTILINE)


def test_every_file_with_a_formula_has_mutants():
    named = (p.relative_to(ROOT) for p in (ROOT / "kernels").rglob("*.py") if p.stem not in WITHOUT)
    files = {path.as_posix() for path in named if path.parts[1] != "api"}
    without = sorted(files - {m.file for m in MUTANTS})
    assert not without, "list some in the test of the model, MUTANTS = [(text, what it becomes), ...], or in mutants.toml"


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A copy of a tree as small as it gets."""
    monkeypatch.setattr(mutate, "ROOT", tmp_path / "tree")
    monkeypatch.setattr(mutate, "PARTS", ("warpdem", "kernels", "scenes", "tests"))
    for part in mutate.PARTS:
        (mutate.ROOT / part).mkdir(parents=True)
    (mutate.ROOT / "kernels/contact").mkdir()
    for name, text in {
        "warpdem/__init__.py": "", "kernels/__init__.py": "", "kernels/contact/__init__.py": "",
        "kernels/contact/law.py": "ONE = 1\nTWO = 2\n",
        "tests/test_one.py": "from warpdem.kernels.contact.law import ONE\n\n\ndef test_one():\n    assert ONE == 1\n",
        "tests/test_two.py": "from warpdem.kernels.contact.law import TWO\n\n\ndef test_two():\n    assert TWO == 2\n",
    }.items():  # fmt: skip
        (mutate.ROOT / name).parent.mkdir(exist_ok=True)
        (mutate.ROOT / name).write_text(text)
    return mutate.Workplace(tmp_path / "copy", tmp_path / "cache")


def test_mutants_are_judged_one_after_the_other_and_taken_back(place):
    """One that survives passes all tests, so what was tried before it is gone."""
    for old, new, status, by in (
        ("ONE = 1", "ONE = 3", "killed", "tests/test_one.py::test_one: assert 3 == 1"),
        ("TWO = 2", "TWO = 4", "killed", "tests/test_two.py::test_two: assert 4 == 2"),  # by the tests for all
        ("ONE = 1", "ONE =", "not run", None),
        ("ONE = 1", "ONE = __import__('os').abort()", "killed", "crash: SIGABRT"),
        ("ONE = 1", "ONE = __import__('os').kill(__import__('os').getpid(), 9)", "not run", None),
        ("TWO = 2", "TWO = 1 + 1", "survived", ""),
    ):
        mutant = mutate.Mutant("name", "kernels/contact/law.py", old, new, ("tests/test_one.py",))
        result = place.judge(mutant, ["tests"], 60.0)
        assert result["status"] == status, new
        assert by is None or result["by"] == by
        assert (place.folder / "kernels/contact/law.py").read_text() == "ONE = 1\nTWO = 2\n"


@pytest.mark.slow
def test_a_test_that_fails_anyway_kills_nothing(place):
    (place.folder / "tests" / "test_broken.py").write_text("def test_broken():\n    assert False\n")
    mutant = mutate.Mutant("name", "kernels/contact/law.py", "TWO = 2", "TWO = 1 + 1", ("tests/test_one.py",))
    result = place.judge(mutant, ["tests"], 60.0)
    assert result["status"] == "not run"
    assert result["by"] == "fails on the unchanged kernels, too: tests/test_broken.py::test_broken: assert False"
    defended = mutate.Mutant("name", "kernels/contact/law.py", "TWO = 2", "TWO = 4", ("tests/test_one.py",), "for a reason")
    assert place.judge(defended, ["tests"], 60.0)["status"] == "survived", "went through the tests for all"


def test_results_of_other_mutants_are_kept_and_those_of_changed_ones_dropped(tmp_path):
    first, second, changed = (mutate.Mutant(n, "kernels/contact/law.py", "1", "2", ("tests",)) for n in ("a", "b", "c"))

    def result(mutant, status):
        return {"name": mutant.name, "file": mutant.file, "digest": mutant.digest, "status": status, "by": "", "seconds": 1.0}

    record = mutate.Record(tmp_path / "r.md", [first, second, changed])
    for mutant in (first, changed):
        record.add(result(mutant, "killed"))
    other = mutate.Mutant("c", "kernels/contact/law.py", "1", "3", ("tests",))
    record = mutate.Record(tmp_path / "r.md", [first, second, other])
    record.add(result(second, "survived"))
    assert list(record.lines) == ["a", "b"]
    assert [record.is_open(m) for m in (first, second, other)] == [False, True, True]
    assert "2 of 3 mutants tried, 1 killed, 0 defended, 1 open" in (tmp_path / "r.md").read_text()


def test_a_text_that_moved_on_is_named():
    with pytest.raises(ValueError, match=r"a: '1' stands 2 times in kernels/contact/law\.py, not once"):
        mutate.Mutant("a", "kernels/contact/law.py", "1", "2", ()).changed("11")


def test_list_and_unknown_names(capsys):
    assert mutate.main(["--list", "--only", "hertz_*"]) == 0
    assert "kernels/normal/hertz.py" in capsys.readouterr().out
    assert mutate.main(["--only", "no_such_mutant"]) == 2
    assert "no mutant is called no_such_mutant" in capsys.readouterr().err
