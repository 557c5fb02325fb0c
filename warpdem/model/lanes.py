"""How many contacts between grains a CPU core evaluates side by side: what its registers, its caches and the law allow.

No bit of a result depends on it: a number has the same bits in any lane, and contacts are summed by grain.
"""

from dataclasses import replace
from functools import cache

import numpy as np

from warpdem.model.choose_features import SIMD_LANES
from warpdem.model.compiled import no_lanes
from warpdem.model.features import Features

WIDE_LANES = 8  # eight doubles fill an AVX-512 register
IN_CACHE = 30_000
"""Grains up to which wide batches pay in double precision; with more, their numbers come from memory, and twice as many at
once wait longer: 20 000 grains 48 against 58 ns per grain and step, 40 000 89 against 80 (32 MB of last cache)."""


@cache
def wide_registers() -> bool:
    """Whether the processor has registers of 512 bits (AVX-512)."""
    found: list[str] = np.show_config(mode="dicts").get("SIMD Extensions", {}).get("found", [])
    return any(name.startswith(("AVX512", "X86_V4")) for name in found)


def simd_lanes(grains: int, precision: str) -> int:
    """Contacts side by side for so many grains; in mixed precision, whose numbers are half as long, wide ones always pay."""
    return WIDE_LANES if wide_registers() and (grains <= IN_CACHE or precision == "mixed") else SIMD_LANES


def as_the_law_allows(features: Features) -> Features:
    """The same features, with one lane where the law cannot be evaluated in several."""
    backend = features.backend
    if backend.resident or backend.lanes == 1:
        return features
    why = no_lanes(features)
    if not why:
        return features
    left_out = features.left_out | {"contacts side by side": why}
    return replace(features, backend=replace(backend, lanes=1), left_out=left_out)
