"""Reading USD in a process of its own: damage, crashes, hangs and hunger for memory end in words."""

import subprocess
import sys
import time

import numpy as np
import pytest
import trimesh
from pxr import Gf, Usd, UsdGeom, Vt

from warpdem.errors import SceneError
from warpdem.usd import stage as usd_stage

BALL = trimesh.creation.icosphere(subdivisions=2)


@pytest.fixture(scope="module")
def stage_bytes(tmp_path_factory):
    """A binary stage with a mesh under a transform with samples."""
    path = tmp_path_factory.mktemp("usd") / "ball.usdc"
    stage = Usd.Stage.CreateNew(str(path))
    arm = UsdGeom.Xform.Define(stage, "/Arm").AddTranslateOp()
    for code in range(5):
        arm.Set(Gf.Vec3d(code, 0, 0), code)
    mesh = UsdGeom.Mesh.Define(stage, "/Arm/Ball")
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(np.array(BALL.vertices, np.float32)))
    mesh.CreateFaceVertexCountsAttr([3] * len(BALL.faces))
    mesh.CreateFaceVertexIndicesAttr(BALL.faces.ravel().tolist())
    stage.Save()
    return path.read_bytes()


def refusal(path, what="geometry", prim="") -> str:
    with pytest.raises(SceneError) as caught:
        usd_stage.read(path, what, prim, "walls[0].mesh")
    return str(caught.value)


def test_answer_holds_units_and_arrays(tmp_path, stage_bytes):
    (tmp_path / "a.usdc").write_bytes(stage_bytes)
    said, arrays = usd_stage.read(tmp_path / "a.usdc", "motion", "/Arm/Ball", "frame")
    assert (said["metres"], said["up"], said["rate"]) == (0.01, "Y", 24.0)
    assert arrays["codes"].tolist() == [0, 1, 2, 3, 4]
    assert arrays["matrices"][:, 0, 3].tolist() == [0, 1, 2, 3, 4]


@pytest.mark.parametrize("name", ["cut.usdc", "noise.usdc", "noise.usda", "text.usda", "empty.usdz", "stl.usd"])
def test_damaged_file_is_refused(tmp_path, stage_bytes, name):
    noise = bytearray(stage_bytes)
    noise[len(noise) // 2 :] = np.random.default_rng(0).bytes(len(noise) - len(noise) // 2)
    content = {
        "cut.usdc": stage_bytes[: len(stage_bytes) // 2],
        "noise.usdc": bytes(noise),
        "noise.usda": b"#usda 1.0\n" + bytes(range(256)),
        "text.usda": b"Dear all, please find attached the drum.",
        "empty.usdz": b"",
        "stl.usd": BALL.export(file_type="stl"),
    }[name]
    (tmp_path / name).write_bytes(content)
    assert f"walls[0].mesh: {name}: cannot be read as USD: " in refusal(tmp_path / name)


def test_counts_of_a_crate_file_are_not_believed(tmp_path, stage_bytes):
    """Eight bytes after another of the tables at the end become a count far beyond the file."""
    begin = time.monotonic()
    for at in range(len(stage_bytes) - 400, len(stage_bytes) - 8, 80):
        wrong = bytearray(stage_bytes)
        wrong[at : at + 8] = (2**40).to_bytes(8, "little")
        (tmp_path / "a.usdc").write_bytes(wrong)
        try:
            said, _ = usd_stage.read(tmp_path / "a.usdc", "geometry", "/Arm", "mesh")
        except SceneError:
            continue
        assert said["surfaces"]
    assert time.monotonic() - begin < 30.0


@pytest.fixture
def reader(monkeypatch, tmp_path):
    """Puts other code in the place of the reader."""

    def replace(code):
        (tmp_path / "reader.py").write_text(code)
        monkeypatch.setattr(usd_stage, "PROGRAM", tmp_path / "reader.py")
        (tmp_path / "a.usda").write_text("#usda 1.0\n")
        return tmp_path / "a.usda"

    return replace


def test_crash_of_the_library_is_told(reader):
    path = reader("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)")
    assert "the USD library crashed on it (SIGSEGV)" in refusal(path)


def test_hang_of_the_library_is_ended(reader, monkeypatch):
    monkeypatch.setattr(usd_stage, "TIME_LIMIT", 0.3)
    path = reader("import time; time.sleep(60)")
    begin = time.monotonic()
    assert "reading it took longer than 0.3 s" in refusal(path)
    assert time.monotonic() - begin < 10.0


def test_failure_of_the_reader_is_told_with_its_reason(reader):
    assert "reading it failed: RuntimeError: no such luck" in refusal(reader("raise RuntimeError('no such luck')"))


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the memory of a process can be limited on Linux only")
def test_memory_is_limited():
    code = (
        "import numpy as np, warpdem.core.process_limits as r; r.MEMORY_SLACK = 50_000_000; r.limit_memory(1_000_000);"
        "a = np.ones(7_000_000); print('fits');"
        "b = np.ones(7_000_000)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.strip() == "fits"
    assert "MemoryError" in done.stderr


def test_missing_file_and_unknown_up_axis(tmp_path):
    assert "no such USD file" in refusal(tmp_path / "none.usda")
    text = '#usda 1.0\n(\n upAxis = "X"\n metersPerUnit = 1\n)\ndef Sphere "Ball" {}\n'
    (tmp_path / "x.usda").write_text(text)
    assert "upAxis = 'X', must be Y or Z" in refusal(tmp_path / "x.usda")
    (tmp_path / "zero.usda").write_text(text.replace("metersPerUnit = 1", "metersPerUnit = 0"))
    assert "metersPerUnit = 0, must be above 0" in refusal(tmp_path / "zero.usda")
