"""Finished and unfinished runs, read from their folders: ``read`` gives run.json, history.csv by column and the frames.

``history`` is the table of history.csv, ``run`` a folder of results. Files only: no simulation, no Warp.
"""

from warpdem.runs.history import History, NoColumn
from warpdem.runs.run import Run, read

__all__ = ["History", "NoColumn", "Run", "read"]
