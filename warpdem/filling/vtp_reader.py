"""Program that opens a .vtp file and hands back plain arrays; `warpdem.filling.grain_file` runs it in a process of its own.

A damaged file can make VTK end the process, loop or ask for any amount of memory. Run as ``python vtp_reader.py FILE ARRAY
...`` with the names of the point arrays that are wanted. The answer on standard output has the form that
`warpdem.core.reader_process` reads: ``points``, and arrays by their names.
"""

import io
import json
import os
import sys
from typing import Any

import numpy as np

from warpdem.core.process_limits import limit_memory
from warpdem.core.vtk_header import excessive_count

EXPANSION = 100
"""Memory that reading may take per byte of the file [-], beside what is always allowed: arrays may be compressed."""


def arrays_of(file: str, wanted: list[str]) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Points and the wanted point arrays of a file, by name, with what is refused about it."""
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOXML import vtkXMLPolyDataReader

    if reason := excessive_count(file):
        return {"refused": reason}, {}
    limit_memory(os.path.getsize(file) * EXPANSION // 10)
    reader = vtkXMLPolyDataReader()
    errors: list[str] = []
    reader.AddObserver("ErrorEvent", lambda *_: errors.append("VTK finds it damaged"))
    if not reader.CanReadFile(file):
        return {"refused": "cannot be read as .vtp: it is no VTK file of the type PolyData"}, {}
    reader.SetFileName(file)
    reader.UpdateInformation()
    selection = reader.GetPointDataArraySelection()
    there = [selection.GetArrayName(k) for k in range(selection.GetNumberOfArrays())]
    for name in there:
        if name not in wanted:
            selection.DisableArray(name)
    reader.Update()
    if errors:
        return {"refused": f"cannot be read as .vtp: {errors[0]}"}, {}
    data = reader.GetOutput()
    points = data.GetPoints()
    arrays = {"points": vtk_to_numpy(points.GetData()) if points is not None else np.zeros((0, 3))}
    for name in wanted:
        found = data.GetPointData().GetArray(name)
        if found is not None:
            arrays[name] = vtk_to_numpy(found)
    return {"there": there}, arrays


def main() -> None:
    """Answer for the file of the command line."""
    file, *wanted = sys.argv[1:]
    # the answer alone goes to standard output: what the library prints goes to standard error
    with open(os.dup(1), "wb") as out:
        os.dup2(2, 1)
        try:
            said, arrays = arrays_of(file, wanted)
        except MemoryError:
            said, arrays = {"refused": "reading it takes far more memory than the file is long: damaged?"}, {}
        held = io.BytesIO()
        contents: dict[str, Any] = {"answer": np.array(json.dumps(said)), **arrays}
        np.savez(held, **contents)
        out.write(held.getbuffer())


if __name__ == "__main__":
    main()
