"""Clumps as scene data: rigid bodies of spheres, by name."""

from typing import Annotated, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from warpdem.scene.base import FileName, Length, Point, SceneModel, exactly_one, validation_error
from warpdem.scene.units import Quantity, Vector

GIVEN = ("mass", "moments")
"""Keys of inertia = "given"."""
ROUNDING = 1e-9
"""By how much a given moment may exceed the sum of the two others [-]."""
Orientation = Annotated[
    Annotated[Literal["random", "aligned"], Tag("~word")]
    | Annotated[tuple[float, float, float, float], Vector(Quantity("-"), 4), Tag("~quaternion")],
    Discriminator(lambda value: "~quaternion" if isinstance(value, (list, tuple)) else "~word"),
]
"""Directions of clumps that are packed or inserted: a word, or one quaternion for all."""


class ClumpSphere(SceneModel):
    """A member of a clump."""

    centre: Point = Field(description="Centre in the axes of the clump, whose origin may lie anywhere [m].")
    radius: Length = Field(description="Radius [m], > 0.")


class Fit(SceneModel):
    """Spheres that fill a mesh, chosen one after the other, each the one that covers most of what is not covered yet."""

    spheres: Annotated[int, Field(strict=True, ge=2, le=1000)] = Field(description="Spheres at most [-], 2 to 1000.")
    coverage: Annotated[float, Quantity("-", gt=0, le=1)] = Field(
        1.0, description="Part of the volume of the mesh at which fewer spheres are enough [-], > 0 and <= 1, default 1."
    )
    outside: Annotated[float, Quantity("m", ge=0)] = Field(
        0.0, description="How far a sphere may stick out of the mesh [m], >= 0, default 0: each touches it from within."
    )


class Clump(SceneModel):
    """A rigid body of spheres, which may overlap each other."""

    spheres: list[ClumpSphere] | None = Field(None, description="Its spheres; this, file or fit.")
    file: FileName | None = Field(
        None, description="File with a row per sphere, .csv with the columns x, y, z, radius, or .npz; this, spheres or fit."
    )
    fit: Fit | None = Field(None, description="Spheres fitted to mesh; this, spheres or file.")
    inertia: Literal["union", "mesh", "given"] | None = Field(
        None,
        description='Mass, centre and moments of inertia: "union" (default), of the union of the spheres at the density of the '
        'material, overlaps counted once; "mesh" (default with fit), of the closed mesh; "given", by mass, moments, centre '
        "and axes.",
    )
    mesh: FileName | None = Field(
        None, description='With fit or inertia = "mesh": closed mesh in the axes of the clump (.stl, .obj, .ply).'
    )
    scale: Annotated[float, Quantity("-", gt=0)] | None = Field(
        None, description="With mesh: metres per unit of its file [-], > 0, default 1."
    )
    mass: Annotated[float, Quantity("kg", gt=0)] | None = Field(None, description='With inertia = "given": mass [kg], > 0.')
    moments: Annotated[tuple[float, float, float], Vector(Quantity("kg m2", gt=0))] | None = Field(
        None, description='With inertia = "given": principal moments of inertia [kg m2], > 0.'
    )
    centre: Point | None = Field(None, description='With inertia = "given": centre of mass [m], default (0, 0, 0).')
    axes: Annotated[tuple[float, float, float, float], Vector(Quantity("-"), 4)] | None = Field(
        None,
        description='With inertia = "given": quaternion (w, x, y, z) [-] from the principal axes to the axes of the clump, '
        "default (1, 0, 0, 0).",
    )

    @model_validator(mode="after")
    def _keys_agree(self) -> "Clump":
        exactly_one(self, "spheres", "file", "fit")
        if self.spheres is not None:
            self._check_spheres(self.spheres)
        needs = 'inertia = "mesh"' if self.mass_of == "mesh" and self.fit is None else "fit"
        if (self.mesh is not None) != (self.fit is not None or self.mass_of == "mesh"):
            reason = f"missing: {needs} needs it" if self.mesh is None else 'is used with fit or inertia = "mesh" only'
            raise validation_error([(("mesh",), self.mesh, reason)])
        if self.scale is not None and self.mesh is None:
            raise validation_error([(("scale",), self.scale, "belongs to mesh")])
        if self.mass_of == "given":
            lacking = [key for key in GIVEN if getattr(self, key) is None]
            if lacking:
                raise validation_error([((key,), None, 'missing: inertia = "given" needs it') for key in lacking])
            self._check_moments()
        else:
            stray = [key for key in (*GIVEN, "centre", "axes") if getattr(self, key) is not None]
            if stray:
                reason = f'is used with inertia = "given" only; it is "{self.mass_of}"'
                raise validation_error([((key,), getattr(self, key), reason) for key in stray])
        return self

    @property
    def mass_of(self) -> Literal["union", "mesh", "given"]:
        """What mass, centre and moments are those of: ``inertia`` with its default."""
        return self.inertia or ("union" if self.fit is None else "mesh")

    def _check_spheres(self, spheres: list[ClumpSphere]) -> None:
        if len(spheres) < 2:
            reason = f"must be at least 2, are {len(spheres)}: a single sphere is a grain without a clump"
            raise validation_error([(("spheres",), None, reason)])
        seen: dict[tuple[object, ...], int] = {}
        for k, sphere in enumerate(spheres):
            first = seen.setdefault((*sphere.centre, sphere.radius), k)
            if first != k:
                raise validation_error([(("spheres", k), None, f"is the same sphere as spheres[{first}]: leave it out")])

    def _check_moments(self) -> None:
        assert self.moments is not None
        for k, moment in enumerate(self.moments):
            others = sum(self.moments) - moment
            if moment > others * (1.0 + ROUNDING):
                reason = f"no body has these: each moment is at most the sum of the two others, {others:g} kg m2"
                raise validation_error([(("moments", k), moment, reason)])
        if self.axes is not None and not sum(x * x for x in self.axes) > 0.0:
            raise validation_error([(("axes",), None, "must not be zero")])
