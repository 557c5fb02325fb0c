"""The lock of a run on its output folder: two runs never write into one folder.

A run holds an exclusive lock of the operating system on a small file in its folder. The system releases the lock however the
run ends, so that a run that was killed, or whose machine failed, blocks no other. The file names the owner of the lock and is
removed with the run. A lock does not depend on process numbers, which mean nothing on another host. Only on a file system
without locks the content of the file decides.
"""

import errno
import json
import os
import platform
import stat
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import datetime
from pathlib import Path
from typing import Any

import psutil

from warpdem.core.atomic_file import not_written
from warpdem.errors import OutputError, SceneError

try:
    import fcntl
except ImportError:  # not a POSIX system
    fcntl = None  # type: ignore[assignment]

LOCK = ".running"
"""The file that is locked; its content is for users, and for file systems without locks."""
ATTEMPTS = 100  # at each attempt another run may remove the file at the same moment
LOCK_ATTEMPTS = 5  # at a lock that another process holds
NO_LOCKS = {errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP, errno.EINVAL}


class FolderLocked(SceneError):
    """Another run writes into ``folder``, or has left its results there."""

    def __init__(self, folder: Path, message: str) -> None:
        super().__init__(message)
        self.folder = folder


class RunLock:
    """An exclusive lock on the folder that a run writes into."""

    def __init__(self, folder: Path, descriptor: int) -> None:
        self.folder = folder
        self._descriptor = descriptor
        self._identity = _identity(os.fstat(descriptor))

    def check(self) -> None:
        """Check that the folder was not removed, or created again by another run, whose files must not be changed.

        Raises:
            OutputError: The folder was removed, or belongs to another run.
        """
        try:
            current = _identity(os.stat(self.folder / LOCK))
        except OSError as error:
            if not self.folder.is_dir():
                raise OutputError(f"{self.folder}: was removed during the run ({error.strerror})") from error
            return  # only the file was removed: no other run has locked the folder
        if current != self._identity:
            raise OutputError(f"{self.folder}: was removed, and now belongs to another run ({_owner_text(self.folder)})")

    def release(self) -> None:
        """Release the lock and remove its file."""
        with suppress(OSError):
            if _identity(os.stat(self.folder / LOCK)) == self._identity:
                (self.folder / LOCK).unlink()  # while it is locked: no other run can hold it
        if fcntl is not None:
            with suppress(OSError):
                fcntl.flock(self._descriptor, fcntl.LOCK_UN)  # a process forked meanwhile would keep the lock
        os.close(self._descriptor)


@contextmanager
def locked(folder: Path) -> Iterator[RunLock]:
    """Create ``folder`` if necessary and lock it for the block; folders created here that are empty at the end are removed.

    Raises:
        FolderLocked: Another run writes into it.
        OutputError: The system refuses to create the folder, or a file in it.
    """
    lock, created = _acquire(Path(folder))
    try:
        yield lock
    finally:
        lock.release()
        _remove_empty(created)


def is_locked(folder: Path) -> bool:
    """Whether a run writes into ``folder``, or a run on another host has not recorded its end."""
    try:
        require_unlocked(folder)
    except FolderLocked:
        return True
    return bool(_owner(folder).get("host", platform.node()) != platform.node())


def is_abandoned(folder: Path) -> bool:
    """Whether no run writes into ``folder``; false where that is unknown."""
    lock = folder / LOCK
    return not is_locked(folder) and (not lock.exists() or os.access(lock, os.R_OK | os.W_OK))


def require_unlocked(folder: Path) -> None:
    """Refuse a folder that another run writes into; nothing is written.

    Raises:
        FolderLocked: Another run writes into it; the message names its process and host.
    """
    try:
        descriptor = os.open(folder / LOCK, os.O_RDWR)
    except OSError:
        return
    try:
        _lock(descriptor, folder, new=False)
    finally:
        os.close(descriptor)


