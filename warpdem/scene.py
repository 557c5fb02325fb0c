"""A scene: everything a run is told, validated, in SI units and immutable.

Positions, velocities and spins are in frame axes (the axes of ``Scene.frame``), velocities and spins relative to the
frame. Frame axes and laboratory axes coincide at angle 0, that is at time 0. A scene without a frame is inertial.
"""

import functools
import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    StrictBool,
    Tag,
    ValidationError,
    field_validator,
    model_validator,
)
from pydantic.json_schema import SkipJsonSchema
from pydantic_core import InitErrorDetails, PydanticCustomError, core_schema

from warpdem.units import Array, Quantity, Vector

STATE_FILE_SUFFIXES = (".npz", ".csv", ".vtp")

Vec3 = tuple[float, float, float]
Pair2 = tuple[float, float]
Name = Annotated[str, Field(pattern=r"^[\w-]+$")]
FileName = Annotated[str, BeforeValidator(lambda value: str(value) if isinstance(value, Path) else value)]
# strict: neither true, nor 5000.5, nor "5000" is a count
Whole = Annotated[int, Field(strict=True, ge=0)]


def _unit_vector(vector: Vec3) -> Vec3:
    norm = math.hypot(*vector)
    if norm == 0.0:
        raise ValueError("must not be the zero vector")
    # left alone when it is one already, so that a scene written out and read again keeps its bits
    return vector if abs(norm - 1.0) < 1e-15 else tuple(x / norm for x in vector)


Point = Annotated[Vec3, Vector(Quantity("m"))]
Direction = Annotated[Vec3, Vector(Quantity("-")), AfterValidator(_unit_vector)]
Length = Annotated[float, Quantity("m", gt=0)]
Duration = Annotated[float, Quantity("s", gt=0)]
AngularRate = Annotated[float, Quantity("rad/s")]


Problem = tuple[tuple[str | int, ...], Any, str]
"""Place (keys and list indices), value there, and what is wrong."""


class SceneModel(BaseModel):
    """Base of all parts of a scene: unknown keys are refused, values do not change."""

    model_config = ConfigDict(extra="forbid", frozen=True, arbitrary_types_allowed=True)


def _wrong(problems: Iterable[Problem]) -> ValidationError:
    """Error with the place of each problem, so that a message can name its key."""
    errors = [
        InitErrorDetails(type=PydanticCustomError("scene", "{reason}", {"reason": text}), loc=loc, input=value)
        for loc, value, text in problems
    ]
    return ValidationError.from_exception_data("Scene", errors)


def _exactly_one(model: SceneModel, *keys: str) -> None:
    """Refuse a part in which none or several of these keys are given."""
    given = [key for key in keys if getattr(model, key) is not None]
    if len(given) != 1:
        raise ValueError(f"give exactly one of {', '.join(keys)}; found {' and '.join(given) or 'none'}")


class Material(SceneModel):
    """What grains or walls are made of."""

    density: Annotated[float, Quantity("kg/m3", gt=0)] = Field(description="Density [kg/m3], > 0.")
    young_modulus: Annotated[float, Quantity("Pa", gt=0)] = Field(description="Young's modulus [Pa], > 0.")
    poisson_ratio: Annotated[float, Quantity("-", gt=-1, le=0.5)] = Field(
        description="Poisson's ratio [-], > -1 and <= 0.5."
    )


class Contact(SceneModel):
    """Contact laws, the same for all contacts of grains with grains and walls."""

    normal: Literal["hertz", "hooke"] = Field(
        "hertz", description='Normal law: "hertz" (from the moduli; default) or "hooke" (linear, stiffness per pair).'
    )
    tangential: Literal["mindlin", "mindlin_displacement", "none"] = Field(
        "mindlin",
        description='Tangential law: "mindlin" (force history; default), "mindlin_displacement" (displacement history) '
        'or "none".',
    )
    rolling: Literal["none", "constant", "spring"] = Field(
        "none", description='Rolling law: "none" (default), "constant" (directional torque) or "spring" (EPSD).'
    )
    torsion: StrictBool = Field(
        False, description="Whether the rolling law also resists spin about the normal, default false."
    )

    @model_validator(mode="after")
    def _torsion_has_a_law(self) -> "Contact":
        if self.torsion and self.rolling == "none":
            reason = 'needs a rolling law: set contact.rolling = "constant" or "spring"'
            raise _wrong([(("torsion",), True, reason)])
        return self


