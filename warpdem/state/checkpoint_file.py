"""The file of a checkpoint: HDF5, float64.

What is no array stands as JSON in the attributes ``scene`` and ``about``; ``digest`` tells damage anywhere in the file.
Arrays are brought in order, written and read block by block (``blocks``): saving and reading take little memory beside that
of the run.
"""

import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from warpdem.core.atomic_file import replaced
from warpdem.errors import SceneError
from warpdem.state.blocks import FileSink, Rows, each_block, made

FORMAT = "warpdem checkpoint 5"
HOLDS = {
    "record", "inverse", "id", "material", "group", "velocity", "spin", "extreme", "pair", "scene_hash", "files", "places",
    "step", "dt", "left", "streams", "next_id", "budget", "guards",
}  # fmt: skip
"""Arrays of any checkpoint, and keys of its ``about``: a file that was saved under other names is one of another version."""


def write(path: Path, scene: str, about: str, arrays: dict[str, Rows | np.ndarray]) -> None:
    """Write a checkpoint beside ``path`` and move it there.

    Args:
        path: the file.
        scene: the scene, as JSON.
        about: all else that is no array, as JSON.
        arrays: the arrays by name.

    Raises:
        OutputError: if the file cannot be written; an older one is as it was.
    """
    with replaced(path) as part, open(part, "w+b", buffering=0) as file:
        sink = FileSink(file)
        _write(sink, scene, about, arrays)
        sink.raise_failure()
        os.fsync(file.fileno())


def _write(sink: FileSink, scene: str, about: str, arrays: dict[str, Rows | np.ndarray]) -> None:
    """Write the HDF5 file to ``sink``."""
    digest = hashlib.sha256((scene + about).encode())
    with h5py.File(sink, "w") as file:
        file.attrs["format"], file.attrs["scene"], file.attrs["about"] = FORMAT, scene, about
        for name in sorted(arrays):
            values = arrays[name]
            digest.update(_head(name, values))
            data = file.create_dataset(name, shape=values.shape, dtype=values.dtype)
            for part, block in each_block(values):
                digest.update(_bytes(block))
                data[part] = block
        file.attrs["digest"] = digest.hexdigest()


def _digest(text: str, arrays: Mapping[str, Rows | np.ndarray]) -> str:
    """SHA-256 of all that a checkpoint holds."""
    digest = hashlib.sha256(text.encode())
    for name in sorted(arrays):
        digest.update(_head(name, arrays[name]))
        for _, block in each_block(arrays[name]):
            digest.update(_bytes(block))
    return digest.hexdigest()


def _head(name: str, values: Rows | np.ndarray) -> bytes:
    """What the digest takes of an array before its numbers."""
    return f"{name} {values.dtype.str} {tuple(values.shape)}".encode()


def _bytes(values: np.ndarray) -> memoryview:
    """The numbers of an array as the digest takes them, without a copy where they lie side by side."""
    return np.ascontiguousarray(values).reshape(-1).data


class Contents(Mapping[str, Any]):
    """Contents of a checkpoint whose file is open: an array is read from the file at each access.

    Args:
        rows: the arrays as ``Rows``, which are read on access, and what is no array.

    Attributes:
        rows: the same.
    """

    def __init__(self, rows: dict[str, Any]) -> None:
        self.rows = rows

    def __getitem__(self, name: str) -> Any:
        return made(self.rows[name])

    def __contains__(self, name: object) -> bool:
        return name in self.rows  # without reading it

    def __iter__(self) -> Iterator[str]:
        return iter(self.rows)

    def __len__(self) -> int:
        return len(self.rows)


@contextmanager
def opened(path: str | Path) -> Iterator[Contents]:
    """Contents of a checkpoint: its arrays, and what ``about`` holds.

    Raises:
        SceneError: if it is missing, damaged, or not a checkpoint of this version.
    """
    path = Path(path)
    if not path.exists():
        raise SceneError(f"{path}: no checkpoint there")
    with ExitStack() as closing:
        try:
            contents = _checked(closing.enter_context(h5py.File(path, "r")), path)
        except (
            OSError, KeyError, RuntimeError, ValueError, TypeError, AttributeError, IndexError, MemoryError,
        ) as error:  # fmt: skip
            raise SceneError(f"{path}: damaged or not a checkpoint ({error})") from error
        yield contents


def read(path: str | Path) -> dict[str, Any]:
    """As ``opened``, all arrays at once.

    Raises:
        SceneError: as ``opened``.
    """
    with opened(path) as contents:
        return dict(contents)


def _checked(file: h5py.File, path: Path) -> Contents:
    """What is in a file, once its digest was found to be that of its content.

    Raises:
        SceneError: it is not, or the file is of another version.
    """
    found = file.attrs.get("format")
    if found != FORMAT:
        known = isinstance(found, str) and found.startswith("warpdem checkpoint")
        what = f"a checkpoint of another version ({found!r})" if known else "an HDF5 file, but not a checkpoint"
        raise SceneError(f"{path}: {what}; this version reads {FORMAT!r}")
    for name in file:
        _require_stored(file, name, path.stat().st_size)
    scene, about, digest = (file.attrs[name] for name in ("scene", "about", "digest"))
    arrays = {name: Rows(data.shape, data.dtype, data.__getitem__) for name, data in file.items()}
    if digest != _digest(scene + about, arrays):
        raise SceneError(f"{path}: damaged: its content is not what was written")
    data = {**arrays, **json.loads(about)}
    if missing := sorted(HOLDS - data.keys()):
        raise SceneError(
            f"{path}: a checkpoint of another version: it holds no {', '.join(missing)}; go on with the version that saved it"
        )
    return Contents({**data, "scene": json.loads(scene), "path": path})


def _require_stored(file: h5py.File, name: str, size: int) -> None:
    """Refuse an array that claims more than its file of ``size`` bytes holds, or that lies in another file.

    Raises:
        ValueError: it does.
    """
    link, held = file.get(name, getlink=True), None
    if isinstance(link, h5py.HardLink):
        held = file[name]
    if not isinstance(held, h5py.Dataset) or held.is_virtual or held.external:
        raise ValueError(f"{name} is no array in this file")
    if held.nbytes > size:
        raise ValueError(f"{name} claims {held.nbytes} bytes in a file of {size}")
