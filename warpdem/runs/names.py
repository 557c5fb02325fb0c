"""Short names of runs, for labels."""

from collections.abc import Sequence
from pathlib import Path


def run_names(paths: Sequence[Path]) -> list[str]:
    """A name for each folder: the last part of its path, without ends that all share, as ``results``; else whole paths."""
    parts = [list(path.resolve().parts) for path in paths]
    while len(parts) > 1 and all(len(p) > 1 for p in parts) and len({p[-1] for p in parts}) == 1:
        parts = [p[:-1] for p in parts]
    names = [p[-1] for p in parts]
    if len(set(names)) == len(names):
        return names
    return [str(path) if paths.count(path) == 1 else f"{path} ({k + 1})" for k, path in enumerate(paths)]
