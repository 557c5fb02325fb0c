"""State files: the grains of a scene in .npz, .csv or .vtp. What a file claims to hold is believed once it fits into it."""

import math
import zipfile
from pathlib import Path

import numpy as np

from warpdem.core import memory
from warpdem.errors import SceneError
from warpdem.filling.vtp_file import listed, read_vtp
from warpdem.scene.units import Quantity

NPZ_KEYS = {
    "position": ("position", "x"),
    "radius": ("radius", "r"),
    "velocity": ("velocity", "v"),
    "spin": ("spin", "w"),
    "id": ("id",),
}
"""Names in a .npz file of each field of a grain."""
CSV_COLUMNS = {
    "position": ("x", "y", "z"),
    "radius": ("radius",),
    "velocity": ("vx", "vy", "vz"),
    "spin": ("wx", "wy", "wz"),
    "id": ("id",),
}
"""Columns in a .csv file of each field of a grain."""
VTP_ARRAYS = {"radius": "radius", "velocity": "v", "spin": "omega", "id": "id"}
"""Names in a .vtp file of each field of a grain, beside its points."""
QUANTITIES = {
    "position": Quantity("m"), "radius": Quantity("m", gt=0), "velocity": Quantity("m/s"), "spin": Quantity("rad/s"),
}  # fmt: skip
"""What the numbers of each field are."""
CSV_BYTES_PER_BYTE = 3
"""Memory that reading takes at least per byte of a .csv file [-]."""


def read_grain_file(path: Path, key: str) -> dict[str, np.ndarray | None]:
    """Fields of the grains in a state file: position, radius, velocity, spin (zero when absent), id (or None).

    Args:
        path: .npz with the keys of `NPZ_KEYS`, .csv with a header of `CSV_COLUMNS`, or .vtp with `VTP_ARRAYS`; members of
            clumps in it are left out.
        key: Scene key, for messages.

    Raises:
        SceneError: Missing file, key or column; a number that is not finite; a radius that is not above 0; ids that
            are not whole or come twice. Names the row, counted from 1.
    """
    path = Path(path)
    if not path.is_file():
        raise SceneError(f"{key}: no such state file: {path}")
    readers = {".npz": _read_npz, ".csv": _read_csv, ".vtp": _read_vtp}
    if path.suffix.lower() not in readers:
        raise SceneError(f"{key}: {path.name}: a state file ends in one of {', '.join(readers)}")
    key = f"{key}: {path.name}"
    fields = readers[path.suffix.lower()](path, key)
    count = len(np.atleast_1d(fields["radius"]))
    if count == 0:
        raise SceneError(f"{key}: holds no grains")
    checked = {}
    for name, width in (("position", (3,)), ("radius", ()), ("velocity", (3,)), ("spin", (3,)), ("id", ())):
        values = fields.get(name)
        if values is None:
            checked[name] = None if name == "id" else np.zeros((count, *width))
            continue
        checked[name] = _checked_field(np.asarray(values), (count, *width), name, key)
    if checked["id"] is not None:
        checked["id"] = _checked_ids(checked["id"], key)
    return checked


def _checked_field(values: np.ndarray, shape: tuple[int, ...], name: str, key: str) -> np.ndarray:
    """Field as finite float64 (integers stay as they are), of the shape that belongs to it."""
    if values.shape != shape:
        raise SceneError(f"{key}: {name} has the shape {values.shape}, must be {shape}")
    if values.dtype.kind not in "fiu":
        raise SceneError(f"{key}: {name} must hold numbers, holds {values.dtype}")
    bad = ~np.isfinite(values)
    _refuse_row(bad if bad.ndim == 1 else bad.any(axis=1), values, name, "must be finite", key)
    if name == "id":
        return values
    values, quantity = values.astype(np.float64), QUANTITIES[name]
    if name == "radius":
        _refuse_row(values <= 0.0, values, name, "must be above 0", key)
    bad = ~quantity.can_be_computed(values)
    _refuse_row(bad if bad.ndim == 1 else bad.any(axis=1), values, name, f"must be {quantity.magnitude_text()}", key)
    return values


def _checked_ids(ids: np.ndarray, key: str) -> np.ndarray:
    """Ids as int64."""
    wrong = (ids < 0) | (ids != np.floor(ids)) | (ids >= 2**63)
    _refuse_row(wrong, ids, "id", "must be a whole number from 0 to 2^63 - 1", key)
    ids = ids.astype(np.int64)
    _, first = np.unique(ids, return_index=True)
    again = np.ones(len(ids), bool)
    again[first] = False
    _refuse_row(again, ids, "id", "comes twice, ids must be unique", key)
    return ids


