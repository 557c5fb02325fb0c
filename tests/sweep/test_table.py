"""Rows of a sweep: from files, grids and samples; what is wrong is reported with its line and column."""

import numpy as np
import pytest

from warpdem import SceneError
from warpdem.sweep.table import grid, overrides, read_table, samples, split_values


def written(folder, text):
    path = folder / "t.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_table_is_read_and_what_it_leaves_empty_is_left(tmp_path):
    text = '\ufeffpairs.0.friction, note on it,frame.rate\n0.1,first,"10 rpm"\n\n0.2,,\n,x,"[1, 2]"\n'
    rows = read_table(written(tmp_path, text))
    assert rows[0] == {"pairs.0.friction": "0.1", "note on it": "first", "frame.rate": "10 rpm"}
    assert [overrides(row) for row in rows] == [
        ["pairs.0.friction=0.1", "frame.rate=10 rpm"], ["pairs.0.friction=0.2"], ["frame.rate=[1, 2]"]
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("text", "said"),
    [("", "must have a line that names the columns"), ("time.end\n", "one or more rows"),
     ("tim.end\n1\n", 'did you mean "time"'),
     ("friction\n1\n", "is no key of a scene"), ("time.end,time.end\n1,2\n", "column 2 repeats 'time.end'"),
     ("time.end,\n1,2\n", "column 2 has no name"), ("time.end\n1\n\n1,2\n", "line 4 has 2 values, the header 1 names")],
)  # fmt: skip
def test_what_is_no_table_is_told(tmp_path, text, said):
    path = written(tmp_path, text)
    with pytest.raises(SceneError, match=said) as error:
        read_table(path)
    assert str(error.value).startswith(str(path))


def test_a_file_that_is_no_text_or_not_there_is_told(tmp_path):
    (tmp_path / "b.csv").write_bytes(b"\xff\xfe\x00")
    for name in ("b.csv", "none.csv"):
        with pytest.raises(SceneError, match="cannot be read as a table"):
            read_table(tmp_path / name)


def test_a_grid_has_all_combinations():
    rows = grid(["pairs.0.friction=0.1,0.3", "frame.axis=[0, 0, 1],[1,0,0]", "title='a,b'"])
    assert [row["pairs.0.friction"] for row in rows] == ["0.1", "0.1", "0.3", "0.3"]
    assert [row["frame.axis"] for row in rows] == ["[0, 0, 1]", "[1,0,0]"] * 2
    assert {row["title"] for row in rows} == {"'a,b'"}
    assert split_values('{ a = 1, b = [2, 3] },"x,y",z') == ["{ a = 1, b = [2, 3] }", '"x,y"', "z"]


@pytest.mark.parametrize("choice", ["time.end", "=1", "time.end=", "time.end=1,,2"])
def test_what_is_no_choice_is_told(choice):
    with pytest.raises(SceneError, match="must be KEY=VALUE,VALUE"):
        grid([choice])


def test_too_large_a_grid_is_told():
    with pytest.raises(SceneError, match="1000000 combinations; at most 100000"):
        grid([f"walls.{k}.scale=" + ",".join("1234567890") for k in range(6)])


def test_samples_fill_their_ranges_evenly_and_are_the_same_each_time():
    """One value in each tenth of every range, on its scale."""
    ranges = ["pairs.0.friction=0.1:0.9", "materials.g.young_modulus=1:100 MPa:log"]
    rows = samples(ranges, 10, 3)
    friction = np.array([float(row["pairs.0.friction"]) for row in rows])
    assert sorted(np.floor((friction - 0.1) / 0.08).astype(int)) == list(range(10))
    modulus = [row["materials.g.young_modulus"] for row in rows]
    assert all(text.startswith('"') and text.endswith(' MPa"') for text in modulus)
    logs = np.log10([float(text[1:].split()[0]) for text in modulus])
    assert sorted(np.floor(logs / 0.2).astype(int)) == list(range(10))
    assert samples(ranges, 10, 3) == rows != samples(ranges, 10, 4)
    assert abs(np.corrcoef(friction, logs)[0, 1]) < 0.9


@pytest.mark.parametrize(
    ("text", "said"),
    [("time.end=1", "must be KEY=LOW:HIGH"), ("time.end=a:2", "must be"), ("time.end=1:2:lin", "must be KEY"),
     ("time.end=2:1", "the lesser number must come first"), ("time.end=0:1:log", "above 0 for log"),
     ("frame.rate=1 rpm:2 rad/s", "two units, 'rpm' and 'rad/s'"), ("tim=1:2", "is no key of a scene")],
)  # fmt: skip
def test_what_is_no_range_is_told(text, said):
    with pytest.raises(SceneError, match=said):
        samples([text], 3, 0)


@pytest.mark.parametrize("count", [0, -1, 10**6])
def test_a_count_out_of_bounds_is_told(count):
    with pytest.raises(SceneError, match="must be from 1 to 100000"):
        samples(["time.end=1:2"], count, 0)
