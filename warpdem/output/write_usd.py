"""Results as USD: grains as points, clumps as instances and walls as meshes under an Xform that carries the frame's motion.

    result.usda              small root layer over the scene: units, frame motion, wall motion, lists of chunks
    scene.usda               the scene as it was run
    result_usd/walls.usdc    wall meshes, written once
    result_usd/clumps.usdc   surfaces of the clumps, if there are any, written once
    result_usd/grains.usdc   grains of the first frame that has any, for readers that ask for no time
    result_usd/chunk_0000.usdc ...   grains in single precision and loads on walls, some frames each, for viewers
    result_usd/state_0000.usdc ...   the same grains in float64, to start from
    result_usd/manifest.usda, state.usda   names of what the chunks hold

The chunks are joined by value clips. The load on a wall is the primvar ``pressure`` [Pa] of its triangles, and ``force`` [N],
``torque`` [N m] about the point ``torqueAbout`` [m] and ``power`` [W] of the whole, vectors in frame axes. A time code is a
fixed share of a second (a millisecond unless another is given). The variant set ``view`` of ``/World/Frame`` shows the motion
in the laboratory (default) or in the frame's own axes.

Each frame is a scene: ``warpdem run result.usda --at SECONDS`` takes the grains of that frame in place of those the scene
began with (``/World/Grains``, switched off in the root layer), from ``primvars:dem:positions``, ``velocities`` and ``spins``
(frame axes, relative to the frame), ``radii`` and ``types``, and its clumps (``usd_clumps``). Contacts start without
history, which only checkpoints keep.
"""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from warpdem.core.atomic_file import replaced
from warpdem.core.pose import Placement
from warpdem.core.snapshot import Snapshot, WallMesh
from warpdem.errors import WarpdemError
from warpdem.filling.clump_template import clump_templates
from warpdem.output import usd_clumps
from warpdem.output.usd_attributes import DISPLAY, GRAINS, LOAD, STATE, grain_values, load_values
from warpdem.output.usd_clips import PARTS, ValueClips, bytes_of
from warpdem.output.usd_layers import PLACEMENT_OPS, first_layer, fixed_motions, frame_samples, root_layer, walls_layer
from warpdem.scene.tables import relative_to, scene_tables
from warpdem.scene.walls import MESH_SUFFIXES
from warpdem.scene.write_usd import GRAINS as _SOURCES
from warpdem.scene.write_usd import MATERIALS as _MATERIALS
from warpdem.scene.write_usd import WALLS as _WALLS
from warpdem.scene.write_usd import export, unused_paths, write_usd_scene
from warpdem.usd.stage import USD_SUFFIXES

if TYPE_CHECKING:
    from pxr import Sdf

    from warpdem.scene.model import Scene

ROOT = "result.usda"
SCENE = "scene.usda"
_FIRST = f"./{PARTS}/grains.usdc"


