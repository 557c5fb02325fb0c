"""Damaged mesh files end in a mesh or in a clear error: no crash, no hang, no memory beyond ten times the file."""

import struct
import time
import tracemalloc

import numpy as np
import pytest
import trimesh
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from warpdem.errors import SceneError
from warpdem.mesh.triangle_mesh import TriangleMesh, load_mesh

BALL = trimesh.creation.icosphere(subdivisions=1)
FILES = {
    ".stl": [BALL.export(file_type="stl"), BALL.export(file_type="stl_ascii").encode()],
    ".ply": [BALL.export(file_type="ply"), BALL.export(file_type="ply", encoding="ascii")],
    ".obj": [BALL.export(file_type="obj").encode()],
}
CASES = [(suffix, content) for suffix, contents in FILES.items() for content in contents]
WORDS = (
    b"\xff\xff\xff\xff",
    b"\x00\x00\x00\x00",
    b"\x00\x00\xc0\x7f",
    b"\xff\xff\xff\x7f",
    b"nan",
    b"1e999",
    b"-1 ",
    b"9" * 30,
)
"""What is written over a file: largest and smallest counts, not a number as float32 and as text, numbers beyond a type."""
SLACK = 3_000_000
"""Memory for what does not grow with the file [bytes], such as NumPy's and the parsers' own tables."""


def outcome(path, content) -> TriangleMesh | None:
    """The mesh, or None if the file was refused in words; anything else fails."""
    path.write_bytes(content)
    tracemalloc.start()
    begin = time.monotonic()
    try:
        mesh = load_mesh(path, key="walls[0].mesh")
    except SceneError as error:
        mesh = None
        assert str(error).startswith(f"walls[0].mesh: {path.name}")
    finally:
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert time.monotonic() - begin < 5.0
    assert peak < 10 * len(content) + SLACK
    if mesh is not None:
        assert len(mesh.triangles) > 0
        assert np.isfinite(mesh.vertices).all()
        assert mesh.triangles.min() >= 0
        assert mesh.triangles.max() < len(mesh.vertices)
        assert np.isfinite(mesh.plane_normal).all()
        assert np.isfinite(mesh.plane_offset).all()
    return mesh


@st.composite
def damaged(draw):
    """A good file of some kind, cut off, with some bytes changed, some words written over it, or lines moved about."""
    suffix, content = draw(st.sampled_from(CASES))
    content = bytearray(content)
    for _ in range(draw(st.integers(1, 3))):
        at = draw(st.integers(0, min(len(content), 600)) | st.integers(0, len(content)))
        match draw(st.sampled_from(("cut", "byte", "word", "insert", "drop", "repeat"))):
            case "cut":
                del content[at:]
            case "byte":
                content[at : at + 1] = bytes([draw(st.integers(0, 255))])
            case "word":
                word = draw(st.sampled_from(WORDS))
                content[at : at + len(word)] = word
            case "insert":
                content[at:at] = draw(st.binary(max_size=20))
            case "drop":
                del content[at : at + draw(st.integers(1, 60))]
            case "repeat":
                content[at:at] = content[at : at + draw(st.integers(1, 60))]
    return suffix, bytes(content)


QUIET = settings(
    max_examples=250, deadline=None, derandomize=True, database=None, suppress_health_check=list(HealthCheck)
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    tmp = tmp_path_factory.mktemp("fuzz")
    for suffix, content in CASES:  # once: what imports and compiles is no file's memory
        assert outcome(tmp / f"good{suffix}", content).is_closed
    return tmp


@QUIET
@given(damaged())
def test_damaged_files(folder, case):
    suffix, content = case
    outcome(folder / f"a{suffix}", content)


@QUIET
@given(
    st.sampled_from(list(FILES)),
    st.sampled_from((b"", b"solid\n", b"ply\nformat ascii 1.0\n", b"v 0 0 0\nf ")),
    st.binary(),
)
@example(".stl", b" " * 80, struct.pack("<I", 2**32 - 1))
@example(".stl", b"", b"")
@example(".ply", b"", b"ply\n" + b"\n" * 1000)
@example(".obj", b"", b"\\\n" * 1000)
@example(".obj", b"", b"v 0 0 0\nf " + b"1 " * 3000)
@example(".obj", b"", b"v nan 0 0\nv 1 inf 0\nv 1 1 1\nf 1 2 3 3 2 1")
@example(".obj", b"", b"v 1e300 0 0\nv 1 1e300 0\nv 1 1 1\nf 1 2 3")
@example(".obj", b"", b"v 1e-300 0 0\nv 0 1e-300 0\nv 0 0 0\nf 1 2 3")
@example(".obj", b"", b"v 1e30 0 0\nv 0 1e30 0\nv 0 0 0\nf 1 2 3")
def test_random_bytes(folder, suffix, start, content):
    outcome(folder / f"a{suffix}", start + content)


@QUIET
@given(
    st.lists(
        st.lists(st.sampled_from((0.0, -0.0, 1.0, 1.0 + 1e-7, 2.0, -1e-30, 1e-9, 1e9)), min_size=9, max_size=9),
        min_size=1,
        max_size=12,
    )
)
def test_triangles_that_touch_cross_and_collapse(folder, numbers):
    record = np.zeros(len(numbers), dtype=[("normal", "<f4", 3), ("corners", "<f4", 9), ("attribute", "<u2")])
    record["corners"] = numbers
    outcome(folder / "a.stl", b" " * 80 + struct.pack("<I", len(numbers)) + record.tobytes())
