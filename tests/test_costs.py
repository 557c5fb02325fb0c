"""The option --costs sums up what each file's tests took, of reports as workers send them, which begin with the longest."""

from pathlib import Path
from types import SimpleNamespace

from costs import LONGEST, NAME, longest_first, table


def report(nodeid, *costs):
    return SimpleNamespace(nodeid=nodeid, user_properties=[("other", 1), (NAME, list(costs))] if costs else [])


def test_files_are_listed_by_their_processor_time():
    reports = [report("a.py::one", 1.0, 0.25, 2, 0.5), report("b.py::one", 5.0, 0.0, 1, 4.0),
               report("a.py::two", 2.0, 1.0, 0, 0.0), report("b.py::call without costs"), SimpleNamespace()]  # fmt: skip
    lines = [line.split() for line in table(reports)[1:]]
    assert lines == [
        ["8.0", "1.2", "4.5", "(3)", "3", "all", "files"],
        ["5.0", "0.0", "4.0", "(1)", "1", "b.py"],
        ["3.0", "1.2", "0.5", "(2)", "2", "a.py"],
    ]


def test_nothing_measured_is_told_too():
    assert len(table([])) == 2


def test_workers_begin_with_the_longest_files_then_with_those_of_most_tests():
    names = ["tests/a.py::one", "tests/b.py::one", f"{LONGEST[1]}::one", "tests/b.py::two", f"{LONGEST[0]}::one",
             f"{LONGEST[1]}::two"]  # fmt: skip
    items = [SimpleNamespace(nodeid=name) for name in names]
    longest_first(items)
    assert [names.index(item.nodeid) for item in items] == [4, 2, 5, 1, 3, 0]


def test_the_longest_files_exist():
    root = Path(__file__).resolve().parents[1]
    assert all((root / file).is_file() for file in LONGEST)