class UsdWriter:
    """Write ``result.usda``, the scene below it, and the chunks it plays."""

    def __init__(
        self,
        folder: Path,
        walls: list[WallMesh],
        *,
        scene: Scene | None = None,
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
        (self._folder / PARTS).mkdir(parents=True, exist_ok=True)
        self._walls = walls
        self._scene = scene
        self._templates = list(clump_templates(scene).values()) if scene is not None else []
        self._wall_paths = dict(
            zip((w.name for w in walls), unused_paths(_WALLS, [w.name for w in walls]), strict=True)
        )
        self._rate = time_codes_per_second
        self._frames_per_chunk = frames_per_chunk
        self._resume = resume and (self._folder / ROOT).exists()
        self._root: Sdf.Layer  # made with the first frame
        self._started = False
        self._loaded: dict[str, str] = {}  # path of each wall that comes with loads
        self._sets: list[ValueClips] = []
        self._widths: tuple[np.ndarray, Any] | None = (
            None  # radii, and the widths made of them: equal arrays are stored once
        )
        self._last: Snapshot | None = None

    def write(self, snapshot: Snapshot) -> None:
        """Write one frame; when this returns the stage shows it.

        Raises:
            WarpdemError: The frame moves about another axis or in another way than before.
        """
        code = self._code(snapshot)
        if not self._started:
            self._start(snapshot, code)
            self._started = True
        elif fixed_motions(snapshot.frame) != fixed_motions(self._first_frame):
            raise WarpdemError(
                f"{self._folder / ROOT}: the frame's axes or motions changed at t = {snapshot.time} s, must be fixed"
            )
        self._write_sample(snapshot, code)
        for path, value in frame_samples(snapshot.frame).items():
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
        export(walls_layer(self._walls, self._wall_paths, self._loaded), self._folder / PARTS / "walls.usdc")
        shown = {f"{GRAINS}.{one.name}": one.kind for one in DISPLAY}
        shown |= {f"{path}.{one.name}": one.kind for path in self._loaded.values() for one in LOAD}
        state = {f"{GRAINS}.{one.name}": one.kind for one in STATE}
        if self._templates:
            shown |= usd_clumps.types(usd_clumps.DISPLAY)
            state |= usd_clumps.types(usd_clumps.STATE)
        many = self._frames_per_chunk
        self._sets = [
            ValueClips(self._folder, "default", "chunk", shown, self._rate, many, overlap=True),
            ValueClips(self._folder, "state", "state", state, self._rate, many, overlap=False),
        ]
        self._root = root_layer(snapshot.frame, list(self._wall_paths.values()), self._rate, self._templates)
        # only now that the stage of root_layer is gone: it would look for the sublayers beside a layer without a place
        self._root.subLayerPaths.append(f"./{PARTS}/walls.usdc")
        if self._templates:
            export(usd_clumps.prototypes_layer(self._templates), self._folder / PARTS / "clumps.usdc")
            self._root.subLayerPaths.append(f"./{PARTS}/clumps.usdc")
        if self._scene is not None:
            self._write_scene()
        self._root.startTimeCode = code
        if self._resume:
            earlier = Sdf.Layer.OpenAsAnonymous(str(self._folder / ROOT))
            self._keep(earlier, code)

    def _write_scene(self) -> None:
        """Write the scene and put it below the results, which take the place of its grains."""
        from pxr import Sdf, Vt

        assert self._scene is not None
        tables = scene_tables(self._scene, self._kept_file)
        tables.pop("start", None)  # what it says of frame and walls is in their motions by now
        write_usd_scene(self._folder / SCENE, tables, bodies=False)
        self._root.subLayerPaths.append(f"./{SCENE}")
        Sdf.CreatePrimInLayer(self._root, _SOURCES).active = False
        grains = self._root.GetPrimAtPath(GRAINS)
        schemas = Sdf.TokenListOp.Create(prependedItems=["PhysicsCollisionAPI"])
        grains.SetInfo("apiSchemas", schemas)
        groups = Sdf.AttributeSpec(grains, "dem:groups", Sdf.ValueTypeNames.StringArray, Sdf.VariabilityUniform)
        groups.default = Vt.StringArray(self._scene.groups)
        of = Sdf.RelationshipSpec(grains, "dem:materials", custom=True)
        materials = unused_paths(_MATERIALS, list(tables["materials"]))
        for path in materials:
            of.targetPathList.explicitItems.append(path)
        if self._templates:
            usd_clumps.describe_clumps(self._root, [one.name for one in self._templates], self._scene.groups, materials)

    def _kept_file(self, file: Path) -> str:
        """Name of a file of the scene: a mesh is copied beside the results, so that they can be moved and shared."""
        if file.suffix.lower() not in MESH_SUFFIXES or file.suffix.lower() in USD_SUFFIXES:
            return relative_to(self._folder)(file)
        kept, count = self._folder / PARTS / file.name, 1
        while kept.exists() and kept.read_bytes() != file.read_bytes():
            count += 1
            kept = kept.with_name(f"{file.stem}_{count}{file.suffix}")
        if not kept.exists():
            with replaced(kept) as part:
                shutil.copyfile(file, part)
        return relative_to(self._folder)(kept)

    def _keep(self, earlier: Sdf.Layer, code: float) -> None:
        """Take over what an earlier run wrote for times before ``code``."""
        if earlier.startTimeCode >= code:
            return
        if _FIRST in earlier.subLayerPaths:
            self._root.subLayerPaths.append(_FIRST)
        self._root.startTimeCode = earlier.startTimeCode
        paths = [*frame_samples(self._first_frame)]
        paths += [f"{path}.{op}" for path in self._wall_paths.values() for op in PLACEMENT_OPS]
        for path in paths:
            for t in earlier.ListTimeSamplesForPath(path):
                if t < code:
                    self._root.SetTimeSample(path, t, earlier.QueryTimeSample(path, t))
        played = earlier.GetPrimAtPath(GRAINS).GetInfo("clips")
        for clips in self._sets:
            files = [asset.path for asset in played[clips.name]["assetPaths"]]
            clips.clips = [(t, files[int(k)]) for t, k in played[clips.name]["active"] if t < code]

    def _write_sample(self, snapshot: Snapshot, code: float) -> None:
        shown, state = self._samples(snapshot)
        if len(snapshot.id) and _FIRST not in self._root.subLayerPaths:
            export(first_layer(shown), self._folder / _FIRST)
            # a layer below that of the clips, which values of no time beside them would hide
            self._root.subLayerPaths.append(_FIRST)
        for clips, samples in zip(self._sets, (shown, state), strict=True):
            clips.add(code, samples, sum(bytes_of(value) for value in samples.values()))
        self._root.GetPrimAtPath(GRAINS).SetInfo("clips", {clips.name: clips.described(GRAINS) for clips in self._sets})
        if self._templates:
            described = {clips.name: clips.described(usd_clumps.CLUMPS) for clips in self._sets}
            self._root.GetPrimAtPath(usd_clumps.CLUMPS).SetInfo("clips", described)
        if self._loaded:
            self._root.GetPrimAtPath(_WALLS).SetInfo("clips", {"default": self._sets[0].described(_WALLS)})

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
        for name, path in self._loaded.items():
            samples |= load_values(path, snapshot.loads[name])
        return samples

    def _write_placement(self, name: str, snapshot: Snapshot, code: float) -> None:
        """Add a sample when the wall has moved, and one that held it in place until the frame before."""
        path = self._wall_paths[name]
        placement = snapshot.walls[name]
        last = None if self._last is None else self._last.walls[name]
        if last is not None and self._last is not None:
            if np.array_equal(last.rotation, placement.rotation) and np.array_equal(
                last.translation, placement.translation
            ):
                return
            self._add_placement(path, last, self._code(self._last))
        self._add_placement(path, placement, code)

    def _add_placement(self, path: str, placement: Placement, code: float) -> None:
        from pxr import Gf

        # Gf matrices act on row vectors
        quaternion = Gf.Matrix3d(*placement.rotation.T.ravel().tolist()).ExtractRotation().GetQuat()
        translate, orient = (f"{path}.{op}" for op in PLACEMENT_OPS)
        self._root.SetTimeSample(translate, code, Gf.Vec3d(*placement.translation.tolist()))
        self._root.SetTimeSample(orient, code, quaternion)
