"""Opening a stage: its layers, sublayers and value clips, none outside the allowed folders; its variants."""

import os
import re
from pathlib import Path

from warpdem.core.process_limits import limit_memory, limit_time
from warpdem.usd.reader.errors import Refused
from warpdem.usd.reader.prims import all_prims


def open_stage(file: str, folders: list[str]):
    """The stage of a file, with all that it refers to.

    Raises:
        Refused: it cannot be opened or composed, or it refers to something outside ``folders``, if there are any.
    """
    from pxr import Usd

    limit_time(os.path.getsize(file))
    limit_memory(os.path.getsize(file))
    if folders:
        stay_inside(file, folders)
    stage = Usd.Stage.Open(file)
    layers = [layer.realPath for layer in stage.GetUsedLayers()]
    limit_memory(sum(os.path.getsize(path) for path in layers if path and os.path.isfile(path)))
    errors = stage.GetCompositionErrors()
    if errors:
        raise Refused(f"what it refers to cannot be put together: {str(errors[0])[:300]}")
    for layer in stage.GetUsedLayers():
        missing = [name for name in clip_assets(layer) if "#" not in name and not resolved(layer, name)]
        if missing:
            raise Refused(f"{layer.GetDisplayName()}: a value clip is missing: {missing[0]!r}")
    return stage


def unchosen_variants(stage) -> list[str]:
    """Notes on sets of variants of which none is chosen, so that USD leaves all of them out.

    Raises:
        Refused: a variant is chosen that does not exist; USD would leave out in silence what it should hold.
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
                found.append(f"{prim.GetPath()}: no variant of {name} is chosen ({', '.join(there)}): all are left out")
    return found


def resolved(layer, name: str) -> str:
    """Where an asset that a layer names lies; empty if nowhere."""
    from pxr import Ar, Sdf

    return str(Ar.GetResolver().Resolve(Sdf.ComputeAssetPathRelativeToLayer(layer, name)))


def stay_inside(file: str, folders: list[str]) -> None:
    """Look at all layers that a stage would open, before it is composed.

    Raises:
        Refused: one lies outside the folders, at an address, or where its name does not tell.
    """
    from pxr import Ar, Sdf

    seen, todo = set(), [file]
    while todo:
        layer = Sdf.Layer.FindOrOpen(todo.pop())
        if layer is None:
            continue  # composition tells what is missing
        clips = clip_assets(layer)
        for asset in [*layer.GetCompositionAssetDependencies(), *clips]:
            name = asset.split(":SDF_FORMAT_ARGS:")[0]
            if not name:
                continue  # a prim of the same file
            if name.startswith("`") or "#" in name or re.match(r"\w[\w+.-]+:", name):
                raise Refused(f"{layer.GetDisplayName()} refers to {name!r}: read are files by their plain names only")
            path = resolved(layer, name)
            outer = Path(Ar.SplitPackageRelativePathOuter(path)[0]).resolve()
            if path and not any(outer.is_relative_to(folder) for folder in folders):
                raise Refused(
                    f"{layer.GetDisplayName()} refers to {name!r}, which leads to {outer}, outside the folders that may be "
                    f"read; --allow-path {outer.parent} allows it"
                )
            if path and path not in seen and asset not in clips:
                seen.add(path)
                todo.append(path)


def clip_assets(layer) -> list[str]:
    """Files that the value clips of a layer name."""
    found: list[str] = []

    def visit(path) -> None:
        spec = layer.GetPrimAtPath(path) if path.IsPrimPath() or path.IsPrimVariantSelectionPath() else None
        for clips in (spec.GetInfo("clips") if spec and spec.HasInfo("clips") else {}).values():
            found.extend(asset.path for asset in [*clips.get("assetPaths", []), clips.get("manifestAssetPath")] if asset)
            found.extend([clips["templateAssetPath"]] if "templateAssetPath" in clips else [])

    layer.Traverse("/", visit)
    return found
