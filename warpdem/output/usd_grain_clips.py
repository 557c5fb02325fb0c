"""Frames of grains and clumps, and of loads on walls, as value clips of one layer."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from warpdem.core.snapshot import Snapshot
from warpdem.filling.clump_template import ClumpTemplate
from warpdem.output import usd_clumps
from warpdem.output.usd_attributes import DISPLAY, GRAINS, LOAD, STATE, grain_values, load_values
from warpdem.output.usd_clips import ValueClips, bytes_of
from warpdem.output.usd_layers import first_layer
from warpdem.scene.write_usd import WALLS, export

if TYPE_CHECKING:
    from pxr import Sdf


class GrainClips:
    """Grains and clumps of all frames: one set of clips for viewers, in which loads on walls are too, and one to start from.

    Args:
        folder: Folder of the layer that plays the clips.
        layer: That layer; it defines grains and clumps.
        prefix: What the names of its files begin with, from the folder: ``./result_usd/``.
        templates: Clumps of the scene.
        loaded: Prim of each wall that comes with loads, by name.
        rate: Time codes in one second [1/s].
        frames: Most frames in one file.
    """

    def __init__(
        self, folder: Path, layer: Sdf.Layer, prefix: str, templates: list[ClumpTemplate], loaded: dict[str, str], rate: float,
        frames: int,
    ) -> None:  # fmt: skip
        self._folder, self._layer, self._templates, self._loaded = folder, layer, templates, loaded
        shown = {f"{GRAINS}.{one.name}": one.kind for one in DISPLAY} | load_types(loaded)
        state = {f"{GRAINS}.{one.name}": one.kind for one in STATE}
        if templates:
            shown |= usd_clumps.types(usd_clumps.DISPLAY)
            state |= usd_clumps.types(usd_clumps.STATE)
        self._sets = [
            ValueClips(folder, "default", f"{prefix}chunk", f"{prefix}manifest", shown, rate, frames, overlap=True),
            ValueClips(folder, "state", f"{prefix}state", f"{prefix}state", state, rate, frames, overlap=False),
        ]
        self._first = f"{prefix}grains.usdc"
        # radii, and the widths made of them: equal arrays are stored once
        self._widths: tuple[np.ndarray, Any] | None = None

    def keep(self, earlier: Sdf.Layer, code: float) -> None:
        """Take over the frames that an earlier run wrote for times before ``code``."""
        if self._first in earlier.subLayerPaths:
            self._layer.subLayerPaths.append(self._first)
        played = earlier.GetPrimAtPath(GRAINS).GetInfo("clips")
        for clips in self._sets:
            clips.keep(played, code)

    def write(self, snapshot: Snapshot, code: float) -> None:
        """Write a frame; the layer plays it as soon as that is written."""
        shown, state = self._samples(snapshot)
        if len(snapshot.id) and self._first not in self._layer.subLayerPaths:
            export(first_layer(shown), self._folder / self._first)
            # a layer below that of the clips, which values of no time beside them would hide
            self._layer.subLayerPaths.append(self._first)
        for clips, samples in zip(self._sets, (shown, state), strict=True):
            clips.add(code, samples, sum(bytes_of(value) for value in samples.values()))
        for prim in [GRAINS, *[usd_clumps.CLUMPS] * bool(self._templates)]:
            self._layer.GetPrimAtPath(prim).SetInfo("clips", {clips.name: clips.described(prim) for clips in self._sets})
        if self._loaded:
            self._layer.GetPrimAtPath(WALLS).SetInfo("clips", {"default": self._sets[0].described(WALLS)})

    def _samples(self, snapshot: Snapshot) -> tuple[dict[str, Any], dict[str, Any]]:
        """What viewers see of a frame, and what a scene starts from, by attribute path."""
        if not self._templates:
            return self._display(snapshot), grain_values(STATE, snapshot)
        alone, instances = usd_clumps.without_members(snapshot), usd_clumps.instances_of(snapshot, self._templates)
        shown = self._display(alone) | usd_clumps.clump_values(usd_clumps.DISPLAY, instances)
        return shown, grain_values(STATE, alone) | usd_clumps.clump_values(usd_clumps.STATE, instances)

    def _display(self, snapshot: Snapshot) -> dict[str, Any]:
        """What viewers see of grains and loads, by attribute path."""
        samples = grain_values(DISPLAY, snapshot)
        widths = f"{GRAINS}.widths"
        if self._widths is None or not np.array_equal(self._widths[0], snapshot.radius):
            self._widths = snapshot.radius.copy(), samples[widths]
        samples[widths] = self._widths[1]
        return samples | load_samples(self._loaded, snapshot)


class LoadClips:
    """Loads on walls of all frames, where the grains are in layers of their own.

    Args:
        folder: Folder of the layer that plays the clips.
        layer: That layer.
        prefix: As of ``GrainClips``.
        loaded: Prim of each wall that comes with loads, by name.
        rate: Time codes in one second [1/s].
        frames: Most frames in one file.
    """

    def __init__(
        self, folder: Path, layer: Sdf.Layer, prefix: str, loaded: dict[str, str], rate: float, frames: int
    ) -> None:
        self._layer, self._loaded = layer, loaded
        types = load_types(loaded)
        self._clips = ValueClips(folder, "default", f"{prefix}chunk", f"{prefix}manifest", types, rate, frames, overlap=True)

    def keep(self, earlier: Sdf.Layer, code: float) -> None:
        """Take over the frames that an earlier run wrote for times before ``code``."""
        self._clips.keep(earlier.GetPrimAtPath(WALLS).GetInfo("clips"), code)

    def write(self, snapshot: Snapshot, code: float) -> None:
        """Write the loads of a frame."""
        samples = load_samples(self._loaded, snapshot)
        self._clips.add(code, samples, sum(bytes_of(value) for value in samples.values()))
        self._layer.GetPrimAtPath(WALLS).SetInfo("clips", {"default": self._clips.described(WALLS)})


def load_types(loaded: dict[str, str]) -> dict[str, str]:
    """Type of each attribute of loads, by path; ``loaded``: prims of the walls by name."""
    return {f"{path}.{one.name}": one.kind for path in loaded.values() for one in LOAD}


def load_samples(loaded: dict[str, str], snapshot: Snapshot) -> dict[str, Any]:
    """Loads of a frame by attribute path."""
    samples: dict[str, Any] = {}
    for name, path in loaded.items():
        samples |= load_values(path, snapshot.loads[name])
    return samples
