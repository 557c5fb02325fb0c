"""Grains at the start as scene data: positions given one by one, a state file, or a filling."""

from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator
from pydantic_core import core_schema

from warpdem.scene.base import (
    GROUP_NAME,
    LIQUID_CONTENT,
    FileName,
    Label,
    Length,
    LiquidContent,
    Point,
    SceneModel,
    Whole,
    exactly_one,
    validation_error,
)
from warpdem.scene.clumps import Orientation
from warpdem.scene.regions import VOLUMES, Box, CylinderRegion, MeshRegion, SphereRegion
from warpdem.scene.size_distribution import Diameter, Factor
from warpdem.scene.units import Array, Quantity, Vector

Copies = Annotated[int, Field(strict=True, ge=1)]
STATE_FILE_SUFFIXES = (".npz", ".csv", ".vtp")
CHECKPOINT_SUFFIXES = (".h5", ".hdf5")
OF_PACKING = ("region", "point", "height", "count", "mass", "solid_fraction", "diameter", "size", "orientation")
"""Keys of a filling that say how grains are packed."""

class Fill(SceneModel):
    """Grains at random positions, dense and without overlap, inside a mesh wall or a region; or copies of a bed that is there.

    The number of grains follows from count, mass, or solid fraction in the volume that walls leave free. Fillings do not
    overlap walls, each other, or grains given by positions or files.
    """

    wall: str | None = Field(
        None, description="Name of the mesh wall to fill; this, or box, cylinder, sphere or mesh; or tile."
    )
    tile: FileName | None = Field(
        None,
        description="Checkpoint (checkpoint.h5) or state file (.npz, .csv, .vtp) whose grains are copied, relative to the "
        "scene file, in place of packing. They start at rest in the frame, all of this material.",
    )
    copies: tuple[Copies, Copies, Copies] = Field(
        (1, 1, 1), description="With tile: number of copies along x, y and z [-], >= 1; the first is where the file has it."
    )
    spacing: Annotated[tuple[float, float, float], Vector(Quantity("m", gt=0))] | None = Field(
        None,
        description="With tile: distance of the copies along x, y and z [m], > 0; default: the period of its scene's periodic "
        "borders, else the length of the tile, grains included.",
    )
    box: Box | None = Field(None, description="Box to fill; this, wall or another region.")
    cylinder: CylinderRegion | None = Field(
        None, description="Cylinder to fill, of a length, in 96 facets; this, wall or another region."
    )
    sphere: SphereRegion | None = Field(None, description="Sphere to fill, in 96 facets; this, wall or another region.")
    mesh: MeshRegion | None = Field(None, description="Inside of a closed mesh that is no wall; this, wall or another region.")
    region: Box | None = Field(None, description="With wall: fill only the part of its inside that lies in this box.")
    point: Point | None = Field(
        None, description="With wall: a point inside the space to fill [m], if the mesh bounds several spaces."
    )
    height: Length | None = Field(
        None,
        description="Fill only up to this height above the lowest point, against gravity [m], > 0; without count, mass and "
        "solid_fraction to a solid fraction of 0.55, as in a poured bed.",
    )
    count: Annotated[int, Field(strict=True, ge=1)] | None = Field(
        None, description="Number of grains [-], >= 1; either this, mass or solid_fraction."
    )
    mass: Annotated[float, Quantity("kg", gt=0)] | None = Field(
        None, description="Total mass [kg], > 0, reached within half a grain; either this, count or solid_fraction."
    )
    solid_fraction: Annotated[float, Quantity("-", gt=0, le=0.74)] | None = Field(
        None, description="Volume of the grains over filled volume [-], > 0 and <= 0.74; about 0.6 can be reached."
    )
    diameter: Diameter | None = Field(
        None, description="Diameter of the grains [m], > 0, or a distribution; not with clump, which has its size."
    )
    size: Factor | None = Field(
        None, description="With clump: factor on its lengths [-], > 0, or a distribution of it, default 1."
    )
    orientation: Orientation | None = Field(
        None,
        description='With clump: "random" (default), all directions alike; "aligned", its axes along the frame axes; or a '
        "quaternion (w, x, y, z) [-] from its axes to the frame axes, not 0. The last two before the clumps are pushed apart.",
    )
    seed: Whole = Field(0, description="Seed of the random numbers [-], >= 0, default 0: the same seed gives the same grains.")

    @field_validator("tile")
    @classmethod
    def _known_suffix(cls, value: str | None) -> str | None:
        known = (*CHECKPOINT_SUFFIXES, *STATE_FILE_SUFFIXES)
        if value is not None and Path(value).suffix.lower() not in known:
            raise ValueError(f"must be a file ending in {', '.join(known)}")
        return value

    @model_validator(mode="after")
    def _keys_agree(self) -> "Fill":
        exactly_one(self, "wall", "tile", *VOLUMES)
        if self.tile is not None:
            stray = [key for key in OF_PACKING if getattr(self, key) is not None]
            if stray:
                reason = "belongs to a packing; the grains of a tile are those of its file"
                raise validation_error([((key,), getattr(self, key), reason) for key in stray])
            return self
        stray = [key for key in ("copies", "spacing") if getattr(self, key) != type(self).model_fields[key].default]
        if stray:
            raise validation_error([((key,), getattr(self, key), "belongs to a tile: name its file") for key in stray])
        if self.cylinder is not None and self.cylinder.length is None:
            raise validation_error([(("cylinder", "length"), None, "missing: a filling has an end")])
        amounts = ("count", "mass", "solid_fraction")
        if self.height is None or any(getattr(self, key) is not None for key in amounts):
            exactly_one(self, *amounts)
        if self.point is not None and self.wall is None:
            raise validation_error([(("point",), None, "selects a space of a wall; a region is filled completely")])
        if isinstance(self.orientation, tuple) and not any(self.orientation):
            raise validation_error([(("orientation",), self.orientation, "must not be zero")])
        if self.region is not None and self.wall is None:
            raise validation_error([(("region",), None, "clips the inside of a wall; else give the smaller region itself")])
        return self


