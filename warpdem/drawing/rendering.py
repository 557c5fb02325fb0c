"""Pictures and films of results, drawn without a screen from the files alone."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import imageio.v2 as imageio
import imageio_ffmpeg
import numpy as np
from matplotlib.colors import is_color_like

from warpdem.core.atomic_file import replaced
from warpdem.drawing.frame_drawer import FrameDrawer
from warpdem.drawing.style import CHOICES, PictureStyle
from warpdem.errors import WarpdemError
from warpdem.output.read_frames import AnyResults, frames_of

FPS = 25.0
"""Pictures in a second of a film [1/s]."""
MOST_FPS = 1000.0
"""Most pictures in a second of a film [1/s]: what players know."""
MOST_PICTURES = 1e6
"""Most pictures of a film [-]: 11 hours of them."""
SHORTEST_FILM = 2.0
"""Time that the frames of a run last as a film [s]: fewer of them follow each other more slowly."""


def render(
    folder: Path | str | Sequence[Path | str],
    out: Path | str,
    *,
    time: float | None = None,
    start: float | None = None,
    end: float | None = None,
    speed: float | None = None,
    fps: float | None = None,
    watch: Callable[[int, int], None] = lambda done, total: None,
    **style: Any,
) -> Path:
    """Draw the results in ``folder`` as a picture (``out`` ends in .png) or a film (.mp4, H.264).

    Args:
        folder: Folder that holds ``result.pvd`` or ``result.vtkhdf``; several are drawn side by side, at the times of the
            first one, with one camera and one range of colours.
        out: File to write.
        time: Time of the picture [s], the nearest frame is taken; None for the last one. Not for films.
        start: A film begins with the frame nearest to this time [s]; None for the first one. For films only, as those below.
        end: A film ends with the frame nearest to this time [s]; None for the last one.
        speed: Seconds of the run in a second of the film [-], so that 0.1 is ten times slowed down; None for each frame once.
        fps: Pictures in a second of the film [1/s]; None for 25, or fewer where frames are shown once each and so few that the
            film would last less than 2 s.
        watch: Called at the start of a film and after each of its pictures with the number done and the number of all.
        **style: Choices of ``warpdem.drawing.style.PictureStyle``: view, colour, camera, cut and so on.

    Returns:
        The file written.

    Raises:
        WarpdemError: A choice is not one of those allowed, a time lies outside the results, or a file of the results cannot
            be read.
    """
    if wrong := style.keys() - set(CHOICES):
        raise WarpdemError(f"{sorted(wrong)[0]!r} is not a choice of a picture; there are {', '.join(CHOICES)}")
    chosen = PictureStyle(**style)
    if not is_color_like(chosen.background):
        raise WarpdemError(f"background {chosen.background!r} is not a colour; give a name such as white, or #rrggbb")
    folders = [Path(folder)] if isinstance(folder, str | Path) else [Path(each) for each in folder]
    if not folders:
        raise WarpdemError("no folder of results is given")
    out = Path(out)
    suffix = out.suffix.lower()
    if suffix not in (".png", ".mp4"):
        raise WarpdemError(f"{out}: suffix {suffix!r} cannot be drawn; allowed are .png (picture) and .mp4 (film)")
    others = {"time": time} if suffix == ".mp4" else {"start": start, "end": end, "speed": speed, "fps": fps}
    if given := [name for name, value in others.items() if value is not None]:
        kind, instead = ("film", "start and end") if suffix == ".mp4" else ("picture", "time")
        raise WarpdemError(f"{given[0]} is not a choice of a {kind} ({out.name}), which has {instead}")
    runs = [frames_of(each) for each in folders]
    if suffix == ".png":
        times = [_nearest(runs[0], time)]
    else:
        _require_ffmpeg()
        chosen = replace(chosen, size=(chosen.size[0] // 2 * 2, chosen.size[1] // 2 * 2))  # as H.264's pixel format needs it
        times = _film_times(runs[0], start, end, speed, FPS if fps is None else fps)
        if fps is None:
            fps = min(FPS, len(times) / SHORTEST_FILM) if speed is None else FPS
        watch(0, len(times))
    drawer = FrameDrawer(runs, times, chosen)
    try:
        with replaced(out) as part:
            out.parent.mkdir(parents=True, exist_ok=True)
            if suffix == ".png":
                imageio.imwrite(part, drawer.draw(times[0]))
            else:
                _write_film(part, (drawer.draw(time) for time in times), fps or FPS, len(times), watch)
    finally:
        drawer.close()
    return out


def _write_film(part: Path, images: Iterable[np.ndarray], fps: float, count: int, watch: Callable[[int, int], None]) -> None:
    film = imageio.get_writer(part, fps=fps, codec="libx264", quality=8, macro_block_size=2, ffmpeg_log_level="error")
    try:
        for done, image in enumerate(images, start=1):
            film.append_data(image)
            watch(done, count)
    finally:
        film.close()


def _require_ffmpeg() -> None:
    try:
        imageio_ffmpeg.get_ffmpeg_exe()
    except RuntimeError as error:
        raise WarpdemError(f"a film needs ffmpeg and none was found: pip install imageio-ffmpeg ({error})") from error


def _nearest(results: AnyResults, time: float | None) -> float:
    """Time of the frame nearest to ``time`` [s]; the last one for None."""
    times = results.times
    if time is None:
        return float(times[-1])
    slack = _slack(times)
    if not times[0] - slack <= time <= times[-1] + slack:
        raise WarpdemError(f"time {time:g} s: the results in {results.folder} go from {times[0]:g} to {times[-1]:g} s")
    return float(times[np.argmin(np.abs(times - time))])


def _slack(times: np.ndarray) -> float:
    """How far a time may lie beyond the first and the last frame [s]: frames stand at whole steps, seldom where one asks."""
    return 0.5 * float(np.max(np.diff(times), initial=0.0)) + 1e-9 * abs(float(times[-1]))


def _film_times(results: AnyResults, start: float | None, end: float | None, speed: float | None, fps: float) -> list[float]:
    """Times of the pictures of a film [s]."""
    if not 0.0 < fps <= MOST_FPS or not (speed is None or 0.0 < speed < np.inf):
        raise WarpdemError(f"fps {fps!r} and speed {speed!r} must be finite and above 0, fps at most {MOST_FPS:g}")
    times = results.times
    begin, last = times[0] if start is None else start, times[-1] if end is None else end
    slack = _slack(times)
    if not begin <= last or begin > times[-1] + slack or last < times[0] - slack:
        raise WarpdemError(
            f"start {begin:g} s to end {last:g} s: holds no frame; the results in {results.folder} go from {times[0]:g} to "
            f"{times[-1]:g} s"
        )
    first, final = (int(np.argmin(np.abs(times - time))) for time in (begin, last))
    shown = times[first : final + 1]
    if speed is None:
        return [float(time) for time in shown]
    length = shown[-1] - shown[0]
    if (count := length * fps / speed) > MOST_PICTURES:
        raise WarpdemError(
            f"speed {speed:g}: a film of {length:.3g} s would have {count:.3g} pictures; at most {MOST_PICTURES:g} are drawn: "
            f"give a speed of {length * fps / MOST_PICTURES:.2g} or more, or a shorter piece by start and end"
        )
    wanted = np.arange(shown[0], shown[-1] + 0.5 * speed / fps, speed / fps)
    return [_nearest(results, time) for time in np.minimum(wanted, shown[-1])]
