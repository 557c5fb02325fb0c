"""State files, checkpoints, meshes, USD stages and results that claim more than they hold: messages, in bounded memory."""

import io
import re
import struct
import zipfile

import h5py
import numpy as np
import pytest

from hostile import GRAIN, HEAD, VTP, refused
from warpdem import SceneError, Simulation, WarpdemError, load_scene, render
from warpdem.core.vtk_header import excessive_count
from warpdem.output.read_vtk import read_frame
from warpdem.state import checkpoint_file

pytestmark = pytest.mark.filterwarnings("error", "ignore:Cyclopts application invoked without tokens")
RAW = (
    b'<?xml version="1.0"?><VTKFile type="PolyData" byte_order="LittleEndian" header_type="UInt64"><PolyData>'
    b'<Piece NumberOfPoints="1"><PointData><DataArray type="Float64" Name="radius" format="appended" offset="0"/></PointData>'
    b'<Points><DataArray type="Float64" NumberOfComponents="3" format="appended" offset="99999999999"/></Points></Piece>'
    b'</PolyData><AppendedData encoding="raw">_' + struct.pack("<Q", 10**13) + b"abc</AppendedData></VTKFile>"
)


def archive(**arrays: bytes) -> bytes:
    """An .npz with these bytes for its arrays."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as file:
        for name, data in arrays.items():
            file.writestr(f"{name}.npy", data)
    return out.getvalue()


def header(shape: tuple[int, ...], kind: str = "<f8") -> bytes:
    """The head of an .npy file that claims an array."""
    out = io.BytesIO()
    np.lib.format.write_array_header_1_0(out, {"descr": kind, "fortran_order": False, "shape": shape})
    return out.getvalue()


def stored(**arrays) -> bytes:
    """An .npz of true arrays."""
    out = io.BytesIO()
    np.savez(out, **arrays)
    return out.getvalue()


ONE = {"position": [[0.0, 0.0, 0.01]], "radius": [1e-3]}
ROWS = b"x,y,z,radius\n"
STATES = {
    "points.vtp": (VTP.format(10**12, 1, 0.01), ["NumberOfPoints = 1000000000000", "bytes long"]),
    "tuples.vtp": (VTP.format(1, 10**12, 0.01), ["NumberOfTuples = 1000000000000", "bytes long"]),
    "components.vtp": (VTP.replace('Components="3"', 'Components="999999999999"').format(1, 1, 0.01),
                       ["NumberOfComponents = 999999999999"]),
    "raw.vtp": (RAW, ["raw.vtp"]),
    "empty.vtp": ("", ["empty.vtp", "cannot be read as .vtp"]),
    "tags.vtp": ("<a>" * 20000, ["tags.vtp", "cannot be read as .vtp"]),
    "far.vtp": (VTP.format(1, 1, 1e300), ["far.vtp: row 1: position", "at most 1e+12 [m]"]),
    "rows.npz": (archive(position=header((10**12, 3)), radius=b""), ["position", "(1000000000000, 3)", "0 follow"]),
    "nonsense.npz": (archive(position=b"nonsense", radius=b""), ["cannot be read as .npz"]),
    "code.npz": (archive(position=header((1, 3), "|O") + b"x", radius=b""), ["no archive of plain arrays"]),
    "version.npz": (archive(position=b"\x93NUMPY\x09\x09" + b"x" * 50, radius=b""), ["cannot be read as .npz"]),
    "deep.npz": (archive(position=b"\x93NUMPY\x01\x00" + struct.pack("<H", 9000) + b"(" * 9000, radius=b""), [".npz"]),
    "one.npz": (b"\x93NUMPY\x01\x00", ["cannot be read as .npz"]),
    "id.npz": (stored(**ONE, id=np.array([2**64 - 1], dtype=np.uint64)), ["id", "from 0 to 2^63 - 1"]),
    "far.npz": (stored(position=[[0, 0, 1e300]], radius=[1e-3]), ["position", "at most 1e+12 [m]"]),
    "small.npz": (stored(position=[[0, 0, 0.01]], radius=[1e-300]), ["radius", "from 1e-12 to 1e+12 [m]"]),
    "complex.npz": (stored(position=np.zeros((1, 3), complex), radius=[1e-3]), ["must hold numbers, holds complex128"]),
    "far.csv": (ROWS + b"0,0,1e300,1e-3\n", ["row 1: position", "at most 1e+12 [m]"]),
    "sixteen.csv": ("x,y,z,radius\n0,0,0,1\n".encode("utf-16"), ["unknown column"]),
    "line.csv": (b"x" * 5_000_000, ["unknown column"]),
    "wide.csv": (ROWS + b"0," * 500_000 + b"\n", ["wide.csv"]),
    "zero.csv": (ROWS + b"0,0,\0,1e-3\n", ["must hold numbers"]),
}


@pytest.mark.parametrize("name", STATES)
def test_state_files_that_claim_or_hold_too_much(tmp_path, name):
    data, words = STATES[name]
    (tmp_path / name).write_bytes(data.encode() if isinstance(data, str) else data)
    said = refused(tmp_path, HEAD + f'grains = [{{ material = "g", file = "{name}" }}]')
    for word in ["grains[0].file", *words]:
        assert word in said, said
    assert len(said) < 2000


@pytest.mark.parametrize(
    ("name", "data"), [("a.vtp", VTP.format(1, 1, 0.01).encode()), ("a.npz", stored(**ONE)),
                       ("a.csv", b"\xef\xbb\xbf" + ROWS.replace(b"\n", b"\r\n") + b"0,0,0.01,1e-3\r\n")],
)  # fmt: skip
def test_state_files_of_one_grain_are_read(tmp_path, name, data):
    (tmp_path / name).write_bytes(data)
    (tmp_path / "scene.toml").write_text(HEAD + f'grains = [{{ material = "g", file = "{name}" }}]')
    sim = Simulation(load_scene(tmp_path / "scene.toml"), device="cpu", threads=1)
    assert sim.particles.position.tolist() == [[0.0, 0.0, 0.01]]


@pytest.mark.parametrize("name", ["sparse.npz", "sparse.csv", "sparse.stl", "sparse.usda", "sparse.toml"])
def test_files_larger_than_the_memory_are_not_read(tmp_path, name):
    """Sparse ones: they take no place on the disk."""
    with (tmp_path / name).open("wb") as file:
        file.write(ROWS if name.endswith("csv") else b"#usda 1.0\n" if name.endswith("usda") else b"\0" * 80)
        file.write(struct.pack("<I", 10**9) if name.endswith("stl") else b"")
        try:
            file.truncate(84 + 50 * 10**9)
        except OSError:
            pytest.skip("the file system knows no sparse files of 50 GB")
    if name.endswith(("usda", "toml")):
        with pytest.raises(SceneError, match=f"{name}.*(GB of memory|50.* bytes)"):
            load_scene(tmp_path / name)
        return
    text = f'grains = [{{ material = "g", file = "{name}" }}]'
    if name.endswith("stl"):
        text = GRAIN + f'[[walls]]\nname = "a"\nmaterial = "g"\nmesh = "{name}"\n'
    said = refused(tmp_path, HEAD + text)
    assert name in said and ("GB" in said or "cannot be read" in said), said


def test_checkpoints_that_claim_or_name_what_they_do_not_hold(tmp_path):
    for name in ("claims", "links", "outside"):
        with h5py.File(tmp_path / f"{name}.h5", "w") as file:
            file.attrs["format"] = checkpoint_file.FORMAT
            file.attrs["scene"], file.attrs["about"], file.attrs["digest"] = "{}", "{}", "x"
            if name == "claims":
                file.create_dataset("record", shape=(10**12,), dtype="f8", chunks=(1000,))
            elif name == "links":
                file["record"] = h5py.ExternalLink("other.h5", "x")
            else:
                (tmp_path / "raw").write_bytes(b"secret!!")
                file.create_dataset("record", shape=(1,), dtype="f8", external=[(str(tmp_path / "raw"), 0, 8)])
        said = refused(tmp_path, HEAD + f'start = {{ checkpoint = "{name}.h5" }}')
        assert "record" in said and "start.checkpoint" in said, said


# --- meshes, stages, results ---------------------------------------------------------------------------------------------

PLY = (
    "ply\nformat ascii 1.0\nelement vertex 1000000000000\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
)
MESHES = {
    "count.stl": b"\0" * 80 + struct.pack("<I", 10**9),
    "index.obj": b"v 0 0 0\nv 1 0 0\nf 1 2 999999999999\n",
    "corners.obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf " + b"1 " * 400_000 + b"\n",
    "digits.obj": b"v 0 0 0\nf " + b"1" * 6000 + b" 2 3\n",
    "vertices.ply": PLY.encode(),
    "far.obj": b"v 0 0 0\nv 1e20 0 0\nv 0 1e20 0\nf 1 2 3\n",
}


@pytest.mark.parametrize("name", MESHES)
def test_meshes_that_claim_too_much(tmp_path, name):
    (tmp_path / name).write_bytes(MESHES[name])
    said = refused(tmp_path, HEAD + GRAIN + f'[[walls]]\nname = "a"\nmaterial = "g"\nopen = true\nmesh = "{name}"\n')
    assert "walls[0].mesh" in said and name in said, said
    assert len(said) < 2000


STAGES = {
    "metadata": 'def PhysicsScene "S" (customData = ' + "{ dictionary a = " * 2000 + "{}" + "}" * 2000 + ") {\n}\n",
    "key": 'def PhysicsScene "S" {\n custom double dem:' + ":".join("a" * 1500) + " = 1\n}\n",
    "prims": 'def Xform "S" {\n' * 3000 + "}\n" * 3000,
}


@pytest.mark.parametrize("case", STAGES)
def test_stages_nested_too_deeply(tmp_path, case):
    (tmp_path / "a.usda").write_text('#usda 1.0\n(metersPerUnit = 1\nupAxis = "Z")\n' + STAGES[case])
    with pytest.raises(SceneError, match=re.escape("a.usda")) as error:
        load_scene(tmp_path / "a.usda")
    assert len(str(error.value)) < 3000


def test_results_that_claim_too_many_grains_are_not_drawn(tmp_path):
    (tmp_path / "grains_000000.vtp").write_text(VTP.format(10**12, 1, 0.01))
    assert "NumberOfPoints" in excessive_count(tmp_path / "grains_000000.vtp")
    with pytest.raises(WarpdemError, match="NumberOfPoints = 1000000000000"):
        read_frame(tmp_path / "grains_000000.vtp")
    line = '<DataSet timestep="0" group="" part="0" name="grains" file="grains_000000.vtp"/>'
    (tmp_path / "result.pvd").write_text(f'<VTKFile type="Collection"><Collection>{line}</Collection></VTKFile>')
    with pytest.raises(WarpdemError, match="NumberOfPoints = 1000000000000"):
        render(tmp_path, tmp_path / "picture.png")