class Pair(SceneModel):
    """Contact coefficients of two materials (or of one with itself), given once, in either order."""

    materials: Annotated[list[str], Field(min_length=2, max_length=2)] = Field(
        description="Names of the two materials, in any order."
    )
    restitution: Annotated[float, Quantity("-", gt=0, le=1)] = Field(
        description="Coefficient of normal restitution [-], > 0 and <= 1."
    )
    friction: Annotated[float, Quantity("-", ge=0)] = Field(
        0.0, description="Coefficient of sliding friction [-], >= 0, default 0."
    )
    rolling_friction: Annotated[float, Quantity("-", ge=0)] = Field(
        0.0, description="Coefficient of rolling friction [-], >= 0, default 0."
    )
    stiffness: Annotated[float, Quantity("N/m", gt=0)] | None = Field(
        None, description='Normal stiffness [N/m], > 0; only with normal = "hooke", and required there.'
    )
    tangential_stiffness_ratio: Annotated[float, Quantity("-", gt=0)] = Field(
        2.0 / 7.0,
        description='Tangential over normal stiffness [-], > 0, default 2/7; only with normal = "hooke".',
    )
    rolling_damping: Annotated[float, Quantity("-", ge=0)] = Field(
        0.3, description='Damping of the rolling spring [-], >= 0, default 0.3; only with rolling = "spring".'
    )


class Box(SceneModel):
    """Box along the frame axes."""

    min: Point = Field(description="Lowest corner [m].")
    max: Point = Field(description="Highest corner [m], above min along each axis.")

    @model_validator(mode="after")
    def _has_inside(self) -> "Box":
        if not all(low < high for low, high in zip(self.min, self.max, strict=True)):
            raise _wrong([(("max",), self.max, f"must be above min = {list(self.min)} along each axis")])
        return self


class DiameterRange(SceneModel):
    """Distribution of diameters."""

    uniform: Annotated[Pair2, Vector(Quantity("m", gt=0), length=2)] = Field(
        description="Smallest and largest diameter [m], > 0; diameters are spread evenly between them."
    )

    @field_validator("uniform")
    @classmethod
    def _rises(cls, value: Pair2) -> Pair2:
        if value[0] > value[1]:
            raise ValueError("the first diameter must not be above the second")
        return value


# The tags steer validation and show up in the places of errors; "~" lets the messages leave them out.
Diameter = Annotated[
    Annotated[Length, Tag("~number")] | Annotated[DiameterRange, Tag("~range")],
    Discriminator(lambda value: "~range" if isinstance(value, (dict, DiameterRange)) else "~number"),
]
RateOrRamp = Annotated[
    Annotated[AngularRate, Tag("~number")]
    | Annotated[tuple[float, float], Vector(Quantity("rad/s"), length=2), Tag("~ramp")],
    Discriminator(lambda value: "~ramp" if isinstance(value, (list, tuple)) else "~number"),
]


