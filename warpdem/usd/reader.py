"""Program that opens a USD file and hands back plain arrays; `warpdem.usd.stage` runs it in a process of its own.

A damaged file can make the USD library crash, loop or ask for any amount of memory; here that ends this process and not
the run. Run as ``python usd_reader.py geometry|motion|scene FILE PRIM|TIME [FOLDER ...]``; the answer on standard output is
an .npz archive whose array ``answer`` is a text in JSON: either what the file says, or ``{"refused": reason}``. With folders,
no layer outside them is opened. This file imports nothing of the package, so that it starts fast.
"""

import contextlib
import io
import json
import os
import re
import sys
from pathlib import Path

import numpy as np

MEMORY_SLACK = 512 << 20
"""Memory that reading may take beyond `MEMORY_SHARE` times the file [bytes]."""
MEMORY_SHARE = 10
"""Memory that reading may take per byte of the files it opens [-]."""
SECONDS = 30.0
"""Processor time that reading may take [s], with another second for each `BYTES_PER_SECOND`."""
BYTES_PER_SECOND = 1e6
SHAPES = {
    "Cube": ("size",),
    "Sphere": ("radius",),
    "Cylinder": ("radius", "height", "axis"),
    "Cone": ("radius", "height", "axis"),
    "Capsule": ("radius", "height", "axis"),
    "Plane": ("width", "length", "axis"),
}
"""Primitive shapes and the attributes that make them."""
WITHOUT_SURFACE = ("Points", "Curves")
"""Ends of the schema names of what has no surface and is left out."""
COLLIDERS = ("MeshShape", "CubeShape", "SphereShape", "CylinderShape", "ConeShape", "CapsuleShape", "PlaneShape")
"""Kinds of the physics parser's shapes that are walls."""
PHYSICS = re.compile(r"(physics|physx|newton|mjc|omniphysics|omnigraph|isaac)", re.IGNORECASE)
"""Beginnings of the names of schemas, and of parts of the names of attributes, that are about physics."""
TRUE_TRIANGLES = ("none", "sdf")
"""Approximations of a collider that are none."""
GRAINS = "SpherePointsShape"
"""Kind of the physics parser's shapes that are grains."""
GRAIN_ARRAYS = ("positions", "velocities", "spins", "radii", "diameters", "types")
"""Arrays of grains in float64, SI and frame axes, as primvars:dem:NAME."""
STANDARD = {
    "Scene": ("physics:gravityDirection", "physics:gravityMagnitude", "newton:gravityEnabled", "newton:timeStepsPerSecond"),
    "RigidBodyMaterial": (
        "physics:density", "physics:dynamicFriction", "physics:restitution", "newton:rollingFriction",
        "newton:mpm:youngsModulus", "newton:mpm:poissonsRatio",
    ),
}  # fmt: skip
"""Attributes of UsdPhysics and of Newton's schemas that a scene takes, by the kind of the prim."""
GRAINS_TAKEN = re.compile(
    r"(points|widths|velocities|ids|extent|visibility|purpose|doubleSided|orientation|proxyPrim)$|(xformOp|material:binding|dem)[:O]"
    r"|primvars:(widths|omega|group|display\w+|dem:(" + "|".join(GRAIN_ARRAYS) + r"))(:|$)"
)
"""Attributes of grains that are taken, or that say how they look."""


class Refused(Exception):
    """The file cannot be used; the text says why."""


def limit_memory(size: int) -> None:
    """Let this process take at most so much more memory for files of ``size`` bytes, where the system can hold it to that."""
    try:
        import resource

        status = Path("/proc/self/status").read_text()
        used = int(status.split("VmData:")[1].split()[0]) * 1024
        resource.setrlimit(resource.RLIMIT_DATA, (used + MEMORY_SLACK + MEMORY_SHARE * size, resource.RLIM_INFINITY))
    except (ImportError, OSError, ValueError, IndexError):
        return  # another system than Linux, or one that allows less already: the time limit remains


def limit_time(size: int) -> None:
    """Let this process take so much processor time for a file of ``size`` bytes, where the system can hold it to that."""
    with contextlib.suppress(ImportError, OSError, ValueError):
        import resource

        seconds = int(SECONDS + size / BYTES_PER_SECOND)
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, resource.getrlimit(resource.RLIMIT_CPU)[1]))


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