def _acquire(folder: Path) -> tuple[RunLock, list[Path]]:
    """The lock, and the folders created for it, outermost first."""
    created: list[Path] = []
    last: OSError | None = None
    for _ in range(ATTEMPTS):
        descriptor = None
        try:
            _create(folder, created)
            descriptor, new = _open(folder / LOCK)
            _lock(descriptor, folder, new)
            if _identity(os.fstat(descriptor)) != _identity(os.stat(folder / LOCK)):
                raise FileNotFoundError  # the previous owner has just removed it
            _write_owner(descriptor)
            return RunLock(folder, descriptor), created
        except FileNotFoundError as error:  # removed meanwhile by a run that ended or was refused
            _close(descriptor)
            last = error
        except BaseException as error:
            _close(descriptor)
            _remove_empty(created)
            if isinstance(error, OSError):
                raise not_written(folder, error) from error
            raise
    raise not_written(folder, last)


def _create(folder: Path, created: list[Path]) -> None:
    """Create ``folder`` and its parents; appends the new folders to ``created``, outermost first.

    Raises:
        FileNotFoundError: A folder that existed was removed meanwhile, by a run that ended.
    """
    for path in reversed([folder, *folder.parents]):
        try:
            path.mkdir()
        except FileExistsError:
            if not stat.S_ISDIR(path.stat().st_mode):
                raise
        except OSError:  # on some file systems the answer for a folder in which nothing can be created
            if not path.is_dir():
                raise
        else:
            created.append(path)


def _remove_empty(folders: list[Path]) -> None:
    """Remove those of the folders, outermost first, that are empty; one that was created twice stands there twice."""
    for path in reversed(folders):
        with suppress(OSError):
            path.rmdir()


def _open(path: Path) -> tuple[int, bool]:
    """Descriptor of the file opened for locking, and whether it is new."""
    try:
        return os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o644), True
    except FileExistsError:
        return os.open(path, os.O_RDWR), False


def _close(descriptor: int | None) -> None:
    if descriptor is not None:
        os.close(descriptor)


def _lock(descriptor: int, folder: Path, new: bool) -> None:
    """Lock the open file in ``folder``, which is ``new`` or may belong to another run.

    Raises:
        FolderLocked: Another run holds the lock.
    """
    for left in reversed(range(LOCK_ATTEMPTS)) if fcntl is not None else ():
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return
        except OSError as error:
            if error.errno in NO_LOCKS:
                break
            if error.errno not in (errno.EWOULDBLOCK, errno.EACCES):
                raise
            if not left:
                raise _locked_error(folder) from None
        time.sleep(0.02)  # a process that only checks the lock holds it for a moment
    if not new and _may_be_running(_owner(folder)):
        raise _locked_error(folder, f"; if that run no longer exists, remove {folder / LOCK}")


def _may_be_running(owner: dict[str, Any]) -> bool:
    """Whether the owner named by a file, on a file system without locks, may still be running."""
    if owner.get("host") != platform.node():
        return True
    try:
        return bool(psutil.Process(owner["process"]).create_time() == owner["began"])
    except (psutil.Error, KeyError, TypeError):
        return False


def _write_owner(descriptor: int) -> None:
    """Write the owner of the lock to the locked file."""
    own = psutil.Process()
    since = f"{datetime.now():%Y-%m-%d %H:%M:%S}"
    owner = {"process": own.pid, "host": platform.node(), "since": since, "began": own.create_time()}
    os.ftruncate(descriptor, 0)
    os.pwrite(descriptor, (json.dumps(owner) + "\n").encode(), 0)


def _owner(folder: Path) -> dict[str, Any]:
    """Owner of the lock by the file in ``folder``; empty if it holds none."""
    try:
        found = json.loads((folder / LOCK).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def _owner_text(folder: Path) -> str:
    owner = _owner(folder)
    if not {"process", "host", "since"} <= owner.keys():
        return "which has just started"
    return f"process {owner['process']} on {owner['host']}, since {owner['since']}"


def _locked_error(folder: Path, remedy: str = "") -> FolderLocked:
    text = f"--out {folder}: another run is writing there ({_owner_text(folder)}); take another folder, or end that run first"
    return FolderLocked(folder, text + remedy)


def _identity(status: os.stat_result) -> tuple[int, int]:
    return status.st_dev, status.st_ino
