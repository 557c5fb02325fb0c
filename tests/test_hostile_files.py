"""Files that claim more than they hold, are none, or hold what numbers cannot: each ends in words and takes no memory.

Scenes, state files, checkpoints, meshes, USD stages, results, and the paths and options of the command line.
"""

import io
import os
import re
import struct
import sys
import zipfile
from pathlib import Path

import h5py
import numpy as np
import psutil
import pytest

from warpdem import Scene, SceneError, Simulation, WarpdemError, load_scene, render
from warpdem.app import cli
from warpdem.core import memory
from warpdem.core.vtk_header import excessive_count
from warpdem.model import needs
from warpdem.output.read_vtk import read_frame
from warpdem.state import checkpoint

pytestmark = pytest.mark.filterwarnings("error", "ignore:Cyclopts application invoked without tokens")

HEAD = """
materials.g = { density = 2500, young_modulus = "10 MPa", poisson_ratio = 0.3 }
pairs = [ { materials = ["g", "g"], restitution = 0.5 } ]
time = { end = 1e-4, step = "1 us" }
"""
GRAIN = 'grains = [ { material = "g", radius = "1 mm", positions = [[0, 0, 0.01]] } ]\n'
GROWTH = 400e6
"""Memory that refusing a file may take [B]: libraries that are loaded for it."""


def refused(folder: Path, text: str | bytes, *overrides: str) -> str:
    """What is said of a scene that must not be set up."""
    file = folder / "scene.toml"
    file.write_bytes(text.encode() if isinstance(text, str) else text)
    before = psutil.Process().memory_info().rss
    with pytest.raises(SceneError) as error:
        Simulation(load_scene(file, overrides), device="cpu", threads=1)
    assert psutil.Process().memory_info().rss - before < GROWTH
    assert error.value.exit_code == 2
    assert "scene.toml" in str(error.value)
    return str(error.value)


# --- text ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text", [b"\xef\xbb\xbf" + (HEAD + GRAIN).encode(), (HEAD + GRAIN).replace("\n", "\r\n").encode(), (HEAD + GRAIN).encode()]
)
def test_text_with_a_mark_or_line_ends_of_windows_is_read(tmp_path, text):
    (tmp_path / "scene.toml").write_bytes(text)
    assert load_scene(tmp_path / "scene.toml").materials["g"].density == 2500


OUTLET = 'outlets = [{{ name = "{}", box = {{ min = [2, 2, 2], max = [3, 3, 3] }} }}]'
TEXTS = {
    "UTF-16": ((HEAD + GRAIN).encode("utf-16"), ["text in UTF-16", "UTF-8: save it in UTF-8"]),
    "UTF-16 without a mark": ((HEAD + GRAIN).encode("utf-16-le"), ["zero byte (byte 1)", "UTF-16"]),
    "zero byte": (HEAD + GRAIN + "\0", ["zero byte"]),
    "bytes": (b"\xff\x80" * 100, ["no text in UTF-8 (byte 0)"]),
    "empty": ("", ["materials", "missing"]),
    "key twice": (HEAD + HEAD, ["line 6", "not valid TOML"]),
    "long number": (HEAD + GRAIN + f"a = 1{'0' * 5000}", ["line 6, column 5", "whole number of 5001 digits", "2^63"]),
    "long number in base 16": (HEAD + GRAIN + f"a = 0x{'f' * 5000}", ["a\n", "about 6021 digits", "2^63"]),
    "lists in lists": (HEAD + GRAIN + f"a = {'[' * 2000}{']' * 2000}", ["nested too deeply", "32 levels"]),
    "tables in tables": (HEAD + GRAIN + f"a = {'{a=' * 2000}1{'}' * 2000}", ["nested too deeply", "32 levels"]),
    "dots in dots": (HEAD + GRAIN + f"{'.'.join('a' * 2000)} = 1", ["a.a.a.a", "nested too deeply"]),
    "control characters": (HEAD + GRAIN + 'b = "\x1b[31m"', ["line 6", "not valid TOML", "\\x1b[31m"]),
    "name as a path": (HEAD + GRAIN + OUTLET.format("../x"), ["outlets[0].name", "letters"]),
    "long name": (HEAD + GRAIN + OUTLET.format("x" * 300), ["outlets[0].name", "100 bytes", "is 300"]),
    "control characters in a name": (HEAD.replace("als.g", 'als."a\\u0007"') + GRAIN, ["materials", "control char"]),
}


