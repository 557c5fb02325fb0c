"""Data flows one way: a layer imports only from layers before it, no circle within one, and the kernels stand alone."""

import ast
import graphlib
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "warpdem"

LAYERS = (
    "errors", "core", "usd", "scene", "mesh", "filling", "model", "state", "engine", "measure", "output", "runs", "guards",
    "ranks", "assembly", "simulation", "drawing", "reports", "exchange", "sweep", "calibration", "app", "runner", "__init__",
    "__main__",
)  # fmt: skip
"""Files and folders of the package, each after all that it imports from."""
KERNEL_IMPORTS = {
    "warp", "functools", "numpy", "ctypes", "os", "types", "math", "dataclasses", "typing", "collections",
    "ast", "inspect", "textwrap",  # of the translator to SIMD lanes
}  # fmt: skip
RESULTS = {
    "errors", "core.atomic_file", "core.pose", "core.rigid_motion", "core.snapshot", "core.vtk_header", "mesh.plane_patch",
}  # fmt: skip
"""What pictures may know besides the formats that results are written in: files only, no simulation."""
HEAVY = {"pyvista", "vtk", "pxr", "trimesh", "matplotlib", "imageio"}
HEAVY_OWNERS = {
    "output.write_usd": {"pxr"},
    "scene.write_usd": {"pxr"}, "scene.write_usd_free": {"pxr"},
    "output.write_vtk": {"vtk", "pyvista"},
    "drawing.colours": {"matplotlib"},
    "drawing.curves": {"matplotlib"},
    "drawing.legend": {"matplotlib"},
    "drawing.vtk_renderer": {"pyvista", "vtk"},
    "drawing.balls": {"pyvista", "vtk"},
    "drawing.depths": {"pyvista", "vtk"},
    "drawing.shadows": {"pyvista"},
    "drawing.plotter": {"pyvista", "matplotlib"},
    "drawing.chains": {"pyvista"},
    "drawing.wall_nodes": {"pyvista"},
    "drawing.frame_drawer": {"matplotlib"},
    "drawing.rendering": {"imageio", "matplotlib"},
    "drawing.work_precision": {"matplotlib"},
}
"""Files that own a heavy library and are themselves imported only when they are needed."""


def module_name(path: Path) -> str:
    """Name of a file within the package; that of a folder for its ``__init__``."""
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    return ".".join(parts[:-1] if len(parts) > 1 and parts[-1] == "__init__" else parts)


FILES = {
    module_name(path): path
    for path in sorted(PACKAGE.rglob("*.py"))
    if path.relative_to(PACKAGE).parts[0] not in ("kernels", "scenes")
}
KERNEL_FILES = sorted((ROOT / "kernels").rglob("*.py"))


def imports(path: Path) -> list[tuple[str, bool]]:
    """Modules that a file names in its import statements, and whether that happens when the file itself is imported.

    Imports under ``if TYPE_CHECKING`` name types for annotations and do not happen: they do not count.
    """
    tree = ast.parse(path.read_text(encoding="utf-8"))
    lazy = {
        inner
        for node in ast.walk(tree)
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda))
        for inner in ast.walk(node)
    }
    for_types = {
        inner
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"
        for statement in node.body
        for inner in ast.walk(statement)
    }
    found = []
    for node in ast.walk(tree):
        if node in for_types:
            continue
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path.name}:{node.lineno}: relative import"
            # "from warpdem.engine import plan" names a file, "from warpdem.model.features import Features" one of its things
            names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        found += [(name, node not in lazy) for name in names]
    return found


def own_files(name: str) -> set[str]:
    """Files of the package that a file of it imports."""
    named = {imported.removeprefix("warpdem.") for imported, _ in imports(FILES[name]) if imported.startswith("warpdem.")}
    return named & FILES.keys() - {name}


def layer(name: str) -> str:
    """Layer that a file belongs to."""
    return name.split(".")[0]


def test_layers_name_every_file_once():
    assert sorted(LAYERS) == sorted({layer(name) for name in FILES})


@pytest.mark.parametrize("name", FILES)
def test_a_file_imports_only_from_its_layer_and_those_before(name):
    before = LAYERS[: LAYERS.index(layer(name)) + 1]
    assert {layer(other) for other in own_files(name)} <= set(before)


@pytest.mark.parametrize("folder", [name for name in LAYERS if (PACKAGE / name).is_dir()])
def test_no_circle_within_a_layer(folder):
    inside = {name: own_files(name) for name in FILES if layer(name) == folder}
    graphlib.TopologicalSorter(inside).prepare()


def test_pictures_read_files_only():
    known = {name for name in FILES if layer(name) in ("drawing", "output", "runs")} | RESULTS
    for name in FILES:
        if layer(name) == "drawing":
            assert own_files(name) <= known, name
            assert "warp" not in {imported for imported, _ in imports(FILES[name])}


@pytest.mark.parametrize("path", KERNEL_FILES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_kernels_stand_alone(path):
    for name, _ in imports(path):
        assert name.split(".")[0] in KERNEL_IMPORTS or name.startswith("warpdem.kernels"), name


@pytest.mark.parametrize("name", FILES)
def test_heavy_libraries_are_imported_where_they_are_used(name):
    at_once = {imported.split(".")[0] for imported, first in imports(FILES[name]) if first}
    assert at_once & HEAVY <= HEAVY_OWNERS.get(name, set())


def test_importing_warpdem_loads_nothing_heavy():
    code = "import sys, warpdem, warpdem.app.cli, warpdem.app.run; print(*sorted({m.split('.')[0] for m in sys.modules}))"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT).stdout
    assert "numpy" in loaded.split()
    assert not set(loaded.split()) & HEAVY
