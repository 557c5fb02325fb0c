"""Tables: every digit, every row on disk at once, resumed runs without doubled rows, JSON that any reader takes."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from warpdem.core.atomic_file import replaced
from warpdem.errors import WarpdemError
from warpdem.output.write_tables import HistoryWriter, write_run_record

COLUMNS = ["time [s]", "grains [-]", "kinetic energy [J]"]


def read(path):
    with open(path, newline="") as file:
        return list(csv.reader(file))


def test_history_row_is_on_disk_before_close_with_all_digits(tmp_path):
    writer = HistoryWriter(tmp_path / "history.csv", COLUMNS)
    writer.write([0.1 + 0.2, 7, np.float64(1.0) / 3.0])
    header, row = read(tmp_path / "history.csv")
    assert header == COLUMNS
    assert [float(row[0]), row[1], float(row[2])] == [0.1 + 0.2, "7", 1.0 / 3.0]
    writer.close()


def test_history_of_a_resumed_run_has_each_time_once(tmp_path):
    path = tmp_path / "history.csv"
    first = HistoryWriter(path, COLUMNS)
    for k in range(4):
        first.write([0.1 * k, k, 1.0])
    first.close()
    with open(path, "a") as file:
        file.write("0.4,")  # killed in the middle of a row
    second = HistoryWriter(path, COLUMNS, resume=True)
    second.write([0.1 * 2, 2, 5.0])
    second.close()
    assert [row[0] for row in read(path)] == ["time [s]", "0.0", "0.1", "0.2"]
    assert read(path)[-1][2] == "5.0"


def test_history_row_cut_within_its_last_number_is_no_row(tmp_path):
    path = tmp_path / "history.csv"
    path.write_text(",".join(COLUMNS) + "\n0.1,1,2.5\n0.2,2,3.")
    HistoryWriter(path, COLUMNS, resume=True).close()
    assert [row[0] for row in read(path)] == ["time [s]", "0.1"]


def test_history_without_resume_starts_anew(tmp_path):
    path = tmp_path / "history.csv"
    for _ in range(2):
        writer = HistoryWriter(path, COLUMNS)
        writer.write([0.5, 1, 1.0])
        writer.close()
    assert len(read(path)) == 2


def test_history_refuses_to_resume_other_columns(tmp_path):
    path = tmp_path / "history.csv"
    HistoryWriter(path, ["time [s]", "mass [kg]"]).close()
    with pytest.raises(WarpdemError, match=r"history\.csv.*mass \[kg\].*kinetic energy"):
        HistoryWriter(path, COLUMNS, resume=True)


def test_history_row_of_wrong_length_is_refused(tmp_path):
    with pytest.raises(ValueError, match="2 values for 3 columns"):
        HistoryWriter(tmp_path / "history.csv", COLUMNS).write([0.0, 1.0])


def test_run_record_holds_numpy_paths_and_no_invalid_numbers(tmp_path):
    data = {"hash": "ab", "steps": np.int64(3), "limit": [np.inf, 0.1], "axis": np.arange(3.0), "mesh": Path("a/b.stl")}
    write_run_record(tmp_path / "run.json", data)
    text = (tmp_path / "run.json").read_text()
    assert json.loads(text, parse_constant=pytest.fail) == {
        "hash": "ab",
        "steps": 3,
        "limit": [None, 0.1],
        "axis": [0.0, 1.0, 2.0],
        "mesh": str(Path("a/b.stl")),
    }


def test_replaced_keeps_the_old_file_when_writing_fails(tmp_path):
    path = tmp_path / "run.json"
    path.write_text("old")
    with pytest.raises(RuntimeError), replaced(path) as part:
        part.write_text("ne")
        raise RuntimeError
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["run.json"]
