"""A scene: everything a run is told, validated, in SI units and immutable.

Positions, velocities and spins are in frame axes (the axes of ``Scene.frame``), velocities and spins relative to the
frame. Frame axes and laboratory axes coincide at time 0. A scene without a frame is inertial.
"""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import (
    AfterValidator,
    ConfigDict,
    Field,
    StrictBool,
    ValidationError,
    ValidationInfo,
    create_model,
    field_validator,
    model_validator,
)
from pydantic.json_schema import SkipJsonSchema

from warpdem.core.paths import Access
from warpdem.errors import SceneError
from warpdem.kernels.contact import columns
from warpdem.kernels.contact.columns import PairKey
from warpdem.scene import models
from warpdem.scene.base import (
    Direction,
    Duration,
    FileName,
    Label,
    Name,
    Point,
    Problem,
    SceneModel,
    Vec3,
    alike,
    exactly_one,
    none_twice,
    relocated,
    wrong,
)
from warpdem.scene.borders import Borders, Outlet
from warpdem.scene.grains import Grains, Stream
from warpdem.scene.measures import Measures
from warpdem.scene.messages import scene_error, unknown_key
from warpdem.scene.motion import Motions, Sampled, Standing
from warpdem.scene.start import NOT_IN_A_PHASE, Phase, Start, changed, place_in_phase
from warpdem.scene.units import Quantity, Vector
from warpdem.scene.wall_shapes import SHAPES, Cone, Cylinder, Plane, Shape, Sphere
from warpdem.usd.stage import USD_SUFFIXES

MESH_SUFFIXES = (".stl", ".obj", ".ply", *USD_SUFFIXES)


def _model_name(role: str, *others: str) -> Any:
    """Annotation of a model's name: a file of ``kernels/<role>/``, a file of the user, or one of ``others``."""
    known = [*models.model_names(role), *others]

    def check(name: str) -> str:
        if name not in known and not models.is_file(name):
            raise ValueError(models.allowed(role, *others) + models.nearest(name, known))
        return name

    schema = {"anyOf": [{"enum": known}, {"pattern": r"\.py$"}]}
    return Annotated[FileName, AfterValidator(check), Field(json_schema_extra=schema)]


def _refusal(name: str, known: Mapping[str, Any]) -> str | None:
    """Why a scene with this ``base`` and ``access`` may not load a model; None if it may."""
    return known.get("access", Access()).plugin_refusal(name, known.get("base", Path())) if models.is_file(name) else None


def _user_model(role: str, name: str, known: Mapping[str, Any]) -> ModuleType:
    """Module of a model that a scene with this ``base`` and ``access`` names.

    Raises:
        SceneError: the file of a user may not be loaded, or is no model of this role.
    """
    if refusal := _refusal(name, known):
        raise SceneError(refusal)
    return models.model(role, models.located(name, known.get("base", Path())))


def _own_pair_keys(known: Mapping[str, Any]) -> dict[str, PairKey] | None:
    """Keys of ``[[pairs]]`` that laws of the user declare; None if one of them cannot be loaded."""
    if "contact" not in known:
        return None
    named = [(role, getattr(known["contact"], role)) for role in models.LAWS]
    found: dict[str, PairKey] = {}
    for role, name in named:
        try:
            found |= columns.pair_keys(_user_model(role, name, known)) if models.is_file(name) else {}
        except SceneError:
            return None
    return found


class Material(SceneModel):
    """What grains or walls are made of."""

    density: Annotated[float, Quantity("kg/m3", gt=0)] = Field(description="Density [kg/m3], > 0.")
    young_modulus: Annotated[float, Quantity("Pa", gt=0)] = Field(description="Young's modulus [Pa], > 0.")
    poisson_ratio: Annotated[float, Quantity("-", gt=-1, le=0.5)] = Field(
        description="Poisson's ratio [-], > -1 and <= 0.5."
    )


