"""Mesh files: all kinds give the same triangles, and what is damaged is refused before it takes memory."""

import math
import struct
import tracemalloc

import numpy as np
import pytest
import trimesh

from warpdem.errors import SceneError
from warpdem.mesh.file import read_triangles
from warpdem.mesh.triangle_mesh import load_mesh
from warpdem.scene.walls import FixedRotation


def box(size=(1.0, 2.0, 3.0)):
    """Triangles of a box about the origin, shape (12, 3, 3)."""
    return np.array(trimesh.creation.box(size).triangles)


def stl_bytes(corners, count=None):
    """Binary STL that says it holds ``count`` triangles."""
    record = np.zeros(len(corners), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    record["corners"] = corners
    return b" " * 80 + struct.pack("<I", len(corners) if count is None else count) + record.tobytes()


@pytest.mark.parametrize("kind", ["stl", "stl_ascii", "obj", "ply"])
def test_all_file_kinds_give_the_same_welded_box(tmp_path, kind):
    path = tmp_path / f"box.{kind[:3]}"
    trimesh.Trimesh(**trimesh.triangles.to_kwargs(box())).export(path, file_type=kind)
    mesh = load_mesh(path, key="walls[0].mesh")
    assert mesh.vertices.shape == (8, 3)
    assert mesh.vertices.dtype == np.float64
    assert mesh.triangles.shape == (12, 3)
    assert mesh.triangles.dtype == np.int32
    assert mesh.is_closed
    np.testing.assert_allclose(mesh.volume, 6.0, rtol=1e-14)
    np.testing.assert_array_equal(mesh.bounds, [[-0.5, -1.0, -1.5], [0.5, 1.0, 1.5]])


def ascii_stl(**solids):
    """ASCII STL of several solids by name."""
    facet = "facet normal 0 0 0\nouter loop\n{}endloop\nendfacet\n"
    text = ""
    for name, corners in solids.items():
        rows = ("".join(f"vertex {a!r} {b!r} {c!r}\n" for a, b, c in t.tolist()) for t in corners)
        text += f"solid {name}\n" + "".join(facet.format(row) for row in rows) + f"endsolid {name}\n"
    return text


def obj(word, **objects):
    """OBJ of several objects or groups by name."""
    text, first = "", 1
    for name, corners in objects.items():
        text += f"{word} {name}\n" + "".join(f"v {a!r} {b!r} {c!r}\n" for a, b, c in corners.reshape(-1, 3).tolist())
        text += "".join(f"f {k}/1 {k + 1}//1 {k + 2}\n" for k in range(first, first + 3 * len(corners), 3))
        first += 3 * len(corners)
    return text


LARGE, SMALL = box(), box((0.5, 0.5, 0.5)) + 0.0
SEVERAL = {"stl": ascii_stl(drum=LARGE, lifter=SMALL), "o.obj": obj("o", drum=LARGE, lifter=SMALL)}
SEVERAL |= {"g.obj": obj("g", drum=LARGE, lifter=SMALL), "both.obj": "o machine\n" + obj("g all", drum=LARGE, lifter=SMALL)}


@pytest.mark.parametrize("kind", SEVERAL)
def test_one_part_of_a_file_with_several(tmp_path, kind):
    path = tmp_path / f"machine.{kind}"
    path.write_text(SEVERAL[kind], encoding="utf-8")
    np.testing.assert_array_equal(read_triangles(path, "mesh", "lifter"), SMALL)
    np.testing.assert_array_equal(read_triangles(path, "mesh", "drum"), LARGE)
    assert len(read_triangles(path, "mesh")) == 24
    assert load_mesh(path, part="lifter").volume == pytest.approx(0.125, rel=1e-14)
    with pytest.raises(SceneError, match=r"machine\..*: part = 'lid': it holds no such part; there are .*'drum', .*'lifter'"):
        read_triangles(path, "mesh", "lid")


def test_files_without_names_have_no_parts(tmp_path):
    (tmp_path / "a.stl").write_bytes(stl_bytes(box()))
    with pytest.raises(SceneError, match="a binary STL has no names of parts"):
        read_triangles(tmp_path / "a.stl", "mesh", "drum")
    (tmp_path / "b.obj").write_text(obj("usemtl", drum=box()), encoding="utf-8")
    with pytest.raises(SceneError, match="its parts have no names"):
        read_triangles(tmp_path / "b.obj", "mesh", "drum")
    with pytest.raises(SceneError, match="a PLY file has no names"):
        (tmp_path / "c.ply").write_bytes(b"ply")
        read_triangles(tmp_path / "c.ply", "mesh", "drum")


def test_scale_along_each_axis_of_the_file(tmp_path):
    path = tmp_path / "a.stl"
    path.write_bytes(stl_bytes(box()))
    quarter = FixedRotation(axis=[0, 0, 1], angle="90 deg")
    mesh = load_mesh(path, scale=(2.0, 0.5, 1.0), rotate=quarter, translate=[0, 0, 1.5])
    np.testing.assert_allclose(mesh.bounds, [[-0.5, -1.0, 0.0], [0.5, 1.0, 3.0]], rtol=0, atol=1e-15)
    assert mesh.volume == pytest.approx(6.0, rel=1e-14)
    whole = load_mesh(path, scale=(0.001, 0.001, 0.001)), load_mesh(path, scale=0.001)
    np.testing.assert_array_equal(whole[0].corners, whole[1].corners)


def test_missing_file_is_named(tmp_path):
    with pytest.raises(SceneError, match=r"walls\[0\]\.mesh: no such mesh file: .*none\.stl"):
        load_mesh(tmp_path / "none.stl", key="walls[0].mesh")


def test_unreadable_file_is_named(tmp_path):
    path = tmp_path / "bad.ply"
    path.write_bytes(b"\x00\x01 no mesh at all")
    with pytest.raises(SceneError, match=r"walls\[0\]\.mesh: bad\.ply \(17 bytes\) cannot be read"):
        load_mesh(path, key="walls[0].mesh")


@pytest.mark.parametrize(
    "content",
    [b" " * 80 + struct.pack("<I", 0), b"solid nothing\nendsolid nothing\n", b"some words"],
    ids=["binary", "ascii", "no mesh"],
)
def test_empty_mesh_is_refused(tmp_path, content):
    path = tmp_path / "empty.stl"
    path.write_bytes(content)
    with pytest.raises(SceneError, match=r"walls\[0\]\.mesh: empty\.stl.*(empty|cannot be read)"):
        load_mesh(path, key="walls[0].mesh")


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_corner_that_is_no_number_is_refused(tmp_path, value):
    path = tmp_path / "bad.stl"
    corners = box()
    corners[5, 1, 2] = value
    record = np.zeros(12, dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    record["corners"] = corners
    path.write_bytes(b" " * 80 + struct.pack("<I", 12) + record.tobytes())
    with pytest.raises(SceneError, match=rf"walls\[0\]\.mesh: bad\.stl: 1 of 12 .* triangle 5: .*{value}"):
        load_mesh(path, key="walls[0].mesh")


def read(path, content):
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_triangles(path, "walls[0].mesh")


def refusal(path, content) -> str:
    with pytest.raises(SceneError) as caught:
        read(path, content)
    text = str(caught.value)
    assert text.startswith(f"walls[0].mesh: {path.name}")
    return text


def test_binary_stl_that_calls_itself_solid_is_read(tmp_path):
    content = b"solid by a careless program".ljust(80) + stl_bytes(box())[80:]
    np.testing.assert_array_equal(read(tmp_path / "a.stl", content), box().astype(np.float32))


def test_other_kinds_of_files_are_refused(tmp_path):
    assert "ends in one of .stl, .obj, .ply" in refusal(tmp_path / "a.step", b"ISO-10303-21;")


def test_obj_counts_points_from_both_ends_and_takes_polygons(tmp_path):
    text = """# a comment
mtllib nowhere.mtl
o floor
v 0 0 0 1 1 1
v 1 0 0
v 1 1 0
v 0 1 0
vt 0 0
vn 0 0 1
usemtl steel
f 1/1/1 2/1/1 3/1/1 4/1/1
o spike
v 5 0 0
v 6 0 0
v 5.5 1 0
v 5.5 0.25 0
f -4//1 -3//1 -2 \\
 -1
"""
    corners = read(tmp_path / "a.obj", text)
    assert len(corners) == 4
    assert corners[:2].tolist() == [[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]]
    # the last polygon is not convex: a fan from its first corner would leave it
    spike = 0.5 * np.cross(corners[2:, 1] - corners[2:, 0], corners[2:, 2] - corners[2:, 0])[:, 2]
    assert (spike > 0.0).all()
    np.testing.assert_allclose(spike.sum(), 0.5 - 0.1875)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("v 0 0\nf 1 1 1", "line 1: 'v 0 0'"),
        ("v 0 0 x\nf 1 1 1", "line 1: 'v 0 0 x'"),
        ("v 0 0 0\nf 1 2", "line 2: 'f 1 2': a face needs at least 3 corners"),
        ("v 0 0 0\nf 0 1 1", "line 2: 'f 0 1 1': a face names a point that does not exist"),
        ("v 0 0 0\nf 1 1 -2", "line 2: 'f 1 1 -2': a face names a point that does not exist"),
        ("v 0 0 0\nf 1 1 7", "names the point 6, there are the points 0 to 0"),
        ("v 0 0 0\nf 1 1 99999999999999999999", "line 2"),
        ("v 0 0 0\n", "holds no faces"),
        ("Dear all,\nplease find attached the drum.\n", "holds no faces"),
        ("f " + "1 " * 600_000, "line 1 is longer than 1048576 bytes"),
    ],
)
def test_wrong_obj_is_refused_with_its_line(tmp_path, text, said):
    assert said in refusal(tmp_path / "a.obj", text)


