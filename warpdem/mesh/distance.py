"""Signed distance from a closed surface, by a search tree that is built once."""

import numpy as np
import warp as wp

from warpdem.kernels.wall import distance as kernels


class DistanceQuery:
    """Search tree of a closed mesh on the CPU for signed distances.

    Args:
        vertices: Corners [m], shape (v, 3).
        outward: Corner numbers of triangles with outward normals, shape (t, 3).
    """

    def __init__(self, vertices: np.ndarray, outward: np.ndarray) -> None:
        corners = vertices[outward]
        low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
        self._centre, self._size = 0.5 * (low + high), float((high - low).max())
        unit = ((vertices - self._centre) / self._size).astype(np.float32)
        with wp.ScopedDevice("cpu"):
            self._vertex: wp.array[wp.vec3d] = wp.array(vertices, dtype=wp.vec3d)
            self._triangle: wp.array[wp.vec3i] = wp.array(np.ascontiguousarray(outward), dtype=wp.vec3i)
            self._tree = wp.Mesh(
                wp.array(unit, dtype=wp.vec3),
                wp.array(outward.flatten(), dtype=wp.int32),
                support_winding_number=True,
            )

    def __call__(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distance of points (n, 3) [m], shape (n,), negative inside, and its gradient [-], shape (n, 3)."""
        distance = wp.empty(len(points), dtype=wp.float64, device="cpu")
        gradient = wp.empty(len(points), dtype=wp.vec3d, device="cpu")
        wp.launch(
            kernels.signed_distance,
            dim=len(points),
            inputs=[
                self._tree.id,
                wp.vec3d(*self._centre),
                self._size,
                self._vertex,
                self._triangle,
                wp.array(points, dtype=wp.vec3d, device="cpu"),
            ],
            outputs=[distance, gradient],
            device="cpu",
        )
        return distance.numpy(), gradient.numpy()

    def pierced(self, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Whether the segment from each point to another, without its end points, intersects the surface.

        Args:
            start: Points [m], shape (n, 3).
            end: Points [m], shape (n, 3).
        """
        hit = wp.empty(len(start), dtype=wp.int32, device="cpu")
        unit = [((p - self._centre) / self._size).astype(np.float32) for p in (start, end)]
        inputs = [self._tree.id, *(wp.array(p, dtype=wp.vec3, device="cpu") for p in unit)]
        wp.launch(kernels.pierced, dim=len(start), inputs=inputs, outputs=[hit], device="cpu")
        return np.asarray(hit.numpy() == 1)