class Contact(SceneModel):
    """Contact laws, the same for all contacts of grains with grains and walls."""

    normal: _model_name("normal") = Field(
        models.default("normal"), description=models.choices("normal", models.default("normal"))
    )
    tangential: _model_name("tangential", "none") = Field(
        models.default("tangential"), description=models.choices("tangential", models.default("tangential"), "none")
    )
    rolling: _model_name("rolling", "none") = Field("none", description=models.choices("rolling", "none", "none"))
    torsion: StrictBool = Field(
        False, description="Whether the rolling law also resists spin about the normal, default false."
    )

    @model_validator(mode="after")
    def _torsion_has_a_law(self) -> "Contact":
        if self.torsion and self.rolling == "none":
            reason = "needs a rolling law: set contact.rolling = " + " or ".join(
                f'"{name}"' for name in models.model_names("rolling")
            )
            raise wrong([(("torsion",), True, reason)])
        return self


class Pair(SceneModel):
    """Contact coefficients of two materials (or of one with itself), given once, in either order."""

    # keys of a law of the user's are checked once that is known, and unknown to the schema
    model_config = ConfigDict(extra="allow", json_schema_extra={"additionalProperties": False})

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

    @classmethod
    def with_keys(cls, keys: Mapping[str, PairKey]) -> "type[Pair]":
        """The same with the keys that contact laws declare."""
        fields: dict[str, Any] = {}
        for key, entry in keys.items():
            number = Annotated[float, models.quantity(entry)]
            fields[key] = (number if entry.default is not None else number | None, Field(entry.default, description=entry.text))
        return create_model("Pair", __base__=cls, __doc__=cls.__doc__, **fields)


if not TYPE_CHECKING:
    Pair = Pair.with_keys({key: entry for key, (entry, _) in models.pair_keys().items()})


class Turn(SceneModel):
    """A turn by an angle about an axis through the origin."""

    axis: Direction = Field(description="Direction of the axis [-], any length but zero; held as a unit vector.")
    angle: Annotated[float, Quantity("rad")] = Field(description="Angle [rad], by the right hand rule.")


class Wall(SceneModel):
    """Wall: the triangles of a mesh file, placed by scale, then rotate, then translate; or one analytic shape."""

    name: Name = Field(description="Name, one of a kind: letters, digits, _ and -.")
    material: str = Field(description="Name of the material.")
    mesh: FileName | None = Field(
        None,
        description="Mesh file (.stl, .obj, .ply, .usd, .usda, .usdc, .usdz), relative to the scene file; this or one shape. "
        "USD comes in metres with z upwards, whatever the stage's own units and upAxis.",
    )
    prim: Annotated[str, Field(pattern=r"^(/\S+)?$")] = Field(
        "",
        description='With a USD mesh: path of the prim whose surfaces are the wall, such as "/World/Drum"; not needed if the '
        "file holds one surface only.",
    )
    plane: Plane | None = Field(None, description="Infinite plane; this, mesh or another shape.")
    cylinder: Cylinder | None = Field(None, description="Cylinder; this, mesh or another shape.")
    cone: Cone | None = Field(None, description="Cone; this, mesh or another shape.")
    sphere: Sphere | None = Field(None, description="Sphere; this, mesh or another shape.")
    scale: Annotated[float, Quantity("-", gt=0)] = Field(
        1.0,
        description="Factor from the file's lengths to metres [-], > 0, default 1; 0.001 for a mesh in millimetres.",
    )
    translate: Point = Field((0.0, 0.0, 0.0), description="Shift of the mesh [m], after scale and rotate, default 0.")
    rotate: Turn | None = Field(None, description="Turn of the mesh about the origin, after scale, default none.")
    fixed_to: Literal["frame", "laboratory"] = Field(
        "frame", description='What the wall is fixed to: "frame" (default) or "laboratory".'
    )
    motion: Motions | None = Field(
        None,
        description="The wall's own motion relative to what it is fixed to: one, or a list, outermost first; default none.",
    )
    torque_about: Point | None = Field(
        None,
        description="Point that the torque on the wall refers to [m]: of the wall's body, given where it is at time 0, and "
        "moving with it. Default: origin of the wall's own rotation, else of the frame's if fixed to that, else (0, 0, 0).",
    )
    open: StrictBool = Field(
        False, description="Whether the mesh has borders on purpose; a closed mesh is required otherwise, default false."
    )

    @field_validator("mesh")
    @classmethod
    def _known_suffix(cls, value: str | None) -> str | None:
        if value is not None and Path(value).suffix.lower() not in MESH_SUFFIXES:
            raise ValueError(f"must be a file ending in {', '.join(MESH_SUFFIXES)}")
        return value

    @model_validator(mode="after")
    def _prim_is_of_usd(self) -> "Wall":
        if self.prim and self.mesh is not None and not self.mesh.lower().endswith(USD_SUFFIXES):
            raise wrong([(("prim",), self.prim, f"only for a mesh from USD, a file ending in {', '.join(USD_SUFFIXES)}")])
        return self

    @model_validator(mode="after")
    def _mesh_or_shape(self) -> "Wall":
        exactly_one(self, "mesh", *SHAPES)
        if self.mesh is None:
            pose = ("prim", "scale", "translate", "rotate", "open")
            stray = [key for key in pose if getattr(self, key) != Wall.model_fields[key].default]
            if stray:
                reason = "only for a mesh; a shape is placed by its own keys"
                raise wrong([((key,), getattr(self, key), reason) for key in stray])
        return self

    @property
    def shape(self) -> Shape | None:
        """The analytic shape; None for a mesh."""
        return next((shape for key in SHAPES if (shape := getattr(self, key)) is not None), None)


