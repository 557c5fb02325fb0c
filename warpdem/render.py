"""Pictures and movies of results, drawn without a screen from the files alone (``result.pvd`` and what it names)."""

import ctypes.util
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

import imageio.v2 as imageio
import numpy as np
import pyvista as pv
from vtkmodules.vtkFiltersHybrid import vtkPolyDataSilhouette
from vtkmodules.vtkRenderingOpenGL2 import vtkOpenGLSphereMapper

from warpdem.errors import WarpdemError
from warpdem.snapshot import FramePose, RotationPart, Snapshot, WallMesh
from warpdem.write_tables import replaced
from warpdem.write_vtk import Results, quiet_vtk, read_results

View = Literal["frame", "laboratory"]

_VIEW_ANGLE = 20.0  # [degree]: a long lens, so that walls along the line of sight hardly spread
_MARGIN = 1.12
_SHARP_ANGLE = 35.0  # [degree] between two faces, above which their edge is drawn
_INK = "#2b2f33"
_WALL = "#9db4c8"
_CATEGORIES = "#1f77b4 #ff7f0e #2ca02c #d62728 #9467bd #8c564b #e377c2 #7f7f7f #bcbd22 #17becf".split()


@dataclass(frozen=True)
class Camera:
    """Where the picture is taken from."""

    position: tuple[float, float, float]
    """Place of the camera [m]."""
    focus: tuple[float, float, float]
    """Point in the middle of the picture [m]."""
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)
    """Direction that points upwards in the picture [-]."""
    height: float | None = None
    """Height of the picture in a parallel projection [m]; None for a perspective one."""


@dataclass(frozen=True)
class _Colour:
    """A quantity that grains can be coloured by."""

    title: str
    values: Callable[[Snapshot], np.ndarray]
    is_category: bool = False
    from_zero: bool = False


_COLOURS = {
    "speed": _Colour("speed in the frame\n[m/s]", lambda s: np.linalg.norm(s.velocity, axis=1), from_zero=True),
    "spin": _Colour("spin in the frame\n[rad/s]", lambda s: np.linalg.norm(s.spin, axis=1), from_zero=True),
    "force": _Colour("contact force\n[N]", lambda s: np.linalg.norm(s.force, axis=1), from_zero=True),
    "radius": _Colour("radius [m]", lambda s: s.radius),
    "mass": _Colour("mass [kg]", lambda s: s.mass),
    "id": _Colour("grain id", lambda s: s.id),
    "type": _Colour("material", lambda s: s.type, is_category=True),
}


def render(
    folder: Path,
    out: Path,
    *,
    view: View = "frame",
    colour: str = "speed",
    time: float | None = None,
    size: tuple[int, int] = (1280, 960),
    camera: Camera | None = None,
    fps: float = 25.0,
) -> Path:
    """Draw the results in ``folder`` as a picture (``out`` ends in .png) or a movie (.mp4).

    Args:
        folder: Folder that holds ``result.pvd``.
        out: File to write.
        view: Axes that stand still in the picture.
        colour: Quantity that colours the grains: speed, spin, force, radius, mass, id or type.
        time: Time of the picture [s], the nearest frame is taken; None for the last one. Not used for movies.
        size: Width and height in pixels.
        camera: Camera; None for one that looks along the frame's axis and sees everything.
        fps: Frames per second of the movie [1/s]. Not used for pictures.

    Returns:
        The file written.

    Raises:
        WarpdemError: The suffix, view or colour is not one of those allowed, or a file of the results cannot be read.
    """
    suffix = Path(out).suffix.lower()
    if suffix == ".png":
        return render_picture(folder, out, view=view, colour=colour, time=time, size=size, camera=camera)
    if suffix == ".mp4":
        return render_movie(folder, out, view=view, colour=colour, size=size, camera=camera, fps=fps)
    raise WarpdemError(f"{out}: suffix {suffix!r} cannot be drawn; allowed are .png (picture) and .mp4 (movie)")


