"""A file that goes from one whole state to the next: HDF5 writes in any order, a reader or a kill sees only what was committed.

HDF5 has no journal: a process killed while its library writes leaves a file that may not open, and on a full disk the library
cannot even close one. Here it writes to memory, and ``commit`` brings that to disk: first what lies beyond the old end, which
nothing refers to yet, then the changed pages of the rest, from a journal beside the file that the next opening repeats
if a kill came in between.
"""

import io
import os
import struct
import zlib
from pathlib import Path

from warpdem.core.atomic_file import not_written, replaced

PAGE = 4096  # [B] a kill does not tear a write of one page
_HEAD = struct.Struct("<II")  # checksum and length of the journal's rest
_ENTRY = struct.Struct("<QI")  # place in the file and length of a page


def journal_of(path: Path) -> Path:
    """Journal of a file."""
    return path.with_name(f".{path.name}.journal")


def repair(path: Path) -> None:
    """Finish what a kill may have left half done."""
    journal = journal_of(path)
    if not journal.exists():
        return
    data = journal.read_bytes()
    checksum, length = _HEAD.unpack_from(data.ljust(_HEAD.size, b"\0"))
    rest = data[_HEAD.size :]
    if len(rest) == length and zlib.crc32(rest) == checksum:
        with open(path, "r+b") as file:
            at = 0
            while at < length:
                place, size = _ENTRY.unpack_from(rest, at)
                at += _ENTRY.size
                os.pwrite(file.fileno(), rest[at : at + size], place)
                at += size
    journal.unlink()


class JournaledFile(io.RawIOBase):
    """What ``h5py.File`` takes as a file; see the module."""

    def __init__(self, path: Path, *, resume: bool = False):
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
        self._old = os.fstat(self._file.fileno()).st_size  # what is on disk
        self._pages: dict[int, bytearray] = {}  # changed pages below the old end, by number
        self._tail, self._new = bytearray(), 0  # what lies beyond it, in memory that is kept for the next time, and its length
        self._at = 0

    def commit(self) -> None:
        """Bring all that was written since the last commit to disk.

        Raises:
            OutputError: The system refuses; the file is as it was after the last commit.
        """
        try:
            _write(self._file.fileno(), memoryview(self._tail)[: self._new], self._old)
            pages = [(number * PAGE, bytes(page)) for number, page in sorted(self._pages.items())]
            if pages:
                rest = b"".join(_ENTRY.pack(place, len(page)) + page for place, page in pages)
                with replaced(journal_of(self._path)) as part:
                    part.write_bytes(_HEAD.pack(zlib.crc32(rest), len(rest)) + rest)
                for place, page in pages:
                    _write(self._file.fileno(), page, place)
                journal_of(self._path).unlink()
        except OSError as error:
            raise not_written(self._path, error) from error
        self._old += self._new
        self._pages, self._new = {}, 0

    def close(self) -> None:
        """Close the file; what was not committed is dropped."""
        self._file.close()
        super().close()

    # -- what HDF5 calls ------------------------------------------------------------------------

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
        """Go to a place [B]."""
        base = {os.SEEK_SET: 0, os.SEEK_CUR: self._at, os.SEEK_END: self._old + self._new}[whence]
        self._at = base + offset
        return self._at

    def tell(self) -> int:
        """The present place [B]."""
        return self._at

    def truncate(self, size: int | None = None) -> int:
        """Make the file ``size`` [B] long; what is on disk already only ever grows."""
        size = self._at if size is None else size
        length = max(size - self._old, 0)
        self._make_room(length)
        self._new = length
        return size

    def write(self, data) -> int:
        """Take over ``data`` at the present place; returns its length [B]."""
        data = memoryview(data).cast("B")
        size = len(data)
        below = min(max(self._old - self._at, 0), size)
        done = 0
        while done < below:
            number, first = divmod(self._at + done, PAGE)
            part = min(PAGE - first, below - done)
            page = self._page(number)
            page[first : first + part] = data[done : done + part]
            done += part
        if size > below:
            first = self._at + below - self._old
            last = first + size - below
            self._make_room(last, first)
            self._tail[first:last] = data[below:]
            self._new = max(self._new, last)
        self._at += size
        return size

    def readinto(self, buffer) -> int:
        """Fill ``buffer`` from the present place; returns how much there was [B]."""
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

    def _make_room(self, length: int, used_from: int | None = None) -> None:
        """Memory for ``length`` bytes beyond the old end; what comes in new before ``used_from``, default all, is zero."""
        if length > len(self._tail):
            self._tail.extend(bytes(max(length, 2 * len(self._tail)) - len(self._tail)))
        gap = (length if used_from is None else used_from) - self._new
        if gap > 0:
            self._tail[self._new : self._new + gap] = bytes(gap)

    def _page(self, number: int) -> bytearray:
        """A page below the old end, held in memory from its first change on."""
        if number not in self._pages:
            length = min(PAGE, self._old - number * PAGE)
            self._pages[number] = bytearray(os.pread(self._file.fileno(), length, number * PAGE))
        return self._pages[number]


def _write(descriptor: int, data: bytes | memoryview, place: int) -> None:
    """Write all of ``data`` at ``place`` [B]: the system may take it in parts."""
    view = memoryview(data)
    while len(view):
        done = os.pwrite(descriptor, view, place)
        view, place = view[done:], place + done