class Fill(SceneModel):
    """Grains placed at random without overlap inside a mesh wall or a box, to a count or a share of the volume."""

    wall: str | None = Field(None, description="Name of the closed mesh wall to fill; this or box.")
    box: Box | None = Field(None, description="Box to fill; this or wall.")
    region: Box | None = Field(None, description="With wall: only the part of its inside that lies in this box.")
    count: Annotated[int, Field(strict=True, ge=1)] | None = Field(
        None, description="Number of grains [-], >= 1; this or solid_fraction."
    )
    solid_fraction: Annotated[float, Quantity("-", gt=0, le=0.74)] | None = Field(
        None, description="Volume of the grains over volume filled [-], > 0 and <= 0.74; this or count."
    )
    diameter: Diameter = Field(description="Diameter of the grains [m], > 0, or {uniform = [smallest, largest]}.")
    seed: Whole = Field(0, description="Start of the random numbers [-], >= 0, default 0: same seed, same grains.")

    @model_validator(mode="after")
    def _groups(self) -> "Fill":
        _exactly_one(self, "wall", "box")
        _exactly_one(self, "count", "solid_fraction")
        if self.region is not None and self.wall is None:
            raise _wrong([(("region",), None, "clips the inside of a wall; with box give the smaller box itself")])
        return self


def _id_array(value: Any) -> np.ndarray:
    wrong = "must be a list of whole numbers from 0 to 2^63 - 1"
    if not isinstance(value, (list, tuple, np.ndarray)) or bool in set(map(type, value)):
        raise ValueError(wrong)
    try:
        ids = np.asarray(value)
    except ValueError:
        # NumPy's word for rows of different length
        raise ValueError(wrong) from None
    if ids.ndim != 1 or ids.size == 0 or ids.dtype.kind not in "iu" or ids.min() < 0 or ids.max() >= 2**63:
        raise ValueError(wrong)
    values, counts = np.unique(ids, return_counts=True)
    if values.size < ids.size:
        raise ValueError(f"ids must be unique; {values[counts > 1][0]} comes {counts[counts > 1][0]} times")
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
    give the columns that belong to ``positions`` with all defaults filled in.
    """

    material: str = Field(description="Name of the material.")
    positions: Annotated[np.ndarray, Array(Quantity("m"), columns=3)] | None = Field(
        None, description="Centres [m], shape (n, 3); this, file or fill."
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
    file: FileName | None = Field(
        None, description="State file (.npz, .csv or .vtp), relative to the scene file; this, positions or fill."
    )
    fill: Fill | None = Field(None, description="Filling of a mesh wall or a box; this, positions or file.")
    velocities_in: Literal["frame", "laboratory"] = Field(
        "frame", description='What velocities and spins are relative to: "frame" (default) or "laboratory".'
    )

    @field_validator("file")
    @classmethod
    def _known_suffix(cls, value: str | None) -> str | None:
        if value is not None and Path(value).suffix.lower() not in STATE_FILE_SUFFIXES:
            raise ValueError(f"must be a file ending in {', '.join(STATE_FILE_SUFFIXES)}")
        return value

    @model_validator(mode="after")
    def _one_source(self) -> "Grains":
        _exactly_one(self, "positions", "file", "fill")
        sizes = ("radius", "radii", "diameter", "diameters")
        if self.positions is not None:
            _exactly_one(self, *sizes)
            self._check_lengths()
            return self
        stray = [key for key in (*sizes, "velocities", "spins", "ids") if getattr(self, key) is not None]
        if stray:
            source = "file" if self.file is not None else "fill"
            reason = f"belongs to positions and cannot stand beside {source}"
            raise _wrong([((key,), getattr(self, key), reason) for key in stray])
        return self

    def _check_lengths(self) -> None:
        count = len(self.positions)
        for key in ("radii", "diameters", "velocities", "spins", "ids"):
            values = getattr(self, key)
            if values is not None and len(values) != count:
                raise _wrong([((key,), values, f"must have as many entries as positions ({count}), has {len(values)}")])

    @property
    def explicit_radii(self) -> np.ndarray:
        """Radii [m] of the grains given by ``positions``, shape (n,)."""
        radius = 0.5 * self.diameter if self.diameter is not None else self.radius
        if radius is not None:
            return np.full(len(self.positions), radius)
        return np.array(self.radii) if self.radii is not None else 0.5 * self.diameters

    @property
    def explicit_velocities(self) -> np.ndarray:
        """Velocities [m/s] of the grains given by ``positions``, shape (n, 3), zero by default."""
        return np.zeros_like(self.positions) if self.velocities is None else np.array(self.velocities)

    @property
    def explicit_spins(self) -> np.ndarray:
        """Angular velocities [rad/s] of the grains given by ``positions``, shape (n, 3), zero by default."""
        return np.zeros_like(self.positions) if self.spins is None else np.array(self.spins)

    def __eq__(self, other: object) -> bool:
        # pydantic compares field by field with ==, which has no single answer for arrays
        return isinstance(other, Grains) and self.model_dump(mode="json") == other.model_dump(mode="json")

    __hash__ = None


class RateSegment(SceneModel):
    """One stretch of a rate schedule."""

    until: Duration | None = Field(
        None, description="End of the stretch [s], > 0 and rising; only the last may omit it and then holds for ever."
    )
    rate: RateOrRamp = Field(description="Angular rate [rad/s], or [start, end] of a linear ramp.")


@functools.lru_cache(maxsize=64)
def _pieces(schedule: tuple[RateSegment, ...]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Start [s], angle and rate there [rad], [rad/s], and acceleration [rad/s2] of each stretch, arrays (k,)."""
    pieces, start, angle = [], 0.0, 0.0
    for segment in schedule:
        first, last = segment.rate if isinstance(segment.rate, tuple) else (segment.rate, segment.rate)
        if segment.until is None:
            pieces.append((start, angle, first, 0.0))
            break
        length = segment.until - start
        pieces.append((start, angle, first, (last - first) / length))
        start, angle = segment.until, angle + 0.5 * (first + last) * length
    else:
        pieces.append((start, angle, 0.0, 0.0))
    return tuple(np.array(column) for column in zip(*pieces, strict=True))


