"""Clumps of a scene as templates: members in principal axes about the centre of mass, mass and moments of inertia."""

import hashlib
from dataclasses import dataclass

import numpy as np

from warpdem.errors import SceneError
from warpdem.filling.grain_file import read_grain_file
from warpdem.mesh.sphere_fit import SphereFit, fit_spheres
from warpdem.mesh.sphere_union import Solid, union_of_spheres
from warpdem.mesh.triangle_mesh import TriangleMesh, load_mesh, require_closed
from warpdem.scene.clumps import Clump, Fit
from warpdem.scene.model import Scene
from warpdem.usd.motion import quaternion_of

EQUAL = 1e-12
"""Moments of inertia whose relative difference is below count as equal: the clump is then a body of revolution, whose free
rotation is exact at any step."""
KEPT = 32
"""Templates that a process keeps."""
THIN = 1e-9
"""Volume of a mesh over that of its bounding box below which it has no thickness [-]."""


@dataclass(frozen=True)
class ClumpTemplate:
    """A clump of the scene at size 1."""

    name: str
    arm: np.ndarray
    """Centres of the members in the principal axes, from the centre of mass [m], shape (k, 3)."""
    radius: np.ndarray
    """Radii of the members [m], shape (k,)."""
    volume: float
    """Volume of the union of the spheres or of the mesh [m3]."""
    mass: float | None
    """Mass [kg] where the scene gives it; None: volume times the density of the material."""
    moments: np.ndarray
    """Principal moments of inertia over the mass [m2], shape (3,); equal ones come first."""
    axes: np.ndarray
    """Quaternion (w, x, y, z) from the principal axes to the axes of the clump in the scene, shape (4,)."""
    parts: int
    """Groups of members that touch each other: 1 for a connected clump."""
    fit: SphereFit | None = None
    """How well the members fill a mesh to which they are fitted; None where they are given."""

    @property
    def equal_radius(self) -> float:
        """Radius of the sphere of equal volume [m]."""
        return float((self.volume / (4.0 / 3.0 * np.pi)) ** (1.0 / 3.0))

    @property
    def matrix(self) -> np.ndarray:
        """Rotation from the principal axes to the axes of the clump in the scene, shape (3, 3)."""
        return _matrix(self.axes)

    def mass_at(self, density: float) -> float:
        """Mass [kg] at a density [kg/m3]."""
        return self.volume * density if self.mass is None else self.mass


_MADE: dict[tuple[object, ...], ClumpTemplate] = {}


def clump_templates(scene: Scene) -> dict[str, ClumpTemplate]:
    """The clumps of a scene by name.

    Raises:
        SceneError: A file is missing or wrong; a mesh is open or has no thickness.
    """
    return {name: _known(scene, name, clump) for name, clump in scene.clumps.items()}


def _known(scene: Scene, name: str, clump: Clump) -> ClumpTemplate:
    """The template, made once in a process: a fit or the union of many spheres takes seconds."""
    paths = [scene.resolve(file) for file in (clump.file, clump.mesh) if file is not None]
    contents = tuple(hashlib.sha256(path.read_bytes()).hexdigest() for path in paths if path.is_file())
    made = name, clump.model_dump_json(), contents
    if made not in _MADE:
        if len(_MADE) >= KEPT:
            _MADE.pop(next(iter(_MADE)))
        _MADE[made] = _template(scene, name, clump)
    return _MADE[made]


def _template(scene: Scene, name: str, clump: Clump) -> ClumpTemplate:
    key = f"{scene.source}: clumps.{name}"
    mesh = _mesh(scene, clump, f"{key}.mesh") if clump.mesh is not None else None
    fit = None
    if clump.fit is not None and mesh is not None:
        fit = _fitted(mesh, clump.fit, f"{key}.fit")
        centre, radius = fit.centre, fit.radius
    else:
        centre, radius = _spheres(scene, clump, key)
    solid = _of_mesh(mesh) if clump.mass_of == "mesh" and mesh is not None else union_of_spheres(centre, radius)
    mass = None
    if clump.mass_of == "given":
        assert clump.mass is not None and clump.moments is not None
        axes = _matrix(np.array(clump.axes or (1.0, 0.0, 0.0, 0.0)))
        mass, moments = clump.mass, np.array(clump.moments) / clump.mass
        middle = np.array(clump.centre or (0.0, 0.0, 0.0))
    else:
        moments, axes = np.linalg.eigh(solid.inertia / solid.volume)
        middle = solid.centre
    moments, axes = in_order(moments, axes)
    return ClumpTemplate(
        name, (centre - middle) @ axes, radius, solid.volume, mass, moments, quaternion_of(axes).astype(float),
        _parts(centre, radius), fit,
    )  # fmt: skip


