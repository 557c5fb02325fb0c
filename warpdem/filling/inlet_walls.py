"""The walls beside the box of a stream at any time."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from warpdem.errors import SceneError
from warpdem.filling.fill_region import closed_region, sample_points
from warpdem.filling.fill_space import body_test
from warpdem.filling.placed_walls import PlacedWall, WallPose, assign_sides, place_walls, smallest_gap
from warpdem.mesh.triangle_mesh import TriangleMesh
from warpdem.scene.grains import Stream
from warpdem.scene.model import Scene
from warpdem.scene.size_distribution import size_law

SAMPLES = 4000  # points of a box at which is tested whether walls leave it free
TIMES = 24  # times at which that is tested where walls move
BLOCKED = 0.01  # share of a box taken by walls [-] above which a note is given


class InletWalls:
    """The walls beside the box of a stream at any time.

    Args:
        number: Number of the stream.
        scene: Validated scene.
        meshes: Mesh walls by name.
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
        poses: Callable[[float], list[WallPose]],
        moves: Sequence[bool],
    ) -> None:
        stream = scene.streams[number]
        self._scene, self._meshes, self._poses = scene, meshes, poses
        low, high = np.array(stream.box.min), np.array(stream.box.max)
        self._box, law = np.array([low, high]), size_law(stream.diameter)
        smallest, largest = (0.5 * diameter for diameter in law.extremes)
        self._reach = largest
        self.notes: list[str] = []
        walls = place_walls(
            scene, meshes, poses(stream.start)
        )  # the sides are decided when the first grains are inserted
        moving = {wall.name for wall, goes in zip(scene.walls, moves, strict=True) if goes}
        # in a rotating frame gravity has no fixed direction, by which a cup is recognized
        up = -np.asarray(scene.gravity, float) if scene.frame is None else np.zeros(3)
        key = f"streams[{number}].box"
        points = sample_points(closed_region(None, self._box, key), SAMPLES)
        sided, self._vessels = assign_sides(walls, points, is_body=body_test(scene, up))
        self._still = [w for w in sided if w.name not in moving and w.is_near(self._box, largest)]
        self._moving = [k for k, wall in enumerate(sided) if wall.name in moving]
        self._sides = [wall.side for wall in sided]
        self._check(key, stream, points, smallest)

    def _check(self, key: str, stream: Stream, points: np.ndarray, radius: float) -> None:
        """Refuse a box that is never free, and note what walls leave of it; of a stream that comes after the end, neither."""
        if stream.start >= self._scene.time.end:
            return
        middle, half = self._box.mean(axis=0), 0.5 * np.ptp(self._box, axis=0)
        centers = middle + (points - middle) * (1.0 - radius / half)
        end = min(self._scene.time.end, stream.until or np.inf)
        times = np.linspace(stream.start, max(stream.start, end), TIMES) if self._moving else [stream.start]
        shares: list[float] = []
        blame: dict[str, float] = {}
        for time in times:
            walls = self.at(time)
            shares.append(float((smallest_gap(walls, centers, radius) >= 0.0).mean()) if walls else 1.0)
            for wall in walls:
                taken = float((wall.gap(centers, radius) < 0.0).mean())
                blame[wall.name] = max(taken, blame.get(wall.name, 0.0))
        named = ", ".join(repr(name) for name, taken in sorted(blame.items(), key=lambda item: -item[1]) if taken > 0.0)
        if max(shares) == 0.0:
            when = "at no time of the run" if self._moving else "nowhere"
            raise SceneError(
                f"{self._scene.source}: {key}: {when} is there space in it for a grain of {2.0 * radius:.4g} m in diameter "
                f"clear of the wall {named}: move the box off it, or make it larger"
            )
        if min(shares) < 1.0 - BLOCKED:
            share = f"{min(shares):.0%} to {max(shares):.0%}" if len(shares) > 1 else f"{shares[0]:.0%}"
            self.notes.append(
                f"{key}: the wall {named} leaves {share} of it: grains are inserted where it leaves space for them"
            )
        if self._vessels:
            vessels = ", ".join(map(repr, dict.fromkeys(self._vessels)))
            self.notes.append(f"{key}: is within the closed mesh {vessels}: its grains are inserted and stay inside")

    def at(self, time: float) -> list[PlacedWall]:
        """The walls that may touch a grain in the box at ``time`` [s]."""
        if not self._moving:
            return self._still
        walls = place_walls(self._scene, self._meshes, self._poses(time))
        now = [replace(walls[k], side=self._sides[k]) for k in self._moving]
        return [*self._still, *(wall for wall in now if wall.is_near(self._box, self._reach))]
