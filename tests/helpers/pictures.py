"""Results of a few grains, and what their pictures show by their pixels."""

import imageio.v2 as imageio
import numpy as np

from warpdem.core.pose import FramePose, Placement
from warpdem.core.snapshot import Snapshot, WallMesh
from warpdem.drawing.legend import bar_width
from warpdem.drawing.rendering import render
from warpdem.output.write_vtk import VtkWriter

SIZE = (400, 400)
HEIGHT = 1.0  # [m] shown by the parallel camera, so 400 pixels per metre
FRONT = {"position": (0.0, -5.0, 0.0), "focus": (0.0, 0.0, 0.0), "height": HEIGHT}
PANE = SIZE[0] - bar_width(SIZE[1])  # pixels beside the scale bar
SCALE = SIZE[1] / HEIGHT
BOX = WallMesh(
    "box",
    0.3 * np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)]),
    np.array(
        [
            *([0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]),
            *([2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]),
        ],
        dtype=np.int32,
    ),
)


def snapshot(position, radius, *, time=0.0, angle=0.0):
    position = np.array(position, dtype=float).reshape(-1, 3)
    count = len(position)
    return Snapshot(
        step=0,
        time=time,
        frame=FramePose.rotated(np.array([0.0, 1.0, 0.0]), np.zeros(3), angle, 1.0),
        id=np.arange(count),
        type=np.arange(count, dtype=np.int32) % 2,
        group=np.arange(count, dtype=np.int32) % 2,
        radius=np.full(count, radius),
        mass=np.ones(count),
        position=position,
        velocity=np.full((count, 3), 0.1),
        spin=np.zeros((count, 3)),
        force=np.zeros((count, 3)),
        walls={"box": Placement(np.eye(3), np.zeros(3))},
    )


def write(folder, *snapshots, walls=()):
    writer = VtkWriter(folder, list(walls))
    for item in snapshots:
        writer.write(item)
    return folder


def coloured(image):
    """Pixels of grains: walls and text are grey; the scale bar at the right and the axes in the corner are left out."""
    pixels = image[:, : image.shape[1] - bar_width(image.shape[0]), :3].astype(int)
    mask = pixels.max(axis=2) - pixels.min(axis=2) > 40
    mask[-60:, :60] = False
    return mask


def middle(mask):
    """Middle of the marked pixels from the middle of a picture of SIZE, to the right and up [m]."""
    row, column = np.nonzero(mask)
    return np.array([column.mean() + 0.5 - 0.5 * PANE, 0.5 * SIZE[1] - row.mean() - 0.5]) / SCALE


def draw(folder, out, **options):
    return imageio.imread(render(folder, out, **{"size": SIZE, **options}))
