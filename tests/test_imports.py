"""Data flows one way: a file imports only from files before it, and the kernels stand alone."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent

ORDER = (
    "errors", "paths", "snapshot", "rigid", "units", "models", "scene_base", "usd_reader", "usd_stage", "usd_scene", "usd_motion",
    "motion", "borders", "sizes", "wall_shapes", "scene_grains", "scene_measures", "scene_start", "scene", "scene_file", "demo", "polygons", "mesh_file", "usd_geometry",
    "mesh_pieces", "mesh_check", "geometry", "threads", "region", "packing", "grain_source", "domain", "streams",
    "plan", "impact", "travel", "timestep", "compiled", "schedule", "state", "walls", "plane_patch", "tessellation", "neighbours", "stepper",
    "observers", "budget", "observation", "contact_network", "bulk", "mixing", "measures", "wall_loads", "dimensionless", "summary", "write_tables", "checkpoint", "start", "simulation",
    "vtk_arrays", "committed_file", "write_vtk", "coarse_grain", "write_grid", "write_vtkhdf", "scene_tables", "write_toml", "write_usd_scene", "write_usd", "convert",
    "look", "cuts", "camera", "visible", "colours", "legend", "stage", "show", "rendering", "notebook", "progress",
    "background", "runner", "run_phases", "advice", "check", "cli",
    "__init__", "__main__",
)  # fmt: skip
KERNEL_IMPORTS = {"warp", "functools", "numpy", "ctypes", "os", "types", "math"}
DRAWING = {"look", "cuts", "camera", "visible", "colours", "legend", "stage", "show", "rendering"}
RESULTS = {"write_tables", "vtk_arrays", "committed_file", "write_vtk", "write_vtkhdf"}
RENDER_IMPORTS = {"errors", "snapshot", "plane_patch", *RESULTS}
"""Files and the formats they are written in; no simulation."""
HEAVY = {"pyvista", "vtk", "pxr", "trimesh", "matplotlib", "imageio"}
HEAVY_OWNERS = {
    "write_usd": {"pxr"},
    "write_usd_scene": {"pxr"},
    "write_vtk": {"vtk", "pyvista"},
    "colours": {"matplotlib"},
    "legend": {"matplotlib"},
    "stage": {"pyvista", "vtk", "matplotlib"},
    "show": {"matplotlib"},
    "rendering": {"imageio", "matplotlib"},
}
"""Files that own a heavy library and are themselves imported only when they are needed."""


def imports(path: Path) -> list[tuple[str, bool]]:
    """Modules that a file names in its import statements, and whether that happens when the file itself is imported."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    lazy = {
        inner
        for node in ast.walk(tree)
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda))
        for inner in ast.walk(node)
    }
    found = []
    for node in ast.walk(tree):
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path.name}:{node.lineno}: relative import"
            # "from warpdem import plan" names a file of the package, "from warpdem.plan import Plan" one of its things
            is_package = node.module in ("warpdem", "warpdem.kernels")
            names = [f"{node.module}.{alias.name}" for alias in node.names] if is_package else [node.module]
        found += [(name, node not in lazy) for name in names]
    return found


def own_files(path: Path) -> set[str]:
    """Files of the package that a file imports, by stem."""
    stems = {name.split(".")[1] for name, _ in imports(path) if name.startswith("warpdem.")}
    return {stem for stem in stems if stem in ORDER}


FILES = sorted((ROOT / "warpdem").glob("*.py"), key=lambda path: path.stem)
KERNEL_FILES = sorted((ROOT / "kernels").rglob("*.py"))


def test_order_names_every_file_once():
    assert sorted(ORDER) == sorted(path.stem for path in FILES)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_file_imports_only_from_files_before_it(path):
    later = ORDER[ORDER.index(path.stem) :]
    assert not own_files(path) & set(later)


def test_render_reads_files_only():
    for stem in DRAWING | RENDER_IMPORTS:
        assert own_files(ROOT / "warpdem" / f"{stem}.py") <= RENDER_IMPORTS | (DRAWING if stem in DRAWING else set())
        assert "warp" not in {name for name, _ in imports(ROOT / "warpdem" / f"{stem}.py")}


@pytest.mark.parametrize("path", KERNEL_FILES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_kernels_stand_alone(path):
    for name, _ in imports(path):
        assert name.split(".")[0] in KERNEL_IMPORTS or name.startswith("warpdem.kernels."), name


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_heavy_libraries_are_imported_where_they_are_used(path):
    at_once = {name.split(".")[0] for name, first in imports(path) if first}
    assert at_once & HEAVY <= HEAVY_OWNERS.get(path.stem, set())


def test_importing_warpdem_loads_nothing_heavy():
    code = "import sys, warpdem, warpdem.cli, warpdem.runner; print(*sorted({m.split('.')[0] for m in sys.modules}))"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT).stdout
    assert "numpy" in loaded.split()
    assert not set(loaded.split()) & HEAVY
