"""VTK data sets from NumPy arrays, and the files that hold them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from warpdem.core.atomic_file import not_written, replaced
from warpdem.core.vtk_header import excessive_count
from warpdem.errors import WarpdemError

if TYPE_CHECKING:
    from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkFieldData, vtkImageData, vtkPolyData


@contextmanager
def quiet_vtk() -> Iterator[None]:
    """Keep VTK's own messages off the screen."""
    from vtkmodules.vtkCommonCore import vtkLogger

    before = vtkLogger.GetCurrentVerbosityCutoff()
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
    try:
        yield
    finally:
        vtkLogger.SetStderrVerbosity(before)


def polydata(points: np.ndarray) -> vtkPolyData:
    """Data set with these points (n, 3) [m], without cells."""
    from vtkmodules.util.numpy_support import numpy_to_vtk
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkPolyData

    corners = vtkPoints()
    corners.SetData(numpy_to_vtk(np.ascontiguousarray(points, dtype=np.float64)))
    data = vtkPolyData()
    data.SetPoints(corners)
    return data


def cells_of(size: int, numbers: np.ndarray) -> vtkCellArray:
    """Cells of ``size`` corners each, whose numbers follow one another."""
    from vtkmodules.util.numpy_support import numpy_to_vtkIdTypeArray
    from vtkmodules.vtkCommonDataModel import vtkCellArray

    cells = vtkCellArray()
    cells.SetData(size, numpy_to_vtkIdTypeArray(np.ascontiguousarray(numbers, dtype=np.int64).ravel(), deep=True))
    return cells


def add_array(group: vtkFieldData, name: str, values: np.ndarray) -> None:
    """Add an array to point, cell or field data."""
    from vtkmodules.util.numpy_support import numpy_to_vtk

    array = numpy_to_vtk(np.ascontiguousarray(values))
    array.SetName(name)
    group.AddArray(array)


def points_of(data: vtkPolyData) -> np.ndarray:
    """Points of a data set [m], shape (n, 3), float64."""
    from vtkmodules.util.numpy_support import vtk_to_numpy

    points: np.ndarray = vtk_to_numpy(data.GetPoints().GetData()).astype(np.float64, copy=False)
    return points.reshape(-1, 3)


def save(data: vtkPolyData | vtkImageData, path: Path) -> None:
    """Write LZ4-packed blocks: as fast as raw ones and smaller; VTK's default, zlib, takes 15 times as long."""
    from vtkmodules import vtkIOXML

    with replaced(path) as part:
        writer = vtkIOXML.vtkXMLPolyDataWriter() if data.IsA("vtkPolyData") else vtkIOXML.vtkXMLImageDataWriter()
        writer.SetFileName(str(part))
        writer.SetInputData(data)
        writer.SetDataModeToAppended()
        writer.EncodeAppendedDataOff()
        writer.SetCompressorTypeToLZ4()
        writer.SetHeaderTypeToUInt64()
        if writer.Write() != 1:
            raise not_written(path)


def load_polydata(path: Path) -> vtkPolyData:
    """Data set of a VTP file.

    Raises:
        WarpdemError: The file is missing or broken, or claims more than it holds.
    """
    from vtkmodules.vtkIOXML import vtkXMLPolyDataReader

    if not Path(path).is_file():
        raise WarpdemError(f"{path}: no such file")
    if reason := excessive_count(path):
        raise WarpdemError(f"{path}: {reason}")
    problems: list[str] = []
    reader = vtkXMLPolyDataReader()
    reader.AddObserver("ErrorEvent", lambda *_: problems.append("error"))
    reader.SetFileName(str(path))
    with quiet_vtk():  # VTK would print pages about a broken file; the error below says it once
        reader.Update()
    data: vtkPolyData = reader.GetOutput()
    if problems or reader.GetErrorCode() or data.GetPoints() is None:
        raise WarpdemError(f"{path}: cannot be read as a VTP file; is it cut off?")
    return data
