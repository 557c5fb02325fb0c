"""``python -m warpdem`` is the command ``warpdem``."""

from warpdem.cli import main

main()