class Time(SceneModel):
    """Length and step of the run."""

    end: Duration = Field(
        description="End of the run [s], > 0; the run starts at 0 and ends with the first step at or after this time."
    )
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
            raise wrong([(("step",), self.step, f"must not be longer than time.end = {self.end:g} s")])
        return self


class ExternalField(SceneModel):
    """A force on every grain from outside: a model of ``kernels/field/`` or of the user, with its parameters."""

    model: _model_name("field") = Field(description='Field: "drag", "harmonic", "lorentz" or a .py file.')
    axes: Literal["laboratory", "frame"] = Field(
        "laboratory",
        description='Where the field is at rest: "laboratory" (default) or "frame" (velocities relative to the frame).',
    )
    parameters: dict[str, Any] = Field(
        {}, description="The field's parameters by name, as its file lists them: numbers or lists, SI or with units."
    )


class Observer(SceneModel):
    """A number read off each grain, and columns of history.csv made of it."""

    name: Name = Field(description="Name, one of a kind: letters, digits, _ and -.")
    model: _model_name("observer") = Field(description='Observer: "speed" or a .py file.')
    axes: Literal["laboratory", "frame"] = Field(
        "laboratory",
        description='Axes of positions, velocities and spins: "laboratory" (default) or "frame" (relative to the frame).',
    )
    parameters: dict[str, Any] = Field(
        {}, description="The observer's parameters by name, as its file lists them: numbers or lists, SI or with units."
    )
    reduce: Annotated[list[Literal["sum", "mean", "min", "max"]], Field(min_length=1)] = Field(
        ["mean"], description='Columns over all grains: "sum", "mean", "min", "max"; default mean.'
    )

    _no_column_twice = field_validator("reduce")(none_twice)


class Output(SceneModel):
    """What is written, and how often."""

    interval: Duration | None = Field(
        None, description="Time between two frames of the result [s], > 0, rounded to whole steps, default time.end / 50."
    )
    formats: list[Literal["vtk", "vtkhdf", "usd"]] = Field(
        ["vtk", "usd"],
        description='File formats of the frames: "vtk" (a file for each frame), "vtkhdf" (one file for ParaView), "usd"; '
        'default ["vtk", "usd"].',
    )
    wall_loads: StrictBool = Field(
        True,
        description="Whether the frames hold the loads on mesh walls and their triangles, default true; VTK then writes a wall "
        "at rest in every frame, not once: some 25 bytes per triangle. history.csv has those of whole walls in any case.",
    )
    contacts: StrictBool = Field(
        False,
        description="Whether the frames hold the contact network, lines with force, overlap and sliding, default false; needs "
        "the format vtk or vtkhdf.",
    )
    orientation: StrictBool = Field(
        False,
        description="Whether the run keeps how each grain is turned, and the frames hold it, default false.",
    )
    picture: StrictBool = Field(True, description="Whether a preview picture is drawn at the end, default true.")
    history_interval: Duration | None = Field(
        None,
        description="Time between two rows of history.csv [s], > 0, default interval / 4; every frame has a row of its time.",
    )
    checkpoint_interval: Duration | None = Field(
        None, description="Simulated time between two checkpoints [s], > 0, default none; see checkpoint_wall_time."
    )
    checkpoint_wall_time: Duration = Field(
        60.0, description="Wall time after which a checkpoint is written [s], > 0, default 60."
    )

    _no_format_twice = field_validator("formats")(none_twice)

    @model_validator(mode="after")
    def _contacts_have_a_format(self) -> "Output":
        if self.contacts and not {"vtk", "vtkhdf"} & set(self.formats):
            raise wrong([(("contacts",), True, 'only the formats "vtk" and "vtkhdf" hold contacts: add one to output.formats')])
        return self


