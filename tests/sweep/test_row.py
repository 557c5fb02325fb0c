"""What the folder of a row says."""

import json

import pytest

from warpdem.sweep.row import folder_of, status_of, why, write_result


def test_folders_are_numbered(tmp_path):
    assert folder_of(tmp_path, 7).name == "0007" and folder_of(tmp_path, 12345).name == "12345"


@pytest.mark.parametrize(
    ("record", "code", "status", "reason"),
    [(None, None, "waiting", ""), ("running", None, "running", ""), ("done", 0, "done", ""), ("running", -9, "crashed", "said"),
     ("running", 1, "crashed", "said"), ("stopped itself", 3, "stopped itself", "said"), (None, 2, "wrong", "said"),
     ("interrupted", None, "interrupted", ""), (None, 1, "crashed", "said")],
)  # fmt: skip
def test_status(tmp_path, record, code, status, reason):
    if record:
        (tmp_path / "run.json").write_text(json.dumps({"status": record}))
    if code is not None:
        write_result(tmp_path, code, "said")
    assert status_of(tmp_path) == status and why(tmp_path) == reason


def test_files_that_cannot_be_read_are_as_none(tmp_path):
    (tmp_path / "run.json").write_text("{")
    (tmp_path / "result.json").write_text("[1]")
    assert status_of(tmp_path) == "waiting" and why(tmp_path) == ""