def all_prims(stage):
    """All live, defined prims of a stage, those within instances too."""
    from pxr import Usd

    return Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies())


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


def units_of(stage) -> dict:
    """Units, upright axis and time scale of a stage, and what of it the file does not say."""
    from pxr import UsdGeom

    unsaid = [] if UsdGeom.StageHasAuthoredMetersPerUnit(stage) else ["metersPerUnit (0.01 then, by the rules of USD)"]
    unsaid += [] if stage.HasAuthoredMetadata("upAxis") else ["upAxis (Y then, by the rules of USD)"]
    metres, rate = UsdGeom.GetStageMetersPerUnit(stage), stage.GetTimeCodesPerSecond()
    for name, value in (("metersPerUnit", metres), ("timeCodesPerSecond", rate)):
        if not (np.isfinite(value) and value > 0.0):
            raise Refused(f"{name} = {value:g}, must be above 0")
    return {"metres": metres, "rate": rate, "up": str(UsdGeom.GetStageUpAxis(stage)), "unsaid": unsaid}


def prim_at(stage, path: str, wanted: str):
    """The prim of a path, live and defined.

    Raises:
        Refused: there is none; names those that are a ``wanted``.
    """
    from pxr import Sdf, Usd, UsdGeom

    prim = stage.GetPrimAtPath(path) if Sdf.Path.IsValidPathString(path) else None
    if prim and prim.IsActive() and prim.IsDefined() and not prim.IsAbstract():
        return prim
    schema = getattr(UsdGeom, wanted)
    everything = Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies())
    there = [str(p.GetPath()) for p in everything if p.IsA(schema)]
    listed = ", ".join(there[:8]) + (f" and {len(there) - 8} more" if len(there) > 8 else "")
    raise Refused(f"prim = {path!r}: no such prim; there is {listed or 'none'}")


def matrix_of(cache, prim) -> np.ndarray:
    """Local-to-world matrix for column vectors, shape (4, 4)."""
    matrix = np.array(cache.GetLocalToWorldTransform(prim)).T
    if not np.isfinite(matrix).all():
        raise Refused(f"{prim.GetPath()}: its transform holds a number that is not finite")
    return matrix


def sample_codes(prim) -> set[float]:
    """Time codes at which a prim or something it stands in has another transform."""
    from pxr import UsdGeom

    codes: set[float] = set()
    while prim and not prim.IsPseudoRoot():
        xform = UsdGeom.Xformable(prim)
        codes |= set(xform.GetTimeSamples()) if xform else set()
        prim = None if xform and xform.GetResetXformStack() else prim.GetParent()
    return codes


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


def read_geometry(stage, path: str) -> tuple[dict, dict[str, np.ndarray]]:
    """All surfaces at and below a prim (or of the stage) at time 0, in their own axes with their matrices.

    What is invisible or meant as a guide or a stand-in is left out, unless it is the very prim that is named.
    """
    from pxr import Usd, UsdGeom

    top = prim_at(stage, path, "Gprim") if path else stage.GetPseudoRoot()
    surfaces, arrays, left_out = [], {}, []
    noticed, physics = [], [words for words in map(physics_words, carriers(top)) if words]
    cache = UsdGeom.XformCache(0.0)
    for prim in Usd.PrimRange(top, Usd.TraverseInstanceProxies()):
        name = str(prim.GetPath())
        physics += [words] if (words := physics_words(prim)) else []
        if prim != top and prim.HasAttribute("visibility") and prim.GetAttribute("visibility").ValueMightBeTimeVarying():
            noticed.append(f"{name}: its visibility changes with time; it is taken as it is at time 0")
        if prim.IsA(UsdGeom.PointInstancer):
            raise Refused(f"{name} is a point instancer, which is not read; make its instances prims of their own")
        if not prim.IsA(UsdGeom.Gprim):
            continue
        kind = str(prim.GetTypeName())
        shown = UsdGeom.Imageable(prim)
        if prim != top and shown.ComputeVisibility(0.0) == "invisible":
            left_out.append(f"{name} (invisible)")
        elif prim != top and shown.ComputePurpose() in ("guide", "proxy"):
            left_out.append(f"{name} (purpose {shown.ComputePurpose()})")
        elif kind.endswith(WITHOUT_SURFACE):
            left_out.append(f"{name} ({kind} has no surface)")
        elif kind == "Mesh" or kind in SHAPES:
            surface, held = mesh_of(prim) if kind == "Mesh" else shape_of(prim, kind)
            matrix = matrix_of(cache, prim)
            surfaces.append({"path": name, "kind": kind, "moves": bool(sample_codes(prim)), **surface, **about(prim)})
            arrays |= {f"{len(surfaces) - 1}.{key}": values for key, values in {**held, "matrix": matrix}.items()}
        else:
            raise Refused(f"{name} is a {kind}; read are Mesh, {', '.join(SHAPES)}")
    if not surfaces:
        more = f"; left out: {', '.join(left_out[:8])}" if left_out else ""
        where = f"prim = {path!r}" if path else "it"
        raise Refused(f"{where} holds no surface (no Mesh, {', '.join(SHAPES)}){more}")
    if not path and len(surfaces) > 1:
        names = ", ".join(surface["path"] for surface in surfaces[:8]) + (" and more" if len(surfaces) > 8 else "")
        raise Refused(
            f"the stage holds {len(surfaces)} surfaces ({names}): say with prim which one, or what they stand in"
        )
    return {"surfaces": surfaces, "left_out": left_out, "noticed": noticed, "physics": physics}, arrays


