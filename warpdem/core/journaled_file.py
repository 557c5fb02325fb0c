"""A file that changes from one complete state to the next: a reader, also after a kill, sees only committed states.

HDF5 writes in any order and has no journal: a process killed while its library writes leaves a file that may not open, and on a
full disk the library cannot even close a file. Here it writes to memory, and ``commit`` brings the changes to disk: first the
data beyond the old end, which nothing refers to yet, then the changed pages before it, by a journal beside the file. If the
process is killed in between, the next opening replays the journal.
"""

import io
import os
import struct
import zlib
from pathlib import Path
from typing import TYPE_CHECKING

from warpdem.core.atomic_file import not_written, replaced

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer, WriteableBuffer

PAGE = 4096  # [B] a kill does not tear a write of one page
_HEAD = struct.Struct("<II")  # checksum and length of the journal's rest
_ENTRY = struct.Struct("<QI")  # offset in the file and length of a page


def journal_of(path: Path) -> Path:
    """Journal of a file."""
    return path.with_name(f".{path.name}.journal")


def repair(path: Path) -> None:
    """Replay the journal that a killed process may have left."""
    journal = journal_of(path)
    if not journal.exists():
        return
    data = journal.read_bytes()
    checksum, length = _HEAD.unpack_from(data.ljust(_HEAD.size, b"\0"))
    rest = data[_HEAD.size :]
    if len(rest) == length and zlib.crc32(rest) == checksum:
        with open(path, "r+b") as file:
            position = 0
            while position < length:
                offset, size = _ENTRY.unpack_from(rest, position)
                position += _ENTRY.size
                os.pwrite(file.fileno(), rest[position : position + size], offset)
                position += size
    journal.unlink()


class JournaledFile(io.RawIOBase):
    """A file object for ``h5py.File`` that writes by commits; see the module."""

    def __init__(self, path: Path, *, resume: bool = False) -> None:
        """Open ``path``, with its content if ``resume``, else empty.

        Raises:
            OutputError: It cannot be opened for writing.
        """
        self._path = Path(path)
        try:
            if resume:
                repair(self._path)
            else:
                journal_of(self._path).unlink(missing_ok=True)
            self._file = open(self._path, "r+b" if resume else "w+b", buffering=0)
        except OSError as error:
            raise not_written(self._path, error) from error
        self._old = os.fstat(self._file.fileno()).st_size  # length on disk
        self._pages: dict[int, bytearray] = {}  # changed pages below the old end, by number
        self._tail, self._new = bytearray(), 0  # data beyond the old end, its buffer kept for reuse, and its length
        self._at = 0

    def commit(self) -> None:
        """Write all changes since the last commit to disk.

        Raises:
            OutputError: The system refuses; the file is in the state of the last commit.
        """
        try:
            _write(self._file.fileno(), memoryview(self._tail)[: self._new], self._old)
            pages = [(number * PAGE, bytes(page)) for number, page in sorted(self._pages.items())]
            if pages:
                rest = b"".join(_ENTRY.pack(offset, len(page)) + page for offset, page in pages)
                with replaced(journal_of(self._path)) as part:
                    part.write_bytes(_HEAD.pack(zlib.crc32(rest), len(rest)) + rest)
                for offset, page in pages:
                    _write(self._file.fileno(), page, offset)
                journal_of(self._path).unlink()
        except OSError as error:
            raise not_written(self._path, error) from error
        self._old += self._new
        self._pages, self._new = {}, 0

    def close(self) -> None:
        """Close the file; uncommitted changes are dropped."""
        self._file.close()
        super().close()

    # -- called by HDF5 ------------------------------------------------------------------------

    def readable(self) -> bool:
        """True."""
        return True

    def writable(self) -> bool:
        """True."""
        return True

    def seekable(self) -> bool:
        """True."""
        return True

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Set the file position [B]."""
        base = {os.SEEK_SET: 0, os.SEEK_CUR: self._at, os.SEEK_END: self._old + self._new}[whence]
        self._at = base + offset
        return self._at

    def tell(self) -> int:
        """The file position [B]."""
        return self._at

    def truncate(self, size: int | None = None) -> int:
        """Set the length of the file to ``size`` [B]; the part on disk never shrinks."""
        size = self._at if size is None else size
        length = max(size - self._old, 0)
        self._reserve(length)
        self._new = length
        return size

    def write(self, data: "ReadableBuffer") -> int:
        """Write ``data`` at the file position; returns its length [B]."""
        view = memoryview(data).cast("B")
        size = len(view)
        below = min(max(self._old - self._at, 0), size)
        done = 0
        while done < below:
            number, first = divmod(self._at + done, PAGE)
            part = min(PAGE - first, below - done)
            page = self._page(number)
            page[first : first + part] = view[done : done + part]
            done += part
        if size > below:
            first = self._at + below - self._old
            last = first + size - below
            self._reserve(last, first)
            self._tail[first:last] = view[below:]
            self._new = max(self._new, last)
        self._at += size
        return size

    def readinto(self, buffer: "WriteableBuffer") -> int:
        """Read into ``buffer`` from the file position; returns the number of bytes read."""
        out = memoryview(buffer).cast("B")
        size = min(len(out), max(self._old + self._new - self._at, 0))
        below = min(max(self._old - self._at, 0), size)
        if below:
            out[:below] = os.pread(self._file.fileno(), below, self._at)
            for number in range(self._at // PAGE, (self._at + below - 1) // PAGE + 1):
                if number in self._pages:
                    first, last = max(number * PAGE, self._at), min((number + 1) * PAGE, self._at + below)
                    out[first - self._at : last - self._at] = self._pages[number][first - number * PAGE : last - number * PAGE]
        if size > below:
            first = self._at + below - self._old
            out[below:size] = memoryview(self._tail)[first : first + size - below]
        self._at += size
        return size

    def _reserve(self, length: int, used_from: int | None = None) -> None:
        """Reserve ``length`` bytes beyond the old end; new bytes before ``used_from``, default all, are set to zero."""
        if length > len(self._tail):
            self._tail.extend(bytes(max(length, 2 * len(self._tail)) - len(self._tail)))
        gap = (length if used_from is None else used_from) - self._new
        if gap > 0:
            self._tail[self._new : self._new + gap] = bytes(gap)

    def _page(self, number: int) -> bytearray:
        """A page before the old end, held in memory from its first change on."""
        if number not in self._pages:
            length = min(PAGE, self._old - number * PAGE)
            self._pages[number] = bytearray(os.pread(self._file.fileno(), length, number * PAGE))
        return self._pages[number]


def _write(descriptor: int, data: bytes | memoryview, offset: int) -> None:
    """Write all of ``data`` at ``offset`` [B]: the system may accept it in parts."""
    view = memoryview(data)
    while len(view):
        done = os.pwrite(descriptor, view, offset)
        view, offset = view[done:], offset + done
