"""The walls beside the region of a stream at any time."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from warpdem.errors import SceneError
from warpdem.filling.fill_region import closed_region, sample_points
from warpdem.filling.fill_space import body_test
from warpdem.filling.placed_walls import PlacedWall, WallPose, assign_sides, place_walls, smallest_gap
from warpdem.filling.stream_place import StreamPlace
from warpdem.filling.stream_portions import extremes_of, portions_of
from warpdem.mesh.triangle_mesh import TriangleMesh
from warpdem.scene.model import Scene
from warpdem.scene.regions import Box
from warpdem.scene.streams import Stream

SAMPLES = 4000  # points of a region at which is tested whether walls leave it free
TIMES = 24  # times at which that is tested where walls move
BLOCKED = 0.01  # fraction of a region taken by walls [-] above which a note is given


class InletWalls:
    """The walls beside the region of a stream at any time that its grains touch.

    Args:
        number: Number of the stream.
        scene: Validated scene.
        meshes: Mesh walls by name.
        place: Where its region is.
        poses: Poses of the bodies of all walls at a time [s], by the walls' numbers.
        moves: Which walls move in the frame, by their numbers.

    Attributes:
        notes: what is to be known of the walls, for people.

    Raises:
        SceneError: They never leave space for a grain; names them.
    """

    def __init__(
        self,
        number: int,
        scene: Scene,
        meshes: dict[str, TriangleMesh],
        place: StreamPlace,
        poses: Callable[[float], list[WallPose]],
        moves: Sequence[bool],
    ) -> None:
        stream = scene.streams[number]
        self._scene, self._meshes, self._poses, self._place = scene, meshes, poses, place
        bodies = portions_of(scene, stream)
        names, material = list(scene.materials), [portion.material for portion in stream.portions]
        self._met = [
            {wall.name for k, wall in enumerate(scene.walls) if scene.touched(np.array([names.index(kind)]), k)[0]}
            for kind in material
        ]
        smallest, largest = (0.5 * diameter for diameter in extremes_of(bodies))
        self._reach = largest
        self.notes: list[str] = []
        # the sides are decided when the first grains are inserted
        walls = [wall for wall in place_walls(scene, meshes, poses(stream.start)) if any(wall.name in met for met in self._met)]
        moving = {wall.name for wall, goes in zip(scene.walls, moves, strict=True) if goes}
        # in a rotating frame gravity has no fixed direction, by which a cup is recognized
        up = -np.asarray(scene.gravity, float) if scene.frame is None else np.zeros(3)
        key = f"streams[{number}].{stream.shape_key}"
        shape, here = place.shape, place.at(stream.start)
        # of a box, points that do not change by the size of its grains
        points = sample_points(closed_region(None, shape.bounds, key), SAMPLES) if isinstance(shape, Box) else None
        centers = place.samples(smallest, SAMPLES) if points is None else _shrunk(points, shape.bounds, smallest)
        if not len(centers):
            raise SceneError(
                f"{scene.source}: {key}: nowhere does a grain of {2.0 * smallest:.4g} m in diameter fit in it: make it larger"
            )
        sides = here.in_frame(centers if points is None else points)
        sided, self._vessels = assign_sides(walls, sides, is_body=body_test(scene, up))
        self._still = [w for w in sided if w.name not in moving and (place.moves or w.is_near(here.bounds, largest))]
        self._moving = {wall.name: wall.side for wall in sided if wall.name in moving}
        self._check(key, stream, centers, min(one.narrowest for one in bodies))

    def _check(self, key: str, stream: Stream, centers: np.ndarray, radius: float) -> None:
        """Refuse a region that is never free, note what walls leave of it; of a stream that comes after the end, neither."""
        if stream.start >= self._scene.time.end:
            return
        changes = bool(self._moving) or self._place.moves
        end = min(self._scene.time.end, stream.until or np.inf)
        times = np.linspace(stream.start, max(stream.start, end), TIMES) if changes else [stream.start]
        fractions: list[float] = []
        blame: dict[str, float] = {}
        for time in times:
            walls, there = self.at(time), self._place.at(time).in_frame(centers)
            of_portions = [self.met(walls, k) for k in range(len(stream.portions))]
            gaps = [smallest_gap(met, there, radius) for met in of_portions if met]
            fractions.append(min((float((gap >= 0.0).mean()) for gap in gaps), default=1.0))
            for wall in walls:
                taken = float((wall.gap(there, radius) < 0.0).mean())
                blame[wall.name] = max(taken, blame.get(wall.name, 0.0))
        named = ", ".join(repr(name) for name, taken in sorted(blame.items(), key=lambda item: -item[1]) if taken > 0.0)
        if max(fractions) == 0.0:
            when = "at no time of the run" if changes else "nowhere"
            raise SceneError(
                f"{self._scene.source}: {key}: {when} is there space in it for a grain of {2.0 * radius:.4g} m in diameter "
                f"clear of the wall {named}: move the box off it, or make it larger"
            )
        if min(fractions) < 1.0 - BLOCKED:
            fraction = f"{min(fractions):.0%} to {max(fractions):.0%}" if len(fractions) > 1 else f"{fractions[0]:.0%}"
            self.notes.append(
                f"{key}: the wall {named} leaves {fraction} of it: grains are inserted where it leaves space for them"
            )
        if self._vessels:
            vessels = ", ".join(map(repr, dict.fromkeys(self._vessels)))
            self.notes.append(f"{key}: is within the closed mesh {vessels}: its grains are inserted and stay inside")

    def at(self, time: float) -> list[PlacedWall]:
        """The walls that may touch a grain in the region at ``time`` [s]."""
        if not self._moving and not self._place.moves:
            return self._still
        box, now, still = self._place.at(time).bounds, [], self._still
        if self._moving:
            walls = {wall.name: wall for wall in place_walls(self._scene, self._meshes, self._poses(time))}
            now = [replace(walls[name], side=side) for name, side in self._moving.items()]
        if self._place.moves:
            still = [wall for wall in still if wall.is_near(box, self._reach)]
        return [*still, *(wall for wall in now if wall.is_near(box, self._reach))]

    def met(self, walls: list[PlacedWall], portion: int) -> list[PlacedWall]:
        """Those of ``walls`` that grains of a portion do not pass through."""
        return [wall for wall in walls if wall.name in self._met[portion]]


def _shrunk(points: np.ndarray, box: np.ndarray, radius: float) -> np.ndarray:
    """Points (n, 3) [m] of a box (2, 3) [m] drawn towards its middle, so that grains of this radius [m] there are within it."""
    middle, half = box.mean(axis=0), 0.5 * np.ptp(box, axis=0)
    return np.asarray(middle + (points - middle) * (1.0 - radius / half))