def carriers(prim) -> list:
    """What a prim stands in, the nearest first."""
    found = []
    while not prim.IsPseudoRoot() and not (prim := prim.GetParent()).IsPseudoRoot():
        found.append(prim)
    return found


def physics_words(prim) -> str:
    """The physics of a prim in words, which geometry leaves out; empty if it has none, or is no more than a collider."""
    said = physics_of(prim, "")
    names = [name for name in (said.get("schemas") or said.get("values", ())) if name != "PhysicsCollisionAPI"]
    return f"{prim.GetPath()} ({', '.join(names)})" if names else ""


def about(prim) -> dict:
    """Winding of a surface and the name of its material."""
    from pxr import UsdGeom, UsdShade

    material = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0]
    return {
        "left_handed": UsdGeom.Gprim(prim).GetOrientationAttr().Get(0.0) == UsdGeom.Tokens.leftHanded,
        "material": str(material.GetPath()) if material else "",
    }


def still(prim, *names: str) -> list:
    """Values of attributes that do not change with time.

    Raises:
        Refused: one is missing or has time samples.
    """
    values = []
    for name in names:
        attribute = prim.GetAttribute(name)
        if attribute.ValueMightBeTimeVarying():
            raise Refused(f"{prim.GetPath()}: its {name} change with time: only its place may move, not its shape")
        value = attribute.Get(0.0)
        if value is None:
            raise Refused(f"{prim.GetPath()} has no {name}")
        values.append(value)
    return values


def mesh_of(prim) -> tuple[dict, dict[str, np.ndarray]]:
    """Points (v, 3), counts and indices of the polygons of a mesh without its holes."""
    from pxr import UsdGeom

    if prim.HasProperty("primvars:skel:jointIndices"):
        raise Refused(f"{prim.GetPath()} is bound to a skeleton, which is not read")
    points, counts, indices = map(np.array, still(prim, "points", "faceVertexCounts", "faceVertexIndices"))
    mesh = UsdGeom.Mesh(prim)
    holes = np.array(mesh.GetHoleIndicesAttr().Get(0.0) or (), dtype=np.int64)
    scheme = mesh.GetSubdivisionSchemeAttr()
    smooth = str(scheme.Get()) if scheme.HasAuthoredValue() and scheme.Get() != UsdGeom.Tokens.none else ""
    held = {"points": points.reshape(-1, 3), "counts": counts.ravel(), "indices": indices.ravel(), "holes": holes}
    return {"subdivision": smooth}, held


def shape_of(prim, kind: str) -> tuple[dict, dict[str, np.ndarray]]:
    """Lengths of a primitive shape in its own units, and its axis."""
    sizes = {name: value for name, value in zip(SHAPES[kind], still(prim, *SHAPES[kind]), strict=True)}
    axis = str(sizes.pop("axis", "Z"))
    for name, value in sizes.items():
        if not (np.isfinite(value) and value > 0.0):
            raise Refused(f"{prim.GetPath()}: {name} = {value:g}, must be above 0")
    return {"sizes": {name: float(value) for name, value in sizes.items()}, "axis": axis}, {}


