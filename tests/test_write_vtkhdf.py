"""VTKHDF results as VTK's own reader and the project's see them, while a run goes on and after it was killed."""

import os
import shutil
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from warpdem.core.journaled_file import JournaledFile, journal_of, repair
from warpdem.core.pose import FramePose, Placement
from warpdem.core.snapshot import ContactNetwork, Snapshot, WallLoad, WallMesh
from warpdem.errors import OutputError, WarpdemError
from warpdem.output.read_vtkhdf import read_vtkhdf
from warpdem.output.write_vtkhdf import CONTACTS, GRAINS, WALLS, VtkhdfWriter

TRIANGLES = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]], dtype=np.int32)
BOX = WallMesh("box", np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)]), TRIANGLES)
PADDLE = WallMesh("paddle <1>", BOX.vertices * 0.1, TRIANGLES[:4], infinite=True)
COUNTS = (30, 30, 41, 0, 35, 35)
"""Grains of each frame: some come, some go."""


def network(rng, count) -> ContactNetwork:
    ends, vectors = rng.random((2, count, 3)), rng.random((2, count, 3))
    i, wall = np.arange(count), np.where(np.arange(count) % 3, -1, 1).astype(np.int32)
    return ContactNetwork(
        i, np.where(wall < 0, i + 1, -1), wall, *ends, vectors[0], rng.random(count), vectors[1], rng.random(count),
        (i % 2).astype(np.int8), 0.1 * vectors[0],
    )  # fmt: skip


def load(rng, triangles) -> WallLoad:
    return WallLoad(*rng.random((3, 3)), 2.5, rng.random((triangles, 3)), rng.random(triangles))


def snapshot(k, count=None) -> Snapshot:
    count = COUNTS[k] if count is None else count
    rng = np.random.default_rng(k)
    same = np.random.default_rng(count)  # what changes only with the grains themselves
    turn = FramePose.rotated(np.array([0.0, 0.0, 1.0]), np.zeros(3), 0.2 * k, 1.0).rotation
    return Snapshot(
        step=1000 * k,
        time=0.1 * k,
        frame=FramePose.rotated(np.array([0.0, 0.6, 0.8]), np.array([0.1, 0.2, 0.3]), 2.5 * k, 25.0),
        id=np.arange(count) * 3,
        type=same.integers(0, 2, count).astype(np.int32),
        group=same.integers(0, 3, count).astype(np.int32),
        radius=same.uniform(0.01, 0.02, count),
        mass=same.uniform(1.0, 2.0, count),
        position=rng.random((count, 3)),
        velocity=rng.random((count, 3)),
        spin=rng.random((count, 3)),
        force=rng.random((count, 3)),
        walls={BOX.name: Placement(np.eye(3), np.zeros(3)), PADDLE.name: Placement(turn, np.array([0.01 * k, 0.0, 0.0]))},
        loads={BOX.name: load(rng, 6), PADDLE.name: load(rng, 0)},
        orientation=rng.random((count, 4)),
        contacts=network(rng, 2 * count),
        gravity=np.array([0.0, -9.81, 1.0 if k > 3 else 0.0]),
    )


def write(folder, frames, **options) -> None:
    writer = VtkhdfWriter(folder, [BOX, PADDLE], contacts=True, **options)
    for k in frames:
        writer.write(snapshot(k))
    writer.close()


def seen(path):
    """Time of each frame with its data, by VTK's reader: asked for by time, as ParaView does."""
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline
    from vtkmodules.vtkIOHDF import vtkHDFReader

    reader = vtkHDFReader()
    assert reader.CanReadFile(str(path))
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    times = reader.GetOutputInformation(0).Get(vtkStreamingDemandDrivenPipeline.TIME_STEPS())
    for time in times or [0.0]:  # a single frame is not a series
        reader.UpdateTimeStep(time)
        data = reader.GetOutputDataObject(0).NewInstance()
        data.DeepCopy(reader.GetOutputDataObject(0))
        groups = (data.GetPointData(), data.GetCellData(), data.GetFieldData())
        arrays = [{g.GetArrayName(a): vtk_to_numpy(g.GetArray(a)).copy() for a in range(g.GetNumberOfArrays())} for g in groups]
        points = vtk_to_numpy(data.GetPoints().GetData()).copy() if data.GetNumberOfPoints() else np.zeros((0, 3))
        yield time, data, points, arrays