class Engine(SceneModel):
    """How the run is computed; the physics does not depend on it."""

    skin: Annotated[float | Literal["auto"], Quantity("m", gt=0, auto=True)] = Field(
        "auto", description='Extra reach of the neighbour lists [m], > 0, or "auto" (default).'
    )
    integrator: Literal[
        "exact_drift", "velocity_verlet", "modified_verlet", "scovel", "explicit_euler", "rk2", "rk4", "lobatto"
    ] = Field("exact_drift", description='Time integrator: "exact_drift" (default), or one of the schemes to compare with.')
    precision: Literal["double", "mixed"] = Field(
        "double",
        description='Precision: "double" (default), or "mixed": law, forces and history of grain pairs in single precision.',
    )
    max_overlap: Annotated[float, Quantity("-", gt=0, le=1)] = Field(
        0.1,
        description="Overlap over the smaller radius, with a wall over the radius, at which a run stops itself and up to "
        "which it may start [-], > 0 and <= 1, default 0.1.",
    )
    guards: Literal["stop", "record"] = Field(
        "stop",
        description='What happens when a run becomes unstable: "stop" (default), or "record" to note it in the summary and go '
        "on, for studies of schemes that are meant to fail; a state that is not finite always stops.",
    )


class Scene(SceneModel):
    """A whole scene. From Python: ``Scene.model_validate({...})``; from a file: ``load_scene(path)``."""

    # first: the parts that name files of the user are checked against it
    base: SkipJsonSchema[Path] = Field(
        default_factory=Path.cwd, exclude=True, description="Folder that relative paths start from."
    )
    access: SkipJsonSchema[Access] = Field(
        Access(), exclude=True, description="Files that the scene may read and load as code, default any: Python code made it."
    )
    title: str = Field("", description="Title, for people.")
    gravity: Annotated[Vec3, Vector(Quantity("m/s2"))] = Field(
        (0.0, 0.0, -9.81), description="Gravity [m/s2] in laboratory axes, default (0, 0, -9.81)."
    )
    materials: dict[Label, Material] = Field(min_length=1, description="Materials by name.")
    contact: Contact = Field(Contact(), description="Contact laws.")
    pairs: list[Pair] = Field([], description="Contact coefficients, one entry for each two materials that can meet.")
    grains: list[Grains] = Field([], description="Groups of grains; at least one, if there are no streams.")
    walls: list[Wall] = Field([], description="Walls, default none.")
    frame: Motions | None = Field(
        None, description="Motion of the frame axes: one, or a list, outermost first; default none (inertial)."
    )
    fields: list[ExternalField] = Field([], description="External fields beside gravity, default none.")
    measures: Measures = Field(Measures(), description="What is measured while the run goes on, default nothing.")
    observers: list[Observer] = Field([], description="Numbers read off each grain for history.csv, default none.")
    borders: Borders | None = Field(None, description="Borders of the domain along the frame axes, default none.")
    outlets: list[Outlet] = Field([], description="Regions that take grains out of the run and count them, default none.")
    streams: list[Stream] = Field([], description="Grains that come in while the run goes on, default none.")
    start: Start | None = Field(None, description="Checkpoint of another run to start from, in place of grains; default none.")
    phases: list[Phase] = Field(
        [], description="Parts of the run, one after the other, each with its changes of the scene; default one, without any."
    )
    time: Time = Field(description="Length and step of the run, or of each phase.")
    output: Output = Field(Output(), description="What is written, and how often.")
    engine: Engine = Field(Engine(), description="How the run is computed.")
    source: SkipJsonSchema[str] = Field("<scene>", exclude=True, description="File name, for messages.")
    notes: SkipJsonSchema[tuple[str, ...]] = Field(
        (), exclude=True, description="What of the file is not taken into the scene, for people."
    )

    def resolve(self, path: str | Path) -> Path:
        """Path of a file that the scene names: relative ones start from ``base``, ~ is the home folder.

        Raises:
            SceneError: the scene may not read it; see ``warpdem.core.paths``.
        """
        if refusal := self.access.refusal(path, self.base):
            raise SceneError(f'{self.source}: "{path}" {refusal}')
        return self.base / Path(path).expanduser()

    def files(self) -> Iterator[tuple[tuple[str | int, ...], str]]:
        """Place and name of each file of data that the scene names; code is not among them."""
        yield from ((("walls", i, "mesh"), wall.mesh) for i, wall in enumerate(self.walls) if wall.mesh is not None)
        yield from ((("grains", i, "file"), group.file) for i, group in enumerate(self.grains) if group.file is not None)
        if self.start is not None:
            yield ("start", "checkpoint"), self.start.checkpoint
        moving = [(("frame",), self.frame), *((("walls", i, "motion"), wall.motion) for i, wall in enumerate(self.walls))]
        for place, motions in moving:
            for k, motion in enumerate(motions or ()):
                if isinstance(motion, Sampled):
                    yield (*place, *[k] * (len(motions) > 1), "usd"), motion.usd

    def later(self, time: float) -> "Scene":
        """The scene as it goes on from ``time`` [s] on: its motions have been going on, its streams are as much nearer."""

        def ahead(motions: tuple | None) -> tuple | None:
            return motions and tuple(
                m if isinstance(m, Standing) else m.model_copy(update={"elapsed": m.elapsed + time}) for m in motions
            )

        walls = [wall.model_copy(update={"motion": ahead(wall.motion)}) for wall in self.walls]
        streams = [
            stream.model_copy(update={"start": max(0.0, stream.start - time), "until": stream.until and stream.until - time})
            for stream in self.streams
            if stream.until is None or stream.until > time
        ]
        return self.model_copy(update={"frame": ahead(self.frame), "walls": walls, "streams": streams})

    def located(self, name: str) -> str:
        """Name of a model as ``models.model`` takes it: files of the user by their absolute path."""
        return models.located(name, self.base)

    @classmethod
    def model_validate(cls, obj: Any, **keys) -> "Scene":
        """The scene of nested tables; ``Scene(...)`` gives the same, with pydantic's own errors.

        Args:
            obj: The tables, as a scene file holds them.
            **keys: As pydantic's.

        Raises:
            SceneError: The scene is wrong; one message lists all problems.
        """
        try:
            return super().model_validate(obj, **keys)
        except ValidationError as error:
            source = obj.get("source", "<scene>") if isinstance(obj, Mapping) else "<scene>"
            raise scene_error(error, source, cls) from None

    @property
    def group_names(self) -> list[str]:
        """Name of the group of each entry of ``grains``, then of each of ``streams``; those without one by their key."""
        entries = [(f"grains[{k}]", entry) for k, entry in enumerate(self.grains)]
        entries += [(f"streams[{k}]", entry) for k, entry in enumerate(self.streams)]
        return [entry.name or key for key, entry in entries]

    @property
    def groups(self) -> list[str]:
        """Names of the groups of grains, in the order of their numbers."""
        return list(dict.fromkeys([*(self.start.groups if self.start else ()), *self.group_names]))

    def pair(self, first: str, second: str) -> Pair:
        """Coefficients of two materials, in either order.

        Raises:
            KeyError: the scene has none for them (they cannot meet).
        """
        for pair in self.pairs:
            if sorted(pair.materials) == sorted((first, second)):
                return pair
        raise KeyError((first, second))

    @field_validator("fields", "observers")
    @classmethod
    def _parameters_fit_their_models(cls, parts: list, info: ValidationInfo) -> list:
        checked, problems = [], []
        for i, part in enumerate(parts):
            try:
                module = _user_model({"fields": "field", "observers": "observer"}[info.field_name], part.model, info.data)
            except SceneError as error:
                problems.append(((i, "model"), part.model, str(error)))
                continue
            values, found = models.field_values(module, part.parameters)
            problems += [((i, "parameters", *place), value, text) for place, value, text in found]
            checked.append(part.model_copy(update={"parameters": values}))
        if problems:
            raise wrong(problems)
        return checked

    @field_validator("pairs")
    @classmethod
    def _keys_fit_the_laws(cls, pairs: list[Pair], info: ValidationInfo) -> list[Pair]:
        own = _own_pair_keys(info.data)
        if own is None:  # what is wrong with the law is said of the law
            return pairs
        checked, problems = [], []
        for i, pair in enumerate(pairs):
            given, values = pair.model_extra or {}, {}
            for key, value in given.items():
                if key not in own:
                    text = unknown_key(("pairs", i, key), cls, list(own))
                    problems.append(((i, key), value, text))
                    continue
                try:
                    values[key] = models.quantity(own[key]).validate(value)
                except ValueError as error:
                    problems.append(((i, key), value, str(error)))
            for key, entry in own.items():
                known = key in Pair.model_fields
                if entry.default is None and key not in given and not (known and getattr(pair, key) is not None):
                    problems.append(((i, key), None, f"missing: {entry.text}"))
                elif key not in given and not known:
                    values[key] = entry.default
            checked.append(pair.model_copy(update=values) if values else pair)
        if problems:
            raise wrong(problems)
        return checked

    @field_validator("contact")
    @classmethod
    def _laws_may_be_loaded(cls, contact: Contact, info: ValidationInfo) -> Contact:
        laws = {role: getattr(contact, role) for role in ("normal", "tangential", "rolling")}
        refused = [((role,), name, _refusal(name, info.data)) for role, name in laws.items() if _refusal(name, info.data)]
        if refused:
            raise wrong(refused)
        return contact

    @model_validator(mode="after")
    def _parts_agree(self) -> "Scene":
        problems = [*_name_problems(self), *_stream_problems(self)]
        problems += [*_pair_problems(self), *_law_problems(self), *_own_law_problems(self)]
        problems += _measure_problems(self)
        if problems:
            raise wrong(problems)
        return self

    @model_validator(mode="after")
    def _phases_stand(self) -> "Scene":
        data = self._tables() if self.phases else {}
        for k, phase in enumerate(self.phases):
            known = [key for key in Scene.model_fields if key not in NOT_IN_A_PHASE]
            unknown = [key for key in phase.changes if key not in known]
            if unknown:
                reason = "a phase cannot change this" if unknown[0] in Scene.model_fields else "unknown key"
                reason += models.nearest(unknown[0], known) or f"; known here: {', '.join(known)}"
                raise wrong([(("phases", k, unknown[0]), phase.changes[unknown[0]], reason)])
            there = [entry["name"] for key in ("walls", "outlets") for entry in data.get(key, [])]
            for name in phase.without:
                if name not in there:
                    reason = f"no such wall or outlet; there are {_quoted(there)}"
                    raise wrong([(("phases", k, "without"), name, reason)])
            data = changed(data, phase)
            try:
                self._phase(k, data)
            except ValidationError as error:
                raise relocated(error, lambda place: ("phases", k, *place_in_phase(place, data, phase))) from None  # noqa: B023
        return self

    def _tables(self) -> dict[str, Any]:
        """The tables of the scene that phases may change."""
        return self.model_dump(mode="json", exclude_unset=True, exclude={"grains", "start", "phases", "title"})

    def _phase(self, number: int, data: dict[str, Any]) -> "Scene":
        kept = {"base": self.base, "access": self.access, "source": self.source, "notes": self.notes}
        name = self.phases[number].name
        begin = {"grains": self.grains, "start": self.start} if number == 0 else {"start": {"checkpoint": "checkpoint.h5"}}
        return Scene(**{**data, **begin, **kept, "title": f"{self.title or self.source}: {name}"})

    def phase(self, number: int) -> "Scene":
        """The scene of one phase; all but the first start from a checkpoint that is still to be named."""
        data = self._tables()
        for phase in self.phases[: number + 1]:
            data = changed(data, phase)
        return self._phase(number, data)

    def continues(self, number: int) -> tuple[str, ...]:
        """What goes on in a phase as it was, since the phase does not give it: frame, streams, names of walls."""
        changes = self.phases[number].changes
        moved = [wall["name"] for wall in changes.get("walls", []) if {"motion", "fixed_to"} & wall.keys()]
        there = {wall.name for wall in self.phase(number - 1).walls}
        scene = self.phase(number)
        names = [key for key in ("frame", "streams") if key not in changes]
        return (*names, *(wall.name for wall in scene.walls if wall.name in there and wall.name not in moved))


