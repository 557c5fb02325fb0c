"""Errors that warpdem raises: every message names the fault, where it is, and what is allowed."""


class WarpdemError(Exception):
    """Base of all errors that a user can correct; ``exit_code`` is the exit code of the command: 2 for a wrong request."""

    exit_code = 2


class SceneError(WarpdemError):
    """The scene is wrong: the message names file, key, value and what is allowed."""


class StabilityError(WarpdemError):
    """The run stopped because it became unstable: the message names grain, time and cause."""

    exit_code = 3


class OutputError(WarpdemError):
    """A result cannot be written (disk full, folder read-only): the message names the file; existing results stay."""

    exit_code = 3
