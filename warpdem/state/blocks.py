"""Arrays that are made block by block while they are written, and the file that they are written to.

A checkpoint holds the arrays of a run in another order than memory does. Brought in order as a whole they would take the run's
memory a second time, and a file that is made in memory a third time.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import IO, Any

import numpy as np

BLOCK = 2**20
"""Size of a block [B]."""


@dataclass(frozen=True)
class Rows:
    """An array whose rows are made when they are written."""

    shape: tuple[int, ...]
    """Its shape; the first number counts the rows."""
    dtype: np.dtype
    """Type of its numbers."""
    part: Callable[[slice], np.ndarray]
    """Gives the rows of a slice of whole numbers, start and stop within the array."""

    @classmethod
    def picked(cls, values: np.ndarray, index: np.ndarray) -> "Rows":
        """The rows ``values[index]``."""
        return cls((len(index), *values.shape[1:]), values.dtype, lambda part: values[index[part]])

    def whole(self) -> np.ndarray:
        """All rows at once."""
        return self.part(slice(0, self.shape[0]))


def made(values: Any) -> Any:
    """An array whose rows are made, or what is there."""
    return values.whole() if isinstance(values, Rows) else values


def each_block(values: Rows | np.ndarray) -> Iterator[tuple[slice, np.ndarray]]:
    """The rows of an array in blocks of about ``BLOCK`` bytes, each with the slice that it fills; none of an empty array."""
    count = values.shape[0]
    row = values.dtype.itemsize * int(np.prod(values.shape[1:]))
    if row == 0:
        return
    length = max(BLOCK // row, 1)
    for first in range(0, count, length):
        part = slice(first, min(first + length, count))
        yield part, values.part(part) if isinstance(values, Rows) else values[part]


class FileSink:
    """A file for HDF5 to write to, which reports no failure before HDF5 has closed it: it cannot close a file on a full disk.

    Args:
        file: open for writing and reading, without a buffer of its own.
    """

    def __init__(self, file: IO[bytes]) -> None:
        self._file, self._failure = file, None  # type: IO[bytes], OSError | None

    def write(self, data: Any) -> int:
        """Write all of ``data``; nothing after the first failure."""
        view = memoryview(data).cast("B")
        try:
            left = view
            while self._failure is None and len(left):
                left = left[self._file.write(left) :]
        except OSError as error:
            self._failure = error
        return len(view)

    def read(self, size: int) -> bytes:
        """``size`` bytes of what was written; zeros where a failure left nothing."""
        found = self._file.read(size)
        return found + bytes(size - len(found))

    def seek(self, offset: int, whence: int = 0) -> int:
        """As of a file."""
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        """As of a file."""
        return self._file.tell()

    def truncate(self, size: int) -> int:
        """Set the size of the file."""
        try:
            if self._failure is None:
                self._file.truncate(size)
        except OSError as error:
            self._failure = error
        return size

    def flush(self) -> None:
        """Nothing is held back."""

    def raise_failure(self) -> None:
        """Raise the first failure, if there was one.

        Raises:
            OSError: something could not be written.
        """
        if self._failure is not None:
            raise self._failure
