"""The walls of a scene on the device: triangles in float64, their trees, analytic shapes, materials and motions."""

from pathlib import Path

import numpy as np
import warp as wp

from warpdem.kernels.wall.mobility import Mobility
from warpdem.kernels.wall.shapes import NUMBER
from warpdem.kernels.wall.surface import WIDTH, MeshTrees, Numbers, Surface
from warpdem.mesh.size_check import size_warning
from warpdem.mesh.triangle_mesh import TriangleMesh, load_mesh, require_closed
from warpdem.mesh.usd_geometry import NOT_READ
from warpdem.scene.model import Scene
from warpdem.scene.size_distribution import size_law

ROUNDING_REACH = 4.0
"""Mismatch allowed at the seams of a mesh over the largest distance of a corner from its plane [-]: both sides, both ways."""


def load_meshes(scene: Scene) -> dict[str, TriangleMesh]:
    """The mesh walls of a scene by name, posed and checked.

    Raises:
        SceneError: if a mesh is missing, empty, not finite, or open without ``open = true``.
    """
    meshes = {}
    for number, wall in enumerate(scene.walls):
        if wall.mesh is not None:
            key = f"{scene.source}: walls[{number}].mesh"
            file, folders = scene.resolve(wall.mesh), scene.access.folders
            given = file, wall.scale, wall.rotate, wall.translate, wall.prim, key, folders, wall.part, wall.tolerance
            mesh = load_mesh(*given)
            if not wall.open:
                require_closed(mesh, key, "if it is open on purpose, add open = true to this wall")
            meshes[wall.name] = mesh
    return meshes


def mesh_notes(scene: Scene, meshes: dict[str, TriangleMesh]) -> list[str]:
    """What a user should know about the meshes: what was mended or is odd in their files."""
    notes = []
    for number, wall in enumerate(scene.walls):
        if wall.mesh is None:
            continue
        key, mesh = f"walls[{number}].mesh", meshes[wall.name]
        # borders are meant where a scene says that a mesh is open; the physics of its own stage a scene in USD has read
        own = scene.resolve(wall.mesh).resolve() == Path(scene.source).resolve()
        known = ["open edges"] * wall.open + [NOT_READ] * own
        notes += [f"{key}: {mesh.name}: {note}" for note in mesh.notes if not any(words in note for words in known)]
    return notes


def size_warnings(scene: Scene, meshes: dict[str, TriangleMesh], diameters: np.ndarray) -> list[str]:
    """Which meshes are of an odd size beside the grains' ``diameters`` [m]: one in millimetres is a thousand times too large.

    Raises:
        SceneError: if a mesh and the grains cannot belong together.
    """
    if not len(diameters):
        return []
    walls = [(f"{scene.source}: walls[{k}].mesh", meshes[w.name]) for k, w in enumerate(scene.walls) if w.mesh is not None]
    found = [size_warning(mesh.name, mesh.bounds, diameters, key) for key, mesh in walls]
    return [text for text in found if text is not None]


def named_diameters(scene: Scene) -> np.ndarray:
    """Diameters that the scene itself names [m]: known before anything is filled."""
    found = []
    for group in scene.grains:
        if group.fill is not None and group.fill.diameter is not None:
            found.append(np.array([size_law(group.fill.diameter).mean_diameter]))
        elif group.positions is not None and group.clump is None:
            found.append(2.0 * group.explicit_radii)
    return np.concatenate(found) if found else np.zeros(0)