@pytest.mark.parametrize("case", TEXTS)
def test_text_that_is_no_scene(tmp_path, case):
    text, words = TEXTS[case]
    said = refused(tmp_path, text)
    for word in words:
        assert word in said, said
    assert "\x1b" not in said and "\x07" not in said and len(said) < 2000


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("title=" + "[" * 2000, ["override", "nested too deeply"]),
        (".".join("a" * 2000) + "=1", ["override", "nested too deeply"]),
        ("time.end=" + "1" * 5001, ["time.end", "a time"]),
        ("grains." + "1" * 5001 + ".radius=1", ["grains is a list of 1"]),
        ("time.end=1 " + "m*" * 3000, ["time.end", "a time"]),
    ],
)
def test_overrides_that_are_no_values(tmp_path, override, words):
    said = refused(tmp_path, HEAD + GRAIN, override)
    for word in words:
        assert word in said, said


def test_walls_that_differ_in_case_only_would_share_files(tmp_path):
    wall = '[[walls]]\nname = "{}"\nmaterial = "g"\nplane = {{ point = [0, 0, 0], normal = [0, 0, 1] }}\n'
    said = refused(tmp_path, HEAD + GRAIN + wall.format("Lid") + wall.format("lid"))
    assert 'walls[1].name = "lid"' in said and 'walls[0] is "Lid"' in said


# --- numbers -------------------------------------------------------------------------------------------------------------

NUMBERS = {
    "grains.0.radius=1e-200": ["grains[0].radius = 1e-200", "from 1e-12 to 1e+12 [m]"],
    "grains.0.radius=1e300": ["grains[0].radius", "from 1e-12 to 1e+12 [m]"],
    "grains.0.positions=[[0, 0, 1e300]]": ["grains[0].positions", "entry [0][2] = 1e+300", "at most 1e+12 [m] in magnitude"],
    "grains.0.positions=[[0, 0, 1e11]]": ["grains[0]: grain 0", "1e+11 m from the origin", "allowed is up to"],
    "grains.0.velocities=[[0, 0, 1e200]]": ["grains[0].velocities", "at most 1e+12 [m/s]"],
    "grains.0.spins=[[0, 0, 1e200]]": ["grains[0].spins", "at most 1e+12 [rad/s]"],
    "gravity=[0, 0, 1e200]": ["gravity[2] = 1e+200", "at most 1e+15 [m/s2]"],
    "materials.g.density=1e300": ["materials.g.density", "from 1e-09 to 1e+18 [kg/m3]"],
    "materials.g.young_modulus=1e-300": ["materials.g.young_modulus", "from 1e-09 to 1e+21 [Pa]"],
    "time.end=1e300": ["time.end", "from 1e-24 to 1e+15 [s]"],
    "time.step=1e-300": ["time.step", "from 1e-24 to 1e+15 [s]", '"auto"'],
    "time.step=1e-21": ["time.end = 0.0001 s is 1e+17 steps", "can be counted"],
    "frame={axis=[0, 0, 1], rate=1e200}": ["frame.rate", "at most 1e+12 [rad/s]"],
    "grains.0.radius=1e12": ["grains[0]: grain 0", "materials.g.density = 2500 kg/m3", "make a mass of"],
    "grains.0.radius='1e999999999 m'": ["grains[0].radius", "must be finite"],
}


