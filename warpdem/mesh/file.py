"""Triangles of mesh files (STL, OBJ, PLY; USD and STEP elsewhere). Every declaration in a file is checked before it is used.

The counts declared in a file are compared with its length before anything is read, so that a wrong count in a damaged file
does not allocate memory. STL and PLY are read by trimesh. OBJ is read here: its text must be checked line by line anyway, and
trimesh takes index 0 for the first point, counts relative indices from the end of the file and triangulates polygons as fans
even if they are not convex.
"""

import io
import struct
import warnings
from array import array
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from warpdem.errors import SceneError
from warpdem.mesh import step_file, usd_geometry
from warpdem.mesh.parts import ObjectFaces, PartProblem, solid_text
from warpdem.mesh.polygons import triangulate
from warpdem.scene.walls import STEP_SUFFIXES
from warpdem.usd.stage import USD_SUFFIXES

STL_HEADER, STL_TRIANGLE = 84, 50
"""Bytes of a binary STL file: header with the number of triangles, and each triangle."""
LONGEST_LINE = 1 << 20
"""Largest length of a line of an OBJ file or of a PLY header [bytes]."""
PLY_BYTES = {
    **dict.fromkeys(("char", "uchar", "int8", "uint8"), 1),
    **dict.fromkeys(("short", "ushort", "int16", "uint16", "float16"), 2),
    **dict.fromkeys(("int", "uint", "float", "int32", "uint32", "float32"), 4),
    **dict.fromkeys(("double", "int64", "uint64", "float64"), 8),
}
"""Size of the data types of a PLY file [bytes]."""


def read_any(
    path: Path,
    key: str,
    prim: str = "",
    folders: Sequence[Path] | None = None,
    part: str = "",
    tolerance: float | None = None,
) -> tuple[np.ndarray, tuple[str, ...]]:
    """Corners of all triangles of a mesh file of any type, shape (t, 3, 3), and notes from reading it.

    Those of USD and STEP are in metres, others in the file's own units.

    Args:
        path: STL (binary or ASCII), OBJ, PLY, USD or STEP file.
        key: Scene key, for messages.
        prim: Path of a prim of a USD file; "" if the file holds one surface only.
        folders: Folders that must hold all files which a USD file refers to; None for no restriction.
        part: Name of a solid of an ASCII STL or STEP file, or of an object or group of an OBJ; "" for the whole file.
        tolerance: Of a STEP file: largest distance between triangles and surfaces [m]; None for the default.

    Raises:
        SceneError: The file is missing, of another type, unreadable, damaged or without triangles.
    """
    suffix = path.suffix.lower()
    if suffix in USD_SUFFIXES:
        return usd_geometry.read_triangles(path, prim, key, folders)
    if suffix in STEP_SUFFIXES:
        return step_file.read_triangles(path, key, part, tolerance)
    return read_triangles(path, key, part), ()


def read_triangles(path: Path, key: str, part: str = "") -> np.ndarray:
    """Corners of all triangles of a file in its own units, in the order of the file, shape (t, 3, 3), float64.

    Args:
        path: File ending in .stl, .obj or .ply.
        key: Scene key, for messages.
        part: Name of the solid, object or group whose triangles are wanted; "" for all.

    Raises:
        SceneError: The file is missing, of another type, unreadable, damaged or without triangles.
    """
    if not path.is_file():
        raise SceneError(f"{key}: no such mesh file: {path}")
    if path.suffix.lower() not in READERS:
        raise SceneError(f"{key}: {path.name}: a mesh file ends in one of {', '.join(READERS)}, or as USD or STEP")
    size = path.stat().st_size
    try:
        corners = READERS[path.suffix.lower()](path, size, part)
    except PartProblem as problem:
        raise SceneError(f"{key}: {path.name}: {problem}") from None
    except Exception as error:  # any error of the parsers
        raise SceneError(f"{key}: {path.name} ({size} bytes) cannot be read as a mesh: {error}") from error
    if len(corners) == 0:
        raise SceneError(f"{key}: {path.name} ({size} bytes): the mesh is empty (0 triangles)")
    return corners


def _read_stl(path: Path, size: int, part: str) -> np.ndarray:
    with path.open("rb") as file:
        start = file.read(STL_HEADER)
    count = struct.unpack("<I", start[-4:])[0] if len(start) == STL_HEADER else 0
    is_binary = len(start) == STL_HEADER and size == STL_HEADER + STL_TRIANGLE * count
    if not is_binary:
        count = _check_ascii_stl(path, start, count)
    if count == 0:
        return np.zeros((0, 3, 3))
    from trimesh.exchange.stl import load_stl  # slow to import: only scenes with meshes pay

    text = None
    if part:
        if is_binary:
            raise PartProblem(f"part = {part!r}: a binary STL has no names of parts: write it as ASCII STL, or as OBJ")
        text = solid_text(path.read_bytes(), part)
        count = text.lower().count(b"endfacet")
    corners = np.concatenate([vertices[faces] for vertices, faces in _parsed(path, load_stl, text)])
    if len(corners) != count:
        raise ValueError(f"it has {count} facets but corners for {len(corners)}; damaged?")
    return corners