def read_scene(stage, at: str) -> tuple[dict, dict[str, np.ndarray]]:
    """All prims that say something about a scene, in the order of the stage.

    Each has its ``path``, ``kind`` (Scene, RigidBodyMaterial, SpherePointsShape, one of `COLLIDERS`, or Table), the nearest
    such prim ``above`` it, its tables ``dem``, the bound ``material``, and what its kind has; arrays are of grains.
    """
    from pxr import UsdGeom, UsdPhysics

    physics = UsdPhysics.UsdPhysicsLoadStageFromPrimRange(stage, ["/"])
    bodies = {str(desc.primPath): desc for kind, (_, found) in physics.items() if str(kind) == "RigidBody" for desc in found}
    descs = [desc for kind, (_, found) in physics.items() if str(kind) != "RigidBody" for desc in found]
    strange = next((d for d in descs if str(d.type).endswith("Shape") and str(d.type) not in (*COLLIDERS, GRAINS)), None)
    if strange is not None:
        raise Refused(f"{strange.primPath} is a {strange.type}, which is no wall; make a Mesh of it, or make it inactive")
    # joints and what else a prim may be besides are found by their schemas
    records = {str(desc.primPath): desc for desc in descs if str(desc.type) in (*COLLIDERS, *STANDARD, GRAINS)}
    kinds = {path: str(desc.type) for path, desc in records.items()}
    frames = sorted({t for p, k in kinds.items() if k == GRAINS for t in frame_codes(stage.GetPrimAtPath(p))})
    code = frame_code(frames, at, stage.GetTimeCodesPerSecond())
    prims, arrays, facts, beside = {}, {}, [], []
    for prim in all_prims(stage):
        path, tables = str(prim.GetPath()), dem_tables(prim)
        kind = kinds.get(path) or ("Table" if "list" in tables else "")
        said = physics_of(prim, kind)
        facts += [said] if said else []
        if not kind and prim.IsA(UsdGeom.PointInstancer):
            beside.append(instancer(prim))
        collides = prim.HasAPI(UsdPhysics.CollisionAPI) and UsdPhysics.CollisionAPI(prim).GetCollisionEnabledAttr().Get()
        if collides and not kind:
            raise Refused(
                f"{path} collides (PhysicsCollisionAPI) but is {a_kind(prim)}, which is no wall: apply the schema to each Mesh "
                "or shape that is one"
            )
        if not kind and prim.IsA(UsdGeom.Gprim):
            beside.append(path)
        if not kind:
            if tables:
                raise Refused(
                    f"{path}.dem:{next(iter(tables))}: the prim is no physics scene, physics material, collider or grains, and "
                    "does not say with dem:list which list of the scene it is an entry of"
                )
            continue
        above = next((p for p in above_of(path) if p in prims), "")
        prims[path] = {"path": path, "kind": kind, "above": above, "dem": tables, "material": bound_material(prim)}
        if kind in STANDARD:
            given = [prim.GetAttribute(name) for name in STANDARD[kind]]
            prims[path]["standard"] = {a.GetName(): plain(a) for a in given if a and a.HasAuthoredValue()}
        elif kind in COLLIDERS:
            prims[path] |= collider(prim, records[path], bodies)
        elif kind == GRAINS:
            prims[path] |= grains_of(prim, records[path], bodies, bool(frames))
            arrays |= {f"{path} {name}": values for name, values in grain_arrays(prim, code).items()}
    kilograms = UsdPhysics.GetStageKilogramsPerUnit(stage)
    if not (np.isfinite(kilograms) and kilograms > 0.0):
        raise Refused(f"kilogramsPerUnit = {kilograms:g}, must be above 0")
    check_overs(stage)
    found = {"prims": list(prims.values()), "physics": facts, "beside": beside}
    return {**found, "kilograms": kilograms, "code": code if frames else None}, arrays


def a_kind(prim) -> str:
    """Type of a prim with its article, for messages."""
    return f"a {prim.GetTypeName()}" if prim.GetTypeName() else "of no type"


