"""Program that divides the surfaces of a STEP file into triangles; `warpdem.mesh.step_file` runs it in a process of its own.

A damaged file can make the library crash; in a process of its own this does not end the run. ``python step_program.py FILE
TOLERANCE``: the answer on standard output is an .npz archive whose array ``answer`` is a text in JSON, either the names of the
parts or ``{"refused": reason}``. TOLERANCE is in [mm], in which the library holds every file, whatever its own unit.
"""

import io
import json
import os
import sys
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).resolve().parents[2]))  # the package that the caller has imported

from warpdem.core.process_limits import limit_memory

FINER = 4.0
"""Factor between the tolerance and that of the points by which its error is measured: half as far apart along a curve."""


def triangles(content: bytes, tolerance: float) -> tuple[list[str], list[np.ndarray]]:
    """Names of the parts, and corners of their triangles [m], shape (t, 3, 3), by the tolerance [mm]."""
    import cascadio
    import trimesh

    # without threads: the triangles are the same on any number of cores
    binary = cascadio.load(content, "step", tol_linear=tolerance, use_parallel=False)
    if not binary:
        return [], []
    scene = trimesh.load_scene(io.BytesIO(binary), file_type="glb", process=False)
    names, corners = [], []
    for node in scene.graph.nodes_geometry:
        matrix, name = scene.graph[node]
        geometry = scene.geometry[name]
        points = np.asarray(geometry.vertices, np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
        names.append(str(node))
        corners.append(points[np.asarray(geometry.faces)])
    return names, corners


def answer(file: str, tolerance: float) -> dict[str, np.ndarray]:
    """All arrays of the answer."""
    content = Path(file).read_bytes()
    limit_memory(len(content))
    try:
        import cascadio  # noqa: F401  # whether it is there
    except ImportError:
        return {"answer": np.array(json.dumps({"refused": "missing"}))}
    names, corners = triangles(content, tolerance)
    if not corners:
        return {"answer": np.array(json.dumps({"refused": "OpenCASCADE finds no surfaces in it: no STEP file, or damaged?"}))}
    _, finer = triangles(content, tolerance / FINER)
    counts = np.array([len(part) for part in corners])
    found = {"corners": np.concatenate(corners), "counts": counts, "points": np.concatenate(finer).reshape(-1, 3)}
    return {"answer": np.array(json.dumps({"names": names})), **found}


def main() -> None:
    """Answer the request of the command line."""
    with open(os.dup(1), "wb") as out:
        os.dup2(2, 1)  # only the answer goes to standard output
        buffer = io.BytesIO()
        np.savez(buffer, allow_pickle=False, **answer(sys.argv[1], float(sys.argv[2])))
        out.write(buffer.getbuffer())


if __name__ == "__main__":
    main()
