"""A scene: the complete input of a run, validated, in SI units and immutable.

Positions, velocities and spins are in frame axes (the axes of ``Scene.frame``), velocities and spins relative to the
frame. Frame axes and laboratory axes coincide at time 0. A scene without a frame is inertial.
"""

import functools
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import (
    Field,
    ValidationError,
    ValidationInfo,
    ValidatorFunctionWrapHandler,
    field_validator,
    model_validator,
)
from pydantic.json_schema import SkipJsonSchema

from warpdem.core.access import Access
from warpdem.core.nearest import nearest
from warpdem.errors import SceneError
from warpdem.scene import models
from warpdem.scene.base import Label, Name, Problem, SceneModel, Vec3, relocated, validation_error
from warpdem.scene.borders import Borders
from warpdem.scene.checks import (
    Named,
    exits,
    grain_problems,
    material_problems,
    measure_problems,
    name_problems,
    quoted,
    region_problems,
    source_problems,
    stream_problems,
)
from warpdem.scene.clump_checks import clump_problems
from warpdem.scene.clumps import Clump
from warpdem.scene.contact import Contact, Material, Pair, unknown_keys, with_own_keys
from warpdem.scene.contact_checks import law_problems, own_law_problems, pair_problems
from warpdem.scene.fields import ExternalField, Observer
from warpdem.scene.grains import Grains
from warpdem.scene.liquid_checks import liquid_problems
from warpdem.scene.measures import Measures
from warpdem.scene.messages import scene_error
from warpdem.scene.model_names import plugin_refusal, user_model
from warpdem.scene.motion import FixedPlacement, Motions, Sampled
from warpdem.scene.parameters import field_values
from warpdem.scene.phases import NOT_IN_A_PHASE, Phase, changed, key_path_in_phase
from warpdem.scene.regions import MeshFile, Outlet, Placed
from warpdem.scene.settings import Engine, Output, Time
from warpdem.scene.start import Start
from warpdem.scene.streams import Stream
from warpdem.scene.units import Quantity, Vector
from warpdem.scene.walls import Wall