def _quoted(names: Sequence[str]) -> str:
    return ", ".join(f'"{name}"' for name in names) or "none"


def _name_problems(scene: Scene) -> Iterator[Problem]:
    """Names that stand for nothing, names and ids given twice."""
    uses = [(("grains", i, "material"), grains.material) for i, grains in enumerate(scene.grains)]
    uses += [(("walls", i, "material"), wall.material) for i, wall in enumerate(scene.walls)]
    uses += [(("streams", i, "material"), stream.material) for i, stream in enumerate(scene.streams)]
    uses += [
        (("pairs", i, "materials", k), m) for i, pair in enumerate(scene.pairs) for k, m in enumerate(pair.materials)
    ]
    for loc, name in uses:
        if name not in scene.materials:
            yield loc, name, f"no such material; the scene has {_quoted(list(scene.materials))}"

    if not scene.grains and not scene.streams and scene.start is None:
        yield ("grains",), None, "missing: give at least one group of grains, a stream, or a start"
    if scene.grains and scene.start is not None:
        yield ("grains",), None, "cannot stand beside start, which brings the grains; streams may add others"
    for key in ("walls", "outlets", "observers", "phases"):
        names = [part.name for part in getattr(scene, key)]
        for i, name in enumerate(names):
            if name in names[:i]:
                yield (key, i, "name"), name, f"{key}[{names.index(name)}] has this name too: names must differ"
            elif key in ("walls", "phases") and alike(name) in map(alike, names[:i]):
                other = list(map(alike, names)).index(alike(name))
                reason = f'{key}[{other}] is "{names[other]}": names must differ in more than case, for files have them'
                yield (key, i, "name"), name, reason

    walls = [wall.name for wall in scene.walls]
    meshes = [wall.name for wall in scene.walls if wall.mesh is not None]
    first_group: dict[int, int] = {}
    for i, grains in enumerate(scene.grains):
        wall = grains.fill.wall if grains.fill is not None else None
        if wall is not None and wall not in meshes:
            reason = "is an analytic shape; only a mesh can be filled" if wall in walls else "no such wall"
            yield ("grains", i, "fill", "wall"), wall, f"{reason}; the scene's mesh walls: {_quoted(meshes)}"
        for number in grains.ids.tolist() if grains.ids is not None else []:
            if number in first_group:
                yield ("grains", i, "ids"), number, f"grains[{first_group[number]}] has this id too: ids must be unique"
                break
            first_group[number] = i


