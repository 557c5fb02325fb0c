"""Results as USD: grains as points and walls as meshes under an Xform that carries the frame's motion.

    result.usda              small root layer over the scene: units, frame motion, wall motion, lists of chunks
    scene.usda               the scene as it was run
    result_usd/walls.usdc    wall meshes, written once
    result_usd/grains.usdc   grains of the first frame that has any, for readers that ask for no time
    result_usd/chunk_0000.usdc ...   grains in single precision and loads on walls, some frames each, for viewers
    result_usd/state_0000.usdc ...   the same grains in float64, to start from
    result_usd/manifest.usda, state.usda   names of what the chunks hold

The chunks are joined by value clips. The load on a wall is the primvar ``pressure`` [Pa] of its triangles, and ``force`` [N],
``torque`` [N m] about the point ``torqueAbout`` [m] and ``power`` [W] of the whole, vectors in frame axes. A time code is a
fixed share of a second (a millisecond unless told otherwise). The variant set ``view`` of ``/World/Frame`` shows the motion
in the laboratory (default) or in the frame's own axes.

Each frame is a scene: ``warpdem run result.usda --at SECONDS`` takes the grains of that frame in place of those the scene
began with (``/World/Grains``, switched off in the root layer), from ``primvars:dem:positions``, ``velocities`` and ``spins``
(frame axes, relative to the frame), ``radii`` and ``types``. Contacts begin anew: only checkpoints keep their history.
"""

import shutil
from pathlib import Path

import numpy as np

from warpdem.core.atomic_file import replaced
from warpdem.core.pose import FramePose, Placement, RotationPart, SampledPart, TranslationPart
from warpdem.core.snapshot import Snapshot, WallLoad, WallMesh
from warpdem.errors import WarpdemError
from warpdem.scene.tables import relative_to, scene_tables
from warpdem.scene.walls import MESH_SUFFIXES
from warpdem.scene.write_usd import GRAINS as _SOURCES
from warpdem.scene.write_usd import MATERIALS as _MATERIALS
from warpdem.scene.write_usd import WALLS as _WALLS
from warpdem.scene.write_usd import export, state_units, unused_paths, write_usd_scene
from warpdem.usd.stage import USD_SUFFIXES

ROOT = "result.usda"
SCENE = "scene.usda"

_PARTS = "result_usd"
_FIRST = f"./{_PARTS}/grains.usdc"
_FRAME = "/World/Frame"
_GRAINS = "/World/Frame/Grains"

# the open chunk is written anew for each frame, so its size bounds the cost of a frame
_CHUNK_BYTES = 8e6

_SHOWN = {
    "points": "point3f[]",
    "widths": "float[]",
    "velocities": "vector3f[]",
    "ids": "int64[]",
    "primvars:omega": "vector3f[]",
    "primvars:group": "int[]",
    "primvars:orientation": "quatf[]",
    "extent": "float3[]",
}
"""Attributes of the grains for viewers."""
_STATE = {
    "primvars:dem:positions": "double3[]",
    "primvars:dem:velocities": "double3[]",
    "primvars:dem:spins": "double3[]",
    "primvars:dem:radii": "double[]",
    "primvars:dem:types": "int[]",
}
"""Attributes of the grains to start from."""
# attribute of a wall prim: its type, field of the load
_LOAD_ATTRIBUTES = {
    "primvars:pressure": ("float[]", "pressure"),
    "force": ("vector3d", "force"),
    "torque": ("vector3d", "torque"),
    "torqueAbout": ("point3d", "about"),
    "power": ("double", "power"),
}
_SAND = (0.85, 0.68, 0.42)
_GLASS = (0.70, 0.78, 0.85)


