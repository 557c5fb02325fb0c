"""Curves of histories: which are drawn, in which panels, and files that open; the command plot."""

import json
from xml.etree import ElementTree

import imageio.v2 as imageio
import numpy as np
import pytest

from warpdem import WarpdemError, plot, runs
from warpdem.app import cli
from warpdem.drawing.curves import drawn
from warpdem.runs.names import run_names

EVERYTHING = (-np.inf, np.inf)


@pytest.fixture
def folder(tmp_path):
    """A run of three rows."""
    return made(tmp_path / "a")


def made(folder, factor=1.0):
    folder.mkdir(parents=True)
    (folder / "run.json").write_text(json.dumps({"status": "done"}))
    names = ["time [s]", "kinetic [J]", "rotational [J]", "elastic [J]", "potential [J]", "lid force z [N]", "grains [-]"]
    rows = np.array([[0, 1, 2, 3, -4, 5, 10], [1, 2, 3, 4, -3, 6, 10], [2, 3, 4, 5, -2, 7, 10]], float)
    rows[:, 1:] *= factor
    np.savetxt(folder / "history.csv", rows, delimiter=",", header=",".join(names), comments="")
    return folder


def texts(path):
    return ["".join(e.itertext()).strip() for e in ElementTree.parse(path).iter("{http://www.w3.org/2000/svg}text")]


def test_panels_hold_the_columns_of_a_unit(folder):
    history = runs.read(folder).history
    figure = drawn({"a": history}, history.matching(["kinetic", "lid force z", "elastic"]), "time", EVERYTHING, False)
    energies, force = figure.axes
    assert [line.get_label() for line in energies.lines] == ["kinetic", "elastic"]
    assert energies.get_ylabel() == "[J]" and force.get_ylabel() == "lid force z [N]"
    np.testing.assert_array_equal(energies.lines[1].get_xydata(), [[0, 3], [1, 4], [2, 5]])
    assert energies.lines[0].get_color() != energies.lines[1].get_color()
    assert force.get_xlabel() == "time [s]" and not energies.get_xlabel()


def test_runs_are_drawn_over_each_other_column_by_column(folder, tmp_path):
    other = made(tmp_path / "b", 2.0)
    histories = {name: runs.read(path).history for name, path in (("a", folder), ("b", other))}
    figure = drawn(histories, ["kinetic [J]", "elastic [J]"], "time", (1.0, 2.0), False)
    assert [ax.get_ylabel() for ax in figure.axes] == ["kinetic [J]", "elastic [J]"]
    assert [[line.get_label() for line in ax.lines] for ax in figure.axes] == [["a", "b"]] * 2
    np.testing.assert_array_equal(figure.axes[1].lines[1].get_xydata(), [[1, 8], [2, 10]])


def test_another_column_on_the_horizontal_axis(folder):
    history = runs.read(folder).history
    (ax,) = drawn({"a": history}, ["elastic [J]"], "kinetic", EVERYTHING, True).axes
    np.testing.assert_array_equal(ax.lines[0].get_xydata(), [[1, 3], [2, 4], [3, 5]])
    assert ax.get_xlabel() == "kinetic [J]" and ax.get_yscale() == "log"


def test_files_open_and_are_the_same_bytes_each_time(folder, tmp_path):
    plot(folder, tmp_path / "x" / "a.svg")
    assert {"kinetic", "rotational", "elastic", "potential", "[J]", "time [s]"} <= set(texts(tmp_path / "x" / "a.svg"))
    plot([folder], tmp_path / "b.svg")
    assert (tmp_path / "b.svg").read_bytes() == (tmp_path / "x" / "a.svg").read_bytes()
    image = imageio.imread(plot(folder, tmp_path / "a.png", columns=["kinetic"], dpi=100))
    assert image.shape[1] == 720 and image.std() > 5
    assert plot(folder, tmp_path / "a.pdf").read_bytes().startswith(b"%PDF")


@pytest.mark.parametrize(
    ("choices", "said"),
    [({"columns": ["kinetik"]}, 'did you mean "kinetic"'), ({"x": "y"}, "has no column 'y'"), ({"start": 5.0}, "no row from 5"),
     ({"out": "a.jpg"}, r"suffix '.jpg' cannot be drawn; allowed are .png, .svg, .pdf"),
     ({"dpi": 0.0}, "dpi 0 must be from 20"),
     ({"columns": ["potential"], "log": True}, "'potential' has no value above 0")],
)  # fmt: skip
def test_what_cannot_be_drawn_is_told_and_nothing_written(folder, tmp_path, choices, said):
    choices = {"out": "a.png"} | choices
    with pytest.raises(WarpdemError, match=said):
        plot(folder, tmp_path / choices.pop("out"), **choices)
    assert not list(tmp_path.glob("a.*"))


def test_a_column_that_one_run_lacks_is_told(folder, tmp_path):
    other = made(tmp_path / "b")
    (other / "history.csv").write_text("time [s]\n0\n")
    with pytest.raises(WarpdemError, match=r"b/history\.csv: has no column"):
        plot([folder, other], tmp_path / "a.png")


def test_names_of_runs_tell_them_apart(tmp_path):
    paths = [tmp_path / name for name in ("drum/results", "mill/results")]
    assert run_names(paths) == ["drum", "mill"]
    assert run_names([tmp_path / "a", tmp_path / "b"]) == ["a", "b"]
    assert run_names([tmp_path / "x" / "a", tmp_path / "y" / "b", tmp_path / "z" / "a"]) != ["a", "b", "a"]
    assert len(set(run_names([tmp_path, tmp_path]))) == 2


def test_the_command_draws_and_lists(folder, capsys):
    cli.app(["plot", str(folder), "--columns", "kinetic", "lid*"], result_action="return_value")
    assert (folder / "history.png").exists() and f"wrote {folder / 'history.png'}" in capsys.readouterr().out.replace("\n", "")
    cli.app(["plot", str(folder), "--list", "--columns", "lid*"], result_action="return_value")
    lines = capsys.readouterr().out.splitlines()
    assert [line.split() for line in lines if "lid" in line] == [["lid", "force", "z", "[N]", "5", "5", "7", "6", "7"]]
    assert not any("kinetic" in line for line in lines)