def _stream_problems(scene: Scene) -> Iterator[Problem]:
    """Streams whose grains would be taken out where they come in."""
    for i, stream in enumerate(scene.streams):
        for outlet in scene.outlets:
            sides = zip(stream.box.min, stream.box.max, outlet.box.min, outlet.box.max, strict=True)
            if all(low < high_out and low_out < high for low, high, low_out, high_out in sides):
                yield ("streams", i, "box"), None, f'meets the box of the outlet "{outlet.name}", which takes grains out'
        for k, axis in enumerate("xyz"):
            border = getattr(scene.borders, axis) if scene.borders else None
            if border is None:
                continue
            if border.min is not None and stream.box.min[k] < border.min:
                yield ("streams", i, "box", "min", k), stream.box.min[k], f"is beyond borders.{axis}.min = {border.min:g} m"
            if border.max is not None and stream.box.max[k] > border.max:
                yield ("streams", i, "box", "max", k), stream.box.max[k], f"is beyond borders.{axis}.max = {border.max:g} m"


def _pair_problems(scene: Scene) -> Iterator[Problem]:
    """Coefficients given twice, and missing ones of materials that can meet (grain-grain, grain-wall)."""
    given: dict[tuple[str, ...], int] = {}
    for i, pair in enumerate(scene.pairs):
        key = tuple(sorted(pair.materials))
        if key in given:
            yield ("pairs", i, "materials"), pair.materials, f"pairs[{given[key]}] is this pair too: give it once"
        given.setdefault(key, i)

    # in the order of the scene, without repeats; unknown names have been named already
    sources = [*scene.grains, *scene.streams]
    of_grains = [name for name in dict.fromkeys(g.material for g in sources) if name in scene.materials]
    of_walls = [name for name in dict.fromkeys(w.material for w in scene.walls) if name in scene.materials]
    meeting = [*itertools.combinations_with_replacement(of_grains, 2), *itertools.product(of_grains, of_walls)]
    missing = dict.fromkeys(key for a, b in meeting if (key := tuple(sorted((a, b)))) not in given)
    if missing:
        listed = "; ".join(f"materials = [{_quoted(key)}]" for key in missing)
        yield ("pairs",), None, f"no coefficients for materials that can meet: add [[pairs]] with {listed}"