class _Clips:
    """Frames of some attributes in files, some frames each, that the root layer plays as one set of value clips."""

    def __init__(
        self, folder: Path, name: str, file: str, types: dict[str, str], rate: float, frames: int, overlap: bool
    ) -> None:
        """Write the manifest.

        Args:
            folder: Folder of the root layer.
            name: Name of the set.
            file: Name of its files, and of its manifest.
            types: Type of each attribute, by path.
            rate: Time codes in one second [1/s].
            frames: Most frames in one file; fewer when they are large.
            overlap: Whether a file begins with the last frame of the one before, so that viewers interpolate across.
        """
        self._folder, self._file, self._types, self._rate = folder, file, types, rate
        self._frames, self._overlap = frames, overlap
        self.name = name
        self.clips: list[tuple[float, str]] = []
        self._layer = None
        self._codes = 0
        self._last: tuple[float, dict[str, object]] | None = None
        self._manifest = f"./{_PARTS}/{'manifest' if file == 'chunk' else file}.usda"
        export(self._new_layer(".usda"), folder / self._manifest)

    def add(self, code: float, samples: dict[str, object], size: float) -> None:
        """Write a frame of ``size`` bytes; samples by attribute path."""
        room = max(1 + self._overlap, min(self._frames, int(_CHUNK_BYTES / max(1.0, size))))
        if self._layer is None or self._codes >= room:
            self._layer, self._codes, begin = self._new_layer(".usdc"), 0, code
            if self._overlap and self._last is not None:
                begin, _ = self._last
                self._set(*self._last)
            self.clips.append((begin, f"./{_PARTS}/{self._file}_{len(self.clips):04d}.usdc"))
        self._set(code, samples)
        export(self._layer, self._folder / self.clips[-1][1])
        self._last = (code, samples)

    def described(self, prim: str) -> dict[str, object]:
        """Metadata of the set for one prim."""
        from pxr import Gf, Sdf, Vt

        return {
            "assetPaths": Sdf.AssetPathArray([Sdf.AssetPath(file) for _, file in self.clips]),
            "active": Vt.Vec2dArray([Gf.Vec2d(code, k) for k, (code, _) in enumerate(self.clips)]),
            "manifestAssetPath": Sdf.AssetPath(self._manifest),
            "primPath": prim,
        }

    def _set(self, code: float, samples: dict[str, object]) -> None:
        for path, value in samples.items():
            self._layer.SetTimeSample(path, code, value)
        self._codes += 1

    def _new_layer(self, suffix: str):
        """Layer that declares the attributes, without values."""
        from pxr import Sdf

        layer = Sdf.Layer.CreateAnonymous(suffix)
        state_units(layer)
        layer.timeCodesPerSecond = self._rate
        for path, kind in self._types.items():
            prim = Sdf.CreatePrimInLayer(layer, Sdf.Path(path).GetPrimPath())
            Sdf.AttributeSpec(prim, Sdf.Path(path).name, Sdf.ValueTypeNames.Find(kind))
        return layer


