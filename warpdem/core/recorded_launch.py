"""A launch that is made over and over: recorded once and replayed, for recording takes several times as long."""

from collections.abc import Sequence
from typing import Any

import warp as wp


class RecordedLaunch:
    """Launches of one kernel with inputs of which few change from one to the next; a struct is read at each launch.

    Args:
        kernel: the kernel; its module is loaded, which is not safe from several threads.
        count: number of its threads.
        inputs: its arguments.
        device: where it runs.
    """

    def __init__(self, kernel: wp.Kernel, count: int, inputs: Sequence[Any], device: wp.Device) -> None:
        self._inputs = list(inputs)
        self._command = wp.launch(kernel, count, inputs=self._inputs, device=device, record_cmd=True)

    def prepare(self, count: int, inputs: Sequence[Any]) -> None:
        """Let the next launch have so many threads and these arguments."""
        for at, value in enumerate(inputs):
            if not _same(self._inputs[at], value):
                self._inputs[at] = value
                self._command.set_param_at_index(at, value)
        self._command.set_dim(count)

    def launch(self) -> None:
        """Launch it."""
        self._command.launch()


def _same(first: Any, second: Any) -> bool:
    """Whether two arguments of a launch are the same: the same array, or equal numbers."""
    return first is second or (isinstance(first, int) and isinstance(second, int) and first == second)
