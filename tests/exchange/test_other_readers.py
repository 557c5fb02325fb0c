"""Exports in the programs that they are made for: Ovito's Python package reads dumps, pandas reads tables, where installed."""

import numpy as np
import pytest

import twelve_grains
from warpdem import runs
from warpdem.exchange.export import export
from warpdem.exchange.lab import in_view


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A run in axes that turn, in which grains have orientations."""
    folder = tmp_path_factory.mktemp("readers") / "out"
    output = {"interval": 2e-3, "history_interval": 1e-3, "formats": ["vtkhdf"], "picture": False, "orientation": True}
    frame = {"axis": [0, 0, 1], "origin": [0.01, 0, 0], "rate": 40.0}
    twelve_grains.run(twelve_grains.scene(output=output, frame=frame), folder)
    return runs.read(folder)


@pytest.mark.parametrize("name", ["a.dump", "a.lammpstrj", "a.dump.gz"])
@pytest.mark.parametrize("view", ["laboratory", "frame"])
def test_ovito_reads_a_dump(run, tmp_path, name, view):
    """All frames, with the names that Ovito gives to what it knows; against the frames."""
    ovito = pytest.importorskip("ovito.io", reason="Ovito is not installed")
    assert export(run.folder, tmp_path / name, view=view) == len(run.frames.times) == 4
    pipeline = ovito.import_file(str(tmp_path / name))
    assert pipeline.source.num_frames == 4
    for number, time in enumerate(run.frames.times):
        frame, data = run.frames.frame(number), pipeline.compute(number)
        seen, grains = in_view(frame, view), data.particles
        assert data.attributes["Timestep"] == frame.step
        np.testing.assert_allclose(data.attributes["Time"], time, rtol=1e-12)
        order = np.argsort(grains.identifiers)
        assert (np.array(grains.identifiers)[order] == frame.id + 1).all()
        for found, asked in (("Position", seen.position), ("Velocity", seen.velocity), ("Angular Velocity", seen.spin),
                             ("Force", seen.force), ("Radius", frame.radius), ("Mass", frame.mass)):  # fmt: skip
            values, size = np.array(grains[found])[order], np.abs(asked).max()
            near = 1e-8 if values.dtype == np.float64 else 1e-7  # nine digits; Ovito keeps sizes in single precision
            np.testing.assert_allclose(values, asked, rtol=near, atol=near * size, err_msg=found)
        if view == "frame":
            turned = np.array(grains["Orientation"])[order][:, [3, 0, 1, 2]]
            np.testing.assert_allclose(turned, frame.orientation, rtol=1e-7, atol=1e-7)


@pytest.mark.parametrize("name", ["a.csv", "a.parquet"])
def test_pandas_reads_a_table(run, tmp_path, name):
    pandas = pytest.importorskip("pandas", reason="pandas is not installed")
    if name.endswith("parquet"):
        pytest.importorskip("pyarrow", reason='the extra "tables" is not installed')
    export(run.folder, tmp_path / name, view="frame")
    read = pandas.read_csv if name.endswith("csv") else pandas.read_parquet
    table = read(tmp_path / name)
    assert len(table) == 4 * 12 and table["id"].dtype.kind == "i" and not table.isna().any(axis=None)
    for number, (time, rows) in enumerate(table.groupby("time [s]")):
        frame = run.frames.frame(number)
        assert time == frame.time and (rows["id"] == frame.id).all()
        np.testing.assert_allclose(rows[["vx [m/s]", "vy [m/s]", "vz [m/s]"]], frame.velocity, rtol=1e-12)


def test_pandas_reads_histories(run):
    """From the file, and from what ``runs.read`` gives."""
    pandas = pytest.importorskip("pandas", reason="pandas is not installed")
    read, table = pandas.read_csv(run.folder / "history.csv"), pandas.DataFrame(dict(run.history))
    assert list(read.columns) == list(table.columns) and len(table) == len(run.history["time"]) > 4
    np.testing.assert_array_equal(read.to_numpy(), table.to_numpy())