class UsdWriter:
    """Write ``result.usda``, the scene below it, and the chunks it plays."""

    def __init__(
        self,
        folder: Path,
        walls: list[WallMesh],
        *,
        scene=None,
        time_codes_per_second: float = 1000.0,
        frames_per_chunk: int = 50,
        resume: bool = False,
    ):
        """Prepare the folder.

        Args:
            folder: Where the files go; made if it is missing.
            walls: The mesh walls, each in its body axes.
            scene: Scene that the results belong to; without one they can be looked at, but not be started from.
            time_codes_per_second: Time codes of the stage in one second [1/s].
            frames_per_chunk: Most frames in one chunk; fewer when there are many grains.
            resume: Keep the frames of an earlier run that come before the first new one.
        """
        self._folder = Path(folder)
        (self._folder / _PARTS).mkdir(parents=True, exist_ok=True)
        self._walls = walls
        self._scene = scene
        self._wall_paths = dict(zip((w.name for w in walls), unused_paths(_WALLS, [w.name for w in walls]), strict=True))
        self._rate = time_codes_per_second
        self._frames_per_chunk = frames_per_chunk
        self._resume = resume and (self._folder / ROOT).exists()
        self._root = None
        self._loaded: dict[str, str] = {}  # path of each wall that comes with loads
        self._sets: list[_Clips] = []
        self._widths = (None, None)  # radii, and the widths made of them: equal arrays are stored once
        self._last: Snapshot | None = None

    def write(self, snapshot: Snapshot) -> None:
        """Write one frame; when this returns the stage shows it.

        Raises:
            WarpdemError: The frame moves about another axis or in another way than before.
        """
        code = self._code(snapshot)
        if self._root is None:
            self._start(snapshot, code)
        elif _fixed(snapshot.frame) != _fixed(self._first_frame):
            raise WarpdemError(
                f"{self._folder / ROOT}: the frame's axes or motions changed at t = {snapshot.time} s, must be fixed"
            )
        self._write_sample(snapshot, code)
        for path, value in _frame_samples(snapshot.frame).items():
            self._root.SetTimeSample(path, code, value)
        for wall in self._walls:
            self._write_placement(wall.name, snapshot, code)
        self._root.endTimeCode = code
        self._last = snapshot
        export(self._root, self._folder / ROOT)

    def close(self) -> None:
        """Nothing is held back: every frame is on disk when ``write`` returns."""

    def _code(self, snapshot: Snapshot) -> float:
        """Time code of a frame, without the last digits of step x dt (300, not 300.00000000000006)."""
        return round(float(snapshot.time) * self._rate, 6)

    def _start(self, snapshot: Snapshot, code: float) -> None:
        from pxr import Sdf

        self._first_frame = snapshot.frame
        self._loaded = {name: path for name, path in self._wall_paths.items() if name in snapshot.loads}
        export(_walls_layer(self._walls, self._wall_paths, self._loaded), self._folder / _PARTS / "walls.usdc")
        shown = {f"{_GRAINS}.{name}": kind for name, kind in _SHOWN.items()}
        shown |= {f"{path}.{name}": kind for path in self._loaded.values() for name, (kind, _) in _LOAD_ATTRIBUTES.items()}
        state = {f"{_GRAINS}.{name}": kind for name, kind in _STATE.items()}
        many = self._frames_per_chunk
        self._sets = [
            _Clips(self._folder, "default", "chunk", shown, self._rate, many, overlap=True),
            _Clips(self._folder, "state", "state", state, self._rate, many, overlap=False),
        ]
        self._root = _root_layer(snapshot.frame, list(self._wall_paths.values()), self._rate)
        # only now that the stage of _root_layer is gone: it would look for the sublayers beside a layer without a place
        self._root.subLayerPaths.append(f"./{_PARTS}/walls.usdc")
        if self._scene is not None:
            self._write_scene()
        self._root.startTimeCode = code
        if self._resume:
            earlier = Sdf.Layer.OpenAsAnonymous(str(self._folder / ROOT))
            self._keep(earlier, code)

    def _write_scene(self) -> None:
        """Write the scene and put it below the results, which take the place of its grains."""
        from pxr import Sdf, Vt

        tables = scene_tables(self._scene, self._kept_file)
        tables.pop("start", None)  # what it says of frame and walls is in their motions by now
        write_usd_scene(self._folder / SCENE, tables)
        self._root.subLayerPaths.append(f"./{SCENE}")
        Sdf.CreatePrimInLayer(self._root, _SOURCES).active = False
        grains = self._root.GetPrimAtPath(_GRAINS)
        schemas = Sdf.TokenListOp.Create(prependedItems=["PhysicsCollisionAPI"])
        grains.SetInfo("apiSchemas", schemas)
        groups = Sdf.AttributeSpec(grains, "dem:groups", Sdf.ValueTypeNames.StringArray, Sdf.VariabilityUniform)
        groups.default = Vt.StringArray(self._scene.groups)
        of = Sdf.RelationshipSpec(grains, "dem:materials", custom=True)
        for path in unused_paths(_MATERIALS, list(tables["materials"])):
            of.targetPathList.explicitItems.append(path)

    def _kept_file(self, file: Path) -> str:
        """Name of a file of the scene: a mesh is copied beside the results, so that they can be moved and shared."""
        if file.suffix.lower() not in MESH_SUFFIXES or file.suffix.lower() in USD_SUFFIXES:
            return relative_to(self._folder)(file)
        kept, count = self._folder / _PARTS / file.name, 1
        while kept.exists() and kept.read_bytes() != file.read_bytes():
            count += 1
            kept = kept.with_name(f"{file.stem}_{count}{file.suffix}")
        if not kept.exists():
            with replaced(kept) as part:
                shutil.copyfile(file, part)
        return relative_to(self._folder)(kept)

    def _keep(self, earlier, code: float) -> None:
        """Take over what an earlier run wrote for times before ``code``."""
        if earlier.startTimeCode >= code:
            return
        if _FIRST in earlier.subLayerPaths:
            self._root.subLayerPaths.append(_FIRST)
        self._root.startTimeCode = earlier.startTimeCode
        paths = [*_frame_samples(self._first_frame)]
        paths += [f"{path}.{op}" for path in self._wall_paths.values() for op in _PLACEMENT_OPS]
        for path in paths:
            for t in earlier.ListTimeSamplesForPath(path):
                if t < code:
                    self._root.SetTimeSample(path, t, earlier.QueryTimeSample(path, t))
        played = earlier.GetPrimAtPath(_GRAINS).GetInfo("clips")
        for clips in self._sets:
            files = [asset.path for asset in played[clips.name]["assetPaths"]]
            clips.clips = [(t, files[int(k)]) for t, k in played[clips.name]["active"] if t < code]

    def _write_sample(self, snapshot: Snapshot, code: float) -> None:
        shown, state = self._shown(snapshot), _state(snapshot)
        if len(snapshot.id) and _FIRST not in self._root.subLayerPaths:
            export(_first_layer(shown), self._folder / _FIRST)
            # a layer below that of the clips, which values of no time beside them would hide
            self._root.subLayerPaths.append(_FIRST)
        for clips, samples in zip(self._sets, (shown, state), strict=True):
            clips.add(code, samples, sum(_bytes(value) for value in samples.values()))
        self._root.GetPrimAtPath(_GRAINS).SetInfo("clips", {clips.name: clips.described(_GRAINS) for clips in self._sets})
        if self._loaded:
            self._root.GetPrimAtPath(_WALLS).SetInfo("clips", {"default": self._sets[0].described(_WALLS)})

    def _shown(self, snapshot: Snapshot) -> dict[str, object]:
        """What viewers see of grains and loads, by attribute path."""
        from pxr import Vt

        if self._widths[0] is None or not np.array_equal(self._widths[0], snapshot.radius):
            self._widths = (snapshot.radius.copy(), Vt.FloatArray.FromNumpy((2.0 * snapshot.radius).astype(np.float32)))
        points = np.ascontiguousarray(snapshot.position, dtype=np.float32)
        samples = {
            "points": Vt.Vec3fArray.FromNumpy(points),
            "widths": self._widths[1],
            "velocities": Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(snapshot.velocity, dtype=np.float32)),
            "ids": Vt.Int64Array.FromNumpy(np.ascontiguousarray(snapshot.id, dtype=np.int64)),
            "primvars:omega": Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(snapshot.spin, dtype=np.float32)),
            "primvars:group": Vt.IntArray.FromNumpy(np.ascontiguousarray(snapshot.group, dtype=np.int32)),
            "extent": _extent(points, snapshot.radius.max(initial=0.0)),
        }
        if snapshot.orientation is not None:
            # Gf holds the scalar part last
            turned = np.ascontiguousarray(np.roll(snapshot.orientation, -1, axis=1), dtype=np.float32)
            samples["primvars:orientation"] = Vt.QuatfArray.FromNumpy(turned)
        samples = {f"{_GRAINS}.{name}": value for name, value in samples.items()}
        for name, path in self._loaded.items():
            samples |= {f"{path}.{key}": value for key, value in _load_values(snapshot.loads[name]).items()}
        return samples

    def _write_placement(self, name: str, snapshot: Snapshot, code: float) -> None:
        """Add a sample when the wall has moved, and one that held it in place until the frame before."""
        path = self._wall_paths[name]
        placement = snapshot.walls[name]
        last = None if self._last is None else self._last.walls[name]
        if last is not None:
            if np.array_equal(last.rotation, placement.rotation) and np.array_equal(
                last.translation, placement.translation
            ):
                return
            self._add_placement(path, last, self._code(self._last))
        self._add_placement(path, placement, code)

    def _add_placement(self, path: str, placement: Placement, code: float) -> None:
        from pxr import Gf

        # Gf matrices act on row vectors
        turn = Gf.Matrix3d(*placement.rotation.T.ravel().tolist()).ExtractRotation().GetQuat()
        translate, orient = (f"{path}.{op}" for op in _PLACEMENT_OPS)
        self._root.SetTimeSample(translate, code, Gf.Vec3d(*placement.translation.tolist()))
        self._root.SetTimeSample(orient, code, turn)


