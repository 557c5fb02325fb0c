r"""How much of grains and of lines between them lies in a closed mesh, exactly, as ``box_share`` for a box.

A ball about O and the inside of a mesh share the sum over the triangles of what the ball shares with the tetrahedra from O to
them, each with the sign of its volume. Seen from O a triangle in a plane at the distance h is a sum over its edges of right
triangles with a corner in the foot F of the perpendicular; with the distance d of F from the edge, the angle phi about F from
the perpendicular on the edge, and rho = d / cos phi the way to it, each direction phi gives

    integral min(r, s)^3/3 h/s^3 rho' drho',  s^2 = h^2 + rho'^2
        = h rho^2/6                                             as far as s <= r
        = h (r^2 - h^2)/6 + r^3/3 (h/r - h/sqrt(h^2 + rho^2))   beyond; the first two terms with h for r where h > r

    integral rho^2 dphi = d^2 tan phi,     integral h/sqrt(h^2 + rho^2) dphi = asin(h sin phi / sqrt(h^2 + d^2))

A triangle that the ball does not reach gives r^3/3 of its solid angle. A line is in the mesh between the triangles that it
passes through. All sums count how often the surface winds around a point: once in a mesh without bodies that intersect.
"""

from collections.abc import Sequence

import numpy as np

from warpdem.measure.image_share import ImageShare
from warpdem.mesh.solid import MeshSolid

AT_ONCE = 200_000
"""Pairs of a ball or line and a triangle that are looked at together."""


class MeshShare(ImageShare):
    """The inside of a closed mesh.

    Args:
        solid: The inside.
        period: Length of the domain along each periodic axis [m], else 0; shape (3,).
    """

    def __init__(self, solid: MeshSolid, period: Sequence[float]) -> None:
        super().__init__(solid.bounds, solid.volume, period)
        self._solid = solid

    def _balls(self, centre: np.ndarray, radius: np.ndarray) -> np.ndarray:
        return balls_in_mesh(self._solid, centre, radius)

    def _lines(self, start: np.ndarray, way: np.ndarray) -> np.ndarray:
        return _line_share(self._solid, start, way)


