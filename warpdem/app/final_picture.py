"""The picture that a run ends with."""

from pathlib import Path

from warpdem.scene.model import Scene


def wants_picture(scene: Scene, asked: bool | None) -> bool:
    """Whether a run of ``scene`` ends with a picture: as ``asked``, or None as the scene says; not without frames to draw."""
    return (scene.output.picture if asked is None else asked) and bool({"vtk", "vtkhdf"} & set(scene.output.formats))


def draw_picture(results: Path, folder: Path) -> None:
    """Draw the last frame of the ``results`` in a folder as picture.png in ``folder``.

    Raises:
        WarpdemError: as ``warpdem.render``.
        KeyboardInterrupt: on Ctrl-C, which says that nothing else is lost.
    """
    from warpdem.drawing.rendering import render

    try:
        render(results, folder / "picture.png")
    except KeyboardInterrupt:
        raise KeyboardInterrupt("while the picture was drawn, with all other results written") from None
