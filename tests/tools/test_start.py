"""The two commands of the README: what is installed for which, once, and which result the tests have."""

import subprocess
import sys
from types import SimpleNamespace

import pytest

import start


@pytest.fixture
def installed(monkeypatch, tmp_path):
    """What pip was asked for, in an environment that is there."""
    monkeypatch.setattr(start, "STAMP", tmp_path / "installed-from")
    monkeypatch.setattr(start, "BIN", tmp_path)
    (tmp_path / "python").touch()
    asked = []
    monkeypatch.setattr(start, "call", lambda *words: asked.append(words[-1]))
    return asked


def test_a_run_installs_no_tools_of_the_tests_and_what_is_there_is_kept(installed):
    start.install(tests=False)
    start.install(tests=False)
    assert installed == ["."]
    start.install(tests=True)
    start.install(tests=True)
    start.install(tests=False)
    assert installed == [".", ".[test]"]


def test_other_dependencies_are_installed_again(installed):
    start.install(tests=True)
    start.STAMP.write_text(start.STAMP.read_text().replace("numpy", "numpy<2,"))
    start.install(tests=True)
    assert installed == [".[test]"] * 2


@pytest.mark.parametrize(("tests", "types", "code"), [(0, 0, 0), (1, 0, 1), (0, 1, 1), (2, 1, 2)])
def test_the_tests_pass_only_with_the_types(monkeypatch, capsys, tests, types, code):
    monkeypatch.setattr(sys, "argv", ["start.py", "test", "-q"])
    monkeypatch.setattr(start, "install", lambda tests: None)
    monkeypatch.setattr(start, "call", lambda *words: None)
    ran = []

    def run(command, **options):
        ran.append(command[-1])
        return SimpleNamespace(returncode=tests)

    monkeypatch.setattr(subprocess, "run", run)
    checked = SimpleNamespace(returncode=types, communicate=lambda: ("what mypy says\n", None))
    monkeypatch.setattr(subprocess, "Popen", lambda command, **options: checked)
    with pytest.raises(SystemExit) as ended:
        start.main()
    assert (ended.value.code, ran) == (code, ["-q"])
    assert "what mypy says" in capsys.readouterr().out