def instancer(prim) -> str:
    """Path of a point instancer.

    Raises:
        Refused: what it repeats is more than a picture.
    """
    from pxr import Usd, UsdGeom

    path = prim.GetPath()
    for target in UsdGeom.PointInstancer(prim).GetPrototypesRel().GetForwardedTargets():
        top = prim.GetStage().GetPrimAtPath(target)
        for part in Usd.PrimRange(top, Usd.TraverseInstanceProxies()) if top else ():
            if physics_of(part, "") or dem_tables(part):
                raise Refused(
                    f"{path} is a point instancer of {part.GetPath()}, which has physics: it is not read; make its instances "
                    "prims of their own (grains: Points)"
                )
    return f"{path} (a point instancer)"


def physics_of(prim, kind: str) -> dict:
    """What a prim says about physics, in schemas and attributes known here or not; empty if nothing.

    Returns:
        The fields of `warpdem.usd.schemas.Prim`.
    """
    from pxr import Usd

    info = prim.GetPrimTypeInfo()
    kind_of_prim = str(info.GetTypeName())
    schemas = [str(name) for name in info.GetAppliedAPISchemas() if PHYSICS.match(str(name))]
    values, sampled = {}, []
    for prop in prim.GetAuthoredProperties():
        name = prop.GetName()
        if not any(PHYSICS.match(part) for part in name.split(":")) and name != "node:type":
            continue
        if name.startswith(("material:binding", "dem:", "primvars:")):
            continue
        if isinstance(prop, Usd.Relationship):
            values[name] = [str(target) for target in prop.GetTargets()]
        elif prop.HasAuthoredValue():
            values[name] = brief(prop)
            sampled += [name] if prop.ValueMightBeTimeVarying() else []
    physical = kind_of_prim if PHYSICS.match(kind_of_prim) else ""
    if not (physical or schemas or values):
        return {}
    said = {"path": str(prim.GetPath()), "type": physical, "schemas": schemas, "values": values, "sampled": sampled}
    return {**said, "kind": kind, "moves": has_samples(prim)}


def has_samples(prim) -> bool:
    """Whether the own transform of a prim has time samples."""
    from pxr import UsdGeom

    xform = UsdGeom.Xformable(prim)
    return bool(xform and xform.GetTimeSamples())


def brief(attribute) -> object:
    """Value of an attribute of another program as JSON has it; of long ones their length."""
    value = attribute.Get(0.0)
    if isinstance(value, (bool, int, float, str)):
        return value
    if hasattr(value, "__len__") and len(value) > 16:
        return f"{len(value)} values"
    try:
        numbers = np.array(value)
    except (TypeError, ValueError):
        return str(value)
    return numbers.tolist() if numbers.dtype.kind in "fiub" else str(value)


def check_overs(stage) -> None:
    """Look for prims that are changed but nowhere defined: USD passes over them in silence.

    Raises:
        Refused: one has something to say about the scene, as one does whose path is misspelt.
    """
    from pxr import Usd

    for prim in Usd.PrimRange.AllPrims(stage.GetPseudoRoot()):
        if prim.IsActive() and not prim.IsDefined() and not prim.IsAbstract() and (physics_of(prim, "") or dem_tables(prim)):
            raise Refused(f"{prim.GetPath()} is an over, and nothing defines the prim; correct its path, or take it out")


def grains_of(prim, desc, bodies: dict, frames: bool) -> dict:
    """Whether grains collide, the names of their attributes that are not taken, and of those of which one sample is.

    Raises:
        Refused: they would be one rigid body.
    """
    body = bodies.get(str(desc.rigidBody))
    if body is not None and body.rigidBodyEnabled and desc.collisionEnabled:
        raise Refused(
            f"{prim.GetPath()}: its points would be one stiff body, by PhysicsRigidBodyAPI at {desc.rigidBody}; grains move "
            "each by itself: take the schema out"
        )
    names = [attribute.GetName() for attribute in prim.GetAuthoredAttributes() if attribute.HasAuthoredValue()]
    left = [name for name in names if not GRAINS_TAKEN.match(name)]
    left = [name for name in left if not any(PHYSICS.match(part) for part in name.split(":"))]
    moving = [name for name in ("points", "widths", "velocities", "ids") if prim.GetAttribute(name).ValueMightBeTimeVarying()]
    return {"enabled": bool(desc.collisionEnabled), "left": left, "moving": [] if frames else moving}


def above_of(path: str) -> list[str]:
    """Paths of what a prim stands in, the nearest first."""
    parts = path.split("/")
    return ["/".join(parts[:n]) for n in range(len(parts) - 1, 1, -1)]