def render_picture(
    folder: Path,
    out: Path,
    *,
    view: View = "frame",
    colour: str = "speed",
    time: float | None = None,
    size: tuple[int, int] = (1280, 960),
    camera: Camera | None = None,
) -> Path:
    """Draw one frame as a PNG; arguments and errors as in ``render``."""
    _check_choices(view, colour)
    results = read_results(folder)
    k = len(results.times) - 1 if time is None else int(np.argmin(np.abs(results.times - time)))
    survey = _survey(results, [k], view, colour)
    stage = _Stage(survey, view, colour, size, camera)
    try:
        image = stage.draw(results.frame(k), results.walls(k))
    finally:
        stage.close()
    return _save(out, lambda part: imageio.imwrite(part, image))


def render_movie(
    folder: Path,
    out: Path,
    *,
    view: View = "frame",
    colour: str = "speed",
    size: tuple[int, int] = (1280, 960),
    camera: Camera | None = None,
    fps: float = 25.0,
) -> Path:
    """Draw all frames as an MP4 (H.264), camera and colours fixed; arguments and errors as in ``render``."""
    _check_choices(view, colour)
    results = read_results(folder)
    frames = range(len(results.times))
    survey = _survey(results, frames, view, colour)
    even = (size[0] // 2 * 2, size[1] // 2 * 2)  # the usual pixel format halves the colour resolution

    def write(part: Path) -> None:
        stage = _Stage(survey, view, colour, even, camera)
        movie = imageio.get_writer(part, fps=fps, codec="libx264", quality=8, macro_block_size=2)
        try:
            for k in frames:
                movie.append_data(stage.draw(results.frame(k), results.walls(k)))
        finally:
            movie.close()
            stage.close()

    return _save(out, write)


@dataclass(frozen=True)
class _Survey:
    """What camera and colours must hold for all frames drawn."""

    axes: np.ndarray
    """Right, up and forward direction of the picture as rows, shape (3, 3)."""
    low: np.ndarray
    """Least coordinates of anything along ``axes`` [m], shape (3,)."""
    high: np.ndarray
    """Greatest coordinates [m], shape (3,)."""
    colour_range: tuple[float, float]


class _Stage:
    """One plotter that draws frame after frame."""

    def __init__(self, survey: _Survey, view: View, colour: str, size: tuple[int, int], camera: Camera | None):
        self._view: View = view
        self._colour = _COLOURS[colour]
        self._plotter = _open_plotter(size)
        self._balls = _ball_mapper(self._colour, survey.colour_range)
        actor = pv.Actor()
        actor.SetMapper(self._balls)
        light = actor.GetProperty()
        light.SetAmbient(0.25)
        light.SetDiffuse(0.8)
        light.SetSpecular(0.15)
        light.SetSpecularPower(20.0)
        self._plotter.add_actor(actor, reset_camera=False, render=False)
        self._plotter.add_scalar_bar(
            title=f"{self._colour.title}\n",  # the empty line keeps it off the top label
            mapper=self._balls,
            n_labels=0 if self._colour.is_category else 5,
            fmt="%.3g",
            color=_INK,
            vertical=True,
            position_x=0.89,
            position_y=0.2,
            width=0.06,
            height=0.6,
            title_font_size=max(10, size[1] // 55),
            label_font_size=max(9, size[1] // 60),
            unconstrained_font_size=True,
            render=False,
        )
        _place_camera(self._plotter, camera or _fitting_camera(survey, size))
        self._wall_vertices: dict[str, np.ndarray] = {}
        self._font = max(6, size[1] // 80)

    def draw(self, snapshot: Snapshot, walls: list[WallMesh]) -> np.ndarray:
        """Pixels of one frame, shape (height, width, 3), uint8."""
        # vtkOpenGLSphereMapper reads single precision only, it crashes on double
        grains = pv.PolyData(_seen(snapshot.position, snapshot.frame, self._view).astype(np.float32))
        grains.point_data["radius"] = snapshot.radius.astype(np.float32)
        grains.point_data["colour"] = self._colour.values(snapshot).astype(np.float64)
        self._balls.SetInputData(grains)
        for wall in walls:
            self._draw_wall(wall, snapshot.frame)
        axes = "laboratory axes" if self._view == "laboratory" else "frame axes"
        label = f"t = {snapshot.time:.4g} s\n{axes}{_turned(snapshot.frame)}"
        self._plotter.add_text(
            label,
            position=(0.015, 0.925),
            viewport=True,
            font_size=self._font,
            color=_INK,
            name="label",
            render=False,
        )
        self._plotter.render()  # screenshot alone would give the pixels of the frame before
        return self._plotter.screenshot(return_img=True)

    def close(self) -> None:
        self._plotter.close()

    def _draw_wall(self, wall: WallMesh, frame: FramePose) -> None:
        """See-through surface with its outline and sharp edges as lines."""
        vertices = _seen(wall.vertices, frame, self._view)
        if np.array_equal(self._wall_vertices.get(wall.name), vertices):
            return
        self._wall_vertices[wall.name] = vertices
        # meshes from STL may hold each corner once per triangle; edges are found only where triangles share corners
        mesh = pv.PolyData.from_regular_faces(vertices, wall.triangles).clean()
        outline = vtkPolyDataSilhouette()
        outline.SetInputData(mesh)
        outline.SetCamera(self._plotter.camera)
        outline.SetEnableFeatureAngle(True)
        outline.SetFeatureAngle(_SHARP_ANGLE)
        outline.BorderEdgesOn()
        outline.Update()
        style = {"reset_camera": False, "render": False}
        self._plotter.add_mesh(
            mesh, color=_WALL, opacity=0.16, lighting=False, name=f"wall {wall.name}", show_scalar_bar=False, **style
        )
        lines = pv.wrap(outline.GetOutput())
        self._plotter.remove_actor(f"outline {wall.name}", **style)
        if lines.n_points:
            self._plotter.add_mesh(lines, color=_INK, opacity=0.8, line_width=3.0, name=f"outline {wall.name}", **style)


def _check_choices(view: str, colour: str) -> None:
    if view not in get_args(View):
        raise WarpdemError(f"view {view!r} is unknown; allowed are {', '.join(get_args(View))}")
    if colour not in _COLOURS:
        raise WarpdemError(f"colour {colour!r} is unknown; allowed are {', '.join(_COLOURS)}")


def _seen(points: np.ndarray, frame: FramePose, view: View) -> np.ndarray:
    """Points given in frame axes, in the axes that stand still in the picture [m], shape (n, 3)."""
    return frame.to_laboratory(points) if view == "laboratory" else points


def _survey(results: Results, frames: Iterable[int], view: View, colour: str) -> _Survey:
    """Bounds and colour range of all frames drawn: nothing leaves the picture, colours keep their meaning."""
    axes = _picture_axes(results.frame(0).frame)
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    least, greatest = np.inf, -np.inf
    for k in frames:
        snapshot = results.frame(k)
        bodies = [(snapshot.position, snapshot.radius[:, None])]
        bodies += [(wall.vertices, np.zeros((1, 1))) for wall in results.walls(k)]
        for points, radius in bodies:
            if len(points):
                along = _seen(points, snapshot.frame, view) @ axes.T
                low = np.minimum(low, (along - radius).min(axis=0))
                high = np.maximum(high, (along + radius).max(axis=0))
        values = _COLOURS[colour].values(snapshot)
        if len(values):
            least = min(least, float(values.min()))
            # a few grains in free fall must not leave one colour for all others
            greatest = max(greatest, float(np.percentile(values, 99.5)))
    if not np.all(np.isfinite([low, high])):
        low, high = -np.ones(3), np.ones(3)
    return _Survey(axes, low, high, _colour_range(colour, least, greatest))


def _colour_range(colour: str, least: float, greatest: float) -> tuple[float, float]:
    if not np.isfinite(least):
        return (0.0, 1.0)
    if _COLOURS[colour].is_category:
        return (-0.5, greatest + 0.5)
    if _COLOURS[colour].from_zero and greatest > 0.0:
        # two digits, rounded up, so that the labels are short
        unit = 10.0 ** (np.floor(np.log10(greatest)) - 1.0)
        return (0.0, float(np.ceil(greatest / unit) * unit))
    return (least, greatest) if greatest > least else (least, least + (abs(least) or 1.0))


def _turned(frame: FramePose) -> str:
    """Words on how far the frame has turned, rotation by rotation; empty if it never turns about an axis of its own."""
    angles = [f"{np.degrees(part.angle):.1f}°" for part in frame.parts if isinstance(part, RotationPart)]
    return f", frame turned by {' and '.join(angles)}" if angles else ""


def _picture_axes(frame: FramePose) -> np.ndarray:
    """Right, up and forward direction as rows, shape (3, 3): forward along the frame's first axis, z up in the picture."""
    up = np.array([0.0, 0.0, 1.0])
    axis = next((part.axis for part in frame.parts if isinstance(part, RotationPart)), up)
    # a frame that turns about the vertical is seen from the side
    forward = np.array([0.0, 1.0, 0.0]) if abs(axis @ up) > 0.9 else axis
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(right, forward), forward])


def _fitting_camera(survey: _Survey, size: tuple[int, int]) -> Camera:
    """Camera that sees everything surveyed, with room at the edges."""
    centre, half = 0.5 * (survey.low + survey.high), 0.5 * _MARGIN * (survey.high - survey.low)
    aspect = size[0] / size[1]
    # the nearest face of the box decides; the scale bar takes a tenth of the width at the right
    spread = max(half[1], half[0] / (0.86 * aspect))
    distance = spread / np.tan(np.radians(0.5 * _VIEW_ANGLE)) + half[2]
    _, up, forward = survey.axes
    focus = survey.axes.T @ centre
    return Camera(tuple(focus - distance * forward), tuple(focus), tuple(up))


def _place_camera(plotter: pv.Plotter, camera: Camera) -> None:
    view = plotter.camera
    view.position, view.focal_point, view.up = camera.position, camera.focus, camera.up
    view.view_angle = _VIEW_ANGLE
    if camera.height is not None:
        view.enable_parallel_projection()
        view.parallel_scale = 0.5 * camera.height


def _ball_mapper(colour: _Colour, colour_range: tuple[float, float]) -> vtkOpenGLSphereMapper:
    """Mapper that draws true balls (ray cast per pixel, right depth and light) at the cost of points."""
    if colour.is_category:
        count = round(colour_range[1] - colour_range[0])
        table = pv.LookupTable([_CATEGORIES[k % len(_CATEGORIES)] for k in range(count)], n_values=count)
        table.annotations = {float(k): str(k) for k in range(count)}
    else:
        table = pv.LookupTable("viridis", n_values=256)
    table.scalar_range = colour_range
    balls = vtkOpenGLSphereMapper()
    balls.SetScaleArray("radius")
    balls.SetScalarModeToUsePointFieldData()
    balls.SelectColorArray("colour")
    balls.SetLookupTable(table)
    balls.UseLookupTableScalarRangeOn()
    return balls


def _open_plotter(size: tuple[int, int]) -> pv.Plotter:
    """Plotter without a screen.

    Raises:
        WarpdemError: The machine has no OpenGL library at all, where VTK would crash.
    """
    with quiet_vtk():  # it tells at length that there is no screen before it takes the way without one
        plotter = pv.Plotter(off_screen=True, window_size=list(size))
        if plotter.render_window.GetClassName() == "vtkOSOpenGLRenderWindow" and not ctypes.util.find_library("OSMesa"):
            plotter.close()
            raise WarpdemError(
                "pictures need an OpenGL library and none was found; on Debian or Ubuntu: apt install libegl1"
            )
        plotter.set_background("white")
        plotter.enable_anti_aliasing("ssaa")
        return plotter


def _save(out: Path, write: Callable[[Path], None]) -> Path:
    out = Path(out)
    out.parent.mkdir(parents=True, exist_ok=True)
    with replaced(out) as part:
        write(part)
    return out
