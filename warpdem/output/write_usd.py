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
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from warpdem.core.atomic_file import replaced
from warpdem.core.pose import Placement
from warpdem.core.snapshot import Snapshot, WallMesh
from warpdem.errors import WarpdemError
from warpdem.filling.clump_template import clump_templates
from warpdem.output import usd_clumps
from warpdem.output.pieces import remove_pieces
from warpdem.output.usd_attributes import GRAINS
from warpdem.output.usd_clips import PARTS, time_code
from warpdem.output.usd_grain_clips import GrainClips, LoadClips
from warpdem.output.usd_layers import (
    PLACEMENT_OPS,
    describe_grains,
    fixed_motions,
    frame_samples,
    root_layer,
    walls_layer,
)
from warpdem.output.usd_pieces import ROOT, UsdPieceWriter, add_pieces, parts_of, prims_of
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

SCENE = "scene.usda"


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
        if not resume:
            remove_pieces(self._folder / PARTS, "piece_*.usd*")
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
        self._clips: GrainClips | LoadClips | None = None
        self._last: Snapshot | None = None

    def write(self, snapshot: Snapshot) -> None:
        """Write one frame; when this returns the stage shows it.

        Raises:
            WarpdemError: The frame moves about another axis or in another way than before.
        """
        self._add(snapshot, None)

    def join(self, around: Snapshot, pieces: Sequence[object]) -> None:
        """As ``write``, of a frame whose grains and clumps are in pieces that ``UsdPieceWriter`` has written.

        Args:
            around: The frame, without grains, contacts and clumps.
            pieces: One for each of those writers.
        """
        self._add(around, len(pieces))

    def _add(self, snapshot: Snapshot, parts: int | None) -> None:
        """Write a frame, with all that is in the snapshot, or of which ``parts`` have grains and clumps."""
        code = time_code(snapshot, self._rate)
        if not self._started:
            self._start(snapshot, code, parts)
            self._started = True
        elif fixed_motions(snapshot.frame) != fixed_motions(self._first_frame):
            raise WarpdemError(
                f"{self._folder / ROOT}: the frame's axes or motions changed at t = {snapshot.time} s, must be fixed"
            )
        if self._clips is not None:
            self._clips.write(snapshot, code)
        for path, value in frame_samples(snapshot.frame).items():
            self._root.SetTimeSample(path, code, value)
        for wall in self._walls:
            self._write_placement(wall.name, snapshot, code)
        self._root.endTimeCode = code
        self._last = snapshot
        export(self._root, self._folder / ROOT)

    def close(self) -> None:
        """Nothing is held back: every frame is on disk when ``write`` returns."""

    def _start(self, snapshot: Snapshot, code: float, parts: int | None) -> None:
        from pxr import Sdf

        earlier = Sdf.Layer.OpenAsAnonymous(str(self._folder / ROOT)) if self._resume else None
        if earlier is not None and earlier.startTimeCode >= code:
            earlier = None
        self._first_frame = snapshot.frame
        loaded = {name: path for name, path in self._wall_paths.items() if name in snapshot.loads}
        export(walls_layer(self._walls, self._wall_paths, loaded), self._folder / PARTS / "walls.usdc")
        whole, prefix = parts is None, f"./{PARTS}/"
        self._root = root_layer(
            snapshot.frame, list(self._wall_paths.values()), self._rate, self._templates if whole else None
        )
        how = loaded, self._rate, self._frames_per_chunk
        if whole:
            self._clips = GrainClips(self._folder, self._root, prefix, self._templates, *how)
        elif loaded:
            self._clips = LoadClips(self._folder, self._root, prefix, *how)
        # only now that the stage of root_layer is gone: it would look for the sublayers beside a layer without a place
        self._root.subLayerPaths.append(f"./{PARTS}/walls.usdc")
        if self._templates:
            export(usd_clumps.prototypes_layer(self._templates), self._folder / PARTS / "clumps.usdc")
            if whole:
                self._root.subLayerPaths.append(f"./{PARTS}/clumps.usdc")
        if parts is not None:
            for part in range(parts, parts_of(earlier)):  # of ranks that are no more
                UsdPieceWriter(self._folder, part, self._scene, self._rate, resume=True).write(snapshot)
            add_pieces(self._root, max(parts, parts_of(earlier)), bool(self._templates))
        if self._scene is not None:
            self._write_scene()
        self._root.startTimeCode = code
        if earlier is not None:
            self._keep(earlier, code)

    def _write_scene(self) -> None:
        """Write the scene and put it below the results, which take the place of its grains."""
        from pxr import Sdf

        assert self._scene is not None
        tables = scene_tables(self._scene, self._kept_file)
        tables.pop("start", None)  # what it says of frame and walls is in their motions by now
        write_usd_scene(self._folder / SCENE, tables, bodies=False)
        self._root.subLayerPaths.append(f"./{SCENE}")
        Sdf.CreatePrimInLayer(self._root, _SOURCES).active = False
        groups, materials = self._scene.groups, unused_paths(_MATERIALS, list(tables["materials"]))
        for grains in prims_of(self._root, GRAINS):
            describe_grains(grains, groups, materials)
        for clumps in prims_of(self._root, usd_clumps.CLUMPS):
            usd_clumps.describe_clumps(clumps, [one.name for one in self._templates], groups, materials)

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
        self._root.startTimeCode = earlier.startTimeCode
        paths = [*frame_samples(self._first_frame)]
        paths += [f"{path}.{op}" for path in self._wall_paths.values() for op in PLACEMENT_OPS]
        for path in paths:
            for t in earlier.ListTimeSamplesForPath(path):
                if t < code:
                    self._root.SetTimeSample(path, t, earlier.QueryTimeSample(path, t))
        if self._clips is not None:
            self._clips.keep(earlier, code)

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
            self._add_placement(path, last, time_code(self._last, self._rate))
        self._add_placement(path, placement, code)

    def _add_placement(self, path: str, placement: Placement, code: float) -> None:
        from pxr import Gf

        # Gf matrices act on row vectors
        quaternion = Gf.Matrix3d(*placement.rotation.T.ravel().tolist()).ExtractRotation().GetQuat()
        translate, orient = (f"{path}.{op}" for op in PLACEMENT_OPS)
        self._root.SetTimeSample(translate, code, Gf.Vec3d(*placement.translation.tolist()))
        self._root.SetTimeSample(orient, code, quaternion)
