"""The claim on a folder: one run at a time, given up however a run ends, and nothing left behind."""

import errno
import json
import os
import platform
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import psutil
import pytest

from warpdem.core import run_lock
from warpdem.core.run_lock import LOCK, FolderLocked, is_locked, locked, require_unlocked
from warpdem.errors import OutputError

HOLD = """
import sys
from pathlib import Path
from warpdem.core.run_lock import locked
with locked(Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def holder(tmp_path):
    """A process that holds the folder ``out``."""
    process = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(tmp_path / "out")], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout.readline() == "held\n"
    yield process
    process.kill()
    process.communicate()


def test_a_folder_of_another_process_is_refused_with_its_name(holder, tmp_path):
    assert is_locked(tmp_path / "out")
    for look in (require_unlocked, lambda folder: locked(folder).__enter__()):
        with pytest.raises(FolderLocked, match=f"process {holder.pid} on {platform.node()}, since 2"):
            look(tmp_path / "out")
    assert [path.name for path in (tmp_path / "out").iterdir()] == [LOCK]


def test_a_killed_owner_keeps_nobody_out(holder, tmp_path):
    holder.kill()
    holder.wait()
    assert (tmp_path / "out" / LOCK).exists()
    assert not is_locked(tmp_path / "out")
    require_unlocked(tmp_path / "out")
    with locked(tmp_path / "out"):
        assert json.loads((tmp_path / "out" / LOCK).read_text())["process"] == os.getpid()
    assert list((tmp_path / "out").iterdir()) == []  # the folder was there before


def test_an_owner_that_ends_leaves_nothing(holder, tmp_path):
    holder.communicate("")
    assert list(tmp_path.iterdir()) == []


def test_what_was_made_goes_if_it_is_empty(tmp_path):
    with locked(tmp_path / "a" / "b" / "c"):
        pass
    assert list(tmp_path.iterdir()) == []
    with locked(tmp_path / "a" / "b"):
        (tmp_path / "a" / "b" / "result").touch()
    assert [path.name for path in (tmp_path / "a" / "b").iterdir()] == ["result"]


def test_many_at_once_have_it_one_at_a_time(tmp_path):
    """Each makes and removes the folder of the others all the time."""
    inside, most, got = [], [], []

    def one(number: int) -> None:
        for _ in range(30):
            try:
                with locked(tmp_path / "out" / "bed"):
                    inside.append(number)
                    most.append(len(inside))
                    inside.remove(number)
                    got.append(number)
            except FolderLocked:
                pass

    with ThreadPoolExecutor(8) as pool:
        list(pool.map(one, range(8)))
    assert max(most) == 1 and len(got) >= 8
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


def test_a_folder_removed_as_it_was_found_is_created_again(tmp_path, monkeypatch):
    """Another run ends between the refusal to create its folder and the look at what stands there."""
    real, refused, folder = Path.mkdir, [], tmp_path / "out" / "bed"

    def mkdir(path, *args, **kwargs):
        if path == folder and len(refused) < 3:
            refused.append(path)
            raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(path))
        real(path, *args, **kwargs)

    monkeypatch.setattr(Path, "mkdir", mkdir)
    with locked(folder):
        assert is_locked(folder)
    assert len(refused) == 3 and list(tmp_path.iterdir()) == []


def test_a_file_in_place_of_the_folder_is_named(tmp_path):
    (tmp_path / "out").touch()
    with pytest.raises(OutputError, match="out: cannot be written .File exists."), locked(tmp_path / "out"):
        pass
    assert (tmp_path / "out").is_file()


def test_a_lock_that_its_owner_has_just_removed_is_none(tmp_path, monkeypatch):
    """Opened before it went and locked after: the next one that comes would make a file of its own."""
    real, removed = run_lock._lock, []

    def lock(descriptor, folder, new):
        real(descriptor, folder, new)
        if not removed:
            removed.append((folder / LOCK).unlink())

    monkeypatch.setattr(run_lock, "_lock", lock)
    with locked(tmp_path):
        assert is_locked(tmp_path)


def test_who_only_looks_keeps_nobody_out(tmp_path):
    """A look has the lock for a moment."""
    (tmp_path / LOCK).touch()
    descriptor = os.open(tmp_path / LOCK, os.O_RDWR)
    run_lock.fcntl.flock(descriptor, run_lock.fcntl.LOCK_EX)
    look = threading.Timer(0.03, lambda: run_lock.fcntl.flock(descriptor, run_lock.fcntl.LOCK_UN))
    look.start()
    with locked(tmp_path):
        pass
    os.close(descriptor)


def test_the_word_of_another_host_is_heeded_where_a_name_is_free_to_choose(tmp_path):
    (tmp_path / LOCK).write_text(json.dumps({"process": 1, "host": "elsewhere", "since": "then", "began": 0.0}))
    assert is_locked(tmp_path)
    with locked(tmp_path):  # asked for by name: its lock is free, so its run has ended
        pass


@pytest.fixture
def no_locks(monkeypatch):
    """A file system without locks."""

    def refuse(*_):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(run_lock.fcntl, "flock", refuse)


def owner(**changes) -> str:
    me = psutil.Process()
    return json.dumps({"process": me.pid, "host": platform.node(), "since": "then", "began": me.create_time()} | changes)


@pytest.mark.parametrize(
    ("says", "taken"),
    [(owner(), True), (owner(began=1.0), False), (owner(host="elsewhere"), True), ("", True)],
    ids=["alive", "another process of that number", "on another host", "has not said yet"],
)
def test_without_locks_the_words_of_the_owner_decide(tmp_path, no_locks, says, taken):
    (tmp_path / LOCK).write_text(says)
    if taken:
        with pytest.raises(FolderLocked, match=f"if that run no longer exists, remove .*{LOCK}"):
            locked(tmp_path).__enter__()
    else:
        with locked(tmp_path):
            pass


def test_without_locks_a_new_file_is_a_claim(tmp_path, no_locks):
    with locked(tmp_path / "out"), pytest.raises(FolderLocked):
        locked(tmp_path / "out").__enter__()


@pytest.mark.parametrize("number", [errno.EROFS, errno.EACCES, errno.ENOSPC])
def test_a_folder_that_cannot_be_made_is_named(tmp_path, monkeypatch, number):
    real = os.open

    def refuse(path, *rest):
        if str(path).endswith(LOCK):
            raise OSError(number, os.strerror(number))
        return real(path, *rest)

    monkeypatch.setattr(os, "open", refuse)
    with pytest.raises(OutputError, match=rf"out: cannot be written \({os.strerror(number)}\)"):
        locked(tmp_path / "out").__enter__()
    assert list(tmp_path.iterdir()) == []