def ply(vertices=4, faces=2, form="ascii", body="0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n", index="int"):
    return (
        f"ply\nformat {form} 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n"
        f"element face {faces}\nproperty list uchar {index} vertex_indices\nend_header\n{body}"
    )


def test_ply_gives_its_triangles(tmp_path):
    corners = read(tmp_path / "a.ply", ply())
    assert corners.tolist() == [[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]]
    quad = read(tmp_path / "a.ply", ply(faces=1, body="0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n"))
    assert len(quad) == 2


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (ply(vertices=10**17), "100000000000000000 of vertex, 2 of face: at least"),
        (ply(faces=10**12), "truncated or damaged?"),
        (ply(vertices=10**12, form="binary_little_endian"), "at least 12000000000002 bytes"),
        (ply(vertices=-4), "bad line in its header: 'element vertex -4'"),
        (ply().replace("float x", "quad x"), "bad line in its header: 'property quad x'"),
        (ply().replace("end_header\n", ""), "end_header"),
        (ply().replace("element vertex 4\n", ""), "bad line in its header"),
        (ply(body="0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 4\n"), "names the point 4"),
        (ply(body="0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 -1\n"), "names the point -1"),
        (ply(body="0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 a 3\n"), "cannot be read"),
        (ply(faces=0), "0 triangles"),
    ],
)
def test_wrong_ply_is_refused(tmp_path, text, said):
    assert said in refusal(tmp_path / "a.ply", text)


