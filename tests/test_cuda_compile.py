"""Every kernel that a GPU run launches compiles for CUDA, also on a machine without a GPU, into registers alone."""

import pytest
import warp as wp
from warpdem.kernels import packing
from warpdem.kernels.lists import numbering
from warpdem.kernels.step import messages
from warpdem.kernels.wall import distance

import cubin
from switches import switched
from warpdem.model.choose_features import WARP_LANES
from warpdem.model.compiled import compile_kernels
from warpdem.model.features import (
    BackendFeatures,
    ContactFeatures,
    DomainFeatures,
    Features,
    FrameFeatures,
    WallFeatures,
)
from warpdem.scene.models import model_names, with_liquid

ARCHITECTURE = 90
"""Compute capability that is compiled for (9.0)."""
READERS = ("read", "read_budget", "read_losses", "settle_losses")
"""Kernels that read a run, which a GPU launches as well."""
MOST_REGISTERS = {"pair_forces": 128, "wall_forces": 255, "move": 96}
"""Of the main job's kernels that run at every step: 65 536 on a multiprocessor are shared by its threads."""
MOST_LOCAL = 400
"""Local memory per thread in plans other than the main job [B]: 40 for a sine, 328 for wall contacts with energies."""

QUICK_LAW = "edinburgh"
"""The normal law that is compiled in the quick suite too: the longest one, with constants, history and losses of its own."""

MAIN_JOB = Features(
    contact=ContactFeatures(
        normal="hertz", tangential="mindlin", rolling="constant", torsion=False, spins=True, materials=1, table=False, gap=0.0
    ),
    frame=FrameFeatures(rotates=True, moves=True, tracked=True),
    walls=WallFeatures(meshes=1, moving=0),
    domain=DomainFeatures(),
    backend=BackendFeatures(integrator="exact_drift", lanes=WARP_LANES, resident=True),
)
PLANS = {
    "main job": MAIN_JOB,
    "everything": switched(
        MAIN_JOB, contact={"tangential": "mindlin_displacement", "rolling": "spring", "torsion": True, "materials": 3,
                           "table": True, "gap": 1e-4},
        walls={"shapes": ("plane",), "moving": 2}, backend={"precision": "mixed"}, measures={"orientation": True},
        fields=(("harmonic", "laboratory"), ("drag", "frame"), ("lorentz", "frame")),
    ),
    "measured": switched(
        MAIN_JOB, contact={"rolling": "spring"}, domain={"period": (0.0, 0.1, 0.0)},
        fields=(("harmonic", "frame"), ("drag", "laboratory")),
        measures={"energy": True, "momentum": True, "flows": 1, "scene_walls": 1},
    ),
    "stages": switched(MAIN_JOB, backend={"integrator": "rk4"}),
    "relative": switched(MAIN_JOB, backend={"integrator": "scovel"}),
    "bare": switched(
        MAIN_JOB, contact={"normal": "hooke", "tangential": None, "rolling": None, "spins": False},
        frame={"rotates": False, "moves": False}, walls={"meshes": 0},
    ),
}  # fmt: skip


@wp.kernel(enable_backward=False, module="unique")
def nothing(x_out: wp.array(dtype=wp.float64)):
    x_out[wp.tid()] = wp.float64(0.0)


