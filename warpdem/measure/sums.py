"""Launches of what is read off a run (``kernels.measure.readings``): over the threads of the run, with exact sums.

Arrays that these launches need are kept from one reading to the next.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import warp as wp

from warpdem.core.recorded_launch import RecordedLaunch
from warpdem.core.threads import Threads, ranges
from warpdem.kernels.measure import readings as kernels
from warpdem.kernels.measure.exact_sum import WIDTH
from warpdem.state.view import RunView

SPREAD = 64  # rows of sums on a GPU, so that few threads meet in the same number
LEAST = 512  # indices below which one thread does it


def reader_of(view: RunView) -> "Reader":
    """Launches on the device of what is read of a run."""
    kept = view.kept.get("reader")
    if kept is None:
        device = view.state.record.device
        assert device is not None
        kept = view.kept["reader"] = Reader(device, view.threads)
    return kept


def load_readers(device: wp.Device | str) -> None:
    """Load the kernels that read, compiled where Warp's cache lacks them; else the first reading does."""
    wp.load_module(kernels.rounded_sums.module, device=device)


class Reader:
    """Launches on one device; what it launches only reads.

    Args:
        device: where the arrays are.
        threads: CPU threads; None: the caller's own alone, as for a copy that is read beside the steps.

    Attributes:
        rows: rows of sums that are added to side by side.
        no_slots: an array of no slots, shape (0,), int32.
    """

    def __init__(self, device: wp.Device, threads: Threads | None = None) -> None:
        self._device = device
        self._threads = threads if threads is not None and device.is_cpu else None
        self.rows = SPREAD if device.is_cuda else self._threads.count if self._threads is not None else 1
        self._spread = self.rows if device.is_cuda else 1
        self._kept: dict[str, tuple[Any, wp.array]] = {}
        self._values: dict[str, np.ndarray] = {}
        self._commands: dict[tuple[wp.Kernel, int | str], RecordedLaunch] = {}
        self._nothing: wp.array = wp.zeros((0, 0), dtype=wp.float64, device=device)
        self.no_slots: wp.array = wp.zeros(0, dtype=wp.int32, device=device)

    def plain(self, name: str, array: wp.array) -> wp.array:
        """An array of vectors as one of float64 numbers, of one dimension more; kept under ``name`` while it is the same."""
        size = wp.types.type_size_in_bytes(array.dtype) // 8
        return self._view(name, array, (*array.shape, size), wp.float64)

    def flat(self, name: str, array: wp.array) -> wp.array:
        """An array of int32 as one of one dimension; kept under ``name`` while it is the same."""
        return self._view(name, array, (array.size,), wp.int32)

    def _view(self, name: str, array: wp.array, shape: tuple[int, ...], dtype: type) -> wp.array:
        key, (found, view) = (array.ptr, shape), self._kept.get(name, (None, self._nothing))
        if found != key:
            view = wp.array(ptr=array.ptr, shape=shape, dtype=dtype, device=self._device)
            self._kept[name] = key, view
        return view

    def buffer(self, name: str, shape: tuple[int, ...], dtype: type) -> wp.array:
        """An array whose content is not set, kept under ``name``."""
        key, (found, array) = (shape, dtype), self._kept.get(name, (None, self._nothing))
        if found != key:
            array = wp.zeros(shape, dtype=dtype, device=self._device)
            self._kept[name] = key, array
        return array

    def each(self, kernel: wp.Kernel, count: int, *inputs: Any) -> None:
        """Launch ``kernel`` over ``count`` indices; its first argument is the first index."""
        self._launch(kernel, count, lambda first, _: [first, *inputs])

    def sums(self, columns: int) -> wp.array:
        """Sums of so many columns, zero, to be added to and read by ``digits``."""
        return self.buffer(f"{columns} sums", (self.rows, columns, WIDTH), wp.int64)

    def add(self, kernel: wp.Kernel, count: int, *inputs: Any) -> None:
        """Launch a kernel that adds to sums over ``count`` indices; its first arguments are first index, row, spread."""
        self._launch(kernel, count, lambda first, row: [first, row, self._spread, *inputs])

    def digits(self, sums: wp.array) -> np.ndarray:
        """What has been added up, in whole numbers of ``exact_sum``, shape (columns, WIDTH); the sums are zero again."""
        columns = sums.shape[1]
        name, joined = self._named("digits", (columns, WIDTH), wp.int64)
        self._command(kernels.joined_sums, name, columns, [self.rows, sums, joined])()
        return self._read(name, joined)

    def rounded(self, parts: Sequence[np.ndarray]) -> np.ndarray:
        """The sums of which each part of a run has given ``digits``, one float64 a column."""
        columns = parts[0].shape[0]
        of, digits = self._named("parts", (len(parts), columns, WIDTH), wp.int64)
        if self._device.is_cpu:
            np.stack(parts, out=self._host(of, digits))
        else:
            digits.assign(np.stack(parts))
        name, value = self._named("values", (columns,), wp.float64)
        self._command(kernels.rounded_sums, of, columns, [len(parts), digits, value])()
        return self._read(name, value)

    def _named(self, kind: str, shape: tuple[int, ...], dtype: type) -> tuple[str, wp.array]:
        """A buffer for one shape, and its name."""
        name = f"{kind} {shape}"
        return name, self.buffer(name, shape, dtype)

    def _host(self, name: str, array: wp.array) -> np.ndarray:
        """Memory of a buffer that stays: asking Warp for it takes longer than reading a few numbers."""
        if name not in self._values:
            self._values[name] = array.numpy()
        return self._values[name]

    def _read(self, name: str, array: wp.array) -> np.ndarray:
        """A copy of what is in a buffer."""
        return self._host(name, array).copy() if self._device.is_cpu else array.numpy()

    def uploaded(self, name: str, *values: np.ndarray) -> wp.array:
        """Columns of float64 side by side in an array of at least so many rows, kept under ``name``; shape (rows, columns)."""
        count, columns = len(values[0]), len(values)
        key, (found, array) = ("columns", columns), self._kept.get(name, (None, self._nothing))
        if found != key or array.shape[0] < count:
            array = wp.empty((count + count // 2 + 64, columns), dtype=wp.float64, device=self._device)
            self._kept[name] = key, array
            if self._device.is_cpu:
                self._values[name] = array.numpy()
        there = self._values[name] if self._device.is_cpu else np.empty((count, columns))
        for column, numbers in enumerate(values):
            there[:count, column] = numbers
        if not self._device.is_cpu:
            wp.copy(array, wp.array(there, dtype=wp.float64, device=self._device), count=there.size)
        return array

    def column_sums(self, *arrays: np.ndarray | wp.array, present: wp.array | None = None) -> list[np.ndarray]:
        """Sums of the columns of each array over its rows, shapes (width,); arguments as of ``column_digits``."""
        widths = [1 if array.ndim == 1 else array.shape[1] for array in arrays]
        found = self.rounded([self.column_digits(*arrays, present=present)])
        return np.split(found, np.cumsum(widths)[:-1])

    def column_digits(self, *arrays: np.ndarray | wp.array, present: wp.array | None = None) -> np.ndarray:
        """``digits`` of the sums of the columns of all arrays, one after the other, over their rows.

        Args:
            arrays: shapes (n,) or (n, width), of float64.
            present: record of the grains that the rows belong to, as ``plain`` gives it: those that have left do not count.
        """
        widths = [1 if array.ndim == 1 else array.shape[1] for array in arrays]
        starts, sums = np.concatenate([[0], np.cumsum(widths)]).tolist(), self.sums(sum(widths))
        for array, width, start in zip(arrays, widths, starts, strict=False):
            if array.shape[0] and width:
                if isinstance(array, np.ndarray):
                    array = wp.array(np.ascontiguousarray(array, dtype=np.float64), dtype=wp.float64, device=self._device)
                self.add_columns(array.reshape((array.shape[0], width)), array.shape[0], start, sums, present)
        return self.digits(sums)

    def add_columns(
        self, values: wp.array, count: int, start: int, sums: wp.array, present: wp.array | None = None
    ) -> None:
        """Add the first ``count`` rows of ``values`` (rows, columns) to ``sums``, from column ``start`` on."""
        self.add(kernels.column_sums, count, values, self._nothing if present is None else present, start, sums)

    def _launch(self, kernel: wp.Kernel, count: int, inputs: Callable[[int, int], list[Any]]) -> None:
        if count == 0:
            return
        if self._threads is None or self._threads.count == 1 or count < LEAST:
            self._command(kernel, 0, count, inputs(0, 0))()
            return
        parts = enumerate(ranges(count, self._threads.count))
        self._threads.together([self._command(kernel, row, end - first, inputs(first, row)) for row, (first, end) in parts])

    def _command(self, kernel: wp.Kernel, key: int | str, count: int, inputs: list[Any]) -> Callable[[], None]:
        """The launch, recorded at the first call with this key."""
        command = self._commands.get((kernel, key))
        if command is None:
            command = self._commands[kernel, key] = RecordedLaunch(kernel, count, inputs, self._device)
        else:
            command.prepare(count, inputs)
        return command.launch