def _id_array(value: Any) -> np.ndarray:
    rule = "must be a list of whole numbers from 0 to 2^63 - 1"
    if not isinstance(value, (list, tuple, np.ndarray)) or bool in set(map(type, value)):
        raise ValueError(rule)
    try:
        ids = np.asarray(value)
    except ValueError:
        # NumPy's error for rows of different length
        raise ValueError(rule) from None
    if ids.ndim != 1 or ids.size == 0 or ids.dtype.kind not in "iu" or ids.min() < 0 or ids.max() >= 2**63:
        raise ValueError(rule)
    values, counts = np.unique(ids, return_counts=True)
    if values.size < ids.size:
        raise ValueError(f"ids must be unique; {values[counts > 1][0]} is given {counts[counts > 1][0]} times")
    ids = ids.astype(np.int64)
    ids.flags.writeable = False
    return ids


class IdArray:
    """Annotation of grain ids: a read-only int64 array of unique numbers >= 0, shape (n,)."""

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: Any) -> Any:
        to_list = core_schema.plain_serializer_function_ser_schema(np.ndarray.tolist, when_used="json")
        return core_schema.no_info_plain_validator_function(_id_array, serialization=to_list)

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: Any, handler: Any) -> dict[str, Any]:
        return {"type": "array", "items": {"type": "integer", "minimum": 0}, "minItems": 1, "uniqueItems": True}