class Rotation(SceneModel):
    """Turning about a fixed axis: a constant rate for ever, or a schedule of steps and linear ramps from time 0.

    After the last ``until`` of a schedule the rate is 0. The angle is 0 at time 0, is not wrapped, and counts positive
    by the right hand rule about the axis.
    """

    axis: Direction = Field(description="Direction of the axis [-], any length but zero; held as a unit vector.")
    origin: Point = Field((0.0, 0.0, 0.0), description="A point of the axis [m], default (0, 0, 0).")
    rate: AngularRate | None = Field(None, description="Constant angular rate [rad/s]; this or schedule.")
    schedule: Annotated[list[RateSegment], Field(min_length=1)] | None = Field(
        None, description="Stretches of constant or linearly changing rate, one after the other; this or rate."
    )

    @model_validator(mode="after")
    def _rate_or_schedule(self) -> "Rotation":
        _exactly_one(self, "rate", "schedule")
        end = 0.0
        for k, segment in enumerate(self.schedule or []):
            until = ("schedule", k, "until")
            if segment.until is None:
                if k + 1 < len(self.schedule):
                    raise _wrong([(until, None, "missing: only the last stretch may omit it")])
                if isinstance(segment.rate, tuple):
                    raise _wrong([(until, None, "missing: a ramp must end")])
            elif segment.until <= end:
                raise _wrong([(until, segment.until, f"must be later than {end:g} s, where the stretch before ends")])
            else:
                end = segment.until
        return self

    def angle(self, t: float | np.ndarray) -> float | np.ndarray:
        """Angle [rad] turned from time 0 to t [s], t >= 0; exact (the schedule is piecewise quadratic)."""
        if self.rate is not None:
            return self.rate * t
        (start, angle, rate, acceleration), k = self._piece_at(t)
        since = t - start[k]
        result = angle[k] + since * (rate[k] + 0.5 * acceleration[k] * since)
        return result if np.ndim(t) else float(result)

    def rate_at(self, t: float | np.ndarray) -> float | np.ndarray:
        """Angular rate [rad/s] at t [s], t >= 0; where it jumps, the value after the jump."""
        if self.rate is not None:
            return self.rate if np.ndim(t) == 0 else np.full(np.shape(t), self.rate)
        (start, _, rate, acceleration), k = self._piece_at(t)
        result = rate[k] + acceleration[k] * (t - start[k])
        return result if np.ndim(t) else float(result)

    def max_rate(self) -> float:
        """Largest magnitude [rad/s] that the rate ever takes."""
        rates = [self.rate] if self.rate is not None else [segment.rate for segment in self.schedule]
        return float(np.max(np.abs(np.hstack(rates))))

    def _piece_at(self, t: float | np.ndarray) -> tuple[tuple[np.ndarray, ...], Any]:
        pieces = _pieces(tuple(self.schedule))
        return pieces, np.maximum(np.searchsorted(pieces[0], t, side="right") - 1, 0)


