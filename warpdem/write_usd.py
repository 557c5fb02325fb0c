"""Results as USD: grains as points and walls as meshes under an Xform that carries the frame's motion.

    result.usda              small root layer: units, frame motion, wall motion, list of chunks
    result_usd/walls.usdc    wall meshes, written once
    result_usd/manifest.usda names of what the chunks hold
    result_usd/chunk_0000.usdc ...   grains and loads on walls, some frames each, joined by value clips

The load on a wall is the primvar ``pressure`` [Pa] of its triangles, and ``force`` [N], ``torque`` [N m] about the point
``torqueAbout`` [m] and ``power`` [W] of the whole, vectors in frame axes.
A time code is a fixed share of a second (a millisecond unless told otherwise). The variant set ``view`` of
``/World/Frame`` shows the motion in the laboratory (default) or in the frame's own axes. USD points are float32: these
files are for looking at results, not for starting from them.
"""

from pathlib import Path

import numpy as np

from warpdem.errors import WarpdemError
from warpdem.snapshot import (
    FramePose,
    Placement,
    RotationPart,
    SampledPart,
    Snapshot,
    TranslationPart,
    WallLoad,
    WallMesh,
)
from warpdem.write_tables import replaced

ROOT = "result.usda"

_PARTS = "result_usd"
_FRAME = "/World/Frame"
_GRAINS = "/World/Frame/Grains"
_WALLS = "/World/Frame/Walls"
_CLIPS = "default"

# the open chunk is written anew for each frame, so its size bounds the cost of a frame
_CHUNK_BYTES = 32e6
_GRAIN_BYTES = 36.0  # position, velocity, spin as float32; equal widths and ids are stored once per chunk

_GRAIN_ATTRIBUTES = {
    "points": "point3f[]",
    "widths": "float[]",
    "velocities": "vector3f[]",
    "ids": "int64[]",
    "primvars:omega": "vector3f[]",
    "extent": "float3[]",
}
_PRESSURE_BYTES = 4.0  # per triangle of a wall
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


class UsdWriter:
    """Write ``result.usda`` and the chunks it plays.

    Each chunk starts with the last frame of the one before, so that viewers interpolate across the border too.
    """

    def __init__(
        self,
        folder: Path,
        walls: list[WallMesh],
        *,
        time_codes_per_second: float = 1000.0,
        frames_per_chunk: int = 50,
        resume: bool = False,
    ):
        """Prepare the folder.

        Args:
            folder: Where the files go; made if it is missing.
            walls: The mesh walls, each in its body axes.
            time_codes_per_second: Time codes of the stage in one second [1/s].
            frames_per_chunk: Most frames in one chunk; fewer when there are many grains.
            resume: Keep the frames of an earlier run that come before the first new one.
        """
        self._folder = Path(folder)
        (self._folder / _PARTS).mkdir(parents=True, exist_ok=True)
        self._walls = walls
        self._wall_paths = _wall_paths(walls)
        self._rate = time_codes_per_second
        self._frames_per_chunk = frames_per_chunk
        self._resume = resume and (self._folder / ROOT).exists()
        self._root = None
        self._loaded: dict[str, str] = {}  # path of each wall that comes with loads
        self._chunk = None
        self._chunk_codes: list[float] = []
        self._clips: list[tuple[float, str]] = []
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
        with replaced(self._folder / ROOT) as part:
            _export(self._root, part)

    def close(self) -> None:
        """Nothing is held back: every frame is on disk when ``write`` returns."""

    def _code(self, snapshot: Snapshot) -> float:
        """Time code of a frame, without the last digits of step x dt (300, not 300.00000000000006)."""
        return round(float(snapshot.time) * self._rate, 6)

    def _start(self, snapshot: Snapshot, code: float) -> None:
        from pxr import Sdf

        parts = self._folder / _PARTS
        self._first_frame = snapshot.frame
        self._loaded = {name: path for name, path in self._wall_paths.items() if name in snapshot.loads}
        for path, layer in [
            (parts / "walls.usdc", _walls_layer(self._walls, self._wall_paths, self._loaded)),
            (parts / "manifest.usda", _chunk_layer(".usda", self._loaded)),
        ]:
            with replaced(path) as part:
                _export(layer, part)
        self._root = _root_layer(snapshot.frame, list(self._wall_paths.values()), self._rate)
        # only now that the stage of _root_layer is gone: it would look for the sublayer beside a layer without a place
        self._root.subLayerPaths.append(f"./{_PARTS}/walls.usdc")
        self._root.startTimeCode = code
        if self._resume:
            earlier = Sdf.Layer.OpenAsAnonymous(str(self._folder / ROOT))
            self._keep(earlier, code)

    def _keep(self, earlier, code: float) -> None:
        """Take over what an earlier run wrote for times before ``code``."""
        if earlier.startTimeCode >= code:
            return
        self._root.startTimeCode = earlier.startTimeCode
        paths = [*_frame_samples(self._first_frame)]
        paths += [f"{path}.{op}" for path in self._wall_paths.values() for op in _PLACEMENT_OPS]
        for path in paths:
            for t in earlier.ListTimeSamplesForPath(path):
                if t < code:
                    self._root.SetTimeSample(path, t, earlier.QueryTimeSample(path, t))
        clips = earlier.GetPrimAtPath(_GRAINS).GetInfo("clips")[_CLIPS]
        files = [asset.path for asset in clips["assetPaths"]]
        self._clips = [(t, files[int(k)]) for t, k in clips["active"] if t < code]

    def _write_sample(self, snapshot: Snapshot, code: float) -> None:
        size = _GRAIN_BYTES * len(snapshot.id)
        size += _PRESSURE_BYTES * sum(len(snapshot.loads[name].pressure) for name in self._loaded)
        room = max(2, min(self._frames_per_chunk, int(_CHUNK_BYTES / max(1.0, size))))
        if self._chunk is None or len(self._chunk_codes) >= room:
            self._chunk = _chunk_layer(".usdc", self._loaded)
            self._chunk_codes = []
            begin = code
            if self._last is not None:
                begin = self._code(self._last)
                self._add_sample(self._last, begin)
            self._clips.append((begin, f"./{_PARTS}/chunk_{len(self._clips):04d}.usdc"))
        self._add_sample(snapshot, code)
        with replaced(self._folder / self._clips[-1][1]) as part:
            _export(self._chunk, part)
        self._author_clips()

    def _add_sample(self, snapshot: Snapshot, code: float) -> None:
        from pxr import Vt

        points = np.ascontiguousarray(snapshot.position, dtype=np.float32)
        widths = (2.0 * snapshot.radius).astype(np.float32)
        samples = {
            "points": Vt.Vec3fArray.FromNumpy(points),
            "widths": Vt.FloatArray.FromNumpy(widths),
            "velocities": Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(snapshot.velocity, dtype=np.float32)),
            "ids": Vt.Int64Array.FromNumpy(np.ascontiguousarray(snapshot.id, dtype=np.int64)),
            "primvars:omega": Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(snapshot.spin, dtype=np.float32)),
            "extent": _extent(points, 0.5 * widths),
        }
        for name, value in samples.items():
            self._chunk.SetTimeSample(f"{_GRAINS}.{name}", code, value)
        for name, path in self._loaded.items():
            for attribute, value in _load_values(snapshot.loads[name]).items():
                self._chunk.SetTimeSample(f"{path}.{attribute}", code, value)
        self._chunk_codes.append(code)

    def _author_clips(self) -> None:
        from pxr import Gf, Sdf, Vt

        clips = {
            "assetPaths": Sdf.AssetPathArray([Sdf.AssetPath(file) for _, file in self._clips]),
            "active": Vt.Vec2dArray([Gf.Vec2d(code, k) for k, (code, _) in enumerate(self._clips)]),
            "manifestAssetPath": Sdf.AssetPath(f"./{_PARTS}/manifest.usda"),
        }
        for path in [_GRAINS, *([_WALLS] if self._loaded else [])]:
            self._root.GetPrimAtPath(path).SetInfo("clips", {_CLIPS: {**clips, "primPath": path}})

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


