"""Frames in pieces, in each format: they hold what a whole frame holds, through resumes with other numbers of pieces."""

from dataclasses import replace
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
import pyvista
from numpy.testing import assert_array_equal
from pxr import Usd
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOHDF import vtkHDFReader

from warpdem import SceneError
from warpdem.core.pose import FramePose
from warpdem.core.snapshot import ContactNetwork, Snapshot
from warpdem.errors import OutputError, WarpdemError
from warpdem.output import own_pieces
from warpdem.output.formats import FORMATS, writer_of
from warpdem.output.pieces import joined_grains, piece_of, without_grains
from warpdem.output.read_vtk import read_results
from warpdem.output.read_vtkhdf import read_vtkhdf
from warpdem.scene.file import scene_from_dict

COUNTS = (20, 20, 31, 0, 25, 25)
"""Grains of each frame."""


def snapshot(k: int) -> Snapshot:
    """Frame ``k``: radii and masses change with the number of grains alone."""
    rng, same, count = np.random.default_rng(k), np.random.default_rng(COUNTS[k]), COUNTS[k]
    i = np.sort(rng.integers(0, max(count, 1), 2 * count))
    at_wall = np.arange(2 * count) >= count
    i[count:] = np.sort(i[count:])
    vectors = rng.random((4, 2 * count, 3))
    network = ContactNetwork(
        i * 3, np.where(at_wall, -1, i * 3 + 3), np.where(at_wall, 0, -1).astype(np.int32), *vectors[:3], rng.random(2 * count),
        vectors[3], rng.random(2 * count), (i % 2).astype(np.int8), 0.1 * vectors[2],
    )  # fmt: skip
    return Snapshot(
        step=1000 * k, time=0.1 * k, frame=FramePose.rotated(np.array([0.0, 0.6, 0.8]), np.zeros(3), 2.5 * k, 25.0),
        id=np.arange(count) * 3, type=np.zeros(count, dtype=np.int32), group=np.zeros(count, dtype=np.int32),
        radius=same.uniform(0.01, 0.02, count), mass=same.uniform(1.0, 2.0, count), position=rng.random((count, 3)),
        velocity=rng.random((count, 3)), spin=rng.random((count, 3)), force=rng.random((count, 3)), contacts=network,
        gravity=np.array([0.0, 0.0, -9.81]),
    )  # fmt: skip


def scene(pieces: str = "ranks"):
    return scene_from_dict({
        "materials": {"a": {"density": 2500, "young_modulus": 1e7, "poisson_ratio": 0.3}},
        "pairs": [{"materials": ["a", "a"], "restitution": 0.5, "friction": 0.1}],
        "grains": [{"material": "a", "positions": [[0, 0, 0]], "radius": 0.01}], "time": {"end": 1, "max_speed": 1},
        "output": {"contacts": True, "formats": list(FORMATS), "pieces": pieces},
    })  # fmt: skip


