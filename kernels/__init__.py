"""Warp kernels of warpdem: one physical model per file, one loop per file; usable without the rest.

The file name of a model is its name in the scene. A model file holds, in this order: the equation with symbols, units,
source and limits; ``coefficients`` (host, float64) where the model derives numbers per pair of materials; ``build(real)``,
cached, which returns the Warp functions for one precision.

Everything that a contact law calls is straight-line code: no early return, no loop over data; choices are conditional
expressions between scalars that are already computed. So a CPU can evaluate several contacts in the lanes of a register
(``simd``, ``contact.sweep``).
"""

from types import SimpleNamespace

import warp as wp

if __name__ != "warpdem.kernels":
    raise ImportError("the folder kernels/ is imported as warpdem.kernels")

wp.config.log_level = wp.LOG_ERROR  # a line per compiled module would drown the progress of a run

# Straight-line kernels profit from the SLP vectoriser at its own depth (Warp limits it to 4 to save compile time);
# floating-point contraction stays off (clang's default here), so a contact's bits do not depend on its lane. All modules have
# the same flags: Warp's own header is compiled once for each set of them, which takes longer than most modules.
CPU_FLAGS = "-march=native -mllvm=-inline-threshold=9000 -mllvm=-slp-recursion-max-depth=12"

MODULE_OPTIONS = {"enable_backward": False, "cpu_compiler_flags": CPU_FLAGS}

SHARED_READERS = "warpdem.kernels.readers"
"""Module of the kernels that only read and are the same for all scenes, compiled and loaded as one: ``measure.readings`` and
``wall.distance``."""


def tiny(real) -> float:
    """A number that keeps a quotient finite and is nothing beside any quantity of a contact."""
    return 1.0e-300 if real is wp.float64 else 1.0e-30


class KernelSet(SimpleNamespace):
    """What a cached factory returns: named functions, types and kernels; equal only to itself, so it can be a cache key."""

    __eq__ = object.__eq__
    __hash__ = object.__hash__