def _refuse_row(bad: np.ndarray, values: np.ndarray, name: str, what: str, key: str) -> None:
    """Raise for the first bad row."""
    if bad.any():
        row = int(np.argmax(bad))
        raise SceneError(
            f"{key}: row {row + 1}: {name} = {values[row].tolist()} {what} ({int(bad.sum())} of {len(bad)} rows)"
        )


def _read_npz(path: Path, key: str) -> dict[str, np.ndarray]:
    try:
        with zipfile.ZipFile(path) as archive:
            held = {entry.filename.removesuffix(".npy"): entry for entry in archive.infolist()}
            fields = {}
            for field, names in NPZ_KEYS.items():
                present = [name for name in names if name in held]
                if present:
                    fields[field] = _array_of(archive, held[present[0]], f"{key}: {present[0]}")
                elif field in ("position", "radius"):
                    raise SceneError(f"{key}: has no key {' or '.join(names)}; it has {listed(held)}")
            return fields
    except SceneError:
        raise
    except ValueError as error:  # NumPy's words advise to run what the file holds
        raise SceneError(f"{key}: cannot be read as .npz: it is no archive of plain arrays of numbers") from error
    except Exception as error:  # whatever the readers of archives and arrays run into
        raise SceneError(f"{key}: cannot be read as .npz: {error or type(error).__name__}") from error


def _array_of(archive: zipfile.ZipFile, entry: zipfile.ZipInfo, key: str) -> np.ndarray:
    """An array of an archive, if it is as long as its header says and there is memory for it."""
    with archive.open(entry) as file:
        version = np.lib.format.read_magic(file)
        read_header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, _, dtype = read_header(file)
        length = math.prod(shape) * dtype.itemsize
        if not dtype.hasobject and length > entry.file_size - file.tell():
            raise SceneError(
                f"{key}: its header says {shape} of {dtype}, {length} bytes, but {entry.file_size - file.tell()} follow: "
                "truncated or damaged?"
            )
    memory.require(2 * length, key, f"an array of {shape} {dtype}", "take fewer grains")
    with archive.open(entry) as file:
        return np.lib.format.read_array(file, allow_pickle=False)


def _read_csv(path: Path, key: str) -> dict[str, np.ndarray]:
    size = path.stat().st_size
    memory.require(CSV_BYTES_PER_BYTE * size, key, f"a text of {size} bytes", "take an .npz, or fewer grains")
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        header = [name.strip() for name in file.readline().split(",")]
        known = [name for names in CSV_COLUMNS.values() for name in names]
        wrong = [name for name in header if name not in known]
        if wrong:
            raise SceneError(f"{key}: unknown column {wrong[0][:60]!r}; allowed: {', '.join(known)}")
        if len(set(header)) < len(header):
            raise SceneError(f"{key}: a column comes twice in {', '.join(header)}")
        lines = [line for line in file if line.strip()]
    try:
        table = np.loadtxt(lines, delimiter=",", ndmin=2) if lines else np.empty((0, len(header)))
    except ValueError as error:
        raise SceneError(f"{key}: the rows below the header, counted from 0, must hold numbers: {str(error)[:300]}") from error
    if table.shape[1] != len(header):
        raise SceneError(f"{key}: the header names {len(header)} columns, the rows have {table.shape[1]}")
    fields = {}
    for field, names in CSV_COLUMNS.items():
        missing = [name for name in names if name not in header]
        if not missing:
            columns = table[:, [header.index(name) for name in names]]
            fields[field] = columns if len(names) == 3 else columns[:, 0]
        elif field in ("position", "radius") or len(missing) < len(names):
            raise SceneError(f"{key}: missing column {missing[0]}; it has {', '.join(header)}")
    return fields


def _read_vtp(path: Path, key: str) -> dict[str, np.ndarray]:
    there, arrays = read_vtp(path, [*VTP_ARRAYS.values(), "clump"], key)
    if "radius" not in arrays:
        raise SceneError(f"{key}: has no point array radius; it has {there}")
    alone = np.asarray(arrays.get("clump", np.full(len(arrays["radius"]), -1))) < 0
    if len(alone) and not alone.any():
        raise SceneError(f"{key}: holds members of clumps alone: name the clump with clump, and take its clumps_*.vtp")
    fields = {"position": arrays["points"], **{field: arrays[name] for field, name in VTP_ARRAYS.items() if name in arrays}}
    return fields if alone.all() else {field: values[alone] for field, values in fields.items()}
