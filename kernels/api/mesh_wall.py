"""Contacts of grains with a triangle mesh at rest."""

import numpy as np
import warp as wp
from warpdem.kernels.api.contact_law import ContactLaw
from warpdem.kernels.api.drift import step_row
from warpdem.kernels.api.grains import Grains, Load
from warpdem.kernels.api.listed_grains import ListedGrains
from warpdem.kernels.lists.numbering import starts
from warpdem.kernels.lists.path import Flight
from warpdem.kernels.step.schedule import Placement
from warpdem.kernels.wall import contact_points, record
from warpdem.kernels.wall.candidates import MET
from warpdem.kernels.wall.surface import MeshTrees, Numbers, Surface

SEAM = 4.0  # mismatch allowed at the seams of a mesh over the largest distance of a corner from its plane [-]


class MeshWall(ListedGrains):
    """Contacts of grains with a triangle mesh at rest.

    Args:
        grains: the grains.
        law: contact law.
        mesh: a ``warpdem.mesh.triangle_mesh.TriangleMesh``, or anything with its attributes ``vertices`` (v, 3) [m],
            ``triangles`` (t, 3), ``piece`` (t,), ``plane`` (t,), ``plane_normal`` (p, 3) and ``plane_offset`` (p,) [m].
        skin: as of ``Pairs``.
        material: index of the wall's material in the contact law.

    Attributes:
        rebuilds: how often the lists of triangles near grains were made.
    """

    def __init__(self, grains: Grains, law: ContactLaw, mesh, skin: float, material: int = 0) -> None:
        super().__init__(grains, law, skin)
        device, triangles = grains.device, np.asarray(mesh.triangles, np.int32)
        corners = np.asarray(mesh.vertices, float)[triangles]
        normal, offset = mesh.plane_normal[mesh.plane], mesh.plane_offset[mesh.plane]
        height = np.einsum("tcx,tx->tc", corners, normal) - offset[:, None]
        surface = self.surface = Surface()
        surface.triangles, surface.analytic = len(triangles), 0
        surface.corner = wp.array(corners, dtype=wp.mat33d, device=device)
        surface.vertex = wp.array(triangles, dtype=wp.vec3i, device=device)
        surface.piece = wp.array(np.asarray(mesh.piece, np.int32), dtype=wp.int32, device=device)
        surface.plane = wp.array(np.concatenate([normal, offset[:, None]], axis=1), dtype=wp.vec4d, device=device)
        surface.shape, surface.numbers = self.ints(0), wp.zeros(0, dtype=Numbers, device=device)
        surface.rounding = wp.array([SEAM * np.abs(height).max()], dtype=wp.float64, device=device)
        surface.wall, surface.motion, surface.images = self.ints(len(triangles)), self.ints(1), self.ints(0)
        surface.material = self.ints(1, material)
        self._tree = wp.Mesh(
            points=wp.array(np.asarray(mesh.vertices, np.float32), dtype=wp.vec3, device=device),
            indices=wp.array(triangles.ravel(), dtype=wp.int32, device=device),
        )
        at_rest = np.zeros((1, 1, 24))
        at_rest[..., [0, 4, 8]] = 1.0
        self._placement = wp.array(at_rest, dtype=Placement, device=device)
        self._wall_contacts = self._new_wall_contacts(self.ints(len(grains) + 1), 0)

    def apply(self, dt: float) -> None:
        """Add the forces and torques of the wall on each grain to ``grains.load``, for a step of ``dt`` [s]."""
        g = self.grains
        self.update()
        row = step_row(dt, (0.0, 0.0, 0.0), g.steps == 0, g.device.alias)
        if self._wall_contacts.grain is not None and len(self._wall_contacts.grain):
            model, struct = self.kernels.structs.Model(), self.kernels.structs.Grains()
            model.coefficients, model.materials, model.surface, model.dt = self._table, self.law.materials, self.surface, dt
            struct.record, struct.inverse, struct.material = g.record, g.inverse, g.material
            read = g.steps & 1, row, self._placement, model, struct
            self.launch(self.kernels.wall_forces, len(self._wall_contacts.grain), [*read, self._wall_contacts, g.load])

    def _new_wall_contacts(self, first: wp.array, slots: int):
        """WallContacts with ``slots`` slots in all, those of each grain from ``first`` on."""
        wall_contacts, n, device = self.kernels.WallContacts(), len(self.grains), self.grains.device
        wall_contacts.first, wall_contacts.candidates = first, self.ints(n)
        wall_contacts.load = wp.zeros(n, dtype=Load, device=device)
        wall_contacts.feature, wall_contacts.hit_state, wall_contacts.hit_mask = (self.ints(slots) for _ in range(3))
        wall_contacts.hit = wp.zeros(slots, dtype=contact_points.Hit, device=device)
        wall_contacts.found = wp.zeros(slots, dtype=record.Found, device=device)
        wall_contacts.result = wp.zeros(slots, dtype=self.kernels.Result, device=device)
        wall_contacts.point_count = self.ints((2, n))
        wall_contacts.point = wp.zeros((2, slots), dtype=self.kernels.WallHistory, device=device)
        return wall_contacts

    def _make(self) -> None:
        g, beside, n = self.grains, self.kernels.beside, len(self.grains)
        count, nothing, trees, met = self.ints(n), self.ints(0), MeshTrees(), self.ints((n, MET))
        trees.tree = wp.array([self._tree.id], dtype=wp.uint64, device=g.device)
        trees.wall, trees.first = self.ints(1), self.ints(1)
        placements = self._placement.flatten()
        shared = [self.listed(), self._allowance, self.surface, trees, placements, met]
        self.launch(beside.near_features, n, [0, 0, *shared, nothing, count, nothing])
        host = starts(count.numpy())
        first, near = wp.array(host, dtype=wp.int32, device=g.device), self.ints(int(host[-1]))
        self.launch(beside.near_features, n, [0, 1, *shared, first, count, near])
        before, wall_contacts = self._wall_contacts, self._new_wall_contacts(first, int(host[-1]))
        same = wp.array(np.arange(n, dtype=np.int32), device=g.device)
        self.launch(beside.carry_wall_contacts, n, [0, 1 - (g.steps & 1), same, before, wall_contacts])
        flight = wp.zeros(0, dtype=Flight, device=g.device)
        self.launch(beside.close_features, n, [
            0, g.record, 1.0, self._allowance, self.surface, placements, near, flight, wall_contacts
        ])  # fmt: skip
        at_wall = np.flatnonzero(wall_contacts.candidates.numpy()).astype(np.int32)
        wall_contacts.grain = wp.array(at_wall, dtype=wp.int32, device=g.device)
        self._wall_contacts = wall_contacts
