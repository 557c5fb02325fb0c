"""The sampled transforms of a prim."""

import numpy as np

from warpdem.usd.reader.errors import Refused
from warpdem.usd.reader.prims import matrix_of, prim_at, sample_codes


def read_motion(stage, path: str) -> tuple[dict, dict[str, np.ndarray]]:
    """Time codes (m,) and local-to-world matrices (m, 4, 4) of the samples of a prim."""
    from pxr import UsdGeom

    prim = prim_at(stage, path, "Xformable")
    if not prim.IsA(UsdGeom.Xformable):
        raise Refused(f"prim = {path!r} is nothing that can move")
    codes = sorted(sample_codes(prim))
    if not codes:
        raise Refused(f"prim = {path!r}: neither it nor what it stands in has time samples: it never moves")
    matrices = np.array([matrix_of(UsdGeom.XformCache(code), prim) for code in codes])
    return {}, {"codes": np.array(codes), "matrices": matrices}
