"""The claim of a run on the folder it writes to: two runs never write into one folder.

A run holds an exclusive lock of the system on a small file in its folder. The system releases it however the run ends, so
that a run that was killed, or went down with its machine, keeps nobody out. The file tells who holds it, and goes away with
the run. A lock needs no process numbers, which mean nothing on another host; only on a file system without locks the file's
words decide.
"""

import errno
import json
import os
import platform
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import datetime
from pathlib import Path

import psutil

from warpdem.core.atomic_file import not_written
from warpdem.errors import OutputError, SceneError

try:
    import fcntl
except ImportError:  # not a POSIX system
    fcntl = None

LOCK = ".running"
"""The file that is locked; what it says is for people, and for file systems without locks."""
TRIES = 100  # another run may remove what is locked at the same moment, each time anew
LOOKS = 5  # at a lock that somebody has
NO_LOCKS = {errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP, errno.EINVAL}


class FolderLocked(SceneError):
    """Another run writes into ``folder``, or has left its results there."""

    def __init__(self, folder: Path, message: str) -> None:
        super().__init__(message)
        self.folder = folder


class RunLock:
    """A folder that this run alone writes into, as long as it holds it."""

    def __init__(self, folder: Path, descriptor: int) -> None:
        self.folder = folder
        self._descriptor = descriptor
        self._identity = _identity(os.fstat(descriptor))

    def check(self) -> None:
        """Notice that the folder was removed, or made anew by another run, whose files must be left alone.

        Raises:
            OutputError: the folder is gone, or another run's.
        """
        try:
            there = _identity(os.stat(self.folder / LOCK))
        except OSError as error:
            if not self.folder.is_dir():
                raise OutputError(f"{self.folder}: was removed during the run ({error.strerror})") from error
            return  # somebody tidied up: nobody else has locked it
        if there != self._identity:
            raise OutputError(f"{self.folder}: was removed, and now belongs to another run ({_words(self.folder)})")

    def release(self) -> None:
        """Let others have the folder."""
        with suppress(OSError):
            if _identity(os.stat(self.folder / LOCK)) == self._identity:
                (self.folder / LOCK).unlink()  # while it is locked: nobody has it
        if fcntl is not None:
            with suppress(OSError):
                fcntl.flock(self._descriptor, fcntl.LOCK_UN)  # a process forked meanwhile would hold it on
        os.close(self._descriptor)


@contextmanager
def locked(folder: Path) -> Iterator[RunLock]:
    """Make ``folder`` if it is not there and hold it for the block; what was made and is still empty then is removed.

    Raises:
        FolderLocked: another run writes into it.
        OutputError: the system refuses to make the folder, or a file in it.
    """
    claim, made = _claim(Path(folder))
    try:
        yield claim
    finally:
        claim.release()
        with suppress(OSError):  # not empty: so are those above
            for path in reversed(made):
                path.rmdir()


def is_locked(folder: Path) -> bool:
    """Whether a run writes into ``folder``, or one on another host has not said that it ended."""
    try:
        require_unlocked(folder)
    except FolderLocked:
        return True
    return _owner(folder).get("host", platform.node()) != platform.node()


def require_unlocked(folder: Path) -> None:
    """Refuse a folder that a run writes into; nothing is written.

    Raises:
        FolderLocked: with the process and the host of that run.
    """
    try:
        descriptor = os.open(folder / LOCK, os.O_RDWR)
    except OSError:
        return
    try:
        _lock(descriptor, folder, new=False)
    finally:
        os.close(descriptor)


def _claim(folder: Path) -> tuple[RunLock, list[Path]]:
    """The claim, and the folders made for it, outermost first."""
    made: list[Path] = []
    for _ in range(TRIES):
        descriptor = None
        try:
            _make(folder, made)
            descriptor, new = _open(folder / LOCK)
            _lock(descriptor, folder, new)
            if _identity(os.fstat(descriptor)) != _identity(os.stat(folder / LOCK)):
                raise FileNotFoundError  # its owner has just removed it
            _write_owner(descriptor)
            return RunLock(folder, descriptor), made
        except FileNotFoundError as error:  # removed meanwhile by a run that ended, or was refused
            _close(descriptor)
            last = error
        except BaseException as error:
            _close(descriptor)
            for path in reversed(made):
                with suppress(OSError):
                    path.rmdir()
            if isinstance(error, OSError):
                raise not_written(folder, error) from error
            raise
    raise not_written(folder, last)


def _make(folder: Path, made: list[Path]) -> None:
    """Make ``folder`` and those above it; adds those that were not there to ``made``, outermost first."""
    for path in reversed([folder, *folder.parents]):
        try:
            path.mkdir()
        except OSError:  # there already, maybe where nothing can be made
            if not path.is_dir():
                raise
        else:
            made.append(path)


def _open(path: Path) -> tuple[int, bool]:
    """Open a file to lock it; whether it is new."""
    try:
        return os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o644), True
    except FileExistsError:
        return os.open(path, os.O_RDWR), False


def _close(descriptor: int | None) -> None:
    if descriptor is not None:
        os.close(descriptor)


def _lock(descriptor: int, folder: Path, new: bool) -> None:
    """Lock the open file in ``folder``, which is ``new`` or may be another run's.

    Raises:
        FolderLocked: another run has it.
    """
    for left in reversed(range(LOOKS)) if fcntl is not None else ():
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return
        except OSError as error:
            if error.errno in NO_LOCKS:
                break
            if error.errno not in (errno.EWOULDBLOCK, errno.EACCES):
                raise
            if not left:
                raise _taken(folder) from None
        time.sleep(0.02)  # who only looks whether the folder is taken has it for a moment
    if not new and _may_live(_owner(folder)):
        raise _taken(folder, f"; if there is no such run any more, remove {folder / LOCK}")


def _may_live(owner: dict) -> bool:
    """Whether the run that a file on a file system without locks tells of may still be there."""
    if owner.get("host") != platform.node():
        return True
    try:
        return psutil.Process(owner["process"]).create_time() == owner["began"]
    except (psutil.Error, KeyError, TypeError):
        return False


def _write_owner(descriptor: int) -> None:
    """Say whose the locked file is."""
    me = psutil.Process()
    since = f"{datetime.now():%Y-%m-%d %H:%M:%S}"
    owner = {"process": me.pid, "host": platform.node(), "since": since, "began": me.create_time()}
    os.ftruncate(descriptor, 0)
    os.pwrite(descriptor, (json.dumps(owner) + "\n").encode(), 0)


def _owner(folder: Path) -> dict:
    """What the file in ``folder`` says of its owner; empty if it says nothing."""
    try:
        found = json.loads((folder / LOCK).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def _words(folder: Path) -> str:
    owner = _owner(folder)
    if not {"process", "host", "since"} <= owner.keys():
        return "which has just begun"
    return f"process {owner['process']} on {owner['host']}, since {owner['since']}"


def _taken(folder: Path, remedy: str = "") -> FolderLocked:
    said = f"--out {folder}: another run is writing there ({_words(folder)}); take another folder, or end that run first"
    return FolderLocked(folder, said + remedy)


def _identity(status: os.stat_result) -> tuple[int, int]:
    return status.st_dev, status.st_ino