class Walls:
    """Device side of all walls, in the order of the scene.

    Attributes:
        surface: what the kernels read; ``images`` as `wall_images` gives them.
        trees: search trees of the meshes.
        wall_of: number of the wall that each feature belongs to, shape (features,), on the host.
        material: material index of each wall, shape (walls,), on the host.
    """

    def __init__(
        self, scene: Scene, meshes: dict[str, TriangleMesh], wall_motion: np.ndarray, images: np.ndarray | None,
        mobility: np.ndarray, device: wp.Device,
    ) -> None:  # fmt: skip
        corners, vertices, pieces, planes, owners = [], [], [], [], []
        mesh_ids, mesh_wall, mesh_first = [], [], []
        self._trees = []
        vertex_count = piece_count = triangle_count = 0
        names = list(scene.materials)
        rounding = np.zeros(len(scene.walls))
        for number, wall in enumerate(scene.walls):
            if wall.mesh is None:
                continue
            mesh = meshes[wall.name]
            normal, offset = mesh.plane_normal[mesh.plane], mesh.plane_offset[mesh.plane]
            corners.append(mesh.corners)
            height = np.einsum("tcx,tx->tc", mesh.corners, normal) - offset[:, None]
            rounding[number] = ROUNDING_REACH * np.abs(height).max()
            vertices.append(mesh.triangles + vertex_count)
            pieces.append(mesh.piece + piece_count)
            planes.append(np.concatenate([normal, offset[:, None]], axis=1))
            owners.append(np.full(len(mesh.triangles), number))
            tree = wp.Mesh(
                points=wp.array(mesh.vertices.astype(np.float32), dtype=wp.vec3, device=device),
                indices=wp.array(mesh.triangles.astype(np.int32).ravel(), dtype=wp.int32, device=device),
            )
            self._trees.append(tree)
            mesh_ids.append(tree.id)
            mesh_wall.append(number)
            mesh_first.append(triangle_count)
            vertex_count += len(mesh.vertices)
            piece_count += int(mesh.piece.max()) + 1
            triangle_count += len(mesh.triangles)
        shapes = [(number, wall.shape) for number, wall in enumerate(scene.walls) if wall.shape is not None]
        shapes.sort(key=lambda one: NUMBER[one[1].KERNEL])  # stable: of one shape in the order of the scene
        numbers = np.zeros((len(shapes), WIDTH))
        for values, (_, shape) in zip(numbers, shapes, strict=True):
            values[: len(shape.numbers)] = shape.numbers
        owners.append(np.array([number for number, _ in shapes], dtype=int))
        pieces.append(piece_count + np.arange(len(shapes)))

        def upload(parts: list[np.ndarray], dtype: type, shape: tuple[int, ...]) -> wp.array:
            data = np.concatenate(parts) if parts else np.zeros((0, *shape))
            return wp.array(np.ascontiguousarray(data), dtype=dtype, device=device)

        surface = Surface()
        surface.triangles, surface.analytic = triangle_count, len(shapes)
        surface.corner = upload(corners, wp.mat33d, (3, 3))
        surface.vertex = upload([v.astype(np.int32) for v in vertices], wp.vec3i, (3,))
        surface.piece = upload([p.astype(np.int32) for p in pieces], wp.int32, ())
        surface.plane = upload(planes, wp.vec4d, (4,))
        surface.shape = upload([np.array([NUMBER[s.KERNEL] for _, s in shapes], np.int32)], wp.int32, ())
        surface.numbers = upload([numbers], Numbers, (WIDTH,))
        surface.rounding = wp.array(rounding, dtype=wp.float64, device=device)
        self.wall_of = np.concatenate(owners).astype(np.int32)
        surface.wall = upload([self.wall_of], wp.int32, ())
        surface.motion = wp.array(wall_motion.astype(np.int32), dtype=wp.int32, device=device)
        surface.mobility = wp.array(mobility, dtype=Mobility, device=device)
        images = np.zeros(0) if images is None else images
        surface.images = wp.array(images.astype(np.int32), dtype=wp.int32, device=device)
        self.material = np.array([names.index(w.material) for w in scene.walls], dtype=np.int32)
        surface.material = wp.array(self.material, dtype=wp.int32, device=device)
        self.surface = surface
        trees = self.trees = MeshTrees()
        trees.tree = wp.array(np.array(mesh_ids, dtype=np.uint64), dtype=wp.uint64, device=device)
        trees.wall = wp.array(np.array(mesh_wall, dtype=np.int32), dtype=wp.int32, device=device)
        trees.first = wp.array(np.array(mesh_first, dtype=np.int32), dtype=wp.int32, device=device)
