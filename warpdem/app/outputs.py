"""All files of a run but the pictures: rows of history.csv and frames in every format, written beside the steps."""

from pathlib import Path

import numpy as np

from warpdem.app.frame_pieces import Pieces, in_pieces
from warpdem.core.output_schedule import OutputSchedule
from warpdem.core.run_lock import RunLock
from warpdem.measure import observation
from warpdem.measure.column import Readings
from warpdem.measure.dimensionless import TurningNumbers
from warpdem.measure.residence import read_departed
from warpdem.measure.snapshot import take_snapshot
from warpdem.measure.sums import load_readers
from warpdem.measure.totals import Totals
from warpdem.output.background import Background
from warpdem.output.formats import FrameWriter, writer_of
from warpdem.output.history import history_columns, history_row, reads_grains
from warpdem.output.staged_state import StagedState, StagingBuffer
from warpdem.output.write_grid import GridWriter
from warpdem.output.write_tables import HistoryWriter, write_departures
from warpdem.simulation import Simulation


def output_schedule(sim: Simulation, end: float) -> OutputSchedule:
    """When frames and rows of the history are due in a run to ``end`` [s]."""
    output = sim.scene.output
    return OutputSchedule.of(output.interval or end / 50.0, output.history_interval, sim.dt)


class Outputs:
    """All files of a run but the pictures."""

    def __init__(self, sim: Simulation, folder: Path, resume: bool = False, claim: RunLock | None = None) -> None:
        self.sim, self.folder, self.claim = sim, folder, claim
        walls = sim.wall_meshes()
        formats = sim.scene.output.formats
        pieces = in_pieces(sim)
        of_formats = [writer_of(name, folder, walls, sim.scene, resume, pieces) for name in formats]
        self.pieces = Pieces(sim, folder, resume, of_formats) if pieces and formats else None
        self.writers: list[FrameWriter] = [] if pieces else [*of_formats]
        grid = sim.scene.measures.grid
        self.writers += [GridWriter(folder, grid, sim.domain.period, resume=resume)] if grid is not None else []
        self.background = Background()
        # of the snapshot that is written, and of the next one
        self.staging = StagingBuffer(sim.device), StagingBuffer(sim.device)
        self.columns = history_columns(sim.scene)
        header = [column.header for column in self.columns]
        self.history = HistoryWriter(folder / "history.csv", header, resume=resume)
        for earlier in self.history.earlier:
            sim.rows.add(earlier)
        self.turning = TurningNumbers(sim.scene)
        self.rows_read_grains = reads_grains(self.columns)
        load_readers("cpu")  # here: loading is not safe from the thread that reads beside the steps

    def write(self, *, row: bool = False, frame: bool = False) -> None:
        """Write a row of the history and a frame of the present time, while the run goes on.

        Raises:
            OutputError: an earlier row or frame could not be written, or the folder is no longer that of this run.
        """
        if not (row or frame):
            return
        if self.claim is not None:
            self.claim.check()
        with self.sim.clock("output"):
            view = self.sim.evaluated
            now = Totals(view)
            if row:
                self.turning.add(now)
            if frame and self.pieces is not None:
                self.background.settle()  # the libraries are called by one thread at a time
                self.pieces.write()
            if not (frame and self.writers) and not (row and self.rows_read_grains):
                # sums are few numbers: copying a run, and gathering it over ranks, takes longer
                numbers = history_row(self.columns, Readings(view, totals=now)) if row else None
                self.background.start(lambda: self._finish(numbers, frame))
                return
            view.gather()
            output, self.staging = self.sim.scene.output, self.staging[::-1]
            measures = self.sim.scene.measures
            network = frame and bool(self.writers) and (output.contacts or measures.grid is not None)
            network |= row and bool(measures.regions or measures.profiles)
            # by kernels and the threads of the run, which no other thread may launch
            observed = observation.observed(view) if row else {}
            totals = now.made() if row else None
            staged = StagedState(view, self.staging[0], contacts=network)
            self.background.start(lambda: self._write(staged, observed, totals, frame))

    def _write(self, staged: StagedState, observed: dict[str, np.ndarray], totals: Totals | None, frame: bool) -> None:
        with self.sim.clock("output, beside the steps"):
            view, numbers = staged.view(), None
            if totals is not None:
                numbers = history_row(self.columns, Readings(view, observed, totals))
            self._finish(numbers, frame)
            if frame and self.writers:
                snapshot = take_snapshot(view)
                for writer in self.writers:
                    writer.write(snapshot)

    def _finish(self, numbers: list[float] | None, frame: bool) -> None:
        """Append a row of the history, and join the pieces of a frame."""
        if numbers is not None:
            self.history.write(numbers)
            self.sim.rows.add(numbers)
        if frame and self.pieces is not None:
            self.pieces.join()

    def settle(self) -> None:
        """Wait until all rows and frames are written: what is saved next counts on them.

        Raises:
            OutputError: one could not be written, or the folder is no longer that of this run.
        """
        if self.claim is not None:
            self.claim.check()
        with self.sim.clock("output"):
            self.background.settle()

    def close(self) -> None:
        """Close all files, after the last row and frame are written.

        Raises:
            OutputError: it could not be written.
        """
        try:
            self.background.close()
            if self.sim.scene.measures.residence:
                scene, departed = self.sim.scene, read_departed(self.sim.live)
                write_departures(self.folder / "departures.csv", departed, scene.groups, list(scene.materials))
        finally:
            for writer in self.writers:
                writer.close()
            if self.pieces is not None:
                self.pieces.close()
            self.history.close()
