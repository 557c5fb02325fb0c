"""Every kernel that a GPU run launches compiles for CUDA, also on a machine without a GPU."""

import re
from dataclasses import replace

import pytest
import warp as wp
from warpdem.kernels import packing
from warpdem.kernels.wall import distance

from warpdem.engine.compiled import compile_plan
from warpdem.engine.plan import Plan

ARCHITECTURE = 90
"""Compute capability that is compiled for (9.0)."""
CPU_ONLY = {"run"}
"""Kernels that meet at a barrier of CPU threads."""

MAIN_JOB = Plan(
    normal="hertz",
    tangential="mindlin",
    rolling="constant",
    torsion=False,
    spins=True,
    integrator="exact_drift",
    turning_frame=True,
    moving_frame=True,
    meshes=1,
    planes=0,
    moving=0,
    in_frame=True,
    materials=1,
    table=False,
    gap=0.0,
    lanes=1,
)
PLANS = {
    "main job": MAIN_JOB,
    "everything": replace(
        MAIN_JOB, tangential="mindlin_displacement", rolling="spring", torsion=True, planes=2, moving=2, materials=3,
        table=True, gap=1e-4, precision="mixed", fields=(("harmonic", "laboratory"), ("drag", "frame"), ("lorentz", "frame")),
        orientation=True,
    ),
    "measured": replace(
        MAIN_JOB, rolling="spring", period=(0.0, 0.1, 0.0), fields=(("harmonic", "frame"), ("drag", "laboratory")), energy=True,
        momentum=True, flows=1, scene_walls=1,
    ),
    "stages": replace(MAIN_JOB, integrator="rk4"),
    "relative": replace(MAIN_JOB, integrator="scovel"),
    "bare": replace(
        MAIN_JOB, normal="hooke", tangential=None, rolling=None, spins=False, turning_frame=False,
        moving_frame=False, meshes=0,
    ),
}  # fmt: skip


@wp.kernel(enable_backward=False, module="unique")
def nothing(x_out: wp.array(dtype=wp.float64)):
    x_out[wp.tid()] = wp.float64(0.0)


def compiled(kernel: wp.Kernel, folder) -> str:
    """PTX of a kernel."""
    [path] = wp.compile_aot_module(kernel.module, arch=ARCHITECTURE, module_dir=folder, use_ptx=True)
    return path.read_text()


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
    return {
        name: thing
        for group in groups
        if group is not None
        for name, thing in vars(group).items()
        if isinstance(thing, wp.Kernel) and name not in CPU_ONLY
    }


@pytest.mark.parametrize("name", PLANS)
def test_kernels_of_a_plan_compile_for_cuda(folder, name):
    built = compile_plan(PLANS[name])
    kernels = kernels_of(built.loop, built.lists, built.walls)
    assert {"pair_forces", "wall_forces", "move", "read", "near_rows"} <= set(kernels)
    for kernel_name, kernel in kernels.items():
        assert re.search(rf"\.entry \S*{kernel_name}\S*_cuda_kernel_forward", compiled(kernel, folder)), kernel_name


def test_kernels_of_the_start_compile_for_cuda(folder):
    kernels = kernels_of(packing, distance)
    assert len(kernels) >= 3
    for kernel in kernels.values():
        assert ".entry" in compiled(kernel, folder)
