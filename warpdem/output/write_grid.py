"""Coarse-grained fields as VTK image data: ``grid_000000.vti`` ... with ``grid.pvd``, in frame or laboratory axes."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from warpdem.core.snapshot import Snapshot, in_laboratory
from warpdem.measure.coarse_grain import Lattice, coarse_grained
from warpdem.output.pvd_index import Entry, read_index, write_index
from warpdem.output.vtk_files import add_array, save
from warpdem.scene.measures import Grid

INDEX = "grid.pvd"


class GridWriter:
    """Write the fields of ``coarse_grain`` on the grid that a scene asks for.

    Args:
        folder: where the files go; made if it is missing.
        grid: ``measures.grid`` of the scene.
        period: length of the domain along each periodic axis [m], else 0.
        resume: keep the frames of an earlier run that come before the first new one.
    """

    def __init__(self, folder: Path, grid: Grid, period: Sequence[float], *, resume: bool = False) -> None:
        self._folder, self._period = Path(folder), period
        self._folder.mkdir(parents=True, exist_ok=True)
        self._lattice = Lattice.across(grid.box.min, grid.box.max, grid.cell)
        self._width, self._in_laboratory = grid.width or 2.0 * grid.cell, grid.fixed_to == "laboratory"
        index = self._folder / INDEX
        self._entries = read_index(index) if resume and index.exists() else []
        self._started = False

    def write(self, snapshot: Snapshot) -> None:
        """Write one frame; when this returns the index holds it."""
        from vtkmodules.vtkCommonDataModel import vtkImageData

        if not self._started:
            self._entries, self._started = [entry for entry in self._entries if entry.time < snapshot.time], True
        data = vtkImageData()
        data.SetDimensions(*self._lattice.shape)
        data.SetOrigin(*self._lattice.origin)
        data.SetSpacing(*[self._lattice.cell] * 3)
        seen = in_laboratory(snapshot) if self._in_laboratory else snapshot
        for name, values in coarse_grained(seen, self._lattice, self._width, self._period).items():
            add_array(data.GetPointData(), name, values)
        add_array(data.GetFieldData(), "time", np.array([float(snapshot.time)]))
        name = f"grid_{len(self._entries):06d}.vti"
        save(data, self._folder / name)
        self._entries.append(Entry(snapshot.time, 0, "grid", name, "grid"))
        write_index(self._folder / INDEX, self._entries)

    def close(self) -> None:
        """Nothing is held back: every frame is on disk when ``write`` returns."""
