"""What a scene must be ready for: the largest speed of a grain, and the pressure at the foot of its grains.

The speed, where the scene does not give ``max_speed``, is sqrt(v0^2 + 2 g H) with v0 the largest speed at the start or of a
stream, plus what frame and walls add. The pressure is that of the weight of the grains as they start and of what presses most
of the servos,

    p = 0.6 rho (g + Omega^2 r) H + K F/A      [Pa]

with H their height, and K = (1 + sin phi)/(1 - sin phi) = 3 for phi = 30 degrees: grains that a servo holds bear so much of its
pressure across when another wall compresses them.
"""

import math

import numpy as np

from warpdem.filling.initial_grains import InitialGrains
from warpdem.mesh.triangle_mesh import TriangleMesh
from warpdem.scene.model import Scene
from warpdem.scene.motion_chain import Chain, frame_chain, wall_chain
from warpdem.scene.servo import Servo
from warpdem.scene.surface_velocity import surface_speed

TURN_ANGLE = 0.05  # [rad] of the frame between two directions of gravity that are looked at
MOST_DIRECTIONS = 20_000
BED_FRACTION = 0.6  # of the volume of a bed is solid
PASSIVE = 3.0  # largest stress over that which a servo holds across [-]


def fall_speed(scene: Scene, start: InitialGrains, meshes: dict[str, TriangleMesh]) -> float:
    """Largest speed that is expected of a grain against what it meets [m/s]: sqrt(v0^2 + 2 g H) + V.

    v0 is the largest speed at the start. H is the height that a grain may fall: from the highest grain to the lowest point of
    grains and walls, along gravity as the frame rotates; from the highest point of walls, too, where frame or walls may lift a
    grain. V is what moves: the frame, the two fastest of the walls that move in different ways, and the fastest belt.
    """
    if not len(start.id):
        return 0.0
    points = [start.position, *(m.vertices for m in meshes.values())]
    for wall in scene.walls:
        if wall.shape is not None:  # the feet of the grains: a plane has no extent of its own
            points.append(wall.shape.nearest(start.position)[0])
    cloud = np.concatenate(points)
    frame = frame_chain(scene)
    motions = [[motion.model_dump_json() for motion in wall.motion or ()] for wall in scene.walls]  # they keep arrays
    walls = [wall_chain(scene, k) for k, motion in enumerate(motions) if motion not in motions[:k]]
    g = float(np.linalg.norm(scene.gravity))
    lifted = frame.moves or any(chain.moves for chain in walls) or any(
        wall.dynamic is not None and (wall.dynamic.rotates or np.dot(wall.dynamic.axis, scene.gravity) < 0.0)
        for wall in scene.walls
    )
    from_where = cloud if lifted else start.position
    height = max((float((cloud @ way).max() - (from_where @ way).min()) for way in _down(scene, frame)), default=0.0)
    fall = math.sqrt(2.0 * g * height)
    by_load = [wall.dynamic.speed_bound(cloud, fall) for wall in scene.walls if wall.dynamic is not None]
    own = np.sort([*(chain.speed_bound(cloud, scene.time.end) for chain in walls), *by_load])
    belts = [surface_speed(wall.surface_velocity) for wall in scene.walls if wall.surface_velocity is not None]
    moved = frame.speed_bound(cloud, scene.time.end) + float(own[-2:].sum()) + max(belts, default=0.0)
    thrown = float(np.linalg.norm(start.velocity, axis=1).max())
    return math.hypot(thrown, fall) + moved


def _down(scene: Scene, frame: Chain) -> np.ndarray:
    """Directions of gravity in frame axes up to the end of the run, shape (d, 3); none without gravity."""
    gravity = np.array(scene.gravity)
    g = float(np.linalg.norm(gravity))
    if not g:
        return np.zeros((0, 3))
    steps = min(MOST_DIRECTIONS, math.ceil(frame.max_rate * scene.time.end / TURN_ANGLE)) if frame.rotates else 0
    axes = frame.pose(np.linspace(0.0, scene.time.end, steps + 1)).axes.astype(float)
    if not steps:
        return (gravity / g @ axes[0])[None]
    ways = np.unique(np.round(gravity / g @ axes, 2), axis=0)
    return ways / np.linalg.norm(ways, axis=1)[:, None]


def bed_pressure(scene: Scene, start: InitialGrains, meshes: dict[str, TriangleMesh]) -> float:
    """Pressure at the foot of the grains [Pa], of their weight as they start and of what the servos may make grains bear."""
    return weight_per_area(scene, start) + PASSIVE * servo_pressure(scene, meshes)


def servo_pressure(scene: Scene, meshes: dict[str, TriangleMesh]) -> float:
    """Largest pressure that a servo asks for [Pa]: of a force, over its mesh as seen along its axis.

    Passed over are torques, and forces of shapes, which have no area.
    """
    largest = 0.0
    for wall in scene.walls:
        servo = wall.dynamic
        if not isinstance(servo, Servo) or servo.rotates:
            continue
        course = servo.pressure if servo.pressure is not None else servo.force
        most = max((abs(load) for _, load in course), default=0.0) if isinstance(course, list) else abs(course or 0.0)
        if servo.pressure is None:
            mesh = meshes.get(wall.name)
            most = most / mesh.area_along(np.array(servo.axis)) if mesh is not None else 0.0
        largest = max(largest, most)
    return largest


def weight_per_area(scene: Scene, start: InitialGrains) -> float:
    """Pressure at the foot of the grains as they start [Pa], in a frame that rotates, with what its rate adds to gravity."""
    if not len(start.id):
        return 0.0
    gravity, chain = np.array(scene.gravity), frame_chain(scene)
    g = float(np.linalg.norm(gravity))
    along = start.position @ gravity / g if g and not chain.rotates else np.linalg.norm(start.position, axis=1)
    height = float(np.ptp(along)) + 2.0 * float(start.radius.max())
    pull = g + chain.max_rate**2 * float(np.linalg.norm(start.position, axis=1).max())
    density = max(list(scene.materials.values())[kind].density for kind in np.unique(start.type))
    return BED_FRACTION * density * pull * height
