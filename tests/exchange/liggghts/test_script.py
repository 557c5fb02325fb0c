"""Scripts of LIGGGHTS as commands: lines, variables, included files; what cannot be read is refused in words."""

import pytest

from warpdem import SceneError
from warpdem.exchange.liggghts.script import read_script


def commands(tmp_path, text, **files):
    for name, content in files.items():
        (tmp_path / name).write_text(content)
    (tmp_path / "in.test").write_text(text)
    found, notes = read_script(tmp_path / "in.test")
    return [command.words for command in found], notes


def test_lines_are_joined_and_comments_taken_off(tmp_path):
    found, _ = commands(tmp_path, "# no &\nfix b\nfix a all &  \n gravity 9.81 &\n\nrun 5 # end & more\nrun 6")
    # a comment that ends in & goes on, too
    assert found == [("fix", "a", "all", "gravity", "9.81"), ("run", "5"), ("run", "6")]


def test_a_line_that_is_joined_keeps_the_number_of_its_first(tmp_path):
    (tmp_path / "in.test").write_text("units si\nfix a all &\n gravity 9.81\nrun 1\n")
    found, _ = read_script(tmp_path / "in.test")
    assert [command.place for command in found] == [f"in.test line {n}" for n in (1, 2, 4)]


def test_variables_are_put_in(tmp_path):
    text = """variable r equal 0.002
variable twice equal "2*v_r^1 + sqrt(4)*0"
variable name string drum.stl
variable x index 7
a ${twice} v_twice $x ${name}
variable r equal 0.003
b ${twice}
"""
    found, notes = commands(tmp_path, text)
    assert found == [("a", "0.004", "0.004", "7", "drum.stl"), ("b", "0.006")]
    assert notes == []


def test_what_is_known_only_in_the_run_is_noted(tmp_path):
    found, notes = commands(tmp_path, "variable e equal ke(all)\nprint ${e}\nvariable a equal v_a\nrun ${a}\n")
    assert found == [("print", "${e}"), ("run", "${a}")]
    assert len(notes) == 2 and "the variable e is not known before the run" in notes[0]


def test_formulas_cannot_run_anything(tmp_path):
    found, _ = commands(tmp_path, "variable a equal __import__('os').getpid()\nrun ${a}\nvariable b equal 9^9^9^9\nrun ${b}\n")
    assert found == [("run", "${a}"), ("run", "${b}")]


def test_included_files_are_followed_and_branches_are_not(tmp_path):
    found, notes = commands(tmp_path, "include more\njump SELF loop\n", more="units si\n")
    assert found == [("units", "si")]
    assert "in.test line 2: jump SELF loop: not followed" in notes[0]


def test_a_file_that_includes_itself_ends(tmp_path):
    found, _ = commands(tmp_path, "units si\ninclude in.test\n")
    assert found.count(("units", "si")) == 9


@pytest.mark.parametrize("content", [b"\xff\xfe\x00", b"units si\0\n"])
def test_what_is_no_text_is_refused(tmp_path, content):
    (tmp_path / "in.test").write_bytes(content)
    with pytest.raises(SceneError, match="in.test"):
        read_script(tmp_path / "in.test")
