"""What a picture shows of the results at one time: one camera and one range of colours for all times and runs."""

import itertools
import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.colors import to_rgb

from warpdem.core.pose import FramePose, RotationPart
from warpdem.core.snapshot import Snapshot, WallMesh
from warpdem.drawing.balls import Balls
from warpdem.drawing.bodies import bodies_of, body_axes, spots
from warpdem.drawing.camera import camera_of, upright, view_axes
from warpdem.drawing.chains import ChainRenderer, Chains, chains_of
from warpdem.drawing.colours import Field, Scale, field_of
from warpdem.drawing.cuts import parsed_cut
from warpdem.drawing.framing import Box, Framing
from warpdem.drawing.legend import Bar, Legend, Pane, bar_width, heading
from warpdem.drawing.ruler import ruler_of
from warpdem.drawing.style import PictureStyle
from warpdem.drawing.vtk_renderer import Surface, VtkRenderer
from warpdem.drawing.wall_nodes import at_nodes, nodes_of
from warpdem.errors import WarpdemError
from warpdem.mesh.plane_patch import MARGIN, RIM, patch, plane_of
from warpdem.output.read_frames import AnyResults

_WALL_OPACITY, _COLOURED_WALL_OPACITY = 0.16, 0.6
FARTHEST = 30.0
"""How far from the middle of the picture grains are drawn, in sizes of what it shows [-]."""
LEAST = 4.0
"""Extent of what a picture shows over the radius of its largest grain, at least [-]."""


@dataclass(frozen=True)
class _Scenery:
    """One run at one time, as the files hold it."""

    time: float
    """Time of the frame in the results [s]: over all phases, where the snapshot has that of its own phase."""
    snapshot: Snapshot
    walls: list[WallMesh]
    grain_fields: dict[str, np.ndarray]
    centre: np.ndarray
    """Centre of the body of each grain, its clump or itself, in frame axes [m], shape (n, 3)."""
    wall_fields: dict[str, dict[str, np.ndarray]]
    contacts: dict[str, np.ndarray]
    """Arrays of the contact network and its ``points``; empty unless force chains are drawn."""


@dataclass(frozen=True)
class _WallValues:
    """Values that colour a wall."""

    values: np.ndarray
    """Of the vertices or of the triangles, shape (v,) or (t,)."""
    vertices: np.ndarray
    """Corners in frame axes [m], shape (v, 3)."""
    triangles: np.ndarray
    """Corner numbers of each triangle, shape (t, 3)."""
    at_vertices: bool
    """Whether the values are those of the vertices."""


