"""What warpdem raises: every message names what is wrong, where, and what is allowed."""


class WarpdemError(Exception):
    """Base of all errors that a user can mend; ``exit_code`` is what the command line returns: 2 for what was asked for."""

    exit_code = 2


class SceneError(WarpdemError):
    """The scene is wrong: the message names file, key, value and what is allowed."""


class StabilityError(WarpdemError):
    """The run stopped itself: the message names grain, time and cause."""

    exit_code = 3


class OutputError(WarpdemError):
    """A result cannot be written (disk full, folder read-only): the message names the file; nothing old is lost."""

    exit_code = 3