def _check_ascii_stl(path: Path, start: bytes, count: int) -> int:
    """Number of facets of an ASCII STL file with this start; as a binary file it would hold ``count`` triangles."""
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
        raise ValueError("it continues after the last 'endsolid'; truncated?")
    return faces


def _read_ply(path: Path, size: int, part: str) -> np.ndarray:
    if part:
        raise PartProblem(f"part = {part!r}: a PLY file has no names of parts: write it as OBJ")
    declared = _check_ply_header(path, size)
    if 0 in declared:
        return np.zeros((0, 3, 3))
    from trimesh.exchange.ply import load_ply  # slow to import: only scenes with meshes pay

    ((vertices, faces),) = _parsed(path, load_ply, None, skip_materials=True, fix_texture=False)
    if len(vertices) != declared[0] or len(faces) < declared[1]:
        raise ValueError(
            f"its header declares {declared[0]} vertices and {declared[1]} faces, it holds {len(vertices)} and {len(faces)}"
        )
    return np.asarray(vertices[triangulate(vertices, np.full(len(faces), faces.shape[1]), faces)])


def _check_ply_header(path: Path, size: int) -> tuple[int, int]:
    """Numbers of vertices and faces declared by a PLY header, after a check that the file is long enough for them."""
    elements: list[tuple[str, int]] = []  # name and count
    least: list[int] = []  # smallest number of bytes of an entry of each
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
                elements.append((words[1], int(words[2])))
                least.append(0)
            elif words[:1] == ["property"]:
                is_list = words[1:2] == ["list"]
                types = words[2:-1] if is_list else words[1:-1]
                if not elements or len(types) != 1 + is_list or not set(types) <= PLY_BYTES.keys():
                    raise ValueError(f"bad line in its header: {' '.join(words)[:60]!r}")
                # a list has at least its length; in text a value has at least a digit and a blank or line end
                least[-1] += 2 if is_ascii else PLY_BYTES[types[0]]
        left = size - file.tell()
    needed = sum(count * max(size, 1) for (_, count), size in zip(elements, least, strict=True))
    if needed > left + 1:  # the last line of a text may lack its line end
        declared = ", ".join(f"{count} of {name}" for name, count in elements)
        raise ValueError(f"its header declares {declared}: at least {needed} bytes, but {left} follow; truncated or damaged?")
    counts = dict(elements)
    return counts.get("vertex", 0), counts.get("face", 0)


def _parsed(
    path: Path, load: Callable[..., Any], text: bytes | None, **options: Any
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Points (v, 3), float64, and point numbers of each face (f, corners), of the parts returned by a loader of trimesh.

    ``text`` stands for the content of the file, if given.
    The loaders are called directly: `trimesh.load_mesh` would weld and drop corners of files with several parts.
    """
    with path.open("rb") if text is None else io.BytesIO(text) as file, warnings.catch_warnings():
        # NumPy's warning for text that is no number
        warnings.simplefilter("error", DeprecationWarning)
        found = load(file, **options)
    parts = list(found["geometry"].values()) if "geometry" in found else [found]
    if not all("faces" in part for part in parts):
        raise ValueError("it holds no faces")
    return [(np.asarray(part["vertices"], np.float64), np.asarray(part["faces"])) for part in parts]


def _read_obj(path: Path, size: int, part: str) -> np.ndarray:
    named_faces = ObjectFaces(part)
    points, corners, counts = array("d"), array("q"), array("q")
    number, continued = 0, b""
    with path.open("rb") as file:
        while line := file.readline(LONGEST_LINE):
            number += 1
            if len(line) + len(continued) >= LONGEST_LINE:
                raise ValueError(f"line {number} is longer than {LONGEST_LINE} bytes")
            line = continued + line.rstrip()
            continued = line[:-1] + b" " if line.endswith(b"\\") else b""
            words = line.split() if not continued else []
            if part and words:
                named_faces.line(words)
            try:
                if words and words[0] == b"v":
                    points.extend([float(words[1]), float(words[2]), float(words[3])])
                elif words and words[0] == b"f":
                    defined = len(points) // 3
                    before = len(corners)
                    for word in words[1:]:
                        named = int(word.split(b"/", 1)[0])
                        # from 1 upwards, or backwards from the last point so far
                        corners.append(named - 1 if named > 0 else named + defined if named < 0 else -1)
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
    sizes, numbers = np.frombuffer(counts, np.int64), np.frombuffer(corners, np.int64)
    if part:
        member = named_faces.faces()
        sizes, numbers = sizes[member], numbers[np.repeat(member, sizes)]
    triangles = triangulate(vertices, sizes, numbers)
    return np.asarray(vertices[triangles])


READERS = {".stl": _read_stl, ".obj": _read_obj, ".ply": _read_ply}
"""Reader of each file type, by suffix."""
