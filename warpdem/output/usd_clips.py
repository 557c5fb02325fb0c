"""Frames of some attributes in files that a USD stage plays as one set of value clips."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from warpdem.core.snapshot import Snapshot
from warpdem.scene.write_usd import export, set_units

if TYPE_CHECKING:
    from pxr import Sdf

PARTS = "result_usd"
"""Folder of the files beside the root layer."""
# the open chunk is rewritten for each frame, so its size bounds the cost of a frame
_CHUNK_BYTES = 8e6


class ValueClips:
    """Frames of some attributes in files, some frames each, that the root layer plays as one set of value clips."""

    def __init__(
        self, folder: Path, name: str, file: str, manifest: str, types: dict[str, str], rate: float, frames: int, overlap: bool
    ) -> None:
        """Write the manifest.

        Args:
            folder: Folder of the layer that plays them.
            name: Name of the set.
            file: Its files from there without number and suffix, ``./result_usd/chunk``.
            manifest: Its manifest likewise.
            types: Type of each attribute, by path.
            rate: Time codes in one second [1/s].
            frames: Most frames in one file; fewer when they are large.
            overlap: Whether a file begins with the last frame of the one before, so that viewers interpolate across.
        """
        self._folder, self._file, self._types, self._rate = folder, file, types, rate
        self._frames, self._overlap = frames, overlap
        self.name = name
        self.clips: list[tuple[float, str]] = []
        self._layer: Sdf.Layer | None = None
        self._codes = 0
        self._last: tuple[float, dict[str, object]] | None = None
        self._manifest = f"{manifest}.usda"
        export(self._new_layer(".usda"), folder / self._manifest)

    def add(self, code: float, samples: dict[str, object], size: float) -> None:
        """Write a frame of ``size`` bytes; samples by attribute path."""
        capacity = max(1 + self._overlap, min(self._frames, int(_CHUNK_BYTES / max(1.0, size))))
        if self._layer is None or self._codes >= capacity:
            self._layer, self._codes, begin = self._new_layer(".usdc"), 0, code
            if self._overlap and self._last is not None:
                begin, earlier = self._last
                self._set(self._layer, begin, earlier)
            self.clips.append((begin, f"{self._file}_{len(self.clips):04d}.usdc"))
        self._set(self._layer, code, samples)
        export(self._layer, self._folder / self.clips[-1][1])
        self._last = (code, samples)

    def keep(self, played: dict[str, Any], code: float) -> None:
        """Take over the files of an earlier run for times before ``code``; ``played``: metadata of the sets of a prim."""
        files = [asset.path for asset in played[self.name]["assetPaths"]]
        self.clips = [(t, files[int(k)]) for t, k in played[self.name]["active"] if t < code]

    def described(self, prim: str) -> dict[str, object]:
        """Metadata of the set for one prim."""
        from pxr import Gf, Sdf, Vt

        return {
            "assetPaths": Sdf.AssetPathArray([Sdf.AssetPath(file) for _, file in self.clips]),
            "active": Vt.Vec2dArray([Gf.Vec2d(code, k) for k, (code, _) in enumerate(self.clips)]),
            "manifestAssetPath": Sdf.AssetPath(self._manifest),
            "primPath": prim,
        }

    def _set(self, layer: Sdf.Layer, code: float, samples: dict[str, object]) -> None:
        for path, value in samples.items():
            layer.SetTimeSample(path, code, value)
        self._codes += 1

    def _new_layer(self, suffix: str) -> Sdf.Layer:
        """Layer that declares the attributes, without values."""
        from pxr import Sdf

        layer = Sdf.Layer.CreateAnonymous(suffix)
        set_units(layer)
        layer.timeCodesPerSecond = self._rate
        for path, kind in self._types.items():
            prim = Sdf.CreatePrimInLayer(layer, Sdf.Path(path).GetPrimPath())
            Sdf.AttributeSpec(prim, Sdf.Path(path).name, Sdf.ValueTypeNames.Find(kind))
        return layer


def time_code(snapshot: Snapshot, rate: float) -> float:
    """Time code of a frame, ``rate`` in one second, without the last digits of step x dt (300, not 300.00000000000006)."""
    return round(float(snapshot.time) * rate, 6)


def bytes_of(value: Any) -> int:
    """Bytes of an array of the USD library, roughly; next to nothing for single numbers."""
    return memoryview(value).nbytes if hasattr(value, "__len__") and len(value) > 3 else 24