def balls_in_mesh(solid: MeshSolid, centre: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Volume of each ball in a mesh [m3], shape (n,)."""
    depth = solid.depth(centre) if len(centre) else np.zeros(0)
    out = np.where(depth > 0.0, 4.0 / 3.0 * np.pi * radius**3, 0.0)
    cut = np.flatnonzero(np.abs(depth) < radius * (1.0 + 1e-6))
    corners, outward = solid.mesh.corners, np.sign(solid.mesh.volume)
    for part in np.array_split(cut, max(1, -(-len(cut) * len(corners) // AT_ONCE))):
        ball, tetrahedron = (k.ravel() for k in np.meshgrid(part, np.arange(len(corners)), indexing="ij"))
        from_centre = corners[tetrahedron] - centre[ball][:, None]
        shared = outward * _tetrahedra(from_centre, radius[ball])
        out[part] = shared.reshape(len(part), len(corners)).sum(axis=1)
    return out


def _tetrahedra(corner: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Volume that a ball about the origin shares with tetrahedra from there to triangles [m3], signed, shape (n,).

    Args:
        corner: Corners of the triangles [m], shape (n, 3, 3).
        radius: Of each ball [m], shape (n,).
    """
    out = np.zeros(len(corner))
    reached = ((corner.min(axis=1) < radius[:, None]) & (corner.max(axis=1) > -radius[:, None])).all(axis=1)
    out[reached] = _cut(corner[reached], radius[reached])
    out[~reached] = radius[~reached] ** 3 / 3.0 * _solid_angle(corner[~reached])
    return out


def _solid_angle(corner: np.ndarray) -> np.ndarray:
    """Solid angle of triangles seen from the origin, positive where their normals point away from it, shape (n,)."""
    a, b, c = corner.transpose(1, 0, 2)
    la, lb, lc = np.linalg.norm(corner, axis=2).T
    ab, bc, ca = (np.einsum("ni,ni->n", *pair) for pair in ((a, b), (b, c), (c, a)))
    volume = np.einsum("ni,ni->n", a, np.cross(b, c))
    return np.asarray(2.0 * np.arctan2(volume, la * lb * lc + ab * lc + bc * la + ca * lb))


def _cut(corner: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """``_tetrahedra`` by the edges of each triangle."""
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    size = np.linalg.norm(normal, axis=1)
    n = normal / np.where(size > 0.0, size, 1.0)[:, None]
    side = np.einsum("ni,ni->n", corner[:, 0], n)
    h, foot = np.abs(side)[:, None], side[:, None] * n
    after = np.roll(corner, -1, axis=1)
    way = after - corner
    length = np.linalg.norm(way, axis=2)
    along = way / np.where(length > 0.0, length, 1.0)[:, :, None]
    arm = corner - foot[:, None]
    # F lies on the left of an edge that turns around it by the normal
    distance = np.einsum("nki,nki->nk", np.cross(n[:, None], along), -arm)
    first = np.einsum("nki,nki->nk", arm, along)
    d, r = np.abs(distance), radius[:, None]
    ends = [np.arctan2(first, d), np.arctan2(first + length, d)]
    reach = np.sqrt(np.maximum(r**2 - h**2, 0.0))  # in the plane
    turn = np.arccos(np.minimum(d / np.where(reach > 0.0, reach, 1.0), 1.0)) * (d < reach)  # where the edge leaves the ball
    hidden = h / np.hypot(h, np.where(d > 0.0, d, 1.0))

    def beyond(phi: np.ndarray) -> np.ndarray:
        return (h * reach**2 / 6.0 + r**2 * np.minimum(h, r) / 3.0) * phi - r**3 / 3.0 * np.arcsin(hidden * np.sin(phi))

    def within(phi: np.ndarray) -> np.ndarray:
        return h * d**2 / 6.0 * np.tan(phi)

    total = np.zeros_like(d)
    for sign, phi in zip((-1.0, 1.0), ends, strict=True):
        inner = np.clip(phi, -turn, turn)
        total += sign * (within(inner) + beyond(phi) - beyond(inner))
    return np.asarray(np.sign(side) * (np.sign(distance) * total).sum(axis=1) * (size > 0.0))


def _line_share(solid: MeshSolid, start: np.ndarray, way: np.ndarray) -> np.ndarray:
    """Share of each line start + t way, t from 0 to 1, that is in a mesh; shape (n,)."""
    length = np.linalg.norm(way, axis=1)
    depth = solid.depth(start + 0.5 * way) if len(start) else np.zeros(0)
    share = np.where(depth > 0.0, 1.0, 0.0)
    cut = np.flatnonzero((np.abs(depth) <= 0.5 * length * (1.0 + 1e-6)) & (length > 0.0))
    count = len(solid.mesh.triangles)
    for part in np.array_split(cut, max(1, -(-len(cut) * count // AT_ONCE))):
        share[part] = _crossed(solid, start[part], way[part])
    return share


def _crossed(solid: MeshSolid, start: np.ndarray, way: np.ndarray) -> np.ndarray:
    """``_line_share`` by the triangles that a line passes through: each edge is seen from both its triangles alike."""
    mesh = solid.mesh
    ends = np.roll(mesh.triangles, -1, axis=1)
    edges, number = np.unique(np.sort(np.stack([mesh.triangles, ends], axis=2).reshape(-1, 2), axis=1), axis=0,
                              return_inverse=True)  # fmt: skip
    forward = np.where(mesh.triangles < ends, 1.0, -1.0)
    a, b = (mesh.vertices[edges[:, k]][None] - start[:, None] for k in (0, 1))
    left = np.where(np.einsum("ni,nei->ne", way, np.cross(a, b)) < 0.0, -1.0, 1.0)
    sides = left[:, number.reshape(-1, 3)] * forward
    hit = np.abs(sides.sum(axis=2)) == 3.0
    corner = mesh.corners
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    climb = way @ normal.T
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (np.einsum("ti,ti->t", corner[:, 0], normal) - start @ normal.T) / climb
    enters = -np.sign(climb) * np.sign(mesh.volume)
    return np.asarray(np.where(hit & (climb != 0.0), enters * (1.0 - np.clip(t, 0.0, 1.0)), 0.0).sum(axis=1))