def frame_codes(prim) -> list[float]:
    """Time codes of the frames of a result."""
    attribute = prim.GetAttribute("primvars:dem:positions")
    return attribute.GetTimeSamples() if attribute else []


def frame_code(frames: list[float], at: str, rate: float) -> float:
    """Time code of the frame nearest to ``at`` [s], the last one without it; 0 in a stage without frames.

    Raises:
        Refused: there are no frames, or the time lies outside them.
    """
    if not frames:
        if at:
            raise Refused(f"at = {at} s: it holds no frames of a run (no primvars:dem:positions with time samples)")
        return 0.0
    wanted = float(at) * rate if at else frames[-1]
    slack = 1e-6 * abs(frames[-1])
    if not frames[0] - slack <= wanted <= frames[-1] + slack:
        raise Refused(f"at = {at} s: its frames lie between {frames[0] / rate:g} and {frames[-1] / rate:g} s")
    return min(frames, key=lambda code: abs(code - wanted))


def dem_tables(prim) -> dict[str, object]:
    """Values of the attributes ``dem:KEY``, and names or targets of the relationships, by KEY."""
    from pxr import Usd

    found: dict[str, object] = {}
    for prop in prim.GetAuthoredPropertiesInNamespace("dem"):
        key = prop.GetName().removeprefix("dem:")
        if isinstance(prop, Usd.Relationship):
            found[key] = {"targets": [str(target) for target in prop.GetTargets()]}
        elif prop.HasAuthoredValue():
            if prop.ValueMightBeTimeVarying():
                raise Refused(f"{prop.GetPath()} changes with time; dem: attributes have one value")
            found[key] = plain(prop)
    return found


def plain(attribute) -> object:
    """Value of an attribute as JSON has it; a single-precision number is the shortest decimal that rounds to it."""
    value = attribute.Get(0.0)
    if attribute.GetTypeName().scalarType == "asset":
        if hasattr(value, "__len__"):
            raise Refused(f"{attribute.GetPath()}: a list of files is not read")
        return {"file": value.path, "found": value.resolvedPath}
    if isinstance(value, (bool, int, str)):
        return value
    numbers = np.array(value)
    if numbers.dtype.kind not in "fiub":
        return [str(entry) for entry in value]
    single = re.search(r"float|half|Vec\d[fh]", attribute.GetTypeName().type.typeName)
    return (shortest(numbers) if single else numbers).tolist()


def shortest(numbers: np.ndarray) -> np.ndarray:
    """The float64 that stand for single-precision numbers: 9.81, not 9.8100004."""
    return numbers.astype(np.float32).astype("U32").astype(np.float64) if numbers.dtype.kind == "f" else numbers


def bound_material(prim) -> str:
    """Path of the material bound for physics, or for all purposes."""
    from pxr import UsdShade

    material = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial("physics")[0]
    return str(material.GetPath()) if material else ""


def collider(prim, desc, bodies: dict) -> dict:
    """What the physics parser says of a shape: its place, its lengths, and the body that carries it."""
    from pxr import UsdGeom, UsdPhysics

    path = str(prim.GetPath())
    if not desc.collisionEnabled:
        return {"enabled": False}
    if getattr(desc, "approximation", "none") not in TRUE_TRIANGLES:
        raise Refused(f"{path}: approximation = {desc.approximation}: walls are the true triangles, so it must be none")
    if len({str(material) for material in desc.materials}) > 1:
        raise Refused(f"{path}: its parts have different physics materials; a wall has one")
    still(prim, *(name for name in ("radius", "axis") if prim.HasAttribute(name)))
    said = {
        "matrix": matrix_of(UsdGeom.XformCache(0.0), prim).tolist(),
        "axis": str(getattr(desc, "axis", "Z")),
        "radius": float(prim.GetAttribute("radius").Get(0.0)) if prim.HasAttribute("radius") else 0.0,
        "moves": bool(sample_codes(prim)),
        "enabled": True,
    }
    body = bodies.get(str(desc.rigidBody))
    if body is None or not body.rigidBodyEnabled:
        return said
    if not body.kinematicBody:
        raise Refused(
            f"{desc.rigidBody} is a rigid body that moves by forces, which walls do not; set physics:kinematicEnabled = true"
        )
    moved, cache = prim.GetStage().GetPrimAtPath(desc.rigidBody), UsdGeom.XformCache(0.0)
    rigid = UsdPhysics.RigidBodyAPI(moved)
    check_carriers(moved, bodies)
    said["body"] = {
        "path": str(desc.rigidBody),
        "parent": np.array(cache.GetParentToWorldTransform(moved)).T.tolist(),
        "origin": matrix_of(cache, moved)[:3, 3].tolist(),
        "velocity": plain(rigid.GetVelocityAttr()),
        "spin": plain(rigid.GetAngularVelocityAttr()),
        "moves": has_samples(moved),
    }
    return said