_PLACEMENT_OPS = ("xformOp:translate", "xformOp:orient")


def _root_layer(frame: FramePose, wall_paths: list[str], rate: float):
    """Root layer without frames: units, prims, transform ops."""
    from pxr import Gf, Sdf, Usd, UsdGeom, Vt

    layer = Sdf.Layer.CreateAnonymous(".usda")
    stage = Usd.Stage.Open(layer)
    state_units(layer)
    stage.SetTimeCodesPerSecond(rate)
    stage.SetFramesPerSecond(25.0)
    UsdGeom.Xform.Define(stage, "/World")
    _author_frame_ops(stage, frame)
    grains = UsdGeom.Points.Define(stage, _GRAINS)
    # a stage has only those attributes of its clips that a layer declares
    for name, kind in (_SHOWN | _STATE).items():
        if name.startswith("primvars:"):
            kind = Sdf.ValueTypeNames.Find(kind)
            UsdGeom.PrimvarsAPI(grains).CreatePrimvar(name.removeprefix("primvars:"), kind, UsdGeom.Tokens.vertex)
    grains.CreateDisplayColorAttr(Vt.Vec3fArray([Gf.Vec3f(*_SAND)]))
    for path in wall_paths:
        wall = UsdGeom.Xformable(stage.OverridePrim(path))
        wall.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble)
        wall.AddOrientOp(UsdGeom.XformOp.PrecisionDouble)
    return layer