def corners(cells, size):
    from vtkmodules.util.numpy_support import vtk_to_numpy

    return vtk_to_numpy(cells.GetConnectivityArray()).reshape(-1, size)


def test_vtk_reads_all_frames_and_fields_of_the_grains(tmp_path):
    write(tmp_path, range(6))
    frames = list(seen(tmp_path / GRAINS))
    assert len(frames) == 6
    for k, (time, data, points, (arrays, _, fields)) in enumerate(frames):
        wanted = snapshot(k)
        assert time == wanted.time
        assert data.GetNumberOfVerts() == COUNTS[k]
        assert_array_equal(points, wanted.position)
        names = {"v": "velocity", "omega": "spin", "f": "force"}
        names |= {name: name for name in ("id", "type", "group", "radius", "mass", "orientation")}
        assert arrays.keys() == names.keys()
        for name, key in names.items():
            assert_array_equal(arrays[name], getattr(wanted, key))
            assert arrays[name].dtype == getattr(wanted, key).dtype
        assert fields["step"] == [wanted.step]
        assert_array_equal(fields["frame_rotation"].reshape(3, 3), wanted.frame.rotation)


def test_vtk_reads_walls_with_their_loads(tmp_path):
    write(tmp_path, range(3))
    for k, (_, data, points, (_, arrays, fields)) in enumerate(seen(tmp_path / WALLS)):
        wanted = snapshot(k)
        place, loads = wanted.walls[PADDLE.name], wanted.loads
        assert_array_equal(points[:8], BOX.vertices)
        assert_array_equal(points[8:], PADDLE.vertices @ place.rotation.T + place.translation)
        assert_array_equal(corners(data.GetPolys(), 3), np.concatenate([TRIANGLES, TRIANGLES[:4] + 8]))
        assert_array_equal(arrays["wall"], [0] * 6 + [1] * 4)
        assert_array_equal(arrays["pressure"], [*loads[BOX.name].pressure, 0, 0, 0, 0])
        assert_array_equal(arrays["force"][:6], loads[BOX.name].triangle_force)
        assert_array_equal(fields["torque"], [loads[name].torque for name in (BOX.name, PADDLE.name)])


def test_vtk_reads_the_contact_network(tmp_path):
    write(tmp_path, range(6))
    for k, (_, data, points, (_, arrays, _)) in enumerate(seen(tmp_path / CONTACTS)):
        wanted = snapshot(k).contacts
        lines = points[corners(data.GetLines(), 2)] if len(wanted.i) else np.zeros((0, 2, 3))
        assert_array_equal(lines, np.stack([wanted.start, wanted.end], axis=1))
        for name in ("i", "j", "wall", "force", "normal_force", "friction_force", "overlap", "sliding", "damping_force"):
            assert_array_equal(arrays[name], getattr(wanted, name))