class FrameDrawer:
    """Draws one time after another: one camera, one range of colours, a pane for each run."""

    def __init__(self, runs: list[AnyResults], times: list[float], style: PictureStyle) -> None:
        self._runs, self._style = runs, style
        self._cuts = [parsed_cut(text, style.view) for text in style.cut]
        first = self._scenery(runs[0], times[0])
        folder = runs[0].folder
        self._grains = Scale(
            field_of(style.colour, first.grain_fields, "colour", f"the grains in {folder}"),
            style.colour_map,
            style.colour_range,
        )
        self._on_walls = self._wall_scale(first, folder)
        self._on_chains = Scale(Field("normal_force", "normal_force", ""), "YlOrRd", None) if style.chains else None
        start = runs[0].frame(0).frame.rotation if style.view == "frame" else np.eye(3)
        gravity = first.snapshot.gravity
        # in rotating axes a single picture is one of the film: upwards is as in the first frame of the results
        rotation = upright(None if gravity is None else start.T @ gravity)
        self._axes = view_axes(style, first.snapshot.frame, rotation)
        self._survey(times)
        width, height = style.size
        column = bar_width(height)
        edges = np.linspace(0, width - column, len(runs) + 1).astype(int)
        self._spans = list(itertools.pairwise(edges))
        pane = min(right - left for left, right in self._spans)
        if pane < 16:
            raise WarpdemError(f"size {style.size!r} is too narrow for the panes ({len(runs)}) and the scale bar")
        camera = camera_of(style, rotation, self._axes, self._low, self._high, pane / height)
        opacity = style.opacity
        if opacity is None:
            opacity = _WALL_OPACITY if self._on_walls is None else _COLOURED_WALL_OPACITY
        self._camera = camera
        self._ruler = ruler_of(camera, pane, height) if style.ruler else None
        self._legend = Legend(style.size, self._bars(), len(runs), style.background)
        self._names = _distinct_names([run.folder for run in runs])
        self._clock = _clock(runs[0].times)
        self._renderers: list[VtkRenderer] = []
        for left, right in self._spans:
            self._renderers.append(VtkRenderer((right - left, height), camera, style.background, opacity, style.shadows))
        self._chain_renderers: list[ChainRenderer] = []
        for left, right in self._spans * style.chains:
            self._chain_renderers.append(ChainRenderer((right - left, height), camera, style.background))

    def draw(self, time: float) -> np.ndarray:
        """Pixels of the picture of a time [s], shape (height, width, 3), uint8."""
        width, height = self._style.size
        image = np.empty((height, width, 3), dtype=np.uint8)
        background = np.round(255.0 * np.array(to_rgb(self._style.background)))
        image[:] = background
        panes = []
        for k, (run, renderer, (left, right), name) in enumerate(
            zip(self._runs, self._renderers, self._spans, self._names, strict=True)
        ):
            scenery = self._scenery(run, time)
            drawn = renderer.draw(self._balls(scenery), self._surfaces(scenery))
            if self._chain_renderers:
                drawn = self._chain_renderers[k].draw_over(drawn, background, self._chains(scenery))
            image[:, left:right] = drawn
            snapshot = scenery.snapshot
            axes = "laboratory axes" if self._style.view == "laboratory" else "frame axes"
            lines = f"{axes}{_rotation_line(snapshot.frame)}" if snapshot.frame.parts else ""
            title = heading(name, self._clock(scenery.time), right - left, height)
            panes.append(Pane(title, lines, self._camera.axes, self._ruler))
        return self._legend.draw(image, panes)

    def close(self) -> None:
        """Free the memory of the renderers."""
        for renderer in self._renderers:
            renderer.close()
        for chains in self._chain_renderers:
            chains.close()

    def _scenery(self, run: AnyResults, time: float) -> _Scenery:
        k = int(np.argmin(np.abs(run.times - time)))
        snapshot = run.frame(k)
        there = run.walls(k)
        if unknown := set(self._style.hide) - {wall.name for wall in there}:
            names = ", ".join(wall.name for wall in there) or "none"
            raise WarpdemError(f"hide {sorted(unknown)[0]!r}: there is no such wall in {run.folder}; there are {names}")
        walls = [wall for wall in there if wall.name not in self._style.hide]
        on_walls = {wall.name: run.fields(k, wall.name) for wall in walls} if self._style.wall_colour else {}
        bodies = bodies_of(snapshot.position, run.fields(k), run.clumps(k))
        return _Scenery(float(run.times[k]), snapshot, walls, bodies.fields, bodies.centre, on_walls, self._network(run, k))

    def _network(self, run: AnyResults, k: int) -> dict[str, np.ndarray]:
        if not self._style.chains:
            return {}
        if not run.has_contacts:
            raise WarpdemError(
                f"chains show the contacts, which {run.folder} does not hold: run the scene with output.contacts = true"
            )
        return run.contacts(k)

    def _wall_scale(self, first: _Scenery, folder: Path) -> Scale | None:
        name = self._style.wall_colour
        if name is None:
            return None
        known = {key: values for arrays in first.wall_fields.values() for key, values in arrays.items()}
        return Scale(field_of(name, known, "wall_colour", f"the walls in {folder}"), "Reds", self._style.wall_range)

    def _survey(self, times: Iterable[float]) -> None:
        """Bounds and values of all that will be drawn, so that camera and colour ranges are the same in all frames."""
        framing = Framing(np.concatenate([self._axes, np.eye(3)]))  # of the picture, and of the view for the planes
        for run in self._runs:
            start = run.frame(0)
            finite = _finite(start)
            framing.include_start(self._seen(start.position[finite], start.frame), start.radius[finite])
        planes = []
        self._moving_frame = False
        ends, any_shown, largest = [], False, 0.0
        for run, time in itertools.product(self._runs, dict.fromkeys(times)):
            scenery = self._scenery(run, time)
            snapshot = scenery.snapshot
            self._moving_frame |= bool(snapshot.frame.parts)
            planes.append((snapshot.frame, [wall for wall in scenery.walls if wall.infinite]))
            finite = _finite(snapshot)
            centres = self._seen(snapshot.position[finite], snapshot.frame)
            framing.include_grains(centres, snapshot.radius[finite])
            shown = self._shown(scenery)
            any_shown |= bool(shown.any())
            largest = max(largest, float(snapshot.radius[finite].max(initial=0.0)))
            if len(centres):
                ends += [centres.min(axis=0), centres.max(axis=0)]
            self._grains.include(self._grain_values(scenery)[shown])
            if self._on_chains is not None:
                self._on_chains.include(np.abs(scenery.contacts["normal_force"]))
            for wall in scenery.walls:
                framing.include_wall(self._seen(wall.vertices, snapshot.frame), wall.infinite)
                if self._on_walls is not None and (values := self._wall_values(scenery, wall)) is not None:
                    self._on_walls.include(values.values)
        if ends and not any_shown:
            words = (", ".join(f"{x:.4g}" for x in side) for side in (np.min(ends, axis=0), np.max(ends, axis=0)))
            raise WarpdemError(
                f"cut {' and '.join(map(repr, self._style.cut))} leaves no grain: in {self._style.view} axes their centres go "
                f"from ({next(words)}) to ({next(words)}) m"
            )
        box = framing.box()
        self._border = RIM if framing.bounded else MARGIN
        self._box = np.stack(np.meshgrid(*zip(box.low[3:], box.high[3:], strict=True), indexing="ij"), axis=-1).reshape(
            8, 3
        )
        drawn = [wall.vertices @ self._axes.T for pose, walls in planes for wall in self._fitted(pose, walls)]
        framed = Box(box.low[:3], box.high[:3])
        for along in drawn:
            extent = Box(along.min(axis=0), along.max(axis=0))
            # planes far from all equipment stay out of the picture
            framed = framed.joined(Box(box.low[:3], box.high[:3]).with_near(extent) if framing.bounded else extent)
        # a ball that fills the picture is so near to the camera that VTK does not draw it round
        border = np.maximum(0.5 * (LEAST * largest - (framed.high - framed.low)), 0.0)
        self._low, self._high = framed.low - border, framed.high + border

    def _seen(self, points: np.ndarray, pose: FramePose) -> np.ndarray:
        """Points given in frame axes, in the axes at rest in the picture [m], shape (n, 3)."""
        return pose.to_laboratory(points) if self._style.view == "laboratory" else points

    def _shown(self, scenery: _Scenery) -> np.ndarray:
        """Which grains are shown, shape (n,), bool."""
        shown = _finite(scenery.snapshot)
        for cut in self._cuts:
            normal, offset = cut.in_frame(scenery.snapshot.frame)
            shown &= scenery.centre @ normal > offset
        return np.asarray(shown)

    def _grain_values(self, scenery: _Scenery) -> np.ndarray:
        snapshot = scenery.snapshot
        return self._grains.field.values(scenery.grain_fields, snapshot.frame, scenery.centre)

    def _wall_values(self, scenery: _Scenery, wall: WallMesh) -> _WallValues | None:
        """The values that colour a wall, and where they are; None for one without them."""
        assert self._on_walls is not None
        arrays, field = scenery.wall_fields[wall.name], self._on_walls.field
        if field.array not in arrays:
            return None
        values = field.values(arrays)
        if not self._style.wall_smooth or field.array == "force":  # which is larger on larger triangles
            return _WallValues(values, wall.vertices, wall.triangles, False)
        nodes, triangles = nodes_of(wall.vertices, wall.triangles)
        return _WallValues(at_nodes(values, nodes, triangles), nodes, triangles, True)

    def _chains(self, scenery: _Scenery) -> Chains:
        """Lines of the contacts of which all grains are shown."""
        assert self._on_chains is not None
        network, snapshot = scenery.contacts, scenery.snapshot
        there = snapshot.id[self._drawn(scenery)]
        shown = np.isin(network["i"], there) & ((network["j"] < 0) | np.isin(network["j"], there))
        force = network["normal_force"][shown]
        ends = self._seen(network["points"][shown].reshape(-1, 3), snapshot.frame).reshape(-1, 2, 3)
        radius = float(np.median(snapshot.radius)) if len(force) else 0.0
        return chains_of(ends, force, self._on_chains.limits[1], radius, self._on_chains.colours(np.abs(force)))

    def _drawn(self, scenery: _Scenery) -> np.ndarray:
        """Numbers of the grains that are drawn, shape (m,)."""
        snapshot, shown = scenery.snapshot, np.flatnonzero(self._shown(scenery))
        if self._style.position is None:
            # a grain far away would be a dot, and would leave fewer digits for the depths of all others
            middle, farthest = self._box.mean(axis=0), FARTHEST * np.ptp(self._box, axis=0).max()
            position = self._seen(snapshot.position[shown], snapshot.frame)
            shown = shown[np.linalg.norm(position - middle, axis=1) < farthest]
        return np.asarray(shown)

    def _balls(self, scenery: _Scenery) -> Balls:
        snapshot, shown = scenery.snapshot, self._drawn(scenery)
        position = self._seen(snapshot.position[shown], snapshot.frame)
        balls = position, snapshot.radius[shown], self._grains.colours(self._grain_values(scenery)[shown])
        if self._style.spots:
            return Balls(*self._with_spots(scenery, shown, balls))
        return Balls(*balls)

    def _with_spots(self, scenery: _Scenery, shown: np.ndarray, balls: tuple[np.ndarray, ...]) -> tuple[np.ndarray, ...]:
        """Centres, radii and colours of the grains ``shown``, and of spots on those that are no members of clumps."""
        axes = body_axes(scenery.grain_fields, self._runs[0].folder)[shown]
        if self._style.view == "laboratory":
            axes = scenery.snapshot.frame.rotation @ axes
        alone = np.full(len(shown), True) if scenery.snapshot.clump is None else scenery.snapshot.clump[shown] < 0
        position, radius, colour = (values[alone] for values in balls)
        added = spots(position, radius, colour, axes[alone])
        return tuple(np.concatenate(both) for both in zip(balls, added, strict=True))

    def _fitted(self, pose: FramePose, walls: list[WallMesh]) -> list[WallMesh]:
        """The planes among the walls, cut to lie around what the picture shows, in the axes of the view."""
        planes = {}
        for wall in walls:
            if wall.infinite:
                normal, offset = plane_of(wall)
                if self._style.view == "laboratory":
                    normal = pose.rotation @ normal
                    offset += float(normal @ pose.translation)
                planes[wall.name] = normal, offset
        return [
            patch(name, half, [other for key, other in planes.items() if key != name], self._box, self._border)
            for name, half in planes.items()
        ]

    def _surfaces(self, scenery: _Scenery) -> list[Surface]:
        pose = scenery.snapshot.frame
        cuts = []
        for normal, offset in (cut.in_frame(pose) for cut in self._cuts):
            rotated = pose.rotation @ normal if self._style.view == "laboratory" else normal
            moved = offset + float(rotated @ pose.translation) if self._style.view == "laboratory" else offset
            cuts.append((rotated, moved))
        surfaces = [
            Surface(w.name, w.vertices, w.triangles, None, False, tuple(cuts), True) for w in self._fitted(pose, scenery.walls)
        ]
        for wall in scenery.walls:
            if wall.infinite:
                continue
            vertices, triangles, colour, at_corners = wall.vertices, wall.triangles, None, False
            if self._on_walls is not None and (of := self._wall_values(scenery, wall)) is not None:
                colour = self._on_walls.colours(of.values)
                vertices, triangles, at_corners = of.vertices, of.triangles, of.at_vertices
            surfaces.append(Surface(wall.name, self._seen(vertices, pose), triangles, colour, at_corners, tuple(cuts), False))
        return surfaces

    def _bars(self) -> list[Bar]:
        field = self._grains.field
        bars = []
        if field.array != "clump":  # whose colours only distinguish bodies
            bars.append(Bar(self._grains, field.title(self._moving_frame), _category_names(self._runs[0].folder, field)))
        if self._on_chains is not None:
            bars.append(Bar(self._on_chains, f"contact {self._on_chains.field.title(False)}"))
        if self._on_walls is not None:
            bars.append(Bar(self._on_walls, f"wall {self._on_walls.field.title(self._moving_frame)}"))
        return bars