def _measure_problems(scene: Scene) -> Iterator[Problem]:
    """Measures that the scheme cannot make, and names given twice."""
    for key in ("energy", "momentum"):
        if getattr(scene.measures, key) and scene.engine.integrator != "exact_drift":
            reason = f'only with engine.integrator = "exact_drift"; it is "{scene.engine.integrator}"'
            yield ("measures", key), True, reason
    stages = len(models.model("integrator", scene.engine.integrator).STAGES)
    if scene.measures.flow and stages > 1:
        yield ("measures", "flow"), None, f'not with engine.integrator = "{scene.engine.integrator}", whose steps have stages'
    for key in ("flow", "regions", "mixing"):
        names = [part.name for part in getattr(scene.measures, key)]
        for i, name in enumerate(names):
            if name in names[:i]:
                reason = f"measures.{key}[{names.index(name)}] has this name too: names must differ"
                yield ("measures", key, i, "name"), name, reason


def _choices(role: str) -> str:
    """The laws of a role, as a scene may name them."""
    return f"a {role} law, contact.{role} = " + " or ".join(f'"{name}"' for name in models.model_names(role))


def _law_problems(scene: Scene) -> Iterator[Problem]:
    """Coefficients without a law to use them, and laws without their coefficients."""
    contact = scene.contact
    for i, pair in enumerate(scene.pairs):

        def problem(key: str, text: str, i: int = i, pair: Pair = pair) -> Problem:
            return ("pairs", i, key), getattr(pair, key), text

        for key, (entry, laws) in models.pair_keys().items():
            if any(models.is_file(getattr(contact, role)) for role, _ in laws):
                continue  # a law of the user's may read any key
            role, name = next(((r, n) for r, n in laws if getattr(contact, r) == n), laws[0])
            reads, least = getattr(contact, role) == name, "> 0" if entry.positive else ">= 0"
            if reads and getattr(pair, key) is None:
                noun = key.replace("_", " ")
                yield problem(key, f'missing; contact.{role} = "{name}" needs a {noun} [{entry.unit}], {least}')
            elif not reads and getattr(pair, key) != entry.default:
                names = " or ".join(f'"{n}"' for _, n in laws)
                yield problem(key, f'only for contact.{role} = {names}; it is "{getattr(contact, role)}"')
        if contact.tangential == "none" and pair.friction > 0:
            yield problem("friction", f'contact.tangential = "none": set friction = 0 or choose {_choices("tangential")}')
        if contact.rolling == "none" and pair.rolling_friction > 0:
            reason = f'contact.rolling = "none": set rolling_friction = 0 or choose {_choices("rolling")}'
            yield problem("rolling_friction", reason)