def _author_frame_ops(stage, frame: FramePose) -> None:
    """One group of transform ops for each motion of the frame, outermost first; angles are not wrapped.

    A rotation is x = o + B Rz(angle) B^T (x' - o), B the constant turn that takes z onto the axis. An orient op would be
    shorter, but quaternions lose whole turns between two frames, and so do matrices; only a sampled motion, which has no
    axis of its own, is given by one.
    """
    from pxr import Gf, UsdGeom

    xform = UsdGeom.Xform.Define(stage, _FRAME)
    double = UsdGeom.XformOp.PrecisionDouble
    ops = []
    for k, part in enumerate(frame.parts):
        if isinstance(part, TranslationPart):
            ops.append(xform.AddTranslateOp(double, f"shift{k}"))
        elif isinstance(part, SampledPart):
            ops += [xform.AddTranslateOp(double, f"shift{k}"), xform.AddOrientOp(double, f"turn{k}")]
        else:
            x, y, z = (float(c) for c in part.axis)
            tilt = Gf.Vec3d(0.0, np.degrees(np.arctan2(np.hypot(x, y), z)), np.degrees(np.arctan2(y, x)))
            there = [xform.AddTranslateOp(double, f"origin{k}"), xform.AddRotateXYZOp(double, f"axis{k}")]
            there[0].Set(Gf.Vec3d(*(float(c) for c in part.origin)))
            there[1].Set(tilt)
            angle = xform.AddRotateZOp(double, f"angle{k}")
            back = [xform.AddRotateXYZOp(double, f"axis{k}", True), xform.AddTranslateOp(double, f"origin{k}", True)]
            ops += [*there, angle, *back]
    # the order that the calls above wrote would win over the variants
    xform.GetPrim().RemoveProperty("xformOpOrder")
    views = xform.GetPrim().GetVariantSets().AddVariantSet("view")
    for view, order in {"frame": [], "laboratory": ops}.items():
        views.AddVariant(view)
        views.SetVariantSelection(view)
        with views.GetVariantEditContext():
            xform.SetXformOpOrder(order)


def _frame_samples(frame: FramePose) -> dict[str, object]:
    """Values of the ops of the frame that change with time, by attribute path."""
    from pxr import Gf

    samples: dict[str, object] = {}
    for k, part in enumerate(frame.parts):
        if isinstance(part, RotationPart):
            samples[f"{_FRAME}.xformOp:rotateZ:angle{k}"] = float(np.degrees(part.angle))
            continue
        samples[f"{_FRAME}.xformOp:translate:shift{k}"] = Gf.Vec3d(*part.shift.tolist())
        if isinstance(part, SampledPart):
            w, *v = part.quaternion.tolist()
            samples[f"{_FRAME}.xformOp:orient:turn{k}"] = Gf.Quatd(w, *v)
    return samples


def _fixed(frame: FramePose) -> list[tuple]:
    """What must not change during a run: the kinds of the frame's motions, and axes and origins of rotations."""
    return [
        (type(part), *part.axis.tolist(), *part.origin.tolist()) if isinstance(part, RotationPart) else (type(part),)
        for part in frame.parts
    ]


