"""Frames for other programs: dumps and tables hold what the frames hold, in either axes; LAMMPS itself reads a dump."""

import gzip
import shutil
import subprocess

import numpy as np
import pytest

import twelve_grains
from warpdem import Simulation, WarpdemError, runs
from warpdem.app import cli
from warpdem.exchange.export import export
from warpdem.exchange.lammps_dump import read_dump


def scene(**changes):
    borders = {"z": {"min": -0.01, "max": 0.02, "kind": "periodic"}}
    frame = {"axis": [0, 0, 1], "origin": [0.01, 0, 0], "rate": 40.0}
    return twelve_grains.scene(borders=borders, frame=frame, walls=[], gravity=[0, 0, 0], **changes)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A run in axes that turn, periodic along them."""
    folder = tmp_path_factory.mktemp("export") / "out"
    output = {"interval": 2e-3, "formats": ["vtkhdf"], "picture": False}
    twelve_grains.run(scene(output=output), folder)
    return folder


@pytest.fixture
def last(folder):
    frames = runs.read(folder).frames
    return frames.frame(len(frames.times) - 1)


@pytest.mark.parametrize("name", ["a.dump", "a.lammpstrj.gz"])
def test_a_dump_in_frame_axes_is_read_back(folder, last, tmp_path, name):
    assert export(folder, tmp_path / name, view="frame") == 4
    text = gzip.open(tmp_path / name, "rt").read() if name.endswith("gz") else (tmp_path / name).read_text()
    assert text.count("ITEM: TIMESTEP") == 4 and text.count("ITEM: UNITS") == 1 and text.startswith("ITEM: UNITS\nsi\n")
    assert "ITEM: BOX BOUNDS ff ff pp" in text and "-0.01 0.02" in text
    read = read_dump(tmp_path / name)
    np.testing.assert_allclose(read.position, last.position, rtol=1e-8)
    np.testing.assert_allclose(read.velocity, last.velocity, rtol=1e-8)
    np.testing.assert_allclose(read.spin, last.spin, rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(read.radius, last.radius, rtol=1e-8)
    assert read.id.tolist() == (last.id + 1).tolist() and set(read.type) == {1}
    first = runs.read(folder).frames.frame(0)
    np.testing.assert_allclose(read_dump(tmp_path / name, step=0).position, first.position, rtol=1e-8)


def test_in_the_laboratory_motion_is_absolute(folder, tmp_path):
    """Against the readings of the same run, rounded by the files."""
    run = runs.read(folder)
    export(folder, tmp_path / "a.dump")
    text = (tmp_path / "a.dump").read_text()
    assert "ITEM: BOX BOUNDS ff ff ff" in text  # of axes that turn the borders turn
    sim = Simulation(scene(), device="cpu", threads=1)
    sim.step(int(run.frames.frame(3).step))
    read = read_dump(tmp_path / "a.dump")
    np.testing.assert_allclose(read.position, sim.particles.position_lab, rtol=0, atol=2e-9)
    np.testing.assert_allclose(read.velocity, sim.particles.velocity_lab, rtol=0, atol=1e-6)
    np.testing.assert_allclose(read.spin, sim.particles.spin_lab, rtol=0, atol=1e-4)


def test_a_table_has_a_row_per_grain_and_frame(folder, last, tmp_path):
    assert export(folder, tmp_path / "a.csv", view="frame", start=2e-3) == 3
    table = np.genfromtxt(tmp_path / "a.csv", delimiter=",", names=True, deletechars="", replace_space=" ")
    assert len(table) == 36 and sorted(set(np.round(table["time [s]"], 6))) == [0.002, 0.004, 0.006]
    ends = table[table["time [s]"] > 0.005]
    np.testing.assert_allclose(ends["vy [m/s]"], last.velocity[:, 1], rtol=1e-12)
    np.testing.assert_allclose(ends["radius [m]"], last.radius, rtol=1e-12)
    assert list(table.dtype.names)[:6] == ["time [s]", "id", "type", "group", "radius [m]", "mass [kg]"]


def test_a_parquet_table_is_the_csv_table(folder, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet", reason='the extra "tables" is not installed')
    export(folder, tmp_path / "a.csv", time=4e-3)
    export(folder, tmp_path / "a.parquet", time=4e-3)
    table = np.genfromtxt(tmp_path / "a.csv", delimiter=",", names=True, deletechars="", replace_space=" ")
    read = parquet.read_table(tmp_path / "a.parquet").to_pydict()
    assert list(read) == list(table.dtype.names)
    for name in read:
        np.testing.assert_array_equal(read[name], table[name])


def test_without_pyarrow_the_remedy_is_told(folder, tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "pyarrow", None)
    with pytest.raises(WarpdemError, match=r'pip install "warpdem\[tables\]", or take .csv'):
        export(folder, tmp_path / "a.parquet")
    assert not list(tmp_path.iterdir())


# a program that no extra of this package installs
@pytest.mark.skipif(shutil.which("lmp") is None, reason="LAMMPS is not installed")
def test_lammps_reads_a_dump(folder, last, tmp_path):
    """Its own read_dump gives the places and speeds back."""
    export(folder, tmp_path / "a.dump", view="frame")
    (tmp_path / "in.lmp").write_text(
        "units si\natom_style sphere\nboundary f f p\nregion b block -1 1 -1 1 -0.01 0.02\ncreate_box 1 b\npair_style none\n"
        "comm_modify cutoff 0.001\n"
        f"read_dump {tmp_path / 'a.dump'} {last.step} x y z vx vy vz box no replace no add keep\n"
        f"write_dump all custom {tmp_path / 'b.dump'} id type x y z vx vy vz radius modify sort id format float %.10g\n"
    )
    done = subprocess.run(["lmp", "-in", "in.lmp", "-log", "none"], cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stdout + done.stderr
    read = read_dump(tmp_path / "b.dump")
    np.testing.assert_allclose(read.position, last.position, rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(read.velocity, last.velocity, rtol=1e-6)


@pytest.mark.parametrize(
    ("name", "choices", "said"),
    [("a.xyz", {}, "its suffix is no known format; allowed are .dump"),
     ("a.csv", {"start": 1.0}, "no frame from 1 to inf s; they go"),
     ("a.csv", {"view": "lab"}, "view 'lab' is unknown"), ("a.csv", {"time": 1.0, "end": 2.0}, "give one or the others")],
)  # fmt: skip
def test_what_cannot_be_written_is_told(folder, tmp_path, name, choices, said):
    with pytest.raises(WarpdemError, match=said):
        export(folder, tmp_path / name, **choices)
    assert not list(tmp_path.iterdir())


def test_the_command_writes_and_overwrites_when_told(folder, tmp_path, capsys):
    path = tmp_path / "a.csv"
    cli.app(["export", str(folder), str(path), "--time", "0"], result_action="return_value")
    assert "a.csv:1frame" in "".join(capsys.readouterr().out.split())  # lines break where the folder is long
    with pytest.raises(WarpdemError, match="is there already; take another name, or give --overwrite"):
        cli.app(["export", str(folder), str(path)], result_action="return_value")
    cli.app(["export", str(folder), str(path), "--overwrite"], result_action="return_value")
    assert len(path.read_text().splitlines()) == 49


def test_that_another_frame_was_taken_is_told(folder, tmp_path, capsys):
    cli.app(["export", str(folder), str(tmp_path / "a.csv"), "--time", "9"], result_action="return_value")
    said = capsys.readouterr().out.replace("\n", " ")
    assert "note: no frame at 9 s; took the nearest, at 0.006 s of 0 to 0.006 s" in said
    cli.app(["export", str(folder), str(tmp_path / "b.csv"), "--time", "0.004"], result_action="return_value")
    assert "note" not in capsys.readouterr().out
