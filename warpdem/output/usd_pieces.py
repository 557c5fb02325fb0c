"""One rank's pieces of the frames in USD: a layer of its own with grains and clumps, which the root layer refers to.

``result_usd/piece_0.usda`` has those of the first rank, which the root has as ``Grains_0`` and ``Clumps_0``; what it plays is
in ``result_usd/piece_0_*``, files as those of a whole frame.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from warpdem.core.snapshot import Snapshot
from warpdem.filling.clump_template import clump_templates
from warpdem.output.pieces import without_grains
from warpdem.output.usd_attributes import GRAINS
from warpdem.output.usd_clips import PARTS, time_code
from warpdem.output.usd_clumps import CLUMPS
from warpdem.output.usd_grain_clips import GrainClips
from warpdem.output.usd_layers import piece_layer
from warpdem.scene.write_usd import export

if TYPE_CHECKING:
    from pxr import Sdf

    from warpdem.scene.model import Scene

ROOT = "result.usda"


class UsdPieceWriter:
    """Write ``result_usd/piece_PART.usda`` and the chunks it plays."""

    def __init__(
        self, folder: Path, part: int, scene: Scene | None, time_codes_per_second: float = 1000.0, frames_per_chunk: int = 50,
        *, resume: bool = False,
    ):  # fmt: skip
        """Prepare the folder; other arguments as of ``UsdWriter``.

        Args:
            folder: Folder of the root layer.
            part: Number of the rank.
            scene: Scene that the results belong to.
            time_codes_per_second: Time codes of the stage in one second [1/s].
            frames_per_chunk: Most frames in one chunk.
            resume: Keep the frames of an earlier run that come before the first new one.
        """
        self._folder, self._part = folder, part
        (folder / PARTS).mkdir(parents=True, exist_ok=True)
        self._templates = list(clump_templates(scene).values()) if scene is not None else []
        self._rate, self._frames = time_codes_per_second, frames_per_chunk
        self._resume = resume and (folder / ROOT).exists()
        self._layer: Sdf.Layer | None = None
        self._clips: GrainClips

    def write(self, piece: Snapshot) -> None:
        """Write the piece of one frame; the root shows it when that has its frame.

        Raises:
            OutputError: A file cannot be written.
        """
        code = time_code(piece, self._rate)
        if self._layer is None:
            self._layer = self._started(piece, code)
        self._clips.write(piece, code)
        self._layer.endTimeCode = code
        export(self._layer, self._file)

    @property
    def _file(self) -> Path:
        return self._folder / PARTS / f"piece_{self._part}.usda"

    def _started(self, piece: Snapshot, code: float) -> Sdf.Layer:
        """The layer, with the frames of an earlier run before ``code``."""
        from pxr import Sdf

        layer = piece_layer(self._rate, self._templates)
        if self._templates:
            layer.subLayerPaths.append("./clumps.usdc")
        prefix = f"./piece_{self._part}_"
        self._clips = GrainClips(self._folder / PARTS, layer, prefix, self._templates, {}, self._rate, self._frames)
        layer.startTimeCode = code
        root = Sdf.Layer.OpenAsAnonymous(str(self._folder / ROOT)) if self._resume else None
        if root is not None and root.startTimeCode < code:
            layer.startTimeCode = root.startTimeCode
            if self._part < parts_of(root):
                self._clips.keep(Sdf.Layer.OpenAsAnonymous(str(self._file)), code)
            else:  # else clips would show their first frame at all times before it
                self._clips.write(without_grains(piece), root.startTimeCode)
        return layer


def add_pieces(root: Sdf.Layer, parts: int, clumps: bool) -> None:
    """Let a root layer refer to the layers of the pieces.

    Args:
        root: The layer.
        parts: Number of the pieces.
        clumps: Whether they have clumps.
    """
    from pxr import Sdf

    for kind in [GRAINS, *[CLUMPS] * clumps]:
        for part in range(parts):
            prim = Sdf.CreatePrimInLayer(root, f"{kind}_{part}")
            prim.specifier = Sdf.SpecifierDef
            prim.referenceList.prependedItems.append(Sdf.Reference(f"./{PARTS}/piece_{part}.usda", kind))


def parts_of(root: Sdf.Layer | None) -> int:
    """Number of the pieces that a root layer refers to."""
    part = 0
    while root is not None and root.GetPrimAtPath(f"{GRAINS}_{part}"):
        part += 1
    return part


def prims_of(root: Sdf.Layer, kind: str) -> list[Sdf.PrimSpec]:
    """The prims of the grains or of the clumps in a root layer: one, that of each piece, or none."""
    found = [root.GetPrimAtPath(kind), *(root.GetPrimAtPath(f"{kind}_{part}") for part in range(parts_of(root)))]
    return [prim for prim in found if prim]