@pytest.mark.parametrize("override", NUMBERS)
def test_numbers_that_cannot_be_computed_with(tmp_path, override):
    said = refused(tmp_path, HEAD + GRAIN, override)
    for word in NUMBERS[override]:
        assert word in said, said


@pytest.mark.parametrize("radius", [1e-7, 1e-6, 1.0, 1e3])
def test_powders_and_boulders_are_computed(tmp_path, radius):
    (tmp_path / "scene.toml").write_text(HEAD + GRAIN)
    place = f"grains.0.positions=[[0, 0, {3 * radius}], [0, 0, {5 * radius}]]"
    changes = [f"grains.0.radius={radius}", place, "time.step=auto", "time.end=1e3", "engine.precision=mixed"]
    sim = Simulation(load_scene(tmp_path / "scene.toml", changes), device="cpu", threads=1)
    sim.step(3)
    assert np.isfinite(sim.particles.position).all()


@pytest.mark.parametrize("cell", [1e-12, 0.5])
def test_cells_of_mixing_may_be_small(cell):
    from warpdem.measure.mixing import lacey_index

    place = np.array([[1e12, 0.0, -1e12], [-0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [5.0, 5.0, 5.0]])
    # the two in the middle share a cell, the others have one each: (1/4 - 1/8)/(1/4 - 3/16)
    assert lacey_index(np.array([True, True, False, False]), place, cell) == 2.0


# --- memory --------------------------------------------------------------------------------------------------------------


def test_the_limit_of_a_container_counts(tmp_path, monkeypatch):
    """Of both versions of control groups, wherever in the tree the limit is; cached files count as free."""
    (tmp_path / "a" / "b").mkdir(parents=True)
    monkeypatch.setattr(memory, "CGROUPS", tmp_path)
    monkeypatch.setattr(memory, "Path", lambda name: proc if name == "/proc/self/cgroup" else Path(name))
    proc = tmp_path / "cgroup"
    proc.write_text("0::/a/b\n")
    for folder, most in ((tmp_path / "a", "900000000"), (tmp_path / "a" / "b", "max")):
        (folder / "memory.max").write_text(most)
        (folder / "memory.current").write_text("600000000\n")
        (folder / "memory.stat").write_text("anon 1\ninactive_file 100000000\n")
    assert memory.available() == 400_000_000
    proc.write_text("5:cpu,memory:/docker/x\n")
    (tmp_path / "memory").mkdir()
    (tmp_path / "memory" / "memory.limit_in_bytes").write_text("500000000")
    (tmp_path / "memory" / "memory.usage_in_bytes").write_text("200000000")
    (tmp_path / "memory" / "memory.stat").write_text("total_inactive_file 0\n")
    assert memory.available() == 300_000_000


def test_a_limit_of_the_shell_counts():
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_DATA)
    used = int(Path("/proc/self/status").read_text().split("VmData:")[1].split()[0]) * 1024
    resource.setrlimit(resource.RLIMIT_DATA, (used + 300_000_000, before[1]))
    try:
        assert memory.available() <= 300_000_000
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, before)


FILL = 'grains = [{{ material = "g", fill = {{ box = {{ min = [0, 0, 0], max = [{0}, {0}, {0}] }}, {1}, diameter = "{2}" }} }}]'
GRID = "measures.grid = {{ box = {{ min = [0, 0, 0], max = [1, 1, 1] }}, cell = {} }}"
BEYOND = {
    "count": (FILL.format(100, "count = 1000000000000", "5 mm"), ["grains[0].fill", "1e+12 grains", "3.5e+05 GB", "available"]),
    "small grains": (FILL.format(1, "count = 1000000000", "0.5 mm"), ["grains[0].fill", "1e+09 grains", "350 GB", "available"]),
    "count in a small box": (FILL.format(0.01, "count = 1000000000000", "5 mm"), ["grains[0].fill", "solid fraction", "0.74"]),
    "mass": (FILL.format(1000, 'mass = "1e9 kg"', "0.1 mm"), ["grains[0].fill", "GB", "available"]),
    "solid fraction": (FILL.format(100, "solid_fraction = 0.4", "0.1 mm"), ["grains[0].fill", "GB", "available"]),
    "grid": (GRAIN + GRID.format(1e-5), ["measures.grid.cell = 1e-05 m", "1e+15 points", "GB", "take a larger cell"]),
    "finest grid": (GRAIN + GRID.format(1e-12), ["measures.grid.cell", "1e+36 points", "available"]),
    "wide kernel": (GRAIN + GRID.format("0.1, width = 1000"), ["measures.grid.width = 1000 m", "1e+04 cells", "at most 50"]),
}


