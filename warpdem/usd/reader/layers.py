"""Opening a stage: its layers, sublayers and value clips, none outside the allowed folders; its variants."""

import os
import re
from pathlib import Path
from typing import TYPE_CHECKING

from warpdem.core.process_limits import limit_memory, limit_time
from warpdem.usd.reader.errors import Refused
from warpdem.usd.reader.prims import all_prims

if TYPE_CHECKING:
    from pxr import Sdf, Usd


def open_stage(file: str, folders: list[str]) -> "Usd.Stage":
    """The stage of a file, with all files that it refers to.

    Raises:
        Refused: It cannot be opened or composed, or it refers to a file outside ``folders``, if any are given.
    """
    from pxr import Usd

    limit_time(os.path.getsize(file))
    limit_memory(os.path.getsize(file))
    if folders:
        check_folders(file, folders)
    stage = Usd.Stage.Open(file)
    layers = [layer.realPath for layer in stage.GetUsedLayers()]
    limit_memory(sum(os.path.getsize(path) for path in layers if path and os.path.isfile(path)))
    errors = stage.GetCompositionErrors()
    if errors:
        raise Refused(f"its references cannot be composed: {str(errors[0])[:300]}")
    for layer in stage.GetUsedLayers():
        missing = [name for name in clip_assets(layer) if "#" not in name and not resolved_path(layer, name)]
        if missing:
            raise Refused(f"{layer.GetDisplayName()}: a value clip is missing: {missing[0]!r}")
    return stage


def unselected_variants(stage: "Usd.Stage") -> list[str]:
    """Notes on variant sets without a selection, of which USD leaves out all variants.

    Raises:
        Refused: A selected variant does not exist; USD would leave out its content without a message.
    """
    found = []
    for prim in all_prims(stage):
        sets = prim.GetVariantSets()
        for name in sets.GetNames() if prim.HasVariantSets() else ():
            chosen, there = sets.GetVariantSelection(name), sets.GetVariantSet(name).GetVariantNames()
            if chosen and chosen not in there:
                listed = ", ".join(there) or "none"
                raise Refused(f"{prim.GetPath()}: variant {name} = {chosen!r}: no such variant; there is {listed}")
            if there and not chosen:
                found.append(f"{prim.GetPath()}: no variant of {name} is selected ({', '.join(there)}): all are left out")
    return found


def resolved_path(layer: "Sdf.Layer", name: str) -> str:
    """Resolved path of an asset that a layer names; empty if it does not exist."""
    from pxr import Ar, Sdf

    return str(Ar.GetResolver().Resolve(Sdf.ComputeAssetPathRelativeToLayer(layer, name)))


def check_folders(file: str, folders: list[str]) -> None:
    """Check all layers that a stage would open, before it is composed.

    Raises:
        Refused: A layer lies outside the folders, at a network address, or its name is an expression.
    """
    from pxr import Ar, Sdf

    seen, todo = set(), [file]
    while todo:
        layer = Sdf.Layer.FindOrOpen(todo.pop())
        if layer is None:
            continue  # composition reports what is missing
        clips = clip_assets(layer)
        for asset in [*layer.GetCompositionAssetDependencies(), *clips]:
            name = asset.split(":SDF_FORMAT_ARGS:")[0]
            if not name:
                continue  # a prim of the same file
            if name.startswith("`") or "#" in name or re.match(r"\w[\w+.-]+:", name):
                raise Refused(f"{layer.GetDisplayName()} refers to {name!r}: only plain file names are read")
            path = resolved_path(layer, name)
            outer = Path(Ar.SplitPackageRelativePathOuter(path)[0]).resolve()
            if path and not any(outer.is_relative_to(folder) for folder in folders):
                raise Refused(
                    f"{layer.GetDisplayName()} refers to {name!r}, which leads to {outer}, outside the folders that may be "
                    f"read; --allow-path {outer.parent} allows it"
                )
            if path and path not in seen and asset not in clips:
                seen.add(path)
                todo.append(path)


def clip_assets(layer: "Sdf.Layer") -> list[str]:
    """Files that the value clips of a layer name."""
    found: list[str] = []

    def visit(path: "Sdf.Path") -> None:
        spec = layer.GetPrimAtPath(path) if path.IsPrimPath() or path.IsPrimVariantSelectionPath() else None
        for clips in (spec.GetInfo("clips") if spec and spec.HasInfo("clips") else {}).values():
            found.extend(asset.path for asset in [*clips.get("assetPaths", []), clips.get("manifestAssetPath")] if asset)
            found.extend([clips["templateAssetPath"]] if "templateAssetPath" in clips else [])

    layer.Traverse("/", visit)
    return found
