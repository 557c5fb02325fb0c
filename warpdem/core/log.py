"""The logger of the package, "warpdem", silent until a program asks for it: ``logging.basicConfig(level=logging.INFO)``.

Warnings are what a run warns of and what its guards notice; infos its notes, beginnings and ends; debug its files.
"""

import logging

log = logging.getLogger("warpdem")
log.addHandler(logging.NullHandler())  # else Python would print warnings beside those of the command
