"""Mesh files (STL, OBJ, PLY) to loose triangles. Nothing in a file is believed before it is checked.

What a file says it holds is compared with its length before anything is read, so that no count of a damaged file takes
memory that the file could not fill. STL and PLY are read by trimesh. OBJ is read here: its text needs checking line by
line anyway, and trimesh takes the index 0 for the first point, counts relative indices from the end of the file and cuts
polygons into fans even where they are not convex.
"""

import struct
import warnings
from array import array
from collections.abc import Callable
from pathlib import Path

import numpy as np

from warpdem.errors import SceneError
from warpdem.mesh.polygons import triangulate

STL_HEADER, STL_TRIANGLE = 84, 50
"""Bytes of a binary STL file: header with the number of triangles, and each triangle."""
LONGEST_LINE = 1 << 20
"""Most bytes of a line of an OBJ file or of the header of a PLY file [-]."""
PLY_BYTES = {
    **dict.fromkeys(("char", "uchar", "int8", "uint8"), 1),
    **dict.fromkeys(("short", "ushort", "int16", "uint16", "float16"), 2),
    **dict.fromkeys(("int", "uint", "float", "int32", "uint32", "float32"), 4),
    **dict.fromkeys(("double", "int64", "uint64", "float64"), 8),
}
"""Bytes of the types of a PLY file."""


def read_triangles(path: Path, key: str) -> np.ndarray:
    """Corners of all triangles of a file in its own units, in the order of the file, shape (t, 3, 3), float64.

    Args:
        path: File ending in .stl, .obj or .ply.
        key: Scene key, for messages.

    Raises:
        SceneError: File missing, of another kind, unreadable, damaged or without triangles.
    """
    if not path.is_file():
        raise SceneError(f"{key}: no such mesh file: {path}")
    if path.suffix.lower() not in READERS:
        raise SceneError(f"{key}: {path.name}: a mesh file ends in one of {', '.join(READERS)}, or in one of USD's")
    size = path.stat().st_size
    try:
        corners = READERS[path.suffix.lower()](path, size)
    except Exception as error:  # whatever the parsers run into
        raise SceneError(f"{key}: {path.name} ({size} bytes) cannot be read as a mesh: {error}") from error
    if len(corners) == 0:
        raise SceneError(f"{key}: {path.name} ({size} bytes): the mesh is empty (0 triangles)")
    return corners


def _read_stl(path: Path, size: int) -> np.ndarray:
    with path.open("rb") as file:
        start = file.read(STL_HEADER)
    count = struct.unpack("<I", start[-4:])[0] if len(start) == STL_HEADER else 0
    is_binary = len(start) == STL_HEADER and size == STL_HEADER + STL_TRIANGLE * count
    if not is_binary:
        count = _check_ascii_stl(path, start, count)
    if count == 0:
        return np.zeros((0, 3, 3))
    from trimesh.exchange.stl import load_stl  # slow to import: only scenes with meshes pay

    corners = np.concatenate([vertices[faces] for vertices, faces in _parsed(path, load_stl)])
    if len(corners) != count:
        raise ValueError(f"it has {count} facets but corners for {len(corners)}; damaged?")
    return corners


def _check_ascii_stl(path: Path, start: bytes, count: int) -> int:
    """Number of facets of an ASCII STL file that starts so, and that as a binary one would hold ``count`` triangles."""
    if not start.lstrip()[:5].lower() == b"solid" or b"\0" in start:
        raise ValueError(
            f"it is no ASCII STL (does not start with 'solid'), and as a binary STL it would hold {count} triangles in "
            f"{STL_HEADER + STL_TRIANGLE * count} bytes; truncated or damaged?"
        )
    text = path.read_bytes().lower()
    ends, solids, faces = text.count(b"endsolid"), text.count(b"solid"), text.count(b"endfacet")
    if ends == 0 or solids < 2 * ends:
        raise ValueError("it starts as an ASCII STL but has no matching 'endsolid'; truncated?")
    if text[text.rfind(b"endsolid") :].count(b"facet"):
        raise ValueError("it goes on after the last 'endsolid'; truncated?")
    return faces


def _read_ply(path: Path, size: int) -> np.ndarray:
    declared = _check_ply_header(path, size)
    if 0 in declared:
        return np.zeros((0, 3, 3))
    from trimesh.exchange.ply import load_ply  # slow to import: only scenes with meshes pay

    ((vertices, faces),) = _parsed(path, load_ply, skip_materials=True, fix_texture=False)
    if len(vertices) != declared[0] or len(faces) < declared[1]:
        raise ValueError(
            f"its header names {declared[0]} vertices and {declared[1]} faces, it holds {len(vertices)} and {len(faces)}"
        )
    return vertices[triangulate(vertices, np.full(len(faces), faces.shape[1]), faces)]