class Grains(SceneModel):
    """Grains of one material from exactly one source: positions, file or fill.

    The arrays are read-only float64 (ids int64). ``explicit_radii``, ``explicit_velocities`` and ``explicit_spins``
    give the arrays for ``positions`` with all defaults filled in.
    """

    name: Label | None = GROUP_NAME
    material: str = Field(description="Name of the material.")
    positions: Annotated[np.ndarray, Array(Quantity("m"), columns=3)] | None = Field(
        None, description="Centres [m], shape (n, 3); either this, file or fill."
    )
    radius: Length | None = Field(None, description="With positions: radius of all grains [m], > 0.")
    radii: Annotated[np.ndarray, Array(Quantity("m", gt=0))] | None = Field(
        None, description="With positions: radius of each grain [m], > 0, shape (n,)."
    )
    diameter: Length | None = Field(None, description="With positions: diameter of all grains [m], > 0.")
    diameters: Annotated[np.ndarray, Array(Quantity("m", gt=0))] | None = Field(
        None, description="With positions: diameter of each grain [m], > 0, shape (n,)."
    )
    velocities: Annotated[np.ndarray, Array(Quantity("m/s"), columns=3)] | None = Field(
        None, description="With positions: velocities [m/s], shape (n, 3), default 0."
    )
    spins: Annotated[np.ndarray, Array(Quantity("rad/s"), columns=3)] | None = Field(
        None, description="With positions: angular velocities [rad/s], shape (n, 3), default 0."
    )
    ids: Annotated[np.ndarray, IdArray] | None = Field(
        None, description="With positions: ids of the grains [-], whole numbers >= 0, all different, shape (n,)."
    )
    clump: str | None = Field(
        None,
        description="Name of the clump that each of the grains is; positions are then the centres of mass, velocities those of "
        "the centres. Default: grains are spheres.",
    )
    orientations: Annotated[np.ndarray, Array(Quantity("-"), columns=4)] | None = Field(
        None,
        description="With clump: quaternions (w, x, y, z) [-] from the axes of the clump to the frame axes, shape (n, 4), "
        "default (1, 0, 0, 0).",
    )
    sizes: Annotated[np.ndarray, Array(Quantity("-", gt=0))] | None = Field(
        None, description="With clump: factor on the lengths of the clump [-], > 0, shape (n,), default 1."
    )
    file: FileName | None = Field(
        None,
        description="State file (.npz, .csv or .vtp), relative to the scene file; either this, positions or fill. With clump: "
        "clumps_*.vtp of a run, of which those of the number of the clump are taken; of grains_*.vtp members are left out.",
    )
    fill: Fill | None = Field(
        None, description="Filling of a mesh wall or a region, or copies of a bed; either this, positions or file."
    )
    liquid_content: LiquidContent = LIQUID_CONTENT
    velocities_in: Literal["frame", "laboratory"] = Field(
        "frame", description='Axes that velocities and spins are relative to: "frame" (default) or "laboratory".'
    )

    @field_validator("file")
    @classmethod
    def _known_suffix(cls, value: str | None) -> str | None:
        if value is not None and Path(value).suffix.lower() not in STATE_FILE_SUFFIXES:
            raise ValueError(f"must be a file ending in {', '.join(STATE_FILE_SUFFIXES)}")
        return value

    @model_validator(mode="after")
    def _one_source(self) -> "Grains":
        exactly_one(self, "positions", "file", "fill")
        sizes = ("radius", "radii", "diameter", "diameters")
        self._check_clump(sizes)
        if self.positions is not None:
            if self.clump is None:
                exactly_one(self, *sizes)
            self._check_lengths(self.positions)
            return self
        stray = [
            key for key in (*sizes, "velocities", "spins", "ids", "orientations", "sizes") if getattr(self, key) is not None
        ]
        if stray:
            source = "file" if self.file is not None else "fill"
            reason = f"belongs to positions and cannot be given with {source}"
            raise validation_error([((key,), getattr(self, key), reason) for key in stray])
        return self

    def _check_clump(self, sizes: tuple[str, ...]) -> None:
        if self.clump is None:
            stray = [key for key in ("orientations", "sizes") if getattr(self, key) is not None]
            reason = "belongs to a clump: name it with clump"
        else:
            stray = [key for key in (*sizes, "ids") if getattr(self, key) is not None]
            reason = "cannot be given with clump: give positions, file or fill, and the sizes of clumps with sizes"
            if self.file is not None and Path(self.file).suffix.lower() != ".vtp":
                raise validation_error([(("file",), self.file, "clumps come from clumps_*.vtp of a run")])
        if stray:
            raise validation_error([((key,), getattr(self, key), reason) for key in stray])
        self._check_fill_of_clumps()
        if self.orientations is not None and not np.all(np.square(self.orientations).sum(axis=1) > 0.0):
            row = int(np.argmin(np.square(self.orientations).sum(axis=1) > 0.0))
            raise validation_error([(("orientations", row), None, "must not be zero")])

    def _check_fill_of_clumps(self) -> None:
        if self.fill is None:
            return
        if self.fill.tile is not None:
            if self.clump is not None:
                raise validation_error([(("clump",), self.clump, "cannot be given with fill.tile, whose grains are spheres")])
            return
        if self.clump is None:
            stray = [key for key in ("size", "orientation") if getattr(self.fill, key) is not None]
            reason = "belongs to a clump: name it with clump beside fill"
            if self.fill.diameter is None:
                raise validation_error([(("fill", "diameter"), None, "missing: give the diameter of the grains, or a clump")])
        else:
            stray = [key for key in ("diameter",) if getattr(self.fill, key) is not None]
            reason = "cannot be given with clump: the clump has its size, and fill.size is a factor on it"
        if stray:
            raise validation_error([(("fill", key), getattr(self.fill, key), reason) for key in stray])

    def _check_lengths(self, positions: np.ndarray) -> None:
        count = len(positions)
        for key in ("radii", "diameters", "velocities", "spins", "ids", "orientations", "sizes"):
            values = getattr(self, key)
            if values is not None and len(values) != count:
                reason = f"must have as many entries as positions ({count}), has {len(values)}"
                raise validation_error([((key,), values, reason)])

    @property
    def explicit_radii(self) -> np.ndarray:
        """Radii [m] of the grains given by ``positions``, shape (n,)."""
        if self.radii is not None:
            return np.array(self.radii)
        if self.diameters is not None:
            return np.asarray(0.5 * self.diameters)
        radius = 0.5 * self.diameter if self.diameter is not None else self.radius
        return np.full(0 if self.positions is None else len(self.positions), radius, dtype=float)

    @property
    def explicit_velocities(self) -> np.ndarray:
        """Velocities [m/s] of the grains given by ``positions``, shape (n, 3), zero by default."""
        return np.zeros_like(self.positions) if self.velocities is None else np.array(self.velocities)

    @property
    def explicit_spins(self) -> np.ndarray:
        """Angular velocities [rad/s] of the grains given by ``positions``, shape (n, 3), zero by default."""
        return np.zeros_like(self.positions) if self.spins is None else np.array(self.spins)

    def __eq__(self, other: object) -> bool:
        # pydantic compares field by field with ==, which gives an array for arrays
        return isinstance(other, Grains) and self.model_dump(mode="json") == other.model_dump(mode="json")

    __hash__ = None  # type: ignore[assignment]
