"""The sampled transforms of a prim."""

from typing import TYPE_CHECKING, Any

import numpy as np

from warpdem.usd.reader.errors import Refused
from warpdem.usd.reader.prims import prim_at, sample_codes, world_matrix

if TYPE_CHECKING:
    from pxr import Usd


def read_motion(stage: "Usd.Stage", path: str) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Time codes (m,) and local-to-world matrices (m, 4, 4) of the samples of a prim."""
    from pxr import UsdGeom

    prim = prim_at(stage, path, "Xformable")
    if not prim.IsA(UsdGeom.Xformable):
        raise Refused(f"prim = {path!r} has no transform")
    codes = sorted(sample_codes(prim))
    if not codes:
        raise Refused(f"prim = {path!r}: neither it nor an ancestor has time samples: it never moves")
    matrices = np.array([world_matrix(UsdGeom.XformCache(code), prim) for code in codes])
    return {}, {"codes": np.array(codes), "matrices": matrices}