class Plane(SceneModel):
    """Infinite plane; grains are on the side to which the normal points."""

    point: Point = Field(description="A point of the plane [m].")
    normal: Direction = Field(
        description="Direction towards the grains [-], any length but zero; held as a unit vector."
    )


class Turn(SceneModel):
    """A turn by an angle about an axis through the origin."""

    axis: Direction = Field(description="Direction of the axis [-], any length but zero; held as a unit vector.")
    angle: Annotated[float, Quantity("rad")] = Field(description="Angle [rad], by the right hand rule.")


class Wall(SceneModel):
    """Wall: the triangles of a mesh file, placed by scale, then rotate, then translate; or an infinite plane."""

    name: Name = Field(description="Name, one of a kind: letters, digits, _ and -.")
    material: str = Field(description="Name of the material.")
    mesh: FileName | None = Field(None, description="Mesh file (.stl), relative to the scene file; this or plane.")
    plane: Plane | None = Field(None, description="Infinite plane; this or mesh.")
    scale: Annotated[float, Quantity("-", gt=0)] = Field(
        1.0,
        description="Factor from the file's lengths to metres [-], > 0, default 1; 0.001 for a mesh in millimetres.",
    )
    translate: Point = Field((0.0, 0.0, 0.0), description="Shift of the mesh [m], after scale and rotate, default 0.")
    rotate: Turn | None = Field(None, description="Turn of the mesh about the origin, after scale, default none.")
    fixed_to: Literal["frame", "laboratory"] = Field(
        "frame", description='What the wall is fixed to: "frame" (default) or "laboratory".'
    )
    rotation: Rotation | None = Field(
        None, description="The wall's own turning relative to what it is fixed to, default none."
    )
    open: StrictBool = Field(
        False, description="Whether the mesh has borders on purpose; a closed mesh is required otherwise, default false."
    )

    @model_validator(mode="after")
    def _mesh_or_plane(self) -> "Wall":
        _exactly_one(self, "mesh", "plane")
        if self.plane is not None:
            pose = ("scale", "translate", "rotate", "open")
            stray = [key for key in pose if getattr(self, key) != Wall.model_fields[key].default]
            if stray:
                reason = "only for a mesh; a plane is placed by its point and normal"
                raise _wrong([((key,), getattr(self, key), reason) for key in stray])
        return self


class Time(SceneModel):
    """Length and step of the run."""

    end: Duration = Field(description="End of the run [s], > 0; it starts at 0.")
    step: Annotated[float | Literal["auto"], Quantity("s", gt=0, auto=True)] = Field(
        "auto", description='Time step [s], > 0, or "auto" (default): the largest that the stability limits allow.'
    )
    max_speed: Annotated[float, Quantity("m/s", gt=0)] | None = Field(
        None,
        description="Largest speed expected [m/s], > 0, for the automatic step; default: estimated from the scene.",
    )

    @model_validator(mode="after")
    def _step_fits(self) -> "Time":
        if self.step != "auto" and self.step > self.end:
            raise _wrong([(("step",), self.step, f"must not be longer than time.end = {self.end:g} s")])
        return self