def _wall_paths(walls: list[WallMesh]) -> dict[str, str]:
    """Prim path of each wall; names that USD does not allow are changed, never to equal ones."""
    from pxr import Tf

    paths: dict[str, str] = {}
    for wall in walls:
        path = stem = f"{_WALLS}/{Tf.MakeValidIdentifier(wall.name)}"
        count = 1
        while path in paths.values():
            count += 1
            path = f"{stem}_{count}"
        paths[wall.name] = path
    return paths


def _root_layer(frame: FramePose, wall_paths: list[str], rate: float):
    """Root layer without frames: units, prims, transform ops."""
    from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics, Vt

    layer = Sdf.Layer.CreateAnonymous(".usda")
    stage = Usd.Stage.Open(layer)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdPhysics.SetStageKilogramsPerUnit(stage, 1.0)
    stage.SetTimeCodesPerSecond(rate)
    stage.SetFramesPerSecond(25.0)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    _author_frame_ops(stage, frame)
    grains = UsdGeom.Points.Define(stage, _GRAINS)
    UsdGeom.PrimvarsAPI(grains).CreatePrimvar("omega", Sdf.ValueTypeNames.Vector3fArray, UsdGeom.Tokens.vertex)
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
        mesh.CreateExtentAttr(_extent(points, np.zeros(1, dtype=np.float32)))
        mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        mesh.CreateDoubleSidedAttr(True)
        mesh.CreateDisplayColorAttr(Vt.Vec3fArray([Gf.Vec3f(*_GLASS)]))
        mesh.CreateDisplayOpacityAttr(Vt.FloatArray([0.3]))
        if wall.name in loaded:
            UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("pressure", Sdf.ValueTypeNames.FloatArray, UsdGeom.Tokens.uniform)
    return layer


def _chunk_layer(suffix: str, loaded: dict[str, str]):
    """Layer that declares what changes from frame to frame, without values: the manifest, and each chunk at its start."""
    from pxr import Sdf

    layer = Sdf.Layer.CreateAnonymous(suffix)
    grains = Sdf.CreatePrimInLayer(layer, _GRAINS)
    for name, kind in _GRAIN_ATTRIBUTES.items():
        Sdf.AttributeSpec(grains, name, Sdf.ValueTypeNames.Find(kind))
    for path in loaded.values():
        wall = Sdf.CreatePrimInLayer(layer, path)
        for name, (kind, _) in _LOAD_ATTRIBUTES.items():
            Sdf.AttributeSpec(wall, name, Sdf.ValueTypeNames.Find(kind))
    return layer


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


def _extent(points: np.ndarray, radius: np.ndarray):
    """Lowest and highest corner of balls, as USD stores it; an empty array when there is nothing."""
    from pxr import Vt

    if len(points) == 0:
        return Vt.Vec3fArray()
    low, high = (points - radius[:, None]).min(axis=0), (points + radius[:, None]).max(axis=0)
    return Vt.Vec3fArray.FromNumpy(np.stack([low, high]))


def _export(layer, path: Path) -> None:
    if not layer.Export(str(path)):
        raise WarpdemError(f"{path}: cannot be written (disk full, or no right to write there?)")
