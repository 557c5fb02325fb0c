"""``python -m warpdem`` is the command ``warpdem``, which begins here: all that takes time is imported within ``main``."""

import os
import signal
import sys
from collections.abc import Callable


def _leave(*_: object) -> None:
    """Answer Ctrl-C before there is anything that has to end in order."""
    os.write(2, b"interrupted\n")
    os._exit(130)


if "warpdem.core.command" not in sys.modules and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, _leave)  # until `answer` takes over


def _command() -> Callable[[], object]:
    from warpdem.app.cli import app

    return app


def main() -> None:
    """Entry point of the command; leaves with the exit codes of ``warpdem.core.command.run_command``."""
    from warpdem.core import interrupts
    from warpdem.core.command import run_command

    try:
        run_command(_command)
    finally:
        interrupts.ignore()  # while Python ends


if __name__ == "__main__":
    main()