class Output(SceneModel):
    """What is written, and how often."""

    interval: Duration | None = Field(
        None, description="Time between two frames of the result [s], > 0, default time.end / 50."
    )
    formats: list[Literal["vtk", "usd"]] = Field(
        ["vtk", "usd"], description='File formats of the frames: "vtk", "usd", default both.'
    )
    picture: StrictBool = Field(True, description="Whether a preview picture is drawn at the end, default true.")
    history_interval: Duration | None = Field(
        None, description="Time between two rows of history.csv [s], > 0, default interval / 4."
    )

    @field_validator("formats")
    @classmethod
    def _no_format_twice(cls, value: list[str]) -> list[str]:
        if len(set(value)) < len(value):
            raise ValueError("each format at most once")
        return value


class Engine(SceneModel):
    """How the run is computed; the physics does not depend on it."""

    skin: Annotated[float | Literal["auto"], Quantity("m", gt=0, auto=True)] = Field(
        "auto", description='Extra reach of the neighbour lists [m], > 0, or "auto" (default).'
    )
    integrator: Literal["exact_drift"] = Field("exact_drift", description='Time integrator: "exact_drift" (default).')
    precision: Literal["double"] = Field("double", description='Precision: "double" (default).')
    max_overlap: Annotated[float, Quantity("-", gt=0, le=1)] = Field(
        0.1,
        description="Overlap over the smaller radius at which a run stops itself [-], > 0 and <= 1, default 0.1.",
    )


class Scene(SceneModel):
    """A whole scene. From Python: ``Scene.model_validate({...})``; from a file: ``load_scene(path)``."""

    title: str = Field("", description="Title, for people.")
    gravity: Annotated[Vec3, Vector(Quantity("m/s2"))] = Field(
        (0.0, 0.0, -9.81), description="Gravity [m/s2] in laboratory axes, default (0, 0, -9.81)."
    )
    materials: dict[str, Material] = Field(min_length=1, description="Materials by name.")
    contact: Contact = Field(Contact(), description="Contact laws.")
    pairs: list[Pair] = Field([], description="Contact coefficients, one entry for each two materials that can meet.")
    grains: Annotated[list[Grains], Field(min_length=1)] = Field(description="Groups of grains, at least one.")
    walls: list[Wall] = Field([], description="Walls, default none.")
    frame: Rotation | None = Field(None, description="Turning of the frame axes, default none (inertial).")
    time: Time = Field(description="Length and step of the run.")
    output: Output = Field(Output(), description="What is written, and how often.")
    engine: Engine = Field(Engine(), description="How the run is computed.")
    base: SkipJsonSchema[Path] = Field(
        default_factory=Path.cwd, exclude=True, description="Folder that relative paths start from."
    )
    source: SkipJsonSchema[str] = Field("<scene>", exclude=True, description="File name, for messages.")

    def resolve(self, path: str | Path) -> Path:
        """Path of a file that the scene names: relative ones start from ``base``, ~ is the home folder."""
        return self.base / Path(path).expanduser()

    def pair(self, first: str, second: str) -> Pair:
        """Coefficients of two materials, in either order.

        Raises:
            KeyError: the scene has none for them (they cannot meet).
        """
        for pair in self.pairs:
            if sorted(pair.materials) == sorted((first, second)):
                return pair
        raise KeyError((first, second))

    @model_validator(mode="after")
    def _parts_agree(self) -> "Scene":
        problems = [*_name_problems(self), *_pair_problems(self), *_law_problems(self)]
        if problems:
            raise _wrong(problems)
        return self


def _quoted(names: Sequence[str]) -> str:
    return ", ".join(f'"{name}"' for name in names) or "none"


