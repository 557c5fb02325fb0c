"""Mass, center of mass and inertia of what a closed mesh encloses."""

from dataclasses import dataclass

import numpy as np

from warpdem.mesh.triangle_mesh import TriangleMesh


@dataclass(frozen=True)
class SolidBody:
    """A homogeneous rigid body."""

    mass: float
    """[kg]."""
    center: np.ndarray
    """Center of mass [m], shape (3,)."""
    inertia: np.ndarray
    """Inertia tensor about the center of mass [kg m2], shape (3, 3)."""

    def about(self, axis: np.ndarray, origin: np.ndarray) -> float:
        """Moment of inertia [kg m2] about the unit vector ``axis`` through ``origin`` [m]: Steiner's theorem."""
        arm = np.cross(self.center - origin, axis)
        return float(axis @ self.inertia @ axis + self.mass * (arm @ arm))


def solid_body(mesh: TriangleMesh, density: float) -> SolidBody:
    """The body that a closed mesh encloses, filled with ``density`` [kg/m3]: sums over tetrahedra on its triangles.

    The covariance of a tetrahedron with one corner in the origin is (det/120) (a a + b b + c c + (a+b+c)(a+b+c)); normals may
    point inwards or outwards.
    """
    middle = mesh.vertices.mean(axis=0)
    corners = mesh.corners - middle
    six_volumes = np.linalg.det(corners)
    sign = 1.0 if six_volumes.sum() >= 0.0 else -1.0
    total = corners.sum(axis=1)
    mass = sign * density * six_volumes.sum() / 6.0
    center = sign * density * (six_volumes @ total) / 24.0 / mass
    second = np.einsum("t,tci,tcj->ij", six_volumes, corners, corners) + np.einsum("t,ti,tj->ij", six_volumes, total, total)
    covariance = sign * density * second / 120.0 - mass * np.outer(center, center)
    inertia = np.trace(covariance) * np.eye(3) - covariance
    return SolidBody(float(mass), center + middle, inertia)