class Scene(SceneModel):
    """A complete scene. From Python: ``Scene.model_validate({...})``; from a file: ``load_scene(path)``."""

    # base and access come first: parts that name files of the user are checked against them
    base: SkipJsonSchema[Path] = Field(
        default_factory=Path.cwd, exclude=True, description="Folder that relative paths start from."
    )
    access: SkipJsonSchema[Access] = Field(
        Access(), exclude=True, description="Files that the scene may read and load as code, default any."
    )
    title: str = Field("", description="Title, for display.")
    gravity: Annotated[Vec3, Vector(Quantity("m/s2"))] = Field(
        (0.0, 0.0, -9.81), description="Gravity [m/s2] in laboratory axes, default (0, 0, -9.81)."
    )
    materials: dict[Label, Material] = Field(min_length=1, description="Materials by name.")
    contact: Contact = Field(Contact(), description="Contact laws.")
    pairs: list[Pair] = Field([], description="Contact coefficients, one entry for each pair of materials that can meet.")
    clumps: dict[Name, Clump] = Field({}, description="Rigid bodies of spheres by name, default none.")
    grains: list[Grains] = Field([], description="Groups of grains; at least one, if there are no streams.")
    walls: list[Wall] = Field([], description="Walls, default none.")
    frame: Motions | None = Field(
        None, description="Motion of the frame axes: one, or a list, outermost first; default none (inertial)."
    )
    fields: list[ExternalField] = Field([], description="External fields beside gravity, default none.")
    measures: Measures = Field(Measures(), description="Measurements during the run, default none.")
    observers: list[Observer] = Field([], description="Quantities of the grains for history.csv, default none.")
    borders: Borders | None = Field(None, description="Borders of the domain along the frame axes, default none.")
    outlets: list[Outlet] = Field([], description="Regions that remove grains and count them, default none.")
    streams: list[Stream] = Field([], description="Grains inserted during the run, default none.")
    start: Start | None = Field(None, description="Checkpoint of another run to start from, in place of grains; default none.")
    phases: list[Phase] = Field(
        [], description="Successive parts of the run, each with its changes of the scene; default one part without changes."
    )
    time: Time = Field(description="Length and step of the run, or of each phase.")
    output: Output = Field(Output(), validate_default=True, description="Output: what is written, and how often.")
    engine: Engine = Field(Engine(), description="Numerical settings of the run.")
    source: SkipJsonSchema[str] = Field("<scene>", exclude=True, description="File name, for messages.")
    notes: SkipJsonSchema[tuple[str, ...]] = Field(
        (), exclude=True, description="Notes on content of the file that the scene does not take over."
    )

    def __repr__(self) -> str:  # str() gives all keys
        parts = f"materials {', '.join(self.materials)}; walls {', '.join(wall.name for wall in self.walls) or 'none'}"
        return f"<Scene {self.title!r} of {self.source}: {parts}; {self.time.end:g} s>"

    def resolve(self, path: str | Path) -> Path:
        """Path of a file that the scene names: relative ones start from ``base``, ~ is the home folder.

        Raises:
            SceneError: The scene may not read it; see ``warpdem.core.access``.
        """
        if refusal := self.access.refusal(path, self.base):
            raise SceneError(f'{self.source}: "{path}" {refusal}')
        return self.base / Path(path).expanduser()

    def files(self) -> Iterator[tuple[tuple[str | int, ...], str]]:
        """Key path and name of each data file that the scene names; files of code are not among them."""
        yield from ((("walls", i, "mesh"), wall.mesh) for i, wall in enumerate(self.walls) if wall.mesh is not None)
        for name, clump in self.clumps.items():
            yield from ((("clumps", name, key), file) for key in ("file", "mesh") if (file := getattr(clump, key)) is not None)
        yield from ((("grains", i, "file"), group.file) for i, group in enumerate(self.grains) if group.file is not None)
        fills = [(("grains", i, "fill"), group.fill) for i, group in enumerate(self.grains) if group.fill is not None]
        yield from (((*key_path, "tile"), fill.tile) for key_path, fill in fills if fill.tile is not None)
        for key_path, region in (*self.regions(), *fills):
            for key in ("mesh", "face"):
                if isinstance(mesh := getattr(region, key, None), MeshFile):
                    yield (*key_path, key, "file"), mesh.file
        if self.start is not None:
            yield ("start", "checkpoint"), self.start.checkpoint
        moving = [(("frame",), self.frame), *((("walls", i, "motion"), wall.motion) for i, wall in enumerate(self.walls))]
        for key_path, motions in moving:
            for k, motion in enumerate(motions or ()):
                if isinstance(motion, Sampled):
                    yield (*key_path, *[k] * (len(motions or ()) > 1), "usd"), motion.usd

    def regions(self) -> Iterator[tuple[tuple[str | int, ...], Placed]]:
        """Key path and region of each part of the scene that has one."""
        yield from ((("outlets", i), outlet) for i, outlet in enumerate(self.outlets))
        yield from ((("streams", i), stream) for i, stream in enumerate(self.streams))
        for key in ("regions", "profiles"):
            yield from ((("measures", key, i), region) for i, region in enumerate(getattr(self.measures, key)))

    def later(self, time: float) -> "Scene":
        """The scene from ``time`` [s] on: its motions are ahead by this time, its streams start and end earlier by it."""

        def ahead(motions: Motions | None) -> Motions | None:
            return motions and tuple(
                m if isinstance(m, FixedPlacement) else m.model_copy(update={"elapsed": m.elapsed + time}) for m in motions
            )

        walls = [
            wall.model_copy(update={"motion": ahead(wall.motion), "servo": wall.servo and wall.servo.later(time),
                                    "free": wall.free and wall.free.later(time),
                                    "surface_velocity": wall.surface_velocity and wall.surface_velocity.later(time)})
            for wall in self.walls
        ]  # fmt: skip
        streams = [
            stream.later(time)
            for stream in self.streams
            if stream.until is None or stream.until > time
        ]
        return self.model_copy(update={"frame": ahead(self.frame), "walls": walls, "streams": streams})

    def located(self, name: str) -> str:
        """Name of a model for ``models.model``: a file of the user by its absolute path."""
        return models.located(name, self.base)

    @property
    def normal_law(self) -> str:
        """Name of the normal law for ``models.model``: with liquid bridges where the scene has a law of them."""
        normal, liquid = self.located(self.contact.normal), self.contact.liquid
        if liquid == "none":
            return normal
        viscous = any(getattr(pair, "viscosity", 0.0) > 0.0 for pair in self.pairs if pair.contact)
        return models.with_liquid(normal, self.located(liquid), viscous)

    @classmethod
    def model_validate(cls, obj: Any, **keys: Any) -> "Scene":
        """The scene of nested tables; ``Scene(...)`` does the same with pydantic's own errors.

        Args:
            obj: The tables of a scene file.
            **keys: As for pydantic.

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
        """Name of the group of each entry of ``grains``, then of each of ``streams``; an entry without a name has its key."""
        of_grains = [entry.name or f"grains[{k}]" for k, entry in enumerate(self.grains)]
        return [*of_grains, *(entry.name or f"streams[{k}]" for k, entry in enumerate(self.streams))]

    def stream_groups(self, number: int) -> list[str]:
        """Name of the group of each portion of a stream: its own, or that of the stream."""
        of_stream = self.group_names[len(self.grains) + number]
        return [portion.name or of_stream for portion in self.streams[number].portions]

    @property
    def groups(self) -> list[str]:
        """Names of the groups of grains, in the order of their numbers."""
        of_grains = self.group_names[: len(self.grains)]
        of_streams = [name for k in range(len(self.streams)) for name in self.stream_groups(k)]
        return list(dict.fromkeys([*(self.start.groups if self.start else ()), *of_grains, *of_streams]))

    @property
    def apart(self) -> np.ndarray:
        """Whether two materials pass through each other, by their numbers, shape (m, m), bool [-]."""
        names = list(self.materials)
        out = np.zeros((len(names), len(names)), dtype=bool)
        for pair in self.pairs:
            if not pair.contact:
                a, b = (names.index(name) for name in pair.materials)
                out[a, b] = out[b, a] = True
        return out

    def touched(self, kind: np.ndarray, wall: int) -> np.ndarray:
        """Whether grains of these materials (n,) touch wall number ``wall``, shape (n,), bool [-]."""
        touched: np.ndarray = ~self.apart[kind, list(self.materials).index(self.walls[wall].material)]
        return touched

    def pair(self, first: str, second: str) -> Pair:
        """Coefficients of two materials, in either order.

        Raises:
            KeyError: The scene has none for them (they cannot be in contact).
        """
        for pair in self.pairs:
            if sorted(pair.materials) == sorted((first, second)):
                return pair
        raise KeyError((first, second))

    @field_validator("fields", "observers")
    @classmethod
    def _parameters_fit_their_models(
        cls, parts: list[ExternalField | Observer], info: ValidationInfo
    ) -> list[ExternalField | Observer]:
        checked: list[ExternalField | Observer] = []
        problems: list[Problem] = []
        for i, part in enumerate(parts):
            try:
                module = user_model({"fields": "field", "observers": "observer"}[str(info.field_name)], part.model, info.data)
            except SceneError as error:
                problems.append(((i, "model"), part.model, str(error)))
                continue
            values, found = field_values(module, part.parameters)
            problems += [((i, "parameters", *key_path), value, text) for key_path, value, text in found]
            checked.append(part.model_copy(update={"parameters": values}))
        if problems:
            raise validation_error(problems)
        return checked

    @field_validator("pairs", mode="wrap")
    @classmethod
    def _keys_fit_the_laws(
        cls, given: object, handler: ValidatorFunctionWrapHandler, info: ValidationInfo
    ) -> list[Pair]:
        try:
            pairs = handler(given)
        except ValidationError as error:
            raise relocated(error, lambda path: path, unknown_keys(given, info.data, cls)) from None
        return with_own_keys(pairs, info.data, cls)

    @field_validator("contact")
    @classmethod
    def _laws_may_be_loaded(cls, contact: Contact, info: ValidationInfo) -> Contact:
        laws = {role: getattr(contact, role) for role in ("normal", "tangential", "rolling", "twisting", "liquid")}
        refused = [
            ((role,), name, refusal) for role, name in laws.items() if (refusal := plugin_refusal(name, info.data))
        ]
        if refused:
            raise validation_error(refused)
        return contact

    @model_validator(mode="after")
    def _parts_agree(self) -> "Scene":
        named: dict[str, Sequence[Named]] = {
            "walls": self.walls, "outlets": self.outlets, "observers": self.observers, "phases": self.phases
        }  # fmt: skip
        portions = [portion for stream in self.streams for portion in stream.portions]
        of_grains = [*(group.material for group in self.grains), *(portion.material for portion in portions)]
        of_walls = [wall.material for wall in self.walls]
        problems = [
            *material_problems(self._material_uses(), self.materials),
            *source_problems(self.grains, self.streams, self.start),
            *name_problems(named),
            *grain_problems(self.grains, self.walls),
            *region_problems(self.regions(), self.walls),
            *stream_problems(self.streams, self.outlets, self.borders),
            *pair_problems(self.pairs, self.materials, of_grains, of_walls),
            *law_problems(self.contact, self.pairs),
            *own_law_problems(self.contact, self.pairs, self.materials, {"base": self.base, "access": self.access}),
            *measure_problems(
                self.measures, self.engine.integrator, None if self.start else self.groups, list(self.materials),
                exits(self.borders, self.outlets),
            ),
            *clump_problems(self),
            *liquid_problems(self),
        ]
        if problems:
            raise validation_error(problems)
        return self

    def _material_uses(self) -> Iterator[tuple[tuple[str | int, ...], str]]:
        """Key path and name of each material that a part of the scene names."""
        for key in ("grains", "walls"):
            users: list[Grains | Wall] = getattr(self, key)
            yield from (((key, i, "material"), user.material) for i, user in enumerate(users))
        for i, stream in enumerate(self.streams):
            of_recipe = [("recipe", k) for k in range(len(stream.portions))] if stream.recipe is not None else [()]
            for path, portion in zip(of_recipe, stream.portions, strict=True):
                yield ("streams", i, *path, "material"), portion.material
        for i, pair in enumerate(self.pairs):
            yield from ((("pairs", i, "materials", k), name) for k, name in enumerate(pair.materials))

    @model_validator(mode="after")
    def _phases_are_valid(self) -> "Scene":
        data = self._tables() if self.phases else {}
        for k, phase in enumerate(self.phases):
            known = [key for key in Scene.model_fields if key not in NOT_IN_A_PHASE]
            unknown = [key for key in phase.changes if key not in known]
            if unknown:
                reason = "a phase cannot change this" if unknown[0] in Scene.model_fields else "unknown key"
                reason += nearest(unknown[0], known) or f"; known here: {', '.join(known)}"
                raise validation_error([(("phases", k, unknown[0]), phase.changes[unknown[0]], reason)])
            present = [entry["name"] for key in ("walls", "outlets") for entry in data.get(key, [])]
            for name in phase.without:
                if name not in present:
                    reason = f"no such wall or outlet; there are {quoted(present)}"
                    raise validation_error([(("phases", k, "without"), name, reason)])
            data = changed(data, phase)
            try:
                self._phase(k, data)
            except ValidationError as error:
                in_phase = functools.partial(key_path_in_phase, data=data, phase=phase)
                raise relocated(error, lambda key_path: ("phases", k, *in_phase(key_path))) from None  # noqa: B023
        return self

    def _tables(self) -> dict[str, Any]:
        """The tables of the scene that phases may change."""
        return self.model_dump(mode="json", exclude_unset=True, exclude={"grains", "start", "phases", "title"})

    def _phase(self, number: int, data: dict[str, Any]) -> "Scene":
        kept = {"base": self.base, "access": self.access, "source": self.source, "notes": self.notes}
        name = self.phases[number].name
        start = {"grains": self.grains, "start": self.start} if number == 0 else {"start": {"checkpoint": "checkpoint.h5"}}
        return Scene(**{**data, **start, **kept, "title": f"{self.title or self.source}: {name}"})

    def phase(self, number: int) -> "Scene":
        """The scene of one phase; all but the first start from a checkpoint whose path is set later."""
        data = self._tables()
        for phase in self.phases[: number + 1]:
            data = changed(data, phase)
        return self._phase(number, data)

    def continues(self, number: int) -> tuple[str, ...]:
        """Parts that continue in a phase unchanged, since the phase does not give them: frame, streams, names of walls."""
        changes = self.phases[number].changes
        moves = {"motion", "fixed_to", "surface_velocity", "servo", "free"}
        moved = [wall["name"] for wall in changes.get("walls", []) if moves & wall.keys()]
        before = {wall.name for wall in self.phase(number - 1).walls}
        scene = self.phase(number)
        names = [key for key in ("frame", "streams") if key not in changes]
        return (*names, *(wall.name for wall in scene.walls if wall.name in before and wall.name not in moved))
