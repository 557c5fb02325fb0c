"""``python -m warpdem`` is the command ``warpdem``, which begins here: its libraries load within ``main``."""

from warpdem import interrupts
from warpdem.process import answer


def _command():
    from warpdem.cli import app

    return app


def main() -> None:
    """Entry point of the command; leaves with the exit codes of ``warpdem.process.answer``."""
    try:
        answer(_command)
    finally:
        interrupts.ignore()  # while Python ends


if __name__ == "__main__":
    main()
