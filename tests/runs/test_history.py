"""history.csv read by column: names with and without units, patterns, unfinished and damaged files, phases in one time."""

import numpy as np
import pytest

import twelve_grains
from warpdem import WarpdemError, runs

HEADER = 'time [s],kinetic [J],"drum, left force x [N]",drum power [W],mass [kg],mass [-]'


def written(folder, body, header=HEADER):
    path = folder / "history.csv"
    path.write_text(header + "\n" + body)
    return path


@pytest.fixture
def history(tmp_path):
    return runs.history.read_history(written(tmp_path, "0,1,10,-1,3,4\n0.5,2.5,20,nan,3,4\n"))


def test_a_column_is_found_with_and_without_its_unit(history):
    assert history["kinetic [J]"].tolist() == history["kinetic"].tolist() == [1.0, 2.5]
    assert history["drum, left force x"].tolist() == [10, 20]
    assert history.header("drum power") == "drum power [W]" and history.unit("drum power") == "W"
    assert np.isnan(history["drum power"][1])
    assert history.rows == 2 and len(history) == 6 and next(iter(history)) == "time [s]"
    assert "kinetic" in history and "heat" not in history and "mass" not in history


def test_the_whole_table_goes_to_other_libraries(history):
    table = dict(history)
    assert list(table) == ["time [s]", "kinetic [J]", "drum, left force x [N]", "drum power [W]", "mass [kg]", "mass [-]"]
    assert all(isinstance(values, np.ndarray) and len(values) == 2 for values in table.values())


@pytest.mark.parametrize(
    ("name", "said"),
    [("kinetik", 'did you mean "kinetic"'), ("xyz", "there are 'time [s]'"),
     ("mass", "'mass [kg]' or 'mass [-]': give the unit")],
)  # fmt: skip
def test_a_column_that_is_not_there_is_told(history, name, said):
    with pytest.raises(runs.NoColumn) as error:
        history[name]
    assert said in str(error.value) and str(error.value).startswith(history.source)
    assert history.get(name) is None


def test_patterns_take_names_in_their_order(history):
    assert history.matching(["drum power", "kin*", "drum*"]) == [
        "drum power [W]", "kinetic [J]", "drum, left force x [N]",
    ]  # fmt: skip
    assert history.matching(["* [J]"]) == ["kinetic [J]"]
    with pytest.raises(runs.NoColumn, match="no column matches 'x"):
        history.matching(["x*"])


def test_what_a_killed_run_left_of_its_last_row_is_dropped(tmp_path):
    assert runs.history.read_history(written(tmp_path, "0,1,10,-1,3,4\n0.5,2.5,2")).rows == 1
    assert runs.history.read_history(written(tmp_path, "0,1,1")).rows == 0


@pytest.mark.parametrize(
    ("header", "body", "said"),
    [("a,a", "1,2\n", "no header"), ("a,b", "1,x\n", "no table of numbers"), ("a,b", "1,2\n1\n", "no table of numbers"),
     ("a,b", "1,2,3\n", "3 numbers, its header 2"), ("", "", "no header")],
)  # fmt: skip
def test_a_file_that_is_no_history_is_told(tmp_path, header, body, said):
    path = written(tmp_path, body, header)
    with pytest.raises(WarpdemError, match=said) as error:
        runs.history.read_history(path)
    assert str(path) in str(error.value)


def test_bytes_that_are_no_text_are_told(tmp_path):
    (tmp_path / "history.csv").write_bytes(b"\xff\xfe,1\n")
    with pytest.raises(WarpdemError, match="cannot be read"):
        runs.history.read_history(tmp_path / "history.csv")


def test_phases_are_joined_in_one_time():
    first = runs.History("a", {"time [s]": np.array([0.0, 1.0]), "x [m]": np.array([1.0, 2.0])})
    second = runs.History("b", {"time [s]": np.array([0.0, 0.5]), "y [m]": np.array([8.0, 9.0])})
    both = runs.history.joined("c", [(0.0, first), (1.0, second)])
    assert both["time"].tolist() == [0.0, 1.0, 1.5]
    np.testing.assert_array_equal(both["x"], [1, 2, np.nan])
    np.testing.assert_array_equal(both["y"], [np.nan, np.nan, 9])


def test_the_history_of_a_run_is_what_its_file_holds(tmp_path):
    twelve_grains.run(twelve_grains.scene(), tmp_path / "out")
    header, rows = twelve_grains.history(tmp_path / "out")
    history = runs.read(tmp_path / "out").history
    assert list(history) == header
    np.testing.assert_array_equal(np.transpose(list(history.values())), rows)
    assert f"{len(rows)} rows to 0.006 s" in repr(history)