def compiled(kernel: wp.Kernel, folder) -> cubin.Resources:
    """What a kernel needs of the device."""
    [path] = wp.compile_aot_module(kernel.module, arch=ARCHITECTURE, module_dir=folder, use_ptx=False)
    [resources] = [r for name, r in cubin.read(path).items() if kernel.key in name and name.endswith("_cuda_kernel_forward")]
    return resources


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Where compiled kernels go; skips where Warp cannot compile for CUDA at all."""
    path = tmp_path_factory.mktemp("ptx")
    try:
        compiled(nothing, path)
    except RuntimeError as error:
        pytest.skip(f"this build of Warp does not compile for CUDA: {error}")
    return path


def kernels_of(*groups) -> dict[str, wp.Kernel]:
    """Kernels by name; two of one name would hide one another."""
    found = [(name, x) for group in groups if group for name, x in vars(group).items() if isinstance(x, wp.Kernel)]
    assert len(dict(found)) == len(found)
    return dict(found)


@pytest.mark.parametrize("name", [pytest.param(name, marks=() if name == "main job" else pytest.mark.slow) for name in PLANS])
def test_kernels_of_a_plan_compile_for_cuda_into_registers(folder, name):
    """The plans other than the main job's take minutes."""
    built = compile_kernels(PLANS[name])
    kernels = kernels_of(built.graph, built.rebuild, built.neighbors, built.batches, built.displacement, built.walls)
    kernels |= {reader: kernel for reader in READERS if (kernel := getattr(built.read, reader)) is not None}
    some = "pair_forces", "wall_forces", "move", "advance_clock", "check_lists", "clear_contacts", "read"
    assert {*some, "find_neighbors", "fill_contacts", "replace_outer"} <= set(kernels)
    for kernel_name, kernel in kernels.items():
        resources = compiled(kernel, folder)
        assert resources.frame <= (0 if name == "main job" else MOST_LOCAL), f"{kernel_name}: {resources}"
        if name == "main job":
            assert resources.registers <= MOST_REGISTERS.get(kernel_name, 128), f"{kernel_name}: {resources}"


def test_kernels_that_differ_over_several_ranks_compile_for_cuda(folder):
    built = compile_kernels(switched(MAIN_JOB, backend={"ranks": True}))
    of_messages = messages.take_rows, messages.put_rows
    for kernel in (built.graph.found, built.graph.agreed, built.graph.move, built.neighbors.find_neighbors, *of_messages):
        resources = compiled(kernel, folder)
        assert resources.frame == 0 and 0 < resources.registers <= MOST_REGISTERS["move"], f"{kernel.key}: {resources}"


@pytest.mark.parametrize("precision", ["double", pytest.param("mixed", marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    "law", [pytest.param(law, marks=() if law == QUICK_LAW else pytest.mark.slow) for law in model_names("normal")]
)
def test_every_normal_law_compiles_for_cuda_with_its_losses_and_twisting(folder, law, precision):
    plan = switched(
        MAIN_JOB, contact={"normal": law, "twisting": "marshall", "gap": 1e-6}, walls={"meshes": 0, "shapes": ("plane",)},
        measures={"energy": True}, backend={"precision": precision},
    )  # fmt: skip
    built = compile_kernels(plan)
    for kernel in (built.graph.pair_forces, built.graph.wall_forces):
        resources = compiled(kernel, folder)
        assert 0 < resources.registers <= MOST_REGISTERS["wall_forces"]
        assert resources.frame <= MOST_LOCAL, f"{law}, {kernel.key}: {resources}"


@pytest.mark.slow
@pytest.mark.parametrize("precision", ["double", "mixed"])
@pytest.mark.parametrize("law", model_names("liquid"))
def test_every_law_of_bridges_compiles_for_cuda_with_films_and_losses(folder, law, precision):
    plan = switched(
        MAIN_JOB, contact={"normal": with_liquid("hertz", law, viscous=True), "gap": 1e-4, "dry_gap": 0.0},
        walls={"meshes": 0, "shapes": ("plane",)}, measures={"energy": True, "losses": ("liquid",)},
        backend={"precision": precision},
    )  # fmt: skip
    built = compile_kernels(plan)
    graph = built.graph.pair_forces, built.graph.wall_forces, built.graph.move
    for kernel in (*graph, built.films.settle_contacts, built.batches.select_contacts, built.walls.close_features):
        resources = compiled(kernel, folder)
        assert 0 < resources.registers <= MOST_REGISTERS["wall_forces"]
        assert resources.frame <= MOST_LOCAL, f"{law}, {kernel.key}: {resources}"


def test_kernels_of_the_start_and_of_the_numbering_compile_for_cuda(folder):
    kernels = kernels_of(packing, distance, numbering)
    assert len(kernels) >= 6
    for kernel in kernels.values():
        assert compiled(kernel, folder).registers > 0