def test_own_reader_gives_back_what_was_written(tmp_path):
    write(tmp_path, range(6))
    results = read_vtkhdf(tmp_path)
    assert_array_equal(results.times, [snapshot(k).time for k in range(6)])
    for k in range(6):
        wanted, got = snapshot(k), results.frame(k)
        assert (got.step, got.time) == (wanted.step, wanted.time)
        assert_array_equal(got.frame.parts[0].axis, wanted.frame.parts[0].axis)
        assert got.frame.angle == wanted.frame.angle
        names = ("id", "type", "group", "radius", "mass", "position", "velocity", "spin", "force", "orientation", "gravity")
        for name in names:
            assert_array_equal(getattr(got, name), getattr(wanted, name))
        walls = {wall.name: wall for wall in results.walls(k)}
        assert list(walls) == [BOX.name, PADDLE.name]
        assert (walls[BOX.name].infinite, walls[PADDLE.name].infinite) == (False, True)
        assert_array_equal(walls[BOX.name].triangles, TRIANGLES)
        assert_array_equal(walls[BOX.name].vertices, BOX.vertices)
        place = wanted.walls[PADDLE.name]
        moved = (PADDLE.vertices @ place.rotation.T + place.translation)[TRIANGLES[:4]]
        assert_array_equal(walls[PADDLE.name].vertices[walls[PADDLE.name].triangles], moved)
        assert_array_equal(results.fields(k, BOX.name)["pressure"], wanted.loads[BOX.name].pressure)
        assert_array_equal(results.fields(k)["omega"], wanted.spin)
        assert_array_equal(results.contacts(k)["overlap"], wanted.contacts.overlap)


def test_arrays_that_do_not_change_are_stored_once(tmp_path):
    import h5py

    write(tmp_path, [0, 1])
    with h5py.File(tmp_path / GRAINS) as file:
        assert len(file["VTKHDF/PointData/id"]) == len(file["VTKHDF/PointData/radius"]) == 30
        assert len(file["VTKHDF/PointData/v"]) == 60


def test_each_frame_is_readable_while_the_run_goes_on(tmp_path):
    writer = VtkhdfWriter(tmp_path, [BOX, PADDLE], contacts=True)
    for k in range(4):
        writer.write(snapshot(k))
        assert [len(list(seen(tmp_path / name))) for name in (GRAINS, WALLS, CONTACTS)] == [k + 1] * 3
        assert_array_equal(read_vtkhdf(tmp_path).frame(k).position, snapshot(k).position)


def test_resumed_run_has_each_time_once_and_no_rest_of_the_frames_it_dropped(tmp_path):
    import h5py

    write(tmp_path / "a", range(5))
    write(tmp_path / "a", range(2, 6), resume=True)
    write(tmp_path / "b", range(6))
    for name in (GRAINS, WALLS, CONTACTS):
        first, second = (list(seen(tmp_path / folder / name)) for folder in "ab")
        assert len(first) == 6
        for (t, data, points, arrays), (u, other, others, wanted) in zip(first, second, strict=True):
            assert (t, data.GetNumberOfCells()) == (u, other.GetNumberOfCells())
            assert_array_equal(points, others)
            for group, expected in zip(arrays, wanted, strict=True):
                assert group.keys() == expected.keys()
                for key, values in expected.items():
                    assert_array_equal(group[key], values)
    with h5py.File(tmp_path / "a" / GRAINS) as file:
        assert len(file["VTKHDF/PointData/v"]) == sum(COUNTS)


def test_a_file_that_does_not_tell_gravity_is_gone_on_with(tmp_path):
    writer = VtkhdfWriter(tmp_path, [BOX, PADDLE], contacts=True)
    for k in range(2):
        writer.write(replace(snapshot(k), gravity=None))
    writer.close()
    write(tmp_path, [2, 3], resume=True)
    results = read_vtkhdf(tmp_path)
    assert len(results.times) == 4
    assert results.frame(3).gravity is None
    assert_array_equal(results.frame(3).position, snapshot(3).position)


def test_new_run_forgets_the_frames_of_the_old_one(tmp_path):
    write(tmp_path, range(4))
    write(tmp_path, range(2))
    assert len(list(seen(tmp_path / GRAINS))) == 2


@pytest.mark.parametrize("name", [GRAINS, WALLS])
def test_missing_and_foreign_files_are_named(tmp_path, name):
    with pytest.raises(WarpdemError, match=r"no result\.vtkhdf in this folder"):
        read_vtkhdf(tmp_path)
    write(tmp_path, [0])
    (tmp_path / name).write_bytes(b"no HDF5")
    with pytest.raises(WarpdemError, match=rf"{name}: cannot be read as a VTKHDF file"):
        read_vtkhdf(tmp_path).walls(0)
    with pytest.raises(WarpdemError, match=rf"{name}: cannot be read as a VTKHDF file"):
        write(tmp_path, [1], resume=True)