@pytest.mark.parametrize("case", BEYOND)
def test_more_than_the_memory_holds_is_refused_with_both_numbers(tmp_path, case):
    text, words = BEYOND[case]
    said = refused(tmp_path, HEAD + text)
    for word in words:
        assert word in said, said


def test_grains_that_fit_are_not_refused_and_told_from_eight_tenths(tmp_path, monkeypatch):
    from warpdem.app import scene_warnings

    (tmp_path / "scene.toml").write_text(HEAD + FILL.format(0.05, "count = 300", "2 mm"))
    scene = load_scene(tmp_path / "scene.toml")
    sim = Simulation(scene, device="cpu", threads=1)
    each = sim.plan.bytes_per_grain
    needed = needs.memory_bytes(scene, each, 300)
    for share, warned in ((0.7, False), (0.9, True)):
        monkeypatch.setattr(memory, "available", lambda share=share: needed / share - 300 * each)
        assert any("of memory" in text for text in scene_warnings.warnings(sim)) == warned
    monkeypatch.setattr(memory, "available", lambda: 300 * each)
    Simulation(scene, device="cpu", threads=1)
    monkeypatch.setattr(memory, "available", lambda: 300 * each - 1)
    with pytest.raises(SceneError, match=f"300 grains need .* kB of memory, {each} B each, and .* kB are available"):
        Simulation(scene, device="cpu", threads=1)


# --- state files ---------------------------------------------------------------------------------------------------------

VTP = (
    '<?xml version="1.0"?><VTKFile type="PolyData"><PolyData><Piece NumberOfPoints="{}"><PointData><DataArray type="Float64" '
    'Name="radius" format="ascii" NumberOfTuples="{}">1e-3</DataArray></PointData><Points><DataArray type="Float64" '
    'NumberOfComponents="3" format="ascii">0 0 {}</DataArray></Points></Piece></PolyData></VTKFile>'
)
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
            file.attrs["format"] = checkpoint.FORMAT
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


# --- paths and options ---------------------------------------------------------------------------------------------------


@pytest.fixture
def said_by(monkeypatch, capfd):
    """A function of the arguments of the command that returns exit code and standard error."""

    def call(*arguments: str) -> tuple[int, str]:
        monkeypatch.setattr(sys, "argv", ["warpdem", *arguments])
        code = 0
        try:
            cli.main()
        except SystemExit as end:
            code = end.code or 0
        return code, capfd.readouterr().err

    return call


@pytest.fixture
def strange(tmp_path) -> dict[str, str]:
    """Paths that are no files to read, by kind."""
    os.mkfifo(tmp_path / "pipe.toml")
    (tmp_path / "circle.toml").symlink_to("circle.toml")
    (tmp_path / "folder.toml").mkdir()
    return {
        "pipe": str(tmp_path / "pipe.toml"), "device": "/dev/zero", "folder": str(tmp_path / "folder.toml"),
        "circle": str(tmp_path / "circle.toml"), "long": "x" * 5000, "deep": "a/" * 3000, "home": "~nobody-here/x.toml",
        "bytes": str(tmp_path / os.fsdecode(b"\xff.toml")), "missing": str(tmp_path / "missing.toml"),
        "control": str(tmp_path / "a\x1b[31m.toml"),
    }  # fmt: skip