def _name_problems(scene: Scene) -> Iterator[Problem]:
    """Names that stand for nothing, names and ids given twice."""
    uses = [(("grains", i, "material"), grains.material) for i, grains in enumerate(scene.grains)]
    uses += [(("walls", i, "material"), wall.material) for i, wall in enumerate(scene.walls)]
    uses += [
        (("pairs", i, "materials", k), m) for i, pair in enumerate(scene.pairs) for k, m in enumerate(pair.materials)
    ]
    for loc, name in uses:
        if name not in scene.materials:
            yield loc, name, f"no such material; the scene has {_quoted(list(scene.materials))}"

    names = [wall.name for wall in scene.walls]
    for i, name in enumerate(names):
        if name in names[:i]:
            yield ("walls", i, "name"), name, f"walls[{names.index(name)}] has this name too: names must differ"

    meshes = [wall.name for wall in scene.walls if wall.mesh is not None]
    first_group: dict[int, int] = {}
    for i, grains in enumerate(scene.grains):
        wall = grains.fill.wall if grains.fill is not None else None
        if wall is not None and wall not in meshes:
            reason = "is a plane and has no inside" if wall in names else "no such wall"
            yield ("grains", i, "fill", "wall"), wall, f"{reason}; the scene's mesh walls: {_quoted(meshes)}"
        for number in grains.ids.tolist() if grains.ids is not None else []:
            if number in first_group:
                yield ("grains", i, "ids"), number, f"grains[{first_group[number]}] has this id too: ids must be unique"
                break
            first_group[number] = i


def _pair_problems(scene: Scene) -> Iterator[Problem]:
    """Coefficients given twice, and missing ones of materials that can meet (grain-grain, grain-wall)."""
    given: dict[tuple[str, ...], int] = {}
    for i, pair in enumerate(scene.pairs):
        key = tuple(sorted(pair.materials))
        if key in given:
            yield ("pairs", i, "materials"), pair.materials, f"pairs[{given[key]}] is this pair too: give it once"
        given.setdefault(key, i)

    # in the order of the scene, without repeats; unknown names have been named already
    of_grains = [name for name in dict.fromkeys(g.material for g in scene.grains) if name in scene.materials]
    of_walls = [name for name in dict.fromkeys(w.material for w in scene.walls) if name in scene.materials]
    meeting = [*itertools.combinations_with_replacement(of_grains, 2), *itertools.product(of_grains, of_walls)]
    missing = dict.fromkeys(key for a, b in meeting if (key := tuple(sorted((a, b)))) not in given)
    if missing:
        listed = "; ".join(f"materials = [{_quoted(key)}]" for key in missing)
        yield ("pairs",), None, f"no coefficients for materials that can meet: add [[pairs]] with {listed}"


def _law_problems(scene: Scene) -> Iterator[Problem]:
    """Coefficients without a law to use them, and laws without their coefficients."""
    contact = scene.contact
    for i, pair in enumerate(scene.pairs):

        def problem(key: str, text: str, i: int = i, pair: Pair = pair) -> Problem:
            return ("pairs", i, key), getattr(pair, key), text

        if contact.normal == "hooke" and pair.stiffness is None:
            yield problem("stiffness", 'missing; contact.normal = "hooke" needs a stiffness [N/m], > 0')
        if contact.normal != "hooke":
            for key in ("stiffness", "tangential_stiffness_ratio"):
                if getattr(pair, key) != Pair.model_fields[key].default:
                    yield problem(key, f'only for contact.normal = "hooke"; it is "{contact.normal}"')
        if contact.tangential == "none" and pair.friction > 0:
            yield problem("friction", 'contact.tangential = "none": set friction = 0 or choose a tangential law')
        if contact.rolling == "none" and pair.rolling_friction > 0:
            yield problem(
                "rolling_friction", 'contact.rolling = "none": set rolling_friction = 0 or choose a rolling law'
            )
        if contact.rolling != "spring" and pair.rolling_damping != Pair.model_fields["rolling_damping"].default:
            yield problem("rolling_damping", f'only for contact.rolling = "spring"; it is "{contact.rolling}"')