def _check_ply_header(path: Path, size: int) -> tuple[int, int]:
    """Numbers of vertices and faces that a PLY header declares, once the file is long enough to hold all it declares."""
    elements: list[list] = []  # name, count, least number of bytes of one
    with path.open("rb") as file:
        if file.readline(LONGEST_LINE).strip() != b"ply":
            raise ValueError("it does not start with 'ply'")
        is_ascii = False
        while (line := file.readline(LONGEST_LINE)).strip() != b"end_header":
            if not line.endswith(b"\n"):
                raise ValueError("its header does not end with 'end_header'; truncated?")
            words = line.decode("utf-8", "replace").split()
            if words[:1] == ["format"]:
                is_ascii = words[1:2] == ["ascii"]
            elif words[:1] == ["element"]:
                if len(words) != 3 or not words[2].isdecimal() or len(words[2]) > 18:
                    raise ValueError(f"bad line in its header: {' '.join(words)[:60]!r}")
                elements.append([words[1], int(words[2]), 0])
            elif words[:1] == ["property"]:
                is_list = words[1:2] == ["list"]
                kinds = words[2:-1] if is_list else words[1:-1]
                if not elements or len(kinds) != 1 + is_list or not set(kinds) <= PLY_BYTES.keys():
                    raise ValueError(f"bad line in its header: {' '.join(words)[:60]!r}")
                # of a list at least its length is there; in text at least a digit and a blank or line end
                elements[-1][2] += 2 if is_ascii else PLY_BYTES[kinds[0]]
        left = size - file.tell()
    needed = sum(count * max(row, 1) for _, count, row in elements)
    if needed > left + 1:  # the last line of a text may lack its end
        held = ", ".join(f"{count} of {name}" for name, count, _ in elements)
        raise ValueError(f"its header names {held}: at least {needed} bytes, but {left} follow; truncated or damaged?")
    count = {name: number for name, number, _ in elements}
    return count.get("vertex", 0), count.get("face", 0)


def _parsed(path: Path, load: Callable[..., dict], **options) -> list[tuple[np.ndarray, np.ndarray]]:
    """Points (v, 3), float64, and the point numbers of each face (f, corners) of the parts that a loader of trimesh finds.

    The loaders are called themselves: `trimesh.load_mesh` would weld and drop corners of files with several parts.
    """
    with path.open("rb") as file, warnings.catch_warnings():
        # how NumPy tells of text that is no number
        warnings.simplefilter("error", DeprecationWarning)
        found = load(file, **options)
    parts = list(found["geometry"].values()) if "geometry" in found else [found]
    if not all("faces" in part for part in parts):
        raise ValueError("it holds no faces")
    return [(np.asarray(part["vertices"], np.float64), np.asarray(part["faces"])) for part in parts]


def _read_obj(path: Path, size: int) -> np.ndarray:
    points, corners, counts = array("d"), array("q"), array("q")
    number, held = 0, b""
    with path.open("rb") as file:
        while line := file.readline(LONGEST_LINE):
            number += 1
            if len(line) + len(held) >= LONGEST_LINE:
                raise ValueError(f"line {number} is longer than {LONGEST_LINE} bytes")
            line = held + line.rstrip()
            held = line[:-1] + b" " if line.endswith(b"\\") else b""  # goes on in the next line
            words = line.split() if not held else ()
            try:
                if words and words[0] == b"v":
                    points.extend([float(words[1]), float(words[2]), float(words[3])])
                elif words and words[0] == b"f":
                    there = len(points) // 3
                    before = len(corners)
                    for word in words[1:]:
                        named = int(word.split(b"/", 1)[0])
                        # from 1, or backwards from the last point so far
                        corners.append(named - 1 if named > 0 else named + there if named < 0 else -1)
                    counts.append(len(corners) - before)
                    if counts[-1] < 3:
                        raise ValueError("a face needs at least 3 corners")
                    if min(corners[before:]) < 0:
                        raise ValueError("a face names a point that does not exist")
            except (ValueError, IndexError, OverflowError) as error:
                text = line[:60].decode("utf-8", "replace")
                raise ValueError(f"line {number}: {text!r}: {error}") from None
    vertices = np.frombuffer(points, np.float64).reshape(-1, 3) if points else np.zeros((0, 3))
    if not counts:
        raise ValueError(f"it holds no faces ({number} lines, {len(vertices)} points)")
    return vertices[triangulate(vertices, np.frombuffer(counts, np.int64), np.frombuffer(corners, np.int64))]


READERS = {".stl": _read_stl, ".obj": _read_obj, ".ply": _read_ply}
"""How each kind of file is read, by its suffix."""
