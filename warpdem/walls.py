"""The walls of a scene on the device: triangles in float64, their trees, planes, materials and motions."""

import numpy as np
import warp as wp

from warpdem.geometry import TriangleMesh, check_size, load_mesh, require_closed
from warpdem.kernels.wall.surface import Surface


def load_meshes(scene) -> dict[str, TriangleMesh]:
    """The mesh walls of a scene by name, posed and checked.

    Raises:
        SceneError: if a mesh is missing, empty, not finite, or open without ``open = true``.
    """
    meshes = {}
    for number, wall in enumerate(scene.walls):
        if wall.mesh is not None:
            key = f"{scene.source}: walls[{number}].mesh"
            mesh = load_mesh(scene.resolve(wall.mesh), wall.scale, wall.rotate, wall.translate, key=key)
            if not wall.open:
                require_closed(mesh, key)
            meshes[wall.name] = mesh
    return meshes


def check_sizes(scene, meshes: dict[str, TriangleMesh], diameters: np.ndarray) -> None:
    """Compare every mesh with the grains' ``diameters`` [m]: a mesh in millimetres is a thousand times too large.

    Raises:
        SceneError: if a mesh and the grains cannot belong together.
    """
    for number, wall in enumerate(scene.walls):
        if wall.mesh is not None and len(diameters):
            check_size(meshes[wall.name], diameters, f"{scene.source}: walls[{number}].mesh")


def named_diameters(scene) -> np.ndarray:
    """Diameters that the scene itself names [m]: known before anything is filled."""
    found = []
    for group in scene.grains:
        if group.fill is not None:
            d = group.fill.diameter
            found.append(np.atleast_1d(np.array(getattr(d, "uniform", d), dtype=float)))
        elif group.positions is not None:
            found.append(2.0 * group.explicit_radii)
    return np.concatenate(found) if found else np.zeros(0)


class Walls:
    """Device side of all walls, in the order of the scene.

    Attributes:
        surface: what the kernels read.
        mesh_arrays: mesh ids, their walls and first triangles, for the candidate search.
    """

    def __init__(self, scene, meshes: dict, wall_motion: np.ndarray, device) -> None:
        corners, vertices, pieces, planes, owners = [], [], [], [], []
        mesh_ids, mesh_wall, mesh_first = [], [], []
        self._trees = []
        vertex_count = piece_count = triangle_count = 0
        names = list(scene.materials)
        for number, wall in enumerate(scene.walls):
            if wall.mesh is None:
                continue
            mesh = meshes[wall.name]
            corners.append(mesh.vertices[mesh.triangles])
            vertices.append(mesh.triangles + vertex_count)
            pieces.append(mesh.piece + piece_count)
            normal, offset = mesh.plane_normal[mesh.plane], mesh.plane_offset[mesh.plane]
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
        for number, wall in enumerate(scene.walls):
            if wall.plane is None:
                continue
            normal = np.array(wall.plane.normal, dtype=float)
            normal = normal / np.linalg.norm(normal)
            planes.append(np.append(normal, normal @ np.array(wall.plane.point))[None])
            pieces.append(np.array([piece_count]))
            owners.append(np.array([number]))
            piece_count += 1

        def upload(parts, dtype, shape):
            data = np.concatenate(parts) if parts else np.zeros((0, *shape))
            return wp.array(np.ascontiguousarray(data), dtype=dtype, device=device)

        surface = Surface()
        surface.triangles = triangle_count
        surface.corner = upload(corners, wp.mat33d, (3, 3))
        surface.vertex = upload([v.astype(np.int32) for v in vertices], wp.vec3i, (3,))
        surface.piece = upload([p.astype(np.int32) for p in pieces], wp.int32, ())
        surface.plane = upload(planes, wp.vec4d, (4,))
        surface.wall = upload([o.astype(np.int32) for o in owners], wp.int32, ())
        surface.motion = wp.array(wall_motion.astype(np.int32), dtype=wp.int32, device=device)
        material = np.array([names.index(w.material) for w in scene.walls], dtype=np.int32)
        surface.material = wp.array(material, dtype=wp.int32, device=device)
        self.surface = surface
        self.mesh_arrays = (
            wp.array(np.array(mesh_ids, dtype=np.uint64), dtype=wp.uint64, device=device),
            wp.array(np.array(mesh_wall, dtype=np.int32), dtype=wp.int32, device=device),
            wp.array(np.array(mesh_first, dtype=np.int32), dtype=wp.int32, device=device),
        )