def _spheres(scene: Scene, clump: Clump, key: str) -> tuple[np.ndarray, np.ndarray]:
    """Centres [m] and radii [m] of the members."""
    if clump.spheres is not None:
        return np.array([s.centre for s in clump.spheres]), np.array([s.radius for s in clump.spheres])
    fields = read_grain_file(scene.resolve(str(clump.file)), f"{key}.file")
    centre, radius = fields["position"], fields["radius"]
    assert centre is not None and radius is not None
    rows = np.column_stack([centre, radius])
    if len(rows) < 2:
        raise SceneError(f"{key}.file: {clump.file} holds 1 sphere; a clump has at least 2: a single one is a grain")
    if len(np.unique(rows, axis=0)) < len(rows):
        raise SceneError(f"{key}.file: {clump.file} holds a sphere twice")
    return centre, radius


def _mesh(scene: Scene, clump: Clump, key: str) -> TriangleMesh:
    """The closed mesh of a clump."""
    mesh = load_mesh(scene.resolve(str(clump.mesh)), clump.scale or 1.0, key=key)
    remedy = "close it in a mesh editor" + (', or take inertia = "union"' if clump.fit is None else "")
    require_closed(mesh, key, remedy)
    box = float(np.prod(mesh.bounds[1] - mesh.bounds[0]))
    if abs(mesh.volume) <= THIN * box or box == 0.0:
        raise SceneError(f"{key}: {clump.mesh} encloses {abs(mesh.volume):.3g} m3: a clump needs a mesh with thickness")
    return mesh


def _fitted(mesh: TriangleMesh, fit: Fit, key: str) -> SphereFit:
    """Spheres that fill a mesh, two at least."""
    found = fit_spheres(mesh, fit.spheres, fit.coverage, fit.outside)
    if len(found.radius) < 2:
        raise SceneError(
            f"{key}: {len(found.radius)} sphere covers {100.0 * found.coverage:.3g} % of {mesh.name}; a clump has at least 2: "
            "take a grain in its place, or a higher coverage"
        )
    return found


def _of_mesh(mesh: TriangleMesh) -> Solid:
    """Integrals over the inside of a closed mesh."""
    from trimesh.triangles import mass_properties  # slow to import

    middle = mesh.bounds.mean(axis=0)
    corners = mesh.corners if mesh.volume > 0.0 else mesh.corners[:, ::-1]
    found = mass_properties(corners - middle, density=1.0)
    return Solid(float(found.volume), np.asarray(found.center_mass) + middle, np.asarray(found.inertia))


def in_order(moments: np.ndarray, axes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Principal moments and right-handed axes (columns), those of equal moments first and the moments equal to the bit.

    Axes that symmetry leaves free lie as near to the axes of the clump as they can, so that no rounding decides on them.
    """
    order = np.argsort(moments)
    moments, axes = moments[order], axes[:, order]
    low, high = (moments[k + 1] - moments[k] <= EQUAL * moments[2] for k in range(2))
    if low and high:
        return np.full(3, moments.mean()), np.eye(3)
    if high:
        moments, axes = np.roll(moments, -1), np.roll(axes, -1, axis=1)
    for k in range(3):
        axes[:, k] *= np.sign(axes[np.argmax(np.abs(axes[:, k])), k])
    if low or high:
        moments = np.array([*[0.5 * (moments[0] + moments[1])] * 2, moments[2]])
        axis = axes[:, 2]
        first = np.eye(3)[np.argmin(np.abs(axis))]
        first = first - axis * (first @ axis)
        axes[:, 0] = first / np.linalg.norm(first)
    axes[:, 1] = np.cross(axes[:, 2], axes[:, 0])
    return moments, axes


def _parts(centre: np.ndarray, radius: np.ndarray) -> int:
    """Number of groups of spheres that touch each other."""
    apart = np.linalg.norm(centre[:, None] - centre[None], axis=2)
    reach = radius[:, None] + radius[None]
    touching = apart <= reach * (1.0 + 1e-9)
    group = np.arange(len(radius))
    for i, j in zip(*np.nonzero(touching), strict=True):
        group[group == group[j]] = group[i]
    return len(np.unique(group))


def _matrix(quaternion: np.ndarray) -> np.ndarray:
    """Rotation matrix of a quaternion of any length."""
    w, x, y, z = quaternion / np.linalg.norm(quaternion)
    v = np.array([x, y, z])
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray((w * w - v @ v) * np.eye(3) + 2.0 * np.outer(v, v) + 2.0 * w * cross)