# -- whole or not at all -----------------------------------------------------------------------------


def test_full_disk_leaves_the_frames_before(tmp_path, monkeypatch):
    writer = VtkhdfWriter(tmp_path, [BOX, PADDLE], contacts=True)
    for k in range(3):
        writer.write(snapshot(k))

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "pwrite", full)
    with pytest.raises(OutputError, match=r"result_walls\.vtkhdf: cannot be written \(No space left on device\)"):
        writer.write(snapshot(3))
    monkeypatch.undo()
    assert [len(list(seen(tmp_path / name))) for name in (GRAINS, WALLS, CONTACTS)] == [3] * 3
    writer.close()
    write(tmp_path, [3, 4], resume=True)
    assert len(list(seen(tmp_path / WALLS))) == 5


class Killed(BaseException):
    """Nothing catches it, as nothing catches a kill."""


def test_a_kill_at_any_write_leaves_whole_frames(tmp_path, monkeypatch):
    """A run that ends at its n-th write to a file, half of it done: whatever n, the file has one frame or both."""
    real, found = os.pwrite, set()
    writer = VtkhdfWriter(tmp_path / "begun", [BOX])
    writer.write(snapshot(0))
    writer.close()
    for n in (0, 1, 2, 7, 20, 40, 60, 62, 64, 66, 90, 110, 130, 1000):
        folder = shutil.copytree(tmp_path / "begun", tmp_path / str(n))
        writer = VtkhdfWriter(folder, [BOX], resume=True)
        count = [n]

        def pwrite(descriptor, data, place, count=count):
            count[0] -= 1
            if count[0] < 0:
                real(descriptor, bytes(data)[: len(data) // 2], place)
                raise Killed
            return real(descriptor, data, place)

        monkeypatch.setattr(os, "pwrite", pwrite)
        try:
            writer.write(snapshot(1))
            break
        except Killed:
            pass
        finally:
            monkeypatch.undo()
        found |= {name for name in (WALLS, GRAINS) if journal_of(folder / name).exists()}
        results = read_vtkhdf(folder)
        assert len(results.times) in (1, 2)
        for k in range(len(results.times)):
            assert_array_equal(results.frame(k).position, snapshot(k).position)
            assert_array_equal(results.walls(k)[0].vertices, BOX.vertices)
        assert len(list(seen(folder / GRAINS))) == len(results.times)
    else:
        pytest.fail("more writes than were tried")
    assert found == {WALLS, GRAINS}, "no kill fell between journal and file"


def test_a_committed_file_is_what_a_plain_one_would_be(tmp_path):
    rng = np.random.default_rng(2)
    plain = bytearray()
    file = JournaledFile(tmp_path / "a")
    for step in range(40):
        for _ in range(6):
            place, data = int(rng.integers(0, len(plain) + 9000)), rng.bytes(int(rng.integers(1, 12000)))
            plain.extend(bytes(max(0, place + len(data) - len(plain))))
            plain[place : place + len(data)] = data
            file.seek(place)
            assert file.write(data) == len(data)
            place, size = int(rng.integers(0, len(plain))), int(rng.integers(1, 15000))
            file.seek(place)
            assert file.read(size) == bytes(plain[place : place + size])
        if step % 3 == 0:
            before = (tmp_path / "a").read_bytes()
            assert before != bytes(plain)
            file.commit()
            assert (tmp_path / "a").read_bytes() == bytes(plain)
        if step % 10 == 6:
            file.commit()
            file.close()
            file = JournaledFile(tmp_path / "a", resume=True)
    file.close()


def test_a_journal_cut_off_is_not_applied(tmp_path):
    path = tmp_path / "a"
    path.write_bytes(b"x" * 100)
    journal_of(path).write_bytes(b"\x01\x02\x03\x04\x10\0\0\0\0\0")
    repair(path)
    assert path.read_bytes() == b"x" * 100
    assert not journal_of(path).exists()
