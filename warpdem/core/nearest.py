"""Words that suggest the name that was meant."""

import difflib
from collections.abc import Sequence
from typing import Any


def nearest(name: Any, known: Sequence[str], likeness: float = 0.6) -> str:
    """Words that ask whether the most similar known name was meant; empty if none is similar."""
    close = difflib.get_close_matches(str(name).lower(), known, n=1, cutoff=likeness)
    return f'; did you mean "{close[0]}"?' if close else ""