KINDS = ("pipe", "device", "folder", "circle", "long", "deep", "home", "bytes", "missing", "control")


@pytest.mark.parametrize("kind", KINDS)
def test_paths_that_are_no_scene(strange, said_by, tmp_path, kind):
    for command in (("check",), ("run",), ("convert",)):
        more = (str(tmp_path / "out.usda"),) if command == ("convert",) else ()
        code, error = said_by(*command, strange[kind], *more)
        assert code == 2, error
        assert 1 <= len(error.strip().splitlines()) <= 3 and "Traceback" not in error and "\x1b" not in error
    wall = '[[walls]]\nname = "a"\nmaterial = "g"\nmesh = "{}"\n'
    name = strange[kind].replace(".toml", ".stl").encode("unicode_escape").decode()
    if kind in ("pipe", "circle", "folder"):
        Path(strange[kind]).rename(strange[kind].replace(".toml", ".stl"))
    if kind not in ("bytes", "device"):
        assert "walls[0].mesh" in refused(tmp_path, HEAD + GRAIN + wall.format(name.replace("\\x1b", "\\u001b")))


@pytest.mark.parametrize("kind", ("long", "deep"))
def test_paths_that_no_results_can_have(strange, said_by, tmp_path, kind):
    (tmp_path / "scene.toml").write_text(HEAD + GRAIN)
    for arguments in (("run", str(tmp_path / "scene.toml"), "--out"), ("render",), ("render", str(tmp_path), "--out"),
                      ("demo", "pile", "--out"), ("convert", str(tmp_path / "scene.toml"))):  # fmt: skip
        code, error = said_by(*arguments, strange[kind])
        assert code == 2 and "Traceback" not in error, error


@pytest.fixture(scope="module")
def results(tmp_path_factory) -> Path:
    """Results of two frames."""
    from warpdem.app.run import run_scene

    folder = tmp_path_factory.mktemp("results")
    data = {
        "materials": {"[/b]": {"density": 2500, "young_modulus": 1e7, "poisson_ratio": 0.3}},
        "title": "[/bold] [red] \x1b[31m",
        "pairs": [{"materials": ["[/b]", "[/b]"], "restitution": 0.5}],
        "streams": [{"material": "[/b]", "box": {"min": [0, 0, 0], "max": [1, 1, 1]}, "diameter": 0.1, "count_rate": 1e7}],
        "time": {"end": 1e-4, "step": 1e-6},
        "output": {"formats": ["vtk"], "interval": 1e-4},
    }
    run_scene(Scene.model_validate(data), folder, device="cpu", threads=1, picture=False)  # brackets are no markup
    return folder


OPTIONS = {
    "--size 100000 100000": "64 to 8192", "--zoom nan": "above 0", "--height inf": "above 0", "--opacity nan": "0 to 1",
    "--colour-range nan 1": "colour_range", "--time nan": "time nan", "--time 1e300": "go from",
    "--out a.mp4 --fps 1e300": "at most 1000", "--out a.mp4 --fps nan": "at most 1000",
    "--out a.mp4 --speed 1e-300": "pictures", "--out a.mp4 --speed nan": "above 0", "--out a.mp4 --start nan": "no frame",
}  # fmt: skip


@pytest.mark.parametrize("options", OPTIONS)
def test_options_of_pictures_beyond_all_measure(results, said_by, monkeypatch, tmp_path, options):
    monkeypatch.chdir(tmp_path)
    code, error = said_by("render", str(results), *options.split())
    assert code != 0 and "Traceback" not in error
    assert OPTIONS[options] in " ".join(error.split()), error


def test_no_machine_has_a_thousand_million_threads(said_by, tmp_path):
    (tmp_path / "scene.toml").write_text(HEAD + GRAIN)
    code, error = said_by("check", str(tmp_path / "scene.toml"), "--device", "cpu", "--threads", "1000000000")
    assert code == 2 and "threads = 1000000000" in error and "1024" in error
