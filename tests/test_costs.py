"""The option --costs sums up what each file's tests took, of reports as workers send them."""

from types import SimpleNamespace

from costs import NAME, table


def report(nodeid, *costs):
    return SimpleNamespace(nodeid=nodeid, user_properties=[("other", 1), (NAME, list(costs))] if costs else [])


def test_files_are_listed_by_their_processor_time():
    reports = [report("a.py::one", 1.0, 2, 0.5), report("b.py::one", 5.0, 1, 4.0), report("a.py::two", 2.0, 0, 0.0),
               report("b.py::call without costs"), SimpleNamespace()]  # fmt: skip
    lines = [line.split() for line in table(reports)[1:]]
    assert lines == [
        ["8.0", "4.5", "(3)", "3", "all", "files"],
        ["5.0", "4.0", "(1)", "1", "b.py"],
        ["3.0", "0.5", "(2)", "2", "a.py"],
    ]


def test_nothing_measured_is_told_too():
    assert len(table([])) == 2