def _finite(snapshot: Snapshot) -> np.ndarray:
    """Which grains have finite position and radius, shape (n,), bool: a run that failed may hold others."""
    return np.asarray(np.isfinite(snapshot.position).all(axis=1) & np.isfinite(snapshot.radius))


def _distinct_names(folders: list[Path]) -> list[str]:
    """Names of the runs written before the time, as short as makes them distinct; none for a single one."""
    if len(folders) == 1:
        return [""]
    names = [folder.resolve().name for folder in folders]
    return names if len(set(names)) == len(names) else [str(folder) for folder in folders]


def _clock(times: np.ndarray) -> Callable[[float], str]:
    """How a time is written: one unit, and in all frames as many digits as make their times distinct."""
    last = float(np.abs(times).max())
    unit, factor = next(((u, f) for u, f in (("s", 1.0), ("ms", 1e3), ("µs", 1e6)) if last * f >= 0.05), ("s", 1.0))
    step = float(np.median(np.diff(times))) * factor if len(times) > 1 else 1e-3 * max(last * factor, 1e-9)
    digits = int(np.clip(np.ceil(-np.log10(step) - 0.05), 0, 9)) if step > 0.0 and last > 0.0 else 0
    return lambda time: f"t = {time * factor:.{digits}f} {unit}"


def _category_names(folder: Path, field: Field) -> tuple[str, ...]:
    """Names of the categories, as far as the run's own record has them."""
    try:
        record = json.loads((folder / "run.json").read_text(encoding="utf-8"))
        if "phases" in record:
            record = json.loads((folder / record["phases"][0]["folder"] / "run.json").read_text(encoding="utf-8"))
        scene = record["scene_data"]
        if field.array == "type":
            return tuple(scene["materials"])
        if field.array == "group":  # numbered as in Scene.groups
            entries = [(key, k, group) for key in ("grains", "streams") for k, group in enumerate(scene[key])]
            names = [(group.get("name") or f"{key}[{k}]", group.get("recipe") or [{}]) for key, k, group in entries]
            return tuple(dict.fromkeys(portion.get("name") or name for name, recipe in names for portion in recipe))
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return ()  # results without a record, or with a damaged one
    return ()


def _rotation_line(frame: FramePose) -> str:
    """Line with the angles of the frame, rotation by rotation; empty if it has no rotation."""
    angles = [f"{np.degrees(part.angle):.1f}°" for part in frame.parts if isinstance(part, RotationPart)]
    return f"\nframe turned by {' and '.join(angles)}" if angles else ""