def check_carriers(body, bodies: dict) -> None:
    """Look for bodies that a body stands in.

    Raises:
        Refused: one of them moves by its velocities, which the inner one would not follow.
    """
    from pxr import UsdGeom

    here = body
    while not here.IsPseudoRoot():
        xform = UsdGeom.Xformable(here)
        if xform and xform.GetResetXformStack():
            return
        here = here.GetParent()
        outer = bodies.get(str(here.GetPath()))
        if outer is not None and outer.rigidBodyEnabled and any([*outer.linearVelocity, *outer.angularVelocity]):
            raise Refused(
                f"{body.GetPath()} is a body within the body {here.GetPath()}, which moves by its velocities: it would not be "
                "carried along; give the inner one dem:motion with both motions, the outer one first, and take its schema out"
            )


def grain_arrays(prim, code: float) -> dict[str, np.ndarray]:
    """Arrays of the grains of a Points prim at a time code: as USD has them, and in float64 where they are there."""
    from pxr import UsdGeom

    api = UsdGeom.PrimvarsAPI(prim)
    widths = api.GetPrimvar("widths") or prim.GetAttribute("widths")
    sources = {
        "points": prim.GetAttribute("points"), "widths": widths, "velocities": prim.GetAttribute("velocities"),
        "omega": api.GetPrimvar("omega"), "ids": prim.GetAttribute("ids"), "group": api.GetPrimvar("group"),
        **{f"dem.{name}": api.GetPrimvar(f"dem:{name}") for name in GRAIN_ARRAYS},
    }  # fmt: skip
    held = {name: value_at(source, code) for name, source in sources.items() if source}
    arrays = {name: shortest(np.array(values)) for name, values in held.items() if values is not None}
    for name, values in held.items():
        if name.startswith("dem.") and values is not None:
            arrays[name] = np.array(values)
    arrays["matrix"] = matrix_of(UsdGeom.XformCache(code), prim)
    return arrays


def value_at(source, code: float):
    """Value of an attribute or primvar at a time code; one with indices is spread out by them."""
    return source.ComputeFlattened(code) if getattr(source, "IsIndexed", bool)() else source.Get(code)


def answer(what: str, file: str, about_what: str, folders: list[str]) -> dict[str, np.ndarray]:
    """All arrays of the answer to one question."""
    from pxr import Tf

    arrays: dict[str, np.ndarray] = {}
    try:
        stage = open_stage(file, folders)
        noticed = unchosen_variants(stage)
        said, arrays = {"geometry": read_geometry, "motion": read_motion, "scene": read_scene}[what](stage, about_what)
        said |= units_of(stage)
        said["noticed"] = [*noticed, *said.get("noticed", ())]
    except Refused as refused:
        said = {"refused": str(refused)}
    except MemoryError:
        said = {"refused": "reading it takes far more memory than the file is long: damaged?"}
    except (Tf.ErrorException, RuntimeError) as error:
        try:
            text = " ".join(str(error).split())
        except UnicodeDecodeError:  # the library quotes the bytes it stumbled over
            text = "it holds bytes that are no text"
        said = {"refused": f"cannot be read as USD: {text[:400] or type(error).__name__}"}
    return {"answer": np.array(json.dumps(said)), **arrays}


def main() -> None:
    """Answer the question of the command line."""
    what, file, about_what, *folders = sys.argv[1:]
    # the answer alone goes to standard output: what libraries print goes to standard error
    with open(os.dup(1), "wb") as out:
        os.dup2(2, 1)
        held = io.BytesIO()
        with contextlib.suppress(BrokenPipeError):
            np.savez(held, **answer(what, file, about_what, folders))
            out.write(held.getbuffer())


if __name__ == "__main__":
    main()