def test_wrong_stl_is_refused(tmp_path):
    path = tmp_path / "a.stl"
    whole = stl_bytes(box())
    assert "12 triangles in 684 bytes; truncated" in refusal(path, whole[:-1])
    assert "4294967295 triangles in 214748364834 bytes" in refusal(path, stl_bytes(box(), 2**32 - 1))
    assert "no ASCII STL" in refusal(path, b"\x89PNG")
    text = trimesh.Trimesh(**trimesh.triangles.to_kwargs(box())).export(file_type="stl_ascii")
    assert len(read(path, text)) == 12
    assert "no matching 'endsolid'" in refusal(path, text[: len(text) // 2])
    assert "cannot be read" in refusal(path, text.replace("vertex", "vertx", 1))
    assert "12 facets but corners for 11" in refusal(path, text.replace("vertex", "vertx", 3))
    assert "cannot be read" in refusal(
        path, text.replace("vertex 0", "vertex o", 1).replace("vertex -0", "vertex -o", 1)
    )
    assert "continues after" in refusal(path, text + text[: len(text) // 2])
    assert len(read(path, text + text)) == 24


@pytest.mark.parametrize("name", ["stl", "ply", "binary ply"])
def test_count_that_the_file_cannot_hold_takes_no_memory(tmp_path, name):
    content = {
        "stl": stl_bytes(box(), 2**31),
        "ply": ply(vertices=10**9).encode(),
        "binary ply": ply(vertices=10**9, form="binary_little_endian").encode(),
    }[name]
    path = tmp_path / f"a.{name[-3:]}"
    refusal(path, content)
    tracemalloc.start()
    refusal(path, content)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 200_000