def _own_law_problems(scene: Scene) -> Iterator[Problem]:
    """Files of the user that are no contact law, or that fail on the scene's coefficients."""
    for role in ("normal", "tangential", "rolling"):
        name = getattr(scene.contact, role)
        if not models.is_file(name):
            continue
        try:
            module = _user_model(role, name, {"base": scene.base, "access": scene.access})
        except SceneError as error:
            yield ("contact", role), name, str(error)
            continue
        for i, pair in enumerate(scene.pairs if role == "normal" else []):
            if not set(pair.materials) <= scene.materials.keys():
                continue  # named already
            try:
                numbers = np.array(module.coefficients(*(scene.materials[m] for m in pair.materials), pair), dtype=float)
            except Exception as error:  # whatever the user's function stumbles over
                yield ("pairs", i), None, f"coefficients of {name} fails for this pair: {type(error).__name__}: {error}"
                continue
            own = columns.own_coefficients(module).names
            if numbers.shape != (len(columns.OF_NORMAL_LAW) + len(own),) or not np.isfinite(numbers).all():
                wanted = f"four finite numbers and {', '.join(own)}" if own else "four finite numbers"
                reason = f"coefficients of {name} gives {numbers.tolist()}; {wanted} are needed"
                yield ("pairs", i), None, reason