def _walls_layer(walls: list[WallMesh], paths: dict[str, str], loaded: dict[str, str]):
    """Layer with the wall meshes in their body axes; those in ``loaded`` have room for a pressure."""
    from pxr import Gf, Sdf, Usd, UsdGeom, Vt

    layer = Sdf.Layer.CreateAnonymous(".usdc")
    state_units(layer)
    stage = Usd.Stage.Open(layer)
    UsdGeom.Scope.Define(stage, _WALLS)
    for wall in walls:
        mesh = UsdGeom.Mesh.Define(stage, paths[wall.name])
        points = np.ascontiguousarray(wall.vertices, dtype=np.float32)
        mesh.GetPrim().SetDisplayName(wall.name)
        mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
        mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(wall.triangles), 3, dtype=np.int32)))
        mesh.CreateFaceVertexIndicesAttr(
            Vt.IntArray.FromNumpy(np.ascontiguousarray(wall.triangles, dtype=np.int32).ravel())
        )
        mesh.CreateExtentAttr(_extent(points))
        mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        mesh.CreateDoubleSidedAttr(True)
        mesh.CreateDisplayColorAttr(Vt.Vec3fArray([Gf.Vec3f(*_GLASS)]))
        mesh.CreateDisplayOpacityAttr(Vt.FloatArray([0.3]))
        if wall.name in loaded:
            UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("pressure", Sdf.ValueTypeNames.FloatArray, UsdGeom.Tokens.uniform)
    return layer


def _first_layer(shown: dict[str, object]):
    """Layer with places and sizes of the grains of a frame, for no time in particular."""
    from pxr import Sdf

    layer = Sdf.Layer.CreateAnonymous(".usdc")
    state_units(layer)
    grains = Sdf.CreatePrimInLayer(layer, _GRAINS)
    for name in ("points", "widths", "extent"):
        attribute = Sdf.AttributeSpec(grains, name, Sdf.ValueTypeNames.Find(_SHOWN[name]))
        attribute.default = shown[f"{_GRAINS}.{name}"]
    return layer


def _state(snapshot: Snapshot) -> dict[str, object]:
    """Grains in float64, by attribute path."""
    from pxr import Vt

    vectors = {"positions": snapshot.position, "velocities": snapshot.velocity, "spins": snapshot.spin}
    samples = {name: Vt.Vec3dArray.FromNumpy(np.ascontiguousarray(values)) for name, values in vectors.items()}
    samples["radii"] = Vt.DoubleArray.FromNumpy(np.ascontiguousarray(snapshot.radius))
    samples["types"] = Vt.IntArray.FromNumpy(np.ascontiguousarray(snapshot.type, dtype=np.int32))
    return {f"{_GRAINS}.primvars:dem:{name}": value for name, value in samples.items()}


def _bytes(value) -> int:
    """Bytes of an array of the USD library, roughly; next to nothing for single numbers."""
    return memoryview(value).nbytes if hasattr(value, "__len__") and len(value) > 3 else 24


def _load_values(load: WallLoad) -> dict[str, object]:
    """The attributes of a wall prim that hold a load."""
    from pxr import Gf, Vt

    makers = {
        "float[]": lambda value: Vt.FloatArray.FromNumpy(value.astype(np.float32)),
        "vector3d": lambda value: Gf.Vec3d(*value.tolist()),
        "point3d": lambda value: Gf.Vec3d(*value.tolist()),
        "double": float,
    }
    values = {name: getattr(load, field) for name, (_, field) in _LOAD_ATTRIBUTES.items()}
    # an empty array would not fit the faces
    return {name: makers[_LOAD_ATTRIBUTES[name][0]](value) for name, value in values.items() if np.size(value)}


def _extent(points: np.ndarray, radius: float = 0.0):
    """Lowest and highest corner of a box around balls, as USD stores it; an empty array when there is nothing.

    Args:
        points: Centres [m], shape (n, 3).
        radius: Largest radius [m].
    """
    from pxr import Vt

    if len(points) == 0:
        return Vt.Vec3fArray()
    # eight rows beside each other: NumPy is slow along the first axis of three columns
    whole = len(points) // 8 * 8
    rows = [points[:whole].reshape(-1, 24)] if whole else []
    low, high = (
        np.concatenate([*(limit(r, axis=0).reshape(-1, 3) for r in rows), points[whole:]]) for limit in (np.min, np.max)
    )
    low, high = low.min(axis=0) - np.float32(radius), high.max(axis=0) + np.float32(radius)
    return Vt.Vec3fArray.FromNumpy(np.stack([low, high]))
