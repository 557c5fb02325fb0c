"""VTK results as pyvista and the project's own reader see them."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from warpdem.core.pose import FramePose, Placement, RotationPart, SampledPart, TranslationPart
from warpdem.core.snapshot import Snapshot, WallMesh
from warpdem.errors import WarpdemError
from warpdem.output.read_vtk import read_frame, read_results
from warpdem.output.write_vtk import VtkWriter

CUBE = WallMesh(
    "box",
    np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)]),
    np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]], dtype=np.int32),
)
PADDLE = WallMesh("paddle & <arm>/1", CUBE.vertices * 0.1, CUBE.triangles)


def turn_z(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def snapshot(k, count=30):
    rng = np.random.default_rng(k)
    return Snapshot(
        step=1000 * k,
        time=0.1 * k,
        frame=FramePose.rotated(np.array([0.0, 0.6, 0.8]), np.array([0.1, 0.2, 0.3]), 2.5 * k, 25.0),
        id=np.arange(count) * 3,
        type=rng.integers(0, 2, count).astype(np.int32),
        group=rng.integers(0, 3, count).astype(np.int32),
        radius=rng.uniform(0.01, 0.02, count),
        mass=rng.uniform(1.0, 2.0, count),
        position=rng.random((count, 3)),
        velocity=rng.random((count, 3)),
        spin=rng.random((count, 3)),
        force=rng.random((count, 3)),
        walls={
            CUBE.name: Placement(np.eye(3), np.zeros(3)),
            PADDLE.name: Placement(turn_z(0.5 * k), np.array([0.01 * k, 0.0, 0.0])),
        },
        gravity=np.array([1.0, -9.81, 0.1 * k]),
    )


def write(folder, frames, **options):
    writer = VtkWriter(folder, [CUBE, PADDLE], **options)
    for k in frames:
        writer.write(snapshot(k))
    writer.close()


def test_pyvista_reads_times_grains_and_walls(tmp_path):
    import pyvista

    write(tmp_path, range(3))
    reader = pyvista.PVDReader(tmp_path / "result.pvd")
    assert reader.time_values == [0.0, 0.1, 0.2]
    reader.set_active_time_value(0.2)
    grains, box, paddle = reader.read()
    wanted = snapshot(2)
    assert grains.n_verts == 30
    assert_array_equal(grains.points, wanted.position)
    for name, values in {
        "id": wanted.id,
        "type": wanted.type,
        "radius": wanted.radius,
        "mass": wanted.mass,
        "v": wanted.velocity,
        "omega": wanted.spin,
        "f": wanted.force,
    }.items():
        assert_array_equal(grains.point_data[name], values)
        assert grains.point_data[name].dtype == values.dtype
    assert_array_equal(box.points, CUBE.vertices)
    assert_array_equal(box.regular_faces, CUBE.triangles)
    np.testing.assert_allclose(paddle.points, PADDLE.vertices @ turn_z(1.0).T + [0.02, 0.0, 0.0], rtol=0, atol=1e-15)


def test_own_reader_gives_back_what_was_written(tmp_path):
    write(tmp_path, range(3))
    results = read_results(tmp_path)
    assert_array_equal(results.times, [0.0, 0.1, 0.2])
    for k in range(3):
        wanted, got = snapshot(k), results.frame(k)
        assert (got.step, got.time) == (wanted.step, wanted.time)
        for name in ("rotation", "translation", "spin", "velocity", "angle"):
            assert_array_equal(getattr(got.frame, name), getattr(wanted.frame, name))
        for part, other in zip(got.frame.parts, wanted.frame.parts, strict=True):
            assert type(part) is type(other)
            for name, values in vars(other).items():
                assert_array_equal(getattr(part, name), values)
        for name in ("id", "type", "radius", "mass", "position", "velocity", "spin", "force", "gravity"):
            assert_array_equal(getattr(got, name), getattr(wanted, name))
        assert [wall.name for wall in results.walls(k)] == [CUBE.name, PADDLE.name]
        assert_array_equal(results.walls(k)[0].triangles, CUBE.triangles)


def test_results_that_do_not_tell_gravity_are_read(tmp_path):
    VtkWriter(tmp_path, [CUBE, PADDLE]).write(replace(snapshot(0), gravity=None))
    assert read_results(tmp_path).frame(0).gravity is None


def test_every_part_of_the_frame_comes_back(tmp_path):
    parts = (
        SampledPart(np.array([0.8, 0.0, 0.6, 0.0]), np.array([0.0, 0.2, 0.0])),
        TranslationPart(np.array([0.3, 0.0, -0.1])),
        RotationPart(np.array([0.0, 0.6, 0.8]), np.array([0.5, 0.0, 0.1]), 30.0),
    )
    frame = FramePose(turn_z(0.3), np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 6.0]), np.array([7.0, 8.0, 9.0]), parts)
    for k, poses in enumerate([parts, parts[:1], ()]):
        writer = VtkWriter(tmp_path / str(k), [CUBE, PADDLE])
        writer.write(replace(snapshot(0), frame=replace(frame, parts=poses)))
        got = read_results(tmp_path / str(k)).frame(0).frame
        assert_array_equal(got.to_laboratory(np.eye(3)), frame.to_laboratory(np.eye(3)))
        assert_array_equal(got.velocity_at(np.eye(3)), frame.velocity_at(np.eye(3)))
        assert got.angle == (30.0 if k == 0 else 0.0)
        for part, other in zip(got.parts, poses, strict=True):
            assert type(part) is type(other)
            for name, values in vars(other).items():
                assert_array_equal(getattr(part, name), values)


def test_resting_wall_is_written_once_and_shown_at_every_time(tmp_path):
    write(tmp_path, range(4))
    assert len(list(tmp_path.glob("wall_box_*.vtp"))) == 1
    assert len(list(tmp_path.glob("wall_paddle*.vtp"))) == 4
    assert {results["box"].name for results in read_results(tmp_path).files} == {"wall_box_000000.vtp"}


def test_grain_files_are_not_zlib(tmp_path):
    write(tmp_path, [0])
    head = (tmp_path / "grains_000000.vtp").read_bytes()[:2000]
    assert b"vtkLZ4DataCompressor" in head
    assert b'format="appended"' in head


def test_results_are_readable_after_each_write(tmp_path):
    writer = VtkWriter(tmp_path, [CUBE, PADDLE])
    for k in range(3):
        writer.write(snapshot(k))
        results = read_results(tmp_path)
        assert len(results.times) == k + 1
        assert_array_equal(results.frame(k).position, snapshot(k).position)
    assert not [path for path in tmp_path.iterdir() if ".part" in path.name]


def test_resumed_run_has_each_time_once(tmp_path):
    write(tmp_path, range(4))
    write(tmp_path, range(2, 6), resume=True)
    assert (tmp_path / "result.pvd").read_text().count('file="grains') == 6
    results = read_results(tmp_path)
    np.testing.assert_allclose(results.times, 0.1 * np.arange(6), rtol=0, atol=1e-15)
    for k in range(6):
        assert_array_equal(results.frame(k).position, snapshot(k).position)
        assert results.walls(k)[1].name == PADDLE.name


def test_new_run_forgets_the_frames_of_the_old_one(tmp_path):
    write(tmp_path, range(4))
    write(tmp_path, range(2))
    assert len(read_results(tmp_path).times) == 2


def test_frame_without_grains_is_written_and_read(tmp_path):
    writer = VtkWriter(tmp_path, [CUBE, PADDLE])
    writer.write(snapshot(0, count=0))
    assert read_results(tmp_path).frame(0).position.shape == (0, 3)


@pytest.mark.parametrize("share", [0.02, 0.3, 0.7, 0.98])
def test_cut_off_file_is_named(tmp_path, share, capfd):
    write(tmp_path, [0])
    path = tmp_path / "grains_000000.vtp"
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    with pytest.raises(WarpdemError, match=r"grains_000000\.vtp: cannot be read"):
        read_frame(path)
    assert capfd.readouterr().err == ""


def test_missing_and_foreign_files_are_named(tmp_path):
    with pytest.raises(WarpdemError, match=r"no result\.pvd"):
        read_results(tmp_path)
    with pytest.raises(WarpdemError, match=r"none\.vtp: no such file"):
        read_frame(tmp_path / "none.vtp")
    write(tmp_path, [0])
    with pytest.raises(WarpdemError, match=r"wall_box_000000\.vtp: not a grain file of warpdem"):
        read_frame(tmp_path / "wall_box_000000.vtp")
    (tmp_path / "result.pvd").write_text("<VTKFile><Collection>")
    with pytest.raises(WarpdemError, match=r"result\.pvd: cannot be read"):
        read_results(tmp_path)