def write(folder, name, numbers, parts, *, resume=False):
    """Write frames in ``parts`` pieces; of three or more the second is empty."""
    root = writer_of(name, folder, [], scene(), resume, True)
    writers = [FORMATS[name].piece(folder, part, scene(), resume) for part in range(parts)]
    for k in numbers:
        whole = snapshot(k)
        owner = np.where(whole.id % 4 == 0, parts - 1, (whole.id // 3 + (0 if COUNTS[k] == COUNTS[k - 1] else k)) % parts)
        owner[(owner == 1) & (parts > 2)] = 0
        written = [writer.write(piece_of(whole, owner == part)) for part, writer in enumerate(writers)]
        root.join(without_grains(whole), written)
    root.close()


def same(alone: dict[str, np.ndarray], shared: dict[str, np.ndarray]) -> None:
    assert alone.keys() == shared.keys()
    for name, values in alone.items():
        assert values.dtype == shared[name].dtype
        assert_array_equal(shared[name], values, err_msg=name)


@pytest.mark.parametrize(("name", "read"), [("vtk", read_results), ("vtkhdf", read_vtkhdf)])
def test_pieces_hold_what_a_whole_frame_holds(tmp_path, name, read):
    """Three ranks, then from a frame before the end one, then from another four."""
    write(tmp_path / "pieces", name, range(4), 3)
    write(tmp_path / "pieces", name, range(2, 5), 1, resume=True)
    write(tmp_path / "pieces", name, range(4, 6), 4, resume=True)
    writer = writer_of(name, tmp_path / "whole", [], scene())
    for k in range(6):
        writer.write(snapshot(k))
    writer.close()
    alone, shared = read(tmp_path / "whole"), read(tmp_path / "pieces")
    assert_array_equal(shared.times, alone.times)
    for k in range(6):
        same(alone.fields(k), shared.fields(k))
        same(alone.contacts(k), shared.contacts(k))
        one, many = alone.frame(k), shared.frame(k)
        assert (one.step, one.time) == (many.step, many.time)
        assert_array_equal(many.position, one.position)
        assert_array_equal(many.frame.translation, one.frame.translation)
        assert_array_equal(many.gravity, one.gravity)


def test_vtk_reads_joined_files_at_any_time(tmp_path):
    """Its own reader, and each piece by itself."""
    write(tmp_path, "vtkhdf", range(6), 3)
    for k in (5, 2, 3, 0):
        found = {}
        for key, file in {"whole": "result.vtkhdf", **{str(p): f"result_vtkhdf/{p}/result.vtkhdf" for p in range(3)}}.items():
            reader = vtkHDFReader()
            reader.SetFileName(str(tmp_path / file))
            reader.UpdateInformation()
            reader.SetStep(k)
            reader.Update()
            data = reader.GetOutputDataObject(0)
            assert data.GetNumberOfCells() == data.GetNumberOfPoints()
            found[key] = vtk_to_numpy(data.GetPointData().GetArray("id")).tolist() if data.GetNumberOfPoints() else []
        assert found["0"] + found["1"] + found["2"] == found["whole"] and not found["1"]
        assert sorted(found["whole"]) == snapshot(k).id.tolist()


def test_pyvista_reads_the_pieces_as_parts_of_a_frame(tmp_path):
    """As it reads walls; all grains are there."""
    write(tmp_path, "vtk", range(3), 3)
    reader = pyvista.get_reader(tmp_path / "result.pvd")
    reader.set_active_time_value(0.2)
    ids = [part["id"] for part in reader.read()]
    assert len(ids) == 2  # one is empty
    assert sorted(np.concatenate(ids)) == snapshot(2).id.tolist()


def test_arrays_that_no_rank_wrote_again_are_joined_once(tmp_path):
    write(tmp_path, "vtkhdf", range(2), 2)
    with h5py.File(tmp_path / "result.vtkhdf") as file:
        assert len(file["VTKHDF/PointData/radius"]) == COUNTS[0]
        assert len(file["VTKHDF/PointData/v"]) == 2 * COUNTS[0]


def test_a_joined_file_without_its_pieces_is_refused(tmp_path):
    """HDF5 itself would read zeros."""
    write(tmp_path, "vtkhdf", range(2), 2)
    (tmp_path / "result_vtkhdf" / "1").rename(tmp_path / "elsewhere")
    with pytest.raises(WarpdemError, match=r"its piece result_vtkhdf/1/result.vtkhdf is not beside it"):
        read_vtkhdf(tmp_path)


def test_a_joined_file_that_is_damaged_is_named(tmp_path):
    (tmp_path / "result.vtkhdf").write_bytes(b"no HDF5")
    with pytest.raises(WarpdemError, match=r"result.vtkhdf: cannot be read as a VTKHDF file"):
        writer_of("vtkhdf", tmp_path, [], scene(), True, True)


def usd_grains(stage: Usd.Stage, code: float) -> Snapshot:
    """Ids and places of the grains of all prims at a time code."""
    pieces = []
    for prim in stage.GetPrimAtPath("/World/Frame").GetChildren():
        if prim.GetName().startswith("Grains"):
            ids, places = (np.array(prim.GetAttribute(name).Get(code)) for name in ("ids", "primvars:dem:positions"))
            pieces.append(replace(without_grains(snapshot(0)), id=ids, position=places.reshape(-1, 3), contacts=None))
    return joined_grains([replace(p, **dict.fromkeys(("type", "group", "radius", "mass", "velocity", "spin", "force"), p.id))
                          for p in pieces])  # fmt: skip


def test_usd_pieces_show_each_frame_of_a_run_with_other_ranks(tmp_path):
    """Before a rank was there, and after it has gone, its prim is empty."""
    write(tmp_path, "usd", range(4), 3)
    write(tmp_path, "usd", range(2, 5), 1, resume=True)
    write(tmp_path, "usd", range(4, 6), 4, resume=True)
    stage = Usd.Stage.Open(str(tmp_path / "result.usda"))
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (0.0, 500.0)
    for k in range(6):
        found, wanted = usd_grains(stage, 100.0 * k), snapshot(k)
        assert_array_equal(found.id, wanted.id)
        assert_array_equal(found.position, wanted.position)


@pytest.mark.parametrize("pieces", [True, False])
@pytest.mark.parametrize(("name", "left"), [("vtk", "result_vtk"), ("vtkhdf", "result_vtkhdf"), ("usd", "result_usd")])
def test_an_overwritten_run_leaves_no_pieces(tmp_path, name, left, pieces):
    """Of more ranks than there are now, or where frames are in one piece now; a run that goes on keeps them."""
    write(tmp_path, name, range(2), 4)
    before = {path for path in (tmp_path / left).rglob("*") if path.is_file()}
    assert len(before) >= 4
    writer_of(name, tmp_path, [], scene(), True, True).close()
    assert {path for path in (tmp_path / left).rglob("*") if path.is_file()} == before
    writer_of(name, tmp_path, [], scene(), False, pieces).close()
    assert not [path for path in (tmp_path / left).rglob("*") if path.is_file() and path.stem != "walls"]


@pytest.mark.parametrize(("pieces", "grains", "wanted"), [
    ("auto", own_pieces.MANY, False), ("auto", own_pieces.MANY + 1, True), ("one", own_pieces.MANY + 1, False),
    ("ranks", 1, True),
])  # fmt: skip
def test_what_is_in_pieces(pieces, grains, wanted):
    assert own_pieces.in_pieces(scene(pieces), grains) == wanted
    with pytest.raises(SceneError, match=r'output.pieces = "two"'):
        scene("two")


def test_a_folder_that_cannot_be_made_is_named(tmp_path):
    (tmp_path / "result_vtk").write_text("")
    with pytest.raises(OutputError, match="cannot be written"):
        own_pieces.OwnPieces(scene(), tmp_path, 1, False)


def test_of_a_rank_only_its_own_is_written(monkeypatch):
    """Of the contacts of two grains those of the lower id, wherever the other is; no ghosts, and no loads."""
    whole, seen = replace(snapshot(0), loads={"w": None}), []
    monkeypatch.setattr(own_pieces, "take_snapshot", lambda view, loads: whole)
    monkeypatch.setattr(own_pieces, "FORMATS", {
        name: SimpleNamespace(piece=lambda *_: SimpleNamespace(write=seen.append)) for name in FORMATS
    })  # fmt: skip
    rank = np.random.default_rng(0).permutation(COUNTS[0])
    pieces = own_pieces.OwnPieces(scene(), None, 0, False)
    pieces.write(SimpleNamespace(state=SimpleNamespace(rank=rank, owned=7)))
    (piece, *_), own = seen, whole.id[rank < 7]
    assert_array_equal(piece.id, own)
    assert_array_equal(piece.contacts.i, whole.contacts.i[np.isin(whole.contacts.i, own)])
    assert not np.isin(piece.contacts.j[piece.contacts.j >= 0], own).all()
    assert piece.loads == {} and len(pieces.around.id) == 0 == len(pieces.around.contacts.i)
